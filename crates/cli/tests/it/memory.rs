//! Scenes that exceed `--memory-limit`.

use lumiris::imaging::oiio::{Part, write_image};
use std::path::Path;
use std::process::{Command, Output};

fn lumiris(args: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lumiris")).args(args).current_dir(folder).output().unwrap()
}

const HEAD: &str = "Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 16\n\
    Camera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\n";

#[test]
fn a_scene_that_does_not_fit_is_refused_before_its_meshes_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    // Zeros that take no space on the disk: `count` vertices and triangles
    let write_mesh = |name: &str, count: u64| {
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\nproperty float y\n\
             property float z\nelement face {count}\nproperty list uchar int vertex_indices\nend_header\n"
        );
        write(name, &header);
        let file = std::fs::File::options().write(true).open(folder.path().join(name)).unwrap();
        file.set_len(header.len() as u64 + count * (12 + 13)).unwrap();
    };
    write_mesh("large.ply", 10_000_000);
    write_mesh("larger.ply", 20_000_000);
    write_mesh("small.ply", 10);
    let mesh = |name: &str| format!("Shape \"plymesh\" \"string filename\" \"{name}.ply\"\n");
    write("scene.pbrt", &format!("{HEAD}{}{}", mesh("large"), mesh("larger")));

    let output = lumiris(&["render", "scene.pbrt", "--memory-limit", "3GB", "-o", "a.exr"], folder.path());
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("more than the 3.0 GiB that --memory-limit allows"), "{text}");
    let position = |name: &str| text.find(name).unwrap_or_else(|| panic!("{name}: {text}"));
    assert!(position("larger.ply") < position("large.ply"), "{text}");
    assert!(text.contains("building the largest acceleration structure"), "{text}");

    // Each frame of an animation
    write("a0001.pbrt", &format!("{HEAD}{}", mesh("small")));
    write("a0002.pbrt", &format!("{HEAD}{}", mesh("larger")));
    let frames = ["render", "a####.pbrt", "--frames", "1-2", "--spp", "1", "--memory-limit", "2GB", "-o", "a####.exr"];
    let output = lumiris(&frames, folder.path());
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("larger.ply"), "{text}");
    assert!(folder.path().join("a0001.exr").exists() && !folder.path().join("a0002.exr").exists());
}

#[test]
fn a_volume_that_does_not_fit_is_refused_before_it_is_read() {
    // The header of a grid of floats, and leaves that take no space on the disk
    const SIZE: u64 = 2 << 30;
    let mut header = vec![0; 672 + 64];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, b"NanoVDB1");
    put(16, &(32_u32 << 21).to_le_bytes());
    put(32, &SIZE.to_le_bytes());
    put(40, b"density");
    put(636, &1_u32.to_le_bytes());
    put(672 + 32, &((SIZE / 2144) as u32).to_le_bytes());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v.nvdb");
    std::fs::write(&path, &header).unwrap();
    std::fs::File::options().write(true).open(&path).unwrap().set_len(SIZE).unwrap();

    let text = "MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" \"v.nvdb\"\nShape \"sphere\"\n";
    std::fs::write(folder.path().join("scene.pbrt"), format!("{HEAD}{text}")).unwrap();
    let output = lumiris(&["render", "scene.pbrt", "--memory-limit", "3GB", "-o", "a.exr"], folder.path());
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && text.contains("v.nvdb") && text.contains("while they are read"), "{text}");
}

#[test]
fn textures_are_stored_in_tiles_if_the_scene_fits_only_so() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["R", "G", "B"].map(str::to_owned).to_vec();
    let size = 4096;
    let texels: Vec<f32> = (0..size * size * 3).map(|i| if i / 300 % 2 == 0 { 0.25 } else { 0.75 }).collect();
    write_image(&folder.path().join("t.png"), &[Part::display(size, size, names, texels)]).unwrap();

    // Eight pyramids of the same file, 67 MB each
    let mut text = HEAD.to_owned();
    for (i, (wrap, filter)) in ["repeat", "black", "clamp", "octahedralsphere"]
        .iter()
        .flat_map(|wrap| ["bilinear", "trilinear"].map(|filter| (wrap, filter)))
        .enumerate()
    {
        text += &format!(
            "Texture \"t{i}\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\" \"string wrap\" \"{wrap}\" \
             \"string filter\" \"{filter}\"\nMaterial \"diffuse\" \"texture reflectance\" \"t{i}\"\n\
             Shape \"bilinearmesh\" \"point3 P\" [ -9 -9 {z}  9 -9 {z}  -9 9 {z}  9 9 {z} ]\n",
            z = i + 2
        );
    }
    std::fs::write(folder.path().join("scene.pbrt"), text).unwrap();
    let tiles = |limit: &[&str]| {
        let render = ["render", "scene.pbrt", "--spp", "1", "-q", "--stats", "s.json", "-o", "a.exr"];
        let output = lumiris(&[&render[..], limit].concat(), folder.path());
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && !text.contains("loading the scene took"), "{text}");
        let stats = std::fs::read_to_string(folder.path().join("s.json")).unwrap();
        serde_json::from_str::<serde_json::Value>(&stats).unwrap()["memory"]["texture_tiles"].clone()
    };
    assert!(tiles(&["--memory-limit", "4GB"]).is_null());
    assert!(tiles(&["--memory-limit", "500MB"])["stored_bytes"].as_u64().unwrap_or(0) > 67 << 20);
}
