//! A building of adjacent square rooms, closed by walls and a ceiling, with a door between neighbours and separate
//! lights in each. Of the many lights, only those of one room and a few of its neighbours are visible from a point.
//!
//! z is up. The walls of room (i, j) are centred at x = 4i and 4(i + 1), y = 4j and 4(j + 1) (m).

use lumiris_numbers::math::Vec3;
use lumiris_numbers::math::hash::{pcg4d, unit_f32};
use std::fmt::Write;

/// Distance of the centres of neighbouring walls (m).
pub const PITCH: f32 = 4.0;
/// Height of the rooms (m).
pub const HEIGHT: f32 = 2.6;
/// Half the thickness of a wall (m).
const HALF_WALL: f32 = 0.1;
/// Width and height of a door (m).
const DOOR: [f32; 2] = [0.95, 2.05];
/// Area of the lights of a room (m²), and their distance from the ceiling (m).
const LIGHT_AREA: f32 = 0.09;
const LIGHT_DROP: f32 = 0.02;
/// Radiance of a light whose strength is 1.
const RADIANCE: f32 = 150.0;
/// Purposes of the random numbers.
const DOORS: [u32; 2] = [0x64_6f_6f_72, 0x64_6f_6f_73];
const LIGHTS: u32 = 0x6c_69_67_68;
const FURNITURE: u32 = 0x63_68_61_69;

/// Parameters of the building.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Building {
    /// Rooms along each side.
    pub rooms: u32,
    /// Rows of lights in a room, and lights in a row.
    pub lights: u32,
    /// Seed of doors, lights and furniture.
    pub seed: u32,
}

impl Default for Building {
    fn default() -> Self {
        Building { rooms: 10, lights: 1, seed: 5 }
    }
}

impl Building {
    /// 10,000 lights: 50 × 50 rooms with four lights each, with the same total power as the light of the smaller
    /// building.
    pub fn with_many_lights() -> Self {
        Building { rooms: 50, lights: 2, ..Building::default() }
    }

    /// The room with the camera.
    pub fn seen(&self) -> [u32; 2] {
        [self.rooms / 2; 2].map(|r| r.saturating_sub(1))
    }

    /// True for the room with the camera and its neighbours.
    fn is_near(&self, [i, j]: [u32; 2]) -> bool {
        let [x, y] = self.seen();
        i.abs_diff(x) <= 1 && j.abs_diff(y) <= 1
    }

    /// A random number for each room and purpose.
    fn random(&self, room: [u32; 2], purpose: u32) -> [f32; 4] {
        pcg4d([room[0], room[1], purpose, self.seed]).map(unit_f32)
    }

    /// Centre of the door from a room in direction `axis` (0: +x, 1: +y), along the wall (m).
    fn door(&self, room: [u32; 2], axis: usize) -> f32 {
        let start = PITCH * room[1 - axis] as f32;
        let max = PITCH - 2.0 * HALF_WALL - DOOR[0] - 0.6;
        start + HALF_WALL + 0.3 + 0.5 * DOOR[0] + max * self.random(room, DOORS[axis])[0]
    }
}

/// Boxes as one triangle mesh.
#[derive(Default)]
struct Boxes {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

/// Corners of the sides of a box, counter-clockwise from outside. Bits 0, 1, 2 of k select the greater x, y, z of
/// corner k.
const SIDES: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

impl Boxes {
    fn push(&mut self, low: Vec3, high: Vec3) {
        let first = self.points.len() as u32;
        let corner = |k: u32| {
            let pick = |bit: u32, low: f32, high: f32| if k >> bit & 1 == 1 { high } else { low };
            Vec3::new(pick(0, low.x, high.x), pick(1, low.y, high.y), pick(2, low.z, high.z))
        };
        self.points.extend((0..8).map(corner));
        for side in SIDES {
            let [a, b, c, d] = side.map(|k| first + k);
            self.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }

    fn write(&self, out: &mut String) {
        out.push_str("Shape \"trianglemesh\" \"point3 P\" [\n");
        for corners in self.points.chunks(8) {
            let points: Vec<String> = corners.iter().map(|p| format!("{} {} {}", mm(p.x), mm(p.y), mm(p.z))).collect();
            let _ = writeln!(out, "  {}", points.join("  "));
        }
        out.push_str("] \"integer indices\" [\n");
        for triangles in self.triangles.chunks(12) {
            let corners: Vec<String> = triangles.iter().map(|t| format!("{} {} {}", t[0], t[1], t[2])).collect();
            let _ = writeln!(out, "  {}", corners.join("  "));
        }
        out.push_str("]\n");
    }
}

/// A length in the file, rounded to the millimetre.
fn mm(v: f32) -> f32 {
    (v * 1000.0).round() / 1000.0
}

/// The scene file.
pub fn building(b: &Building) -> String {
    let mut out = String::new();
    head(b, &mut out);
    walls(b, &mut out);
    furniture(b, &mut out);
    lights(b, &mut out);
    out
}

/// Comment, camera and materials.
fn head(b: &Building, out: &mut String) {
    // The camera faces a door of its room
    let [i, j] = b.seen().map(|r| PITCH * r as f32);
    let door = b.door(b.seen(), 0);

    // The file, with names by the number of lights
    let count = b.lights * b.lights;
    let name = if count == 1 { "rooms".to_owned() } else { format!("rooms-{}", b.rooms * b.rooms * count) };
    let lights = if count == 1 { "one light".to_owned() } else { format!("{count} lights") };
    let _ = write!(
        out,
        "# {0} × {0} closed rooms with {lights} in each, and a door between every two neighbours; after figures 1, 2 and 5 of\n\
         # [Keller and Wald 2000]. Written by `lumiris generate keller-wald`.\n\
         Scale -1 1 1\nLookAt {1} {2} 1.6   {3} {4} 1.05   0 0 1\n\
         Camera \"perspective\" \"float fov\" [ 62 ]\n\
         Film \"rgb\" \"integer xresolution\" [ 480 ] \"integer yresolution\" [ 360 ] \"string filename\" [ \"{name}.exr\" ]\n\
         Sampler \"zsobol\" \"integer pixelsamples\" [ 16 ]\n\
         PixelFilter \"gaussian\"\n\
         Integrator \"path\" \"integer maxdepth\" [ 8 ]\n\nWorldBegin\n\n\
         MakeNamedMaterial \"plaster\" \"string type\" [ \"diffuse\" ] \"rgb reflectance\" [ 0.68 0.66 0.62 ]\n\
         MakeNamedMaterial \"boards\" \"string type\" [ \"diffuse\" ] \"rgb reflectance\" [ 0.44 0.3 0.19 ]\n\
         MakeNamedMaterial \"wood\" \"string type\" [ \"diffuse\" ] \"rgb reflectance\" [ 0.36 0.2 0.1 ]\n\
         MakeNamedMaterial \"cloth\" \"string type\" [ \"diffuse\" ] \"rgb reflectance\" [ 0.16 0.26 0.46 ]\n\
         MakeNamedMaterial \"clay\" \"string type\" [ \"diffuse\" ] \"rgb reflectance\" [ 0.62 0.28 0.16 ]\n\n",
        b.rooms,
        mm(i + 0.35),
        mm(j + 0.45),
        mm(i + PITCH),
        mm(0.65 * door + 0.35 * (j + 0.6 * PITCH)),
    );
}

/// Floor, ceiling and walls. Walls extend through the whole building and intersect.
fn walls(b: &Building, out: &mut String) {
    let size = b.rooms as f32 * PITCH;
    let _ = write!(
        out,
        "# Floor, ceiling, walls\n\
         NamedMaterial \"boards\"\n\
         Shape \"bilinearmesh\" \"point3 P\" [ 0 0 0  {size} 0 0  0 {size} 0  {size} {size} 0 ]\n\
         NamedMaterial \"plaster\"\n\
         Shape \"bilinearmesh\" \"point3 P\" [ 0 0 {HEIGHT}  {size} 0 {HEIGHT}  0 {size} {HEIGHT}  {size} {size} {HEIGHT} ]\n"
    );
    let mut boxes = Boxes::default();
    for axis in 0..2 {
        for line in 0..=b.rooms {
            let at = PITCH * line as f32;
            // A piece of the wall from `a` to `c` along it, from `z` upwards
            let mut piece = |a: f32, c: f32, z: f32| {
                let (mut low, mut high) = (Vec3::new(at - HALF_WALL, a, z), Vec3::new(at + HALF_WALL, c, HEIGHT));
                if axis == 1 {
                    (low, high) = (Vec3::new(low.y, low.x, low.z), Vec3::new(high.y, high.x, high.z));
                }
                boxes.push(low, high);
            };
            let mut from = -HALF_WALL;
            if (1..b.rooms).contains(&line) {
                for along in 0..b.rooms {
                    let room = if axis == 0 { [line - 1, along] } else { [along, line - 1] };
                    let [left, right] = [-0.5, 0.5].map(|s| b.door(room, axis) + s * DOOR[0]);
                    piece(from, left, 0.0);
                    piece(left, right, DOOR[1]);
                    from = right;
                }
            }
            piece(from, size + HALF_WALL, 0.0);
        }
    }
    boxes.write(out);
}

/// A table with a ball, a chest and a stool in the room with the camera and its neighbours.
fn furniture(b: &Building, out: &mut String) {
    let (mut wood, mut cloth) = (Boxes::default(), Boxes::default());
    let mut balls = Vec::new();
    for j in 0..b.rooms {
        for i in (0..b.rooms).filter(|&i| b.is_near([i, j])) {
            let [u, v, w, s] = b.random([i, j], FURNITURE);
            let corner = Vec3::new(PITCH * i as f32, PITCH * j as f32, 0.0);

            // The table is in the centre, away from the doors
            let middle = corner + Vec3::new(1.9 + 0.3 * u, 1.9 + 0.3 * v, 0.0);
            let half = Vec3::new(0.38 + 0.1 * w, 0.38 + 0.1 * s, 0.0);
            wood.push(middle - half + Vec3::Z * 0.68, middle + half + Vec3::Z * 0.72);
            for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
                let leg = middle + Vec3::new(x * (half.x - 0.04), y * (half.y - 0.04), 0.0);
                wood.push(leg - Vec3::new(0.03, 0.03, 0.0), leg + Vec3::new(0.03, 0.03, 0.68));
            }
            balls.push((middle + Vec3::new(0.3 * u - 0.15, 0.3 * v - 0.15, 0.0), 0.13 + 0.06 * w));

            // The chest is in a corner, the stool beside the table
            let chest = corner + Vec3::new(PITCH - HALF_WALL - 0.4, PITCH - HALF_WALL - 0.3, 0.0);
            wood.push(chest, chest + Vec3::new(0.4, 0.3, 0.6 + 0.8 * s));
            let stool = middle + Vec3::new(0.62 + 0.2 * v, 0.2 - 0.4 * u, 0.0);
            cloth.push(stool - Vec3::new(0.17, 0.17, 0.0), stool + Vec3::new(0.17, 0.17, 0.45));
        }
    }
    out.push_str("\n# Tables, chests, stools and balls\nNamedMaterial \"wood\"\n");
    wood.write(out);
    out.push_str("NamedMaterial \"cloth\"\n");
    cloth.write(out);
    out.push_str("NamedMaterial \"clay\"\n");
    for (p, r) in balls {
        let _ = writeln!(
            out,
            "AttributeBegin  Translate {} {} {}  Shape \"sphere\" \"float radius\" [ {} ]  AttributeEnd",
            mm(p.x),
            mm(p.y),
            mm(0.72 + r),
            mm(r)
        );
    }
}

/// Squares below the ceilings. Rooms differ in the strength and colour temperature of their light; near the camera they
/// differ less, so that one exposure suits them.
fn lights(b: &Building, out: &mut String) {
    let edge = (LIGHT_AREA / (b.lights * b.lights) as f32).sqrt();
    let z = mm(HEIGHT - LIGHT_DROP);
    out.push_str("\n# Lights\nNamedMaterial \"plaster\"\n");
    for j in 0..b.rooms {
        for i in 0..b.rooms {
            let [strength, warmth, du, dv] = b.random([i, j], LIGHTS);
            let span = if b.is_near([i, j]) { 1.0 } else { 4.0 };
            let room = RADIANCE * ((strength - 0.5) * span).exp2();
            let color = Vec3::new(1.0, 0.8, 0.52).lerp(Vec3::new(0.66, 0.82, 1.05), warmth);
            for k in 0..b.lights * b.lights {
                // A grid over most of the ceiling; a single light is near the centre
                let at = |cell: u32, jitter: f32| match b.lights {
                    1 => PITCH * 0.5 + 0.8 * (jitter - 0.5),
                    n => PITCH * 0.5 + (PITCH - 1.0) * ((cell as f32 + 0.5) / n as f32 - 0.5),
                };
                let [own, ..] = b.random([i * b.lights + k % b.lights, j * b.lights + k / b.lights], LIGHTS + 1);
                let l = color * room * if b.lights == 1 { 1.0 } else { 0.5 + own };
                let x = PITCH * i as f32 + at(k % b.lights, du);
                let y = PITCH * j as f32 + at(k / b.lights, dv);
                let [x0, x1, y0, y1] = [x - 0.5 * edge, x + 0.5 * edge, y - 0.5 * edge, y + 0.5 * edge].map(mm);
                let _ = writeln!(
                    out,
                    "AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [ {:.1} {:.1} {:.1} ] Shape \"bilinearmesh\" \"point3 P\" \
                     [ {x0} {y0} {z}  {x0} {y1} {z}  {x1} {y0} {z}  {x1} {y1} {z} ] AttributeEnd",
                    l.x, l.y, l.z
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_room_has_its_lights_and_doors_stay_inside_their_walls() {
        for b in [Building::default(), Building::with_many_lights()] {
            let lights = building(&b).matches("AreaLightSource").count();
            assert_eq!(lights as u32, (b.rooms * b.lights).pow(2));
        }
        let b = Building::default();
        for room in (0..10).flat_map(|i| (0..10).map(move |j| [i, j])) {
            for axis in 0..2 {
                let start = PITCH * room[1 - axis] as f32;
                let [left, right] = [-0.5, 0.5].map(|s| b.door(room, axis) + s * DOOR[0] - start);
                assert!(left > HALF_WALL && right < PITCH - HALF_WALL, "{room:?}: {left} {right}");
            }
        }
    }

    #[test]
    fn sides_of_boxes_face_outwards() {
        let mut boxes = Boxes::default();
        boxes.push(Vec3::ZERO, Vec3::ONE);
        for t in &boxes.triangles {
            let [a, b, c] = t.map(|k| boxes.points[k as usize]);
            let middle = (a + b + c) / 3.0 - Vec3::splat(0.5);
            assert!((b - a).cross(c - a).dot(middle) > 0.0);
        }
    }
}
