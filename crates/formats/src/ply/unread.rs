//! Colours and textures of a file that are not supported.

use super::header::{Element, Header};
use super::{faces, vertices};

/// Parts of names that indicate colours and textures.
const PARTS: [&str; 9] = ["tex", "color", "colour", "red", "green", "blue", "alpha", "uv", "material"];
/// Whole names of that kind.
const NAMES: [&str; 12] = ["r", "g", "b", "a", "rgb", "rgba", "u", "v", "s", "t", "tu", "tv"];

fn tells_of_appearance(name: &str) -> bool {
    let name = name.to_ascii_lowercase().replace("vertex", "");
    PARTS.iter().any(|part| name.contains(part))
}

/// A warning that names them; `None` without any.
pub(super) fn warning(header: &Header) -> Option<String> {
    let of_element = |element: &Element| {
        let is_read = |name: &str| match element.name.as_str() {
            "vertex" => vertices::reads(element, name),
            "face" => faces::READ.contains(&name),
            _ => false,
        };
        let is_short = |name: &str| {
            let is_of_mesh = matches!(element.name.as_str(), "vertex" | "face" | "tristrips");
            is_of_mesh && NAMES.iter().any(|short| short.eq_ignore_ascii_case(name))
        };
        let names = element.properties.iter().map(|property| property.name.as_str());
        let unread = names.filter(|name| (tells_of_appearance(name) || is_short(name)) && !is_read(name));
        let unread: Vec<String> = unread.map(|name| format!("`{name}`")).collect();
        match unread[..] {
            [] => tells_of_appearance(&element.name).then(|| format!("`{}`", element.name)),
            _ => Some(format!("{} of `{}`", unread.join(", "), element.name)),
        }
    };
    let unread: Vec<String> =
        header.elements.iter().filter(|element| element.count > 0).filter_map(of_element).collect();
    let unread = unread.join("; ");
    (!unread.is_empty()).then(|| format!("colours and textures are those of the material; not read: {unread}"))
}
