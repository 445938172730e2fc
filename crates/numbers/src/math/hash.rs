//! Counter-based hashes: stateless random numbers.

/// Permutes four 32-bit words; each output word is a good hash of all inputs [Jarzynski and Olano 2020, pcg4d].
#[inline]
pub fn pcg4d(mut v: [u32; 4]) -> [u32; 4] {
    for x in &mut v {
        *x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    }
    let mix = |v: &mut [u32; 4]| {
        v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[3]));
        v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
        v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
        v[3] = v[3].wrapping_add(v[1].wrapping_mul(v[2]));
    };
    mix(&mut v);
    for x in &mut v {
        *x ^= *x >> 16;
    }
    mix(&mut v);
    v
}

/// Uniform f32 in [0, 1) from the 24 high bits.
#[inline]
pub fn unit_f32(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Hash of the bits of a tuple of floats, for decisions that must depend on geometry only.
#[inline]
pub fn hash_floats(values: &[f32]) -> u32 {
    let mut state = [0x9e37_79b9, 0x85eb_ca6b, 0xc2b2_ae35, values.len() as u32];
    for chunk in values.chunks(3) {
        for (word, value) in state.iter_mut().zip(chunk) {
            *word ^= value.to_bits();
        }
        state = pcg4d(state);
    }
    state[0]
}

/// A small sequential generator over [`pcg4d`], for random walks of unknown length.
#[derive(Clone, Copy, Debug)]
pub struct HashStream {
    key: [u32; 3],
    counter: u32,
    block: [u32; 4],
}

impl HashStream {
    /// The stream of a key; equal keys give equal numbers.
    #[inline]
    pub fn new(key: [u32; 3]) -> Self {
        HashStream { key, counter: 0, block: [0; 4] }
    }

    /// The next uniform in [0, 1).
    #[inline]
    pub fn next_f32(&mut self) -> f32 {
        let lane = (self.counter & 3) as usize;
        if lane == 0 {
            self.block = pcg4d([self.key[0], self.key[1], self.key[2], self.counter >> 2]);
        }
        self.counter += 1;
        unit_f32(self.block[lane])
    }

    /// The next two uniforms in [0, 1).
    #[inline]
    pub fn next_2d(&mut self) -> [f32; 2] {
        [self.next_f32(), self.next_f32()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stream_is_uniform_by_chi_squared() {
        let mut counts = [0_u32; 64];
        let mut stream = HashStream::new([1, 2, 3]);
        for _ in 0..64_000 {
            counts[(stream.next_f32() * 64.0) as usize] += 1;
        }
        let chi2: f64 = counts.iter().map(|&c| (f64::from(c) - 1000.0).powi(2) / 1000.0).sum();
        // 63 degrees of freedom: the 0.001 quantiles are 33.9 and 103.4.
        assert!((33.9..103.4).contains(&chi2), "{chi2}");
    }
}
