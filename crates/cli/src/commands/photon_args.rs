//! Options of photon maps.

use clap::Args;
use lumiris::scene::{Deposition, PhotonMapSettings, Shrinking};

/// Options of `--integrator photon-map`.
#[derive(Args, Clone, Copy, Debug)]
pub struct PhotonArgs {
    /// Photons that the global map stores, in each pass if progressive [default: the file's, or 200000]
    #[arg(long, help_heading = "Photon maps", value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub photons: Option<u32>,
    /// Share q of the trajectories that fill the global map too; all fill the caustic map [default: the file's, or 0.2]
    #[arg(long, help_heading = "Photon maps", value_name = "Q", value_parser = parse_ratio)]
    pub caustic_ratio: Option<f32>,
    /// Store photons by visual importance: none, floor:E (with the probability p(x), at least E), or cut-off:E (biased: none
    /// where p(x) is below E) [default: the file's, or none]
    #[arg(long, help_heading = "Photon maps", value_name = "WHICH", value_parser = parse_deposition)]
    pub importance: Option<Deposition>,
    /// Photons of an estimate [default: the file's, or 50]
    #[arg(long, help_heading = "Photon maps", value_name = "K", value_parser = clap::value_parser!(u32).range(2..=100_000))]
    pub nearest: Option<u32>,
    /// Rays of the final gather at a diffuse point; 0 shows the global map directly [default: the file's, or 4]
    #[arg(long, help_heading = "Photon maps", value_name = "G", value_parser = clap::value_parser!(u32).range(0..=4096))]
    pub gather: Option<u32>,
    /// Share of these rays whose directions photons choose [default: the file's, or 0]
    #[arg(long, help_heading = "Photon maps", value_name = "SHARE", value_parser = parse_guide)]
    pub gather_guide: Option<f32>,
    /// New photons and smaller radii from sample to sample, so that the picture converges: r² falls with the power ALPHA - 1
    /// [default: the file's; ALPHA: 0.5]; off for one map where the file asks for sppm
    #[arg(long, help_heading = "Photon maps", value_name = "ALPHA", num_args = 0..=1, default_missing_value = "0.5", value_parser = parse_alpha)]
    pub progressive: Option<Progressive>,
    /// First radius of a progressive map [default: how far the nearest K photons reach where the camera looks]
    #[arg(long, help_heading = "Photon maps", value_name = "METRES", value_parser = parse_radius)]
    pub photon_radius: Option<f32>,
    /// Photons that tell which lights are seen, for --light-choice photons, --target visibility and --estimator contributing
    /// [default: the file's, or 512 for each light, at least 262144]
    #[arg(long, help_heading = "Photon maps", value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub light_photons: Option<u32>,
    /// Most trajectories for one map: with importance it can take many to store what was asked for [default: 1073741824]
    #[arg(long, help_heading = "Photon maps", value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub photon_paths: Option<u64>,
    /// Most memory of the maps, such as 800M or 4G [default: 4G]
    #[arg(long, help_heading = "Photon maps", value_name = "BYTES", value_parser = parse_bytes)]
    pub memory: Option<u64>,
}

/// `--progressive`
#[derive(Clone, Copy, Debug)]
pub enum Progressive {
    /// One map.
    Off,
    /// Radii that shrink with this α.
    On(f32),
}

impl PhotonArgs {
    /// Puts the options in.
    pub fn apply(&self, s: &mut PhotonMapSettings) {
        let or = |value: &mut u32, option: Option<u32>| *value = option.unwrap_or(*value);
        or(&mut s.photons, self.photons);
        or(&mut s.nearest, self.nearest);
        or(&mut s.gather, self.gather);
        s.caustic_ratio = self.caustic_ratio.unwrap_or(s.caustic_ratio);
        s.deposition = self.importance.unwrap_or(s.deposition);
        s.guide = self.gather_guide.unwrap_or(s.guide);
        s.light_photons = self.light_photons.or(s.light_photons);
        s.trajectories = self.photon_paths.unwrap_or(s.trajectories);
        s.memory = self.memory.unwrap_or(s.memory);
        match self.progressive {
            None => {}
            Some(Progressive::Off) => s.progressive = None,
            Some(Progressive::On(alpha)) => {
                s.progressive = Some(Shrinking { alpha, ..s.progressive.unwrap_or_default() });
            }
        }
        if let (Some(radius), Some(shrinking)) = (self.photon_radius, &mut s.progressive) {
            shrinking.radius = Some(radius);
        }
    }
}

fn parse_within(text: &str, is_valid: impl Fn(f32) -> bool, expected: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if is_valid(value) => Ok(value),
        _ => Err(format!("expected {expected}")),
    }
}

fn parse_ratio(text: &str) -> Result<f32, String> {
    parse_within(text, PhotonMapSettings::is_ratio, "a number above 0 and up to 1")
}

fn parse_alpha(text: &str) -> Result<Progressive, String> {
    match text {
        "off" => Ok(Progressive::Off),
        _ => parse_within(text, Shrinking::is_alpha, "a number above 0 and below 1, or off").map(Progressive::On),
    }
}

fn parse_guide(text: &str) -> Result<f32, String> {
    parse_within(text, PhotonMapSettings::is_guide, "a number from 0 to 0.95")
}

fn parse_radius(text: &str) -> Result<f32, String> {
    parse_within(text, |r| r > 0.0 && r.is_finite(), "a positive number of metres")
}

fn parse_deposition(text: &str) -> Result<Deposition, String> {
    let (name, least) = text.split_once(':').unwrap_or((text, "0.01"));
    let least = parse_within(least, Deposition::is_least, "a probability above 0 and up to 1 after the colon");
    match name {
        "none" => Ok(Deposition::All),
        "floor" => Ok(Deposition::Floor(least?)),
        "cut-off" => Ok(Deposition::CutOff(least?)),
        _ => Err("expected none, floor:E or cut-off:E, such as floor:0.01".to_owned()),
    }
}

fn parse_bytes(text: &str) -> Result<u64, String> {
    let expected = || "expected a number of bytes, such as 4000000, 800M or 4G".to_owned();
    let (digits, shift) = match text.trim_end_matches(['B', 'b', 'i']) {
        t if t.ends_with(['k', 'K']) => (&t[..t.len() - 1], 10),
        t if t.ends_with(['m', 'M']) => (&t[..t.len() - 1], 20),
        t if t.ends_with(['g', 'G']) => (&t[..t.len() - 1], 30),
        t => (t, 0),
    };
    let bytes = digits.trim().parse::<f64>().map_err(|_| expected())? * f64::from(1_u32 << shift);
    if (1.0..1e18).contains(&bytes) { Ok(bytes as u64) } else { Err(expected()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!(parse_bytes("1234"), Ok(1234));
        assert_eq!(parse_bytes("800M"), Ok(800 << 20));
        assert_eq!(parse_bytes("1.5GiB"), Ok(3 << 29));
        for wrong in ["", "G", "-1", "0", "1e30", "lots"] {
            assert!(parse_bytes(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn depositions_have_a_least_probability() {
        assert_eq!(parse_deposition("none"), Ok(Deposition::All));
        assert_eq!(parse_deposition("floor:0.2"), Ok(Deposition::Floor(0.2)));
        assert_eq!(parse_deposition("cut-off"), Ok(Deposition::CutOff(0.01)));
        for wrong in ["floor:0", "floor:2", "cut-off:", "most"] {
            assert!(parse_deposition(wrong).is_err(), "{wrong}");
        }
    }
}
