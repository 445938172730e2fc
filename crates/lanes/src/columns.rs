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

/// Replaces `rows` by the rows below `n` for which `is_kept` is true. There is no branch: nothing predicts which rows
/// contribute.
#[inline]
pub fn select_rows(n: usize, is_kept: impl Fn(usize) -> bool, rows: &mut Vec<u32>) {
    rows.clear();
    rows.resize(n, 0);
    let mut count = 0;
    for i in 0..n {
        rows[count] = i as u32;
        count += usize::from(is_kept(i));
    }
    rows.truncate(count);
}

/// Sets `to[k]` to `from[rows[k]]`.
#[inline]
pub fn gather<T: Copy>(to: &mut [T], from: &[T], rows: &[u32]) {
    for (to, &row) in to.iter_mut().zip(rows) {
        *to = from[row as usize];
    }
}

/// Sets `to[rows[k]]` to `from[k]`.
#[inline]
pub fn scatter<T: Copy>(to: &mut [T], rows: &[u32], from: &[T]) {
    for (&from, &row) in from.iter().zip(rows) {
        to[row as usize] = from;
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

    /// Sets the first `n` vectors to `v`.
    pub fn fill(&mut self, n: usize, v: Vec3) {
        self.0.iter_mut().zip(v.to_array()).for_each(|(column, x)| column[..n].fill(x));
    }

    /// See [`gather`].
    pub fn gather(&mut self, from: &Columns3, rows: &[u32]) {
        self.0.iter_mut().zip(&from.0).for_each(|(to, from)| gather(to, from, rows));
    }

    /// See [`scatter`].
    pub fn scatter(&mut self, rows: &[u32], from: &Columns3) {
        self.0.iter_mut().zip(&from.0).for_each(|(to, from)| scatter(to, rows, from));
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

    /// Adds the first vectors of `other` where `mask` has all bits; 0 leaves a vector as it is.
    pub fn add_masked(&mut self, other: &Columns3, mask: &[u32]) {
        for (sum, column) in self.0.iter_mut().zip(&other.0) {
            for ((sum, value), mask) in sum.iter_mut().zip(column).zip(mask) {
                *sum += f32::from_bits(value.to_bits() & mask);
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_selected_and_added() {
        let mut rows = vec![9; 7];
        select_rows(6, |i| i % 3 != 1, &mut rows);
        assert_eq!(rows, [0, 2, 3, 5]);
        select_rows(4, |_| false, &mut rows);
        assert!(rows.is_empty());

        let (mut values, mut sums) = (Columns3::default(), Columns3::default());
        values.reserve(8);
        sums.reserve(8);
        for i in 0..4 {
            values.set(i, Vec3::splat(if i == 1 { f32::INFINITY } else { i as f32 }));
            sums.set(i, Vec3::ONE);
        }
        sums.add_masked(&values, &[0, 0, u32::MAX]);
        assert_eq!([0, 1, 2, 3].map(|i| sums.vec3(i).x), [1.0, 1.0, 3.0, 1.0]);
    }
}
