//! The scene as text: cameras, materials, objects and their places.

use super::kinds::KINDS;
use super::leaves::LEAVES;
use super::patches::{PEBBLES, Placement, Planting};
use super::terrain::Terrain;
use lumiris_numbers::math::{Vec2, Vec3};
use std::io::{self, Write};

/// Side of the square in which waves repeat (m).
const WAVE_TILE: f32 = 12.0;

/// A view of the island.
pub(super) struct View {
    /// Name of the scene without `.pbrt`.
    pub(super) name: &'static str,
    eye: Vec3,
    target: Vec3,
    /// Field of view along the shorter side (degrees).
    fov: f32,
}

/// The point of the coast that `angle` (radians) shows from the middle, moved inland by `offset`, a fraction of the
/// side.
fn coast(terrain: &Terrain, angle: f32, offset: f32) -> Vec2 {
    let direction = Vec2::from_angle(angle) * terrain.side;
    let is_land = |&i: &u32| terrain.inland(direction * (i as f32 * 0.001)) > offset;
    direction * ((0..500).rev().find(is_land).unwrap_or(300) as f32 * 0.001)
}

/// The whole island from the air, and a part of its beach.
pub(super) fn views(terrain: &Terrain) -> [View; 2] {
    let side = terrain.side;
    let (eye, target) = (coast(terrain, -1.95, 0.003), coast(terrain, -1.95 + 80.0 / side, 0.012));
    let lift = |p: Vec2, above: f32| p.extend(terrain.height(p).max(0.0) + above);
    [
        View {
            name: "island",
            eye: Vec3::new(-0.25, -0.75, 0.16) * side,
            target: Vec3::new(0.0, 0.0, 0.01) * side,
            fov: 36.0,
        },
        View { name: "beach", eye: lift(eye, 1.7), target: lift(target, 2.5), fov: 45.0 },
    ]
}

/// The scene of a view.
pub(super) fn view_text(view: &View) -> String {
    let View { name, eye, target, fov } = view;
    format!(
        "# A generated island. `lumiris generate island` made the files of this folder.\n\
         LookAt {} {} {}   {} {} {}   0 0 1\n\
         Camera \"perspective\" \"float fov\" [ {fov} ]\n\
         Film \"rgb\" \"integer xresolution\" [ 640 ] \"integer yresolution\" [ 360 ] \
         \"string filename\" [ \"{name}.exr\" ]\n\
         Sampler \"zsobol\" \"integer pixelsamples\" [ 64 ]\n\
         Integrator \"path\" \"integer maxdepth\" [ 5 ]\n\n\
         WorldBegin\n\
         LightSource \"infinite\" \"string filename\" [ \"sky.exr\" ]\n\
         Include \"materials.pbrt\"\nInclude \"objects.pbrt\"\nInclude \"places.pbrt\"\n",
        eye.x, eye.y, eye.z, target.x, target.y, target.z
    )
}

/// Textures and materials, the ground and the water.
pub(super) fn material_text(terrain: &Terrain) -> String {
    // Maps, seen from above
    let (side, far) = (terrain.side, 40.0 * terrain.side);
    let scale = 1.0 / side;
    let map = |name: &str| {
        format!(
            "Texture \"{name}\" \"spectrum\" \"imagemap\" \"string filename\" [ \"{name}.png\" ] \
             \"string mapping\" [ \"planar\" ] \"string wrap\" [ \"clamp\" ]\n    \"vector3 v1\" [ {scale} 0 0 ] \
             \"vector3 v2\" [ 0 {scale} 0 ] \"float udelta\" [ 0.5 ] \"float vdelta\" [ 0.5 ]\n"
        )
    };
    let mut text = map("ground") + &map("water");

    // Materials, and the alpha textures of leaves
    text += "Texture \"grain\" \"float\" \"fbm\" \"integer octaves\" [ 6 ]\n\
             Texture \"grains\" \"float\" \"mix\" \"float tex1\" [ 0.75 ] \"float tex2\" [ 1 ] \
             \"texture amount\" [ \"grain\" ]\n\
             Texture \"soil\" \"spectrum\" \"scale\" \"texture tex\" [ \"ground\" ] \"texture scale\" [ \"grains\" ]\n\
             MakeNamedMaterial \"ground\" \"string type\" [ \"diffuse\" ] \"texture reflectance\" [ \"soil\" ]\n\
             MakeNamedMaterial \"water\" \"string type\" [ \"coateddiffuse\" ] \"texture reflectance\" [ \"water\" ]\n    \
             \"float roughness\" [ 0.03 ] \"float eta\" [ 1.33 ] \"string normalmap\" [ \"waves.png\" ]\n\
             MakeNamedMaterial \"wood\" \"string type\" [ \"diffuse\" ] \"rgb reflectance\" [ 0.16 0.12 0.085 ]\n";
    for leaf in LEAVES.map(|leaf| leaf.name()) {
        text += &format!("Texture \"{leaf}\" \"float\" \"imagemap\" \"string filename\" [ \"{leaf}.png\" ]\n");
    }

    // The ground, and water to the horizon
    let waves = far / WAVE_TILE;
    text + &format!(
        "\nNamedMaterial \"ground\"\nShape \"plymesh\" \"string filename\" [ \"terrain.ply\" ]\n\
         NamedMaterial \"water\"\nShape \"trianglemesh\" \"integer indices\" [ 0 1 2 0 2 3 ]\n    \
         \"point3 P\" [ -{far} -{far} 0  {far} -{far} 0  {far} {far} 0  -{far} {far} 0 ]\n    \
         \"point2 uv\" [ -{waves} -{waves}  {waves} -{waves}  {waves} {waves}  -{waves} {waves} ]\n"
    )
}

fn numbers(values: impl IntoIterator<Item = f32>) -> String {
    values.into_iter().map(|x| x.to_string()).collect::<Vec<_>>().join(" ")
}

/// Plants, pebbles and patches.
pub(super) fn write_objects(file: &mut dyn Write, planting: &Planting) -> io::Result<()> {
    // Plants
    for kind in &KINDS {
        let (name, [r, g, b]) = (kind.name, kind.color);
        let mesh = |part: &str| format!("Shape \"plymesh\" \"string filename\" [ \"{name}-{part}.ply\" ]");
        writeln!(file, "ObjectBegin \"{name}\"")?;
        if kind.has_wood() {
            writeln!(file, "NamedMaterial \"wood\"\n{}", mesh("wood"))?;
        }
        writeln!(
            file,
            "Material \"diffusetransmission\" \"rgb reflectance\" [ {} ]\n    \"rgb transmittance\" [ {} ]\n\
             {} \"texture alpha\" [ \"{}\" ]\nObjectEnd",
            numbers([r, g, b]),
            numbers([0.9 * r, 0.9 * g, 0.4 * b]),
            mesh("leaves"),
            kind.leaf.name()
        )?;
    }

    // Pebbles
    for i in 0..PEBBLES {
        let grey = 0.12 + 0.11 * i as f32;
        writeln!(
            file,
            "ObjectBegin \"pebble{i}\"\nMaterial \"diffuse\" \"rgb reflectance\" [ {} ]\n\
             Shape \"plymesh\" \"string filename\" [ \"pebble{i}.ply\" ]\nObjectEnd",
            numbers([grey, 0.93 * grey, 0.84 * grey])
        )?;
    }

    // Patches
    for patch in &planting.patches {
        writeln!(file, "ObjectBegin \"{}\"", patch.name)?;
        write_places(file, &patch.contents)?;
        writeln!(file, "ObjectEnd")?;
    }
    Ok(())
}

/// Instances with their transforms, to a tenth of a millimetre.
pub(super) fn write_places(file: &mut dyn Write, placements: &[Placement]) -> io::Result<()> {
    for Placement { object, transform } in placements {
        let columns = transform.to_cols_array_2d().map(|column| numbers(column.map(|x| (x * 1e4).round() / 1e4)));
        let [x, y, z, p] = columns;
        writeln!(file, "Transform [{x} 0 {y} 0 {z} 0 {p} 1]\nObjectInstance \"{object}\"")?;
    }
    Ok(())
}
