//! All lights of a scene, and the map from hits to lights.

use crate::geometry::{GeometryId, Shape};
use crate::lights::kinds::volume_light::Parts;
use crate::lights::{
    AreaShape, Emission, Light, LightCtx, LightId, LightLayers, LightSample, LightTree, SampleOfLight, SampledLight,
    Sphere, TreeChoice, VolumeLight, area_lights_of,
};
use crate::media::{Medium, MediumId, MediumSet};
use lumiris_numbers::math::{Bounds3, Rgb, Vec3};
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

/// Lights of the primitives of one geometry: one for all, or one for each.
#[derive(Clone, Debug)]
struct EmittingGeometry {
    geometry: GeometryId,
    first_light: LightId,
    light_of_primitive: Vec<u32>,
}

/// Collects the lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct LightSetBuilder {
    lights: Vec<Light>,
    emitting: Vec<EmittingGeometry>,
    /// The group of lights added from now on, and the groups of all lights so far.
    group: Option<Arc<str>>,
    groups: Vec<Option<Arc<str>>>,
    /// Emitting media, by medium.
    emitting_media: Vec<Option<EmittingMedium>>,
}

/// Minimum expected number of emission lookups along a camera ray through a medium of average width.
const MIN_LOOKUPS: f32 = 8.0;

/// The emitting parts of a medium.
#[derive(Clone, Debug)]
struct EmittingMedium {
    parts: Parts,
    /// The light of each part; `None` if it is dark.
    lights: Vec<Option<LightId>>,
    /// Rate of emission lookups along camera rays (1/m).
    rate: f32,
}

impl LightSetBuilder {
    /// Assigns the lights added from now on to a group, which has its own layer in the image.
    pub fn in_group(&mut self, group: Option<Arc<str>>) -> &mut Self {
        self.group = group;
        self
    }

    /// Adds a light that is not an area light.
    pub fn add(&mut self, light: Light) -> LightId {
        self.lights.push(light);
        self.groups.resize(self.lights.len(), self.group.clone());
        (self.lights.len() - 1) as LightId
    }

    /// Adds the area lights of a geometry of the root group; `shape` is in world space.
    pub fn add_area(&mut self, geometry: GeometryId, shape: &Shape, emission: &Emission) {
        let area = area_lights_of(shape, emission);
        let first_light = self.lights.len() as LightId;
        self.lights.extend(area.lights.into_iter().map(Light::Area));
        self.groups.resize(self.lights.len(), self.group.clone());
        self.emitting.push(EmittingGeometry { geometry, first_light, light_of_primitive: area.light_of_primitive });
    }

    /// Adds the emitting parts of the media.
    pub fn add_media(&mut self, media: &MediumSet) {
        for (id, medium) in (0..).zip(&media.media) {
            self.emitting_media.push(None);
            let Medium::Heterogeneous(medium) = medium else { continue };
            if !medium.is_emissive() {
                continue;
            }
            let parts = Parts::of(medium);
            let lights = parts.lights(medium, id);
            let bounds = lights.iter().flatten().fold(Bounds3::EMPTY, |b, light| b.union(light.bounds().bounds));
            let size = bounds.diagonal();
            let rate = MIN_LOOKUPS / size.element_product().cbrt();
            let added = |light: Option<VolumeLight>| light.map(|light| self.add(Light::Volume(Box::new(light))));
            let lights = lights.into_iter().map(added).collect();
            let rate = if rate.is_finite() { rate } else { 0.0 };
            *self.emitting_media.last_mut().expect("was added above") = Some(EmittingMedium { parts, lights, rate });
        }
    }

    /// The set, for a scene of the given bounds.
    pub fn build(mut self, scene_bounds: &Bounds3) -> LightSet {
        let Sphere { center, radius } = scene_bounds.bounding_sphere();
        let has_extent = radius > 0.0 && radius.is_finite();
        let scene_radius = if has_extent { radius } else { 1.0 };

        // Infinite lights with a radiance in all directions, and lights with power
        let has_le = |light: &Light| light.is_infinite() && !light.is_delta();
        let infinite = (0..self.lights.len()).filter(|&i| has_le(&self.lights[i])).map(|i| i as LightId).collect();
        let powers: Vec<f32> = self.lights.par_iter().map(|light| light.power_luminance(scene_radius)).collect();
        let lit = (0..).zip(&powers).filter(|(_, power)| **power > 0.0).map(|(light, _)| light).collect();

        // Geometries that emit
        self.emitting.sort_by_key(|e| e.geometry);
        let mut place_of = vec![None; self.emitting.last().map_or(0, |e| e.geometry as usize + 1)];
        (0..).zip(&self.emitting).for_each(|(place, e)| place_of[e.geometry as usize] = Some(place));
        LightSet {
            lights: self.lights,
            infinite,
            powers,
            lit,
            layers: LightLayers::new(&self.groups),
            place_of,
            emitting: self.emitting,
            emitting_media: self.emitting_media,
            trees: Default::default(),
            scene_centre: if center.is_finite() { center } else { Vec3::ZERO },
            scene_radius,
        }
    }
}

/// The lights of a scene.
#[derive(Clone, Debug)]
pub struct LightSet {
    /// The lights; a [`LightId`] is an index.
    pub lights: Vec<Light>,
    /// Infinite lights, which rays that leave the scene hit, ascending.
    pub infinite: Vec<LightId>,
    /// Luminance of the power of each light.
    pub(super) powers: Vec<f32>,
    /// Lights with power, ascending.
    pub lit: Vec<LightId>,
    /// Layers of the image by groups of lights.
    pub layers: LightLayers,
    /// For each geometry up to the last that emits, its index in `emitting`, if it emits.
    place_of: Vec<Option<u32>>,
    /// Sorted by geometry.
    emitting: Vec<EmittingGeometry>,
    /// Emitting media, by medium.
    emitting_media: Vec<Option<EmittingMedium>>,
    /// The light trees without and with emitting media, once they are needed.
    trees: [OnceLock<Arc<LightTree>>; 2],
    /// Centre of the scene's bounding sphere; the origin for an empty scene.
    pub scene_centre: Vec3,
    /// Radius of the scene's bounding sphere; 1 for a scene without extent.
    pub scene_radius: f32,
}

impl LightSet {
    /// The bounding sphere of the scene.
    pub fn scene_sphere(&self) -> Sphere {
        Sphere { center: self.scene_centre, radius: self.scene_radius }
    }

    /// False only if no emitter can occlude another light or itself from any point, as for lamps in one ceiling.
    pub fn may_hide_each_other(&self) -> bool {
        if self.emitting.is_empty() {
            return false;
        }
        if !self.infinite.is_empty() {
            return true;
        }
        let area = || self.lights.iter().filter_map(|l| if let Light::Area(area) = l { Some(area) } else { None });
        let all = area().fold(Bounds3::EMPTY, |b, light| b.union(light.bounds().bounds));
        let tolerance = 1e-5 * all.diagonal().length();
        area().any(|light| {
            let (p, n) = match &light.shape {
                AreaShape::Triangle(t) => (t.p[0], t.n),
                AreaShape::Rectangle(r) => (r.corner, r.n),
                AreaShape::Quadric(_) | AreaShape::Patch(_) => return true,
            };
            // The corner of the bounds that lies farthest along the normal
            let corner = Vec3::select(n.cmpgt(Vec3::ZERO), all.max, all.min);
            light.emission.two_sided || n.dot(corner - p) > tolerance
        })
    }

    /// The infinite lights with power, ascending.
    pub(super) fn lit_infinite(&self) -> impl Iterator<Item = LightId> {
        self.lit.iter().copied().filter(|&light| self.lights[light as usize].is_infinite())
    }

    /// The light tree, built at the first call; `volumes`: with the emitting parts of media.
    pub(super) fn tree(&self, volumes: bool) -> &Arc<LightTree> {
        let volumes = volumes && self.has_volume_lights();
        let holds = |light: &Light| volumes || !matches!(light, Light::Volume(_));
        self.trees[usize::from(volumes)].get_or_init(|| Arc::new(LightTree::new(&self.lights, holds)))
    }

    /// The choice by the light tree, with the probability `infinite_fraction` of the infinite lights (see
    /// [`TreeChoice::new`]).
    pub(super) fn tree_choice(&self, infinite_fraction: Option<f32>, volumes: bool) -> TreeChoice {
        TreeChoice::new(Arc::clone(self.tree(volumes)), self.lit_infinite().collect(), infinite_fraction)
    }

    /// The area lights with their geometries.
    pub fn emitters(&self) -> impl Iterator<Item = (GeometryId, LightId)> {
        let lights = |e: &'_ EmittingGeometry| {
            let (geometry, first_light) = (e.geometry, e.first_light);
            e.light_of_primitive.iter().map(move |&i| (geometry, first_light + i)).collect::<Vec<_>>()
        };
        self.emitting.iter().flat_map(lights)
    }

    /// True if any primitive of the geometry emits.
    pub fn emits(&self, geometry: GeometryId) -> bool {
        self.place_of.get(geometry as usize).is_some_and(Option::is_some)
    }

    /// The light that a primitive of a geometry belongs to, if it emits.
    #[inline]
    pub fn light_of(&self, geometry: GeometryId, primitive: u32) -> Option<LightId> {
        let place = (*self.place_of.get(geometry as usize)?)?;
        let e = &self.emitting[place as usize];
        e.light_of_primitive.get(primitive as usize).map(|&i| e.first_light + i)
    }

    /// For each light, the index of its geometry among the emitting geometries; `None` for lights without geometry.
    pub fn sources(&self) -> Vec<Option<u32>> {
        let mut sources = vec![None; self.lights.len()];
        for (source, e) in (0..).zip(&self.emitting) {
            e.light_of_primitive.iter().for_each(|i| sources[(e.first_light + i) as usize] = Some(source));
        }
        sources
    }

    /// True if any emitting medium is a light.
    pub fn has_volume_lights(&self) -> bool {
        self.emitting_media.iter().flatten().any(|medium| medium.lights.iter().any(Option::is_some))
    }

    /// The light of the part of a medium that contains a point of its unit cube; `None` if the part is dark.
    #[inline]
    pub fn volume_light_at(&self, medium: MediumId, unit: Vec3) -> Option<LightId> {
        let medium = self.emitting_media.get(medium as usize)?.as_ref()?;
        medium.lights[medium.parts.at(unit)]
    }

    /// Rate of emission lookups along camera rays (1/m), by the size of the emitting region; 0 if the medium does not
    /// emit.
    #[inline]
    pub fn emission_lookup_rate(&self, medium: MediumId) -> f32 {
        self.emitting_media.get(medium as usize).and_then(Option::as_ref).map_or(0.0, |medium| medium.rate)
    }

    /// The medium of a light; `None` for other lights.
    #[inline]
    pub fn medium_of(&self, light: LightId) -> Option<MediumId> {
        if let Some(Light::Volume(volume)) = self.lights.get(light as usize) { Some(volume.id) } else { None }
    }

    /// Samples a direction to the light of `choice`. `pdf` of the sample includes the probability of the choice: it is
    /// per steradian, or a probability for delta lights.
    #[inline]
    pub fn sample_choice(&self, ctx: &LightCtx, choice: SampledLight, u: [f32; 2]) -> Option<SampleOfLight> {
        let sample = self.lights[choice.light as usize].sample_li(ctx, u)?;
        let pdf = sample.pdf * choice.pmf;
        let sample = LightSample { pdf, ..sample };
        (pdf > 0.0 && pdf.is_finite()).then_some(SampleOfLight { light: choice.light, sample })
    }

    /// Radiance that all infinite lights send along a ray that leaves the scene from `p` in direction `w`.
    #[inline]
    pub fn le(&self, p: Vec3, w: Vec3) -> Rgb {
        self.infinite.iter().map(|&i| self.lights[i as usize].le(p, w)).sum()
    }
}
