//! Evaluates animations at a time.
//!
//! All animations of a file are played. If two animate the same property, as the clips of a character do, the first one
//! takes precedence.

use super::messages::Messages;
use glam::Quat;
use lumiris_formats::gltf::{Document, GltfError, Place};
use lumiris_numbers::math::Vec3;
use std::collections::HashMap;

/// Animated properties of a node.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Change {
    pub(super) translation: Option<[f32; 3]>,
    pub(super) rotation: Option<[f32; 4]>,
    pub(super) scale: Option<[f32; 3]>,
    pub(super) weights: Option<Vec<f32>>,
}

/// Changes by node.
pub(super) type Changes = HashMap<usize, Change>;

/// Interpolation between keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

/// Position of a time among the keys.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Position {
    key: usize,
    /// Between this key and the next.
    fraction: f32,
    /// Seconds between them.
    seconds: f32,
}

/// The changes of the nodes by all animations at a time (s).
pub(super) fn changes(document: &Document, time: f32, messages: &mut Messages<'_>) -> Result<Changes, GltfError> {
    let animations = document.root().key("animations");
    if animations.is_empty() {
        messages.warning(&animations, "no animation: the time in the scene changes nothing");
    }
    let (mut changes, mut positions) = (Changes::new(), Positions::new());
    let mut track = |sampler: &Place<'_>| Track::of(document, sampler, time, &mut positions);
    for animation in animations.items() {
        for channel in animation.key("channels").items() {
            let target = channel.key("target");
            let path = target.key("path").text().unwrap_or_default();

            // Target
            let Some(node) = target.key("node").index() else {
                if target.extension("KHR_animation_pointer").exists() {
                    messages.warning(&target, "animations of materials, lights and cameras are not rendered");
                }
                continue;
            };

            // Value at the time; the first channel of a property wins
            let sampler = animation.key("samplers").item(channel.key("sampler").index().unwrap_or(usize::MAX));
            if !sampler.exists() {
                return Err(channel.key("sampler").error("is not there"));
            }
            let change = changes.entry(node).or_default();
            match path {
                "translation" if change.translation.is_none() => {
                    change.translation = Some(vector(&track(&sampler)?, &sampler)?);
                }
                "scale" if change.scale.is_none() => {
                    change.scale = Some(vector(&track(&sampler)?, &sampler)?);
                }
                "rotation" if change.rotation.is_none() => {
                    change.rotation = Some(rotation(&track(&sampler)?, &sampler)?);
                }
                "weights" if change.weights.is_none() => {
                    let track = track(&sampler)?;
                    change.weights = Some(track.at(track.numbers / track.per_key()));
                }
                "translation" | "scale" | "rotation" | "weights" => {}
                other => messages.warning(&target, &format!("an animation of `{other}` is not rendered")),
            }
        }
    }
    Ok(changes)
}

/// Numbers of keys and the position of the time among them, by the accessor of the times, which channels may share.
type Positions = HashMap<usize, (usize, Position)>;

/// The keys of a sampler around a time.
struct Track {
    interpolation: Interpolation,
    position: Position,
    /// Number of values of each key.
    numbers: usize,
    /// All values of the key before the time, and of the next.
    values: Vec<f32>,
}

impl Track {
    fn of(document: &Document, sampler: &Place<'_>, time: f32, positions: &mut Positions) -> Result<Self, GltfError> {
        let index = |name: &'static str| {
            let place = sampler.key(name);
            place.index().ok_or_else(|| place.error("is not there"))
        };

        // Times of the keys, shared between samplers
        let input = index("input")?;
        let (keys, position) = match positions.get(&input) {
            Some(known) => *known,
            None => {
                let times: Vec<f32> = document.accessor(input)?.elements::<1>(0.0).concat();
                if times.is_empty() || !times.is_sorted_by(|a, b| a < b) {
                    return Err(sampler.key("input").error("the times of keys must increase"));
                }
                *positions.entry(input).or_insert((times.len(), position(&times, time)))
            }
        };
        let interpolation = match sampler.key("interpolation").text() {
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::CubicSpline,
            _ => Interpolation::Linear,
        };

        // Only the values of the two keys around the time are read
        let accessor = document.open(index("output")?)?;
        let of_key = accessor.count() / keys;
        let mut track = Track { interpolation, position, numbers: of_key * accessor.width(), values: Vec::new() };
        if of_key == 0 || !accessor.count().is_multiple_of(keys * track.per_key()) {
            return Err(sampler.key("output").error("has not the same number of values for every key"));
        }
        let Position { key, .. } = position;
        track.values = accessor.numbers(key * of_key..(key + 2).min(keys) * of_key).values();
        Ok(track)
    }

    /// Values per number at a key: one, and for splines also the tangents before and after it.
    fn per_key(&self) -> usize {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    /// The `width` numbers of the key before the time (0) or of the next (1). `part` of a spline: tangent before,
    /// value, tangent after.
    fn key(&self, key: usize, part: usize, width: usize) -> &[f32] {
        let first = key * self.numbers + part * width;
        &self.values[first..first + width]
    }

    /// The `width` numbers at the time, interpolated.
    fn at(&self, width: usize) -> Vec<f32> {
        let Position { fraction: s, seconds, .. } = self.position;
        let value = usize::from(self.interpolation == Interpolation::CubicSpline);
        let a = self.key(0, value, width);
        if s == 0.0 {
            return a.to_vec();
        }
        let b = self.key(1, value, width);
        let blend = |weights: [f32; 4], [out, into]: [&[f32]; 2]| {
            let [p0, m0, p1, m1] = weights;
            (0..width).map(|i| p0 * a[i] + m0 * seconds * out[i] + p1 * b[i] + m1 * seconds * into[i]).collect()
        };
        match self.interpolation {
            Interpolation::Step => a.to_vec(),
            Interpolation::Linear => blend([1.0 - s, 0.0, s, 0.0], [a, b]),
            Interpolation::CubicSpline => {
                // Hermite basis functions
                let (s2, s3) = (s * s, s * s * s);
                let weights = [2.0 * s3 - 3.0 * s2 + 1.0, s3 - 2.0 * s2 + s, 3.0 * s2 - 2.0 * s3, s3 - s2];
                blend(weights, [self.key(0, 2, width), self.key(1, 0, width)])
            }
        }
    }

    /// Checks that there are `width` numbers at each key.
    fn has(&self, width: usize, sampler: &Place<'_>) -> Result<(), GltfError> {
        if self.numbers == self.per_key() * width {
            return Ok(());
        }
        Err(sampler.key("output").error(format!("has not {width} numbers for each key")))
    }
}

fn vector(track: &Track, sampler: &Place<'_>) -> Result<[f32; 3], GltfError> {
    track.has(3, sampler)?;
    Ok(Vec3::from_slice(&track.at(3)).to_array())
}

/// Linear rotations have a constant angular speed along the shorter arc.
fn rotation(track: &Track, sampler: &Place<'_>) -> Result<[f32; 4], GltfError> {
    track.has(4, sampler)?;
    let fraction = track.position.fraction;
    if track.interpolation != Interpolation::Linear || fraction == 0.0 {
        return Ok(Quat::from_slice(&track.at(4)).to_array());
    }
    let [a, b] = [0, 1].map(|i| Quat::from_slice(track.key(i, 0, 4)).normalize());
    Ok(a.slerp(b, fraction).to_array())
}

/// Before the first key and after the last, the value of that key holds.
fn position(times: &[f32], time: f32) -> Position {
    let key = times.partition_point(|t| *t <= time).saturating_sub(1);
    match times.get(key + 1) {
        Some(next) if time > times[key] => {
            let seconds = next - times[key];
            Position { key, fraction: (time - times[key]) / seconds, seconds }
        }
        _ => Position { key, fraction: 0.0, seconds: 0.0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(interpolation: Interpolation, times: &[f32], values: &[f32], time: f32) -> Track {
        let (position, numbers) = (position(times, time), values.len() / times.len());
        Track { interpolation, position, numbers, values: values[position.key * numbers..].to_vec() }
    }

    #[test]
    fn times_outside_of_the_keys_are_those_of_the_ends() {
        let at = |time| track(Interpolation::Linear, &[1.0, 2.0, 4.0], &[10.0, 20.0, 0.0], time).at(1)[0];
        assert_eq!([0.0, 1.0, 1.25, 2.0, 3.0, 4.0, 9.0].map(at), [10.0, 10.0, 12.5, 20.0, 10.0, 0.0, 0.0]);
        let at = |time| track(Interpolation::Step, &[1.0, 2.0], &[10.0, 20.0], time).at(1)[0];
        assert_eq!([0.0, 1.9, 2.0].map(at), [10.0, 10.0, 20.0]);
    }

    #[test]
    fn splines_have_the_values_and_slopes_of_their_keys() {
        // t³ between 0 and 2: slopes 0 and 12
        let values = [0.0, 0.0, 0.0, 12.0, 8.0, 0.0];
        let at = |time| track(Interpolation::CubicSpline, &[0.0, 2.0], &values, time).at(1)[0];
        for time in [0.0, 0.5, 1.0, 1.7, 2.0] {
            assert!((at(time) - time.powi(3)).abs() < 1e-5, "{time}: {}", at(time));
        }
    }
}
