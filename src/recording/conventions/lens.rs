//! Intrinsics against depth and poses: those of an image of another size, or of another camera.
//!
//! Depth that is seen through a wrong focal length lies too far apart or too close together, and misses what other frames see of
//! the same places. A wrong scale of the positions does so too: both are compared.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::agreement::{Candidate, Pair, mean, nats};
use super::looks::FrameLook;
use super::{Finding, LIKELY_NATS, Subject};
use crate::recording::Camera;

/// What focal lengths could have to be multiplied by: images are halved, doubled, scaled by two or three quarters; and a ladder
/// between.
const FACTORS: [f64; 10] = [0.4, 0.5, 0.58, 2.0 / 3.0, 0.75, 4.0 / 3.0, 1.5, 1.75, 2.0, 2.5];
/// Between the rungs of the ladder.
const BETWEEN: [f64; 4] = [0.88, 0.94, 1.06, 1.12];
/// Scales of the positions that are tried with each: those that are nobody's error ([`super::poses`]).
const SCALES: [f64; 5] = [1.0, 0.72, 0.85, 1.18, 1.4];
/// Focal lengths within are those of a camera that was calibrated badly or not at all, which costs little.
const RIGHT: std::ops::Range<f64> = 0.8..1.25;
/// A principal point is nearer to the middle than this share of the image's width, or was moved.
const MIDDLE: f64 = 0.05;
/// Log of the kinds of lenses, and what a ladder gains by chance.
const CHANCE_NATS: f64 = 2.0;

/// Intrinsics that could be meant, by what the declared focal lengths are multiplied with.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Lens {
    /// The principal point is right.
    Focal(f64),
    /// The principal point is multiplied too: the intrinsics are of an image of another size.
    Resized(f64),
    /// The principal point is the middle of the image.
    Middle(f64),
}

impl Lens {
    fn factor(self) -> f64 {
        match self {
            Self::Focal(f) | Self::Resized(f) | Self::Middle(f) => f,
        }
    }

    fn times(self, by: f64) -> Self {
        match self {
            Self::Focal(f) => Self::Focal(f * by),
            Self::Resized(f) => Self::Resized(f * by),
            Self::Middle(f) => Self::Middle(f * by),
        }
    }

    fn of(self, declared: &Camera) -> Camera {
        let factor = self.factor();
        let (cx, cy) = match self {
            Self::Focal(_) => (declared.cx, declared.cy),
            // From the corner of the image.
            Self::Resized(f) => (f * (declared.cx + 0.5) - 0.5, f * (declared.cy + 0.5) - 0.5),
            Self::Middle(_) => middle(declared),
        };
        Camera { fx: factor * declared.fx, fy: factor * declared.fy, cx, cy, ..*declared }
    }

    /// What is wrong, and what sets it right.
    fn words(self, declared: &Camera) -> (String, String) {
        let (factor, (mx, my)) = (self.factor(), middle(declared));
        let (cx, cy) = (declared.cx, declared.cy);
        let centre =
            format!("the principal point ({cx:.0}, {cy:.0}) is not the middle of the images ({mx:.0}, {my:.0})");
        let focal = format!("fx and fy are {:.2} times what depth and poses need", 1.0 / factor);
        match self {
            Self::Focal(_) => (focal, format!("multiply fx and fy by {factor:.2}")),
            Self::Resized(_) => (
                format!("the intrinsics are of images {:.2} times as large", 1.0 / factor),
                format!("multiply fx, fy, cx and cy by {factor:.2}"),
            ),
            Self::Middle(1.0) => (centre, "put cx and cy in the middle of the images".to_owned()),
            Self::Middle(_) => (
                format!("{focal}, and {centre}"),
                format!("multiply fx and fy by {factor:.2} and put cx and cy in the middle of the images"),
            ),
        }
    }
}

fn middle(camera: &Camera) -> (f64, f64) {
    (0.5 * (camera.width as f64 - 1.0), 0.5 * (camera.height as f64 - 1.0))
}

/// All that are compared, the simplest first.
fn lenses(declared: &Camera) -> Vec<Lens> {
    let (mx, my) = middle(declared);
    let is_moved = (declared.cx - mx).hypot(declared.cy - my) > MIDDLE * declared.width as f64;
    let mut all: Vec<Lens> = if is_moved { vec![Lens::Middle(1.0)] } else { Vec::new() };
    all.extend(FACTORS.map(Lens::Focal));
    all.extend(FACTORS.map(Lens::Resized));
    if is_moved {
        all.extend(FACTORS.map(Lens::Middle));
    }
    all
}

/// A lens and a scale of the positions, with the share of places that meet, of each pair.
struct Rated {
    lens: Lens,
    scale: f64,
    shares: Vec<f64>,
}

/// The share of places that meet through a lens, of each pair.
fn shares(lens: Lens, scale: f64, subject: &Subject, looks: &[FrameLook], pairs: &[Pair]) -> Vec<f64> {
    let camera = lens.of(&subject.camera);
    let seen: Vec<FrameLook> = looks.iter().map(|look| look.through(&camera)).collect();
    Candidate { poses: &subject.poses, axes: Matrix3::identity(), scale, lag: 0 }.shares(&seen, pairs)
}

/// Other intrinsics, where they explain clearly more than the declared ones do under any reading of the poses (`rival`, shares
/// of each pair as `declared`).
pub(super) fn judge(
    subject: &Subject,
    looks: &[FrameLook],
    pairs: &[Pair],
    declared: &[f64],
    rival: &[f64],
) -> Option<Finding> {
    let rate = |lens: Lens| {
        let at = |scale: f64| Rated { lens, scale, shares: shares(lens, scale, subject, looks, pairs) };
        SCALES.into_iter().map(at).reduce(|a, b| if mean(&b.shares) > mean(&a.shares) { b } else { a })
    };
    let all: Vec<Rated> = lenses(&subject.camera).into_par_iter().filter_map(rate).collect();
    let gain = |a: &[f64], b: &[f64]| nats(a, b, pairs, looks.len());
    let top = all.iter().reduce(|a, b| if mean(&b.shares) > mean(&a.shares) { b } else { a })?;
    // Of those that are nearly as good the simplest one.
    let is_as_good = |r: &&Rated| gain(&top.shares, &r.shares) < 0.5 && mean(&r.shares) > 0.98 * mean(&top.shares);
    let best = all.iter().find(is_as_good)?;
    let mut exact = best.lens;
    if exact.factor() != 1.0 {
        let mut most = mean(&best.shares);
        for lens in BETWEEN.map(|by| best.lens.times(by)) {
            let found = mean(&shares(lens, best.scale, subject, looks, pairs));
            if found > most {
                (exact, most) = (lens, found);
            }
        }
    }
    let is_other = exact.factor() == 1.0 || !RIGHT.contains(&exact.factor());
    let sure = gain(&best.shares, declared) - CHANCE_NATS;
    if !is_other || sure < LIKELY_NATS || gain(&best.shares, rival) < LIKELY_NATS {
        return None;
    }
    let (what, remedy) = best.lens.words(&subject.camera);
    Some(Finding {
        what,
        evidence: format!(
            "depth of one frame, moved by the poses, meets another frame's at {:.0} % of the places as declared, at {:.0} % through \
             such a lens ({} frames, {} pairs)",
            100.0 * mean(declared),
            100.0 * mean(&best.shares),
            looks.len(),
            pairs.len()
        ),
        remedy: format!(
            "{remedy}: images or depth were resized, or the intrinsics are of another camera (cameras.json; paws import --camera \
             WIDTH,HEIGHT,FX,FY,CX,CY)"
        ),
        nats: sure,
        ruinous: true,
        // Depth tells the factor to a tenth.
        fix: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Camera = Camera { width: 640, height: 480, fx: 400.0, fy: 410.0, cx: 319.5, cy: 239.5 };

    #[test]
    fn a_resized_image_has_its_intrinsics_scaled_from_the_corner() {
        let half = Lens::Resized(0.5).of(&CAMERA);
        assert_eq!((half.fx, half.fy, half.cx, half.cy), (200.0, 205.0, 159.5, 119.5));
        assert_eq!((half.width, half.height), (640, 480));
        let (what, remedy) = Lens::Resized(0.5).words(&CAMERA);
        assert!(what.contains("2.00 times as large") && remedy.contains("by 0.50"), "{what} {remedy}");
    }

    #[test]
    fn the_middle_is_asked_about_only_where_the_principal_point_is_elsewhere() {
        assert!(!lenses(&CAMERA).iter().any(|l| matches!(l, Lens::Middle(_))));
        let moved = Camera { cx: 160.0, ..CAMERA };
        assert_eq!(lenses(&moved).first(), Some(&Lens::Middle(1.0)));
    }
}
