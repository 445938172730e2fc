//! The cases of direct light: scenes that replace the paper's, and their settings.

use super::roster::Role;

/// A row of the paper's table.
pub(super) struct Case {
    pub id: &'static str,
    pub title: &'static str,
    pub intro: &'static str,
    pub file: &'static str,
    /// Width and height of the paper's image.
    pub shape: [u32; 2],
    /// Camera rays per pixel, and samples at each.
    pub spp: u32,
    pub samples: u32,
    /// Errors of mis and of ocv in the paper, and the ratio of the time of ocv to mis.
    pub paper: [f64; 2],
    pub paper_time: f64,
    /// Target reduction of the error (percent).
    pub target: f64,
    /// True if the efficiency must be at least as high as with mis.
    pub efficient: bool,
    /// The part of the image for the enlarged view: left, top, right, bottom, in fractions.
    pub crop: [f64; 4],
}

impl Case {
    pub(super) const CHECKERS: Case = Case {
        id: "checkers",
        title: "Checkers",
        intro: "A glossy board with a few things on it, under a large yellow light that it reflects at the left and a small blue one at the \
                right, after figure 2 of the paper: light samples are poor where the board mirrors the large light, BSDF samples everywhere else.",
        file: "checkers.pbrt",
        shape: [500, 500],
        spp: 4,
        samples: 64,
        paper: [0.60, 0.48],
        paper_time: 1.05,
        target: 20.0,
        efficient: false,
        crop: [0.0, 0.3, 0.4, 0.7],
    };
    pub(super) const STATUE: Case = Case {
        id: "statue",
        title: "Statue",
        intro: "A lacquered dragon among large lights, in the place of the Buddha of figure 1: tight highlights, folds that see a part of each light, \
                soft shadows.",
        file: "statue.pbrt",
        shape: [256, 512],
        spp: 4,
        samples: 64,
        paper: [0.72, 0.46],
        paper_time: 1.07,
        target: 36.0,
        efficient: false,
        crop: [0.2, 0.12, 0.9, 0.47],
    };
    pub(super) const ROOM: Case = Case {
        id: "room",
        title: "Room",
        intro: "A room with three small lights and little that hides them, after figure 3: few samples do, and there is little to win.",
        file: "room.pbrt",
        shape: [480, 360],
        spp: 2,
        samples: 18,
        paper: [0.75, 0.68],
        paper_time: 1.16,
        target: 9.0,
        efficient: true,
        crop: [0.3, 0.35, 0.75, 0.85],
    };
}

/// Camera rays of each of the long renderings, and their number.
pub(super) const LONG: (u32, u32) = (16, 4);
/// First turn of long renderings, whose index determines their seed.
pub(super) const LONG_TURNS: u32 = 1_000_000;

/// Methods with antialiased images, and their sampling.
pub(super) const SHOWN: [Role; 4] = [Role::Balance, Role::Progressive, Role::Correlated, Role::Ris];
pub(super) const SHOWN_WAYS: [usize; 2] = [0, 1];
