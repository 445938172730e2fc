//! Rendering: the work in a thread of its own, and the calling thread, which calls back and watches for Ctrl-C.

use crate::images::{Layer, Place, arrays, split};
use crate::progress::{Canvas, PassProgress};
use crate::settings::{Given, apply, parse, parse_plan};
use lumiris::film::filter::PixelFilter;
use lumiris::film::{Film, PixelBounds};
use lumiris::imaging::Image;
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load_text, load_with};
use lumiris::render::allocation::complete_for_noise;
use lumiris::render::cryptomatte::{Cryptomatte, cryptomattes};
use lumiris::render::output::{self, Aov};
use lumiris::render::plan::prepare;
use lumiris::render::{Continuation, Progress, RenderSettings, Rendering, go_on};
use lumiris::scene::{AccelKind, RenderJob};
use lumiris::settings::value::{Kind, Value};
use lumiris_formats::diagnostic::Report;
use lumiris_formats::source::Position;
use pyo3::exceptions::{PyException, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

pyo3::create_exception!(lumiris, SceneError, PyException, "A scene that cannot be loaded.");

/// Time between two looks for Ctrl-C.
const ATTENTION: Duration = Duration::from_millis(50);

/// What to render: a file, or a text with a name and the folder of the files that it names.
#[derive(Debug, FromPyObject)]
enum Source {
    #[pyo3(transparent)]
    Text((String, String, PathBuf)),
    #[pyo3(transparent)]
    File(PathBuf),
}

/// Options that are no settings of the image.
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
    camera_auto: bool,
    time_in_scene: Option<f32>,
    texture_memory: Option<String>,
    aov: Option<Vec<String>>,
    cryptomatte: Vec<String>,
    interval: f64,
    settings: Vec<(String, String)>,
    plan: Vec<(String, String)>,
}

/// The options, checked.
struct Request {
    source: Source,
    load: LoadOptions,
    /// Most bytes of textures in memory.
    texture_memory: Option<u64>,
    box_filter: bool,
    accel: AccelKind,
    packet_width: Option<u32>,
    render: RenderSettings,
    aov: Option<Vec<Aov>>,
    cryptomatte: Vec<Cryptomatte>,
    interval: Duration,
    settings: Given,
    plan: Given,
}

/// A rendering with all that is told of it.
struct Done {
    layers: Vec<(String, Image)>,
    metadata: Vec<(String, String)>,
    place: Place,
    plan: Vec<(&'static str, String)>,
    complete: bool,
    seconds: f64,
    warnings: Vec<String>,
}

/// Why there is no image.
enum Failure {
    Scene(Box<Report>),
    Value(String),
    Other(String),
    /// Ctrl-C, or an exception, ended the work before there was anything to keep.
    Stopped,
}

/// What the working thread tells the calling one.
enum Event {
    Begin(Arc<Canvas>),
    Pass(Progress, SyncSender<()>),
}

impl Options {
    fn checked(self) -> PyResult<Request> {
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
        let seconds = |name: &str, seconds: f64| {
            let duration = Duration::try_from_secs_f64(seconds).ok().filter(|duration| !duration.is_zero());
            duration.ok_or_else(|| PyValueError::new_err(format!("{name}: expected a positive number of seconds")))
        };
        let needs = |is_shown: fn(&Aov) -> bool| aov.as_ref().is_none_or(|list| list.iter().any(is_shown));
        let render = RenderSettings {
            threads: self.threads.map(|t| t as usize),
            tile_size: self.tile_size,
            time_limit: self.time.map(|time| seconds("time", time)).transpose()?,
            with_replicas: needs(|aov| *aov == Aov::Variance),
            with_features: needs(|aov| aov.is_feature()),
            ..RenderSettings::default()
        };
        Ok(Request {
            source: self.source,
            load: LoadOptions {
                resolution: self.resolution,
                crop: self.crop,
                environment: self.environment,
                camera_auto: self.camera_auto,
                time: self.time_in_scene,
            },
            texture_memory,
            box_filter: self.box_filter,
            accel,
            packet_width: self.packet_width,
            render,
            aov,
            cryptomatte,
            interval: seconds("interval", self.interval)?,
            settings: parse(&self.settings)?,
            plan: parse_plan(&self.plan)?,
        })
    }
}

impl Request {
    /// Loads the scene and applies the settings.
    fn load(&self) -> Result<Loaded, Failure> {
        let files = FileCache::default();
        if let Some(bytes) = self.texture_memory {
            files.limit_textures(bytes);
        }
        let loaded = match &self.source {
            Source::File(path) => load_with(path, &self.load, &files),
            Source::Text((text, name, folder)) => load_text(text, name, folder, &self.load, &files),
        };
        let mut loaded = loaded.map_err(Failure::Scene)?;
        apply(&self.plan, &mut loaded.settings);
        apply(&self.settings, &mut loaded.settings);
        let has_spp = self.settings.iter().any(|(row, _)| row.flag == "spp");
        complete_for_noise(&mut loaded.settings, has_spp).map_err(|needs| Failure::Value(format!("noise {needs}")))?;
        if self.box_filter {
            loaded.scene.film.filter = PixelFilter::Box { rx: 0.5, ry: 0.5 };
        }
        Ok(loaded)
    }

    /// The name of the scene in metadata.
    fn scene(&self) -> String {
        match &self.source {
            Source::File(path) => path.display().to_string(),
            Source::Text((_, name, _)) => name.clone(),
        }
    }

    /// All the work. `hooks` are there if someone is called back.
    fn run(
        &self,
        stop: &AtomicBool,
        latest: &Mutex<Option<Progress>>,
        events: Option<Sender<Event>>,
    ) -> Result<Done, Failure> {
        let goes_on = || if stop.load(Ordering::Relaxed) { Err(Failure::Stopped) } else { Ok(()) };
        let other = |error: &dyn std::error::Error| Failure::Other(error.to_string());
        let loaded = self.load()?;
        let mut warnings = Vec::from_iter(Some(loaded.warnings.to_string()).filter(|text| !text.is_empty()));
        if loaded.settings.integrator.leaves_lights_out() {
            warnings.push("without samples on non-contributing lights, direct light is biased".to_owned());
        }
        goes_on()?;
        let mut job = loaded.job(self.accel, self.packet_width).map_err(|error| other(&error))?;
        goes_on()?;
        let asks_for_ratio = self.aov.as_ref().is_some_and(|list| list.contains(&Aov::Ratio));
        let plan = prepare(&mut job, self.render.threads, asks_for_ratio).map_err(|error| other(&error))?;
        goes_on()?;
        warnings.extend(plan.warnings);

        let spp = job.pixel_samples.as_ref().map_or(job.settings().sampling.spp, |of_pixels| of_pixels.spp);
        let settings = RenderSettings { spp, ..self.render };
        let rendering = observed(&job, &settings, stop, latest, events).map_err(|error| other(&error))?;
        let aovs = self.aov.clone();
        let has = (job.sample_count_map.is_some(), rendering.cache.is_some());
        let aovs = aovs.unwrap_or_else(|| output::default_aovs(&rendering.film, has.0, has.1));
        let mut layers = output::layers(&rendering.film, &aovs, job.sample_count_map.as_ref());
        let mut metadata = self.metadata(&job, &rendering);
        for ids in cryptomattes(&job, &settings, &rendering.film, &self.cryptomatte).map_err(|error| other(&error))? {
            let PixelBounds { x0, y0, x1, y1 } = rendering.film.bounds;
            let size = [x1 - x0, y1 - y0].map(|n| n as usize);
            let image =
                Image { width: size[0], height: size[1], channels: ids.channels.clone(), data: ids.rows(y0..y1) };
            layers.extend(split(&image));
            metadata.extend(ids.metadata);
        }
        let Film { bounds, resolution, .. } = &rendering.film;
        Ok(Done {
            layers,
            metadata,
            place: ([bounds.x0 as usize, bounds.y0 as usize], resolution.map(|n| n as usize)),
            plan: plan.chosen,
            complete: rendering.complete,
            seconds: rendering.elapsed.as_secs_f64(),
            warnings,
        })
    }

    /// What the image depends on, and how it came about.
    fn metadata(&self, job: &RenderJob, rendering: &Rendering) -> Vec<(String, String)> {
        let mut metadata = output::metadata(&job.world.scene.film, job.settings());
        metadata.push(("lumiris:scene".to_owned(), self.scene()));
        metadata.push(("lumiris:accel".to_owned(), <&str>::from(self.accel).to_owned()));
        metadata.extend(output::progress_metadata(rendering));
        metadata
    }
}

/// A number of bytes, as on the command line.
fn bytes(text: &str) -> PyResult<u64> {
    match Kind::Bytes.parse(text) {
        Ok(Value::Integer(bytes)) => Ok(bytes),
        Ok(_) => Err(PyValueError::new_err("texture_memory: expected a number of bytes")),
        Err(expected) => Err(PyValueError::new_err(format!("texture_memory: {expected}, but found `{text}`"))),
    }
}

/// Renders; tells of tiles and passes if there is someone to tell.
fn observed(
    job: &RenderJob,
    settings: &RenderSettings,
    stop: &AtomicBool,
    latest: &Mutex<Option<Progress>>,
    events: Option<Sender<Event>>,
) -> Result<Rendering, lumiris::render::RenderError> {
    let Some(events) = events else { return go_on(job, settings, stop, &|_| (), Continuation::default()) };
    let film = &job.world.scene.film;
    let canvas = Arc::new(Canvas::new(film.resolution, film.bounds, settings.with_features));
    // Nobody listens any more once the rendering is to stop: that is no error
    let _ = events.send(Event::Begin(Arc::clone(&canvas)));
    let observe = |progress: &Progress| *latest.lock().unwrap_or_else(PoisonError::into_inner) = Some(*progress);
    let set_tile = |tile: &Film| canvas.set_tile(tile);
    let passed = |progress: &Progress| {
        let (done, wait) = sync_channel(1);
        if events.send(Event::Pass(*progress, done)).is_ok() {
            let _ = wait.recv();
        }
    };
    let hooks = Continuation { watch: Some(&set_tile), passes: Some(&passed), ..Continuation::default() };
    go_on(job, settings, stop, &observe, hooks)
}

/// The calling thread while another one renders.
struct Attendant<'a> {
    callback: Option<&'a Py<PyAny>>,
    interval: Duration,
    stop: &'a AtomicBool,
    latest: &'a Mutex<Option<Progress>>,
    canvas: Option<Arc<Canvas>>,
    called: Instant,
    /// The exception of Ctrl-C, or of the callback.
    raised: Option<PyErr>,
}

impl Attendant<'_> {
    /// Attends until the other thread has ended: it drops `finished` and the senders of events.
    fn attend(&mut self, events: &Receiver<Event>, finished: &Receiver<()>) {
        loop {
            match events.recv_timeout(ATTENTION.min(self.interval)) {
                Ok(Event::Begin(canvas)) => self.canvas = Some(canvas),
                Ok(Event::Pass(progress, done)) => {
                    // What was before the pass has been overtaken
                    self.latest.lock().unwrap_or_else(PoisonError::into_inner).take();
                    self.call(progress, true);
                    // The other side may have ended
                    let _ = done.send(());
                }
                Err(RecvTimeoutError::Timeout) => self.call_latest(),
                // Nobody is called back, or the rendering is about to end
                Err(RecvTimeoutError::Disconnected) => match finished.recv_timeout(ATTENTION) {
                    Err(RecvTimeoutError::Timeout) => {}
                    Ok(()) | Err(RecvTimeoutError::Disconnected) => return,
                },
            }
            self.raise_if(|_, py| py.check_signals());
        }
    }

    /// Calls back within a pass, if it is time.
    fn call_latest(&mut self) {
        if self.called.elapsed() >= self.interval
            && let Some(progress) = self.latest.lock().unwrap_or_else(PoisonError::into_inner).take()
        {
            self.call(progress, false);
        }
    }

    fn call(&mut self, progress: Progress, is_pass: bool) {
        let (Some(callback), Some(canvas)) = (self.callback, self.canvas.clone()) else { return };
        if self.stop.load(Ordering::Relaxed) {
            return;
        }
        self.raise_if(|attendant, py| {
            let returned = callback.call1(py, (PassProgress { progress, is_pass, canvas },))?;
            // Only `False` itself: a callback that returns nothing goes on
            if returned.bind(py).extract::<bool>().is_ok_and(|goes_on| !goes_on) {
                attendant.stop.store(true, Ordering::Relaxed);
            }
            Ok(())
        });
        self.called = Instant::now();
    }

    /// Runs something of Python; an exception ends the rendering.
    fn raise_if(&mut self, run: impl FnOnce(&Self, Python<'_>) -> PyResult<()>) {
        if self.raised.is_some() {
            return;
        }
        if let Err(error) = Python::attach(|py| run(self, py)) {
            self.stop.store(true, Ordering::Relaxed);
            self.raised = Some(error);
        }
    }
}

/// The exception of a failure.
fn exception(py: Python<'_>, request: &Request, failure: Failure) -> PyErr {
    match failure {
        Failure::Value(text) => PyValueError::new_err(text),
        Failure::Other(text) => PyRuntimeError::new_err(text),
        Failure::Stopped => PyRuntimeError::new_err("the rendering was stopped before it began"),
        Failure::Scene(report) => {
            let error = SceneError::new_err(report.to_string().trim_end().to_owned());
            let first = report.errors().next();
            let place = first.and_then(|entry| entry.location.as_ref());
            // Binary files have neither
            let text = place.and_then(|place| match place.position {
                Position::Text { line, column } => Some((line, column)),
                Position::Byte(_) => None,
            });
            let value = error.value(py);
            let set = || {
                value.setattr("message", first.map(|entry| entry.message.as_str()))?;
                value.setattr("file", place.map_or_else(|| request.scene(), |place| place.name.clone()))?;
                value.setattr("line", text.map(|(line, _)| line))?;
                value.setattr("column", text.map(|(_, column)| column))
            };
            set().err().unwrap_or(error)
        }
    }
}

/// What `render` returns: layers, metadata, place, plan, whether all samples are done, seconds, and warnings.
type Rendered<'py> =
    (Vec<Layer<'py>>, Vec<(String, String)>, Place, Vec<(&'static str, String)>, bool, f64, Vec<String>);

/// Renders.
#[pyfunction]
pub(crate) fn render(py: Python<'_>, options: Options, callback: Option<Py<PyAny>>) -> PyResult<Rendered<'_>> {
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
    if let Some(error) = attendant.raised {
        return Err(error);
    }
    let done = result.map_err(|_| PyRuntimeError::new_err("the renderer has panicked: this is a bug"))?;
    let done = done.map_err(|failure| exception(py, &request, failure))?;
    let layers = arrays(py, done.layers)?;
    Ok((layers, done.metadata, done.place, done.plan, done.complete, done.seconds, done.warnings))
}
