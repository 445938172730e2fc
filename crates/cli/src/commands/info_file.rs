//! `lumiris info` for rendered files: images, parts and checkpoints.

use super::pictures::is_picture;
use lumiris::film::Summary;
use lumiris::imaging::oiio::{read_headers, read_metadata};
use lumiris::render::parts::{FilmHeader, FilmReader, PartError, merge};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Prefix of the settings in metadata.
const PREFIX: &str = "lumiris:";

/// Layers, settings and other metadata, as JSON; `None` for a file that may be a scene.
pub(super) fn facts_of_file(path: &Path) -> anyhow::Result<Option<Value>> {
    if is_picture(path) {
        return Ok(Some(facts_of_image(path)?));
    }
    match FilmReader::open(path) {
        Ok(reader) => Ok(Some(facts_of_part(path, reader.header()))),
        Err(error @ PartError::Damaged { .. }) => Err(error.into()),
        Err(_) => Ok(None),
    }
}

fn facts_of_image(path: &Path) -> anyhow::Result<Value> {
    // Group the channels by layer
    let headers = read_headers(path)?;
    let mut layers: Vec<(String, Vec<String>)> = Vec::new();
    for channel in headers.iter().flat_map(|part| &part.channels) {
        let (layer, name) = channel.rsplit_once('.').unwrap_or(("", channel));
        let layer = if layer.is_empty() { "image" } else { layer };
        match layers.iter_mut().find(|(other, _)| other == layer) {
            Some((_, names)) => names.push(name.to_owned()),
            None => layers.push((layer.to_owned(), vec![name.to_owned()])),
        }
    }
    let layers: Map<_, _> = layers.into_iter().map(|(layer, names)| (layer, names.join(" ").into())).collect();
    let [width, height] = headers.first().map_or([0, 0], |part| part.size);

    // Separate the settings from other metadata
    let Divided { settings, others } = divided(read_metadata(path)?);
    Ok(json!({
        "image": path.display().to_string(),
        "size": format!("{width}x{height}"),
        "parts": headers.len(),
        "layers": layers,
        "settings": settings,
        "metadata": others,
    }))
}

fn facts_of_part(path: &Path, header: &FilmHeader) -> Value {
    let Divided { settings, others } = divided(header.settings.iter().chain(&header.notes).cloned());
    let share = header.share.map(|share| format!("{} of {}", share.index + 1, share.count));
    json!({
        "part": path.display().to_string(),
        "size": format!("{}x{}", header.bounds.width(), header.bounds.height()),
        "samples": format!("{} to {} of {}", header.samples.start, header.samples.end, header.spp),
        "samples done": samples_done(path, header),
        "share of tiles": share.unwrap_or_else(|| "all".to_owned()),
        "is complete": header.is_finished,
        "light groups": header.light_layers.join(" "),
        "settings": settings,
        "metadata": others,
    })
}

/// The samples of the pixels so far, or the reason why they cannot be read.
fn samples_done(path: &Path, header: &FilmHeader) -> String {
    let of = if header.share.is_some() { Summary::samples_text_of_sampled } else { Summary::samples_text };
    merge(&[path.to_owned()], true)
        .map_or_else(|error| error.to_string(), |merged| of(merged.film.summary(), "per pixel"))
}

/// Metadata, by whether it is a setting of the renderer.
struct Divided {
    settings: Map<String, Value>,
    others: Map<String, Value>,
}

/// Splits metadata into the renderer's settings and everything else.
fn divided(entries: impl IntoIterator<Item = (String, String)>) -> Divided {
    let (mut settings, mut others) = (Map::new(), Map::new());
    for (key, text) in entries {
        let value = Value::String(text);
        match key.strip_prefix(PREFIX) {
            Some(name) => settings.insert(name.to_owned(), value),
            None => others.insert(key, value),
        };
    }
    Divided { settings, others }
}
