//! Where the scenes of the figures are.

use super::super::{Options, ReproduceError, make_folder, write_file};
use crate::imaging::oiio::{Part, write_image};
use crate::math::Vec3;
use crate::math::sphere_map::equal_area_square_to_sphere;
use std::path::PathBuf;

/// A statue under a sky and two lights, and with either alone.
#[derive(Clone, Debug)]
pub struct Scenes {
    folder: PathBuf,
}

/// Which of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Which {
    /// Sky.
    Environment,
    /// Two area lights.
    Lights,
    /// Both.
    Both,
}

impl Scenes {
    /// Makes the scenes inside the folder of the page, unless the options name others.
    pub fn new(options: &Options) -> Result<Self, ReproduceError> {
        if let Some(folder) = &options.scenes {
            return Ok(Scenes { folder: folder.clone() });
        }
        let folder = options.out.join("scenes");
        make_folder(&folder)?;
        write_scenes(&folder)?;
        Ok(Scenes { folder })
    }

    /// The scene file.
    pub fn path(&self, which: Which) -> PathBuf {
        self.folder.join(match which {
            Which::Environment => "statue-env.pbrt",
            Which::Lights => "statue-lights.pbrt",
            Which::Both => "statue-env-lights.pbrt",
        })
    }
}

const HEAD: &str = "LookAt 0 1.6 -4.6  0 0.85 0  0 1 0\nCamera \"perspective\" \"float fov\" [ 34 ]\n\
    Integrator \"path\" \"integer maxdepth\" [ 1 ]\nFilm \"rgb\" \"integer xresolution\" [ 400 ] \"integer yresolution\" [ 400 ]\n\
    WorldBegin\n";
const ENVIRONMENT: &str = "LightSource \"infinite\" \"string filename\" \"sky.exr\"\n";
const LIGHTS: &str = "AttributeBegin\n  AreaLightSource \"diffuse\" \"rgb L\" [ 18 15 11 ]\n  Shape \"bilinearmesh\" \
    \"point3 P\" [ -2.4 3.2 -1.2  -1.4 3.2 -1.2  -2.4 3.2 -0.2  -1.4 3.2 -0.2 ]\nAttributeEnd\n\
    AttributeBegin\n  AreaLightSource \"diffuse\" \"rgb L\" [ 8 10 14 ]\n  Shape \"bilinearmesh\" \
    \"point3 P\" [ 1.6 2.6 -1  2.2 2.6 -1  1.6 2.6 -0.4  2.2 2.6 -0.4 ]\nAttributeEnd\n";
const STATUE: &str = "AttributeBegin\n  Material \"diffuse\" \"rgb reflectance\" [ 0.55 0.53 0.5 ]\n\
    Shape \"bilinearmesh\" \"point3 P\" [ -9 0 -9  9 0 -9  -9 0 9  9 0 9 ]\nAttributeEnd\n\
    Material \"coateddiffuse\" \"rgb reflectance\" [ 0.5 0.4 0.3 ] \"float roughness\" [ 0.3 ]\n";

/// Balls in a spiral around a column: something to throw shadows.
fn write_scenes(folder: &std::path::Path) -> Result<(), ReproduceError> {
    let mut balls = String::from(STATUE);
    for i in 0..60 {
        let (turn, height) = (i as f32 * 0.62, 0.08 + i as f32 * 0.03);
        let radius = 0.75 - 0.28 * height;
        let (x, z) = (radius * turn.cos(), radius * turn.sin());
        balls += &format!(
            "AttributeBegin Translate {x:.4} {height:.4} {z:.4} Shape \"sphere\" \"float radius\" [ 0.14 ] AttributeEnd\n"
        );
    }
    for (name, lights) in [("env", ENVIRONMENT), ("lights", LIGHTS), ("env-lights", &format!("{ENVIRONMENT}{LIGHTS}"))]
    {
        write_file(folder.join(format!("statue-{name}.pbrt")), &format!("{HEAD}{lights}{balls}"))?;
    }

    // A sky with a sun, as an equal-area map
    const N: usize = 128;
    let sun = Vec3::new(0.45, 0.7, -0.55).normalize();
    let mut data = Vec::with_capacity(N * N * 3);
    for i in 0..N * N {
        let w = equal_area_square_to_sphere([(i % N) as f32 / N as f32, (i / N) as f32 / N as f32].into());
        let glow = 400.0 * ((w.dot(sun) - 1.0) * 900.0).exp() + 1.5 * ((w.dot(sun) - 1.0) * 6.0).exp();
        let up = 0.25 + 0.25 * w.y.max(0.0);
        data.extend([glow + 0.5 * up, 0.9 * glow + 0.7 * up, 0.7 * glow + up]);
    }
    let channels = ["R", "G", "B"].map(str::to_owned).to_vec();
    write_image(&folder.join("sky.exr"), &[Part::linear(N, N, channels, data)])?;
    Ok(())
}
