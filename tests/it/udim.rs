//! Image textures of tiles: `<UDIM>` in the file name.

use lumiris::imaging::oiio::{Part, write_image};
use lumiris::import::cache::FileCache;
use lumiris::import::{LoadOptions, Loaded, load_text};
use lumiris::textures::{RgbTexture, TextureContext};
use lumiris_numbers::math::{DVec3, Rgb, Vec2, Vec3};
use std::path::Path;

/// Tiles 1001, 1002 and 1011 of one colour each, and files that are no tiles.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, value) in [("1001", 0.25), ("1002", 0.5), ("1011", 0.75), ("0999", 9.0), ("10021", 9.0), ("1o01", 9.0)] {
        let names = ["R", "G", "B"].map(str::to_owned).to_vec();
        // The lower row, which is the second, is twice as bright
        let pixels = [value, value, 2.0 * value, 2.0 * value].iter().flat_map(|&v| [v, v, v]).collect();
        write_image(&folder.path().join(format!("wall.{name}.exr")), &[Part::linear(2, 2, names, pixels)]).unwrap();
    }
    folder
}

fn load(folder: &Path, name: &str) -> Result<Loaded, String> {
    let text = format!(
        r#"Film "rgb" "integer xresolution" 8 "integer yresolution" 8
        WorldBegin
        LightSource "infinite"
        Texture "wall" "spectrum" "imagemap" "string filename" "{name}" "string filter" "point"
        Material "diffuse" "texture reflectance" "wall"
        Shape "sphere""#
    );
    load_text(&text, "wall.pbrt", folder, &LoadOptions::default(), &FileCache::default()).map_err(|d| d.to_string())
}

#[test]
fn each_tile_has_its_image_and_the_rest_is_black() {
    // The texture has three images
    let folder = folder();
    let textures = load(folder.path(), "wall.<UDIM>.exr").unwrap().scene.textures;
    assert_eq!(textures.images.len(), 3);
    let wall = textures.rgbs.iter().find_map(|t| if let RgbTexture::Image(image) = t { Some(image) } else { None });
    let at = |u: f32, v: f32| {
        let (uv, uv1) = (Vec2::new(u, v), Vec2::ZERO);
        let ctx =
            TextureContext { uv, uv_width: Vec2::ZERO, uv1, color: [1.0; 4], face: 0, p: DVec3::ZERO, n: Vec3::Z };
        textures.image_value(wall.unwrap(), &ctx)
    };

    // Texture coordinates and the values there
    for (u, v, value) in [
        (0.3, 0.7, 0.25),
        (0.3, 0.2, 0.5),
        (1.3, 0.7, 0.5),
        (1.9, 0.01, 1.0),
        (0.9, 1.99, 0.75),
        (1.1, 1.5, 0.0),
        (2.5, 0.5, 0.0),
        (-0.5, 0.5, 0.0),
    ] {
        assert_eq!(at(u, v), Rgb::splat(value), "{u} {v}");
    }
}

#[test]
fn no_tile_at_all_is_an_error_with_its_place() {
    let folder = folder();
    let error = load(folder.path(), "floor.<UDIM>.exr").err().unwrap();
    assert!(error.contains("there is no tile of") && error.contains("wall.pbrt:4:"), "{error}");
    assert!(load(&folder.path().join("nowhere"), "wall.<UDIM>.exr").is_err());
}
