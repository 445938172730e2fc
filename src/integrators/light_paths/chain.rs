//! The part of a camera path that light paths can sample as well, and the MIS weights of both.

/// The part of a camera path from its first vertex on: any surface there, then only metal and glass. See [`super`].
#[derive(Clone, Copy, Debug)]
pub(in crate::integrators) struct Chain {
    /// Density of camera samples at the first vertex (1/m², projected). Beyond that vertex, times the density of the
    /// direction (1/(m² sr), projected). 0 if light paths cannot sample the path.
    density: f32,
    /// True if the path has hit metal or glass.
    passes_metal_or_glass: bool,
}

impl Chain {
    /// A path that light paths cannot sample.
    pub(in crate::integrators) const NONE: Chain = Chain { density: 0.0, passes_metal_or_glass: false };

    /// At a first vertex. `cos` is the cosine between the camera ray and the geometric normal, `width` the pixel width.
    #[inline]
    pub(in crate::integrators) fn at_first(cos: f32, width: f32) -> Self {
        Chain { density: samples_per_area(cos, width), ..Chain::NONE }.checked()
    }

    /// Beyond the first vertex, in a direction with the density `pdf` (1/sr) and the cosine `cos` to the geometric
    /// normal. `pdf` is 0 if no other technique can sample the direction.
    #[inline]
    #[must_use]
    pub(in crate::integrators) fn beyond_first(self, pdf: f32, cos: f32) -> Self {
        if !self.is_open() || pdf == 0.0 {
            return Chain::NONE;
        }
        Chain { density: self.density * projected(pdf, cos), ..self }.checked()
    }

    /// The chain after a vertex on metal or glass.
    #[inline]
    #[must_use]
    pub(in crate::integrators) fn bundled(self) -> Self {
        Chain { passes_metal_or_glass: true, ..self }
    }

    /// True if light paths may sample the path, depending on its next vertices.
    #[inline]
    pub(in crate::integrators) fn is_open(&self) -> bool {
        self.density > 0.0
    }

    /// True if light paths can sample an emitter hit at the next vertex.
    #[inline]
    pub(in crate::integrators) fn is_caustic(&self) -> bool {
        self.is_open() && self.passes_metal_or_glass
    }

    /// MIS weight of the camera path, where light paths have the density `of_light`
    /// ([`super::LightPathGuide::density`]).
    #[inline]
    pub(in crate::integrators) fn camera_weight(&self, of_light: f32) -> f32 {
        1.0 - light_weight(of_light, self.density)
    }

    fn checked(self) -> Self {
        if self.density.is_finite() { self } else { Chain::NONE }
    }
}

/// Density of camera samples (1/m², projected). `width` is the pixel width, `cos` the cosine of the camera ray.
#[inline]
fn samples_per_area(cos: f32, width: f32) -> f32 {
    cos.abs() / (width * width)
}

/// Density per projected solid angle (1/sr).
#[inline]
fn projected(pdf: f32, cos: f32) -> f32 {
    pdf / cos.abs()
}

/// Density of camera paths (1/(m² sr), projected), for the MIS weight of a light path. The camera ray has the cosine
/// `cos_camera` and the pixel width `width`. The next direction has the density `pdf` (1/sr) and the cosine `cos`.
#[inline]
pub(super) fn camera_density(cos_camera: f32, width: f32, pdf: f32, cos: f32) -> f32 {
    Chain::at_first(cos_camera, width).beyond_first(pdf, cos).density
}

/// Weight of a light path by the balance heuristic [Veach 1997, §9.2.2]; 0 if either density is 0.
#[inline]
pub(super) fn light_weight(of_light: f32, of_camera: f32) -> f32 {
    if of_light > 0.0 && of_camera > 0.0 { 1.0 / (1.0 + of_camera / of_light) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_weights_are_one_together_whatever_the_densities() {
        for (light, width) in [(0.0, 1.0), (1e-9, 0.01), (3.0, 0.2), (1e30, 1e-3), (f32::INFINITY, 1.0)] {
            let chain = Chain::at_first(-0.5, width).beyond_first(0.3, -0.7).bundled();
            assert!(chain.is_caustic());
            let weight = light_weight(light, camera_density(0.5, width, 0.3, 0.7));
            assert!((chain.camera_weight(light) + weight - 1.0).abs() < 1e-6, "{light} {width}");
        }
    }

    #[test]
    fn what_light_paths_cannot_find_is_left_to_camera_paths() {
        let first = Chain::at_first(1.0, 1.0);
        assert!(first.is_open() && !first.is_caustic() && first.bundled().is_caustic());
        for none in [Chain::NONE, Chain::at_first(1.0, 0.0), first.beyond_first(1.0, 0.0), first.beyond_first(0.0, 1.0)]
        {
            assert!(!none.is_open() && !none.bundled().is_caustic() && none.camera_weight(5.0) == 1.0, "{none:?}");
        }
        assert_eq!(light_weight(5.0, camera_density(1.0, 1.0, 1.0, 0.0)), 0.0);
    }
}
