//! The end of an import: reads all files in parallel, and builds the scene.

use super::assembly::{Assembly, Emitter, MadeEarly};
use super::descriptions::ShapeDesc;
use super::files::{EmissionError, EmissionFile, ImageFiles, Images, Meshes};
use super::make_shapes::ShapeMaker;
use super::measured;
use super::options::ParsedOptions;
use super::ptex;
use super::settings::GivenSetting;
use super::state::Builder;
use crate::geometry::GeometrySet;
use crate::imaging::oiio::ImageError;
use crate::import::cache::FileCache;
use crate::import::images::RgbImage;
use crate::import::resources::{MEMORY_HELP, report};
use crate::lights::{AlphaMask, Emission, EmissionImage, LightSet, LightSetBuilder};
use crate::materials::MaterialSet;
use crate::media::{Medium, MediumSet};
use crate::scene::{Choices, Scene};
use crate::settings::Settings;
use crate::textures::TextureSet;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::source::Span;
use lumiris_numbers::math::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// An imported scene.
pub struct Finished {
    /// The scene.
    pub scene: Scene,
    /// Its settings.
    pub settings: Settings,
    /// The settings that the text gives.
    pub given: Vec<GivenSetting>,
}

/// The contents of a scene's files.
struct Contents<'a> {
    images: Images,
    meshes: MeshFiles<'a>,
    materials: MaterialSet,
}

impl Builder<'_> {
    /// Reads the files that the text names and builds the scene; `None` after an error.
    pub fn finish(mut self, files: &FileCache, d: &mut Diagnostics) -> Option<Finished> {
        let options = self.options.finish(self.load_options, d);

        // Read all files even after errors, so that one run reports all missing ones
        let mut shapes = std::mem::take(&mut self.shapes);
        self.place_single_objects(&mut shapes);
        let pixels = options.as_ref().map_or(0, |options| options.film.bounds.area());
        let Contents { images, meshes: MeshFiles { meshes, made }, materials } =
            self.read_files(&mut shapes, pixels, files, d)?;

        // Put their contents in place
        self.textures.images = images.textures;
        self.textures.face_maps = ptex::check(images.face_maps, self.face_maps.list(), d);
        let measured = measured::check(images.measured, self.measured_files.list(), d);
        let materials = materials.with_measured(measured);
        self.add_environments(images.environments, d);
        let emission_images = check_emission_images(images.emission, &shapes, d);

        // Assemble the geometry
        self.load_volumes(files, d);
        let mut media = self.media_in_use(&shapes, d);
        self.add_interiors(&mut media, &shapes, d);
        let shutter = options.as_ref().map_or([0.0, 1.0], |options| options.shutter);
        let mut assembly = Assembly::new(self.objects.len(), shutter, emission_images, media);
        let maker = ShapeMaker { origin: self.origin, meshes: &meshes, textures: &self.textures };
        self.place_shapes(&mut assembly, shapes, made, &maker, d);
        self.place_instances(&mut assembly, d);
        if d.has_errors() {
            return None;
        }

        // Add lights
        let ParsedOptions { camera, film, settings, given, .. } = options?;
        let Assembly { set, surfaces, emitters, media, .. } = assembly;
        let geometry = Arc::new(set);
        let textures = Arc::new(std::mem::take(&mut self.textures));
        let lights = self.light_set(emitters, &geometry, &textures, &media.set, d);
        let scene = Scene {
            camera,
            film,
            materials: materials.find_caustics(&textures),
            textures,
            geometry,
            surfaces,
            lights: Arc::new(lights),
            media: media.set,
            choices: Choices::default(),
            origin: self.origin,
        };
        Some(Finished { scene, settings, given })
    }

    /// Reads all files but volumes, and makes the shapes of those that need no textures. `None` if the scene does not
    /// fit into memory.
    fn read_files<'a>(
        &self,
        shapes: &mut [ShapeDesc],
        pixels: usize,
        files: &'a FileCache,
        d: &mut Diagnostics,
    ) -> Option<Contents<'a>> {
        let mut account = self.account(shapes, files);
        account.reserve_image(pixels);
        if let Some(refusal) = files.refusal(&account) {
            d.error_without_place(refusal).help(MEMORY_HELP);
            return None;
        }
        let (wanted, origin) = (ImageFiles::of(self), self.origin);
        let (entries, textures) = (self.materials.clone(), &self.textures);

        // Images first: while one thread loads the image library, the others process meshes and coats
        let (images, (meshes, materials)) = rayon::join(
            || wanted.read(files, account, d),
            || rayon::join(|| MeshFiles::read(shapes, files, origin), || MaterialSet::new(entries, textures)),
        );
        Some(Contents { images: images?, meshes, materials })
    }

    fn add_environments(&mut self, images: Vec<Result<Arc<RgbImage>, ImageError>>, d: &mut Diagnostics) {
        for (desc, image) in self.environments.iter().zip(images) {
            match image {
                Ok(image) => {
                    if let Some(light) = desc.light(Arc::unwrap_or_clone(image), d) {
                        self.lights[desc.index] = light;
                    }
                }
                Err(error) => report(&error, &desc.path, desc.span, d),
            }
        }
    }

    /// The lights of directives, emitting shapes and media.
    fn light_set(
        &mut self,
        emitters: Vec<Emitter>,
        geometry: &Arc<GeometrySet>,
        textures: &Arc<TextureSet>,
        media: &MediumSet,
        d: &mut Diagnostics,
    ) -> LightSet {
        let mut lights = LightSetBuilder::default();
        for (light, group) in std::mem::take(&mut self.lights).into_iter().zip(self.light_groups.drain(..)) {
            lights.in_group(group).add(light);
        }

        // Emitting shapes and media
        for Emitter { geometry: id, emission, group } in emitters {
            // As in pbrt-v4, an emitter with an alpha of 0 everywhere is an invisible light
            let is_invisible = |mask: &Arc<AlphaMask>| textures.constant_float(mask.texture) == Some(0.0);
            let alpha = AlphaMask::of(geometry, id, Arc::clone(textures) as _).filter(|mask| !is_invisible(mask));
            let shape = &geometry.geometries[id as usize].shape;
            lights.in_group(group).add_area(id, shape, &Emission { alpha, ..emission });
        }
        lights.in_group(None).add_media(media);

        // Warn about light that nothing receives, and about darkness
        let bounds = geometry.world_bounds();
        for (_, span) in self.portals.iter().filter(|(portal, _)| !portal.lights(&bounds)) {
            let message = "no shape is on the side of the portal that is lit: its light will not be seen";
            d.warning_once(*span, message).map(|w| w.help("reverse the order of its corners"));
        }
        let lights = lights.build(&bounds);
        if lights.lit.is_empty() && !media.media.iter().any(Medium::is_emissive) {
            d.warning_without_place("nothing emits light: the image will be black");
        }
        lights
    }
}

/// PLY files, and their shapes.
struct MeshFiles<'a> {
    meshes: Meshes<'a>,
    /// Shapes that need no textures.
    made: MadeEarly,
}

impl<'a> MeshFiles<'a> {
    /// Reads the files, and makes their shapes, except for those that are displaced by textures.
    fn read(shapes: &mut [ShapeDesc], files: &'a FileCache, origin: DVec3) -> Self {
        let meshes = Meshes::new(files, shapes.iter().filter_map(|shape| shape.source.file()));
        let textures = TextureSet::default();
        let maker = ShapeMaker { origin, meshes: &meshes, textures: &textures };
        let is_early = |shape: &ShapeDesc| shape.source.file().is_some() && shape.displacement.is_none();
        let early = shapes.par_iter_mut().enumerate().filter(|(_, shape)| is_early(shape));
        let made = early.map(|(i, shape)| (i, maker.make(shape))).collect();
        MeshFiles { meshes, made }
    }
}

/// The images of area lights; errors go to `d`.
fn check_emission_images(
    images: Vec<EmissionFile>,
    shapes: &[ShapeDesc],
    d: &mut Diagnostics,
) -> HashMap<PathBuf, Arc<EmissionImage>> {
    // The first source position of each file
    let users = shapes.iter().rev().filter_map(|s| s.area_light.as_ref()?.image.as_ref());
    let spans: HashMap<&PathBuf, Span> = users.map(|(path, span)| (path, *span)).collect();

    let mut found = HashMap::new();
    for EmissionFile { path, image } in images {
        let span = spans.get(&path).copied().unwrap_or_default();
        match image {
            Ok(image) => {
                found.insert(path, Arc::new(image));
            }
            Err(EmissionError::Image(error)) => report(&error, &path, span, d),
            Err(EmissionError::Size(reason)) => {
                d.error(span, reason);
            }
        }
    }
    found
}
