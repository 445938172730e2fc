//! `lumiris reproduce` from outside: the page and the JSON file contain every figure.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

const FIGURES: [&str; 6] = [
    "paper-figure-3",
    "paper-figure-4",
    "paper-figure-4-lights",
    "paper-figure-5",
    "thesis-figure-5.3",
    "thesis-figure-5.4",
];

const FAN_FIGURES: [&str; 4] = ["checkers", "statue", "room", "box"];

const PHOTON_FIGURES: [&str; 4] = ["rooms", "ring", "slit", "direct"];

/// Files referenced by the page.
fn sources(html: &str) -> Vec<&str> {
    html.split("src=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect()
}

/// A number from the JSON file.
fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().unwrap_or_else(|| panic!("{key} of {of}"))
}

/// A number with its standard error.
fn estimate(of: &Value, key: &str) -> [f64; 2] {
    ["value", "standard_error"].map(|part| number(&of[key], part))
}

fn reached(summary: &Value) -> bool {
    summary["reached"].as_bool().unwrap()
}

/// Target reduction of a row (percent).
fn asked(summary: &Value) -> f64 {
    let target = summary["target"].as_str().unwrap();
    target.trim_start_matches('−').split(' ').next().unwrap().parse().unwrap()
}

/// True if `left`, the remaining fraction, is at most 1 minus the target reduction.
fn is_reduced(summary: &Value, left: f64) -> bool {
    left > 0.0 && (1.0 - left) * 100.0 >= asked(summary)
}

/// All rows of the summary table.
fn summaries(numbers: &Value) -> Vec<&Value> {
    let figures = numbers["figures"].as_object().unwrap().values();
    figures.flat_map(|f| std::iter::once(&f["summary"]).chain(f["also"].as_object().unwrap().values())).collect()
}

/// The page and the JSON file have the same verdicts.
fn assert_same_verdicts(html: &str, numbers: &Value) {
    let rows = summaries(numbers);
    for (good, cell) in [(true, "<td class=\"good\">yes</td>"), (false, "<td class=\"bad\">no</td>")] {
        let expected = rows.iter().filter(|row| reached(row) == good).count();
        assert_eq!(html.matches(cell).count(), expected, "{cell}");
    }
}

/// A sky, a lamp, a floor and a ball, under the names of the original scenes.
fn write_scenes(folder: &Path) {
    let head = "LookAt 0 1.6 -4.6  0 0.6 0  0 1 0\nCamera \"perspective\" \"float fov\" [ 34 ]\nWorldBegin\n";
    let sky = "LightSource \"infinite\" \"rgb L\" [ 0.3 0.4 0.6 ]\n";
    let lamp = "AttributeBegin\n  AreaLightSource \"diffuse\" \"rgb L\" [ 18 15 11 ]\n  Shape \"bilinearmesh\" \
                \"point3 P\" [ -1.4 3.2 -1.2  -0.4 3.2 -1.2  -1.4 3.2 -0.2  -0.4 3.2 -0.2 ]\nAttributeEnd\n";
    let things = "Material \"diffuse\"\nShape \"bilinearmesh\" \"point3 P\" [ -9 0 -9  9 0 -9  -9 0 9  9 0 9 ]\n\
                  AttributeBegin Translate 0 0.7 0 Shape \"sphere\" \"float radius\" [ 0.7 ] AttributeEnd\n";
    for (name, lights) in [("env", sky), ("lights", lamp), ("env-lights", &format!("{sky}{lamp}"))] {
        std::fs::write(folder.join(format!("statue-{name}.pbrt")), format!("{head}{lights}{things}")).unwrap();
    }
}

/// Reproduces a paper with the scenes of a folder. Returns the page's folder, its text, and its numbers.
fn reproduced(paper: &str, folder: &Path) -> (PathBuf, String, Value) {
    let output = Command::new(env!("CARGO_BIN_EXE_lumiris"))
        .args(["reproduce", paper, "--out", "page", "--quick", "--size", "16", "--scenes", ".", "-q"])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = folder.join("page");
    let html = std::fs::read_to_string(page.join("index.html")).unwrap();
    let numbers = std::fs::read_to_string(page.join(format!("{paper}.json"))).unwrap();
    (page, html, serde_json::from_str(&numbers).unwrap())
}

#[test]
fn the_page_and_the_numbers_hold_every_figure() {
    let folder = tempfile::tempdir().unwrap();
    write_scenes(folder.path());
    let (page, html, numbers) = reproduced("talbot", folder.path());

    let figures = numbers["figures"].as_object().unwrap();
    assert_eq!(figures.len(), FIGURES.len());
    for id in FIGURES {
        assert!(html.contains(&format!("<h2 id=\"{id}\">")), "{id}");
        let figure = &figures[id];
        let methods = figure["numbers"].get("methods").and_then(|m| m.as_array());
        for m in methods.into_iter().flatten() {
            assert_eq!(m["invalid_samples"], 0, "{id} {}", m["name"]);
            assert!(m["at_equal_time"]["value"].as_f64().unwrap() > 0.0, "{id} {}", m["name"]);
            // All methods are unbiased; the probability that one of some fifty means is this far off is small
            assert!(m["same_mean_p"].as_f64().unwrap() > 1e-6, "{id} {}", m["name"]);
        }
    }
    assert_same_verdicts(&html, &numbers);
    assert_verdicts_of_resampling(&numbers["figures"]);
    let shown = sources(&html);
    assert!(shown.len() > 30, "{shown:?}");
    for file in shown {
        assert!(page.join(file).is_file(), "{file}");
    }
}

/// Each verdict follows from the numbers.
fn assert_verdicts_of_resampling(figures: &Value) {
    for id in ["paper-figure-4", "paper-figure-4-lights", "thesis-figure-5.3"] {
        let (summary, n) = (&figures[id]["summary"], &figures[id]["numbers"]);
        let method = |key: &str| &n["methods"][n[key].as_u64().unwrap() as usize];
        let expected = |row: &Value, key: &str| {
            let m = method(key);
            let resamples = number(m, "proposals") > number(m, "samples");
            resamples && is_reduced(row, estimate(m, "at_equal_time")[0])
        };
        assert_eq!(reached(summary), expected(summary, "judged"), "{id}");
        let also: Vec<&Value> = figures[id]["also"].as_object().unwrap().values().collect();
        if id == "thesis-figure-5.3" {
            // With M = N nothing is resampled, so the verdict uses the thesis's M and N
            let judged = method("judged");
            assert_eq!((number(judged, "proposals"), number(judged, "samples")), (229.0, 64.0));
            assert_eq!(reached(also[0]), expected(also[0], "equal_halves"));
        }
        assert_eq!(also.len(), usize::from(id == "thesis-figure-5.3"), "{id}");
    }

    // Systematic samples and stratified proposals leave a quarter of the variance, with a relative error of a tenth
    let figure = &figures["thesis-figure-5.4"];
    let methods = figure["numbers"]["methods"].as_array().unwrap();
    let [[none, none_error], [systematic, error]] = [0, 4].map(|i| estimate(&methods[i], "variance"));
    assert!(systematic + 3.0 * error.hypot(none_error) < none, "{systematic} ± {error} against {none} ± {none_error}");
    let steps: Vec<f64> = methods[..5].iter().map(|m| estimate(m, "at_equal_time")[0]).collect();
    assert!(!reached(&figure["summary"]) || steps.windows(2).all(|pair| pair[1] < pair[0]), "{steps:?}");

    let figure = &figures["paper-figure-3"];
    assert_eq!(reached(&figure["summary"]), number(&figure["numbers"], "auto_over_best") <= 2.0);
    let figure = &figures["paper-figure-5"];
    let spheres = figure["numbers"].as_array().unwrap().iter();
    let ratios: Vec<f64> = spheres.filter(|s| s["in_paper"] == true).map(|s| number(s, "ratio")).collect();
    assert_eq!(reached(&figure["summary"]), ratios.iter().all(|&r| r <= 0.2), "{ratios:?}");
    // 20 proposals leave 1/20 at least; the ratio of variances of 64 estimates at some 200 points has an error of 2 %
    assert!(ratios.len() == 2 && ratios.iter().all(|&r| r > 0.9 / 20.0), "{ratios:?}");
}

/// A lamp, a floor and a ball, under the names of the scenes of optimizing control variates.
fn write_fan_scenes(folder: &Path) {
    write_scenes(folder);
    let scene = folder.join("statue-lights.pbrt");
    for name in FAN_FIGURES {
        std::fs::copy(&scene, folder.join(format!("{name}.pbrt"))).unwrap();
    }
}

#[test]
fn the_page_of_control_variates_holds_every_scene_and_method() {
    // Figures
    let folder = tempfile::tempdir().unwrap();
    write_fan_scenes(folder.path());
    let (page, html, numbers) = reproduced("fan", folder.path());

    let figures = numbers["figures"].as_object().unwrap();
    assert_eq!(figures.len(), FAN_FIGURES.len());
    for id in FAN_FIGURES {
        assert!(html.contains(&format!("<h2 id=\"{id}\">")), "{id}");
        let (figure, is_box) = (&figures[id], id == "box");
        let methods = figure["numbers"]["methods"].as_array().unwrap();
        assert_eq!(methods.len(), if is_box { 4 } else { 3 * ROLES + 6 }, "{id}");
        for m in methods {
            assert_eq!(m["invalid_samples"], 0, "{id} {}", m["name"]);
        }
        if is_box {
            assert_box(methods);
        } else {
            assert_errors(id, methods);
            (0..3).for_each(|way| assert_biases(id, &methods[way * ROLES..(way + 1) * ROLES]));
        }
        assert_verdicts_of_control_variates(id, figure, methods);
    }

    // Stratification, verdicts and images
    let all = |id: &str| &figures[id]["numbers"]["methods"].as_array().unwrap()[..];
    assert_stratification_helps(&["checkers", "statue", "room"].map(all));
    assert_same_verdicts(&html, &numbers);
    let shown = sources(&html);
    assert!(shown.len() > 50, "{shown:?}");
    for file in shown {
        assert!(page.join(file).is_file(), "{file}");
    }
}

/// Number of methods for each of the three sampling strategies with uniform light selection; `mis` is the first.
const ROLES: usize = 10;
/// Indices of unbiased methods with a stated number of samples. The two "in the time of mis" take as many as the
/// machine has time for: their errors have no bound that holds under load.
const UNBIASED: [usize; 5] = [0, 1, 2, 4, 7];
/// Index of `ocv` in the form `paper`, which is biased.
const PAPER: usize = 3;
/// Indices of progressive `ocv`: with uniform light selection for each strategy, then with the light tree for each.
const PROGRESSIVE: [usize; 6] = [2, ROLES + 2, 2 * ROLES + 2, 3 * ROLES + 1, 3 * ROLES + 3, 3 * ROLES + 5];
/// Half the width of a 95 % confidence interval over the standard error, for four renderings (a quick page).
const STUDENT: f64 = 3.18;

/// The bias of the mean luminance, and its standard error.
fn bias(m: &Value) -> [f64; 2] {
    [number(&m["bias"], "value"), number(&m["bias"], "half_width_95") / STUDENT]
}

/// Means agree with the reference within six standard errors, pooled over the methods of a strategy, since each is from
/// four replicas: 0.2 to 1 % of the mean. The same bound detects the bias of the form `paper`, which loses 3 to 10 %.
fn assert_biases(id: &str, methods: &[Value]) {
    let pooled = UNBIASED.iter().map(|&i| bias(&methods[i])[1].powi(2)).sum::<f64>() / UNBIASED.len() as f64;
    let bound = 6.0 * pooled.sqrt();
    for i in UNBIASED {
        let [found, _] = bias(&methods[i]);
        assert!(found.abs() < bound, "{id} {}: {found}, where {bound} would be noticed", methods[i]["name"]);
    }
    assert!(bias(&methods[PAPER])[0] < -bound, "{id}: {bound} does not find the bias of paper");
}

/// No unbiased method has twice the error of `mis` with independent samples. Measured ratios are below 1.3; six
/// standard errors allow for chance.
fn assert_errors(id: &str, methods: &[Value]) {
    let [independent, _] = estimate(&methods[2 * ROLES], "error");
    for way in 0..3 {
        for i in UNBIASED {
            let m = &methods[way * ROLES + i];
            let [error, uncertainty] = estimate(m, "error");
            let is_low = error > 0.0 && error < 2.0 * independent + 6.0 * uncertainty;
            assert!(is_low, "{id} {}: {error} against {independent}", m["name"]);
        }
    }
}

/// Stratified samples have less error than independent ones, with both kinds of stratification: 0.45 to 0.7 times in
/// the geometric mean of three scenes, each with a relative error of 0.1 to 0.2.
fn assert_stratification_helps(scenes: &[&[Value]]) {
    for stratified in [0, ROLES] {
        let ratio = |methods: &&[Value]| {
            let [error, independent] = [stratified, 2 * ROLES].map(|i| estimate(&methods[i], "error")[0]);
            (error / independent).ln()
        };
        let mean = (scenes.iter().map(ratio).sum::<f64>() / scenes.len() as f64).exp();
        assert!(mean < 0.9, "{mean} times the error, with {}", scenes[0][stratified]["points"]);
    }
}

/// The cache has few records in an image of 16 × 16 pixels, and interpolates across shadow edges: its errors are 74 to
/// 87 with standard errors of up to 13, and it is 2 ± 0.3 % darker than path tracing. Differences between estimators
/// are the estimators' own.
fn assert_box(methods: &[Value]) {
    let [of_mis, its_error] = bias(&methods[0]);
    assert!(of_mis.abs() < 0.04, "interpolation changes the mean by {of_mis}");
    let beyond = |m: &Value| {
        let [own, own_error] = bias(m);
        (own - of_mis).abs() - 6.0 * own_error.hypot(its_error)
    };
    for m in &methods[..3] {
        let [error, _] = estimate(m, "error");
        assert!(error > 0.0 && error < 130.0, "{}: {error}", m["name"]);
        assert!(beyond(m) < 0.0, "{}: {:?} against {of_mis} of mis", m["name"], bias(m));
    }
    assert!(beyond(&methods[PAPER]) > 0.0, "the bound does not find the bias of paper");
}

/// Each verdict follows from the numbers.
fn assert_verdicts_of_control_variates(id: &str, figure: &Value, methods: &[Value]) {
    // Rows of the summary table
    let mut rows = vec![&figure["summary"]];
    if id != "box" {
        let also = figure["also"].as_object().unwrap();
        let ways = ["stratified over all rays", "independent"];
        let by_tree = ["stratified in each estimate", ways[0], ways[1]].map(|way| format!("{way}, lights by the tree"));
        rows.extend(ways.iter().map(|&way| &also[way]));
        rows.extend(by_tree.iter().map(|way| &also[way.as_str()]));
        assert_eq!(also.len() + 1, rows.len());
    }

    // Verdicts on progressive `ocv`
    for (row, place) in rows.into_iter().zip(PROGRESSIVE) {
        let m = &methods[place];
        assert_eq!(m["name"], "ocv, progressive");
        let is_efficient = id != "room" || estimate(m, "efficiency")[0] >= 1.0;
        let expected = is_reduced(row, estimate(m, "relative_error")[0]) && is_efficient;
        assert_eq!(reached(row), expected, "{id}: {row}");
    }

    // Light samplers and strategies of all methods
    for (k, m) in methods.iter().enumerate().filter(|_| id != "box") {
        let (light_sampler, points) = (m["light_sampler"].as_str().unwrap(), m["points"].as_str().unwrap());
        assert_eq!(light_sampler, if k < 3 * ROLES { "uniform" } else { "tree" }, "{id} {k}");
        let way = if k < 3 * ROLES { k / ROLES } else { (k - 3 * ROLES) / 2 };
        let ways = ["stratified in each estimate", "stratified over all rays", "independent"];
        assert_eq!(points, ways[way], "{id} {k}");
    }
}

/// The scenes of the repository; the rooms with few lights also serve as those with many.
fn write_photon_scenes(folder: &Path) {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/keller-wald");
    for name in ["rooms", "ring", "ring-indirect", "ring-geometry", "slit"] {
        let file = format!("{name}.pbrt");
        std::fs::copy(scenes.join(&file), folder.join(&file)).unwrap();
    }
    std::fs::copy(scenes.join("rooms.pbrt"), folder.join("rooms-10000.pbrt")).unwrap();
}

#[test]
fn the_page_of_photon_maps_holds_every_figure_and_its_maps() {
    let folder = tempfile::tempdir().unwrap();
    write_photon_scenes(folder.path());
    let (page, html, numbers) = reproduced("keller-wald", folder.path());

    let figures = numbers["figures"].as_object().unwrap();
    assert_eq!(figures.len(), PHOTON_FIGURES.len());
    for id in PHOTON_FIGURES {
        assert!(html.contains(&format!("<h2 id=\"{id}\">")), "{id}");
    }
    assert_same_verdicts(&html, &numbers);
    assert_verdicts_of_photon_maps(&numbers["figures"]);
    let maps = |figure: &Value| figure["maps"].as_array().unwrap().clone();
    let count = number;

    // Importance increases the photons traced in the room, but not the photons stored in the map
    let rooms = maps(&figures["rooms"]["numbers"]);
    assert_eq!(rooms.len(), 4);
    for pair in rooms.chunks(2) {
        assert!(count(&pair[1], "photons_in_room") > 5.0 * count(&pair[0], "photons_in_room"));
        // Each number is from a pilot of 1024 photons or more, with a few photons per path: 5 standard deviations
        let ratio = count(&pair[1], "photons") / count(&pair[0], "photons");
        assert!((ratio - 1.0).abs() < 5.0 * (2.0 * 5.0 / 1024.0_f64).sqrt(), "{ratio}");
    }
    let slit = maps(&figures["slit"]["numbers"]);
    assert!(count(&slit[2], "photons_in_room") > count(&slit[0], "photons_in_room"));

    // The size of the global map is constant, the caustic map grows
    for scene in figures["ring"]["numbers"]["scenes"].as_array().unwrap() {
        let maps = maps(scene);
        for pair in maps.windows(2) {
            assert!((count(&pair[1], "global_photons") / count(&pair[0], "global_photons") - 1.0).abs() < 0.02);
            assert!(count(&pair[1], "caustic_photons") > 2.0 * count(&pair[0], "caustic_photons"));
        }
    }

    // Unbiased methods agree on direct light
    for scene in ["few", "many"] {
        for m in figures["direct"]["numbers"][scene]["methods"].as_array().unwrap() {
            assert_eq!(m["invalid_samples"], 0, "{}", m["name"]);
            let is_same = m["same_mean_p"].as_f64().unwrap() > 1e-6;
            assert!(is_same || m["biased"] == true, "{}", m["name"]);
        }
    }
    let shown = sources(&html);
    assert!(shown.len() > 30, "{shown:?}");
    for file in shown {
        assert!(page.join(file).is_file(), "{file}");
    }
}

/// Each verdict follows from the numbers.
fn assert_verdicts_of_photon_maps(figures: &Value) {
    let errors =
        |of: &Value| -> Vec<f64> { of["maps"].as_array().unwrap().iter().map(|m| number(m, "error")).collect() };
    let rooms = errors(&figures["rooms"]["numbers"]);
    let expected = rooms[0] >= 3.0 * rooms[1] || rooms[1] <= rooms[2];
    assert_eq!(reached(&figures["rooms"]["summary"]), expected, "{rooms:?}");

    let ring = &figures["ring"];
    for (row, scene) in [&ring["summary"], &ring["also"]["lit indirectly"]].into_iter().zip([0, 1]) {
        let errors = errors(&ring["numbers"]["scenes"][scene]);
        assert_eq!(reached(row), errors.windows(2).all(|pair| pair[1] < pair[0]), "{errors:?}");
    }

    // The cut-off loses a third of the light or more, by far more than its noise. That is not "hardly perceivable"
    let [loss, error] = estimate(&figures["slit"]["numbers"]["maps"][2], "bias");
    assert!(loss + 3.0 * error < -0.1, "{loss} ± {error}");
    assert!(!reached(&figures["slit"]["summary"]));

    let direct = &figures["direct"];
    let methods = direct["numbers"]["few"]["methods"].as_array().unwrap();
    let informed = methods[4..8].iter().map(|m| ["at_equal_time", "at_equal_time_of_ris"].map(|of| estimate(m, of)[0]));
    let [left, left_of_ris] = informed.min_by(|a, b| a[0].total_cmp(&b[0])).unwrap();
    assert_eq!(reached(&direct["summary"]), left <= 0.1 && left_of_ris <= 1.0 / 3.0, "{left} {left_of_ris}");
    let growth = number(&direct["numbers"], "growth");
    assert_eq!(reached(&direct["also"]["10,000 lights"]), growth < 1.5, "{growth}");
}

#[test]
fn a_folder_without_scenes_is_an_error_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_lumiris"))
        .args(["reproduce", "talbot", "--out", "page", "--quick", "--scenes", "nowhere", "-q"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8_lossy(&output.stderr).contains("statue-env-lights.pbrt"));
    assert!(!folder.path().join("page/index.html").exists());
}
