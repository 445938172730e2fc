//! `--texture-cache`, and textures by `lumiris maketx`.

use super::program::{command, folder_with, read, stderr};
use lumiris::imaging::oiio::{Part, write_image};
use std::path::{Path, PathBuf};

const SCENE: &str = "LookAt 0 0 2  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 50\n\
    Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 12\nSampler \"independent\" \"integer pixelsamples\" 1\n\
    WorldBegin\nLightSource \"infinite\"\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\"\n\
    Material \"diffuse\" \"texture reflectance\" \"t\"\n\
    Shape \"bilinearmesh\" \"point3 P\" [ -1 -1 0  1 -1 0  -1 1 0  1 1 0 ]\n";

fn write_texture(path: &Path) {
    let names = ["R", "G", "B"].map(str::to_owned).to_vec();
    let values = (0..200 * 150 * 3).map(|i| (i * 7 % 256) as f32 / 255.0).collect();
    write_image(path, &[Part::display(200, 150, names, values)]).unwrap();
}

/// Runs a command that succeeds, and returns its messages.
fn succeed(folder: &Path, args: &str) -> String {
    let output = command(folder, args).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{args}: {}", stderr(&output));
    stderr(&output)
}

fn tifs(folder: &Path) -> Vec<PathBuf> {
    let paths = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    paths.filter(|path| path.extension().is_some_and(|extension| extension == "tif")).collect()
}

#[test]
fn renders_with_a_folder_of_textures_have_the_same_bits_and_damage_is_reported() {
    let folder = folder_with(SCENE);
    let path = folder.path();
    write_texture(&path.join("t.png"));
    succeed(path, "render scene.pbrt -o a.exr");
    let expected = read(path, "a.exr").image;
    for damages in [false, false, true, false] {
        if damages {
            std::fs::write(&tifs(&path.join("cache"))[0], "damaged").unwrap();
        }
        let text = succeed(path, "render scene.pbrt --texture-cache cache -q -o b.exr");
        assert_eq!(text.contains("warning") && text.contains("t.png"), damages, "{text}");
        assert!(read(path, "b.exr").image == expected);
        assert_eq!(tifs(&path.join("cache")).len(), 1);
    }

    // A file is no folder
    let output = command(path, "render scene.pbrt --texture-cache t.png -o c.exr").output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(stderr(&output).contains("--texture-cache t.png"), "{}", stderr(&output));
}

#[test]
fn textures_by_maketx_give_the_bits_of_their_images() {
    let folder = folder_with(SCENE);
    let path = folder.path();
    write_texture(&path.join("t.png"));
    write_texture(&path.join("u.png"));
    succeed(path, "render scene.pbrt -o a.exr");
    succeed(path, "maketx t.png u.png");
    succeed(path, "maketx t.png u.png -o made/all");
    succeed(path, "maketx t.png -o other.tx");
    let made = |name: &str| std::fs::read(path.join(name)).unwrap();
    assert!(made("t.tx") == made("made/all/u.tx") && made("u.tx") == made("other.tx"));

    std::fs::write(path.join("scene.pbrt"), SCENE.replace("t.png", "other.tx")).unwrap();
    succeed(path, "render scene.pbrt -o b.exr");
    assert!(read(path, "a.exr").image == read(path, "b.exr").image);
    succeed(path, "render scene.pbrt --texture-memory 1 -o b.exr");
    assert!(read(path, "a.exr").image == read(path, "b.exr").image);

    // What cannot be made
    for (args, code, part) in [
        ("maketx t.png u.png -o one.tx", 2, "need a folder"),
        ("maketx t.png made/all/../../t.jpg -o made", 2, "two images"),
        ("maketx other.tx -o again.tx", 3, "all levels already"),
        ("maketx none.png", 3, "none.png"),
    ] {
        let output = command(path, args).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{args}: {}", stderr(&output));
        assert!(stderr(&output).contains(part), "{args}: {}", stderr(&output));
    }
}
