//! Surface interactions of many rays at once.

use super::job::RenderJob;
use super::surface_interaction::{RayHit, SurfaceInteraction, inverse_lengths};
use crate::accel::Hit;
use crate::geometry::{Shape, TriangleMesh};
use lumiris_lanes::lane::LANES;
use lumiris_lanes::level;
use lumiris_lanes::triangle_points::{CornerCoordinates, TexturedPoints, TriangleHits, lane, textured_points};
use lumiris_numbers::math::{Ray, Vec2};

/// The interactions of a group of rays with surfaces. The points of meshes are computed together; the results are those of
/// [`SurfaceInteraction::new`], bit for bit.
#[derive(Debug, Default)]
pub struct SurfaceInteractions {
    ray_hits: Vec<RayHit>,
    interactions: Vec<SurfaceInteraction>,
    /// Hits on meshes, their texture coordinates and their points, one item per vector of lanes.
    hits: Vec<TriangleHits>,
    coordinates: Vec<CornerCoordinates>,
    points: Vec<TexturedPoints>,
}

impl SurfaceInteractions {
    /// Maximum number of rays of a group. More would displace the texels that are requested for it from the cache.
    pub const GROUP: usize = 32;

    /// Adds a ray to the group.
    #[inline]
    pub fn push(&mut self, ray_hit: RayHit) {
        self.ray_hits.push(ray_hit);
    }

    /// The interactions of the rays added since the last call, in their order. Requests the texels of the materials.
    pub fn find(&mut self, job: &RenderJob) -> &[SurfaceInteraction] {
        self.compute_points(job);
        let SurfaceInteractions { ray_hits, interactions, points, .. } = self;
        let mut row = 0;
        interactions.clear();
        interactions.extend(ray_hits.drain(..).map(|ray_hit| {
            let Hit { primitive, instance, uv, .. } = ray_hit.hit;
            let Some(mesh) = mesh_of(job, &ray_hit.hit) else { return SurfaceInteraction::new(job, &ray_hit) };
            let (points, k) = (&points[row / LANES], row % LANES);
            row += 1;
            let (surface, wo) = (mesh.surface_hit_of_lane(primitive as usize, uv, points, k), lane(&points.wo, k));
            let inverse = Vec2::new(points.inverse_lengths[0][k], points.inverse_lengths[1][k]);
            if instance != Hit::NO_INSTANCE {
                let set = &job.world.scene.geometry;
                let placed = surface.transformed(&set.world_from_group_at(instance, ray_hit.ray.time));
                return SurfaceInteraction::at(job, &ray_hit, placed, wo, inverse_lengths(&placed));
            }
            // Without derivatives the surface has other tangents
            let inverse = if inverse == Vec2::ZERO { inverse_lengths(&surface) } else { inverse };
            SurfaceInteraction::at(job, &ray_hit, surface, wo, inverse)
        }));
        interactions.iter().for_each(|interaction| interaction.prefetch(job));
        interactions
    }

    /// Calls `visit` with each of the items whose ray hits a surface, and the interaction. `hits` are the first hits of
    /// these rays.
    pub fn visit<'p, P>(
        &mut self,
        job: &RenderJob,
        items: &'p [P],
        ray: impl Fn(&P) -> &Ray,
        hits: &[Option<Hit>],
        mut visit: impl FnMut(&'p P, &SurfaceInteraction),
    ) {
        for (items, hits) in items.chunks(Self::GROUP).zip(hits.chunks(Self::GROUP)) {
            let met = || items.iter().zip(hits).filter_map(|(item, hit)| Some((item, hit.as_ref()?)));
            met().for_each(|(item, hit)| self.push(RayHit::of_ray(ray(item), hit)));
            met().zip(self.find(job)).for_each(|((item, _), interaction)| visit(item, interaction));
        }
    }

    /// Computes the points of meshes in the spaces of their groups, in the order of their ray_hits.
    fn compute_points(&mut self, job: &RenderJob) {
        let SurfaceInteractions { ray_hits, hits, coordinates, points, .. } = self;
        let mut count = 0;
        for RayHit { ray, hit, .. } in ray_hits {
            let Some(mesh) = mesh_of(job, hit) else { continue };
            let (block, k) = (count / LANES, count % LANES);
            if block == hits.len() {
                hits.push(TriangleHits::default());
                coordinates.push(CornerCoordinates::default());
                points.push(TexturedPoints::default());
            }
            mesh.gather_hit(hit.primitive as usize, hit.uv, ray.d, &mut hits[block], k);
            mesh.gather_coordinates(hit.primitive as usize, &mut coordinates[block], k);
            count += 1;
        }
        let blocks = ..count.div_ceil(LANES);
        textured_points(level(), &hits[blocks], &coordinates[blocks], &mut points[blocks]);
    }
}

/// The mesh of a hit.
#[inline]
fn mesh_of<'j>(job: &'j RenderJob, hit: &Hit) -> Option<&'j TriangleMesh> {
    match &job.world.scene.geometry.geometries[hit.geometry as usize].shape {
        Shape::Mesh(mesh) => Some(mesh),
        Shape::Quadric(_) | Shape::Bilinear(_) | Shape::Curves(_) => None,
    }
}
