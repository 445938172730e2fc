//! A scene with its ray tracers.

use super::Scene;
use crate::accel::bvh::Bvh;
use crate::accel::embree::{EmbreeAccel, EmbreeError};
use crate::accel::{Accel, Coherence, Hit, RayBatch};
use crate::geometry::{AlphaSource, Geometry, GeometryId, GeometrySet, Group, Shape, VertexValues, Visibility};
use crate::lights::LightId;
use crate::textures::{TextureContext, TextureSet};
use lumiris_lanes::level;
use lumiris_lanes::triangles::{self, FirstHits};
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
    /// The emitters, if they are few triangles without cut-outs.
    few_emitters: Option<FewTriangles>,
    /// False if no emitter can hide another.
    emitters_hide: bool,
}

/// Number of triangles up to which a ray is tested with each of them: faster than a tree for it.
const MAX_FEW: usize = 32;

/// Triangles with their geometries and primitives.
#[derive(Default)]
struct FewTriangles {
    corners: Vec<[Vec3; 3]>,
    places: Vec<(GeometryId, u32)>,
}

impl FewTriangles {
    /// The triangles of all `ids`, if they are nothing else and few.
    fn new(geometry: &GeometrySet, ids: &[GeometryId]) -> Option<Self> {
        let mut few = FewTriangles::default();
        for &id in ids {
            let Geometry { shape: Shape::Mesh(mesh), alpha: None, visibility } = &geometry.geometries[id as usize]
            else {
                return None;
            };
            if *visibility != Visibility::ALL || few.corners.len() + mesh.triangle_count() > MAX_FEW {
                return None;
            }
            few.corners.extend((0..mesh.triangle_count()).map(|i| mesh.triangle(i)));
            few.places.extend((0..mesh.triangle_count() as u32).map(|i| (id, i)));
        }
        Some(few)
    }

    /// First hits of rays without end.
    fn intersect(&self, o: [&[f32]; 3], d: [&[f32]; 3], scratch: &mut EmitterScratch) {
        scratch.columns.iter_mut().for_each(|c| c.resize(o[0].len(), 0.0));
        let [t, b1, b2, triangle] = &mut scratch.columns;
        triangles::first_hits(level(), &self.corners, o, d, &mut FirstHits { t, b: [b1, b2], triangle });
    }
}

/// Memory of [`World::intersect_emitters`].
#[derive(Debug, Default)]
pub struct EmitterScratch {
    hits: Vec<Option<Hit>>,
    /// Parameter, two weights, and index of the triangle.
    columns: [Vec<f32>; 4],
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
    fn alpha(&self, texture: u32, uv: Vec2, vertex: &VertexValues, p: Vec3) -> f32 {
        let VertexValues { uv1, color, face } = *vertex;
        self.float(texture, &TextureContext { uv, uv_width: Vec2::ZERO, uv1, color, face, p: p.as_dvec3(), n: Vec3::Z })
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
    /// Builds the ray tracers. `packet_width` overrides the device's native width (1, 4, 8 or 16); images do
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
        let few_emitters = FewTriangles::new(&scene.geometry, &emitter_geometry);
        Ok(World { scene, accel, emitters, emitter_geometry, few_emitters, emitters_hide })
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
    pub fn intersect_emitters(&self, rays: &RayBatch, scratch: &mut EmitterScratch, out: &mut Vec<Option<EmitterHit>>) {
        out.clear();
        if let Some(few) = &self.few_emitters {
            return self.intersect_few(few, rays, scratch, out);
        }
        let Some(emitters) = &self.emitters else {
            out.resize(rays.len(), None);
            return;
        };
        emitters.intersect(rays, Coherence::Incoherent, &mut scratch.hits);
        out.extend(scratch.hits.iter().map(|hit| {
            hit.map(|h| {
                let geometry = self.emitter_geometry[h.geometry as usize];
                let light = self.scene.lights.light_of(geometry, h.primitive);
                EmitterHit { geometry, primitive: h.primitive, uv: h.uv, t: h.t, light }
            })
        }));
    }

    fn intersect_few(
        &self,
        few: &FewTriangles,
        rays: &RayBatch,
        scratch: &mut EmitterScratch,
        out: &mut Vec<Option<EmitterHit>>,
    ) {
        let (o, d) = ([&rays.ox[..], &rays.oy, &rays.oz], [&rays.dx[..], &rays.dy, &rays.dz]);
        few.intersect(o, d, scratch);
        out.extend((0..rays.len()).map(|i| self.few_hit(few, scratch, i).filter(|hit| hit.t < rays.t_max[i])));
    }

    /// [`intersect_emitters`](Self::intersect_emitters) for the rays from `o` in the directions `d` without end, where
    /// emitters are few: a function of the index of a ray. `None` elsewhere.
    pub fn intersect_few_emitters<'a>(
        &'a self,
        o: [&[f32]; 3],
        d: [&[f32]; 3],
        scratch: &'a mut EmitterScratch,
    ) -> Option<impl Fn(usize) -> Option<EmitterHit> + use<'a>> {
        let few = self.few_emitters.as_ref()?;
        few.intersect(o, d, scratch);
        let scratch = &*scratch;
        Some(move |i| self.few_hit(few, scratch, i))
    }

    #[inline]
    fn few_hit(&self, few: &FewTriangles, scratch: &EmitterScratch, i: usize) -> Option<EmitterHit> {
        let [t, b1, b2, triangle] = &scratch.columns;
        (t[i] < f32::INFINITY).then(|| {
            let (geometry, primitive) = few.places[triangle[i] as usize];
            let light = self.scene.lights.light_of(geometry, primitive);
            EmitterHit { geometry, primitive, uv: [b1[i], b2[i]], t: t[i], light }
        })
    }
}
