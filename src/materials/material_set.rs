//! All materials of a scene, and the BSDF at a hit.

use super::material::{Material, MaterialEntry, MaterialId};
use super::parameters::{Coat, Textures, distribution_of, valid_eta};
use super::shading_frame::shading_frame;
use super::surface_bsdf::SurfaceBsdf;
use crate::bsdfs::{
    Base, Bsdf, CoatTable, CoatedDiffuse, Dielectric, Diffuse, DiffuseTransmission, Evaluated, Measured,
    MeasuredTables, ProposalDensity, ThinDielectric, TrowbridgeReitz,
};
use crate::geometry::SurfaceHit;
use crate::textures::{FloatTextureId, ImageTexture, RgbTextureId, TextureContext, TextureSet};
use lumiris_numbers::math::hash::{hash_floats, unit_f32};
use lumiris_numbers::math::{Rgb, Vec2, Vec3};
use rayon::prelude::*;
use std::collections::HashSet;
use std::sync::Arc;

/// All materials of a scene, with the tables of their coats.
#[derive(Clone, Debug, Default)]
pub struct MaterialSet {
    entries: Vec<MaterialEntry>,
    coats: Vec<CoatTable>,
    /// Per material, the index of its coat table.
    coat_of: Vec<Option<u32>>,
    /// Tables of measured materials.
    measured: Vec<Arc<MeasuredTables>>,
    /// Per material, true if it makes caustics.
    caustics: Vec<bool>,
    /// Per material, the images of its colours, roughness and displacement.
    images: Vec<Vec<ImageTexture>>,
}

/// The arguments of a coat's table, as bits: η, thickness, and the alphas unless they are textured.
#[derive(Clone, Copy, PartialEq)]
struct CoatKey {
    eta: f32,
    thickness: f32,
    distribution: Option<TrowbridgeReitz>,
}

impl MaterialSet {
    /// Tabulates the coats of the materials, in about 30 ms for each (η, thickness, roughness), and one second for
    /// textured roughness. `textures` is the set that the materials refer to; its images need not be loaded yet.
    pub fn new(entries: Vec<MaterialEntry>, textures: &TextureSet) -> Self {
        let mut keys: Vec<CoatKey> = Vec::new();
        let mut intern = |key: CoatKey| {
            let found = keys.iter().position(|k| *k == key);
            found.unwrap_or_else(|| {
                keys.push(key);
                keys.len() - 1
            }) as u32
        };
        let coat_of = entries.iter().map(|entry| coat_key(&entry.material, textures).map(&mut intern)).collect();
        let tabulate = |key: &CoatKey| match key.distribution {
            Some(distribution) => CoatTable::for_roughness(key.eta, key.thickness, distribution),
            None => CoatTable::for_all_roughness(key.eta, key.thickness),
        };
        let mut coats: Vec<CoatTable> = keys.par_iter().map(tabulate).collect();
        CoatTable::join(&mut coats);
        let images = entries.iter().map(|entry| images_of(entry, textures)).collect();
        MaterialSet { caustics: vec![false; entries.len()], images, entries, coats, coat_of, measured: Vec::new() }
    }

    /// With the tables that measured materials refer to.
    #[must_use]
    pub fn with_measured(self, measured: Vec<Arc<MeasuredTables>>) -> Self {
        MaterialSet { measured, ..self }
    }

    /// Determines which materials make caustics, by one value of each of their textures; for an image, its mean. The
    /// images must be loaded. The result is constant over each material: techniques that share paths look up textures
    /// at different points and must agree on it.
    #[must_use]
    pub fn find_caustics(self, textures: &TextureSet) -> Self {
        let t = Textures { set: textures, ctx: &TextureContext::whole() };
        let makes = |id| self.local_bsdf(id, &t).is_some_and(|bsdf| bsdf.makes_caustics());
        let caustics = (0..self.entries.len() as MaterialId).map(makes).collect();
        MaterialSet { caustics, ..self }
    }

    /// True if any material makes caustics.
    pub fn make_caustics(&self) -> bool {
        self.caustics.contains(&true)
    }

    /// True if the material is a mixture, in which every direction chooses a material.
    pub fn is_mixture(&self, id: MaterialId) -> bool {
        matches!(self.entries[id as usize].material, Material::Mix { .. })
    }

    /// Maximum number of lobes of a BSDF of these materials, by [`Bsdf::first_lobe`]; `density` is the proposal density
    /// of BSDFs that can only be evaluated.
    pub fn lobes(&self, density: ProposalDensity) -> usize {
        let has_two = |material: &Material| match material {
            Material::Principled(_)
            | Material::CoatedDiffuse { .. }
            | Material::CoatedConductor { .. }
            | Material::DiffuseTransmission { .. } => true,
            Material::Evaluated(_) => density == ProposalDensity::Lobes,
            Material::Diffuse { .. }
            | Material::Conductor { .. }
            | Material::Dielectric { .. }
            | Material::ThinDielectric { .. }
            | Material::Hair(_)
            | Material::Measured { .. }
            | Material::Mix { .. }
            | Material::Interface => false,
        };
        if self.entries.iter().any(|entry| has_two(&entry.material)) { 2 } else { 1 }
    }

    /// The materials.
    pub fn entries(&self) -> &[MaterialEntry] {
        &self.entries
    }

    /// Resolves mixtures at a hit, by a hash of the point, the direction and the mixed materials. A mixture that
    /// contains itself resolves to `None`.
    #[inline]
    pub fn resolve(&self, id: MaterialId, textures: &TextureSet, ctx: &TextureContext, wo: Vec3) -> Option<MaterialId> {
        if !self.is_mixture(id) {
            return Some(id);
        }
        self.resolve_mixture(id, textures, ctx, wo)
    }

    /// See [`Self::resolve`]. Not inlined: the hash would be computed for other materials, too.
    #[inline(never)]
    fn resolve_mixture(
        &self,
        id: MaterialId,
        textures: &TextureSet,
        ctx: &TextureContext,
        wo: Vec3,
    ) -> Option<MaterialId> {
        let mut id = id;
        for _ in 0..=self.entries.len() {
            let Material::Mix { materials: [a, b], amount } = self.entries[id as usize].material else {
                return Some(id);
            };
            let amount = textures.float(amount, ctx);
            let (p, ids) = (ctx.p.as_vec3(), [f32::from_bits(a), f32::from_bits(b)]);
            let hash = hash_floats(&[p.x, p.y, p.z, wo.x, wo.y, wo.z, ids[0], ids[1]]);
            id = if amount <= 0.0 || (amount < 1.0 && amount < unit_f32(hash)) { a } else { b };
        }
        None
    }

    /// True if the index of any material depends on the wavelength.
    pub fn has_dispersion(&self) -> bool {
        self.entries.iter().any(|entry| entry.dispersion.is_some())
    }

    /// For each material, true if there may be no surface at a hit: interfaces between media, and mixtures with them.
    pub fn may_pass(&self) -> Vec<bool> {
        let mut holders: Vec<Vec<MaterialId>> = vec![Vec::new(); self.entries.len()];
        let mut open = Vec::new();
        for (id, entry) in (0..).zip(&self.entries) {
            match entry.material {
                Material::Interface => open.push(id),
                Material::Mix { materials, .. } => materials.iter().for_each(|&part| holders[part as usize].push(id)),
                _ => {}
            }
        }
        let mut may_pass = vec![false; self.entries.len()];
        while let Some(id) = open.pop() {
            if !std::mem::replace(&mut may_pass[id as usize], true) {
                open.extend(&holders[id as usize]);
            }
        }
        may_pass
    }

    /// The reflectance of a Lambertian material that is constant and has no normal map or displacement; `None` for
    /// others.
    pub fn plain_reflectance(&self, id: MaterialId, textures: &TextureSet) -> Option<Rgb> {
        let MaterialEntry { material: Material::Diffuse { reflectance }, normal_map: None, displacement: None, .. } =
            self.entries[id as usize]
        else {
            return None;
        };
        textures.constant_rgb(reflectance).map(|c| c.clamp(0.0, 1.0))
    }

    /// Requests the texels that [`Self::bsdf`] reads, if it is called soon with the same arguments.
    pub fn prefetch(&self, id: MaterialId, textures: &TextureSet, ctx: &TextureContext) {
        textures.prefetch(&self.images[id as usize], ctx);
        if let Some(map) = &self.entries[id as usize].normal_map {
            textures.prefetch(&[map.image], &TextureContext { uv_width: Vec2::ZERO, ..*ctx });
        }
    }

    /// The BSDF at a hit for the world-space direction `wo`; `None` if rays pass through. `id` and its textures must
    /// belong to the sets that the materials were made with.
    pub fn bsdf(
        &self,
        id: MaterialId,
        textures: &TextureSet,
        hit: &SurfaceHit,
        ctx: &TextureContext,
        wo: Vec3,
    ) -> Option<SurfaceBsdf<'_>> {
        let id = self.resolve(id, textures, ctx, wo)?;
        let entry = &self.entries[id as usize];
        let t = Textures { set: textures, ctx };
        let bsdf = self.local_bsdf(id, &t)?;
        let frame = shading_frame(entry, textures, hit, ctx);
        let frame = match &entry.material {
            Material::Principled(material) => material.frame(frame, hit.dpdv, &t),
            _ => frame,
        };
        Some(SurfaceBsdf { bsdf, frame, n: hit.n, makes_caustics: self.caustics[id as usize] })
    }

    fn local_bsdf(&self, id: MaterialId, t: &Textures<'_>) -> Option<Bsdf<'_>> {
        Some(match self.entries[id as usize].material {
            Material::Diffuse { reflectance } => Bsdf::Diffuse(Diffuse { reflectance: t.albedo(reflectance) }),
            Material::Conductor { spectrum, roughness } => Bsdf::Conductor(t.conductor(spectrum, roughness, 1.0)),
            Material::Dielectric { eta, roughness } => {
                Bsdf::Dielectric(Dielectric { eta: valid_eta(eta), distribution: t.distribution(roughness) })
            }
            Material::ThinDielectric { eta } => Bsdf::ThinDielectric(ThinDielectric { eta: valid_eta(eta) }),
            Material::DiffuseTransmission { reflectance, transmittance, scale } => {
                Bsdf::DiffuseTransmission(DiffuseTransmission {
                    reflectance: (t.rgb(reflectance) * scale).clamp(0.0, 1.0),
                    transmittance: (t.rgb(transmittance) * scale).clamp(0.0, 1.0),
                })
            }
            Material::CoatedDiffuse { reflectance, coat } => {
                // A coat without a scattering medium has a closed form with a table; all others are random walks
                let base = t.albedo(reflectance);
                if let (Some(table), true) = (self.coat_of[id as usize], t.albedo(coat.albedo).is_black()) {
                    let table = &self.coats[table as usize];
                    let distribution = t.distribution(coat.roughness);
                    return Some(Bsdf::CoatedDiffuse(CoatedDiffuse::new(table, distribution, base, coat.max_depth)));
                }
                Bsdf::Layered(t.layered(Base::Diffuse(Diffuse { reflectance: base }), &coat))
            }
            Material::CoatedConductor { conductor, roughness, coat } => {
                let metal = t.conductor(conductor, roughness, valid_eta(coat.eta));
                Bsdf::Layered(t.layered(Base::Conductor(metal), &coat))
            }
            Material::Principled(material) => Bsdf::Principled(material.bsdf(t)),
            Material::Hair(material) => Bsdf::Hair(material.bsdf(t)),
            Material::Measured { tables } => Bsdf::Measured(Measured { tables: &self.measured[tables as usize] }),
            Material::Evaluated(material) => {
                Bsdf::Evaluated(Evaluated { model: material.model(t), density: ProposalDensity::default() })
            }
            Material::Mix { .. } | Material::Interface => return None,
        })
    }
}

/// The images of the colours, the roughness and the displacement of a material; none for a mixture.
fn images_of(entry: &MaterialEntry, textures: &TextureSet) -> Vec<ImageTexture> {
    let (rgbs, floats): (Vec<RgbTextureId>, Vec<FloatTextureId>) = match entry.material {
        Material::Diffuse { reflectance } => (vec![reflectance], vec![]),
        Material::DiffuseTransmission { reflectance, transmittance, .. } => (vec![reflectance, transmittance], vec![]),
        Material::CoatedDiffuse { reflectance, coat } => (vec![reflectance], vec![coat.roughness.u]),
        Material::Conductor { roughness, .. } | Material::Dielectric { roughness, .. } => (vec![], vec![roughness.u]),
        Material::Principled(material) => (vec![material.base_color], vec![material.metalness, material.roughness]),
        Material::CoatedConductor { .. }
        | Material::ThinDielectric { .. }
        | Material::Hair(_)
        | Material::Measured { .. }
        | Material::Evaluated(_)
        | Material::Mix { .. }
        | Material::Interface => (vec![], vec![]),
    };
    let mut images = Vec::new();
    rgbs.into_iter().for_each(|id| textures.images_of_rgb(id, &mut images));
    floats.into_iter().chain(entry.displacement).for_each(|id| textures.images_of_float(id, &mut images));

    // Channels of an image have the same texels
    let mut seen = HashSet::new();
    images.retain(|image| seen.insert(image.image));
    images
}

/// The key of the coat table of a material; `None` if it has no closed form.
fn coat_key(material: &Material, textures: &TextureSet) -> Option<CoatKey> {
    let Material::CoatedDiffuse { coat: Coat { roughness, thickness, eta, albedo, .. }, .. } = material else {
        return None;
    };
    if textures.constant_rgb(*albedo).is_some_and(|a| !a.clamp(0.0, 1.0).is_black()) {
        return None;
    }
    let thickness = textures.constant_float(*thickness)?.max(f32::MIN_POSITIVE);
    let alphas = (textures.constant_float(roughness.u), textures.constant_float(roughness.v));
    let distribution = match alphas {
        (Some(u), Some(v)) => Some(distribution_of(u, v, roughness.remap)),
        // Tables over the roughness are isotropic; other textured roughness needs walks.
        _ if roughness.u == roughness.v => None,
        _ => return None,
    };
    Some(CoatKey { eta: valid_eta(*eta), thickness, distribution })
}

#[cfg(test)]
#[path = "material_set_tests.rs"]
mod tests;
