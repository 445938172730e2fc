//! Time and memory of loading a scene against its number of elements, for every reader and every kind of element.
//! Growth that is not linear shows in the last column. Inputs are written to a temporary folder; a separate process
//! loads each.
//!
//! `cargo bench --bench load -- [part of a name] [largest power of 10, 3 to 6, default 5]`
#![allow(clippy::print_stdout, missing_docs)]

use base64::Engine;
use lumiris::import::{LoadOptions, load};
use lumiris::scene::AccelKind;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// Smallest and largest power of 10.
const POWERS: (u32, u32) = (3, 6);

/// Writes an input of `n` elements into a folder, and returns the name of the scene file.
type Make = fn(usize, &Path) -> String;

/// Kinds of elements, with the largest power of 10 for each. (A folder of 10⁶ files takes longer to write than to
/// read.)
const CASES: &[(&str, u32, Make)] = &[
    ("gltf/nodes side by side", 6, |n, f| gltf(f, &Gltf { nodes: leaves(n, |_| 0), ..Gltf::of_mesh(n) })),
    ("gltf/nodes in a chain", 6, |n, f| gltf(f, &Gltf { nodes: chain(n), roots: "0".into(), ..Gltf::of_mesh(n) })),
    ("gltf/meshes", 6, |n, f| gltf(f, &Gltf { meshes: meshes(n, ""), nodes: leaves(n, |i| i), ..Gltf::of_mesh(n) })),
    ("gltf/primitives of one vertex buffer", 5, shared_vertices),
    ("gltf/materials", 6, |n, f| {
        let material = |i| format!(r#"{{"name":"part {i}","pbrMetallicRoughness":{{"metallicFactor":0.{i}}}}}"#);
        let own = Gltf { meshes: meshes(n, r#","material":INDEX"#), nodes: leaves(n, |i| i), ..Gltf::of_mesh(n) };
        gltf(f, &Gltf { rest: format!(r#","materials":[{}]"#, list(n, material)), ..own })
    }),
    ("gltf/accessors", 6, |n, f| {
        let accessor = |i| format!(r#"{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","name":"{i}"}}"#);
        gltf(f, &Gltf { accessors: list(n, accessor), ..Gltf::of_mesh(n) })
    }),
    ("gltf/textures of one image", 5, |n, f| gltf(f, &textured(n, 1))),
    ("gltf/images", 4, |n, f| gltf(f, &textured(n, n))),
    ("gltf/materials that emit one image", 5, |n, f| {
        let scene = textured(n, 1);
        let emitting = |i| format!(r#"{{"emissiveFactor":[1,1,1],"emissiveTexture":{{"index":{i}}}}}"#);
        let rest = scene.rest.replacen(&list(n, base_color), &list(n, emitting), 1);
        gltf(f, &Gltf { rest, ..scene })
    }),
    ("gltf/channels of an animation", 6, |n, f| {
        let channel = |i| format!(r#"{{"sampler":0,"target":{{"node":{i},"path":"translation"}}}}"#);
        let rest =
            format!(r#","animations":[{{"samplers":[{{"input":1,"output":0}}],"channels":[{}]}}]"#, list(n, channel));
        let times = r#",{"bufferView":1,"componentType":5126,"count":3,"type":"SCALAR"}"#;
        gltf(f, &Gltf { nodes: leaves(n, |_| 0), accessors: POSITIONS.to_owned() + times, rest, ..Gltf::of_mesh(n) })
    }),
    ("gltf/skins", 5, |n, f| gltf(f, &skinned(n, n))),
    ("gltf/joints of a skin", 6, |n, f| gltf(f, &skinned(n, 1))),
    ("gltf/weights of a mesh by node", 5, |n, f| {
        let node = |i| format!(r#"{{"mesh":0,"weights":[{i}]}}"#);
        let mesh = r#"{"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":0}]}]}"#;
        gltf(f, &Gltf { nodes: list(n, node), meshes: mesh.into(), ..Gltf::of_mesh(n) })
    }),
    ("gltf/cameras and lights", 5, |n, f| {
        let node = |i| format!(r#"{{"name":"{i}","camera":0,"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}}"#);
        let nodes = list(n, node) + r#",{"mesh":0}"#;
        let rest = r#","cameras":[{"type":"perspective","perspective":{"yfov":1}}],
            "extensions":{"KHR_lights_punctual":{"lights":[{"type":"point"}]}}"#;
        gltf(f, &Gltf { nodes, roots: list(n + 1, |i| i.to_string()), rest: rest.into(), ..Gltf::of_mesh(n) })
    }),
    ("pbrt/shapes", 6, |n, f| pbrt(f, n, |i| triangle(i) + "\n")),
    ("pbrt/spheres", 6, |n, f| pbrt(f, n, |i| format!("Shape \"sphere\" \"float radius\" {}\n", i + 1))),
    ("pbrt/attribute blocks", 6, |n, f| {
        pbrt(f, n, |i| format!("AttributeBegin Translate {i} 0 0 {} AttributeEnd\n", triangle(0)))
    }),
    ("pbrt/nested blocks", 3, |n, f| {
        pbrt_text(
            f,
            &("AttributeBegin Attribute \"shape\" \"float alpha\" 1\n".repeat(n)
                + &triangle(0)
                + &"\nAttributeEnd".repeat(n)),
        )
    }),
    ("pbrt/defaults of attributes", 5, |n, f| {
        pbrt(f, n, |i| format!("Attribute \"shape\" \"float alpha\" 1\n{}\n", triangle(i)))
    }),
    ("pbrt/named materials", 6, |n, f| {
        pbrt(f, n, |i| {
            format!("MakeNamedMaterial \"m{i}\" \"string type\" \"diffuse\"\nNamedMaterial \"m{i}\" {}\n", triangle(i))
        })
    }),
    ("pbrt/mixtures in a chain", 5, |n, f| {
        let mix = |i| {
            format!(
                "MakeNamedMaterial \"m{i}\" \"string type\" \"mix\" \"string materials\" [\"m{}\" \"m{n}\"]\n\
                 NamedMaterial \"m{i}\" {}\n",
                i + 1,
                triangle(i)
            )
        };
        let last = format!("MakeNamedMaterial \"m{n}\" \"string type\" \"diffuse\"\n");
        pbrt_text(f, &((0..n).map(mix).collect::<String>() + &last))
    }),
    ("pbrt/textures", 6, |n, f| {
        pbrt(f, n, |i| {
            format!(
                "Texture \"t{i}\" \"spectrum\" \"constant\" \"rgb value\" [.1 .2 .3]\n\
                 Material \"diffuse\" \"texture reflectance\" \"t{i}\" {}\n",
                triangle(i)
            )
        })
    }),
    ("pbrt/coordinate systems", 6, |n, f| {
        pbrt(f, n, |i| format!("CoordinateSystem \"c{i}\" CoordSysTransform \"c{i}\"\n"))
    }),
    ("pbrt/objects", 5, |n, f| {
        pbrt(f, n, |i| format!("ObjectBegin \"o{i}\" {} ObjectEnd\nObjectInstance \"o{i}\"\n", triangle(i)))
    }),
    ("pbrt/objects in a chain", 5, |n, f| {
        let first = format!("ObjectBegin \"o0\" {} ObjectEnd\n", triangle(0));
        let next = |i| format!("ObjectBegin \"o{}\" ObjectInstance \"o{i}\" ObjectEnd\n", i + 1);
        pbrt_text(f, &(first + &(0..n).map(next).collect::<String>() + &format!("ObjectInstance \"o{n}\"")))
    }),
    ("pbrt/instances", 6, |n, f| {
        let object = format!("ObjectBegin \"o\" {} ObjectEnd\n", triangle(0));
        let instance =
            |i| format!("AttributeBegin Translate {} {} 0 ObjectInstance \"o\" AttributeEnd\n", i % 1000, i / 1000);
        pbrt_text(f, &(object + &(0..n).map(instance).collect::<String>()))
    }),
    ("pbrt/included files", 4, |n, f| {
        for i in 0..n {
            write(f, &format!("{i}.pbrt"), triangle(i).as_bytes());
        }
        pbrt(f, n, |i| format!("Include \"{i}.pbrt\"\n"))
    }),
    ("pbrt/media", 5, |n, f| {
        pbrt(f, n, |i| {
            format!(
                "MakeNamedMedium \"m{i}\" \"string type\" \"homogeneous\" MediumInterface \"m{i}\" \"\" {}\n",
                triangle(i)
            )
        })
    }),
    ("pbrt/point lights", 5, |n, f| pbrt(f, n, |i| format!("LightSource \"point\" \"point3 from\" [{i} 0 1]\n"))),
    ("pbrt/light groups", 4, |n, f| {
        pbrt(f, n, |i| format!("LightSource \"point\" \"point3 from\" [{i} 0 1] \"string lightgroup\" \"g{i}\"\n"))
    }),
    ("pbrt/area lights", 6, |n, f| {
        pbrt(f, n, |i| format!("AttributeBegin AreaLightSource \"diffuse\" {} AttributeEnd\n", triangle(i)))
    }),
    ("pbrt/curves", 6, |n, f| {
        pbrt(f, n, |i| format!("Shape \"curve\" \"point3 P\" [{i} 0 0 {i} 1 0 {i} 2 0 {i} 3 1] \"float width\" .1\n"))
    }),
    ("pbrt/measured materials that are missing", 4, |n, f| {
        pbrt(f, n, |i| format!("Material \"measured\" \"string filename\" \"{i}.bsdf\" {}\n", triangle(i)))
    }),
    ("pbrt/images that are missing", 5, |n, f| {
        pbrt(f, n, |i| format!("Texture \"t{i}\" \"spectrum\" \"imagemap\" \"string filename\" \"{i}.png\"\n"))
    }),
    ("pbrt/emission images that are missing", 4, |n, f| {
        pbrt(f, n, |i| format!("AreaLightSource \"diffuse\" \"string filename\" \"{i}.png\" {}\n", triangle(i)))
    }),
    ("pbrt/materials that are unknown", 4, |n, f| {
        pbrt(f, n, |i| format!("MakeNamedMaterial \"a{i}\" NamedMaterial \"material of part {i}\" {}\n", triangle(i)))
    }),
    ("ply/ascii faces", 6, |n, f| ply(f, n, false)),
    ("ply/binary faces", 6, |n, f| ply(f, n, true)),
    ("ply/properties", 3, |n, f| {
        let properties: String = (0..n).map(|i| format!("property float p{i}\n")).collect();
        let header = ply_header("ascii", 3, 1).replacen("element face", &(properties + "element face"), 1);
        let row = |p: &str| p.to_owned() + &" 0".repeat(n) + "\n";
        ply_scene(f, &(header + &row("0 0 0") + &row("1 0 0") + &row("0 1 0") + "3 0 1 2\n").into_bytes())
    }),
    ("ply/files", 4, |n, f| {
        let text = ply_header("ascii", 3, 1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        for i in 0..n {
            write(f, &format!("{i}.ply"), text.as_bytes());
        }
        pbrt(f, n, |i| format!("Shape \"plymesh\" \"string filename\" \"{i}.ply\"\n"))
    }),
];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["--load", file] => load_once(Path::new(file)),
        [] => table("", 5),
        [name] => table(name, 5),
        [name, power, ..] => table(name, power.parse().expect("a power of 10")),
    }
}

/// Loads a file. Prints the times of import and of building the render job (s), and the peak memory.
fn load_once(file: &Path) {
    let start = Instant::now();
    let loaded =
        load(file, &LoadOptions { time: Some(1.0).filter(|_| file.ends_with("scene.gltf")), ..LoadOptions::default() });
    let load = start.elapsed().as_secs_f64();
    let job = loaded.ok().map(|loaded| loaded.job(AccelKind::Embree, None).expect("Embree builds the scene"));
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse::<u64>().ok());
    println!(
        "{load} {} {} {}",
        start.elapsed().as_secs_f64() - load,
        peak.unwrap_or(0) * 1024,
        u8::from(job.is_some())
    );
}

fn table(part: &str, largest: u32) {
    // Header
    println!(
        "| elements | {} bytes each | growth |",
        (POWERS.0..=largest).map(|p| format!("10^{p}: import + build (s) |")).collect::<String>()
    );
    println!("|---|{}---|---|", "---|".repeat((largest - POWERS.0 + 1) as usize));

    // One row per kind of element
    for (name, power, make) in CASES.iter().filter(|(name, ..)| name.contains(part)) {
        let powers = POWERS.0..=largest.min(*power);
        let runs: Vec<[f64; 4]> = powers.clone().map(|power| measured(10_usize.pow(power), *make)).collect();
        let time = |run: &[f64; 4]| run[0] + run[1];
        let cells: String = runs
            .iter()
            .map(|r| format!(" {:.3} + {:.3}{} |", r[0], r[1], if r[3] == 0.0 { " (errors)" } else { "" }))
            .collect();
        let empty = "|".repeat((largest + 1 - POWERS.0) as usize - runs.len());
        let (bytes, growth) = match runs[..] {
            [.., a, b] => {
                let elements = 0.9 * 10_f64.powi(*powers.end() as i32);
                (format!("{:.0}", (b[2] - a[2]) / elements), format!("{:.2}", (time(&b) / time(&a)).log10()))
            }
            _ => (String::new(), String::new()),
        };
        println!("| {name} |{cells}{empty} {bytes} | {growth} |");
    }
}

/// Times of import and build (s), peak memory (bytes), and 1 if the scene was loaded.
fn measured(n: usize, make: Make) -> [f64; 4] {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join(make(n, folder.path()));
    let program = std::env::current_exe().expect("the path of this program");
    let output = Command::new(program).arg("--load").arg(file).output().expect("this program runs");
    let text = String::from_utf8_lossy(&output.stdout);
    let mut numbers = text.split_whitespace().map(|word| word.parse().unwrap_or(f64::NAN));
    std::array::from_fn(|_| numbers.next().unwrap_or(f64::NAN))
}

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    std::fs::write(folder.join(name), bytes).expect("the temporary folder can be written");
}

fn list(n: usize, item: impl Fn(usize) -> String) -> String {
    (0..n).map(item).collect::<Vec<_>>().join(",")
}

/// The parts of a glTF document. Accessor 0 has the positions of a triangle.
struct Gltf {
    nodes: String,
    roots: String,
    meshes: String,
    accessors: String,
    /// Further members of the root, each after a comma.
    rest: String,
}

const POSITIONS: &str = r#"{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}"#;

impl Gltf {
    /// One mesh with one triangle, and `n` root nodes.
    fn of_mesh(n: usize) -> Self {
        let (roots, nodes) = (list(n, |i| i.to_string()), leaves(n, |_| 0));
        Gltf { nodes, roots, meshes: meshes(1, ""), accessors: POSITIONS.into(), rest: String::new() }
    }
}

fn leaves(n: usize, mesh: impl Fn(usize) -> usize) -> String {
    list(n, |i| format!(r#"{{"mesh":{},"translation":[{},{},0]}}"#, mesh(i), i % 1000, i / 1000))
}

fn chain(n: usize) -> String {
    let children = |i: usize| if i + 1 < n { format!(r#","children":[{}]"#, i + 1) } else { String::new() };
    list(n, |i| format!(r#"{{"mesh":0,"translation":[1,0,0]{}}}"#, children(i)))
}

fn meshes(n: usize, more: &str) -> String {
    list(n, |i| {
        format!(r#"{{"primitives":[{{"attributes":{{"POSITION":0}}{}}}]}}"#, more.replace("INDEX", &i.to_string()))
    })
}

fn gltf(folder: &Path, scene: &Gltf) -> String {
    let floats = [0.0_f32, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0, 2.0];
    let bytes: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
    let data = base64::engine::general_purpose::STANDARD.encode(bytes);
    let Gltf { nodes, roots, meshes, accessors, rest } = scene;
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[{roots}]}}],"nodes":[{nodes}],"meshes":[{meshes}],
        "accessors":[{accessors}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":12}}],
        "buffers":[{{"byteLength":48,"uri":"data:application/octet-stream;base64,{data}"}}]{rest}}}"#
    );
    write(folder, "scene.gltf", text.as_bytes());
    "scene.gltf".into()
}

/// A mesh of `n` primitives that share an accessor of 3n vertices.
fn shared_vertices(n: usize, folder: &Path) -> String {
    // Positions and indices
    let positions = (0..3 * n).flat_map(|v| [v as f32, (v % 3 % 2) as f32, (v % 3 / 2) as f32].map(f32::to_le_bytes));
    let bytes: Vec<u8> = positions.chain((0..3 * n as u32).map(u32::to_le_bytes)).flatten().collect();
    write(folder, "data.bin", &bytes);

    // Document
    let primitive = |i| format!(r#"{{"attributes":{{"POSITION":0}},"indices":{}}}"#, i + 1);
    let indices =
        |i| format!(r#"{{"bufferView":1,"byteOffset":{},"componentType":5125,"count":3,"type":"SCALAR"}}"#, 12 * i);
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3"}},{}],
        "bufferViews":[{{"buffer":0,"byteLength":{}}},{{"buffer":0,"byteOffset":{},"byteLength":{}}}],
        "buffers":[{{"byteLength":{},"uri":"data.bin"}}]}}"#,
        list(n, primitive),
        3 * n,
        list(n, indices),
        36 * n,
        36 * n,
        12 * n,
        bytes.len()
    );
    write(folder, "scene.gltf", text.as_bytes());
    "scene.gltf".into()
}

/// `n` materials with one texture each, using `images` images in total.
fn textured(n: usize, images: usize) -> Gltf {
    const PNG: &str =
        "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAIAAAD91JpzAAAAEklEQVR4nGP4z8DAAMIM/4EAAB/uBfsL2WiLAAAAAElFTkSuQmCC";
    let rest = format!(
        r#","materials":[{}],"textures":[{}],"images":[{}]"#,
        list(n, base_color),
        list(n, |i| format!(r#"{{"source":{}}}"#, i % images)),
        list(images, |_| format!(r#"{{"uri":"data:image/png;base64,{PNG}"}}"#))
    );
    Gltf { meshes: meshes(n, r#","material":INDEX"#), nodes: leaves(n, |i| i), rest, ..Gltf::of_mesh(n) }
}

fn base_color(texture: usize) -> String {
    format!(r#"{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":{texture}}}}}}}"#)
}

/// `skins` skins that divide all `n` nodes as joints, one mesh each.
fn skinned(n: usize, skins: usize) -> Gltf {
    let of_skin = n / skins;
    let skin = |s: usize| format!(r#"{{"joints":[{}]}}"#, list(of_skin, |i| (s * of_skin + i).to_string()));
    let node = |i| if i < skins { format!(r#"{{"mesh":0,"skin":{i}}}"#) } else { "{}".to_owned() };
    Gltf { nodes: list(n, node), rest: format!(r#","skins":[{}]"#, list(skins, skin)), ..Gltf::of_mesh(n) }
}

fn triangle(i: usize) -> String {
    let (x, y) = (i % 1000, i / 1000);
    format!("Shape \"trianglemesh\" \"point3 P\" [{x} {y} 0 {x}.5 {y} 0 {x} {y}.5 0] \"integer indices\" [0 1 2]")
}

fn pbrt(folder: &Path, n: usize, element: impl Fn(usize) -> String) -> String {
    let mut text = String::new();
    (0..n).for_each(|i| text.write_str(&element(i)).expect("strings can be written to"));
    pbrt_text(folder, &text)
}

fn pbrt_text(folder: &Path, world: &str) -> String {
    let text = format!("Camera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\n{}\n{world}", triangle(0));
    write(folder, "scene.pbrt", text.as_bytes());
    "scene.pbrt".into()
}

fn ply_scene(folder: &Path, bytes: &[u8]) -> String {
    write(folder, "mesh.ply", bytes);
    pbrt_text(folder, "Shape \"plymesh\" \"string filename\" \"mesh.ply\"")
}

fn ply_header(format: &str, vertices: usize, faces: usize) -> String {
    format!(
        "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

/// A mesh of `n` triangles and `n` vertices.
fn ply(folder: &Path, n: usize, binary: bool) -> String {
    let format = if binary { "binary_little_endian" } else { "ascii" };
    let mut bytes = ply_header(format, n, n).into_bytes();
    let point = |i: usize| [(i % 1000) as f32, (i / 1000) as f32, (i % 7) as f32];
    let face = |i: usize| [i, (i + 1) % n, (i + 1000) % n];
    if binary {
        bytes.extend((0..n).flat_map(|i| point(i).map(f32::to_le_bytes)).flatten());
        (0..n).for_each(|i| {
            bytes.push(3);
            bytes.extend(face(i).iter().flat_map(|&v| (v as u32).to_le_bytes()));
        });
    } else {
        let text = |words: [String; 3]| words.join(" ");
        bytes.extend((0..n).flat_map(|i| (text(point(i).map(|x| x.to_string())) + "\n").into_bytes()));
        bytes.extend((0..n).flat_map(|i| (format!("3 {}\n", text(face(i).map(|v| v.to_string())))).into_bytes()));
    }
    ply_scene(folder, &bytes)
}
