//! A scene with its ray tracers.

use super::Scene;
use crate::accel::bvh::Bvh;
use crate::accel::embree::{EmbreeAccel, EmbreeError};
use crate::accel::{Accel, AlphaSource, Coherence, Hit, RayBatch};
use crate::geometry::{GeometryId, GeometrySet, Group};
use crate::lights::LightId;
use crate::textures::{TextureContext, TextureSet};
use lumiris_numbers::math::{Vec2, Vec3};
use std::sync::Arc;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// Which ray tracer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum AccelKind {
    /// Intel Embree.
    #[default]
    Embree,
    /// The pure-Rust BVH.
    Bvh,
}

/// A scene and two ray tracers: over everything, and over emitters only.
///
/// The second one determines what a BSDF sample would hit if nothing else were in the way, so that proposing candidates
/// needs no visibility.
pub struct World {
    /// The scene.
    pub scene: Scene,
    /// Everything.
    pub accel: Box<dyn Accel>,
    /// Emitters only; geometry ids are indices into `emitter_geometry`.
    emitters: Option<Box<dyn Accel>>,
    emitter_geometry: Vec<GeometryId>,
    /// False if no emitter can hide another.
    emitters_hide: bool,
}

/// The first emitter that a ray hits.
#[derive(Clone, Copy, Debug)]
pub struct EmitterHit {
    /// Geometry of the scene.
    pub geometry: GeometryId,
    /// Primitive in it.
    pub primitive: u32,
    /// Parametric position, as in [`Hit`].
    pub uv: [f32; 2],
    /// Ray parameter.
    pub t: f32,
    /// The light of this primitive, if it emits.
    pub light: Option<LightId>,
}

impl AlphaSource for TextureSet {
    fn alpha(&self, texture: u32, uv: Vec2, p: Vec3) -> f32 {
        self.float(texture, &TextureContext { uv, uv_width: Vec2::ZERO, p, n: Vec3::Z })
    }
}

fn build(
    kind: AccelKind,
    geometry: &Arc<GeometrySet>,
    alpha: &Arc<TextureSet>,
    packet_width: Option<u32>,
) -> Result<Box<dyn Accel>, EmbreeError> {
    let alpha = Some(Arc::clone(alpha) as Arc<dyn AlphaSource>);
    Ok(match kind {
        AccelKind::Embree => Box::new(EmbreeAccel::new(Arc::clone(geometry), alpha, packet_width)?),
        AccelKind::Bvh => Box::new(Bvh::new(Arc::clone(geometry), alpha)),
    })
}

impl World {
    /// Builds the ray tracers. `packet_width` overrides the device's native width (1, 4 or 8); images do
    /// not depend on it.
    pub fn new(scene: Scene, kind: AccelKind, packet_width: Option<u32>) -> Result<World, EmbreeError> {
        let accel = build(kind, &scene.geometry, &scene.textures, packet_width)?;
        let emitter_geometry: Vec<GeometryId> =
            scene.geometry.root.geometries.iter().copied().filter(|&g| scene.lights.emits(g)).collect();
        let emitters = if emitter_geometry.is_empty() {
            None
        } else {
            let set = GeometrySet {
                geometries: emitter_geometry.iter().map(|&g| scene.geometry.geometries[g as usize].clone()).collect(),
                root: Group { geometries: (0..emitter_geometry.len() as u32).collect() },
                ..GeometrySet::default()
            };
            Some(build(kind, &Arc::new(set), &scene.textures, packet_width)?)
        };
        let emitters_hide = scene.lights.may_hide_each_other();
        Ok(World { scene, accel, emitters, emitter_geometry, emitters_hide })
    }

    /// True if an emitter can hide another.
    pub fn emitters_hide(&self) -> bool {
        self.emitters_hide
    }

    /// For each segment, whether an emitter occludes it.
    pub fn occluded_by_emitters(&self, segments: &RayBatch, out: &mut Vec<bool>) {
        match &self.emitters {
            Some(emitters) => emitters.occluded(segments, Coherence::Incoherent, out),
            None => {
                out.clear();
                out.resize(segments.len(), false);
            }
        }
    }

    /// What each ray would hit first if there were only emitters.
    pub fn intersect_emitters(
        &self,
        rays: &RayBatch,
        scratch: &mut Vec<Option<Hit>>,
        out: &mut Vec<Option<EmitterHit>>,
    ) {
        out.clear();
        let Some(emitters) = &self.emitters else {
            out.resize(rays.len(), None);
            return;
        };
        emitters.intersect(rays, Coherence::Incoherent, scratch);
        out.extend(scratch.iter().map(|hit| {
            hit.map(|h| {
                let geometry = self.emitter_geometry[h.geometry as usize];
                let light = self.scene.lights.light_of(geometry, h.primitive);
                EmitterHit { geometry, primitive: h.primitive, uv: h.uv, t: h.t, light }
            })
        }));
    }
}
