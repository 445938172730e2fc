//! Points of surfaces in columns.

use crate::lights::GlossyLobe;
use crate::lights::sample_columns::LitPoints;
use lumiris_lanes::columns::Columns3;
use lumiris_lanes::vertex::Ends;

/// Points of surfaces, and Lambertian reflection there.
#[derive(Debug, Default)]
pub struct Surface {
    /// Points.
    pub p: Columns3,
    /// Bounds of their rounding errors.
    pub p_error: Columns3,
    /// Geometric normals; zero if there is no surface.
    pub n: Columns3,
    /// Normals on the lit side; zero if both sides are lit.
    pub facing: Columns3,
    /// Shading normals.
    pub ns: Columns3,
    /// Unit directions to the viewer.
    pub wo: Columns3,
    /// Reflectances; black if the BSDF is not Lambertian.
    pub rho: Columns3,
    /// Lobes used by the choice of lights; empty if it does not use them.
    pub lobes: Vec<GlossyLobe>,
}

impl Surface {
    pub(super) fn reserve(&mut self, len: usize) {
        let Surface { p, p_error, n, facing, ns, wo, rho, lobes: _ } = self;
        [p, p_error, n, facing, ns, wo, rho].into_iter().for_each(|c| c.reserve(len));
    }

    /// The points as input of light sampling.
    pub fn lit_points(&self) -> LitPoints<'_> {
        LitPoints { p: &self.p, n: &self.facing, ns: &self.ns, lobes: &self.lobes }
    }

    /// The first `len` points as ends of segments.
    pub fn ends(&self, len: usize) -> Ends<'_> {
        Ends { p: self.p.get(len), p_error: self.p_error.get(len), n: self.n.get(len) }
    }
}
