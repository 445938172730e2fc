//! Columns of numbers: one number per item of a batch.

use super::lane::LANES;
use lumiris_numbers::math::{Rgb, Vec3};

/// A column.
pub type Column = Vec<f32>;

/// Three columns: the components of vectors, or the channels of colours.
#[derive(Clone, Debug, Default)]
pub struct Columns3([Column; 3]);

/// Length of columns of `n` items, rounded up to whole SIMD vectors.
pub fn padded(n: usize) -> usize {
    n.next_multiple_of(LANES)
}

/// Extends shorter columns to `len`.
pub fn reserve(columns: &mut [&mut Column], len: usize) {
    for column in columns {
        if column.len() < len {
            column.resize(len, 0.0);
        }
    }
}

impl Columns3 {
    /// Extends shorter columns to `len`.
    pub fn reserve(&mut self, len: usize) {
        reserve(&mut self.0.each_mut(), len);
    }

    /// The first `len` numbers of each column.
    pub fn get(&self, len: usize) -> [&[f32]; 3] {
        self.0.each_ref().map(|c| &c[..len])
    }

    /// The first `len` numbers of each column, mutable.
    pub fn get_mut(&mut self, len: usize) -> [&mut [f32]; 3] {
        self.0.each_mut().map(|c| &mut c[..len])
    }

    /// Sets the vector `i`.
    #[inline]
    pub fn set(&mut self, i: usize, v: Vec3) {
        let [x, y, z] = &mut self.0;
        (x[i], y[i], z[i]) = v.into();
    }

    /// Sets the colour `i`.
    #[inline]
    pub fn set_rgb(&mut self, i: usize, c: Rgb) {
        self.set(i, Vec3::from_array(c.to_array()));
    }

    /// The vector `i`.
    #[inline]
    pub fn vec3(&self, i: usize) -> Vec3 {
        let [x, y, z] = &self.0;
        Vec3::new(x[i], y[i], z[i])
    }

    /// The colour `i`.
    #[inline]
    pub fn rgb(&self, i: usize) -> Rgb {
        Rgb::from_array(self.vec3(i).to_array())
    }
}
