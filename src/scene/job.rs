//! A render job: a world with its settings, and the data derived from both.

use super::input::Scene;
use super::pixel_samples::PixelSamples;
use super::sample_count_map::SampleCountMap;
use super::world::World;
use crate::accel::Hit;
use crate::bsdfs::MAX_LOBES;
use crate::geometry::{GeometryId, Shape};
use crate::lights::{Irradiances, JobLights, LightChoice};
use crate::settings::{IntegratorSettings, Settings};
use lumiris_numbers::math::Rgb;
use std::sync::Arc;

/// A world with its render settings.
pub struct RenderJob {
    /// Geometry, materials, lights, and ray tracers.
    pub world: World,
    settings: Settings,
    /// The lights, with the light sampler and the visibility cache.
    pub lights: JobLights,
    /// Irradiances of lights in closed form.
    pub irradiances: Irradiances,
    /// Sample counts of each pixel, if they vary between pixels.
    pub sample_count_map: Option<SampleCountMap>,
    /// Numbers of camera samples of each pixel, if they vary between pixels.
    pub pixel_samples: Option<PixelSamples>,
    lobes: usize,
    /// Reflectance of geometries that are meshes with a constant Lambertian reflectance; `None` for others.
    plain: Vec<Option<Rgb>>,
    /// True for geometries that rays may pass: their material has no surface, at least in some points.
    may_pass: Vec<bool>,
    /// See [`Self::shadows_pass`].
    shadows_pass: bool,
}

impl RenderJob {
    /// Prepares all data that needs no ray tracing.
    pub fn new(world: World, settings: Settings) -> Self {
        let i = &settings.integrator;
        let scene = &world.scene;
        let lobes = scene.materials.lobes(i.bsdf_density);
        let has_alpha = |geometry: GeometryId| scene.geometry.geometries[geometry as usize].alpha.is_some();
        let irradiances = Irradiances::new(&scene.lights, has_alpha);

        // Geometries that rays may pass
        let plain = (0..scene.geometry.geometries.len() as GeometryId).map(|g| plain_reflectance(scene, g)).collect();
        let of_material = scene.materials.may_pass();
        let may_pass: Vec<bool> = scene.surfaces.iter().map(|s| of_material[s.material as usize]).collect();
        let shadows_pass = may_pass.contains(&true);

        // Lights
        let choice = light_choice(i, shadows_pass);
        let lights = JobLights::new(Arc::clone(&scene.lights), choice, max_groups(i, lobes));
        RenderJob {
            world,
            settings,
            lights,
            irradiances,
            sample_count_map: None,
            pixel_samples: None,
            lobes,
            plain,
            may_pass,
            shadows_pass,
        }
    }

    /// Prepares all data for other settings, as [`Self::new`] does. Results of photons and pilots are dropped.
    pub fn reset(&mut self, settings: Settings) {
        let i = &settings.integrator;
        self.settings = settings;
        self.lobes = self.world.scene.materials.lobes(i.bsdf_density);
        let choice = light_choice(i, self.shadows_pass);
        self.lights = JobLights::new(Arc::clone(&self.world.scene.lights), choice, max_groups(i, self.lobes));
        self.sample_count_map = None;
        self.pixel_samples = None;
    }

    /// The reflectance at a hit, if the geometry is a mesh in world space that does not emit, has a constant Lambertian
    /// reflectance, and has the same medium on both sides.
    #[inline]
    pub fn plain_reflectance(&self, hit: &Hit) -> Option<Rgb> {
        if hit.instance == Hit::NO_INSTANCE { self.plain[hit.geometry as usize] } else { None }
    }

    /// True if shadow segments may pass surfaces: interfaces between media, and mixtures with them. Otherwise, segments
    /// that begin in vacuum stay in vacuum.
    #[inline]
    pub fn shadows_pass(&self) -> bool {
        self.shadows_pass
    }

    /// True if rays may pass the hit: its material may have no surface there.
    #[inline]
    pub fn may_pass(&self, hit: &Hit) -> bool {
        self.may_pass[hit.geometry as usize]
    }

    /// The settings.
    #[inline]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Changes the settings and the data that depend on them. Results of photons and pilots are kept.
    pub fn change(&mut self, change: impl FnOnce(&mut Settings)) {
        let before = self.settings.integrator;
        change(&mut self.settings);
        let i = &self.settings.integrator;
        self.lobes = self.world.scene.materials.lobes(i.bsdf_density);
        let max = max_groups(i, self.lobes);
        let choice = light_choice(i, self.shadows_pass);
        if choice != light_choice(&before, self.shadows_pass) {
            self.lights.choose_by(choice, max);
        } else if (i.bsdf_density, i.ocv.components) != (before.bsdf_density, before.ocv.components) {
            self.lights.set_groups(max);
        }
    }

    /// Number of BSDF components of a mixture: the maximum number of lobes of any BSDF.
    pub fn lobes(&self) -> usize {
        self.lobes
    }

    /// Number of components of a mixture: lobes, then groups of lights.
    pub fn components(&self) -> usize {
        self.lobes + self.lights.groups.len()
    }

    /// True if BSDFs may have two lobes.
    pub fn has_two_lobes(&self) -> bool {
        self.lobes == MAX_LOBES
    }

    /// Number of control variates over pixels: one per mixture group, and one for the first of two lobes. The last lobe
    /// is linearly dependent on these.
    pub fn controls(&self) -> usize {
        self.lights.groups.len() + usize::from(self.has_two_lobes())
    }
}

/// See [`RenderJob::plain_reflectance`].
fn plain_reflectance(scene: &Scene, geometry: GeometryId) -> Option<Rgb> {
    let is_between_media = scene.surfaces[geometry as usize].sides.is_some();
    let is_mesh = matches!(scene.geometry.geometries[geometry as usize].shape, Shape::Mesh(_));
    let reflectance = scene.materials.plain_reflectance(scene.surfaces[geometry as usize].material, &scene.textures)?;
    (is_mesh && !is_between_media && !scene.lights.emits(geometry)).then_some(reflectance)
}

/// The choice of lights. Segments reach emitting media only by passing interfaces.
fn light_choice(settings: &IntegratorSettings, shadows_pass: bool) -> LightChoice {
    let choice = settings.light_choice();
    LightChoice { volumes: choice.volumes && shadows_pass, ..choice }
}

/// Maximum number of mixture groups: the components of a mixture without `lobes`.
fn max_groups(settings: &IntegratorSettings, lobes: usize) -> usize {
    settings.ocv.max_components().saturating_sub(lobes).max(1)
}
