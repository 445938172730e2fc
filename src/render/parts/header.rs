//! Header of a file of sums: scene, settings, samples and pixels.

use crate::direct::Estimator;
use crate::film::PixelBounds;
use crate::film::replicas::ReplicaChoice;
use crate::imaging::TextEntries;
use crate::render::render_settings::RenderSettings;
use crate::render::tile_share::TileShare;
use crate::render::tiles::replica_choice;
use crate::scene::RenderJob;
use std::ops::Range;
use std::str::FromStr;

/// The header of a file of sums.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmHeader {
    /// Size of the full image.
    pub resolution: [u32; 2],
    /// The crop window.
    pub bounds: PixelBounds,
    /// Range of sample indices of each pixel.
    pub samples: Range<u32>,
    /// Samples per pixel of the whole image.
    pub spp: u32,
    /// The share of the pixels; all if `None`.
    pub share: Option<TileShare>,
    /// True if all pixels have all samples of the range.
    pub is_finished: bool,
    /// Selection of the pixels that are estimated twice, if any.
    pub replicas: Option<ReplicaChoice>,
    /// Number of control variates with stored sums.
    pub controls: u32,
    /// Names of the light-group layers.
    pub light_layers: Vec<String>,
    /// Hash of the scene files.
    pub fingerprint: u64,
    /// Settings that the image depends on. They are equal in all parts of an image.
    pub settings: TextEntries,
    /// Notes, which may differ between parts.
    pub notes: TextEntries,
}

impl FilmHeader {
    /// The header of the sums of a rendering with `spp` samples per pixel.
    pub fn new(
        job: &RenderJob,
        render: &RenderSettings,
        spp: u32,
        fingerprint: u64,
        [settings, notes]: [TextEntries; 2],
    ) -> Self {
        // Samples and pixels come from the job; settings and notes are given
        let film = &job.world.scene.film;
        let estimator = Estimator::at_vertex(&job.settings().integrator, 0);
        let end = render.first_sample + render.spp;
        FilmHeader {
            resolution: film.resolution,
            bounds: film.bounds,
            samples: (render.first_sample + render.skip).min(end)..end,
            spp,
            share: render.share,
            is_finished: false,
            replicas: replica_choice(job, render),
            controls: if estimator.is_over_pixels() { job.controls() as u32 } else { 0 },
            light_layers: render.light_layers(job).to_vec(),
            fingerprint,
            settings,
            notes,
        }
    }

    /// The note with this name.
    pub fn note(&self, name: &str) -> Option<&str> {
        self.notes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// The setting with this name.
    pub fn setting(&self, name: &str) -> Option<&str> {
        self.settings.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// Differences that prevent this part and `other` from being parts of one image, one line each: the value of
    /// `other`, then the value of this part.
    pub fn differences(&self, other: &FilmHeader) -> Vec<String> {
        let mut lines = self.differences_of_rendering(other);
        if (self.replicas.is_some(), self.controls) != (other.replicas.is_some(), other.controls) {
            lines.push("one of them holds the sums for a variance layer, the other does not".to_owned());
        }
        if self.light_layers != other.light_layers {
            let [here, there] = [other, self].map(|header| header.light_layers.join(", "));
            lines.push(format!("light groups: {here}; not {there}"));
        }
        lines
    }

    /// Like [`Self::differences`], but the kinds of sums may differ.
    pub fn differences_of_rendering(&self, other: &FilmHeader) -> Vec<String> {
        let mut lines = self.differences_of_settings(other);
        if self.spp != other.spp {
            lines.push(format!("samples per pixel: {}, not {}", other.spp, self.spp));
        }
        lines
    }

    /// Like [`Self::differences_of_rendering`], but sample counts may differ.
    pub fn differences_of_settings(&self, other: &FilmHeader) -> Vec<String> {
        let mut lines = Vec::new();
        for (key, value) in &self.settings {
            match other.setting(key) {
                Some(theirs) if theirs == value => {}
                Some(theirs) => lines.push(format!("{}: {theirs}, not {value}", short(key))),
                None => lines.push(format!("{}: none, not {value}", short(key))),
            }
        }
        let added = other.settings.iter().filter(|(key, _)| self.setting(key).is_none());
        lines.extend(added.map(|(key, value)| format!("{}: {value}, which was not set", short(key))));
        if lines.is_empty() && (self.resolution, self.bounds) != (other.resolution, other.bounds) {
            lines.push("the size of the image".to_owned());
        }
        if self.fingerprint != other.fingerprint {
            lines.push("the scene: its files are not the same".to_owned());
        }
        lines
    }

    /// The header as text, one line per entry.
    pub(super) fn text(&self) -> String {
        // Fields
        let b = &self.bounds;
        let share = self.share.map_or_else(|| "all".to_owned(), |s| format!("{}/{}", s.index, s.count));
        let own = [
            ("resolution", format!("{} {}", self.resolution[0], self.resolution[1])),
            ("bounds", format!("{} {} {} {}", b.x0, b.x1, b.y0, b.y1)),
            ("samples", format!("{} {}", self.samples.start, self.samples.end)),
            ("spp", self.spp.to_string()),
            ("share", share),
            ("finished", self.is_finished.to_string()),
            ("replicas", self.replicas.map_or_else(|| "none".to_owned(), |r| format!("{} {}", r.edge, r.seed))),
            ("controls", self.controls.to_string()),
            ("light_layers", self.light_layers.join(",")),
            ("fingerprint", format!("{:016x}", self.fingerprint)),
        ];
        // Settings and notes
        let mut text: String = own.iter().map(|(key, value)| line("", key, value)).collect();
        text.extend(self.settings.iter().map(|(key, value)| line("setting ", key, value)));
        text.extend(self.notes.iter().map(|(key, value)| line("note ", key, value)));
        text
    }

    /// Parses a header; `None` if an entry is missing or invalid.
    pub(super) fn parse(text: &str) -> Option<Self> {
        // Split lines into entries
        let entries: Vec<(&str, String)> =
            text.lines().map(|l| l.split_once('=').map(|(k, v)| (k, unescaped(v)))).collect::<Option<_>>()?;
        let own = |name: &str| entries.iter().find(|(key, _)| *key == name).map(|(_, value)| value.as_str());

        // Size, samples and share
        let [w, h] = numbers(own("resolution")?)?;
        let [x0, x1, y0, y1] = numbers(own("bounds")?)?;
        let [start, end] = numbers(own("samples")?)?;
        let share = match own("share")? {
            "all" => None,
            text => {
                let [index, count] = numbers(&text.replace('/', " "))?;
                Some(Some(TileShare { index, count }).filter(|share| index < share.count)?)
            }
        };

        // Replicas
        let replicas = match own("replicas")? {
            "none" => None,
            text => {
                let [edge, seed] = numbers(text)?;
                Some(Some(ReplicaChoice { edge, seed }).filter(|choice| choice.edge > 0)?)
            }
        };

        // Settings and notes
        let is_inside = x0 < x1 && x1 <= w && y0 < y1 && y1 <= h && w.max(h) <= 1 << 16;
        let named = |prefix: &str| {
            let of_kind = entries.iter().filter_map(|(key, value)| Some((key.strip_prefix(prefix)?, value)));
            of_kind.map(|(key, value)| (key.to_owned(), value.clone())).collect()
        };

        // Check the ranges
        (is_inside && start <= end).then_some(FilmHeader {
            resolution: [w, h],
            bounds: PixelBounds { x0, x1, y0, y1 },
            samples: start..end,
            spp: own("spp")?.parse().ok()?,
            share,
            is_finished: own("finished")?.parse().ok()?,
            replicas,
            controls: own("controls")?.parse().ok().filter(|n| *n <= 1 << 16)?,
            light_layers: own("light_layers")?.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect(),
            fingerprint: u64::from_str_radix(own("fingerprint")?, 16).ok()?,
            settings: named("setting "),
            notes: named("note "),
        })
    }
}

/// A name without the metadata prefix.
fn short(key: &str) -> &str {
    key.strip_prefix("lumiris:").unwrap_or(key)
}

fn line(kind: &str, key: &str, value: &str) -> String {
    let escaped = value.replace('\\', "\\\\").replace('\n', "\\n").replace('\r', "\\r");
    format!("{kind}{key}={escaped}\n")
}

fn unescaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut characters = text.chars();
    while let Some(c) = characters.next() {
        match c {
            '\\' => match characters.next() {
                Some('n') => out.push('\n'),
                Some('r') => out.push('\r'),
                Some(other) => out.push(other),
                None => {}
            },
            other => out.push(other),
        }
    }
    out
}

/// N values between separators.
pub(super) fn list<T: FromStr, const N: usize>(text: &str, separator: char) -> Option<[T; N]> {
    let values: Vec<T> = text.split(separator).map(|v| v.parse().ok()).collect::<Option<_>>()?;
    values.try_into().ok()
}

/// N numbers between spaces.
fn numbers<const N: usize>(text: &str) -> Option<[u32; N]> {
    list(text, ' ')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> FilmHeader {
        FilmHeader {
            resolution: [64, 48],
            bounds: PixelBounds { x0: 3, x1: 64, y0: 0, y1: 40 },
            samples: 8..16,
            spp: 32,
            share: Some(TileShare { index: 2, count: 5 }),
            is_finished: true,
            replicas: Some(ReplicaChoice { edge: 16, seed: u32::MAX }),
            controls: 7,
            light_layers: vec!["key".to_owned(), "other".to_owned()],
            fingerprint: 0xfedc_ba98_7654_3210,
            settings: vec![
                ("lumiris:seed".to_owned(), "3".to_owned()),
                ("lumiris:filter".to_owned(), "a = b".to_owned()),
            ],
            notes: vec![("scene".to_owned(), "back\\slash\nand \\n".to_owned())],
        }
    }

    #[test]
    fn what_is_written_is_read() {
        assert_eq!(FilmHeader::parse(&header().text()), Some(header()));
        let whole = FilmHeader { share: None, ..header() };
        assert_eq!(FilmHeader::parse(&whole.text()), Some(whole));
    }

    #[test]
    fn headers_that_mean_nothing_are_refused() {
        let text = header().text();
        for (from, to) in
            [("64 48", "64"), ("3 64 0 40", "3 65 0 40"), ("2/5", "5/5"), ("8 16", "17 16"), ("spp=", "x=")]
        {
            assert!(text.contains(from));
            assert_eq!(FilmHeader::parse(&text.replace(from, to)), None, "{to}");
        }
        assert_eq!(FilmHeader::parse(""), None);
    }

    #[test]
    fn differences_are_named() {
        assert!(header().differences(&header()).is_empty());
        let mut other = header();
        (other.fingerprint, other.spp, other.settings[0].1) = (1, 64, "4".to_owned());
        other.settings.push(("lumiris:aperture".to_owned(), "2".to_owned()));
        let lines = header().differences(&other).join("; ");
        for part in ["seed: 4, not 3", "aperture: 2, which was not set", "the scene", "samples per pixel: 64, not 32"] {
            assert!(lines.contains(part), "{part} in {lines}");
        }
        assert!(!header().differences_of_settings(&other).join("").contains("samples per pixel"));
    }
}
