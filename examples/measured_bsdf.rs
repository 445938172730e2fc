//! Evaluates and samples a measured BSDF: `measured_bsdf FILE.bsdf < LINES`. Each line has wo, wi and two random
//! numbers, eight in all; the answer is f and the density of wi, and the direction sampled by the random numbers with
//! its f and density.

use lumiris::bsdfs::{Bsdf, Measured, MeasuredTables};
use lumiris_formats::bsdf_file::read_bsdf;
use lumiris_numbers::math::Vec3;
use std::error::Error;
use std::io::{Write, stdin, stdout};
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).ok_or("usage: measured_bsdf FILE.bsdf < LINES")?;
    let tables = MeasuredTables::new(read_bsdf(Path::new(&file))?)?;
    let bsdf = Bsdf::Measured(Measured { tables: &tables });
    let mut out = stdout().lock();
    for line in stdin().lines() {
        let line = line?;
        let numbers: Vec<f32> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        let [ox, oy, oz, ix, iy, iz, u, v] = numbers[..] else {
            return Err(format!("a line has 8 numbers: `{line}`").into());
        };
        let (wo, wi) = (Vec3::new(ox, oy, oz), Vec3::new(ix, iy, iz));
        let f = bsdf.f(wo, wi);
        write!(out, "{} {} {} {}", f.r, f.g, f.b, bsdf.pdf(wo, wi))?;
        match bsdf.sample_direction(wo, 0.5, [u, v]) {
            Some(s) => writeln!(out, " {} {} {} {} {} {} {}", s.wi.x, s.wi.y, s.wi.z, s.f.r, s.f.g, s.f.b, s.pdf)?,
            None => writeln!(out, " 0 0 0 0 0 0 0")?,
        }
    }
    Ok(())
}
