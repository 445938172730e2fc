//! Random numbers in ranges.

use lumiris_numbers::math::hash::HashStream;

/// The random numbers of a key.
pub(super) struct Stream(HashStream);

impl Stream {
    pub(super) fn new(key: [u32; 3]) -> Self {
        Stream(HashStream::new(key))
    }

    /// Uniform in `low..high`.
    pub(super) fn within(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.0.next_f32()
    }

    /// An angle (radians).
    pub(super) fn angle(&mut self) -> f32 {
        self.within(0.0, std::f32::consts::TAU)
    }
}
