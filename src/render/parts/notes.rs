//! Entries of files of sums: settings, which are equal in all parts of an image, and notes, which are needed to resume
//! and merge.

use super::error::PartError;
use super::header::{FilmHeader, list};
use super::stored::Stored;
use crate::cameras::Camera;
use crate::imaging::TextEntries;
use crate::import::LoadOptions;
use crate::import::gltf::LightUnits;
use crate::render::output::{self, Aov};
use crate::render::render_settings::RenderSettings;
use crate::scene::{AccelKind, Choices, RenderJob};

/// Note: the layers of the image.
const AOV: &str = "aov";
/// Note: the path of the scene.
pub(super) const SCENE_NOTE: &str = "scene";
/// Note: the time of the rendering (s).
pub(in crate::render) const SECONDS: &str = "seconds";
/// Notes: the camera matrices.
const MATRICES: [&str; 2] = ["camera_from_world", "ndc_from_world"];
/// Setting: the layers of the sums besides radiance, and the word for features of the first surfaces.
const LAYERS: &str = "layers";
const FEATURES: &str = "features";

/// Options of a rendering besides its settings and extent.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// Name of the scene in metadata.
    pub scene: String,
    /// Options of the import.
    pub load: LoadOptions,
    /// True if a box filter of one pixel replaces the filter of the scene.
    pub box_filter: bool,
    /// The ray tracer.
    pub accel: AccelKind,
    /// The layers of the image; the default ones if `None`.
    pub aovs: Option<Vec<Aov>>,
}

impl Asked {
    /// Fills in stored options where no option is given now.
    pub fn complete(&mut self, stored: &Stored) -> Result<(), PartError> {
        // Size
        let note = |name| stored.header.note(name).filter(|text| !text.is_empty());
        let wrong = |name: &str| stored.foreign(&format!("the stored {name} means nothing"));
        let load = &mut self.load;
        if let (None, Some(text)) = (load.resolution, note("resolution")) {
            let is_size = |size: &[u32; 2]| size.iter().all(|n| (1..=1 << 16).contains(n));
            load.resolution = Some(list(text, 'x').filter(is_size).ok_or_else(|| wrong("resolution"))?);
        }
        if let (None, Some(text)) = (load.crop, note("crop")) {
            let is_inside = |[x0, x1, y0, y1]: &[f32; 4]| {
                0.0 <= *x0 && x0 < x1 && *x1 <= 1.0 && 0.0 <= *y0 && y0 < y1 && *y1 <= 1.0
            };
            load.crop = Some(list(text, ',').filter(is_inside).ok_or_else(|| wrong("crop window"))?);
        }

        // Scene and camera
        if let (AccelKind::Embree, Some(accel)) = (self.accel, stored.header.setting("lumiris:accel")) {
            self.accel = accel.parse().map_err(|_| wrong("ray tracer"))?;
        }
        if let (None, Some(path)) = (&load.environment, note("environment")) {
            load.environment = Some(path.into());
        }
        if let (None, Some(name)) = (&load.scene, note("scene_in_file")) {
            load.scene = Some(name.to_owned());
        }
        match note("camera") {
            Some(name) if load.camera.is_none() && !load.camera_auto => load.camera = Some(name.to_owned()),
            _ => load.camera_auto |= load.camera.is_none() && note("camera_auto").is_some(),
        }
        if let (None, Some(name)) = (load.light_units, note("light_units")) {
            load.light_units = Some(name.parse().map_err(|_| wrong("unit of lights"))?);
        }
        if let (None, Some(text)) = (load.time, note("time_in_scene")) {
            load.time = Some(text.parse().ok().filter(|t| f32::is_finite(*t)).ok_or_else(|| wrong("time"))?);
        }

        // Filter and layers
        self.box_filter |= note("box_filter").is_some();
        if let (None, Some(text)) = (&self.aovs, note(AOV)) {
            self.aovs = Some(aovs(text).ok_or_else(|| wrong("list of layers"))?);
        }
        Ok(())
    }

    /// Notes, which may differ between parts; some are needed to resume.
    pub(in crate::render) fn notes(&self, camera: &Camera) -> TextEntries {
        // One note per option that is given
        let LoadOptions { resolution, crop, environment, scene, camera: camera_name, camera_auto, light_units, time } =
            &self.load;
        let names = |aovs: &Vec<Aov>| match aovs[..] {
            [] => "none".to_owned(),
            _ => aovs.iter().map(<&str>::from).collect::<Vec<_>>().join(","),
        };
        let notes = [
            (SCENE_NOTE, Some(self.scene.clone())),
            ("resolution", resolution.map(|[w, h]| format!("{w}x{h}"))),
            ("crop", crop.map(|c| c.map(|v| v.to_string()).join(","))),
            ("environment", environment.as_ref().map(|path| path.display().to_string())),
            ("scene_in_file", scene.clone()),
            ("camera", camera_name.clone()),
            ("camera_auto", camera_auto.then(|| "true".to_owned())),
            ("light_units", light_units.map(|units| <&str>::from(units).to_owned())),
            ("time_in_scene", time.map(|time| time.to_string())),
            ("box_filter", self.box_filter.then(|| "true".to_owned())),
            (AOV, self.aovs.as_ref().map(names)),
        ];

        // Notes of the camera
        let notes = notes.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        notes.chain(CameraMatrices::of(camera).notes()).collect()
    }

    /// Settings that all parts of an image have in common.
    pub(in crate::render) fn described(&self, job: &RenderJob, settings: &RenderSettings) -> TextEntries {
        let mut entries = output::metadata(&job.world.scene.film, job.settings());
        entries.push(("lumiris:accel".to_owned(), <&str>::from(self.accel).to_owned()));
        let layers = [(settings.with_features, FEATURES), (settings.with_replicas, "variance")];
        let layers: Vec<&str> = layers.into_iter().filter(|(has, _)| *has).map(|(_, name)| name).collect();
        entries.push((LAYERS.to_owned(), layers.join(" ")));
        // Choices among the contents of the scene file, where the file does not decide
        let LoadOptions { camera_auto, light_units, time, .. } = &self.load;
        let Choices { cameras, scenes, camera, scene } = &job.world.scene.choices;
        let one_of = |index: &Option<usize>, names: &[String]| {
            let index = (*index)?;
            Some(format!("{index} {}", names.get(index).map_or("", String::as_str)).trim_end().to_owned())
        };
        let framing = || camera_auto.then(|| "one that frames the scene".to_owned());
        let units = light_units.filter(|units| *units != LightUnits::default());
        let shown = [
            ("scene_in_file", one_of(scene, scenes)),
            ("camera", one_of(camera, cameras).or_else(framing)),
            ("light_units", units.map(|units| <&str>::from(units).to_owned())),
            ("time_in_scene", time.map(|time| time.to_string())),
        ];
        entries.extend(shown.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))));
        // Join values with the same name
        let mut joined = TextEntries::new();
        for (key, value) in entries {
            match joined.iter_mut().find(|(other, _)| *other == key) {
                Some((_, values)) => *values = format!("{values}; {value}"),
                None => joined.push((key, value)),
            }
        }
        joined
    }
}

/// The layers listed in a note; `None` if one of them does not exist.
fn aovs(text: &str) -> Option<Vec<Aov>> {
    text.split(',').filter(|name| *name != "none").map(|name| name.parse().ok()).collect()
}

/// The layers requested for a rendering.
pub(super) fn asked_aovs(header: &FilmHeader) -> Option<Vec<Aov>> {
    header.note(AOV).and_then(aovs)
}

/// True if the sums include features of the first surfaces.
pub(super) fn has_features(header: &FilmHeader) -> bool {
    header.setting(LAYERS).is_some_and(|layers| layers.split(' ').any(|name| name == FEATURES))
}

/// Camera transforms, as columns of 4 × 4 matrices.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CameraMatrices {
    /// From world space to camera space.
    pub camera_from_world: Option<[f32; 16]>,
    /// From world space to normalised device coordinates.
    pub ndc_from_world: Option<[f32; 16]>,
}

impl CameraMatrices {
    /// The matrices of a camera.
    pub fn of(camera: &Camera) -> Self {
        CameraMatrices {
            camera_from_world: Some(camera.camera_from_world().to_cols_array()),
            ndc_from_world: camera.ndc_from_world().map(|m| m.to_cols_array()),
        }
    }

    /// The matrices as notes of a part.
    fn notes(&self) -> impl Iterator<Item = (String, String)> {
        let text = |m: [f32; 16]| m.map(|v| v.to_string()).join(",");
        let matrices = MATRICES.into_iter().zip([self.camera_from_world, self.ndc_from_world]);
        matrices.filter_map(move |(key, m)| Some((key.to_owned(), text(m?))))
    }

    /// The matrices in the notes of a part.
    pub fn from_notes<'a>(note: impl Fn(&str) -> Option<&'a str>) -> Self {
        let [camera_from_world, ndc_from_world] = MATRICES.map(|key| list(note(key)?, ','));
        CameraMatrices { camera_from_world, ndc_from_world }
    }
}
