//! Light groups: sets of lights with their own layer in the image. `integrators/light_layers.rs` adds the samples of a
//! layer, and `film/light_layers.rs` packs its sums.

use super::light_sample::LightId;
use std::collections::HashMap;
use std::sync::Arc;

/// Name of the layer for lights without a group, if other lights have groups.
pub const OTHERS: &str = "other";

/// The image layer of each light; empty if no light has a group.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightLayers {
    names: Vec<String>,
    /// The layer of each light; empty without layers.
    of_light: Vec<u32>,
}

impl LightLayers {
    /// Assigns layers; `groups` holds the group of each light.
    pub fn new(groups: &[Option<Arc<str>>]) -> Self {
        let mut layers = LightLayers::default();
        if groups.iter().all(Option::is_none) {
            return layers;
        }
        let mut indices: HashMap<&str, u32> = HashMap::new();
        for group in groups {
            let name = group.as_deref().unwrap_or(OTHERS);
            let index = *indices.entry(name).or_insert_with(|| {
                layers.names.push(name.to_owned());
                (layers.names.len() - 1) as u32
            });
            layers.of_light.push(index);
        }
        layers
    }

    /// Names of the layers, in the order of their first lights.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The layer of a light. Layers must exist.
    #[inline]
    pub fn of(&self, light: LightId) -> u32 {
        self.of_light[light as usize]
    }
}

/// The reason why a text is not a valid group name, or `None` if it is valid. The name becomes a part of channel names.
pub fn fault_of_name(name: &str) -> Option<String> {
    let is_allowed = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-');
    match name.chars().find(|&c| !is_allowed(c)) {
        _ if name == OTHERS => Some(format!("the light group `{OTHERS}` is reserved for lights without a group")),
        _ if name.is_empty() => Some("the name of a light group is empty".to_owned()),
        Some(c) => Some(format!("the name of a light group has letters, digits, `_` and `-`, and no `{c}`")),
        None => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_without_a_group_are_together_where_others_have_one() {
        let [key, rim]: [Option<Arc<str>>; 2] = ["key", "rim"].map(|name| Some(name.into()));
        let layers = LightLayers::new(&[None, key.clone(), rim, key, None]);
        assert_eq!(layers.names(), ["other", "key", "rim"]);
        assert_eq!([0, 1, 2, 3, 4].map(|light| layers.of(light)), [0, 1, 2, 1, 0]);
        assert_eq!(LightLayers::new(&[None, None]), LightLayers::default());
    }

    #[test]
    fn names_are_parts_of_names_of_channels() {
        assert_eq!(fault_of_name("Key_2-ü"), None);
        for name in ["", "a.b", "a b", "a,b", "other"] {
            assert!(fault_of_name(name).is_some(), "{name}");
        }
    }
}
