//! Shading frames, optionally perturbed by a normal map or a displacement texture [Blinn 1978].

use super::material::{Material, MaterialEntry, NormalMap};
use crate::geometry::SurfaceHit;
use crate::textures::{FloatTextureId, TextureContext, TextureSet};
use lumiris_numbers::math::{Frame, Vec2, Vec3};

/// Step in u and v of the finite differences without a known footprint.
const DEFAULT_STEP: f32 = 5e-4;

/// Shading frame at a hit: z is the shading normal after normal map or displacement, x is as near to ∂p/∂u as possible.
pub fn shading_frame(entry: &MaterialEntry, textures: &TextureSet, hit: &SurfaceHit, ctx: &TextureContext) -> Frame {
    match (entry.normal_map, entry.displacement) {
        (Some(map), _) => normal_mapped(map, textures, hit, ctx),
        (None, Some(displacement)) => displaced(displacement, textures, hit, ctx),
        // Lambertian reflection needs no tangent; the vectorised code uses this frame, too
        (None, None) if matches!(entry.material, Material::Diffuse { .. }) => Frame::from_z(hit.ns),
        (None, None) => Frame::from_xz(hit.dpdus, hit.ns),
    }
}

/// The tangent-space normal 2c − 1 of the map, in the frame of the hit.
fn normal_mapped(map: NormalMap, textures: &TextureSet, hit: &SurfaceHit, ctx: &TextureContext) -> Frame {
    let image = &textures.images[map.image.image as usize];
    let st = image.within_periods(map.image.mapping.st(ctx));
    let c = image.bilinear(0, Vec2::new(st.x, 1.0 - st.y));
    let local = Vec3::from_array((c * 2.0).to_array()) - Vec3::ONE;
    let frame = Frame::from_xz(hit.dpdus, hit.ns);
    let is_mirrored = map.is_along_v && frame.y.dot(hit.dpdvs) < 0.0;
    let scale = Vec2::new(map.strength, if is_mirrored { -map.strength } else { map.strength });
    let local = (local.truncate() * scale).extend(local.z);
    let ns = frame.to_world(local).normalize_or(hit.ns);
    Frame::from_xz(hit.dpdus, facing(ns, hit.n))
}

/// The normal of the surface p + d·n for the displacement d: ∂p'/∂u = ∂p/∂u + ∂d/∂u n, by forward differences. The term
/// d ∂n/∂u is omitted: it matters only for displacements near the radius of curvature.
fn displaced(displacement: FloatTextureId, textures: &TextureSet, hit: &SurfaceHit, ctx: &TextureContext) -> Frame {
    // As in pbrt-v4: with interpolated normals the second tangent is perpendicular to the first, and has its length.
    let dpdvs = if hit.ns == hit.n { hit.dpdv } else { hit.ns.cross(hit.dpdus) };
    let step = |width: f32| if width > 0.0 { 0.5 * width } else { DEFAULT_STEP };
    let (du, dv) = (step(ctx.uv_width.x), step(ctx.uv_width.y));
    let at = |duv: Vec2, dp: Vec3| {
        textures.float(displacement, &TextureContext { uv: ctx.uv + duv, p: ctx.p + dp.as_dvec3(), ..*ctx })
    };
    let d = textures.float(displacement, ctx);
    let d_u = (at(Vec2::new(du, 0.0), hit.dpdus * du) - d) / du;
    let d_v = (at(Vec2::new(0.0, dv), dpdvs * dv) - d) / dv;

    let (dpdu, dpdv) = (hit.dpdus + hit.ns * d_u, dpdvs + hit.ns * d_v);
    let ns = dpdu.cross(dpdv).normalize_or(hit.ns);
    Frame::from_xz(dpdu, facing(ns, hit.n))
}

/// `ns` flipped to the side of `n`.
fn facing(ns: Vec3, n: Vec3) -> Vec3 {
    if ns.dot(n) < 0.0 { -ns } else { ns }
}
