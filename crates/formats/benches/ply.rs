//! Processor time for reading generated PLY meshes, and the numbers of a pbrt file, on one thread.
//!
//! `cargo bench --bench ply -- [triangles in millions, default 10]`
#![allow(clippy::print_stdout, missing_docs)]

use lumiris_formats::pbrt::lexer::Lexer;
use lumiris_formats::ply::read_ply;
use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::time::Instant;

/// Layout of a mesh in the file.
#[derive(Clone, Copy)]
enum Layout {
    /// Positions, and lists `uchar, int`.
    Plain,
    /// The same with normals, texture coordinates, and a number after each face.
    Full,
    /// As `Plain`, in big-endian byte order.
    BigEndian,
    /// As `Plain`, with quads instead of pairs of triangles.
    Quads,
    /// As `Plain`, as text.
    Ascii,
}

/// The header of a grid with the given numbers of cells and vertices, and the given property names.
fn header(layout: Layout, [cells, vertices]: [u32; 2], names: &[&str]) -> Result<String, std::fmt::Error> {
    let format = match layout {
        Layout::Plain | Layout::Full | Layout::Quads => "binary_little_endian",
        Layout::BigEndian => "binary_big_endian",
        Layout::Ascii => "ascii",
    };
    let faces = if matches!(layout, Layout::Quads) { cells } else { 2 * cells };
    let mut head = format!("ply\nformat {format} 1.0\nelement vertex {vertices}\n");
    for name in names {
        writeln!(head, "property float {name}")?;
    }
    writeln!(head, "element face {faces}\nproperty list uchar int vertex_indices")?;
    if matches!(layout, Layout::Full) {
        writeln!(head, "property int face_indices")?;
    }
    head.push_str("end_header\n");
    Ok(head)
}

/// A grid of 2·columns·rows triangles with a wave.
fn grid(layout: Layout, columns: u32, rows: u32) -> Result<Vec<u8>, std::fmt::Error> {
    let names: &[&str] =
        if matches!(layout, Layout::Full) { &["x", "y", "z", "nx", "ny", "nz", "u", "v"] } else { &["x", "y", "z"] };
    let counts = [columns * rows, (columns + 1) * (rows + 1)];
    let mut out = header(layout, counts, names)?.into_bytes();
    let mut text = String::new();
    for (y, x) in (0..=rows).flat_map(|y| (0..=columns).map(move |x| (y, x))) {
        let wave = (x as f32 * 0.1).sin();
        let row = [x as f32 * 0.01, y as f32 * 0.01, wave, 0.0, 0.0, 1.0, 0.5, 0.25];
        match layout {
            Layout::Ascii => {
                text.clear();
                writeln!(text, "{} {} {}", row[0], row[1], row[2])?;
                out.extend(text.as_bytes());
            }
            Layout::BigEndian => row[..3].iter().for_each(|c| out.extend(c.to_be_bytes())),
            Layout::Plain | Layout::Full | Layout::Quads => {
                row[..names.len()].iter().for_each(|c| out.extend(c.to_le_bytes()));
            }
        }
    }
    for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
        let a = y * (columns + 1) + x;
        let b = a + columns + 1;
        if matches!(layout, Layout::Quads) {
            out.push(4);
            [a, a + 1, b + 1, b].iter().for_each(|i| out.extend(i.to_le_bytes()));
            continue;
        }
        for t in [[a, a + 1, b + 1], [a, b + 1, b]] {
            match layout {
                Layout::Ascii => {
                    text.clear();
                    writeln!(text, "3 {} {} {}", t[0], t[1], t[2])?;
                    out.extend(text.as_bytes());
                    continue;
                }
                Layout::BigEndian => {
                    out.push(3);
                    t.iter().for_each(|i| out.extend(i.to_be_bytes()));
                }
                Layout::Plain | Layout::Full | Layout::Quads => {
                    out.push(3);
                    t.iter().for_each(|i| out.extend(i.to_le_bytes()));
                }
            }
            if matches!(layout, Layout::Full) {
                out.extend(a.to_le_bytes());
            }
        }
    }
    Ok(out)
}

/// Processor time of this thread (s), from the scheduler; wall-clock time if that is unavailable.
fn processor_seconds(start: Instant) -> f64 {
    let statistics = fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = statistics.and_then(|s| s.split(' ').next()?.parse::<f64>().ok());
    nanoseconds.map_or_else(|| start.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

fn measure(name: &str, path: &Path) -> Result<(), Box<dyn Error>> {
    let start = Instant::now();
    let megabytes = fs::metadata(path)?.len() as f64 * 1e-6;
    let (mut processor, mut wall, mut faces) = (f64::INFINITY, f64::INFINITY, 0);
    for _ in 0..5 {
        let (p, w) = (processor_seconds(start), start.elapsed().as_secs_f64());
        let mesh = read_ply(path)?;
        faces = mesh.triangles.len() + mesh.quads.len();
        processor = processor.min(processor_seconds(start) - p);
        wall = wall.min(start.elapsed().as_secs_f64() - w);
    }
    let rate = megabytes / processor;
    println!(
        "{name:<24} {faces:>9} faces {megabytes:>6.0} MB  cpu {processor:.3} s  wall {wall:.3} s  {rate:>5.0} MB/s"
    );
    Ok(())
}

/// Reads a list of `count` numbers in the notation of a pbrt file.
fn measure_pbrt(count: u32) -> Result<(), Box<dyn Error>> {
    let mut text = String::from("[");
    for i in 0..count {
        write!(text, " {}", (i as f32 * 0.1).sin() * 37.0)?;
    }
    text.push_str(" ]");
    let start = Instant::now();
    let (mut processor, mut numbers) = (f64::INFINITY, Vec::new());
    for _ in 0..5 {
        let before = processor_seconds(start);
        numbers.clear();
        let mut lexer = Lexer::new(text.as_bytes(), 0);
        lexer.next_token().map_err(|e| e.message)?;
        lexer.numbers_f32(&mut numbers).map_err(|e| e.message)?;
        processor = processor.min(processor_seconds(start) - before);
    }
    let (megabytes, count) = (text.len() as f64 * 1e-6, numbers.len());
    let rate = megabytes / processor;
    println!("{:<24} {count:>9} numbers {megabytes:>4.0} MB  cpu {processor:.3} s  {rate:>18.0} MB/s", "pbrt numbers");
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let millions = std::env::args().skip(1).find_map(|a| a.parse::<f64>().ok()).unwrap_or(10.0);
    let cells = (millions.clamp(0.01, 100.0) * 0.5e6).sqrt() as u32;
    let (columns, rows) = (cells * 5 / 4, cells * 4 / 5);
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("grid.ply");
    let cases = [
        ("little endian", Layout::Plain),
        ("big endian", Layout::BigEndian),
        ("normals, uv, face index", Layout::Full),
        ("quads", Layout::Quads),
        ("ascii", Layout::Ascii),
    ];
    for (name, layout) in cases {
        fs::write(&path, grid(layout, columns, rows)?)?;
        measure(name, &path)?;
    }
    let mut encoder = flate2::write::GzEncoder::new(fs::File::create(&path)?, flate2::Compression::fast());
    encoder.write_all(&grid(Layout::Plain, columns, rows)?)?;
    encoder.finish()?;
    measure("little endian, gzip", &path)?;
    measure_pbrt(3 * cells * cells)
}
