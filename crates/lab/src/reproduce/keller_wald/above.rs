//! Points of a scene from above: their density in each square of the floor plan. x is to the right, y upwards.

use super::super::images::{HEAT, Image, Scale};
use lumiris_numbers::math::{Bounds3, Vec3};

/// A raster over the x and y of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plan {
    /// The corner with the minimum x and y (m).
    low: [f64; 2],
    /// Edge of a square (m).
    edge: f64,
    /// Squares along x and y.
    size: [u32; 2],
}

/// A part of the floor: minimum and maximum x and y (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    /// Minimum x and y.
    pub low: [f32; 2],
    /// Maximum x and y.
    pub high: [f32; 2],
}

impl Area {
    /// True if a point is above or below the area.
    pub(super) fn holds(&self, p: Vec3) -> bool {
        let inside = |i: usize| self.low[i] <= p[i] && p[i] < self.high[i];
        inside(0) && inside(1)
    }

    /// Number of points above or below the area.
    pub(super) fn count(&self, points: &[Vec3]) -> u64 {
        points.iter().filter(|&&p| self.holds(p)).count() as u64
    }
}

impl Plan {
    /// A raster that covers the bounds, with `longer` squares along the longer side.
    pub(super) fn new(bounds: &Bounds3, longer: u32) -> Self {
        let extent = [0, 1].map(|i| f64::from((bounds.max[i] - bounds.min[i]).max(1e-3)));
        let longer = longer.max(1);
        let edge = extent[0].max(extent[1]) * 1.0001 / f64::from(longer);
        let size = extent.map(|e| ((e / edge).ceil() as u32).clamp(1, longer));
        Plan { low: [0, 1].map(|i| f64::from(bounds.min[i])), edge, size }
    }

    /// The square below a point, counted row by row from the top left; `None` outside.
    fn square(&self, p: Vec3) -> Option<usize> {
        let at = [0, 1].map(|i| ((f64::from(p[i]) - self.low[i]) / self.edge).floor());
        let inside = (0..2).all(|i| at[i] >= 0.0 && at[i] < f64::from(self.size[i]));
        let [column, row] = at.map(|v| v as usize);
        inside.then(|| (self.size[1] as usize - 1 - row) * self.size[0] as usize + column)
    }

    /// Points per square metre of the floor.
    pub(super) fn density(&self, points: &[Vec3]) -> Vec<f64> {
        let mut density = vec![0.0; (self.size[0] * self.size[1]) as usize];
        let each = 1.0 / (self.edge * self.edge);
        points.iter().filter_map(|&p| self.square(p)).for_each(|i| density[i] += each);
        density
    }

    /// Densities as colours.
    pub(super) fn image(&self, density: &[f64], scale: &Scale) -> Image {
        Image::colored(self.size, density, scale)
    }

    /// A common scale for several images: from the density of a single point to the 95th percentile of the squares,
    /// which are walls.
    pub(super) fn scale(&self, densities: &[&[f64]]) -> Scale {
        let mut sorted: Vec<f64> = densities.iter().flat_map(|d| d.iter().copied()).filter(|v| *v > 0.0).collect();
        sorted.sort_by(f64::total_cmp);
        let high = sorted.get(sorted.len().saturating_sub(1 + sorted.len() / 20)).copied().unwrap_or(1.0);
        Scale::new(HEAT, 0.5 / (self.edge * self.edge), high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Plan {
        Plan::new(&Bounds3 { min: Vec3::new(-1.0, 0.0, 0.0), max: Vec3::new(3.0, 2.0, 1.0) }, 4)
    }

    #[test]
    fn points_count_in_the_square_below_them_and_the_greatest_y_is_on_top() {
        let plan = plan();
        assert_eq!(plan.size, [4, 2]);
        let points = [Vec3::new(-0.5, 0.5, 0.0), Vec3::new(-0.5, 0.5, 0.9), Vec3::new(2.5, 1.5, 0.0)];
        let density = plan.density(&points);
        assert_eq!(density.iter().map(|d| d.round()).collect::<Vec<_>>(), [0.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0]);
        // Points outside do not count
        assert_eq!(plan.density(&[Vec3::new(5.0, 0.0, 0.0), Vec3::splat(f32::NAN)]), [0.0; 8]);
        let area = Area { low: [-1.0, 0.0], high: [0.0, 2.0] };
        assert_eq!(area.count(&points), 2);
    }

    #[test]
    fn the_scale_begins_below_a_single_point() {
        let plan = plan();
        let density = plan.density(&[Vec3::new(0.5, 0.5, 0.0)]);
        let scale = plan.scale(&[&density]);
        assert!(scale.color(density[5]).iter().sum::<f64>() > scale.color(0.0).iter().sum::<f64>());
    }
}
