//! Random numbers by counters.

use lumiris_numbers::math::hash::{pcg4d, unit_f32};

/// The random numbers of a key.
pub(super) struct Stream {
    key: [u32; 3],
    next: u32,
}

impl Stream {
    pub(super) fn new(key: [u32; 3]) -> Self {
        Stream { key, next: 0 }
    }

    /// Uniform in `low..high`.
    pub(super) fn within(&mut self, low: f32, high: f32) -> f32 {
        let [a, b, c] = self.key;
        self.next += 1;
        low + (high - low) * unit_f32(pcg4d([a, b, c, self.next])[0])
    }

    /// An angle (radians).
    pub(super) fn angle(&mut self) -> f32 {
        self.within(0.0, std::f32::consts::TAU)
    }
}
