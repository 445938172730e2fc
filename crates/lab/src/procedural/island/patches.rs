//! Patches of plants and pebbles, and their places on the terrain.

use super::random::Stream;
use super::terrain::{Ground, Terrain};
use crate::procedural::gradient_noise::fractal;
use lumiris_numbers::math::{Affine3A, Mat3, Vec2, Vec3};
use rayon::prelude::*;

/// Side of a patch (m).
const PATCH: f32 = 5.0;
/// Patches that differ by random numbers only.
const VARIANTS: u32 = 12;
/// Number of different pebbles.
pub(super) const PEBBLES: u32 = 4;

/// An object with its mean number per square metre.
struct Share(&'static str, f32);

/// Vegetation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cover {
    Pebbles,
    Shore,
    Grove,
    Forest,
    Meadow,
}

const COVERS: [Cover; 5] = [Cover::Pebbles, Cover::Shore, Cover::Grove, Cover::Forest, Cover::Meadow];

impl Cover {
    /// The plants; pebbles are listed by [`contents`].
    fn shares(self) -> &'static [Share] {
        match self {
            Cover::Pebbles => &[],
            Cover::Shore => &[
                Share("dunegrass", 3.5),
                Share("grass", 2.0),
                Share("naupaka", 0.10),
                Share("agave", 0.04),
                Share("coconut", 0.018),
                Share("youngpalm", 0.012),
            ],
            Cover::Grove => &[
                Share("coconut", 0.030),
                Share("youngpalm", 0.015),
                Share("royalpalm", 0.010),
                Share("fanpalm", 0.010),
                Share("banana", 0.02),
                Share("almond", 0.006),
                Share("hibiscus", 0.05),
                Share("bougainvillea", 0.02),
                Share("croton", 0.05),
                Share("swordfern", 0.8),
                Share("grass", 9.0),
            ],
            Cover::Forest => &[
                Share("breadfruit", 0.010),
                Share("fig", 0.008),
                Share("almond", 0.010),
                Share("royalpalm", 0.006),
                Share("treefern", 0.04),
                Share("banana", 0.02),
                Share("birdnestfern", 0.7),
                Share("swordfern", 2.5),
                Share("grass", 8.0),
            ],
            Cover::Meadow => &[
                Share("acacia", 0.003),
                Share("fanpalm", 0.002),
                Share("hibiscus", 0.02),
                Share("naupaka", 0.04),
                Share("reed", 2.0),
                Share("grass", 13.0),
            ],
        }
    }

    /// The cover of a point; `None` for the sea, clean sand and rock.
    fn at(terrain: &Terrain, p: Vec2, ground: &Ground) -> Option<Cover> {
        let noise = fractal((p / 40.0).extend(3.3), 4, terrain.seed ^ 0x77);
        let beach = terrain.beach_height();
        let height = ground.height / beach * (1.0 + 0.5 * noise);
        let wood = fractal((p / (0.08 * terrain.side)).extend(9.1), 4, terrain.seed ^ 0x99);
        if ground.gradient.length() > 1.3 || height < -0.2 {
            return None;
        }
        Some(match height {
            ..0.7 => Cover::Pebbles,
            ..1.0 => return None,
            ..3.0 => Cover::Shore,
            ..16.0 if wood > -0.25 => Cover::Grove,
            _ if wood > -0.05 => Cover::Forest,
            _ => Cover::Meadow,
        })
    }
}

/// An instance of an object.
#[derive(Clone, Debug)]
pub(super) struct Placement {
    /// The object.
    pub(super) object: String,
    /// Transform to the space of the patch, or to the world.
    pub(super) transform: Affine3A,
}

/// An object that holds instances.
pub(super) struct Patch {
    pub(super) name: String,
    pub(super) contents: Vec<Placement>,
}

/// All patches and their places.
pub(super) struct Planting {
    pub(super) terrain: Terrain,
    pub(super) patches: Vec<Patch>,
    pub(super) placements: Vec<Placement>,
    /// Numbers of plants and of pebbles.
    pub(super) plants: usize,
    pub(super) pebbles: usize,
}

/// The contents of a patch.
fn contents(cover: Cover, seed: u32) -> Vec<Placement> {
    // Random places, rotations and sizes
    let mut stream = Stream::new([seed, 2, cover as u32]);
    let mut all = Vec::new();
    let mut add = |name: &str, density: f32, sizes: [f32; 2], stream: &mut Stream| {
        let count = (density * PATCH * PATCH + stream.within(0.0, 1.0)) as u32;
        for _ in 0..count {
            let [x, y] = [(); 2].map(|()| stream.within(-0.5, 0.5) * PATCH);
            // Small ones are more frequent
            let scale = sizes[0] + (sizes[1] - sizes[0]) * stream.within(0.0, 1.0).powi(3);
            let rotation = Mat3::from_rotation_z(stream.angle());
            let transform = Affine3A::from_mat3_translation(rotation * scale, Vec3::new(x, y, 0.0));
            all.push(Placement { object: name.to_owned(), transform });
        }
    };

    // Plants, or pebbles
    for &Share(name, density) in cover.shares() {
        add(name, density, [0.75, 1.35], &mut stream);
    }
    if cover == Cover::Pebbles {
        for i in 0..PEBBLES {
            add(&format!("pebble{i}"), 2.1, [0.02, 0.16], &mut stream);
        }
    }
    all
}

/// The transform of a patch at `p`: turned, and sheared to the slope of the ground, so that plants stay upright.
fn on_ground(p: Vec2, ground: &Ground, angle: f32) -> Affine3A {
    let g = ground.gradient;
    let shear = Mat3::from_cols(Vec3::new(1.0, 0.0, g.x), Vec3::new(0.0, 1.0, g.y), Vec3::Z);
    Affine3A::from_mat3_translation(shear * Mat3::from_rotation_z(angle), p.extend(ground.height))
}

impl Planting {
    /// Plants `instances` plants and pebbles on the smallest island that has room for them.
    pub(super) fn new(instances: usize, seed: u32) -> Self {
        let each = |cover: Cover| {
            (0..VARIANTS).map(move |i| {
                let contents = contents(cover, seed.wrapping_mul(VARIANTS).wrapping_add(i));
                Patch { name: format!("{cover:?}{i}").to_lowercase(), contents }
            })
        };

        // Enlarge the island until there is room
        let patches: Vec<Patch> = COVERS.into_iter().flat_map(each).collect();
        let mut side = (instances as f32 / 14.0).sqrt();
        loop {
            let terrain = Terrain { side, seed };
            let places = sites(&terrain);
            let room: usize = places.iter().map(|place| patches[place.patch].contents.len()).sum();
            if room >= instances {
                return Planting::of(terrain, patches, &places, instances);
            }
            side *= 1.02;
        }
    }

    /// Uses places in their order until there are enough instances. The last patch is cut off.
    fn of(terrain: Terrain, mut patches: Vec<Patch>, places: &[Site], instances: usize) -> Self {
        let (mut placements, mut left) = (Vec::new(), instances);
        let (mut plants, mut pebbles) = (0, 0);
        for place in places {
            // Place a patch, or the part of it that is left
            let Patch { name, contents } = &patches[place.patch];
            let count = contents.len().min(left);
            let is_whole = count == contents.len();
            let object = if is_whole { name.clone() } else { "last".to_owned() };
            placements.push(Placement { object, transform: place.transform });

            // Count
            let is_pebbles = place.patch < VARIANTS as usize;
            *(if is_pebbles { &mut pebbles } else { &mut plants }) += count;
            left -= count;
            if left == 0 {
                let contents = contents[..count].to_vec();
                patches.extend((!is_whole).then(|| Patch { name: "last".to_owned(), contents }));
                break;
            }
        }
        Planting { terrain, patches, placements, plants, pebbles }
    }
}

/// A place for a patch.
struct Site {
    /// Index of the patch.
    patch: usize,
    transform: Affine3A,
    /// Random; places are sorted by it.
    order: f32,
}

/// All places on the terrain, in a random order.
fn sites(terrain: &Terrain) -> Vec<Site> {
    let cells = (terrain.side / PATCH).ceil() as u32;
    let place = |i: u32| {
        // A point in the cell of the grid
        let mut stream = Stream::new([terrain.seed, 3, i]);
        let [x, y] = [i % cells, i / cells].map(|cell| cell as f32 + stream.within(0.2, 0.8));
        let p = terrain.at(x / cells as f32, y / cells as f32);
        if terrain.inland(p) < -0.02 {
            return None;
        }

        // A patch of its cover
        let ground = terrain.ground(p, 0.4 * PATCH);
        let cover = Cover::at(terrain, p, &ground)?;
        let variant = stream.within(0.0, VARIANTS as f32) as u32;
        let transform = on_ground(p, &ground, stream.angle());
        Some(Site { patch: (cover as u32 * VARIANTS + variant) as usize, transform, order: stream.within(0.0, 1.0) })
    };
    let mut places: Vec<Site> = (0..cells * cells).into_par_iter().filter_map(place).collect();
    places.sort_by(|a, b| a.order.total_cmp(&b.order));
    places
}

#[cfg(test)]
mod tests {
    use super::super::kinds::KINDS;
    use super::*;

    #[test]
    fn covers_name_plants_and_every_plant_is_used() {
        let names: Vec<&str> = COVERS.iter().flat_map(|cover| cover.shares().iter().map(|share| share.0)).collect();
        assert!(names.iter().all(|name| KINDS.iter().any(|kind| kind.name == *name)));
        assert!(KINDS.iter().all(|kind| names.contains(&kind.name)));
    }
}
