//! The program from outside: images, statistics, and its messages about bad input.

use lumiris::imaging::oiio::{Part, ReadLimits, read_image, write_image};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn lumiris(args: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lumiris")).args(args).current_dir(folder).output().unwrap()
}

fn scene(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name).display().to_string()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs the program with a text as its standard input.
fn lumiris_reading(text: &str, args: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lumiris"));
    command.args(args).current_dir(folder).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // A program that ends early closes its end of the pipe
    let _ = child.stdin.take().unwrap().write_all(text.as_bytes());
    child.wait_with_output().unwrap()
}

/// All CPU time of the process is attributed to phases. `passes`, the remainder of rendering, is a small part even for
/// an image with few samples.
fn assert_phases(seconds: &serde_json::Value) {
    let names = "start load build prepare camera_samples camera_rays bounce_rays shade t1_propose select_resolve t2_trace paths film \
                 noise passes libraries output";
    let of = |name: &str| seconds[name].as_f64().unwrap_or_else(|| panic!("{name} is missing"));
    let (sum, all) = (names.split(' ').map(of).sum::<f64>(), of("all"));
    assert!(sum > 0.98 * all && sum < 1.001 * all, "{sum} of {all}: {seconds}");
    assert_eq!(seconds.as_object().unwrap().len(), names.split(' ').count() + 1, "{seconds}");
    assert!(["camera_rays", "shade", "t1_propose", "film"].iter().all(|name| of(name) > 0.0), "{seconds}");
    assert!(of("passes") < 0.5 * all, "{seconds}");
}

#[test]
fn scenes_are_read_from_the_standard_input() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.pbrt"), "Shape \"sphere\"\n").unwrap();
    let head = "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\nWorldBegin\n";
    let text = format!("{head}LightSource \"infinite\" # \u{e9}\nInclude \"part.pbrt\"\n");
    let output = lumiris_reading(&text, &["render", "-", "--spp", "1", "-o", "a.exr", "-q"], folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(read_image(&folder.path().join("a.exr"), &ReadLimits::default()).is_ok());

    let output = lumiris_reading("WorldBegin\nShape \"spere\"\n", &["info", "-"], folder.path());
    let text = stderr(&output);
    assert!(text.contains("<stdin>:2:7") && text.contains("<stdin> could not be loaded"), "{text}");
}

#[test]
fn render_writes_every_image_and_the_statistics() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene("demo/gallery.pbrt");
    let args = [
        "render",
        &path,
        "--spp",
        "2",
        "--resolution",
        "64x36",
        "-o",
        "a.exr",
        "-o",
        "a.png",
        "--path-reuse",
        "1",
        "--stats",
        "a.json",
        "-q",
    ];
    let output = lumiris(&args, folder.path());
    assert!(output.status.success(), "{}", stderr(&output));

    let exr = read_image(&folder.path().join("a.exr"), &ReadLimits::default()).unwrap();
    assert_eq!((exr.image.width, exr.image.height), (64, 36));
    for name in ["R", "albedo.G", "normal.Z", "depth.Z", "material", "object", "samples", "variance.B"] {
        assert!(exr.image.channels.iter().any(|c| c == name), "{name} in {:?}", exr.image.channels);
    }
    assert_eq!(exr.metadata.get("lumiris:estimator").map(String::as_str), Some("mis"));
    assert!(read_image(&folder.path().join("a.png"), &ReadLimits::default()).is_ok());

    let stats: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("a.json")).unwrap()).unwrap();
    // All pixels of a small image are rendered twice, for the variances
    let replicas = stats["counts"]["replica_pixels"].as_u64().unwrap();
    assert_eq!(replicas, 64 * 36);
    assert_eq!(stats["counts"]["camera_rays"], (64 * 36 + replicas) * 2);
    assert_eq!(stats["complete"], true);
    assert_phases(&stats["cpu_seconds"]);
}

#[test]
fn images_without_aovs_have_the_same_pixels_and_no_other_channels() {
    // AOVs do not change the pixels
    let folder = tempfile::tempdir().unwrap();
    for integrator in ["path", "irradiance-cache", "photon-map"] {
        let image = |aovs: &[&str]| {
            let path = scene("demo/gallery.pbrt");
            let mut args = vec!["render", &path, "--spp", "2", "--resolution", "32x18", "-o", "a.exr", "-q"];
            args.extend(["--integrator", integrator, "--photons", "1000", "--gather", "4", "--cache-samples", "16"]);
            args.extend(aovs);
            let output = lumiris(&args, folder.path());
            assert!(output.status.success(), "{}", stderr(&output));
            read_image(&folder.path().join("a.exr"), &ReadLimits::default()).unwrap().image
        };
        let (all, none, depth) = (image(&[]), image(&["--aov", "none"]), image(&["--aov", "depth"]));
        assert_eq!(none.channels, ["R", "G", "B"]);
        let beauty = |data: &[f32], channels: usize| -> Vec<u32> {
            data.chunks_exact(channels).flat_map(|p| [p[0], p[1], p[2]].map(f32::to_bits)).collect()
        };
        assert_eq!(beauty(&none.data, 3), beauty(&all.data, all.channels.len()), "{integrator}");
        assert_eq!(depth.channels, ["R", "G", "B", "depth.Z"]);
        assert!(depth.data.chunks_exact(4).all(|p| p[3] > 0.0));
    }

    // `none` excludes other AOVs
    let path = scene("demo/gallery.pbrt");
    let output = lumiris(&["render", &path, "--aov", "none,depth", "-o", "b.exr"], folder.path());
    assert!(output.status.code() == Some(2) && stderr(&output).contains("--aov none"), "{}", stderr(&output));
}

#[test]
fn an_irradiance_cache_is_part_of_image_and_statistics() {
    // Layers and metadata of the image
    let folder = tempfile::tempdir().unwrap();
    let path = scene("demo/gallery.pbrt");
    let options = "--integrator irradiance-cache --cached all --cache-samples 32 --cache-error 0.3 --cache-radius 2,16 --spp 2 \
                   --resolution 48x27 -o a.exr --stats a.json";
    let args: Vec<&str> = ["render", &path].into_iter().chain(options.split_whitespace()).collect();
    let output = lumiris(&args, folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("irradiance cache: "), "{}", stderr(&output));

    let exr = read_image(&folder.path().join("a.exr"), &ReadLimits::default()).unwrap();
    assert!(exr.image.channels.iter().any(|c| c == "records"), "{:?}", exr.image.channels);
    for (key, value) in [("integrator", "irradiance-cache"), ("cached", "all"), ("cache_radius", "2,16")] {
        assert_eq!(exr.metadata.get(&format!("lumiris:{key}")).map(String::as_str), Some(value));
    }

    // Statistics
    let stats: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("a.json")).unwrap()).unwrap();
    let cache = &stats["irradiance_cache"];
    assert!(cache["records"].as_u64().unwrap() > 50 && cache["build_seconds"].as_f64().unwrap() > 0.0, "{cache}");
    assert!(cache["lookups"].as_u64().unwrap() >= cache["misses"].as_u64().unwrap(), "{cache}");

    // Values out of range
    for (option, value) in [("--cache-error", "1.5"), ("--cache-radius", "5,2"), ("--cached", "none")] {
        let output = lumiris(&["render", &path, option, value], folder.path());
        assert_eq!(output.status.code(), Some(2), "{option}: {}", stderr(&output));
    }
}

#[test]
fn numbers_of_proposals_are_the_same_in_every_run() {
    // Chosen by a measurement
    let folder = tempfile::tempdir().unwrap();
    let path = scene("demo/gallery.pbrt");
    let render = |name: &str, options: &[&str]| {
        let common =
            ["render", &path, "--integrator", "direct", "--spp", "2", "--resolution", "48x27", "-q", "-o", name];
        let output = lumiris(&[&common[..], &["--estimator", "ris"], options].concat(), folder.path());
        assert!(output.status.success(), "{}", stderr(&output));
        read_image(&folder.path().join(name), &ReadLimits::default()).unwrap()
    };
    let bits = |image: &lumiris::imaging::Image| image.data.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let chosen = render("chosen.exr", &["--proposals", "optimal"]);
    assert!(chosen.image.channels.iter().any(|c| c == "ratio.proposals"), "{:?}", chosen.image.channels);
    let again = render("again.exr", &["--proposals", "optimal", "--threads", "1"]);
    assert_eq!(bits(&chosen.image), bits(&again.image));

    // Chosen by the rule
    let auto = render("auto.exr", &[]);
    assert_eq!(auto.metadata["lumiris:proposals"], "12", "three for each of four samples");
    assert_eq!(bits(&auto.image), bits(&render("given.exr", &["--proposals", "12"]).image));
}

#[test]
fn info_counts_what_the_scene_holds() {
    let folder = tempfile::tempdir().unwrap();
    let output = lumiris(&["info", &scene("demo/gallery.pbrt"), "--json"], folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    let facts: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(facts["geometry"]["instances"], 8);
    let memory = |name: &str| facts["memory"][name].as_u64().unwrap();
    let predicted = |name: &str| facts["memory"]["predicted_with_all_layers"][name].as_u64().unwrap();
    // Libraries are not loaded yet, so the peak is still to come
    assert!(predicted("fixed_bytes") > 100 << 20 && memory("most_taken_bytes") >= memory("taken_bytes"));
    assert!(predicted("peak_bytes") > memory("most_taken_bytes") && predicted("peak_bytes") > predicted("bytes"));
    // A knot of 576 triangles, subdivided four times, and four walls and a lamp of two triangles each
    assert_eq!(facts["geometry"]["triangles"], 576 * 256 + 5 * 2);
}

#[test]
fn an_image_that_does_not_fit_is_refused_before_rendering_with_its_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let gallery = scene("demo/gallery.pbrt");
    let large = ["render", &gallery, "--resolution", "65536x65536", "--memory-limit", "24GB", "-o", "a.exr"];
    let limited = ["render", &gallery, "--resolution", "64x64", "--memory-limit", "10MB", "-o", "a.exr"];
    let start = std::time::Instant::now();
    for args in [&large[..], &limited[..]] {
        let output = lumiris(args, folder.path());
        assert!(!output.status.success());
        let message = stderr(&output);
        let number = message.split("bytes)").next().and_then(|text| text.rsplit('(').next()).unwrap_or_default();
        let bytes: u64 = number.trim().parse().unwrap_or_else(|_| panic!("no bytes: {message}"));
        // At least the radiance of every pixel
        let (least, limit) = if args[3] == "64x64" { (100_000_000, "10.0 MiB") } else { (44 << 32, "24.0 GiB") };
        assert!(bytes > least && message.contains(&format!("{limit} that --memory-limit allows")), "{message}");
        assert!(!folder.path().join("a.exr").exists());
    }
    assert!(start.elapsed().as_secs() < 60, "nothing of that size is rendered or allocated");
    let fits =
        ["render", &gallery, "--resolution", "64x36", "--spp", "1", "--memory-limit", "4GB", "-q", "-o", "a.exr"];
    assert!(lumiris(&fits, folder.path()).status.success());
}

#[test]
fn an_unknown_parameter_is_an_error_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bad.pbrt"), "WorldBegin\nShape \"sphere\" \"float radios\" [ 1 ]\n").unwrap();
    let output = lumiris(&["render", "bad.pbrt"], folder.path());
    assert_eq!(output.status.code(), Some(3));
    let text = stderr(&output);
    assert!(text.contains("bad.pbrt:2:16") && text.contains("radios") && text.contains("radius"), "{text}");
    assert!(!folder.path().join("bad.exr").exists());
}

#[test]
fn all_missing_files_are_named_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let text = "WorldBegin\nShape \"plymesh\" \"string filename\" \"one.ply\"\nTexture \"t\" \"spectrum\" \"imagemap\" \
                \"string filename\" \"two.png\"\nLightSource \"infinite\" \"string filename\" \"three.exr\"\n";
    std::fs::write(folder.path().join("missing.pbrt"), text).unwrap();
    let output = lumiris(&["render", "missing.pbrt"], folder.path());
    assert_eq!(output.status.code(), Some(3));
    let text = stderr(&output);
    for name in ["one.ply", "two.png", "three.exr"] {
        assert!(text.contains(name), "{text}");
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_rendering() {
    let folder = tempfile::tempdir().unwrap();
    for (name, code) in [("a.xyz", 2), ("nowhere/a.exr", 3)] {
        let output = lumiris(&["render", &scene("analytic/point.pbrt"), "-o", name], folder.path());
        assert_eq!(output.status.code(), Some(code), "{name}");
        assert!(stderr(&output).contains(name.split('/').next().unwrap()), "{}", stderr(&output));
    }
}

#[test]
fn options_out_of_range_are_usage_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene("analytic/point.pbrt");
    for args in [["--resolution", "0x5"], ["--crop", "0.5,0.2,0,1"], ["--spp", "0"], ["--estimator", "magic"]] {
        let output = lumiris(&["render", &path, args[0], args[1]], folder.path());
        assert_eq!(output.status.code(), Some(2), "{args:?}");
    }
}

#[test]
fn a_time_limit_ends_the_rendering_and_writes_it() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["render", &scene("demo/gallery.pbrt"), "--resolution", "64x36", "--spp", "1000000", "--time", "0.5"];
    let output = lumiris(&args, folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    assert!(stderr(&output).contains("stopped early"), "{}", stderr(&output));
    assert!(folder.path().join("gallery.exr").exists());
}

#[test]
fn a_time_alone_is_filled_with_samples_and_with_spp_both_are_limits() {
    let folder = tempfile::tempdir().unwrap();
    let gallery = scene("demo/gallery.pbrt");
    let samples = |more: &[&str]| {
        let args =
            [&["render", gallery.as_str(), "--resolution", "64x36", "-o", "a.exr", "--stats", "s.json"], more].concat();
        let output = lumiris(&args, folder.path());
        assert!(output.status.success(), "{}", stderr(&output));
        let stats = std::fs::read_to_string(folder.path().join("s.json")).unwrap();
        let stats: serde_json::Value = serde_json::from_str(&stats).unwrap();
        (stats["complete"].as_bool().unwrap(), stats["settings"].clone(), stderr(&output))
    };
    let (complete, settings, said) = samples(&["--time", "1"]);
    assert!(!complete && said.contains("stopped early"), "{said}");
    // They follow from the options, not from measured times
    assert_eq!(
        (&settings["lumiris:spp"], &settings["lumiris:pilot_spp"]),
        (&"1048576".into(), &"64".into()),
        "{settings}"
    );
    let (complete, settings, said) = samples(&["--time", "1000", "--spp", "2"]);
    assert!(complete && said.contains("2 samples per pixel"), "{said}");
    assert_eq!(settings["lumiris:spp"], "2");
}

#[test]
fn what_a_time_cut_short_goes_on_to_the_same_image() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let gallery = scene("demo/gallery.pbrt");
    // Passes over a tile take long enough for the time limit to interrupt one
    let common = ["render", &gallery, "--resolution", "192x108", "--spp", "64", "--estimator", "mis", "-q"];
    let run = |more: &[&str]| {
        let output = lumiris(&[&common[..], more].concat(), folder);
        assert!(output.status.success(), "{}", stderr(&output));
    };
    run(&["--time", "0.3", "--checkpoint", "a.film", "-o", "cut.exr"]);
    run(&["--resume", "a.film", "-o", "resumed.exr"]);
    run(&["-o", "whole.exr"]);
    let [resumed, whole] = ["resumed.exr", "whole.exr"].map(|name| crate::program::read(folder, name).image.data);
    assert!(resumed.iter().zip(&whole).all(|(a, b)| a.to_bits() == b.to_bits()));
}

#[test]
fn a_noise_is_a_number_or_a_percentage_and_said_to_be_reached_or_not() {
    let folder = tempfile::tempdir().unwrap();
    let gallery = scene("demo/gallery.pbrt");
    let said_at = |resolution: &str, more: &[&str]| {
        let args = [&["render", gallery.as_str(), "--resolution", resolution, "-o", "a.exr"], more].concat();
        let output = lumiris(&args, folder.path());
        assert!(output.status.success(), "{}", stderr(&output));
        stderr(&output).lines().find(|line| line.starts_with("target")).unwrap_or_default().to_owned()
    };
    let said = |more: &[&str]| said_at("64x36", more);
    let [number, percent] = ["0.2", "20%"].map(|noise| said(&["--noise", noise]));
    assert!(number.starts_with("target 20 % reached in") && number == percent, "{number} {percent}");
    let limited = said(&["--noise", "0.1%", "--spp", "8"]);
    assert!(limited.contains("hit the limit of --spp (8 samples per pixel)"), "{limited}");
    let late = said_at("160x90", &["--noise", "0.5%", "--time", "2"]);
    // Empty if a busy machine abandons the pilot, and with it the target
    assert!(late.contains("hit the limit of --time") || late.is_empty(), "{late}");
}

#[test]
fn crosscheck_of_a_small_scene_succeeds() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["crosscheck", &scene("analytic/furnace-box-3.pbrt"), "--rays", "20000", "--json", "c.json"];
    let output = lumiris(&args, folder.path());
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    let report: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("c.json")).unwrap()).unwrap();
    assert_eq!(report["rays"]["tallies"].as_array().unwrap().len(), 5);
}

#[test]
fn bench_reports_every_case_with_the_hits_of_both_loops() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene("analytic/rectangle.pbrt");
    let common = ["--resolution", "32x32", "--spp", "4", "--runs", "1", "--rays", "2048", "--json", "b.json"];
    let report = |subject: &[&str]| -> serde_json::Value {
        let args = [&["bench"], subject, &[path.as_str()], &common].concat();
        let output = lumiris(&args, folder.path());
        assert!(output.status.success(), "{}", stderr(&output));
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("b.json")).unwrap()).unwrap()
    };

    // All measurements, as by default
    let all = report(&[]);
    assert_eq!(all["camera_rays"], 2048);
    let names = |cases: &serde_json::Value| -> Vec<String> {
        cases.as_array().unwrap().iter().map(|c| format!("{} {}", c["name"].as_str().unwrap(), c["width"])).collect()
    };
    assert!(names(&all["intersect"])[0].starts_with("camera rays"), "{all}");
    assert!(names(&all["t2"]).len() >= 4, "{all}");
    for case in all["intersect"].as_array().unwrap().iter().chain(all["t2"].as_array().unwrap()) {
        assert_eq!(case["hits"], case["bare_hits"], "{case}");
        assert!(case["rays"].as_u64().unwrap() > 0 && case["ratio"].as_f64().unwrap() > 0.0, "{case}");
    }
    assert_eq!(all["intersect"][0]["rays"], 2048);
    assert!(all["t1"]["light_proposals"].as_u64().unwrap() > 0, "{all}");
    assert_eq!(all["stages"].as_array().unwrap().last().unwrap()["name"], "all");

    // Single measurements
    let t1 = report(&["t1"]);
    assert_eq!((names(&t1["intersect"]).len(), names(&t1["t2"]).len()), (0, 0));
    assert!(t1["t1"]["bsdf_nanoseconds"].is_number(), "{t1}");
    let intersect = report(&["intersect"]);
    assert!(intersect["t1"].is_null() && !names(&intersect["intersect"]).is_empty());
}

#[test]
fn efficiency_is_measured_against_references_that_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = scene("analytic/rectangle.pbrt");
    let args =
        [
            &["bench", "efficiency", path.as_str(), "--resolution", "32x32", "--spp", "4", "--reference-spp", "64"][..],
            &[
                "--references",
                "kept",
                "--case",
                "auto=",
                "--case",
                "mis=--estimator mis --samples 1",
                "--json",
                "e.json",
            ][..],
            &["--variant", "four=--samples 4"][..],
        ]
        .concat();
    let run = |more: &[&str]| -> (String, serde_json::Value) {
        let output = lumiris(&[&args[..], more].concat(), folder.path());
        assert!(output.status.success(), "{}", stderr(&output));
        let report = std::fs::read_to_string(folder.path().join("e.json")).unwrap();
        (stderr(&output), serde_json::from_str(&report).unwrap())
    };
    let kept = || -> Vec<_> {
        std::fs::read_dir(folder.path().join("kept")).unwrap().map(|entry| entry.unwrap().path()).collect()
    };
    let is_rendered = |said: &str| [1, 2].map(|index| said.contains(&format!(": reference {index}, 64 samples")));
    let (said, report) = run(&[]);
    assert_eq!((is_rendered(&said), kept().len()), ([true; 2], 2), "{said}");
    let rows = report[0]["rows"].as_array().unwrap();
    let names: Vec<_> = rows.iter().map(|row| row["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["auto", "mis", "mis, four"]);
    assert!(rows.iter().all(|row| row["relmse"]["error"].as_f64().unwrap() > 0.0), "{report}");

    // The screening pass skips `mis` with one sample, possibly of the BSDF: it is hundreds of times less efficient
    let (said, screened) = run(&["--screen-spp", "16", "--case", "mc=--estimator mc"]);
    let names = |key: &str| -> Vec<&str> {
        screened[0][key].as_array().unwrap().iter().map(|row| row["name"].as_str().unwrap()).collect()
    };
    let (kept_rows, left_out) = (names("rows"), names("left_out"));
    assert!(kept_rows.starts_with(&["auto", "mc"]) && left_out.contains(&"mis"), "{screened}");
    assert_eq!(kept_rows.len() + left_out.len(), 5, "{screened}");
    let has_seed = |name: &str, seed: u32| said.contains(&format!(": {name}, seed {seed}\n"));
    let looks = ["auto", "mis", "mc", "mis, four", "mc, four"].map(|name| has_seed(name, 2));
    assert_eq!((looks, has_seed("mis", 0)), ([false, true, true, true, true], false), "{said}");

    // Stored references give the same errors. With black ones, the error is the whole image
    let files = kept();
    let (said, again) = run(&[]);
    let error = |report: &serde_json::Value| report[0]["rows"][1]["mse"]["error"].as_f64().unwrap();
    assert_eq!((is_rendered(&said), error(&again)), ([false; 2], error(&report)), "{said}");
    let black =
        |edge: usize| Part::linear(edge, edge, ["R", "G", "B"].map(str::to_owned).to_vec(), vec![0.0; 3 * edge * edge]);
    files.iter().for_each(|path| write_image(path, &[black(32)]).unwrap());
    assert!(error(&run(&[]).1) > 2.0 * error(&report));

    // Other settings need other references; a reference of another size is an error
    for (i, other) in [&["--seed", "7"][..], &["--max-depth", "3"], &["--crop", "0,0.5,0,1"]].iter().enumerate() {
        assert_eq!((is_rendered(&run(other).0), kept().len()), ([true; 2], 4 + 2 * i), "{other:?}");
    }
    write_image(&files[0], &[black(8)]).unwrap();
    let output = lumiris(&args, folder.path());
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("8 × 8 pixels, but the image has 32 × 32"), "{}", stderr(&output));
}

/// As installed by `make install`.
#[test]
fn a_copy_of_the_executable_alone_reads_and_writes_images() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("lumiris");
    std::fs::copy(env!("CARGO_BIN_EXE_lumiris"), &program).unwrap();
    let run = |args: &[&str]| Command::new(&program).args(args).current_dir(folder.path()).output().unwrap();
    let small = ["--resolution", "8x6", "--spp", "1", "--estimator", "mis", "-q", "-o", "a.exr", "-o", "a.png"];
    let output = run(&[&["render", &scene("analytic/rectangle.pbrt")][..], &small[..]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    let output = run(&["compare", "a.exr", "--reference", "a.exr"]);
    assert!(output.status.success(), "{}", stderr(&output));
}

#[test]
fn ctrl_c_writes_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["render", &scene("analytic/rectangle.pbrt"), "--spp", "1000000000", "-q", "-o", "a.exr"];
    let mut child = Command::new(env!("CARGO_BIN_EXE_lumiris")).args(args).current_dir(folder.path()).spawn().unwrap();
    // Long enough to read the scene and finish the first pass, even on a busy machine
    std::thread::sleep(std::time::Duration::from_secs(4));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let exr = read_image(&folder.path().join("a.exr"), &ReadLimits::default()).unwrap();
    assert_eq!(exr.metadata.get("lumiris:complete").map(String::as_str), Some("false"));
    let samples = exr.image.channel("samples").unwrap();
    let channels = exr.image.channels.len();
    assert!(exr.image.data.iter().skip(samples).step_by(channels).all(|&n| n >= 1.0));
}

#[test]
fn ctrl_c_before_the_first_sample_leaves_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.exr"), "an image of yesterday").unwrap();
    // The pilot for such low noise takes longer than this test
    let args = ["render", &scene("demo/gallery.pbrt"), "--spp", "1000000", "--noise", "0.01%", "-q", "-o", "a.exr"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_lumiris"));
    let child = command.args(args).current_dir(folder.path()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    // By itself, or because the grace time was over
    let ends = ["stopped before the first sample: nothing is written", "stopped while "];
    assert!(ends.iter().any(|end| stderr(&output).contains(end)), "{}", stderr(&output));
    assert_eq!(std::fs::read(folder.path().join("a.exr")).unwrap(), b"an image of yesterday");
}

#[test]
fn generated_scenes_render_and_say_what_is_missing_before_they_are_generated() {
    let folder = tempfile::tempdir().unwrap();
    let output = lumiris(&["generate", "talbot", "-o", "t", "--detail", "40", "--resolution", "32"], folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    for name in ["statue-env", "statue-lights", "statue-env-lights"] {
        let scene = format!("t/{name}.pbrt");
        let args = ["render", &scene, "--spp", "1", "--resolution", "24x32", "-o", "a.exr", "-q"];
        let output = lumiris(&args, folder.path());
        assert!(output.status.success() && stderr(&output).is_empty(), "{}", stderr(&output));
        let image = read_image(&folder.path().join("a.exr"), &ReadLimits::default()).unwrap().image;
        let green = image.channel("G").unwrap();
        let sum: f32 = (0..24 * 32).map(|i| image.get(i % 24, i / 24, green)).sum();
        assert!(sum > 10.0, "{name} is dark: {sum}");
        // The generated scenes are the repository's
        let original = std::fs::read(self::scene(&format!("talbot/{name}.pbrt"))).unwrap();
        assert!(original == std::fs::read(folder.path().join(&scene)).unwrap());
    }

    std::fs::remove_file(folder.path().join("t/statue.ply")).unwrap();
    std::fs::remove_file(folder.path().join("t/sky.exr")).unwrap();
    let output = lumiris(&["render", "t/statue-env.pbrt"], folder.path());
    assert_eq!(output.status.code(), Some(3));
    let text = stderr(&output);
    assert!(text.contains("statue.ply") && text.contains("sky.exr"), "{text}");
}

#[test]
fn a_generated_statue_and_sky_are_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let output = lumiris(&["generate", "statue", "-o", "s.ply", "--detail", "32"], folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    let mesh = lumiris_formats::ply::read_ply(&folder.path().join("s.ply")).unwrap();
    assert!(mesh.warnings.is_empty() && mesh.triangles.len() > 3000 && mesh.normals.len() == mesh.positions.len());
    let count = stderr(&output);
    assert!(count.contains(&format!("{} triangles", mesh.triangles.len())), "{count}");

    let args = ["generate", "sky", "-o", "s.exr", "--resolution", "48", "--clouds", "0.3", "--azimuth", "-30"];
    let output = lumiris(&args, folder.path());
    assert!(output.status.success(), "{}", stderr(&output));
    let sky = read_image(&folder.path().join("s.exr"), &ReadLimits::default()).unwrap();
    assert_eq!((sky.image.width, sky.image.height, sky.image.channels.len()), (48, 48, 3));
}

#[test]
fn what_cannot_be_generated_is_an_error_that_says_why() {
    let folder = tempfile::tempdir().unwrap();
    for (args, words) in [
        (vec!["statue", "--detail", "3"], "8 to 4096"),
        (vec!["statue", "-o", "s.obj"], ".ply"),
        (vec!["statue", "-o", "no/s.ply", "--detail", "8"], "no/s.ply"),
        (vec!["sky", "--elevation", "-5"], "elevation"),
        (vec!["sky", "-o", "no/s.exr", "--resolution", "8"], "s.exr"),
    ] {
        let output = lumiris(&[&["generate"], &args[..]].concat(), folder.path());
        assert_eq!(output.status.code(), Some(3), "{args:?}");
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
