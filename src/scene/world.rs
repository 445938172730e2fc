//! A scene with its ray tracers. Rays against emitters only are traced here, for BSDF samples of direct light.

use super::input::Scene;
use crate::accel::bvh::Bvh;
use crate::accel::embree::{EmbreeAccel, EmbreeError};
use crate::accel::{Accel, Coherence, Hit, RayBatch};
use crate::geometry::triangle::{RayPrecomputed, TriangleHit, intersect_triangle};
use crate::geometry::{AlphaSource, Geometry, GeometryId, GeometrySet, Group, Shape, VertexValues, Visibility};
use crate::lights::LightId;
use crate::textures::{TextureContext, TextureSet};
use lumiris_lanes::level;
use lumiris_lanes::triangles::{self, FirstHits};
use lumiris_numbers::math::{Ray, Vec2, Vec3};
use std::sync::Arc;
use strum::{EnumString, IntoStaticStr, VariantNames};

/// The kind of ray tracer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, EnumString, IntoStaticStr, VariantNames)]
#[strum(serialize_all = "kebab-case")]
pub enum AccelKind {
    /// Intel Embree.
    #[default]
    Embree,
    /// The pure-Rust BVH.
    Bvh,
}

/// A scene and two ray tracers: over all geometry, and over emitters only.
///
/// The second ray tracer determines which emitter a BSDF sample would hit without occluders, so that proposing
/// candidates needs no visibility.
pub struct World {
    /// The scene.
    pub scene: Scene,
    /// Ray tracer over all geometry.
    pub accel: Box<dyn Accel>,
    /// Ray tracer over emitters only; its geometry ids are indices into `emitter_geometry`.
    emitters: Option<Box<dyn Accel>>,
    emitter_geometry: Vec<GeometryId>,
    /// The emitters, if they are a few triangles without alpha textures.
    few_emitters: Option<FewTriangles>,
    /// False if no emitter can occlude another.
    emitters_hide: bool,
}

/// Maximum number of triangles that a ray is tested with one by one, which is then faster than a tree.
const MAX_FEW: usize = 32;

/// Distance of a ray's origin from the plane of a triangle, relative to coordinates, below which an exact test must
/// decide whether the ray hits the triangle. Larger than the error of the vectorised parameter, except for slivers.
const NEAR_PLANE: f32 = 1.0 / (1 << 13) as f32;

/// Triangles with their unit normals, geometries and primitives.
#[derive(Default)]
struct FewTriangles {
    corners: Vec<[Vec3; 3]>,
    normals: Vec<Vec3>,
    places: Vec<(GeometryId, u32)>,
    /// Their maximum coordinate.
    extent: f32,
}

/// The first hit among few triangles: its parameter, two weights, and the index of the triangle.
#[derive(Clone, Copy)]
struct FewHit {
    t: f32,
    uv: [f32; 2],
    triangle: usize,
}

impl FewTriangles {
    /// The triangles of all `ids`; `None` if there are other shapes or too many triangles.
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
        few.normals = few.corners.iter().map(|[a, b, c]| (b - a).cross(c - a).normalize_or_zero()).collect();
        few.extent = few.corners.iter().flatten().fold(0.0, |m, p| m.max(p.abs().max_element()));
        Some(few)
    }

    /// The hit of ray `i` according to [`Self::intersect`]. By rounding, the vectorised test may hit a triangle next to
    /// the ray's origin; then all triangles are tested exactly.
    #[inline]
    fn hit(&self, scratch: &EmitterScratch, i: usize, ray: impl Fn() -> Ray) -> Option<FewHit> {
        let [t, b1, b2, triangle] = &scratch.columns;
        if t[i] == f32::INFINITY {
            return None;
        }
        let (ray, triangle) = (ray(), triangle[i] as usize);
        let height = self.normals[triangle].dot(ray.o - self.corners[triangle][0]);
        if height.abs() <= (self.extent + ray.o.abs().max_element()) * NEAR_PLANE {
            return self.exact_hit(&ray);
        }
        Some(FewHit { t: t[i], uv: [b1[i], b2[i]], triangle })
    }

    #[cold]
    fn exact_hit(&self, ray: &Ray) -> Option<FewHit> {
        let ray = RayPrecomputed::new(ray)?;
        let hits = self.corners.iter().enumerate().filter_map(|(triangle, &corners)| {
            let TriangleHit { t, b1, b2 } = intersect_triangle(&ray, corners, f32::INFINITY)?;
            Some(FewHit { t, uv: [b1, b2], triangle })
        });
        hits.reduce(|first, hit| if hit.t < first.t { hit } else { first })
    }

    /// First hits of unbounded rays.
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

    /// True if an emitter can occlude another.
    pub fn emitters_hide(&self) -> bool {
        self.emitters_hide
    }

    /// Determines for each segment if an emitter occludes it.
    pub fn occluded_by_emitters(&self, segments: &RayBatch, out: &mut Vec<bool>) {
        match &self.emitters {
            Some(emitters) => emitters.occluded(segments, Coherence::Incoherent, out),
            None => {
                out.clear();
                out.resize(segments.len(), false);
            }
        }
    }

    /// First hits of the rays with emitters, ignoring all other geometry.
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
        out.extend((0..rays.len()).map(|i| {
            let hit = few.hit(scratch, i, || rays.get(i)).filter(|hit| hit.t < rays.t_max[i]);
            hit.map(|hit| self.few_hit(few, hit))
        }));
    }

    /// [`intersect_emitters`](Self::intersect_emitters) for unbounded rays with origins `o` and directions `d`: a
    /// function of a ray's index and the ray. `None` if there are too many emitters.
    pub fn intersect_few_emitters<'a>(
        &'a self,
        o: [&[f32]; 3],
        d: [&[f32]; 3],
        scratch: &'a mut EmitterScratch,
    ) -> Option<impl Fn(usize, &Ray) -> Option<EmitterHit> + use<'a>> {
        let few = self.few_emitters.as_ref()?;
        few.intersect(o, d, scratch);
        let scratch = &*scratch;
        Some(move |i, ray: &Ray| few.hit(scratch, i, || *ray).map(|hit| self.few_hit(few, hit)))
    }

    #[inline]
    fn few_hit(&self, few: &FewTriangles, FewHit { t, uv, triangle }: FewHit) -> EmitterHit {
        let (geometry, primitive) = few.places[triangle];
        let light = self.scene.lights.light_of(geometry, primitive);
        EmitterHit { geometry, primitive, uv, t, light }
    }
}
