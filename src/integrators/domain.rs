//! Random-number domains of a path vertex and of its camera sample. Numbers from different domains are independent. The
//! domains below [`DIRECT`] are in `direct/domain.rs`.

/// Direct light.
pub(super) const DIRECT: u32 = 0;
/// The next direction.
pub(super) const BSDF: u32 = 1;
/// Russian roulette.
pub(super) const ROULETTE: u32 = 2;
/// The choice among directions that are resampled, at BSDFs that can only be evaluated.
pub(super) const RESAMPLE: u32 = 3;
/// The albedo of the first surface, a feature for denoisers.
pub(super) const ALBEDO: u32 = 4;
/// The rays of a final gather. They may share numbers with [`ALBEDO`], whose estimate is another channel of the image.
pub(super) const GATHER: u32 = 4;
/// Vertex k uses the domain `VERTEX + k` of the camera sample.
pub(super) const VERTEX: u32 = 16;
/// The segment to vertex k, through media, uses the domain `FLIGHT + k`.
pub(super) const FLIGHT: u32 = 1 << 19;
/// The light for equiangular distance sampling in media.
pub(super) const FOCUS: u32 = 1 << 18;
/// The walk through an interior before vertex k uses the domain `WALK + k`.
pub(super) const WALK: u32 = 1 << 17;
/// The wavelength of the path.
pub(super) const WAVELENGTH: u32 = 1 << 16;
