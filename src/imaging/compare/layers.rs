//! Which channels of a file are the image.
//!
//! Programs name them in many ways: `R G B` (pbrt, Mitsuba, Lumiris), `rgb.R` (Mitsuba with several films),
//! `Combined.R` or `ViewLayer.Combined.R` (Cycles), parts of one file that all have `R G B` (then the name of the part
//! counts). A **layer** is a set of red, green and blue under one name.

use crate::imaging::file::PartHeader;

/// Channels that make a colour.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Part of the file, from 0.
    pub part: usize,
    /// What stands before the channels' last dot, or the name of the part; empty for plain `R G B`.
    pub name: String,
    /// Positions in the part: three, or one that is grey.
    pub channels: Vec<usize>,
}

/// Names that stand for the image itself, not for a part of its light or a feature.
const IMAGE_NAMES: [&str; 10] =
    ["combined", "beauty", "rgb", "rgba", "color", "colour", "image", "main", "final", "default"];

impl Layer {
    /// 0 for the name that most surely means the image.
    fn rank(&self) -> u8 {
        let last = self.name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
        match () {
            () if self.channels.len() == 1 => 3,
            () if self.name.is_empty() => 0,
            () if IMAGE_NAMES.contains(&last.as_str()) => 1,
            () => 2,
        }
    }

    /// The name as in messages.
    pub fn title(&self) -> &str {
        if self.name.is_empty() { "R G B" } else { &self.name }
    }

    /// What `--layer` calls it: the whole name or what stands after its last dot.
    fn is_called(&self, wanted: &str) -> bool {
        let last = self.name.rsplit('.').next().unwrap_or_default();
        self.name.eq_ignore_ascii_case(wanted) || last.eq_ignore_ascii_case(wanted)
    }
}

/// Name before the last dot, and what follows it.
fn split(channel: &str) -> (&str, &str) {
    channel.rsplit_once('.').unwrap_or(("", channel))
}

/// Position of a colour component among red, green and blue.
fn component(name: &str) -> Option<usize> {
    match name.to_ascii_lowercase().as_str() {
        "r" | "red" => Some(0),
        "g" | "green" => Some(1),
        "b" | "blue" => Some(2),
        _ => None,
    }
}

/// All colour layers of a file, in its order.
pub fn color_layers(parts: &[PartHeader]) -> Vec<Layer> {
    let mut layers = Vec::new();
    for (part, header) in parts.iter().enumerate() {
        let mut names: Vec<&str> = Vec::new();
        for channel in &header.channels {
            let (name, _) = split(channel);
            if !names.contains(&name) {
                names.push(name);
            }
        }
        for name in names {
            let mut rgb = [None; 3];
            for (position, channel) in header.channels.iter().enumerate() {
                if let (true, Some(c)) = (split(channel).0 == name, component(split(channel).1)) {
                    rgb[c] = rgb[c].or(Some(position));
                }
            }
            if let [Some(r), Some(g), Some(b)] = rgb {
                let name = if name.is_empty() && parts.len() > 1 { header.name.as_str() } else { name };
                layers.push(Layer { part, name: name.to_owned(), channels: vec![r, g, b] });
            }
        }
    }
    layers
}

/// The layer that is the image, or the one called `wanted` (a single channel as well). `Err` says what there is.
pub fn choose(parts: &[PartHeader], wanted: Option<&str>) -> Result<Layer, String> {
    let layers = color_layers(parts);
    let channels =
        || parts.iter().enumerate().flat_map(|(p, h)| h.channels.iter().enumerate().map(move |(c, n)| (p, c, n)));
    let grey = |(part, c, name): (usize, usize, &String)| Layer { part, name: name.clone(), channels: vec![c] };
    if let Some(wanted) = wanted {
        let found = layers.iter().find(|l| l.is_called(wanted)).cloned();
        let single = || channels().find(|(.., n)| n.eq_ignore_ascii_case(wanted)).map(grey);
        return found.or_else(single).ok_or_else(|| {
            let mut names: Vec<&str> = layers.iter().map(Layer::title).collect();
            names.extend(channels().map(|(.., n)| n.as_str()).filter(|n| component(split(n).1).is_none()));
            format!("has no layer `{wanted}`; it has {}", names.join(", "))
        });
    }
    if let Some(best) = layers.into_iter().min_by_key(Layer::rank) {
        return Ok(best);
    }
    let is_alpha = |n: &str| matches!(split(n).1.to_ascii_lowercase().as_str(), "a" | "alpha");
    let luminance = channels().find(|(.., n)| n.eq_ignore_ascii_case("y"));
    let first = || channels().find(|(.., n)| !is_alpha(n)).or_else(|| channels().next());
    luminance.or_else(first).map(grey).ok_or_else(|| "has no channels".to_owned())
}

/// What a person should know of the choice; `None` if there was none to make.
pub fn remark(parts: &[PartHeader], chosen: &Layer) -> Option<String> {
    let layers = color_layers(parts);
    let others: Vec<&str> = layers.iter().filter(|l| *l != chosen).map(Layer::title).collect();
    let plain = chosen.name.is_empty() && !layers.iter().any(|l| l != chosen && l.name.is_empty());
    if plain || others.is_empty() {
        return None;
    }
    Some(format!("colour is `{}` (also there: {})", chosen.title(), others.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(name: &str, channels: &[&str]) -> PartHeader {
        let channels = channels.iter().map(|&c| c.to_owned()).collect();
        PartHeader { name: name.to_owned(), channels, size: [1, 1] }
    }

    #[test]
    fn the_image_is_found_whatever_its_name() {
        let cases: [(&[&str], &str, &[usize]); 8] = [
            (&["R", "G", "B", "albedo.R", "albedo.G", "albedo.B"], "", &[0, 1, 2]),
            (&["albedo.B", "albedo.G", "albedo.R", "B", "G", "R"], "", &[5, 4, 3]),
            (&["nn.X", "rgb.R", "rgb.G", "rgb.B"], "rgb", &[1, 2, 3]),
            (
                &[
                    "ViewLayer.Albedo.R",
                    "ViewLayer.Albedo.G",
                    "ViewLayer.Albedo.B",
                    "ViewLayer.Combined.A",
                    "ViewLayer.Combined.B",
                    "ViewLayer.Combined.G",
                    "ViewLayer.Combined.R",
                ],
                "ViewLayer.Combined",
                &[6, 5, 4],
            ),
            (&["Combined.R", "Combined.G", "Combined.B", "Combined.A"], "Combined", &[0, 1, 2]),
            (&["A", "Y"], "Y", &[1]),
            (&["A", "Z"], "Z", &[1]),
            (&["red", "green", "blue"], "", &[0, 1, 2]),
        ];
        for (channels, name, positions) in cases {
            let chosen = choose(&[part("", channels)], None).unwrap();
            assert_eq!((chosen.name.as_str(), chosen.channels.as_slice()), (name, positions), "{channels:?}");
        }
        assert!(choose(&[part("", &[])], None).unwrap_err().contains("no channels"));
    }

    #[test]
    fn parts_are_told_apart_by_their_names() {
        let rgb = ["R", "G", "B"];
        let parts = [part("albedo", &rgb), part("beauty", &rgb), part("depth", &["Z"])];
        let chosen = choose(&parts, None).unwrap();
        assert_eq!((chosen.part, chosen.name.as_str()), (1, "beauty"));
        assert_eq!(remark(&parts, &chosen).unwrap(), "colour is `beauty` (also there: albedo)");
        assert_eq!(choose(&parts, Some("Albedo")).unwrap().part, 0);
        assert_eq!(choose(&parts, Some("Z")).unwrap().channels, [0]);
        let error = choose(&parts, Some("normal")).unwrap_err();
        assert_eq!(error, "has no layer `normal`; it has albedo, beauty, Z");
    }

    #[test]
    fn plain_channels_need_no_remark() {
        let parts = [part("", &["R", "G", "B", "variance.R", "variance.G", "variance.B"])];
        let chosen = choose(&parts, None).unwrap();
        assert_eq!(remark(&parts, &chosen), None);
        let albedo = choose(&parts, Some("variance")).unwrap();
        assert!(remark(&parts, &albedo).unwrap().contains("`variance` (also there: R G B)"));
    }
}
