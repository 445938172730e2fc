//! Truncated and bit-flipped versions of the project's own scenes: a result or a message, never a panic.

use lumiris::import::{LoadOptions, load};
use lumiris_test_support::power::by_power;
use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// The number of mutated inputs.
fn mutations() -> usize {
    by_power(10_000, 2_000)
}
/// Scenes that take longest to read (`docs/measurements/build.md`): only every [`SLOW_TURNS`]th round includes them.
const SLOW: [&str; 8] =
    ["relief.pbrt", "lens.pbrt", "gallery.pbrt", "fog.pbrt", "room.pbrt", "checkers.pbrt", "fire.pbrt", "window.pbrt"];
const SLOW_TURNS: usize = 8;

fn scene_files(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            scene_files(&path, out);
        } else if path.extension().is_some_and(|e| e == "pbrt" || e == "ply" || e == "gz") {
            out.push(path);
        }
    }
    out.sort();
}

/// A random number below `n`, or 0 if `n` is 0.
fn below(random: &mut Pcg32, n: usize) -> usize {
    random.random_range(0..n.max(1))
}

/// Truncates, flips bits, removes, repeats or swaps pieces.
fn mutate(bytes: &mut Vec<u8>, random: &mut Pcg32) {
    match below(random, 5) {
        0 => bytes.truncate(below(random, bytes.len())),
        1 => {
            for _ in 0..=below(random, 8) {
                let i = below(random, bytes.len());
                if let Some(b) = bytes.get_mut(i) {
                    *b ^= 1 << below(random, 8);
                }
            }
        }
        2 => {
            let (a, n) = (below(random, bytes.len()), below(random, 40));
            let end = (a + n).min(bytes.len());
            bytes.drain(a..end);
        }
        3 => {
            let (a, n, at) = (below(random, bytes.len()), below(random, 40), below(random, bytes.len()));
            let piece = bytes[a..(a + n).min(bytes.len())].to_vec();
            bytes.splice(at..at, piece);
        }
        _ => {
            // A digit is replaced by another number: sizes, counts and indices
            let digits: Vec<usize> = (0..bytes.len()).filter(|&i| bytes[i].is_ascii_digit()).collect();
            if !digits.is_empty() {
                let texts: [&[u8]; 6] = [b"-1", b"99999999999", b"1e38", b"nan", b"0", b"2147483647"];
                let at = digits[below(random, digits.len())];
                bytes.splice(at..=at, texts[below(random, texts.len())].iter().copied());
            }
        }
    }
}

#[test]
fn mutated_scenes_never_panic_and_always_say_what_is_wrong() {
    let mut files = Vec::new();
    scene_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes"), &mut files);
    scene_files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pbrt"), &mut files);
    assert!(files.len() >= 20);
    assert!(SLOW.iter().all(|name| files.iter().any(|file| file.ends_with(name))), "they are there");
    let folder = tempfile::tempdir().unwrap();
    let mut random = pcg32([1, 0, 0]);
    let (mut accepted, mut refused) = (0, 0);
    let turns = (0..).flat_map(|round| files.iter().map(move |source| (round, source)));
    let is_turn =
        |(round, source): &(usize, &PathBuf)| round % SLOW_TURNS == 0 || !SLOW.iter().any(|s| source.ends_with(s));
    for (i, (_, source)) in turns.filter(is_turn).take(mutations()).enumerate() {
        let mut bytes = std::fs::read(source).unwrap();
        mutate(&mut bytes, &mut random);
        let path = folder.path().join(source.file_name().unwrap());
        std::fs::write(&path, &bytes).unwrap();
        let outcome = catch_unwind(AssertUnwindSafe(|| load(&path, &LoadOptions::default())));
        match outcome {
            Ok(Ok(_)) => accepted += 1,
            Ok(Err(diagnostics)) => {
                refused += 1;
                assert!(diagnostics.to_string().contains("error"), "{}: a refusal without a message", source.display());
            }
            Err(_) => {
                let kept = std::env::temp_dir().join(format!("lumiris-mutation-{i}.pbrt"));
                std::fs::write(&kept, &bytes).unwrap();
                panic!("mutation {i} of {} panicked; kept as {}", source.display(), kept.display());
            }
        }
    }
    // Both outcomes are frequent: the mutations are neither harmless nor all fatal
    assert!(accepted > mutations() / 20 && refused > mutations() / 20, "{accepted} accepted, {refused} refused");
}
