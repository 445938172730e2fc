//! The end of an import: reads all files in parallel, and assembles the scene in text order.

use super::descriptions::{AreaLightDesc, InstanceDesc, ShapeDesc};
use super::instances::{Objects, flattened, rendered};
use super::lights::power_factor;
use super::measured;
use super::media::MediaInUse;
use super::options::ParsedOptions;
use super::ptex;
use super::settings::Placed;
use super::shapes::{Made, ShapeError};
use super::state::Builder;
use super::transform::Ctm;
use crate::geometry::{Geometry, GeometryId, GeometrySet, Group, GroupId, Instance, Shape, Visibility};
use crate::imaging::oiio::ImageError;
use crate::import::cache::FileCache;
use crate::import::images::RgbImage;
use crate::import::resources::report;
use crate::lights::{Cover, Emission, EmissionImage, LightSetBuilder, area_lights_of};
use crate::materials::{Material, MaterialId, MaterialSet};
use crate::media::Medium;
use crate::scene::{Choices, Scene, Surface};
use crate::settings::Settings;
use crate::textures::TextureSet;
use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::ply::PlyMesh;
use lumiris_formats::source::Span;
use lumiris_numbers::math::origin::rebased;
use lumiris_numbers::math::{DAffine3, DVec3, Rgb};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What shapes of a group that moves have in common.
#[derive(Clone, Copy, PartialEq)]
struct Together {
    object: Option<usize>,
    motion: Ctm,
    /// The origin of the group in its object or in the world.
    origin: DVec3,
}

/// Geometry during assembly.
#[derive(Default)]
struct Assembly {
    set: GeometrySet,
    surfaces: Vec<Surface>,
    /// Emitters, with their emission and light groups.
    emitters: Vec<(GeometryId, Emission, Option<Arc<str>>)>,
    /// Opening and closing of the shutter as fractions of the motion.
    shutter: [f32; 2],
    /// Images that area lights emit.
    images: HashMap<PathBuf, Arc<EmissionImage>>,
    media: MediaInUse,
    /// By object, groups that move within it or are far from its origin, with their transforms.
    moving: Vec<Vec<(GroupId, Vec<DAffine3>)>>,
    /// The last group that moves.
    last_moving: Option<(Together, GroupId)>,
    /// Groups far from the origin of their object, by the index of the object and their own origin.
    far: HashMap<(usize, [u64; 3]), GroupId>,
}

impl Assembly {
    /// The group of static shapes in an object that have this origin.
    fn in_object(&mut self, object: usize, origin: DVec3) -> &mut Group {
        if origin == DVec3::ZERO {
            return &mut self.set.groups[object];
        }
        let group = *self.far.entry((object, origin.to_array().map(f64::to_bits))).or_insert_with(|| {
            let group = self.set.groups.len() as GroupId;
            self.set.groups.push(Group::default());
            self.moving[object].push((group, vec![DAffine3::from_translation(origin)]));
            group
        });
        &mut self.set.groups[group as usize]
    }
}

impl Assembly {
    /// Adds the shapes of a singular instance to the root.
    fn add_flat(&mut self, instance: &Instance, span: Span, d: &mut Diagnostics) {
        let [world_from_group] = instance.world_from_group[..] else {
            d.error(span, "an object cannot be flattened while it moves");
            return;
        };

        // Copies of the shapes, in world space
        let mut is_flat = true;
        for id in self.set.groups[instance.group as usize].geometries.clone() {
            let Geometry { shape, alpha, visibility } = &self.set.geometries[id as usize];
            let Some(shape) = flattened(shape, &world_from_group) else {
                is_flat = false;
                continue;
            };
            let geometry = Geometry { shape, alpha: *alpha, visibility: *visibility };
            self.set.root.geometries.push(self.set.geometries.len() as GeometryId);
            self.set.geometries.push(geometry);
            self.surfaces.push(self.surfaces[id as usize].clone());
        }
        if !is_flat {
            let message =
                "spheres, cylinders and curves of the object cannot be flattened: the transformation has no inverse";
            d.error(span, message);
        }
    }
}

impl Builder<'_> {
    /// Reads the files that the text names and builds the scene; `None` after an error. Also returns its settings, and
    /// the settings that the text gives.
    pub fn finish(mut self, files: &FileCache, d: &mut Diagnostics) -> Option<(Scene, Settings, Placed)> {
        let options = self.options.finish(self.load_options, d);

        // Read all files even after errors, so that one run reports all missing ones
        let mut shapes = std::mem::take(&mut self.shapes);
        self.place_single_objects(&mut shapes);
        let environment_paths: Vec<PathBuf> = self.environments.iter().map(|e| e.path.clone()).collect();
        let emission_paths = self.emission_image_paths();
        // Images first: while one thread loads the image library, the others process meshes and coats
        let ((images, emission_images, texture_images, face_maps, measured), (made, materials)) = rayon::join(
            || {
                let emission_images = load_emission_images(&emission_paths, files);
                let textures = self.resources.load(files, d);
                let face_maps = ptex::load(self.face_maps.list(), files);
                let measured = measured::load(self.measured_files.list(), files);
                (load_images(&environment_paths, files), emission_images, textures, face_maps, measured)
            },
            || {
                rayon::join(
                    || make_shapes(&mut shapes, files, None),
                    || MaterialSet::new(self.materials.clone(), &self.textures),
                )
            },
        );
        self.textures.images = texture_images;
        self.textures.face_maps = ptex::check(face_maps, self.face_maps.list(), d);
        let materials = materials.with_measured(measured::check(measured, self.measured_files.list(), d));
        let made = if d.has_errors() { made } else { with_displaced(made, &mut shapes, files, &self.textures) };
        self.add_environments(images, d);
        let images = self.check_emission_images(emission_images, &shapes, d);

        // Assemble the geometry
        let shutter = options.as_ref().map_or([0.0, 1.0], |s| s.shutter);
        self.load_volumes(files, d);
        let mut media = self.media_in_use(&shapes, d);
        self.add_interiors(&mut media, &shapes, d);
        let mut assembly = Assembly { shutter, images, media, ..Assembly::default() };
        assembly.set.groups.resize_with(self.objects.len(), Group::default);
        assembly.moving.resize_with(self.objects.len(), Vec::new);
        for (desc, made) in shapes.iter().zip(made) {
            let Some(made) = made else { continue };
            let material = self.material_of(&desc.material, d);
            match (made, material) {
                (Ok(made), Some(material)) => {
                    made.warnings.iter().for_each(|w| {
                        d.warning_first(desc.span, w.clone());
                    });
                    self.place(&mut assembly, desc, made, material, d);
                }
                (Err(ShapeError::Missing(path, reason)), _) => d.missing_file(path, reason, Some(desc.span)),
                (Err(ShapeError::Wrong(reason)), _) => {
                    d.error(desc.span, reason);
                }
                (Ok(_), None) => {}
            }
        }
        let objects = Objects { objects: &self.objects, moving: &assembly.moving, shutter, origin: self.origin };
        match objects.place(&self.instances) {
            Ok(placed) => {
                assembly.set.instances.extend(placed.instances);
                placed.flat.iter().for_each(|(instance, span)| assembly.add_flat(instance, *span, d));
            }
            Err(reason) => {
                d.error_without_place(reason);
            }
        }
        if d.has_errors() {
            return None;
        }
        let ParsedOptions { camera, film, settings, given, .. } = options?;

        // Lights
        let mut lights = LightSetBuilder::default();
        for (light, group) in self.lights.into_iter().zip(self.light_groups) {
            lights.in_group(group).add(light);
        }
        let (geometry, textures) = (Arc::new(assembly.set), Arc::new(self.textures));
        for (id, emission, group) in assembly.emitters {
            // As in pbrt-v4, an emitter with an alpha of 0 everywhere is an invisible light
            let is_unseen = |cover: &Arc<Cover>| textures.constant_float(cover.texture) == Some(0.0);
            let cover = Cover::of(&geometry, id, Arc::clone(&textures) as _).filter(|cover| !is_unseen(cover));
            let shape = &geometry.geometries[id as usize].shape;
            lights.in_group(group).add_area(id, shape, &Emission { cover, ..emission });
        }
        lights.in_group(None).add_media(&assembly.media.set);
        let bounds = geometry.world_bounds();
        for (_, span) in self.portals.iter().filter(|(portal, _)| !portal.lights(&bounds)) {
            let message = "no shape is on the side of the portal that is lit: its light will not be seen";
            d.warning_once(*span, message).map(|w| w.help("reverse the order of its corners"));
        }
        let lights = lights.build(&bounds);
        if lights.lit.is_empty() && !assembly.media.set.media.iter().any(Medium::is_emissive) {
            d.warning_without_place("nothing emits light: the image will be black");
        }
        let scene = Scene {
            camera,
            film,
            materials: materials.find_caustics(&textures),
            textures,
            geometry,
            surfaces: assembly.surfaces,
            lights: Arc::new(lights),
            media: assembly.media.set,
            choices: Choices::default(),
            origin: self.origin,
        };
        Some((scene, settings, given))
    }

    /// Moves the shapes of objects that have one instance, without motion, to the place of the instance. So they need no
    /// group, and no acceleration structure of their own.
    fn place_single_objects(&mut self, shapes: &mut [ShapeDesc]) {
        let mut counts = vec![0_u32; self.objects.len()];
        let nested = self.objects.iter().flat_map(|object| &object.instances);
        nested.chain(&self.instances).for_each(|instance| counts[instance.object] += 1);
        let mut placements: Vec<Option<Ctm>> = vec![None; self.objects.len()];
        for InstanceDesc { object, ctm, .. } in &self.instances {
            let is_single = counts[*object] == 1 && self.objects[*object].instances.is_empty();
            placements[*object] = Some(*ctm).filter(|ctm| is_single && !ctm.is_moving() && ctm.is_invertible());
        }
        for shape in shapes.iter().filter(|shape| !shape.can_leave_object()) {
            shape.object.inspect(|&object| placements[object] = None);
        }

        for shape in shapes {
            let Some(placement) = shape.object.and_then(|object| placements[object]) else { continue };
            shape.ctm = shape.ctm.within(&placement);
            shape.object = None;
        }
        self.instances.retain(|instance| placements[instance.object].is_none());
        self.instances.shrink_to_fit();
    }

    /// Adds the shapes of one description to their group, to the root, or to an instance of their own if they move.
    fn place(&self, assembly: &mut Assembly, desc: &ShapeDesc, made: Made, material: MaterialId, d: &mut Diagnostics) {
        let moving = desc.ctm.is_moving();
        let sides = assembly.media.sides(&desc.media, material);
        let passes = matches!(self.materials[material as usize].material, Material::Interface);
        let mut ids = Vec::new();
        for shape in made.shapes {
            let id = assembly.set.geometries.len() as GeometryId;
            let emission = desc.area_light.as_ref().and_then(|light| match (desc.object, moving) {
                (Some(_), _) => {
                    d.warning_once(
                        light.span,
                        "area lights in objects are not rendered, as in pbrt-v4: the shape is dark",
                    );
                    None
                }
                (None, true) => {
                    d.warning_once(light.span, "moving area lights are not rendered, as in pbrt-v4: the shape is dark");
                    None
                }
                (None, false) if passes => {
                    d.warning_once(light.span, "a surface that only bounds a medium does not emit, as in pbrt-v4");
                    None
                }
                (None, false) => Some((emission_of(light, &shape, &assembly.images), light.group.clone())),
            });
            if passes && emission.is_none() && sides.is_none() {
                // No scattering, and the same medium on both sides: rays need not stop.
                continue;
            }
            assembly.emitters.extend(emission.map(|(emission, group)| (id, emission, group)));
            assembly.set.geometries.push(Geometry { shape, alpha: desc.alpha, visibility: Visibility::ALL });
            assembly.surfaces.push(Surface { material, name: desc.name.clone(), sides });
            ids.push(id);
        }
        match (desc.object, moving) {
            (Some(object), false) => assembly.in_object(object, made.origin).geometries.extend(ids),
            (None, false) => assembly.set.root.geometries.extend(ids),
            (object, true) => {
                let together = Together { object, motion: desc.ctm.motion(), origin: made.origin };
                let group = match assembly.last_moving {
                    Some((last, group)) if last == together => group,
                    _ => self.add_moving_group(assembly, together),
                };
                assembly.last_moving = Some((together, group));
                assembly.set.groups[group as usize].geometries.extend(ids);
            }
        }
    }

    /// Adds a group that moves in an object or in the world.
    fn add_moving_group(&self, assembly: &mut Assembly, together: Together) -> GroupId {
        let Together { object, motion, origin } = together;
        let group = assembly.set.groups.len() as GroupId;
        assembly.set.groups.push(Group::default());
        let samples = motion.samples(assembly.shutter);
        match object {
            Some(object) => {
                let placements = samples.iter().map(|m| rebased(m, DVec3::ZERO, origin)).collect();
                assembly.moving[object].push((group, placements));
            }
            None => {
                let world_from_group = rendered(&samples, self.origin, origin);
                assembly.set.instances.push(Instance { group, world_from_group });
            }
        }
        group
    }

    fn add_environments(&mut self, images: Vec<LoadedImage>, d: &mut Diagnostics) {
        for (desc, image) in self.environments.iter().zip(images) {
            match image {
                Ok(image) => {
                    let (texels, size) = Arc::unwrap_or_clone(image);
                    if let Some(light) = desc.light(texels, size, d) {
                        self.lights[desc.index] = light;
                    }
                }
                Err(error) => report(&error, &desc.path, desc.span, d),
            }
        }
    }

    fn emission_image_paths(&self) -> Vec<PathBuf> {
        let mut paths: Vec<PathBuf> = self.emission_images.clone();
        paths.sort();
        paths.dedup();
        paths
    }

    fn check_emission_images(
        &self,
        images: Vec<(PathBuf, Result<EmissionImage, EmissionError>)>,
        shapes: &[ShapeDesc],
        d: &mut Diagnostics,
    ) -> HashMap<PathBuf, Arc<EmissionImage>> {
        let mut found = HashMap::new();
        // The first source position of each file
        let users = shapes.iter().rev().filter_map(|s| s.area_light.as_ref()?.image.as_ref());
        let spans: HashMap<&PathBuf, Span> = users.map(|(path, span)| (path, *span)).collect();
        for (path, image) in images {
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
}

type LoadedImage = Result<Arc<RgbImage>, ImageError>;

fn load_images(paths: &[PathBuf], files: &FileCache) -> Vec<LoadedImage> {
    paths.par_iter().map(|path| files.rgb(path)).collect()
}

/// Makes all shapes. If meshes are cached for other scenes, each file is read once. Otherwise a mesh is transformed as
/// soon as it has been read, so that there is one copy. Shapes that need texture images are made last.
fn with_displaced(
    made: Vec<Option<Result<Made, ShapeError>>>,
    shapes: &mut [ShapeDesc],
    files: &FileCache,
    textures: &TextureSet,
) -> Vec<Option<Result<Made, ShapeError>>> {
    let displaced = make_shapes(shapes, files, Some(textures));
    made.into_iter().zip(displaced).map(|(made, displaced)| made.or(displaced)).collect()
}

/// Makes either the shapes displaced by `textures`, or, without these, all other shapes.
fn make_shapes(
    shapes: &mut [ShapeDesc],
    files: &FileCache,
    textures: Option<&TextureSet>,
) -> Vec<Option<Result<Made, ShapeError>>> {
    let is_meant = |shape: &ShapeDesc| shape.displacement.is_some() == textures.is_some();
    let nothing = TextureSet::default();
    let textures = textures.unwrap_or(&nothing);
    let paths: BTreeSet<&Path> =
        shapes.iter().filter(|s| files.keeps() && is_meant(s)).filter_map(|s| s.source.file()).collect();
    let paths: Vec<PathBuf> = paths.into_iter().map(Path::to_path_buf).collect();
    // Shapes report their unreadable files
    let meshes = paths.into_par_iter().filter_map(|path| files.mesh(&path).ok().map(|mesh| (path, mesh)));
    let meshes: HashMap<PathBuf, Arc<PlyMesh>> = meshes.collect();
    let mesh = |path: &Path| meshes.get(path).map_or_else(|| files.mesh(path), |mesh| Ok(Arc::clone(mesh)));
    shapes.par_iter_mut().map(|shape| is_meant(shape).then(|| shape.make(&mesh, textures))).collect()
}

enum EmissionError {
    Image(ImageError),
    Size(String),
}

fn load_emission_images(paths: &[PathBuf], files: &FileCache) -> Vec<(PathBuf, Result<EmissionImage, EmissionError>)> {
    let load = |path: &PathBuf| {
        let (texels, size) = Arc::unwrap_or_clone(files.rgb(path).map_err(EmissionError::Image)?);
        EmissionImage::new(size[0], size[1], texels).map_err(EmissionError::Size)
    };
    paths.par_iter().map(|path| (path.clone(), load(path))).collect()
}

/// The emission of a shape in world space.
fn emission_of(light: &AreaLightDesc, shape: &Shape, images: &HashMap<PathBuf, Arc<EmissionImage>>) -> Emission {
    let image = light.image.as_ref().and_then(|(path, _)| images.get(path).cloned());
    let mut emission = Emission { two_sided: light.two_sided, image, ..Emission::constant(light.l) };
    if light.power > 0.0 {
        let area = area_lights_of(shape, &emission).lights.iter().map(|l| l.area()).sum();
        // The image replaces the colour: pbrt-v4 uses white here.
        let white = Emission { l: Rgb::WHITE, ..emission.clone() };
        emission.l *= power_factor(light, area, white.mean_luminance());
    }
    emission
}
