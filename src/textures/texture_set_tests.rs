use super::*;
use crate::imaging::{ColorEncoding, Image};
use crate::textures::*;
use lumiris_numbers::math::{DVec3, Vec3};

fn at(u: f32, v: f32) -> TextureContext {
    TextureContext {
        uv: Vec2::new(u, v),
        uv_width: Vec2::ZERO,
        uv1: Vec2::ZERO,
        color: [0.5; 4],
        face: 0,
        p: DVec3::ZERO,
        n: Vec3::new(0.6, 0.0, 0.8),
    }
}

/// A 2×2 image, red below, green above, blue on the right.
fn set() -> (TextureSet, ImageTexture) {
    let mut image = Image::new(2, 2, &["R", "G", "B"]);
    for x in 0..2 {
        image.set(x, 1, 0, 0.75);
        image.set(x, 0, 1, 0.5);
        image.set(1, x, 2, 1.5);
    }
    let mut set = TextureSet::default();
    let image = set.add_image(MipMap::new(&image, Wrap::Repeat, Filter::Bilinear, ColorEncoding::Linear));
    (set, ImageTexture { image, mapping: Mapping2d::default(), udim: None, scale: 1.0, invert: false })
}

#[test]
fn images_have_their_origin_at_the_lower_left() {
    let (mut set, image) = set();
    let rgb = set.add_rgb(RgbTexture::Image(image));
    let float = set.add_float(FloatTexture::Image(image));
    assert_eq!(set.rgb(rgb, &at(0.25, 0.25)), Rgb::new(0.75, 0.0, 0.0));
    assert_eq!(set.rgb(rgb, &at(0.75, 0.75)), Rgb::new(0.0, 0.5, 1.5));
    assert!((set.float(float, &at(0.25, 0.25)) - 0.25).abs() < 1e-6);
}

#[test]
fn scale_comes_before_invert_and_colours_stay_positive() {
    let (mut set, image) = set();
    let texture = ImageTexture { scale: 2.0, invert: true, ..image };
    let rgb = set.add_rgb(RgbTexture::Image(texture));
    let float = set.add_float(FloatTexture::Image(texture));
    assert_eq!(set.rgb(rgb, &at(0.75, 0.75)), Rgb::new(1.0, 0.0, 0.0));
    assert!((set.float(float, &at(0.25, 0.25)) - 0.5).abs() < 1e-6);
    assert_eq!(set.float(float, &at(0.75, 0.75)), 0.0);
}

#[test]
fn trees_combine_their_leaves() {
    // Floats
    let (mut set, _) = set();
    let [a, b, quarter] = [2.0, 6.0, 0.25].map(|v| set.add_float(FloatTexture::Constant(v)));
    let [red, blue] = [Rgb::new(1.0, 0.0, 0.0), Rgb::new(0.0, 0.0, 1.0)].map(|c| set.add_rgb(RgbTexture::Constant(c)));
    let mix = set.add_float(FloatTexture::Mix { tex1: a, tex2: b, amount: quarter });
    let scale = set.add_float(FloatTexture::Scale { tex: mix, scale: quarter });
    let along = set.add_float(FloatTexture::DirectionMix { tex1: a, tex2: b, direction: Vec3::Z });
    assert_eq!(set.float(mix, &at(0.0, 0.0)), 3.0);
    assert_eq!(set.float(scale, &at(0.0, 0.0)), 0.75);
    assert!((set.float(along, &at(0.0, 0.0)) - (0.8 * 2.0 + 0.2 * 6.0)).abs() < 1e-5);

    // Checkerboards
    let mapping = CheckerboardMapping::Squares(Mapping2d::default());
    let board = set.add_rgb(RgbTexture::Checkerboard { mapping, tex1: red, tex2: blue });
    let float_board = set.add_float(FloatTexture::Checkerboard { mapping, tex1: a, tex2: b });
    assert_eq!((set.rgb(board, &at(0.5, 0.5)).r, set.rgb(board, &at(1.5, 0.5)).b), (1.0, 1.0));
    assert_eq!((set.float(float_board, &at(0.5, 0.5)), set.float(float_board, &at(0.5, 1.5))), (2.0, 6.0));

    // Colours
    let rgb_mix = set.add_rgb(RgbTexture::Mix { tex1: red, tex2: board, amount: quarter });
    let rgb_scale = set.add_rgb(RgbTexture::Scale { tex: rgb_mix, scale: a });
    assert_eq!(set.rgb(rgb_scale, &at(1.5, 0.5)), Rgb::new(1.5, 0.0, 0.5));
    let rgb_along = set.add_rgb(RgbTexture::DirectionMix { tex1: red, tex2: blue, direction: Vec3::Z });
    assert!((set.rgb(rgb_along, &at(0.0, 0.0)).b - 0.2).abs() < 1e-5);

    // Constants
    assert_eq!((set.constant_float(a), set.constant_float(mix)), (Some(2.0), None));
    assert_eq!((set.constant_rgb(red), set.constant_rgb(board)), (Some(Rgb::new(1.0, 0.0, 0.0)), None));
}

#[test]
#[should_panic(expected = "earlier ones only")]
fn a_texture_cannot_refer_to_itself() {
    TextureSet::default().add_float(FloatTexture::Scale { tex: 0, scale: 0 });
}
