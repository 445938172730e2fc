use super::*;
use crate::bsdfs::Lobe;
use crate::imaging::{ColorEncoding, Filter, Image, MipMap, Wrap};
use crate::materials::*;
use crate::textures::{FloatTexture, FloatTextureId, ImageId, ImageTexture, Mapping2d, RgbTexture, RgbTextureId};
use lumiris_numbers::math::{Frame, Vec2, warp};
use lumiris_test_support::random::{RngExt, pcg32};
use std::f32::consts::FRAC_1_PI;

/// A hit on a plane whose normal is `n`, with ∂p/∂u and ∂p/∂v of lengths 2 and 3.
fn hit(n: Vec3) -> SurfaceHit {
    let frame = lumiris_numbers::math::Frame::from_xz(Vec3::new(1.0, 0.2, 0.1), n);
    let (dpdu, dpdv) = (frame.x * 2.0, frame.y * 3.0);
    let p = Vec3::new(1.0, 2.0, 3.0);
    SurfaceHit {
        p,
        p_error: Vec3::ZERO,
        n,
        ns: n,
        dpdu,
        dpdv,
        dpdus: dpdu,
        dpdvs: dpdv,
        uv: Vec2::new(0.4, 0.6),
        vertex: Default::default(),
    }
}

fn context(hit: &SurfaceHit) -> TextureContext {
    let (uv1, color) = (hit.vertex.uv1, hit.vertex.color);
    TextureContext {
        uv: hit.uv,
        uv_width: Vec2::ZERO,
        uv1,
        color,
        face: hit.vertex.face,
        p: hit.p.as_dvec3(),
        n: hit.n,
    }
}

struct Bench {
    textures: TextureSet,
    entries: Vec<MaterialEntry>,
}

impl Bench {
    fn new() -> Self {
        Bench { textures: TextureSet::default(), entries: Vec::new() }
    }

    fn float(&mut self, v: f32) -> FloatTextureId {
        self.textures.add_float(FloatTexture::Constant(v))
    }

    fn rgb(&mut self, r: f32, g: f32, b: f32) -> RgbTextureId {
        self.textures.add_rgb(RgbTexture::Constant(Rgb::new(r, g, b)))
    }

    /// An image with the given value at (u right, v up), `n` × `n`.
    fn image(&mut self, n: usize, value: impl Fn(f32, f32) -> [f32; 3]) -> ImageId {
        let mut image = Image::new(n, n, &["R", "G", "B"]);
        for y in 0..n {
            for x in 0..n {
                let (u, v) = ((x as f32 + 0.5) / n as f32, 1.0 - (y as f32 + 0.5) / n as f32);
                value(u, v).into_iter().enumerate().for_each(|(c, v)| image.set(x, y, c, v));
            }
        }
        self.textures.add_image(MipMap::new(&image, Wrap::Repeat, Filter::Bilinear, ColorEncoding::Linear))
    }

    fn material(&mut self, material: Material) -> MaterialId {
        self.entries.push(MaterialEntry {
            name: "m".into(),
            material,
            normal_map: None,
            displacement: None,
            dispersion: None,
        });
        (self.entries.len() - 1) as MaterialId
    }

    fn coated(&mut self, roughness: Roughness, albedo: f32) -> MaterialId {
        let (reflectance, thickness, g) = (self.rgb(0.2, 0.5, 0.9), self.float(0.01), self.float(0.0));
        let albedo = self.rgb(albedo, albedo, albedo);
        let coat = Coat { roughness, thickness, eta: 1.5, g, albedo, max_depth: 10, samples: 1 };
        self.material(Material::CoatedDiffuse { reflectance, coat })
    }

    fn set(&self) -> MaterialSet {
        MaterialSet::new(self.entries.clone(), &self.textures)
    }
}

const UP: Vec3 = Vec3::new(0.0, 0.6, 0.8);

#[test]
fn a_diffuse_material_clamps_its_texture_and_works_in_world_space() {
    let mut bench = Bench::new();
    let reflectance = bench.rgb(0.5, 2.0, -1.0);
    let id = bench.material(Material::Diffuse { reflectance });
    let (set, hit) = (bench.set(), hit(UP));
    let wo = (UP + Vec3::X * 0.3).normalize();
    let s = set.bsdf(id, &bench.textures, &hit, &context(&hit), wo).unwrap();
    let f = s.f(wo, UP);
    assert!((f.r - 0.5 * FRAC_1_PI).abs() < 1e-6 && (f.g - FRAC_1_PI).abs() < 1e-6 && f.b == 0.0);
    assert!((s.f_cos(wo, wo).r - f.r * UP.dot(wo)).abs() < 1e-6);
    assert_eq!(s.f(wo, -UP), Rgb::BLACK);
    let x = s.sample(wo, 0.5, [0.3, 0.7]).unwrap();
    assert!((s.pdf(wo, x.wi) - x.pdf).abs() < 1e-5 && (x.pdf - UP.dot(x.wi) * FRAC_1_PI).abs() < 1e-5);
    assert_eq!(s.albedo_estimate(wo, || [0.5; 3]).g, 1.0);
}

#[test]
fn shading_frames_follow_the_tangent() {
    let mut bench = Bench::new();
    let reflectance = bench.rgb(0.5, 0.5, 0.5);
    let glass = bench.material(Material::ThinDielectric { eta: 1.5 });
    let chalk = bench.material(Material::Diffuse { reflectance });
    let (set, hit) = (bench.set(), hit(UP));
    let frame = |id| set.bsdf(id, &bench.textures, &hit, &context(&hit), UP).unwrap().frame;
    assert!((frame(glass).x - hit.dpdus.normalize()).length() < 1e-6 && (frame(glass).z - UP).length() < 1e-6);
    // Lambertian reflection has no preferred direction
    assert_eq!(frame(chalk), Frame::from_z(hit.ns));
}

#[test]
fn a_displacement_tilts_the_normal_by_its_slope() {
    let mut bench = Bench::new();
    let image = bench.image(64, |u, v| [0.5 * u - 0.25 * v + 0.25; 3]);
    let texture = ImageTexture { image, mapping: Mapping2d::default(), udim: None, scale: 1.0, invert: false };
    let displacement = bench.textures.add_float(FloatTexture::Image(texture));
    let reflectance = bench.rgb(0.5, 0.5, 0.5);
    let id = bench.material(Material::Diffuse { reflectance });
    bench.entries[0].displacement = Some(displacement);
    let set = bench.set();
    for n in [UP, -UP] {
        let hit = hit(n);
        // ∂p/∂u has length 2, so a slope of 0.5 per u is 0.25 per length; along v 0.25 per v is 1/12.
        let (x, y) = (hit.dpdu.normalize(), hit.dpdv.normalize());
        let expected = (n - x * 0.25 + y / 12.0).normalize();
        for uv_width in [Vec2::ZERO, Vec2::splat(0.02)] {
            let ctx = TextureContext { uv_width, ..context(&hit) };
            let z = set.bsdf(id, &bench.textures, &hit, &ctx, n).unwrap().frame.z;
            assert!((z - expected).length() < 2e-3, "{z} {expected}");
        }
    }
}

#[test]
fn a_normal_map_sets_the_normal_in_the_tangent_frame() {
    let mut bench = Bench::new();
    let local = Vec3::new(0.3, -0.2, 0.9).normalize();
    let map = bench.image(4, |_, _| ((local + Vec3::ONE) * 0.5).to_array());
    let reflectance = bench.rgb(0.5, 0.5, 0.5);
    let id = bench.material(Material::Diffuse { reflectance });
    bench.entries[0].normal_map = Some(NormalMap::unscaled(map));
    let (set, hit) = (bench.set(), hit(UP));
    let s = set.bsdf(id, &bench.textures, &hit, &context(&hit), UP).unwrap();
    let frame = lumiris_numbers::math::Frame::from_xz(hit.dpdus, hit.ns);
    assert!((s.frame.z - frame.to_world(local)).length() < 1e-5);
    assert!(s.frame.x.dot(s.frame.z).abs() < 1e-6 && s.frame.x.dot(hit.dpdus) > 0.0);
}

#[test]
fn mixtures_choose_by_amount_and_always_alike() {
    let mut bench = Bench::new();
    let (black, white, amount) = (bench.rgb(0.0, 0.0, 0.0), bench.rgb(1.0, 1.0, 1.0), bench.float(0.3));
    let a = bench.material(Material::Diffuse { reflectance: black });
    let b = bench.material(Material::Diffuse { reflectance: white });
    let mix = bench.material(Material::Mix { materials: [a, b], amount });
    let nested = bench.material(Material::Mix { materials: [mix, a], amount });
    let (none, all) = (bench.float(0.0), bench.float(1.0));
    let first = bench.material(Material::Mix { materials: [a, b], amount: none });
    let second = bench.material(Material::Mix { materials: [a, b], amount: all });
    let itself = bench.material(Material::Mix { materials: [6, 6], amount });
    assert_eq!(itself, 6);
    let set = bench.set();
    let (mut counts, mut s, n) = ([0.0; 2], pcg32([1, 2, 3]), 100_000);
    for _ in 0..n {
        let mut hit = hit(UP);
        hit.p = Vec3::new(s.random::<f32>(), s.random::<f32>(), s.random::<f32>());
        let (ctx, wo) = (context(&hit), warp::sample_uniform_sphere(s.random::<[f32; 2]>()));
        let chosen = set.resolve(mix, &bench.textures, &ctx, wo);
        assert_eq!(chosen, set.resolve(mix, &bench.textures, &ctx, wo));
        counts[0] += f64::from(u8::from(chosen == Some(b)));
        counts[1] += f64::from(u8::from(set.resolve(nested, &bench.textures, &ctx, wo) == Some(b)));
        assert_eq!(set.resolve(first, &bench.textures, &ctx, wo), Some(a));
        assert_eq!(set.resolve(second, &bench.textures, &ctx, wo), Some(b));
        assert_eq!(set.resolve(itself, &bench.textures, &ctx, wo), None);
    }
    // Nested: 0.7 of the inner mixture. Bounds of 5 standard deviations.
    for (count, p) in counts.into_iter().zip([0.3, 0.21]) {
        let sigma = (p * (1.0 - p) / f64::from(n)).sqrt();
        assert!((count / f64::from(n) - p).abs() < 5.0 * sigma, "{count} {p}");
    }
}

#[test]
fn rays_pass_an_interface() {
    let mut bench = Bench::new();
    let id = bench.material(Material::Interface);
    let hit = hit(UP);
    assert!(bench.set().bsdf(id, &bench.textures, &hit, &context(&hit), UP).is_none());
}

#[test]
fn coats_share_tables_and_walk_only_where_they_must() {
    let mut bench = Bench::new();
    let (rough, smooth) = (bench.float(0.04), bench.float(0.0));
    let image = bench.image(2, |_, _| [0.04; 3]);
    let texture = ImageTexture { image, mapping: Mapping2d::default(), udim: None, scale: 1.0, invert: false };
    let (textured, other) = [0, 1].map(|_| bench.textures.add_float(FloatTexture::Image(texture))).into();
    let roughness = |u, v, remap| Roughness { u, v, remap };
    let constant = bench.coated(roughness(rough, rough, true), 0.0);
    let same = bench.coated(roughness(rough, rough, true), 0.0);
    let mirror = bench.coated(roughness(smooth, smooth, false), 0.0);
    let map = bench.coated(roughness(textured, textured, true), 0.0);
    let two_maps = bench.coated(roughness(textured, other, true), 0.0);
    let medium = bench.coated(roughness(rough, rough, true), 0.5);
    let (set, hit) = (bench.set(), hit(UP));
    assert_eq!(set.coats.len(), 3);
    assert_eq!(set.coat_of[constant as usize], set.coat_of[same as usize]);

    let wo = (UP + Vec3::X * 0.5).normalize();
    let bsdf = |id| set.bsdf(id, &bench.textures, &hit, &context(&hit), wo).unwrap();
    for id in [constant, mirror, map] {
        assert!(matches!(bsdf(id).bsdf, Bsdf::CoatedDiffuse(_)));
    }
    for id in [two_maps, medium] {
        assert!(matches!(bsdf(id).bsdf, Bsdf::Layered(_)));
    }
    assert!(bsdf(mirror).bsdf.has_specular() && !bsdf(constant).bsdf.has_specular());
    // The table over all roughnesses agrees with the table of this roughness.
    let wi = (UP - Vec3::X * 0.2 + Vec3::Y * 0.4).normalize();
    let (a, b) = (bsdf(map).f(wo, wi).g, bsdf(constant).f(wo, wi).g);
    assert!((a - b).abs() < 2e-3 * b, "{a} {b}");
}

#[test]
fn indices_are_relative_to_the_coat_and_roughness_is_remapped() {
    let mut bench = Bench::new();
    let (zero, rough, thickness) = (bench.float(0.0), bench.float(0.09), bench.float(0.01));
    let (eta, k, black) = (bench.rgb(0.3, 0.6, 1.2), bench.rgb(3.0, 3.0, 3.0), bench.rgb(0.0, 0.0, 0.0));
    let roughness = |id, remap| Roughness { u: id, v: id, remap };
    let smooth = roughness(zero, false);
    let coat = Coat { roughness: smooth, thickness, eta: 1.5, g: zero, albedo: black, max_depth: 10, samples: 0 };
    let conductor = ConductorSpectrum::EtaK { eta, k };
    let metal = bench.material(Material::CoatedConductor { conductor, roughness: roughness(rough, true), coat });
    let glass = bench.material(Material::Dielectric { eta: 0.0, roughness: roughness(rough, false) });
    let (set, hit) = (bench.set(), hit(UP));
    let bsdf = |id| set.bsdf(id, &bench.textures, &hit, &context(&hit), UP).unwrap();
    let Bsdf::Layered(l) = bsdf(metal).bsdf else { panic!("a coated metal is layered") };
    let Base::Conductor(c) = l.base else { panic!("its base is a metal") };
    assert!((c.eta.g - 0.4).abs() < 1e-6 && (c.k.r - 2.0).abs() < 1e-6);
    assert!((c.distribution.alpha_x - 0.3).abs() < 1e-6 && l.top.distribution.is_smooth());
    assert_eq!((l.top.eta, l.samples), (1.5, 1));
    // Without an index there is no interface: light passes unrefracted.
    let x = bsdf(glass).sample(UP, 0.0, [0.5, 0.5]).unwrap();
    assert!(x.lobe.contains(Lobe::SPECULAR | Lobe::TRANSMISSION) && (x.wi + UP).length() < 1e-6);
}

#[test]
fn images_are_requested_wherever_they_are_in_the_trees_of_a_material() {
    let mut bench = Bench::new();
    let image = |bench: &mut Bench, scale| {
        let image = bench.image(2, |_, _| [0.5; 3]);
        ImageTexture { image, mapping: Mapping2d::default(), udim: None, scale, invert: false }
    };
    let [color, weight, roughness, height] = [1.0, 2.0, 3.0, 4.0].map(|scale| image(&mut bench, scale));
    let tex = bench.textures.add_rgb(RgbTexture::Image(color));
    let scale = bench.textures.add_float(FloatTexture::Channel(weight, 1));
    let reflectance = bench.textures.add_rgb(RgbTexture::Scale { tex, scale });
    let [u, displacement] = [roughness, height].map(|image| bench.textures.add_float(FloatTexture::Image(image)));

    // A coated material with all of them, and a mixture with itself
    let coated = bench.coated(Roughness { u, v: u, remap: false }, 0.0);
    if let Material::CoatedDiffuse { reflectance: of_coated, .. } = &mut bench.entries[coated as usize].material {
        *of_coated = reflectance;
    }
    bench.entries[coated as usize].displacement = Some(displacement);
    let mixture = bench.material(Material::Mix { materials: [coated; 2], amount: scale });
    let images = |id: MaterialId| images_of(&bench.entries[id as usize], &bench.textures);
    let ids: Vec<ImageId> = images(coated).iter().map(|image| image.image).collect();
    assert_eq!(ids, [color, weight, roughness, height].map(|image| image.image));
    assert!(images(mixture).is_empty());
}
