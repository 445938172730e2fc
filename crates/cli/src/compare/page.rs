//! The HTML page: a single self-contained file.
//!
//! The page contains pixel values, so that exposures, differences and displayed values are exact. Values are f32
//! rounded to 16 significant bits (the low 8 bits are dropped; range, NaN and infinity are kept). Their bytes are
//! sorted by significance, compressed by zlib, and encoded in base64. Maps that are expensive to compute (ꟻLIP, tvi)
//! are embedded in the same form.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::{Compression, write::ZlibEncoder};
use lumiris::imaging::compare::columns::shown_columns;
use lumiris::imaging::compare::load::{ImageSet, Shown};
use lumiris::imaging::compare::scores::{Compared, Scores, Settings};
use lumiris::imaging::heat::{BLUE_RED, HEAT, Stops};
use lumiris::imaging::metrics::Pixel;
use lumiris_formats::output::{check_writable, write_whole};
use minijinja::{Environment, Value as Safe, context};
use serde_json::{Value, json};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

const TEMPLATE: &str = include_str!("viewer/index.html");
const STYLE: &str = include_str!("viewer/style.css");
const IMAGES: &str = include_str!("viewer/images.js");
const VIEWER: &str = include_str!("viewer/viewer.js");

/// Path of the page in a folder.
fn page_in(folder: &Path) -> PathBuf {
    folder.join("index.html")
}

/// Fails if the page of a folder cannot be written. A missing folder is created later.
pub(crate) fn check_page(folder: &Path) -> io::Result<()> {
    if folder.exists() { check_writable(&page_in(folder)) } else { Ok(()) }
}

/// Writes `index.html` into a folder, which is created if it is missing. Returns the path of the page.
pub(crate) fn write_page(
    folder: &Path,
    set: &ImageSet,
    settings: &Settings,
    compared: &[Compared],
) -> io::Result<PathBuf> {
    std::fs::create_dir_all(folder)?;
    let path = page_in(folder);
    write_whole(&path, |file| {
        let mut out = BufWriter::new(file);
        write(&mut out, set, settings, compared)?;
        out.flush()
    })?;
    Ok(path)
}

/// Writes the page.
fn write(out: impl Write, set: &ImageSet, settings: &Settings, compared: &[Compared]) -> io::Result<()> {
    let mut data = String::new();
    let mut images = Vec::new();
    for (index, shown) in set.images.iter().enumerate() {
        images.push(image(index, shown, Some(&compared[index]), &mut data)?);
    }
    images.push(image(set.images.len(), &set.reference, None, &mut data)?);
    let manifest = manifest(set, settings, compared, images);
    // `<` could close the script element
    let manifest = manifest.to_string().replace('<', "\\u003c");

    let [style, images, viewer] = [STYLE, IMAGES, VIEWER].map(|text| Safe::from_safe_string(text.to_owned()));
    let [manifest, data] = [manifest, data].map(Safe::from_safe_string);
    let context = context! { style, manifest, data, images, viewer };
    let environment = Environment::new();
    let template = environment.template_from_named_str("index.html", TEMPLATE).map_err(io::Error::other)?;
    template.render_captured_to(context, out).map_err(io::Error::other)?;
    Ok(())
}

/// Everything except pixel values.
fn manifest(set: &ImageSet, settings: &Settings, compared: &[Compared], images: Vec<Value>) -> Value {
    let scores: Vec<&Scores> = compared.iter().map(|c| &c.scores).collect();
    let columns = shown_columns(&settings.metrics, &scores);
    let described: Vec<Value> = columns
        .iter()
        .map(|c| json!({ "key": c.key, "title": c.title, "help": c.help, "better": <&str>::from(c.better) }))
        .collect();
    let rows: Vec<Value> = scores
        .iter()
        .map(|s| {
            let cells = columns.iter().map(|c| {
                let value = (c.value)(s);
                // JSON has no infinity; the largest number sorts the same
                let sortable = value.map(|v| if v.is_nan() { f64::MAX } else { v.clamp(f64::MIN, f64::MAX) });
                json!({ "value": sortable, "text": value.map_or("–".to_owned(), c.text) })
            });
            Value::from(cells.collect::<Vec<_>>())
        })
        .collect();
    let r = set.region;
    json!({
        "x": r.x, "y": r.y, "width": r.width, "height": r.height,
        "images": images, "columns": described, "rows": rows,
        "exposure": settings.exposure, "epsilon": settings.epsilon,
        "heat": colors(HEAT), "signed": colors(BLUE_RED),
        "version": env!("CARGO_PKG_VERSION"),
    })
}

fn colors(stops: Stops) -> Value {
    json!(stops)
}

/// Appends the pixels and maps of an image and describes them.
fn image(index: usize, shown: &Shown, compared: Option<&Compared>, data: &mut String) -> io::Result<Value> {
    // Colours and variances
    let mut layers = Vec::new();
    let mut add = |key: &str, values: &[f32]| -> io::Result<()> {
        layers.push(key.to_owned());
        append(data, &format!("data-{index}-{key}"), values)
    };
    add("color", shown.pixels.as_flattened())?;
    if let Some(variance) = &shown.variance {
        let mean = |v: &Pixel| (v[0] + v[1] + v[2]) / 3.0;
        add("variance", &variance.iter().map(mean).collect::<Vec<_>>())?;
    }

    // Maps
    if let Some(maps) = compared.map(|c| &c.maps) {
        for (key, map) in [("flip", &maps.flip), ("hdrflip", &maps.hdr_flip), ("tvi", &maps.tvi), ("z", &maps.z)] {
            if let Some(map) = map {
                add(key, map)?;
            }
        }
    }
    let path = shown.path.display().to_string();
    Ok(json!({ "name": shown.name, "path": path, "layer": shown.layer, "data": layers }))
}

/// Appends a script element with encoded values.
fn append(data: &mut String, id: &str, values: &[f32]) -> io::Result<()> {
    data.push_str(&format!("<script type=\"application/octet-stream\" id=\"{id}\">"));
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(6));
    encoder.write_all(&planes(values))?;
    STANDARD.encode_string(encoder.finish()?, data);
    data.push_str("</script>\n");
    Ok(())
}

/// The upper three bytes of all values as three planes, most significant first.
fn planes(values: &[f32]) -> Vec<u8> {
    let n = values.len();
    let mut bytes = vec![0; 3 * n];
    for (i, &v) in values.iter().enumerate() {
        let bits = v.to_bits();
        let rounded = bits.wrapping_add(0x80);
        // Rounding would make the largest numbers infinite; NaN and infinity are not rounded
        let kept = if v.is_finite() && f32::from_bits(rounded).is_finite() { rounded } else { bits };
        let kept = if v.is_nan() { f32::NAN.to_bits() } else { kept };
        for (plane, byte) in kept.to_be_bytes()[..3].iter().enumerate() {
            bytes[plane * n + i] = *byte;
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumiris::imaging::compare::load::Region;
    use lumiris::imaging::compare::scores::compare;

    #[test]
    fn values_keep_sixteen_bits_and_their_kind() {
        let values = [0.0, 1.0, -0.1, 1e-30, 65_504.0 * 7.3, f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
        let bytes = planes(&values);
        for (i, &v) in values.iter().enumerate() {
            let back = f32::from_be_bytes([bytes[i], bytes[values.len() + i], bytes[2 * values.len() + i], 0]);
            let same = (v.is_nan() && back.is_nan()) || v == back || (v - back).abs() <= v.abs() / 65_536.0;
            assert!(same, "{v} {back}");
        }
    }

    #[test]
    fn the_page_is_one_file_without_anything_from_elsewhere() {
        // Images, one with a name that closes a script element
        let shown = |name: &str, v: f32| Shown {
            path: name.into(),
            name: name.into(),
            layer: "R G B".into(),
            remarks: Vec::new(),
            pixels: vec![[v; 3]; 4],
            variance: Some(vec![[0.01; 3]; 4]),
            is_half: false,
        };
        let region = Region { x: 0, y: 0, width: 2, height: 2 };
        let evil = "</script><script>alert(1)</script>.exr";
        let set = ImageSet { images: vec![shown(evil, 0.5)], reference: shown("r.exr", 0.25), region, display: [2, 2] };

        // The name is escaped
        let settings = Settings::default();
        let folder = tempfile::tempdir().unwrap();
        let path = write_page(&folder.path().join("new"), &set, &settings, &compare(&set, &settings)).unwrap();
        let html = std::fs::read_to_string(path).unwrap();
        assert!(!html.contains("alert(1)</script>") && html.contains("\\u003c/script>"));

        // Nothing is loaded from elsewhere
        assert!(
            !html.contains("http:") && !html.contains("https:") && !html.contains("src=") && !html.contains("url(")
        );

        // Each map is there once
        for id in ["data-0-color", "data-0-variance", "data-0-flip", "data-0-hdrflip", "data-0-z", "data-1-color"] {
            assert_eq!(html.matches(&format!("id=\"{id}\"")).count(), 1, "{id}");
        }
        assert_eq!(html.matches("<script").count(), html.matches("</script>").count());
        assert!(!html.contains("data-1-flip") && !html.contains("{{"));
        assert_eq!(std::fs::read_dir(folder.path().join("new")).unwrap().count(), 1);
    }
}
