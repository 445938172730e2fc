//! Rendering: options, and the work in a separate thread.

use crate::attendant::{Attendant, Event};
use crate::images::{Layer, Place, arrays, split};
use crate::parts::{PartOptions, Parts, in_words_of_python, part_error, place};
use crate::progress::Canvas;
use crate::settings::{Given, apply, named, parse};
use lumiris::film::filter::PixelFilter;
use lumiris::film::{Film, PixelBounds};
use lumiris::imaging::Image;
use lumiris::import::cache::FileCache;
use lumiris::import::fingerprint::SceneFiles;
use lumiris::import::gltf::LightUnits;
use lumiris::import::{LoadOptions, Loaded, load_text, load_with};
use lumiris::planning::allocation::complete_for_noise;
use lumiris::planning::preparation::{complete_for_time, pilot_deadline};
use lumiris::planning::{PlanError, Preparation, prepare};
use lumiris::render::cryptomatte::{Cryptomatte, cryptomattes};
use lumiris::render::output::{self, Aov, NamedImages};
use lumiris::render::parts::{Asked, PartError, Stored};
use lumiris::render::{Continuation, Progress, RenderError, RenderSettings, Rendering, resume};
use lumiris::render::{FilmFile, Storage};
use lumiris::scene::RenderJob;
use lumiris::settings::value::{Kind, Value};
use lumiris_formats::diagnostic::Report;
use lumiris_formats::source::Position;
use pyo3::exceptions::{PyException, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

pyo3::create_exception!(lumiris, SceneError, PyException, "A scene that cannot be loaded.");

/// The scene: a file, or a text with a name and the folder of its files.
#[derive(Debug, FromPyObject)]
enum Source {
    #[pyo3(transparent)]
    Text((String, String, PathBuf)),
    #[pyo3(transparent)]
    File(PathBuf),
}

/// Options of a rendering. Settings of the image are texts in `settings`.
#[derive(Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    source: Source,
    resolution: Option<[u32; 2]>,
    crop: Option<[f32; 4]>,
    box_filter: bool,
    accel: String,
    packet_width: Option<u32>,
    threads: Option<u32>,
    tile_size: u32,
    time: Option<f64>,
    environment: Option<PathBuf>,
    scene_in_file: Option<String>,
    camera: Option<String>,
    camera_auto: bool,
    light_units: Option<String>,
    time_in_scene: Option<f32>,
    texture_memory: Option<String>,
    texture_cache: Option<PathBuf>,
    aov: Option<Vec<String>>,
    cryptomatte: Vec<String>,
    interval: f64,
    settings: Vec<(String, String)>,
    parts: PartOptions,
}

/// The options, checked.
struct Request {
    source: Source,
    asked: Asked,
    /// Memory limit for textures (bytes).
    texture_memory: Option<u64>,
    texture_cache: Option<PathBuf>,
    packet_width: Option<u32>,
    render: RenderSettings,
    parts: Parts,
    cryptomatte: Vec<Cryptomatte>,
    interval: Duration,
    settings: Given,
}

/// Results of a rendering.
struct Done {
    layers: NamedImages,
    metadata: Vec<(String, String)>,
    place: Place,
    complete: bool,
    seconds: f64,
    warnings: Vec<String>,
}

/// Reason for a rendering without a result.
enum Failure {
    Scene(Box<Report>),
    Value(String),
    Part(PartError),
    Other(String),
    /// Ctrl-C or an exception ended the work before the first sample.
    Stopped,
}

impl Options {
    fn checked(self) -> PyResult<Request> {
        // Names
        let wrong = |text: String| Err(PyValueError::new_err(text));
        let accel = self.accel.parse().map_err(|_| PyValueError::new_err("accel: expected embree or bvh"))?;
        let parse_aov =
            |name: &String| name.parse().map_err(|_| PyValueError::new_err(format!("aov: there is no `{name}`")));
        let aov =
            self.aov.as_ref().map(|list| list.iter().map(parse_aov).collect::<PyResult<Vec<Aov>>>()).transpose()?;
        let cryptomatte = |name: &String| {
            name.parse()
                .map_err(|_| PyValueError::new_err(format!("cryptomatte: expected object or material, not `{name}`")))
        };
        let cryptomatte = self.cryptomatte.iter().map(cryptomatte).collect::<PyResult<Vec<Cryptomatte>>>()?;
        let texture_memory = self.texture_memory.as_deref().map(bytes).transpose()?;

        // Ranges of numbers
        if self.resolution.is_some_and(|size| size.iter().any(|n| !(1..=65_536).contains(n))) {
            return wrong("resolution: expected two whole numbers from 1 to 65536".to_owned());
        }
        if let Some([x0, x1, y0, y1]) = self.crop
            && !(0.0 <= x0 && x0 < x1 && x1 <= 1.0 && 0.0 <= y0 && y0 < y1 && y1 <= 1.0)
        {
            return wrong("crop: expected 0 <= x0 < x1 <= 1 and 0 <= y0 < y1 <= 1".to_owned());
        }
        if self.packet_width.is_some_and(|width| ![1, 4, 8, 16].contains(&width)) {
            return wrong("packet_width: expected 1, 4, 8 or 16".to_owned());
        }
        for (name, n) in [("threads", self.threads.unwrap_or(1)), ("tile_size", self.tile_size)] {
            if !(1..=4096).contains(&n) {
                return wrong(format!("{name}: expected a whole number from 1 to 4096"));
            }
        }

        // Times, part and light units
        let seconds = |name: &str, seconds: f64| {
            let duration = Duration::try_from_secs_f64(seconds).ok().filter(|duration| !duration.is_zero());
            duration.ok_or_else(|| PyValueError::new_err(format!("{name}: expected a positive number of seconds")))
        };
        let render = RenderSettings {
            threads: self.threads.map(|t| t as usize),
            tile_size: self.tile_size,
            time_limit: self.time.map(|time| seconds("time", time)).transpose()?,
            ..RenderSettings::default()
        };
        let parts = self.parts.checked(self.time.is_some())?;
        if parts.extent.is_partial() && !cryptomatte.is_empty() {
            return wrong("cryptomatte needs the whole image, not a part".to_owned());
        }
        let light_units = self.light_units.as_deref().map(str::parse::<LightUnits>).transpose();
        let light_units = light_units.map_err(|_| PyValueError::new_err("light_units: expected watt or candela"))?;
        let load = LoadOptions {
            resolution: self.resolution,
            crop: self.crop,
            environment: self.environment,
            scene: self.scene_in_file,
            camera: self.camera,
            camera_auto: self.camera_auto,
            light_units,
            time: self.time_in_scene,
        };
        Ok(Request {
            asked: Asked { scene: self.source.name(), load, box_filter: self.box_filter, accel, aovs: aov },
            source: self.source,
            texture_memory,
            texture_cache: self.texture_cache,
            packet_width: self.packet_width,
            render,
            parts,
            cryptomatte,
            interval: seconds("interval", self.interval)?,
            settings: parse(&self.settings)?,
        })
    }
}

impl Source {
    /// The name of the scene in metadata.
    fn name(&self) -> String {
        match self {
            Source::File(path) => path.display().to_string(),
            Source::Text((_, name, _)) => name.clone(),
        }
    }
}

impl Request {
    /// Loads the scene and applies the settings, after the settings of the stored state.
    fn load(&self, asked: &Asked, files: &FileCache, stored: Option<&Stored>) -> Result<Loaded, Failure> {
        if let Some(bytes) = self.texture_memory {
            files.limit_textures(bytes);
        }
        if let Some(folder) = &self.texture_cache {
            let failed = |error| Failure::Other(format!("texture_cache: {}: {error}", folder.display()));
            files.cache_textures(folder).map_err(failed)?;
        }
        let loaded = match &self.source {
            Source::File(path) => load_with(path, &asked.load, files),
            Source::Text((text, name, folder)) => load_text(text, name, folder, &asked.load, files),
        };
        let mut loaded = loaded.map_err(Failure::Scene)?;
        if let Some(stored) = stored {
            stored.apply(&mut loaded.settings).map_err(Failure::Part)?;
        }
        apply(&self.settings, &mut loaded.settings);
        loaded.given.extend(named(&self.settings));
        if let Some(time) = self.render.time_limit.filter(|_| stored.is_none()) {
            let has_spp = self.spp().is_some();
            complete_for_time(&mut loaded.settings, has_spp, time, loaded.scene.film.bounds.area());
        }
        complete_for_noise(&mut loaded.settings, self.spp().is_some())
            .map_err(|needs| Failure::Value(format!("noise {needs}")))?;
        // Additional samples use the same preparation as the first ones
        if let Some(stored) = stored {
            loaded.settings.sampling.spp = stored.spp().map_err(Failure::Part)?;
        }
        if asked.box_filter {
            loaded.scene.film.filter = PixelFilter::Box { rx: 0.5, ry: 0.5 };
        }
        Ok(loaded)
    }

    /// The requested number of samples per pixel.
    fn spp(&self) -> Option<u32> {
        let (_, value) = self.settings.iter().find(|(row, _)| row.flag == "spp")?;
        value.integer().and_then(|n| u32::try_from(n).ok())
    }

    /// Does all the work. `events` is given if there is a callback.
    fn run(
        &self,
        stop: &AtomicBool,
        latest: &Mutex<Option<Progress>>,
        events: Option<Sender<Event>>,
    ) -> Result<Done, Failure> {
        let goes_on = || if stop.load(Ordering::Relaxed) { Err(Failure::Stopped) } else { Ok(()) };
        let other = |error: &dyn std::error::Error| Failure::Other(error.to_string());
        // Load
        let mut asked = self.asked.clone();
        let stored = self.parts.stored().map_err(Failure::Part)?;
        stored.as_ref().map_or(Ok(()), |stored| asked.complete(stored)).map_err(Failure::Part)?;
        let start = Instant::now();
        let textures = FileCache::default();
        let mut loaded = self.load(&asked, &textures, stored.as_ref())?;
        let mut warnings = Vec::from_iter(Some(loaded.warnings.to_string()).filter(|text| !text.is_empty()));
        if loaded.settings.integrator.leaves_lights_out() {
            warnings.push("without samples on non-contributing lights, direct light is biased".to_owned());
        }
        goes_on()?;

        // Build the ray tracer
        let (files, given) = (std::mem::take(&mut loaded.files), std::mem::take(&mut loaded.given));
        let mut job = loaded.job(asked.accel, self.packet_width).map_err(|error| other(&error))?;
        let extent = &self.parts.extent;
        let divided = extent.check_settings(job.settings());
        divided.map_err(|error| Failure::Value(in_words_of_python(&error)))?;
        goes_on()?;

        // Choose open settings
        let asks_for_ratio = asked.aovs.as_ref().is_some_and(|list| list.contains(&Aov::Ratio));
        let limit = self.render.time_limit.filter(|_| stored.is_none());
        let how = Preparation {
            threads: self.render.threads,
            ratio_map: asks_for_ratio,
            deadline: limit.and_then(|limit| pilot_deadline(start, limit)),
            stop,
            ..Preparation::default()
        };
        let before = *job.settings();
        let plan = prepare(&mut job, &how).map_err(|error| match error {
            PlanError::Stopped => Failure::Stopped,
            error => other(&error),
        })?;
        warnings.extend(plan.warnings);
        warnings.extend(given.without_effect(&before, job.settings()));

        // Render
        let mut settings = self.render_settings(&asked, &job);
        settings.time_limit = settings.time_limit.map(|limit| limit.saturating_sub(start.elapsed()));
        let (mut film_file, told) = self.film_file(&asked, &job, &files, &mut settings, stored)?;
        let continuation = film_file.as_mut().map_or_else(Continuation::default, FilmFile::continuation);
        let rendering =
            observed((&job, &settings), (stop, latest), events, continuation).map_err(|error| other(&error))?;
        warnings.extend(told.try_iter());
        warnings.extend(textures.take_texture_warnings());
        if let (Some(film_file), Some(path)) = (&mut film_file, &self.parts.file) {
            film_file.end(&rendering);
            film_file.write(path, &rendering).map_err(Failure::Part)?;
        }

        // Layers and metadata
        let (layers, metadata) = self.layers(&asked, (&job, &settings), &rendering)?;
        Ok(Done {
            layers,
            metadata,
            place: place(&rendering.film),
            complete: rendering.complete,
            seconds: rendering.elapsed.as_secs_f64(),
            warnings,
        })
    }

    /// The render settings for the requested layers.
    fn render_settings(&self, asked: &Asked, job: &RenderJob) -> RenderSettings {
        let needs = |is_shown: fn(&Aov) -> bool| asked.aovs.as_ref().is_none_or(|list| list.iter().any(is_shown));
        RenderSettings {
            spp: job.pixel_samples.as_ref().map_or(job.settings().sampling.spp, |of_pixels| of_pixels.spp),
            with_replicas: needs(|aov| *aov == Aov::Variance),
            with_features: needs(|aov| aov.is_feature()),
            with_light_layers: self.parts.file.is_some() || needs(|aov| *aov == Aov::LightGroups),
            ..self.render
        }
    }

    /// Sets the sample range of the rendering. Returns the file of sums, if any, and the receiver of its warnings.
    fn film_file(
        &self,
        asked: &Asked,
        job: &RenderJob,
        files: &SceneFiles,
        settings: &mut RenderSettings,
        stored: Option<Stored>,
    ) -> Result<(Option<FilmFile>, Receiver<String>), Failure> {
        let Parts { extent, file, checkpoint, .. } = &self.parts;
        let spp = settings.spp;
        let applied = extent.apply(settings, stored.as_ref(), self.spp());
        applied.map_err(|error| Failure::Value(in_words_of_python(&error)))?;
        let (warn, told) = channel();
        if file.is_none() && checkpoint.is_none() && stored.is_none() {
            return Ok((None, told));
        }
        let storage = Storage { checkpoint: checkpoint.clone(), keeps_sums: file.is_some(), stored };
        // Nobody receives after the rendering has ended: that is no error
        let warn = move |text: &str| drop(warn.send(text.to_owned()));
        let film_file = FilmFile::new(asked, job, files, settings, spp, storage, warn).map_err(Failure::Part)?;
        Ok((Some(film_file), told))
    }

    /// The layers and the metadata of the image.
    fn layers(
        &self,
        asked: &Asked,
        (job, settings): (&RenderJob, &RenderSettings),
        rendering: &Rendering,
    ) -> Result<(NamedImages, Vec<(String, String)>), Failure> {
        // Layers of the film
        let has = (job.sample_count_map.is_some(), rendering.cache.is_some());
        let aovs = asked.aovs.clone().unwrap_or_else(|| output::default_aovs(&rendering.film, has.0, has.1));
        let mut layers = output::layers(&rendering.film, &aovs, job.sample_count_map.as_ref());
        let mut metadata = output::metadata(&job.world.scene.film, job.settings());
        metadata.push(("lumiris:scene".to_owned(), asked.scene.clone()));
        metadata.push(("lumiris:accel".to_owned(), <&str>::from(asked.accel).to_owned()));
        metadata.extend(output::progress_metadata(rendering));

        // Cryptomattes
        let ids = cryptomattes(job, settings, &rendering.film, &self.cryptomatte);
        for ids in ids.map_err(|error| Failure::Other(error.to_string()))? {
            let PixelBounds { x0, y0, x1, y1 } = rendering.film.bounds;
            let size = [x1 - x0, y1 - y0].map(|n| n as usize);
            let image =
                Image { width: size[0], height: size[1], channels: ids.channels.clone(), data: ids.rows(y0..y1) };
            layers.extend(split(&image));
            metadata.extend(ids.metadata);
        }
        Ok((layers, metadata))
    }
}

/// Parses a number of bytes as on the command line.
fn bytes(text: &str) -> PyResult<u64> {
    match Kind::Bytes.parse(text) {
        Ok(Value::Integer(bytes)) => Ok(bytes),
        Ok(_) => Err(PyValueError::new_err("texture_memory: expected a number of bytes")),
        Err(expected) => Err(PyValueError::new_err(format!("texture_memory: {expected}, but found `{text}`"))),
    }
}

/// Renders; sends tiles and passes if there is a callback.
fn observed(
    (job, settings): (&RenderJob, &RenderSettings),
    (stop, latest): (&AtomicBool, &Mutex<Option<Progress>>),
    events: Option<Sender<Event>>,
    continuation: Continuation<'_>,
) -> Result<Rendering, RenderError> {
    let Some(events) = events else { return resume(job, settings, stop, &|_| (), continuation) };
    let film = &job.world.scene.film;
    let canvas = Arc::new(Canvas::new(film.resolution, film.bounds, settings.with_features));
    // Nobody receives once the rendering is to stop: that is no error
    let _ = events.send(Event::Begin(Arc::clone(&canvas)));
    let observe = |progress: &Progress| *latest.lock().unwrap_or_else(PoisonError::into_inner) = Some(*progress);
    let set_tile = |tile: &Film| canvas.set_tile(tile);
    let passed = |progress: &Progress| {
        let (done, wait) = sync_channel(1);
        if events.send(Event::Pass(*progress, done)).is_ok() {
            let _ = wait.recv();
        }
    };
    let hooks = Continuation { watch: Some(&set_tile), passes: Some(&passed), ..continuation };
    resume(job, settings, stop, &observe, hooks)
}

/// The exception for a failure.
fn exception(py: Python<'_>, request: &Request, failure: Failure) -> PyErr {
    match failure {
        Failure::Value(text) => PyValueError::new_err(text),
        Failure::Part(error) => part_error(error),
        Failure::Other(text) => PyRuntimeError::new_err(text),
        Failure::Stopped => PyRuntimeError::new_err("the rendering was stopped before it began"),
        Failure::Scene(report) => {
            let error = SceneError::new_err(report.to_string().trim_end().to_owned());
            let first = report.errors().next();
            let place = first.and_then(|entry| entry.location.as_ref());
            // Positions in binary files have neither line nor column
            let text = place.and_then(|place| match place.position {
                Position::Text { line, column } => Some((line, column)),
                Position::Byte(_) => None,
            });
            let value = error.value(py);
            let set = || {
                value.setattr("message", first.map(|entry| entry.message.as_str()))?;
                value.setattr("file", place.map_or_else(|| request.asked.scene.clone(), |place| place.name.clone()))?;
                value.setattr("line", text.map(|(line, _)| line))?;
                value.setattr("column", text.map(|(_, column)| column))
            };
            set().err().unwrap_or(error)
        }
    }
}

/// Return value of `render`: layers, metadata, position, true if all samples are done, time (s), and warnings.
type Rendered<'py> = (Vec<Layer<'py>>, Vec<(String, String)>, Place, bool, f64, Vec<String>);

/// Renders in another thread, while this one calls back and checks for Ctrl-C.
#[pyfunction]
pub(crate) fn render(py: Python<'_>, options: Options, callback: Option<Py<PyAny>>) -> PyResult<Rendered<'_>> {
    // Arguments
    let request = options.checked()?;
    let (stop, latest) = (AtomicBool::new(false), Mutex::new(None));
    let mut attendant = Attendant {
        callback: callback.as_ref(),
        interval: request.interval,
        stop: &stop,
        latest: &latest,
        canvas: None,
        called: Instant::now(),
        raised: None,
    };

    // Render without the GIL
    let result = py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, events) = channel();
            let (end, finished) = channel::<()>();
            let sender = attendant.callback.map(|_| sender);
            let worker = scope.spawn(|| {
                let result = request.run(&stop, &latest, sender);
                drop(end);
                result
            });
            attendant.attend(&events, &finished);
            worker.join()
        })
    });

    // Exceptions of this thread come first
    if let Some(error) = attendant.raised {
        return Err(error);
    }
    let done = result.map_err(|_| PyRuntimeError::new_err("the renderer has panicked: this is a bug"))?;
    let done = done.map_err(|failure| exception(py, &request, failure))?;
    let layers = arrays(py, done.layers)?;
    Ok((layers, done.metadata, done.place, done.complete, done.seconds, done.warnings))
}
