//! Textures of one type by name, which may be used before their definition.

use lumiris_formats::diagnostic::Diagnostics;
use lumiris_formats::pbrt::directive::Name;
use lumiris_formats::source::Span;
use std::collections::HashMap;

/// Textures of one type by name.
#[derive(Debug)]
pub(super) struct TextureNames<I> {
    /// `float` or `spectrum`.
    kind: &'static str,
    /// Source position of each definition, and the texture once it is made.
    by_name: HashMap<String, (Span, Option<I>)>,
}

impl<I: Copy> TextureNames<I> {
    /// No names.
    pub(super) fn new(kind: &'static str) -> Self {
        TextureNames { kind, by_name: HashMap::new() }
    }

    /// Registers the definition of a name; returns false after an error.
    pub(super) fn define(&mut self, name: &Name, d: &mut Diagnostics) -> bool {
        if let Some((first, _)) = self.by_name.get(&name.text) {
            let message = format!("{} texture `{}` is defined twice", self.kind, name.text);
            d.error(name.span, message).label(*first, "first defined here");
            return false;
        }
        self.by_name.insert(name.text.clone(), (name.span, None));
        true
    }

    /// Sets the texture of a name.
    pub(super) fn set(&mut self, name: &Name, texture: I) {
        self.by_name.insert(name.text.clone(), (name.span, Some(texture)));
    }

    /// The texture of a name; reports an error if it is not made yet. `other` are the names of the other type.
    pub(super) fn find<J>(&self, name: &str, span: Span, other: &TextureNames<J>, d: &mut Diagnostics) -> Option<I> {
        let kind = self.kind;
        match self.by_name.get(name) {
            Some((_, Some(texture))) => return Some(*texture),
            Some((defined, None)) => {
                // Textures are made in a fixed order
                let message = format!("{kind} texture `{name}` is not made before the one that uses it");
                d.error(span, message)
                    .label(*defined, "defined here")
                    .help("textures of images are made first, then the others in their order, spectra after floats");
            }
            None => {
                let known = self.by_name.keys().map(String::as_str);
                let diagnostic = d.unknown(span, &format!("{kind} texture"), name, known);
                if other.by_name.contains_key(name) {
                    diagnostic.help(format!("a {} texture of this name exists", other.kind));
                }
            }
        }
        None
    }
}
