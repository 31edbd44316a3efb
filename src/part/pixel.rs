//! What the depth of one pixel tells of a place: how likely it is where a surface is there, and where the view goes on (ours).
//!
//! One model for everything that asks depth about a part: candidates, openings, outlines, parts that were left ajar. A depth is
//! the surface's with its noise, or something before it (an arm, a hand, another door), or something behind it.

use crate::config;
use crate::recording::{DepthNoise, Recording};

/// How far depth is off the surfaces that are asked about, and what else a pixel may show: `part.pixel` of the config, as the
/// densities take it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    depth: DepthNoise,
    /// Standard deviations of depth within which it counts as a surface's.
    depth_stds: f64,
    /// Of the surface itself, metres: fronts are taken for planes, and none is found exactly.
    surface_m: f64,
    /// How far its points are off the plane that fits it best, metres.
    flat_m: f64,
    /// Standard deviations behind a place at which a surface is as likely another one's.
    there_stds: f64,
    /// Share of pixels in which something hides what is expected.
    before: f64,
    /// Share that meets a surface where the view is expected to go on.
    blocked: f64,
    /// Share that shows a surface where one is expected.
    shown: f64,
    /// Share that goes on where the view is expected to.
    passed: f64,
    /// Over this far behind a surface a depth may lie anywhere, metres.
    room_m: f64,
    /// What furniture is deep, metres.
    inside_m: f64,
    /// What is seen of a tray's inside behind the closed front, metres.
    tray_m: f64,
    /// Likelihood (1/m) of what is seen behind where a surface is expected.
    behind_per_m: f64,
    /// The same where the view goes on, within furniture; half of it beyond.
    free_per_m: f64,
}

impl Noise {
    /// The recording's own; what is assumed where it does not tell it.
    #[must_use]
    pub fn of(recording: &Recording, config: &config::Part) -> Self {
        let assumed = DepthNoise { floor_m: config.assumed_floor_m, per_m: config.assumed_per_m };
        Self::new(recording.depth_factors.noise.unwrap_or(assumed), config)
    }

    pub(super) fn new(depth: DepthNoise, config: &config::Part) -> Self {
        let config::PixelOdds { before, behind, blocked, room_m, inside_m, tray_m } = config.pixel;
        let passed = 1.0 - before - blocked;
        Self {
            depth,
            depth_stds: config.depth_stds,
            surface_m: config.surface_m,
            flat_m: config.flat_m,
            there_stds: config.there_stds,
            before,
            blocked,
            shown: 1.0 - before - behind,
            passed,
            room_m,
            inside_m,
            tray_m,
            behind_per_m: behind / room_m,
            free_per_m: passed / (inside_m + 0.5 * (room_m - inside_m)),
        }
    }

    /// Over this far behind a surface a depth may lie anywhere, metres.
    pub(super) fn room_m(&self) -> f64 {
        self.room_m
    }

    /// So far from a surface at distance `z` depth may be and still show it, metres.
    pub(super) fn tolerance(&self, z: f64) -> f64 {
        self.depth_stds * self.shared_std(z)
    }

    /// The same where what all pixels of a surface share is accounted for, metres.
    pub(super) fn tight(&self, z: f64) -> f64 {
        self.depth_stds * self.own_std(z)
    }

    /// Standard deviation of depth at one point of a surface, metres: of depth, which bends over a few decimetres, and of the surface,
    /// which is no plane.
    pub(super) fn own_std(&self, z: f64) -> f64 {
        self.flat_m.hypot(self.depth.std_m(z))
    }

    /// Of what all points of a surface share in a view, metres: of its own place, and of the view's depth.
    pub(super) fn shared_std(&self, z: f64) -> f64 {
        self.surface_m.hypot(self.depth.std_m(z))
    }

    /// Of a front's plane, metres.
    pub(super) fn surface_std(&self) -> f64 {
        self.surface_m
    }

    /// Likelihood (1/m) of a depth where a surface is expected.
    pub(super) fn surface(&self, depth: f64, expected: f64) -> f64 {
        self.shown * self.near(depth, expected)
            + if depth < expected { self.before / expected } else { self.behind_per_m }
    }

    /// Likelihood (1/m) of a depth where the view goes on behind a place.
    pub(super) fn through(&self, depth: f64, place: f64) -> f64 {
        let beyond = if depth < place { self.before / place } else { self.free(depth - place) };
        self.blocked * self.near(depth, place) + beyond
    }

    /// Likelihood (1/m) of a depth where the view passes a drawer's front at `leaf` and its closed place at `front`: between
    /// them, or some way behind, it meets the tray and what lies in it.
    pub(super) fn tray(&self, depth: f64, leaf: f64, front: f64) -> f64 {
        match depth {
            d if d < leaf => self.before / leaf,
            d if d < front + self.tray_m => self.passed / (front + self.tray_m - leaf),
            _ => self.blocked / self.room_m,
        }
    }

    /// Whether a surface that is seen so far `behind` a place at distance `z` (metres, across the surface; negative: before it) is
    /// that place's: from 1, it is, to -1, the view goes on there. What hides the place says nothing, zero.
    ///
    /// For outlines, cell by cell. What is seen through a cell beside a part is mostly the next front, a few centimetres behind:
    /// log odds against anything in the room call that a surface too often.
    pub(super) fn there(&self, behind: f64, z: f64) -> f64 {
        let x = (behind / (self.there_stds * self.shared_std(z))).powi(2);
        let miss = x / (x + 1.0);
        if behind > 0.0 { 1.0 - 2.0 * miss } else { 1.0 - miss }
    }

    /// Density (1/m) of the depth of a surface: a top as flat as the tolerance is wide.
    fn near(&self, depth: f64, expected: f64) -> f64 {
        density(depth - expected, self.tolerance(expected))
    }

    /// Density (1/m) of what is seen so far behind a place where the view goes on.
    fn free(&self, behind: f64) -> f64 {
        if behind < self.inside_m { self.free_per_m } else { 0.5 * self.free_per_m }
    }
}

/// A density (1/m) that is flat within `width` of zero and falls steeply beyond it: 1 / (1 + x^8), scaled.
fn density(off: f64, width: f64) -> f64 {
    /// Arithmetic: the integral of 1 / (1 + x^8).
    const AREA: f64 = 2.052_344_305_954_062;
    let x2 = (off / width).powi(2);
    let x4 = x2 * x2;
    1.0 / (AREA * width * (1.0 + x4 * x4))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_are_densities_and_odds_fall_from_a_surface_to_what_is_seen_through() {
        let noise = Noise::new(DepthNoise { floor_m: 0.005, per_m: 0.008 }, &config::Part::default());
        for of in [Noise::surface, Noise::through] {
            // Up to the room's end.
            let sum: f64 = (0..55_000).map(|i| of(&noise, f64::from(i) * 1e-4, 1.5) * 1e-4).sum();
            assert!((0.97..1.03).contains(&sum), "{sum}");
        }
        let odds = |noise: &Noise, depth: f64| (noise.surface(depth, 1.5) / noise.through(depth, 1.5)).ln();
        let [on, behind, hidden] = [1.5, 2.0, 1.0].map(|depth| odds(&noise, depth));
        assert!(on > 1.0 && behind < -1.0 && hidden.abs() < 0.01, "{on} {behind} {hidden}");
        // Noisier depth tells less of a surface, and takes more for one.
        let noisy = Noise::new(DepthNoise { floor_m: 0.02, per_m: 0.02 }, &config::Part::default());
        assert!(odds(&noisy, 1.5) < on && odds(&noisy, 1.65) > odds(&noise, 1.65));
        let [on, behind, hidden] = [0.0, 0.5, -0.5].map(|d| noise.there(d, 1.5));
        assert!(on == 1.0 && behind < -0.9 && hidden.abs() < 0.05, "{on} {behind} {hidden}");
        assert!(noisy.there(0.05, 1.5) > noise.there(0.05, 1.5));
    }
}
