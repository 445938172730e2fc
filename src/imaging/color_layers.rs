//! Selects the colour channels of a file, for textures, environment maps, comparisons and denoising alike.
//!
//! Programs name them differently: `R G B` (pbrt, Mitsuba, Lumiris), `rgb.R` (Mitsuba with several films), `Combined.R`
//! or `ViewLayer.Combined.R` (Cycles), or several parts that all have `R G B` (then the name of the part counts). A
//! **layer** is a set of red, green and blue with a common name. The image is the layer without a name; else the only
//! layer with a name of the whole image; else the only layer. In all other cases the user has to choose.

use super::channels::ColorChannels;
use super::file::PartHeader;

/// A set of colour channels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColorLayer {
    /// Part of the file, from 0.
    pub part: usize,
    /// The channel names before their last dot, or the name of the part; empty for plain `R G B`.
    pub name: String,
    /// Positions of the channels in the part.
    pub channels: ColorChannels,
    /// Position of the opacity channel, if there is one.
    pub alpha: Option<usize>,
}

/// Names of the whole image, in contrast to a light component or a feature.
const IMAGE_NAMES: [&str; 10] =
    ["combined", "beauty", "rgb", "rgba", "color", "colour", "image", "main", "final", "default"];

impl ColorLayer {
    /// Order of preference as the image; 0 is the best.
    fn rank(&self) -> u8 {
        let last = last_of(&self.name).to_ascii_lowercase();
        match () {
            () if self.name.is_empty() => 0,
            () if IMAGE_NAMES.contains(&last.as_str()) => 1,
            () => 2,
        }
    }

    /// The name in messages.
    pub fn title(&self) -> &str {
        if self.name.is_empty() { "R G B" } else { &self.name }
    }

    /// True if `--layer` with this name selects the layer: its whole name, or the part after the last dot.
    fn is_called(&self, wanted: &str) -> bool {
        self.name.eq_ignore_ascii_case(wanted) || last_of(&self.name).eq_ignore_ascii_case(wanted)
    }
}

/// The part of a channel name before the last dot.
fn layer_of(channel: &str) -> &str {
    channel.rsplit_once('.').map_or("", |(layer, _)| layer)
}

/// The part of a name after the last dot.
fn last_of(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(_, last)| last)
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

/// True for the channel name of opacity.
fn is_alpha(name: &str) -> bool {
    matches!(name.to_ascii_lowercase().as_str(), "a" | "alpha")
}

/// Position of the opacity channel of a layer in a part.
fn alpha_of(header: &PartHeader, layer: &str) -> Option<usize> {
    header.channels.iter().position(|channel| layer_of(channel) == layer && is_alpha(last_of(channel)))
}

/// All colour layers of a file, in file order.
pub fn color_layers(parts: &[PartHeader]) -> Vec<ColorLayer> {
    // The names before the last dot, in file order
    let mut layers = Vec::new();
    for (part, header) in parts.iter().enumerate() {
        let mut names: Vec<&str> = Vec::new();
        for channel in &header.channels {
            let name = layer_of(channel);
            if !names.contains(&name) {
                names.push(name);
            }
        }

        // Names with red, green and blue are layers
        for name in names {
            let mut rgb = [None; 3];
            for (position, channel) in header.channels.iter().enumerate() {
                if let (true, Some(c)) = (layer_of(channel) == name, component(last_of(channel))) {
                    rgb[c] = rgb[c].or(Some(position));
                }
            }
            if let [Some(r), Some(g), Some(b)] = rgb {
                let title = if name.is_empty() && parts.len() > 1 { header.name.as_str() } else { name };
                layers.push(ColorLayer {
                    part,
                    name: title.to_owned(),
                    channels: ColorChannels::Rgb([r, g, b]),
                    alpha: alpha_of(header, name),
                });
            }
        }
    }
    layers
}

/// The layer that is the image, or the layer or single channel called `wanted`. In a file without colour layers, the
/// image is the channel Y, or the first channel that is not opacity. `Err` lists the alternatives.
pub fn choose(parts: &[PartHeader], wanted: Option<&str>) -> Result<ColorLayer, String> {
    let layers = color_layers(parts);
    let channels =
        || parts.iter().enumerate().flat_map(|(p, h)| h.channels.iter().enumerate().map(move |(c, n)| (p, c, n)));
    let grey = |(part, c, name): (usize, usize, &String)| {
        let alpha = alpha_of(&parts[part], layer_of(name));
        ColorLayer { part, name: name.clone(), channels: ColorChannels::Grey(c), alpha }
    };
    if let Some(wanted) = wanted {
        let found = layers.iter().find(|l| l.is_called(wanted)).cloned();
        let single = || channels().find(|(.., n)| n.eq_ignore_ascii_case(wanted)).map(grey);
        return found.or_else(single).ok_or_else(|| {
            let mut names: Vec<&str> = layers.iter().map(ColorLayer::title).collect();
            names.extend(channels().map(|(.., n)| n.as_str()).filter(|n| component(last_of(n)).is_none()));
            format!("has no layer `{wanted}`; it has {}", names.join(", "))
        });
    }
    if let Some(best) = layers.iter().min_by_key(|layer| layer.rank()) {
        // Parts without names are pages of one picture
        let is_only = layers.iter().filter(|other| other.rank() == best.rank()).count() == 1;
        if is_only || best.name.is_empty() {
            return Ok(best.clone());
        }
        let names: Vec<&str> = layers.iter().map(ColorLayer::title).collect();
        return Err(format!("has several images, none of which is plain R G B: {}", names.join(", ")));
    }
    let luminance = channels().find(|(.., n)| n.eq_ignore_ascii_case("y"));
    let first = || channels().find(|(.., n)| !is_alpha(last_of(n))).or_else(|| channels().next());
    luminance.or_else(first).map(grey).ok_or_else(|| "has no channels".to_owned())
}

/// A remark for the user on the choice; `None` if there was no choice.
pub fn remark(parts: &[PartHeader], chosen: &ColorLayer) -> Option<String> {
    let layers = color_layers(parts);
    let others: Vec<&str> = layers.iter().filter(|l| *l != chosen).map(ColorLayer::title).collect();
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
        // Channels, name of the image, positions of its channels
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
        assert_eq!(choose(&parts, Some("Z")).unwrap().channels, ColorChannels::Grey(0));
        let error = choose(&parts, Some("normal")).unwrap_err();
        assert_eq!(error, "has no layer `normal`; it has albedo, beauty, Z");
    }

    #[test]
    fn of_several_images_without_a_plain_one_the_names_are_told() {
        let layer = |name: &str| ["R", "G", "B", "A"].map(|c| format!("{name}.{c}"));
        let file = |names: &[&str]| {
            let channels: Vec<String> = names.iter().flat_map(|name| layer(name)).collect();
            [PartHeader { name: String::new(), channels, size: [1, 1] }]
        };
        let only = choose(&file(&["Sky.Light"]), None).unwrap();
        assert_eq!((only.channels, only.alpha), (ColorChannels::Rgb([0, 1, 2]), Some(3)));
        let combined = choose(&file(&["View.Albedo", "View.Combined"]), None).unwrap();
        assert_eq!((combined.channels, combined.alpha), (ColorChannels::Rgb([4, 5, 6]), Some(7)));
        for names in [["left", "right"], ["View.Combined", "View.001.Combined"]] {
            let error = choose(&file(&names), None).unwrap_err();
            assert!(error.ends_with(&format!("none of which is plain R G B: {}", names.join(", "))), "{error}");
            assert_eq!(choose(&file(&names), Some(names[1])).unwrap().name, names[1]);
        }
        // Pages of one picture
        let rgb = ["R", "G", "B"];
        assert_eq!(choose(&[part("", &rgb), part("", &rgb)], None).unwrap().part, 0);
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
