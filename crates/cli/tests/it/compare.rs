//! `lumiris compare` from outside: numbers, formats, errors, and its page in a real browser.

use super::browser::Browser;
use lumiris::imaging::color::linear_to_srgb;
use lumiris::imaging::oiio::{Part, ReadLimits, read_image, write_image};
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Output};

const SIZE: [usize; 2] = [40, 30];

fn lumiris(args: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lumiris")).args(args).current_dir(folder).output().unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn names(names: &[&str]) -> Vec<String> {
    names.iter().map(|&n| n.to_owned()).collect()
}

/// One colour, with two blocks that a display clips (2 and 4 at columns 4..8 and 12..16 of the rows 4..8), and with a
/// yellow block (columns 20..24, rows 20..24) that all images share.
fn image([r, g, b]: [f32; 3]) -> Vec<[f32; 3]> {
    let pixel = |i: usize| match (i % SIZE[0], i / SIZE[0]) {
        (4..8, 4..8) => [2.0; 3],
        (12..16, 4..8) => [4.0; 3],
        (20..24, 20..24) => [1.0, 1.0, 0.0],
        _ => [r, g, b],
    };
    (0..SIZE[0] * SIZE[1]).map(pixel).collect()
}

fn write_with_variance(path: &Path, pixels: &[[f32; 3]], variance: f32) {
    let channels = names(&["R", "G", "B", "variance.R", "variance.G", "variance.B"]);
    let data = pixels.iter().flat_map(|p| [p[0], p[1], p[2], variance, variance, variance]).collect();
    write_image(path, &[Part::linear(SIZE[0], SIZE[1], channels, data)]).unwrap();
}

fn write_plain(path: &Path, pixels: &[[f32; 3]]) {
    let data = pixels.as_flattened().to_vec();
    write_image(path, &[Part::linear(SIZE[0], SIZE[1], names(&["R", "G", "B"]), data)]).unwrap();
}

fn report(output: &Output) -> Value {
    assert!(output.status.success(), "{}", stderr(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn a_table_and_json_say_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write_with_variance(&path("r.exr"), &image([0.5; 3]), 0.0004);
    write_with_variance(&path("a.exr"), &image([0.52, 0.5, 0.48]), 0.0005);
    write_with_variance(&path("b.exr"), &image([0.6; 3]), 0.0005);
    let args = ["compare", "a.exr", "b.exr", "r.exr", "--reference", "r.exr", "--json", "out.json"];
    let output = lumiris(&args, folder.path());
    assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
    let table = stdout(&output);
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 4, "{table}");
    assert!(lines[0].starts_with("image") && lines[0].contains("relMSE") && lines[0].contains("p(χ²)"), "{table}");
    let lengths: Vec<usize> = lines.iter().map(|l| l.chars().count()).collect();
    assert!(lengths.iter().all(|&l| l == lengths[0]), "columns are aligned: {table}");

    let out: Value = serde_json::from_str(&std::fs::read_to_string(path("out.json")).unwrap()).unwrap();
    let [a, b, same] = [0, 1, 2].map(|i| &out["images"][i]);
    // All but 48 of 1200 pixels differ: image a by 0.02 in two of three channels, image b by 0.1 in all
    let share = 1152.0 / 1200.0;
    let near = |value: &Value, expected: f64| (value.as_f64().unwrap() / expected - 1.0).abs() < 1e-4;
    assert!(near(&a["mse"], 0.02 * 0.02 * 2.0 / 3.0 * share) && near(&b["mse"], 0.01 * share), "{out:#}");
    assert!(
        near(&b["relmse"], 0.01 / 0.26 * share) && near(&b["bias"], 0.1 * share) && a["bias"].as_f64().unwrap() < 1e-6
    );
    assert!(near(&b["bias_ci95"], 1.959_964 * (0.0009_f64 / 1200.0).sqrt()), "{b}");
    assert!(near(&b["z_max"], 0.1 / 0.03) && near(&b["z"], share) && b["chi2_p"].as_f64().unwrap() < 1e-12);
    assert_eq!((&a["z"], &a["variances"], &a["bias_error_from"]), (&json!(0.0), &json!("both"), &json!("variances")));
    assert!(near(&b["psnr"], -10.0 * (0.01 * share).log10()) && same["psnr"].is_null());
    for key in ["mse", "flip", "hdrflip", "tvi", "bias", "z_max"] {
        assert_eq!(same[key], 0.0, "{key}");
    }
    let row: Vec<&str> = lines[2].split_whitespace().collect();
    assert_eq!((row[0], row[1]), ("b.exr", "0.00960"), "{table}");

    let few = lumiris(&["compare", "a.exr", "-r", "r.exr", "--metrics", "tvi,mse", "--json", "-"], folder.path());
    let few = report(&few);
    assert!(
        few["images"][0]["tvi"].is_f64() && few["images"][0]["flip"].is_null() && few["images"][0]["rmse"].is_null()
    );
}

#[test]
fn limits_decide_the_exit_code() {
    // Limits on metrics
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    write_plain(&path("r.exr"), &image([0.5; 3]));
    write_plain(&path("a.exr"), &image([0.4; 3]));
    let code = |limits: &[&str]| {
        let output =
            lumiris(&[&["compare", "a.exr", "-r", "r.exr", "--metrics", "mse"], limits].concat(), folder.path());
        (output.status.code().unwrap(), stderr(&output))
    };
    assert_eq!(code(&["--fail-above", "mse=0.01", "--fail-below", "psnr=20"]).0, 0);
    let (exit, said) = code(&["--fail-above", "bias=0.09", "--fail-below", "psnr=30"]);
    assert!(exit == 1 && said.contains("a.exr: bias = -0.09") && said.contains("psnr = 20.1"), "{said}");

    // Metrics that cannot be computed or do not exist
    let (exit, said) = code(&["--fail-above", "z=0.1"]);
    assert!(exit == 3 && said.contains("no variances"), "{said}");
    let (exit, said) = code(&["--fail-above", "ssim=0.1"]);
    assert!(exit == 2 && said.contains("no number `ssim`") && said.contains("relmse"), "{said}");
    let (exit, said) = code(&["--metrics", "ssim"]);
    assert!(exit == 2 && said.contains("ssim") && said.contains("hdrflip"), "{said}");
}

#[test]
fn bad_files_are_said_at_once_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("text.png"), "no image").unwrap();
    write_plain(&path("r.exr"), &image([0.5; 3]));
    let small = Part::linear(4, 3, names(&["R", "G", "B"]), vec![0.0; 36]);
    write_image(&path("small.exr"), &[small]).unwrap();
    let run = |images: &[&str]| {
        let rest = ["--reference", "r.exr", "--html", "page", "--json", "out.json"];
        let output = lumiris(&[&["compare"], images, &rest].concat(), folder.path());
        assert_eq!(output.status.code(), Some(3));
        stderr(&output)
    };
    let said = run(&["none.exr", "text.png", "r.exr"]);
    assert!(said.contains("none.exr: no such file") && said.contains("text.png"), "{said}");
    let said = run(&["small.exr", "r.exr"]);
    assert!(said.contains("small.exr is 4×3 and the reference r.exr is 40×30"), "{said}");
    assert!(!path("page").exists() && !path("out.json").exists());
}

#[test]
fn images_of_every_format_are_linear_when_they_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let value = |i: usize| [(i % 40) as f32 / 40.0, (i / 40) as f32 / 30.0, 0.5];
    let pixels: Vec<[f32; 3]> = (0..1200).map(value).collect();
    write_plain(&path("r.exr"), &pixels);
    write_plain(&path("a.hdr"), &pixels);
    let encoded = pixels.as_flattened().iter().map(|&v| linear_to_srgb(v)).collect();
    write_image(&path("a.png"), &[Part::display(SIZE[0], SIZE[1], names(&["R", "G", "B"]), encoded)]).unwrap();
    // Rows of a PFM start at the bottom
    let mut pfm = b"PF\n40 30\n-1.0\n".to_vec();
    pfm.extend(pixels.chunks(40).rev().flatten().flatten().flat_map(|v| v.to_le_bytes()));
    std::fs::write(path("a.pfm"), pfm).unwrap();
    let cycles = names(&["ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B", "ViewLayer.Mist.Z"]);
    let data = pixels.iter().flat_map(|p| [p[0], p[1], p[2], 9.0]).collect();
    write_image(&path("cycles.exr"), &[Part::linear(SIZE[0], SIZE[1], cycles, data)]).unwrap();

    let args =
        ["compare", "a.hdr", "a.png", "a.pfm", "cycles.exr", "-r", "r.exr", "--metrics", "rmse,bias", "--json", "-"];
    let output = lumiris(&args, folder.path());
    let out = report(&output);
    // RGBE keeps 8 bits of the largest channel, PNG 8 bits of the encoded value, the others all bits
    for (i, max) in [(0, 2e-3), (1, 3e-3), (2, 0.0), (3, 0.0)] {
        let rmse = out["images"][i]["rmse"].as_f64().unwrap();
        assert!(rmse <= max, "{} {rmse}", out["images"][i]["path"]);
        assert!(out["images"][i]["bias"].as_f64().unwrap().abs() <= 0.6 * max);
    }
    assert_eq!(out["images"][3]["layer"], "ViewLayer.Combined");
}

#[test]
fn crops_layers_and_odd_pixels_are_told_of() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mut pixels = image([0.25; 3]);
    pixels[45] = [f32::NAN, 1.0, 1.0];
    let data = pixels.as_flattened().to_vec();
    let part = |data: Vec<f32>| Part::linear(SIZE[0], SIZE[1], names(&["R", "G", "B"]), data);
    write_image(&path("a.exr"), &[part(vec![0.1; 3600]).named("albedo"), part(data).named("beauty")]).unwrap();
    let crop = Part::linear(8, 6, names(&["R", "G", "B"]), vec![0.25; 144]).with_window([0, 0], SIZE);
    write_image(&path("crop.exr"), &[crop]).unwrap();
    let output =
        lumiris(&["compare", "a.exr", "-r", "crop.exr", "--json", "-", "--fail-above", "nonfinite=1"], folder.path());
    let out = report(&output);
    let said = stderr(&output);
    assert!(said.contains("a.exr: colour is `beauty` (also there: albedo)"), "{said}");
    assert!(said.contains("columns 0..8 and rows 0..6 of 40×30") && said.contains("1 pixels are not finite"), "{said}");
    assert_eq!(out["region"], json!({ "x": 0, "y": 0, "width": 8, "height": 6 }));
    let a = &out["images"][0];
    assert_eq!((&a["pixels"], &a["nonfinite"]), (&json!(47), &json!(1.0)));
    // The block of value 2 has 4 × 2 pixels in the crop
    assert!((a["mse"].as_f64().unwrap() - 1.75 * 1.75 * 8.0 / 47.0).abs() < 1e-9);
}

/// The page of several images and a reference, open in a browser.
struct Open {
    browser: Browser,
    folder: tempfile::TempDir,
    output: Output,
}

fn open(images: &[(&str, Vec<[f32; 3]>)], options: &[&str]) -> Open {
    let folder = tempfile::tempdir().unwrap();
    for (name, pixels) in images {
        write_with_variance(&folder.path().join(name), pixels, 1e-4);
    }
    let names: Vec<&str> = images[..images.len() - 1].iter().map(|(name, _)| *name).collect();
    let reference = images[images.len() - 1].0;
    let rest = ["--reference", reference, "--html", "page", "--json", "-"];
    let output = lumiris(&[&["compare"], &names[..], &rest, options].concat(), folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    let browser = Browser::start([1500, 800]);
    let page = std::fs::canonicalize(folder.path().join("page/index.html")).unwrap();
    browser.open(&page, "document.body?.dataset.ready === 'true'");
    browser.settle();
    Open { browser, folder, output }
}

/// A script that returns the context of a copy of the page's canvas, which can be read repeatedly.
const COPY: &str = "(() => { const from = document.getElementById('canvas'); const to = document.createElement('canvas'); \
    [to.width, to.height] = [from.width, from.height]; const context = to.getContext('2d', { willReadFrequently: true }); \
    context.drawImage(from, 0, 0); return context; })()";

impl Open {
    /// Left, top, width and height of an element in the window.
    fn place(&self, id: &str) -> [f64; 4] {
        let script = format!(
            "(() => {{ const b = document.getElementById('{id}').getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; }})()"
        );
        let value = self.browser.run(&script);
        std::array::from_fn(|i| value[i].as_f64().unwrap())
    }

    /// A point of the canvas in the window, from shares of its width and height.
    fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, top, width, height] = self.place("canvas");
        [left + x * width, top + y * height]
    }

    /// Position of the centre of an image pixel, in wipe and single layout before zooming.
    fn pixel_at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, top, width, height] = self.place("canvas");
        let zoom = ((width - 24.0) / SIZE[0] as f64).min((height - 24.0) / SIZE[1] as f64);
        [left + width / 2.0 + (x + 0.5 - 20.0) * zoom, top + height / 2.0 + (y + 0.5 - 15.0) * zoom]
    }

    /// Colour of the canvas at a point of the window.
    fn color(&self, [x, y]: [f64; 2]) -> [i64; 3] {
        self.browser.settle();
        let [left, top, ..] = self.place("canvas");
        let script = format!("[...({COPY}).getImageData({}, {}, 1, 1).data]", (x - left).floor(), (y - top).floor());
        let value = self.browser.run(&script);
        std::array::from_fn(|i| value[i].as_i64().unwrap())
    }

    fn text(&self, id: &str) -> String {
        self.browser.run(&format!("document.getElementById('{id}').textContent")).as_str().unwrap().to_owned()
    }

    /// Chooses an entry of a select, or moves a slider, with the same events as a user.
    fn set(&self, id: &str, value: &str) {
        let event = if id == "exposure" { "input" } else { "change" };
        self.browser.run(&format!(
            "(() => {{ const e = document.getElementById('{id}'); e.value = '{value}'; \
             e.dispatchEvent(new Event('{event}', {{ bubbles: true }})); }})()"
        ));
        self.browser.settle();
    }

    fn click(&self, selector: &str) {
        self.browser.run(&format!("document.querySelector('{selector}').click()"));
        self.browser.settle();
    }

    fn shows(&self, id: &str) -> bool {
        self.browser.run(&format!("!document.getElementById('{id}').hidden")) == json!(true)
    }

    /// Bounding box of pure yellow in each third of the canvas, relative to the third.
    fn yellow_of_thirds(&self) -> Vec<Value> {
        self.browser.settle();
        let script = "(copy) => { const { width, height } = copy.canvas; return [0, 1, 2].map((k) => { \
            const d = copy.getImageData(Math.round((k * width) / 3), 0, Math.floor(width / 3), height); \
            const box = [1e9, 1e9, -1, -1]; \
            for (let i = 0; i < d.data.length; i += 4) { \
              if (d.data[i] < 255 || d.data[i + 1] < 255 || d.data[i + 2] > 0) continue; \
              const [x, y] = [(i / 4) % d.width, Math.floor(i / 4 / d.width)]; \
              box[0] = Math.min(box[0], x); box[1] = Math.min(box[1], y); \
              box[2] = Math.max(box[2], x); box[3] = Math.max(box[3], y); } \
            return box; }); }";
        self.browser.run(&format!("({script})({COPY})")).as_array().unwrap().clone()
    }

    fn has_no_complaint(&self) {
        assert!(self.browser.complaints.borrow().is_empty(), "{:?}", self.browser.complaints.borrow());
    }
}

/// Display values of a linear colour.
fn shown(pixel: [f32; 3], stops: f32) -> [i64; 3] {
    pixel.map(|v| (linear_to_srgb((v * stops.exp2()).clamp(0.0, 1.0)) * 255.0).round() as i64)
}

fn near(a: [i64; 3], b: [i64; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1)
}

const RED: [f32; 3] = [0.5, 0.1, 0.1];
const GREEN: [f32; 3] = [0.1, 0.5, 0.1];
const BLUE: [f32; 3] = [0.1, 0.1, 0.5];

fn three() -> Open {
    open(&[("a.exr", image(RED)), ("b.exr", image(GREEN)), ("r.exr", image(BLUE))], &[])
}

#[test]
fn the_page_wipes_between_images_and_exposes_true_radiance() {
    let page = three();
    let (left, right, between) = (page.at([0.3, 0.45]), page.at([0.7, 0.45]), page.at([0.6, 0.45]));
    assert_eq!(page.color(left), shown(RED, 0.0));
    assert_eq!((page.color(right), page.color(between)), (shown(BLUE, 0.0), shown(BLUE, 0.0)));

    // Divider by mouse and by keys
    page.browser.drag(&[page.at([0.5, 0.5]), page.at([0.55, 0.5]), page.at([0.65, 0.5])]);
    assert_eq!((page.color(between), page.color(right)), (shown(RED, 0.0), shown(BLUE, 0.0)));
    page.browser.run("document.getElementById('divider').focus()");
    (0..5).for_each(|_| page.browser.key("ArrowLeft", "ArrowLeft", false));
    assert_eq!(page.color(between), shown(BLUE, 0.0));

    // Left and right image by keys and by selects
    page.browser.key("2", "Digit2", false);
    assert_eq!(page.color(left), shown(GREEN, 0.0));
    page.set("image-b", "0");
    assert_eq!(page.color(right), shown(RED, 0.0));
    page.browser.key("x", "KeyX", false);
    assert_eq!((page.color(left), page.color(right)), (shown(RED, 0.0), shown(GREEN, 0.0)));

    // Both blocks are white at first but differ three stops down, since their values are kept
    let blocks = [page.pixel_at([5.0, 5.0]), page.pixel_at([13.0, 5.0])];
    assert_eq!(blocks.map(|b| page.color(b)), [[255; 3]; 2]);
    page.set("exposure", "-3");
    assert_eq!(page.text("exposure-value"), "−3.0");
    assert!(near(page.color(blocks[0]), shown([2.0; 3], -3.0)) && near(page.color(blocks[1]), shown([4.0; 3], -3.0)));
    (0..4).for_each(|_| page.browser.key("e", "KeyE", false));
    assert!(near(page.color(left), shown(RED, -1.0)), "{:?}", page.color(left));
    page.browser.key("r", "KeyR", false);
    page.browser.point(blocks[1]);
    page.browser.settle();
    let said = page.text("readout");
    assert!(said.contains("x 13  y 5") && said.contains("a.exr 4 4 4") && said.contains("b.exr 4 4 4"), "{said}");

    // The window shows the contents of the canvas
    let png = page.folder.path().join("window.png");
    page.browser.screenshot(&png);
    let window = read_image(&png, &ReadLimits::default()).unwrap().image;
    let seen = [0, 1, 2].map(|c| (window.get(left[0] as usize, left[1] as usize, c) * 255.0).round() as i64);
    assert!(near(seen, page.color(left)), "{seen:?}");
    page.has_no_complaint();
}

#[test]
fn the_page_zooms_and_pans_all_images_together() {
    // Zoom at the pointer
    let page = three();
    let before = page.text("zoom");
    let point = page.pixel_at([22.0, 22.0]);
    page.browser.wheel(point, -480.0);
    page.browser.point([point[0] + 1.0, point[1]]);
    page.browser.settle();
    assert_ne!(page.text("zoom"), before);
    assert!(page.text("readout").contains("x 22  y 22"), "the point under the pointer stays: {}", page.text("readout"));
    assert_eq!(page.color(page.at([0.4, 0.02])), shown(RED, 0.0), "what was beside the image is filled by it");

    // Three images side by side zoom and pan together
    page.browser.key("f", "KeyF", false);
    page.browser.key("g", "KeyG", false);
    let fit = page.yellow_of_thirds();
    assert!(fit.iter().all(|b| *b == fit[0] && b[2].as_f64().unwrap() > 0.0), "{fit:?}");
    let third = page.at([0.9, 0.6]);
    page.browser.wheel(third, -240.0);
    let zoomed = page.yellow_of_thirds();
    assert!(zoomed.iter().all(|b| *b == zoomed[0]) && zoomed[0] != fit[0], "{zoomed:?}");
    page.browser.drag(&[third, [third[0] - 10.0, third[1] - 20.0], [third[0] - 30.0, third[1] - 50.0]]);
    let panned = page.yellow_of_thirds();
    let shift = |i: usize| panned[0][i].as_f64().unwrap() - zoomed[0][i].as_f64().unwrap();
    assert!(panned.iter().all(|b| *b == panned[0]), "{panned:?}");
    assert!((shift(0) + 30.0).abs() <= 1.0 && (shift(1) + 50.0).abs() <= 1.0, "{zoomed:?} {panned:?}");

    // Fit again
    page.browser.call("Input.dispatchKeyEvent", json!({ "type": "keyDown", "key": "f", "code": "KeyF" }));
    assert_eq!(page.yellow_of_thirds(), fit);
    page.has_no_complaint();
}

#[test]
fn the_page_shows_maps_with_their_scales_and_a_table_that_sorts() {
    let page = three();
    let out: Value = serde_json::from_slice(&page.output.stdout).unwrap();
    let (left, block) = (page.at([0.3, 0.45]), page.pixel_at([5.0, 5.0]));
    assert!(!page.shows("legend-a") && !page.shows("legend-b"));
    let mut seen = Vec::new();
    for view in ["difference", "signed", "relative", "variance", "flip", "hdrflip", "tvi", "z"] {
        page.set("view-a", view);
        assert!(page.shows("legend-a"), "{view}");
        assert_eq!(page.browser.run("document.querySelectorAll('#legend-a .ticks span').length"), json!(5), "{view}");
        let [here, there] = [left, block].map(|p| page.color(p));
        // The block is the same in both images; only the variance is the same everywhere
        assert_eq!(here == there, view == "variance", "{view} {here:?} {there:?}");
        seen.push((here, page.text("legend-a")));
    }
    assert!((1..seen.len()).all(|i| seen[i].1 != seen[i - 1].1), "{seen:?}");
    page.browser.key("]", "BracketRight", false);
    assert_ne!(page.text("legend-a"), seen[7].1);
    page.browser.point(left);
    page.browser.settle();
    assert!(page.text("readout").contains("z (standard deviations): "), "{}", page.text("readout"));

    // The reference has no ꟻLIP; its side has its own legend
    page.set("view-b", "flip");
    assert!(page.shows("legend-b") && page.text("legend-b").contains("FLIP"));

    let column = |text: &str| {
        page.browser
            .run(&format!("[...document.querySelectorAll('#metrics th')].findIndex((t) => t.textContent === '{text}')"))
    };
    let index = column("tvi").as_i64().unwrap() + 1;
    let first = || page.browser.run("document.querySelector('#metrics tbody td').textContent");
    page.click(&format!("#metrics th:nth-child({index}) button"));
    let (one, up) = (&out["images"][0]["tvi"], first());
    page.click(&format!("#metrics th:nth-child({index}) button"));
    let (other, down) = (&out["images"][1]["tvi"], first());
    let min = if one.as_f64() < other.as_f64() { "a.exr" } else { "b.exr" };
    assert!(up == json!(min) && down != up, "{one} {other} {up} {down}");
    let cell = page.browser.run(&format!("document.querySelector('#metrics td:nth-child({index})').textContent"));
    let max = one.as_f64().unwrap().max(other.as_f64().unwrap());
    let text: f64 = cell.as_str().unwrap().parse().unwrap();
    assert!((text / max - 1.0).abs() < 0.005, "{text} {max}");
    page.has_no_complaint();
}

#[test]
fn a_page_of_one_image_works_and_marks_what_is_not_finite() {
    // Colours, and the marker of values that are not finite
    let mut pixels = image(RED);
    pixels[16 * 40 + 10] = [f32::NAN, 0.5, 0.5];
    let page = open(&[("a.exr", pixels), ("r.exr", image(BLUE))], &["--metrics", "mse", "--exposure", "-1"]);
    assert!(near(page.color(page.at([0.3, 0.3])), shown(RED, -1.0)));
    assert_eq!(page.color(page.pixel_at([10.0, 16.0])), [255, 0, 255]);

    // Single layout
    page.browser.key("s", "KeyS", false);
    assert!(!page.shows("divider") && !page.shows("side-b"));
    page.browser.key("0", "Digit0", false);
    assert!(near(page.color(page.at([0.3, 0.3])), shown(BLUE, -1.0)));
    page.browser.key("1", "Digit1", false);

    // Numbers and choices
    page.browser.point(page.pixel_at([10.0, 16.0]));
    page.browser.settle();
    assert!(page.text("readout").contains("a.exr NaN 0.5 0.5"), "{}", page.text("readout"));
    assert!(page.text("metrics").contains("NaN, inf"));
    assert_eq!(
        page.browser.run("[...document.querySelectorAll('#view-a option')].some((o) => o.value === 'flip')"),
        json!(false)
    );
    page.has_no_complaint();
}
