//! Frame numbers, and file names with a frame number.

use lumiris_numbers::math::hash::pcg4d;
use std::iter::StepBy;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Maximum number of frames per run.
const MAX_FRAMES: usize = 1_000_000;

/// Constant that is hashed with the seed and the frame number to give the frame's seed.
const FRAME_SEED: u32 = 0x66_72_61_6d;

/// The seed of a frame, given the seed of the sequence.
pub(super) fn seed_of_frame(seed: u32, number: u32) -> u32 {
    pcg4d([seed, number, FRAME_SEED, 0])[0]
}

/// Frame numbers in rendering order, without duplicates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FrameList(pub Vec<u32>);

impl FrameList {
    /// The numbers, separated by commas.
    pub(super) fn text(&self) -> String {
        self.0.iter().map(u32::to_string).collect::<Vec<_>>().join(",")
    }
}

/// Parses `1-48`, `1-48:2`, `5`, and lists of these separated by commas.
pub(super) fn parse_frames(text: &str) -> Result<FrameList, String> {
    let mut frames = Vec::new();
    let mut seen = std::collections::HashSet::new();
    for range in text.split(',') {
        let numbers = parse_range(range.trim())?;
        if numbers.size_hint().0 > MAX_FRAMES {
            return Err(format!("`{range}` is more than {MAX_FRAMES} frames"));
        }
        frames.extend(numbers.filter(|n| seen.insert(*n)));
    }
    Ok(FrameList(frames))
}

/// The numbers of a range.
fn parse_range(text: &str) -> Result<StepBy<RangeInclusive<u32>>, String> {
    // A number with its error message
    let number = |digits: &str| {
        let digits = digits.trim();
        digits
            .parse::<u32>()
            .map_err(|_| format!("`{digits}` is no frame: expected 5, 1-48, 1-48:2 or a list of these"))
    };

    // Split the range
    let (range, step) = match text.split_once(':') {
        Some((range, step)) => (range, number(step)?),
        None => (text, 1),
    };
    let (first, last) = match range.split_once('-') {
        Some((first, last)) => (number(first)?, number(last)?),
        None => (number(range)?, number(range)?),
    };
    if first > last || step == 0 {
        return Err(format!("`{text}` holds no frame"));
    }
    Ok((first..=last).step_by(step as usize))
}

/// True if the name contains `#`, the placeholder for the frame number.
pub(super) fn has_number(path: &Path) -> bool {
    path.to_string_lossy().contains('#')
}

/// Replaces each run of `#` by the frame number, zero-padded to the length of the run.
pub(super) fn numbered(path: &Path, frame: u32) -> PathBuf {
    let Some(text) = path.to_str() else { return path.to_owned() };
    let mut name = String::new();
    let mut rest = text;
    while let Some(start) = rest.find('#') {
        let width = rest[start..].bytes().take_while(|b| *b == b'#').count();
        name += &rest[..start];
        name += &format!("{frame:0width$}");
        rest = &rest[start + width..];
    }
    PathBuf::from(name + rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_frames_are_ranges_with_steps_each_frame_once() {
        let frames = |text| parse_frames(text).map(|list| list.0);
        assert_eq!(frames("7"), Ok(vec![7]));
        assert_eq!(frames("1-7:2"), Ok(vec![1, 3, 5, 7]));
        assert_eq!(frames("1-8:3"), Ok(vec![1, 4, 7]));
        assert_eq!(frames("5, 1-3,2-6:2"), Ok(vec![5, 1, 2, 3, 4, 6]));
        assert_eq!(frames("4294967295"), Ok(vec![u32::MAX]));
        for wrong in ["", "a", "3-1", "1-5:0", "1-", "-5", "1-2-3", "1:2:3", "0-4294967295", "5000000000", "1,,2"] {
            assert!(frames(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_run_of_hashes_becomes_the_number() {
        let name = |text: &str, frame| numbered(Path::new(text), frame).display().to_string();
        assert_eq!(name("a/shot.####.pbrt", 7), "a/shot.0007.pbrt");
        assert_eq!(name("f#/x.##.exr", 123), "f123/x.123.exr");
        assert_eq!(name("ä#", 3), "ä3");
        assert_eq!(name("still.pbrt", 3), "still.pbrt");
        assert!(has_number(Path::new("a.#.exr")) && !has_number(Path::new("a.exr")));
    }
}
