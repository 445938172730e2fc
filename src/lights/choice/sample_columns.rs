//! One light sample for each of many points, in columns.
//!
//! Points that chose the same light are sampled together: rectangles, triangles, spheres and infinite lights by
//! kernels, other lights one by one. A light that has a kernel always uses it, so the result is bit-identical for any
//! number of points.

use super::job_lights::JobLights;
use super::light_sampler::LightSampler;
use crate::lights::{AreaLight, AreaShape, LeAndPdf, Light, LightCtx, LightId, LightLanes, LightSample, SampledLight};
use lumiris_lanes::area::{Rectangle, many};
use lumiris_lanes::columns::{Column, Columns3, gather, padded, reserve, scatter};
use lumiris_lanes::level;
use lumiris_lanes::light_tree::{GlossyLobes, Receivers};
use lumiris_numbers::math::light_bound::GlossyLobe;
use lumiris_numbers::math::{Rgb, Sphere, Vec2, Vec3};
use std::ops::Range;

/// Maximum number of lights for which points are sorted by counting.
const MAX_COUNTED: usize = 256;

/// The choice of no light.
pub const NO_LIGHT: LightId = LightId::MAX;

/// The light that a point chose.
#[derive(Clone, Copy, Debug)]
pub struct ChosenLight {
    /// The light.
    pub light: LightId,
    /// Probability of the choice.
    pub pmf: f32,
}

impl From<SampledLight> for ChosenLight {
    fn from(SampledLight { light, pmf, .. }: SampledLight) -> Self {
        ChosenLight { light, pmf }
    }
}

impl ChosenLight {
    /// The choice of no light.
    pub const NONE: ChosenLight = ChosenLight { light: NO_LIGHT, pmf: 0.0 };

    /// True if no light was chosen.
    fn is_none(self) -> bool {
        self.light == NO_LIGHT
    }
}

/// Illuminated points, in columns; see [`LightCtx`].
#[derive(Clone, Copy, Debug)]
pub struct LitPoints<'a> {
    /// Positions.
    pub p: &'a Columns3,
    /// Geometric normals on the illuminated side; zero if both sides are illuminated.
    pub n: &'a Columns3,
    /// Shading normals.
    pub ns: &'a Columns3,
    /// Glossy lobes for the choice of lights; empty if no choice depends on them.
    pub lobes: &'a [GlossyLobe],
}

impl LitPoints<'_> {
    /// Point `i`.
    #[inline]
    pub fn get(&self, i: usize) -> LightCtx {
        let lobe = self.lobes.get(i).copied().unwrap_or(GlossyLobe::NONE);
        LightCtx { p: self.p.vec3(i), n: self.n.vec3(i), ns: self.ns.vec3(i), lobe }
    }
}

/// A light sample for each point, as [`LightSample`].
#[derive(Debug, Default)]
pub struct LightSamples {
    /// Unit directions.
    pub wi: Columns3,
    /// Radiances.
    pub li: Columns3,
    /// Densities including the probability of the light (1/sr); 0 if there is no sample.
    pub pdf: Column,
    /// Points on lights.
    pub p: Columns3,
    /// Bounds of their rounding errors.
    pub p_error: Columns3,
    /// Normals of lights.
    pub n: Columns3,
    /// 1 for lights at infinity, else 0.
    pub is_far: Column,
    /// True if no other technique can sample the direction.
    pub is_delta: Vec<bool>,
}

impl LightSamples {
    /// Lengthens the columns if they are shorter.
    pub fn reserve(&mut self, len: usize) {
        let LightSamples { wi, li, pdf, p, p_error, n, is_far, is_delta } = self;
        [wi, li, p, p_error, n].into_iter().for_each(|c| c.reserve(len));
        reserve(&mut [pdf, is_far], len);
        is_delta.resize(is_delta.len().max(len), false);
    }

    /// The first `len` of them, as kernels fill them.
    fn lanes(&mut self, len: usize) -> LightLanes<'_> {
        LightLanes { wi: self.wi.get_mut(len), li: self.li.get_mut(len), pdf: &mut self.pdf[..len] }
    }

    /// Sample `i`, drawn from the point `from`; `None` if there is none.
    #[inline]
    pub fn get(&self, i: usize, from: Vec3) -> Option<LightSample> {
        let (pdf, p, is_far) = (self.pdf[i], self.p.vec3(i), self.is_far[i] > 0.0);
        (pdf > 0.0).then(|| LightSample {
            li: self.li.rgb(i),
            wi: self.wi.vec3(i),
            pdf,
            t: if is_far { f32::INFINITY } else { (p - from).length() },
            p,
            n: self.n.vec3(i),
            p_error: self.p_error.vec3(i),
            is_delta: self.is_delta[i],
        })
    }

    /// Sets sample `i`.
    #[inline]
    fn set(&mut self, i: usize, sample: Option<LightSample>) {
        let Some(LightSample { li, wi, pdf, t, p, n, p_error, is_delta }) = sample else {
            self.pdf[i] = 0.0;
            return;
        };
        self.wi.set(i, wi);
        self.li.set_rgb(i, li);
        self.pdf[i] = pdf;
        self.p.set(i, p);
        self.p_error.set(i, p_error);
        self.n.set(i, n);
        self.is_far[i] = if t.is_finite() { 0.0 } else { 1.0 };
        self.is_delta[i] = is_delta;
    }

    /// Sets the samples `places` to the first samples of `others`, without points, error bounds and normals if `is_far`.
    fn scatter(&mut self, places: &[u32], others: &LightSamples, is_far: bool) {
        self.wi.scatter(places, &others.wi);
        self.li.scatter(places, &others.li);
        scatter(&mut self.pdf, places, &others.pdf);
        scatter(&mut self.is_delta, places, &others.is_delta);
        scatter(&mut self.is_far, places, &others.is_far);
        if !is_far {
            self.p.scatter(places, &others.p);
            self.p_error.scatter(places, &others.p_error);
            self.n.scatter(places, &others.n);
        }
    }
}

/// Lobes in columns.
#[derive(Debug, Default)]
struct LobeColumns {
    wo: Columns3,
    rest: [Column; 4],
}

impl LobeColumns {
    /// Sets the columns to these lobes, in whole vectors.
    fn set(&mut self, lobes: &[GlossyLobe]) {
        let len = padded(lobes.len());
        let LobeColumns { wo, rest } = self;
        wo.reserve(len);
        reserve(&mut rest.each_mut(), len);
        for (i, lobe) in lobes.iter().enumerate() {
            wo.set(i, Vec3::from_array(lobe.wo));
            for (column, x) in rest.iter_mut().zip([lobe.cos_o, lobe.alpha_squared, lobe.scale, lobe.diffuse]) {
                column[i] = x;
            }
        }
    }

    /// The first `len` lobes.
    fn get(&self, len: usize) -> GlossyLobes<'_> {
        let [cos_o, alpha_squared, scale, diffuse] = self.rest.each_ref().map(|column| &column[..len]);
        GlossyLobes { wo: self.wo.get(len), cos_o, alpha_squared, scale, diffuse }
    }
}

/// Memory of [`JobLights::sample_many`].
#[derive(Debug, Default)]
pub struct Scratch {
    /// The light that each point chose.
    chosen: Vec<ChosenLight>,
    /// Lobes at the points.
    lobes: LobeColumns,
    /// Points sorted by light.
    order: Vec<u32>,
    begins: Vec<u32>,
    p: Columns3,
    u: [Column; 2],
    samples: LightSamples,
}

impl Scratch {
    /// Prepares for samples of `lights` at the points `at`; each point may be sampled several times.
    pub fn begin(&mut self, lights: &JobLights, at: LitPoints<'_>) {
        if matches!(lights.sampler, LightSampler::Tree(_)) && lights.sampler.only_light().is_none() {
            self.lobes.set(at.lobes);
        }
    }

    /// The light that point `i` chose in the last [`JobLights::sample_many`], if there is more than one light.
    pub fn chosen(&self, i: usize) -> LightId {
        self.chosen[i].light
    }
}

impl JobLights {
    /// Samples a direction to a light for each of the `n` points `at`: the light by `u[0]`, the direction by `u[1]` and
    /// `u[2]`. The results equal [`sample`](Self::sample) up to rounding, except that the radiance and density of
    /// infinite lights are sums over all of them. `out` must have whole vectors. `scratch` must have begun with these
    /// points.
    pub fn sample_many(
        &self,
        n: usize,
        at: LitPoints<'_>,
        u: &[Column; 3],
        scratch: &mut Scratch,
        out: &mut LightSamples,
    ) {
        // A single light needs no choice
        if let Some(light) = self.sampler.only_light() {
            let len = padded(n);
            self.sample_one_light(light, n, at.p, [&u[1][..len], &u[2][..len]], out);
        } else {
            let mut chosen = std::mem::take(&mut scratch.chosen);
            chosen.clear();
            let take = |choice: Option<SampledLight>| chosen.push(choice.map_or(ChosenLight::NONE, ChosenLight::from));
            if let LightSampler::Tree(choice) = &self.sampler {
                let len = padded(n);
                let lobes = if at.lobes.is_empty() { None } else { Some(scratch.lobes.get(len)) };
                choice.sample_many(&Receivers { p: at.p.get(len), ns: at.ns.get(len), lobes }, &u[0][..len], take);
                chosen.truncate(n);
            } else {
                u[0][..n].iter().enumerate().map(|(i, &u)| self.sampler.sample(&at.get(i), u)).for_each(take);
            }
            self.sample_chosen(&chosen, at.p, [&u[1], &u[2]], scratch, out);
            scratch.chosen = chosen;
        }

        // Infinite lights overlap
        self.unite_infinite(0..n, |i| at.get(i), out);
    }

    /// Samples a direction for each of the points `p` to its chosen light, by the random numbers `u`. Otherwise as
    /// [`sample_many`](Self::sample_many), but infinite lights are not combined.
    pub fn sample_chosen(
        &self,
        chosen: &[ChosenLight],
        p: &Columns3,
        u: [&Column; 2],
        scratch: &mut Scratch,
        out: &mut LightSamples,
    ) {
        // One light for all points needs no sorting
        let len = padded(chosen.len());
        let mut lights = chosen.iter().filter(|c| !c.is_none()).map(|c| c.light);
        if let Some(light) = lights.next()
            && lights.all(|other| other == light)
        {
            self.sample_one_light(light, chosen.len(), p, [&u[0][..len], &u[1][..len]], out);
            return with_choices(chosen, out);
        }

        // Gather the points of each light, sample them together, and scatter the results
        sort_by_light(chosen, self.lights.len(), scratch);
        scratch.p.reserve(len);
        scratch.samples.reserve(len);
        let [u0, u1] = &mut scratch.u;
        reserve(&mut [u0, u1], len);
        let mut rest = &scratch.order[..];
        while let Some(&first) = rest.first() {
            let light = chosen[first as usize].light;
            let count = rest.partition_point(|&i| chosen[i as usize].light == light);
            let (places, others) = rest.split_at(count);
            rest = others;
            scratch.p.gather(p, places);
            gather(u0, u[0], places);
            gather(u1, u[1], places);
            let len = padded(count);
            self.sample_one_light(light, count, &scratch.p, [&u0[..len], &u1[..len]], &mut scratch.samples);
            out.scatter(places, &scratch.samples, self.infinite.contains(&light));
        }
        with_choices(chosen, out);
    }

    /// Replaces radiance and density of samples of infinite lights by the sums over all infinite lights, since every
    /// direction belongs to each of them. `at(i)` is the point of sample `i`.
    pub fn unite_infinite(&self, places: Range<usize>, at: impl Fn(usize) -> LightCtx, out: &mut LightSamples) {
        if self.infinite.len() > 1 {
            for i in places {
                if out.pdf[i] == 0.0 || out.is_far[i] == 0.0 || out.is_delta[i] {
                    continue;
                }
                let wi = out.wi.vec3(i);
                let LeAndPdf { le, pdf } = self.infinite_in_direction(&at(i), wi);
                out.li.set_rgb(i, le);
                out.pdf[i] = pdf;
            }
        }
    }

    /// Samples the same light for `n` points; the columns `u` have whole vectors.
    fn sample_one_light(&self, light: LightId, n: usize, p: &Columns3, u: [&[f32]; 2], out: &mut LightSamples) {
        let len = u[0].len();
        match &self.lights[light as usize] {
            Light::Area(area) if area.is_even() && area.sample_many(n, p, u, out) => {}
            light if len > 0 && light.sample_li_columns(u, &mut out.lanes(len)) => {
                out.is_far[..n].fill(1.0);
                out.is_delta[..n].fill(false);
            }
            light => {
                for i in 0..n {
                    out.set(i, light.sample_li(&LightCtx::at(p.vec3(i)), [u[0][i], u[1][i]]));
                }
            }
        }
    }
}

/// Multiplies densities by the probabilities of the choices.
fn with_choices(chosen: &[ChosenLight], out: &mut LightSamples) {
    for (pdf, choice) in out.pdf.iter_mut().zip(chosen) {
        *pdf = if choice.is_none() { 0.0 } else { *pdf * choice.pmf };
    }
}

/// Sorts the indices of points by their chosen light, without the points that chose none.
fn sort_by_light(chosen: &[ChosenLight], lights: usize, scratch: &mut Scratch) {
    let Scratch { order, begins, .. } = scratch;
    let lit = || chosen.iter().enumerate().filter(|(_, c)| !c.is_none());
    order.clear();
    if lights > MAX_COUNTED {
        order.extend(lit().map(|(i, _)| i as u32));
        order.sort_unstable_by_key(|&i| (chosen[i as usize].light, i));
        return;
    }

    // Counting sort
    begins.clear();
    begins.resize(lights + 1, 0);
    for (_, choice) in lit() {
        begins[choice.light as usize + 1] += 1;
    }
    for light in 0..lights {
        begins[light + 1] += begins[light];
    }
    order.resize(begins[lights] as usize, 0);
    for (i, choice) in lit() {
        let next = &mut begins[choice.light as usize];
        order[*next as usize] = i as u32;
        *next += 1;
    }
}

impl AreaLight {
    /// Samples a point for each of the `n` points `p`; returns false if the shape has no kernel.
    fn sample_many(&self, n: usize, p: &Columns3, u: [&[f32]; 2], out: &mut LightSamples) -> bool {
        if let AreaShape::Quadric(quadric) = &self.shape {
            let sphere = quadric.sphere.as_ref();
            return sphere.map(|sphere| self.sample_sphere(sphere, quadric.reversed, n, p, u, out)).is_some();
        }
        let len = u[0].len();
        let from = p.get(len);
        let LightSamples { wi, li, pdf, p: points, p_error, n: normals, is_far, is_delta } = out;
        let (wi, points, p_error) = (wi.get_mut(len), points.get_mut(len), p_error.get_mut(len));
        let mut on_light = many::PointsOnLight { wi, p: points, p_error, pdf: &mut pdf[..len] };
        let normal = match &self.shape {
            AreaShape::Rectangle(r) => {
                let rectangle = Rectangle { corner: r.corner, ex: r.ex, ey: r.ey, size: r.size, n: r.n };
                many::sample_rectangle(level(), &rectangle, r.flatness_error, from, u, &mut on_light);
                r.n
            }
            AreaShape::Triangle(t) => {
                many::sample_triangle(level(), (t.p, t.n, t.area), from, u, &mut on_light);
                t.n
            }
            AreaShape::Quadric(_) | AreaShape::Patch(_) => return false,
        };

        // Emission and normal, the same for all points
        let l: Rgb = self.emission.l;
        let [x, y, z] = p.get(n);
        for (i, pdf) in pdf[..n].iter_mut().enumerate() {
            *pdf = if self.is_dark_from(Vec3::new(x[i], y[i], z[i])) { 0.0 } else { *pdf };
        }
        li.fill(n, Vec3::from_array(l.to_array()));
        normals.fill(n, normal);
        is_far[..n].fill(0.0);
        is_delta[..n].fill(false);
        true
    }

    /// [`Self::sample_many`] for a sphere; `reversed`: its normals point to the inside.
    fn sample_sphere(
        &self,
        sphere: &Sphere,
        reversed: bool,
        n: usize,
        p: &Columns3,
        u: [&[f32]; 2],
        out: &mut LightSamples,
    ) {
        let len = u[0].len();
        let LightSamples { wi, pdf, p: points, p_error, n: outward, .. } = &mut *out;
        let (wi, points, p_error) = (wi.get_mut(len), points.get_mut(len), p_error.get_mut(len));
        let mut on_light = many::PointsOnLight { wi, p: points, p_error, pdf: &mut pdf[..len] };
        many::sample_sphere(level(), sphere, p.get(len), u, outward.get_mut(len), &mut on_light);
        out.is_far[..n].fill(0.0);
        out.is_delta[..n].fill(false);

        // Emission and normals; points inside are sampled one by one
        let is_dark_outside = reversed && !self.emission.two_sided;
        for i in 0..n {
            if out.pdf[i] < 0.0 {
                out.set(i, self.sample_li(&LightCtx::at(p.vec3(i)), [u[0][i], u[1][i]]));
            } else if is_dark_outside {
                out.pdf[i] = 0.0;
            } else {
                let outward = out.n.vec3(i);
                let normal = if reversed { -outward } else { outward };
                out.n.set(i, normal);
                out.li.set_rgb(i, self.emission.l(normal, Vec2::ZERO, -out.wi.vec3(i)));
            }
        }
    }
}

impl LightSampler {
    /// The light that is always chosen, if there is only one.
    pub fn only_light(&self) -> Option<LightId> {
        match self {
            LightSampler::Uniform(choice) | LightSampler::Power(choice) => choice.only(),
            LightSampler::Tree(choice) => match (choice.infinite.as_slice(), choice.tree.only_light()) {
                ([], light) => light,
                (&[light], None) if choice.tree.is_empty() => Some(light),
                _ => None,
            },
            LightSampler::VisibilityCache(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Quadric, QuadricKind, Shape, TriangleMesh};
    use crate::lights::{
        DistantLight, Emission, EnvironmentFilter, EnvironmentMap, EnvironmentMapping, LightSamplerKind,
        LightSetBuilder, PointLight, SampleOfLight,
    };
    use lumiris_numbers::math::warp::sample_uniform_sphere;
    use lumiris_numbers::math::{Affine3A, Bounds3};
    use lumiris_test_support::random::{Pcg32, RngExt, pcg32};
    use std::sync::Arc;

    const N: usize = 203;

    fn mesh(points: &[Vec3], triangles: Vec<[u32; 3]>) -> Shape {
        Shape::Mesh(TriangleMesh::new(points.to_vec(), triangles).unwrap())
    }

    /// A large and a small rectangle, a triangle, a sphere, delta lights.
    fn lamps(builder: &mut LightSetBuilder) {
        let square = |z: f32, s: f32| [(0.0, 0.0), (0.0, s), (s, s), (s, 0.0)].map(|(x, y)| Vec3::new(x, y, z));
        let two = vec![[0, 1, 2], [0, 2, 3]];
        builder.add_area(0, &mesh(&square(2.0, 1.5), two.clone()), &Emission::constant(Rgb::new(5.0, 4.0, 3.0)));
        builder.add_area(1, &mesh(&square(2.5, 0.1), two), &Emission::constant(Rgb::splat(90.0)));
        let both = Emission { two_sided: true, ..Emission::constant(Rgb::splat(2.0)) };
        builder.add_area(
            2,
            &mesh(&[Vec3::ONE, Vec3::new(2.0, 1.0, 1.5), Vec3::new(1.0, 2.0, 1.0)], vec![[0, 1, 2]]),
            &both,
        );
        let sphere = |radius: f32, center: Vec3, flip_normal: bool| {
            let kind = QuadricKind::Sphere { radius, z_min: -radius, z_max: radius, phi_max: std::f32::consts::TAU };
            Shape::Quadric(Quadric::new(kind, Affine3A::from_translation(center), flip_normal))
        };
        builder.add_area(3, &sphere(0.4, Vec3::new(-1.0, 1.0, 2.0), false), &Emission::constant(Rgb::splat(7.0)));
        // A sphere that contains some of the points, and one that shines to the inside
        builder.add_area(4, &sphere(0.9, Vec3::ZERO, false), &both);
        builder.add_area(5, &sphere(1.1, Vec3::ZERO, true), &Emission::constant(Rgb::splat(2.0)));
        builder.add(Light::Point(PointLight { p: Vec3::new(2.0, 2.0, 2.0), intensity: Rgb::splat(3.0) }));
        builder.add(Light::Distant(DistantLight { wi: Vec3::Z, irradiance: Rgb::WHITE }));
    }

    fn sky(builder: &mut LightSetBuilder) {
        let texels = (0..64).map(|i| Rgb::new(i as f32 * 0.01, 0.3, 0.1)).collect();
        let map = EnvironmentMap::new(texels, [8, 8], EnvironmentMapping::EqualArea, EnvironmentFilter::Bilinear);
        builder.add(Light::infinite_image(Arc::new(map.unwrap()), &Affine3A::from_rotation_x(0.4), 2.0));
    }

    fn assert_like_singles(builder: LightSetBuilder, kind: LightSamplerKind, stream: &mut Pcg32) {
        let set = Arc::new(builder.build(&Bounds3 { min: -Vec3::ONE, max: Vec3::splat(3.0) }));
        let lights = JobLights::new(set, kind, 1);
        let len = padded(N);
        let [mut p, mut n, mut ns] = [(); 3].map(|()| Columns3::default());
        [&mut p, &mut n, &mut ns].into_iter().for_each(|c| c.reserve(len));
        let mut u: [Column; 3] = std::array::from_fn(|_| vec![0.0; len]);
        for i in 0..N {
            p.set(i, Vec3::new(stream.random::<f32>(), stream.random::<f32>(), stream.random::<f32>()) * 2.0 - 1.0);
            n.set(i, Vec3::Z);
            ns.set(i, Vec3::Z);
        }
        let lobes: Vec<GlossyLobe> = (0..N)
            .map(|i| match i % 3 {
                0 => GlossyLobe::NONE,
                k => GlossyLobe::new(sample_uniform_sphere(stream.random::<[f32; 2]>()), Vec3::Z, 0.2 * k as f32, 0.7),
            })
            .collect();
        let at = LitPoints { p: &p, n: &n, ns: &ns, lobes: &lobes };
        let (mut scratch, mut out) = (Scratch::default(), LightSamples::default());
        out.reserve(len);
        scratch.begin(&lights, at);
        for _ in 0..3 {
            u.iter_mut().for_each(|u| u[..N].fill_with(|| stream.random::<f32>()));
            lights.sample_many(N, at, &u, &mut scratch, &mut out);
            assert_same(&lights, at, &u, &out);
        }
    }

    /// Compares `out` with single samples.
    fn assert_same(lights: &JobLights, at: LitPoints<'_>, u: &[Column; 3], out: &LightSamples) {
        let mut drawn = 0;
        for i in 0..N {
            let ctx = at.get(i);
            let sampled = lights.sample(&ctx, u[0][i], [u[1][i], u[2][i]]);
            let Some(SampleOfLight { light, sample: s }) = sampled else {
                assert_eq!(out.pdf[i], 0.0);
                continue;
            };

            // The single sample, with all infinite lights
            let (mut li, mut pdf) = (s.li, s.pdf);
            if lights.infinite.contains(&light) && lights.infinite.len() > 1 {
                LeAndPdf { le: li, pdf } = lights.infinite_in_direction(&ctx, s.wi);
            }

            // Both agree up to rounding
            let what = lights.lights[light as usize].kind_name();
            drawn += 1;
            assert!((out.pdf[i] - pdf).abs() <= 2e-4 * pdf, "{what} {} {pdf}", out.pdf[i]);
            assert!((out.wi.vec3(i) - s.wi).length() < 1e-5, "{what}");
            assert!((out.li.rgb(i) - li).map(f32::abs).max_component() <= 2e-4 * li.max_component(), "{what}");
            assert_eq!((out.is_far[i] > 0.0, out.is_delta[i]), (!s.t.is_finite(), s.is_delta), "{what}");
            if s.t.is_finite() {
                assert!((out.p.vec3(i) - s.p).length() < 1e-5 && (out.n.vec3(i) - s.n).length() < 1e-5, "{what}");
                assert!((out.p_error.vec3(i) - s.p_error).abs().max_element() < 1e-6, "{what}");
            }
        }
        assert!(drawn > N / 3, "{drawn}");
    }

    #[test]
    fn samples_are_those_of_single_points() {
        let stream = &mut pcg32([4, 8, 1]);
        for kind in [LightSamplerKind::Uniform, LightSamplerKind::Power, LightSamplerKind::Tree] {
            let all = |_: &mut Pcg32| {
                let mut b = LightSetBuilder::default();
                lamps(&mut b);
                b
            };
            assert_like_singles(all(stream), kind, stream);
            // One infinite light, and two that overlap
            for skies in [1, 2] {
                let mut b = all(stream);
                (0..skies).for_each(|_| sky(&mut b));
                assert_like_singles(b, kind, stream);
            }
            // More lights than counting sort handles
            let mut b = all(stream);
            for i in 0..MAX_COUNTED as u32 {
                let p = Vec3::new(i as f32 * 0.1, 1.0, 2.0);
                b.add(Light::Point(PointLight { p, intensity: Rgb::splat(0.1) }));
            }
            assert_like_singles(b, kind, stream);
            // One light alone
            let mut b = LightSetBuilder::default();
            sky(&mut b);
            assert_like_singles(b, kind, stream);
            let square = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)].map(|(x, y)| Vec3::new(x, y, 1.5));
            let mut b = LightSetBuilder::default();
            let two = vec![[0, 1, 2], [0, 2, 3]];
            b.add_area(0, &mesh(&square, two), &Emission::constant(Rgb::WHITE));
            assert_like_singles(b, kind, stream);
        }
    }
}
