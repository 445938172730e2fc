//! `--noise`: adaptive sample counts from the command line.

use super::parts::command;
use super::program::stderr;
use lumiris::imaging::oiio::{ReadLimits, read_image};

#[test]
fn noise_needs_settings_that_allow_it() {
    let folder = tempfile::tempdir().unwrap();
    let output = command("render GALLERY --noise 0.1 --integrator photon-map -q", folder.path()).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("--noise needs"), "{}", stderr(&output));
}

#[test]
fn noise_is_reached_with_samples_where_they_are_needed() {
    let folder = tempfile::tempdir().unwrap();
    let image = |noise: &str, name: &str| {
        let size = "--resolution 64x48 --estimator mis --samples 2";
        let args = format!("render GALLERY --integrator direct --noise {noise} -q -o {name} {size}");
        let output = command(&args, folder.path()).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        read_image(&folder.path().join(name), &ReadLimits::default()).unwrap().image
    };
    let counts = |noise: &str, name: &str| {
        let image = image(noise, name);
        let channel = image.channels.iter().position(|c| c == "samples").unwrap();
        image.data.iter().skip(channel).step_by(image.channels.len()).copied().collect::<Vec<f32>>()
    };
    let [coarse, fine] = [counts("0.2", "a.exr"), counts("0.05", "b.exr")];
    let sum = |counts: &[f32]| counts.iter().sum::<f32>();
    assert!(sum(&fine) > 4.0 * sum(&coarse), "{} {}", sum(&fine), sum(&coarse));
    let (min, max) = fine.iter().fold((f32::INFINITY, 0.0_f32), |(a, b), &n| (a.min(n), b.max(n)));
    assert!(max > 1.5 * min, "{min} to {max}");
}
