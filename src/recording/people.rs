//! Which pixels of a frame show the person who records, or anybody else.

use super::{Grid, HAND_CLASS, Recording};
use crate::error::Result;
use crate::math::{Point, unit};

/// Of a forearm and more, metres.
const ARM_M: f64 = 0.4;
/// Shoulders are below the eyes, metres.
const SHOULDER_M: f64 = 0.3;
/// Points along a forearm.
const ALONG: u32 = 8;
/// Nearer to the camera a limb fills no circle, metres.
const NEAR_M: f64 = 0.05;

/// Mask classes of hands and people.
#[must_use]
pub fn classes(recording: &Recording) -> [bool; 256] {
    let mut hidden = [false; 256];
    hidden[usize::from(HAND_CLASS)] = true;
    for (class, name) in &recording.labels {
        hidden[usize::from(*class)] |= is_of_person(name);
    }
    hidden
}

/// Whether a class is of a person: "left hand", not "hand towel".
fn is_of_person(name: &str) -> bool {
    const PEOPLE: [&str; 12] = [
        "hand", "hands", "arm", "arms", "forearm", "forearms", "finger", "fingers", "person", "people", "human",
        "wearer",
    ];
    const BESIDE: [&str; 6] = ["left", "right", "camera", "the", "of", "s"];
    let name = name.to_lowercase();
    let words = || name.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty());
    words().any(|word| PEOPLE.contains(&word)) && words().all(|word| PEOPLE.contains(&word) || BESIDE.contains(&word))
}

/// Grows what is marked by some samples to all four sides, row by row and column by column.
pub fn grow(marked: &mut [bool], width: usize, reach: usize) {
    let height = marked.len() / width.max(1);
    let mut spread = |start: usize, stride: usize, count: usize| {
        let line: Vec<bool> = (0..count).map(|i| marked[start + i * stride]).collect();
        for at in (0..count).filter(|&i| line[i]) {
            // Only the ends of a run mark anything new.
            let inner = at > 0 && line[at - 1] && at + 1 < count && line[at + 1];
            if !inner {
                for i in at.saturating_sub(reach)..(at + reach + 1).min(count) {
                    marked[start + i * stride] = true;
                }
            }
        }
    };
    (0..height).for_each(|y| spread(y * width, 1, width));
    (0..width).for_each(|x| spread(x, width, height));
}

/// Pixels of a frame that show a person: masks of hands and people, a hundredth of the image larger, as masks end at the
/// skin's edge; and discs of `radius_m` around the joints of tracked hands and along their forearms, as masks may be missing.
///
/// # Errors
/// A mask that cannot be decoded.
pub fn pixels(recording: &Recording, frame: usize, radius_m: f64) -> Result<Grid<bool>> {
    let camera = recording.camera_of(frame);
    let mut marked = match recording.mask(frame)? {
        Some(mask) => {
            let hidden = classes(recording);
            let mut marked: Vec<bool> = mask.data.iter().map(|class| hidden[usize::from(*class)]).collect();
            grow(&mut marked, mask.width, (mask.width / 100).max(1));
            Grid { width: mask.width, height: mask.height, data: marked }
        }
        None => Grid::filled(camera.width, camera.height, false),
    };
    for p in limbs(recording, frame) {
        let Some((u, v)) = camera.project(&p).filter(|_| p.z > NEAR_M) else { continue };
        disc(&mut marked, [u, v], radius_m / p.z * camera.fx);
    }
    Ok(marked)
}

/// Joints of a frame's hands and points along their forearms, camera frame, metres.
fn limbs(recording: &Recording, frame: usize) -> Vec<Point> {
    let Some(from) = recording.frames.get(frame) else { return Vec::new() };
    let camera_from_world = from.world_from_camera.inverse();
    let shoulder = from.center() - recording.up() * SHOULDER_M;
    let mut out = Vec::new();
    for hand in recording.hands_in(frame, frame) {
        let joints = hand.skeleton();
        // The wrist comes first where all joints are known.
        let wrist = if hand.joints.is_some() { joints.first().copied() } else { None };
        let wrist = wrist.unwrap_or_else(|| hand.grasp());
        let along = unit(&(shoulder - wrist)).unwrap_or_default() * ARM_M.min((shoulder - wrist).norm());
        let arm = (0..=ALONG).map(|i| wrist + along * (f64::from(i) / f64::from(ALONG)));
        out.extend(joints.iter().copied().chain(arm).map(|p| camera_from_world * p));
    }
    out
}

/// Marks the pixels of a disc; of one that is larger than the image, all that it covers.
fn disc(marked: &mut Grid<bool>, [u, v]: [f64; 2], radius: f64) {
    if ![u, v, radius].iter().all(|x| x.is_finite()) {
        return;
    }
    let range = |middle: f64, size: usize| {
        let low = (middle - radius).ceil().clamp(0.0, size as f64) as usize;
        let high = ((middle + radius).floor() + 1.0).clamp(0.0, size as f64) as usize;
        low..high.max(low)
    };
    let width = marked.width;
    for y in range(v, marked.height) {
        for x in range(u, width) {
            if (x as f64 - u).hypot(y as f64 - v) <= radius {
                marked.data[y * width + x] = true;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hands_are_of_a_person_and_hand_towels_are_not() {
        for (name, expected) in
            [("left_hand", true), ("Person", true), ("hand towel", false), ("armchair", false), ("left", false)]
        {
            assert_eq!(is_of_person(name), expected, "{name}");
        }
    }

    #[test]
    fn a_mark_grows_to_a_square() {
        let mut marked = vec![false; 49];
        marked[24] = true;
        grow(&mut marked, 7, 2);
        let expected: Vec<bool> = (0..49).map(|i| (1..=5).contains(&(i % 7)) && (1..=5).contains(&(i / 7))).collect();
        assert_eq!(marked, expected);
    }

    #[test]
    fn a_disc_is_cut_off_at_the_image() {
        let mut marked = Grid::filled(6, 4, false);
        disc(&mut marked, [0.0, 1.0], 1.0);
        disc(&mut marked, [90.0, 1.0], 2.0);
        disc(&mut marked, [f64::NAN, 1.0], 2.0);
        let on: Vec<usize> = (0..24).filter(|i| marked.data[*i]).collect();
        assert_eq!(on, [0, 6, 7, 12]);
    }
}
