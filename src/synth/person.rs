//! A person with a camera on the head who opens and closes parts of a kitchen.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::kitchen::{Kitchen, OpenPart, limb};
use crate::articulation::{Action, JointKind};
use crate::math::{Point, Pose, Vector, unit};
use crate::twin::OrientedBox;

/// One frame as it really was.
#[derive(Debug, Clone)]
pub struct TrueFrame {
    /// Seconds.
    pub time_secs: f64,
    /// Camera.
    pub world_from_camera: Pose,
    /// Opening of every part.
    pub openings: Vec<f64>,
    /// Boxes of hand and arm; empty where none is near.
    pub hand: Vec<OrientedBox>,
    /// Where the fingertips are, and the wrist.
    pub grasp: Option<(Point, Point)>,
    /// Whether the hand holds a part.
    pub contact: bool,
    /// No interaction: such frames get a normals file.
    pub is_still: bool,
}

impl TrueFrame {
    /// A frame with a hand, which reaches from the shoulder to its grasp.
    pub(super) fn with_hand(
        time_secs: f64,
        world_from_camera: Pose,
        openings: &[f64],
        grasp: Point,
        shoulder: &Point,
        contact: bool,
    ) -> Self {
        let wrist = grasp + unit(&(shoulder - grasp)).unwrap_or_else(Vector::z) * 0.16;
        Self {
            time_secs,
            world_from_camera,
            openings: openings.to_vec(),
            hand: vec![limb(&grasp, &wrist, 0.035), limb(&wrist, shoulder, 0.04)],
            grasp: Some((grasp, wrist)),
            contact,
            is_still: false,
        }
    }
}

/// A narrated segment.
#[derive(Debug, Clone)]
pub struct TakeClip {
    /// First and last frame as narrated.
    pub span: [usize; 2],
    /// First and last frame of reach, motion and withdrawal.
    pub true_span: [usize; 2],
    /// The part, if any.
    pub part: Option<String>,
    /// Opening or closing.
    pub action: Option<Action>,
    /// The words.
    pub narration: String,
    /// Verb.
    pub verb: String,
    /// Noun.
    pub noun: String,
}

impl TakeClip {
    /// A narration that moves no joint, at a frame.
    pub(super) fn distraction(frame: usize) -> Self {
        Self {
            span: [frame, frame],
            true_span: [frame, frame],
            part: None,
            action: None,
            narration: "wash hands".to_owned(),
            verb: "wash".to_owned(),
            noun: "hands".to_owned(),
        }
    }

    /// An interaction with a part, of `total` frames from `first` on: the narration leaves out half of reach and withdrawal.
    pub(super) fn of_part(part: &OpenPart, action: Action, first: usize, total: usize) -> Self {
        let verb = if action == Action::Open { "open" } else { "close" };
        Self {
            span: [first + REACH / 2, first + total - 1 - LEAVE / 2],
            true_span: [first, first + total - 1],
            part: Some(part.id.clone()),
            action: Some(action),
            narration: format!("{verb} the {}", part.noun),
            verb: verb.to_owned(),
            noun: part.noun.to_owned(),
        }
    }
}

/// The whole take.
#[derive(Debug, Clone, Default)]
pub struct Take {
    /// Frames in time order.
    pub frames: Vec<TrueFrame>,
    /// Clips.
    pub clips: Vec<TakeClip>,
}

/// Frames a second during interactions.
pub(super) const FPS: f64 = 12.0;
/// Frames in which the hand reaches, and in which it withdraws.
pub(super) const REACH: usize = 8;
pub(super) const LEAVE: usize = 8;

/// A camera at `eye` that looks at `target`, upright.
#[must_use]
pub fn look_at(eye: &Point, target: &Point) -> Pose {
    let forward = unit(&(target - eye)).unwrap_or_else(Vector::x);
    let right = unit(&forward.cross(&Vector::z())).unwrap_or_else(Vector::x);
    let down = forward.cross(&right);
    let matrix = Matrix3::from_columns(&[right, down, forward]);
    Pose::from_parts(eye.coords.into(), UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix)))
}

/// Minimum-jerk progress.
pub(super) fn smooth_step(s: f64) -> f64 {
    let s = s.clamp(0.0, 1.0);
    s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s)
}

/// Where the hand is in frame `i` of a clip whose part moves for `moving` frames: it reaches from `rest` to where it would
/// hold the part, holds it, and goes back.
pub(super) fn grasp_in(i: usize, moving: usize, rest: &Point, held: &Point) -> Point {
    if i < REACH {
        rest + (held - rest) * smooth_step((i + 1) as f64 / REACH as f64)
    } else if i >= REACH + moving {
        held + (rest - held) * smooth_step((i + 1 - REACH - moving) as f64 / LEAVE as f64)
    } else {
        *held
    }
}

/// How a head that stands still moves, metres; time in seconds.
pub(super) fn sway(time: f64) -> Vector {
    Vector::new(0.01 * (1.7 * time).sin(), 0.01 * (1.3 * time).cos(), 0.005 * (2.1 * time).sin())
}

/// The shoulder below and beside the eyes; `along` points to the side.
pub(super) fn shoulder_of(eye: &Point, along: &Vector) -> Point {
    eye - Vector::z() * 0.28 + along * 0.15
}

/// Where a hand rests that does nothing, before furniture whose front faces `out`.
pub(super) fn rest_of(shoulder: &Point, out: &Vector) -> Point {
    shoulder + out * -0.15 - Vector::z() * 0.25
}

/// Who does it and what is opened: the same in all takes of a kitchen.
#[derive(Debug, Clone)]
pub struct TakePlan {
    /// Height of the eyes, world, metres.
    eye_height: f64,
    /// All parts in some order.
    order: Vec<usize>,
    /// Parts that are opened and closed.
    chosen: Vec<usize>,
}

/// Chooses a person and `count` parts: every kind of part once before any kind twice.
#[must_use]
pub fn choose(kitchen: &Kitchen, count: usize, rng: &mut Pcg64Mcg) -> TakePlan {
    let base = kitchen
        .parts
        .iter()
        .map(|p| p.bounds.center - Vector::z() * p.bounds.half.z)
        .map(|p| p.z)
        .fold(f64::INFINITY, f64::min)
        - 0.1;
    let eye_height = base + rng.random_range(1.5..1.72);
    let mut order: Vec<usize> = (0..kitchen.parts.len()).collect();
    for i in (1..order.len()).rev() {
        order.swap(i, rng.random_range(0..=i));
    }
    let mut chosen: Vec<usize> = Vec::new();
    let kind = |i: usize| (kitchen.parts[i].noun, kitchen.parts[i].articulation.kind);
    for round in 0..=count {
        for &i in &order {
            let same = chosen.iter().filter(|&&c| kind(c) == kind(i)).count();
            if chosen.len() < count
                && same <= round
                && !chosen.contains(&i)
                && same == chosen.iter().filter(|&&c| kind(c) == kind(i)).count().min(round)
            {
                chosen.push(i);
            }
        }
    }

    TakePlan { eye_height, order, chosen }
}

/// Plays a take: a look around, then each chosen part opened and closed, with a distractor in between. A `hard` take has
/// short motions and vague, shifted narrations.
#[must_use]
pub fn play(kitchen: &Kitchen, plan: &TakePlan, hard: bool, rng: &mut Pcg64Mcg) -> Take {
    let openings = vec![0.0; kitchen.parts.len()];
    let mut player = TakePlayer { kitchen, plan, take: Take::default(), openings, time: 0.0, rng };
    player.look_around();
    for (n, &index) in plan.chosen.iter().enumerate() {
        player.open_and_close(index, hard);
        if n == 0 {
            let last = player.take.frames.len() - 1;
            player.take.clips.push(TakeClip::distraction(last));
        }
    }
    player.take
}

/// A take under way.
struct TakePlayer<'a> {
    kitchen: &'a Kitchen,
    plan: &'a TakePlan,
    take: Take,
    /// Of every part, rad or m.
    openings: Vec<f64>,
    /// Seconds.
    time: f64,
    rng: &'a mut Pcg64Mcg,
}

impl TakePlayer<'_> {
    /// Each part that will be used, and its neighbours, from a few places.
    fn look_around(&mut self) {
        let TakePlan { eye_height, order, chosen } = self.plan;
        for view in 0..18 {
            let part = &self.kitchen.parts
                [if view < 2 * chosen.len() { chosen[view % chosen.len()] } else { order[view % order.len()] }];
            let along = Vector::z().cross(&part.out);
            let side = along * self.rng.random_range(-0.7..0.7);
            let mut eye = part.handle + part.out * self.rng.random_range(0.9..1.6) + side;
            eye.z = eye_height + self.rng.random_range(-0.1..0.1);
            let target =
                part.handle + along * self.rng.random_range(-0.2..0.2) - Vector::z() * self.rng.random_range(0.0..0.25);
            self.take.still(self.time, look_at(&eye, &target), &self.openings);
            self.time += 0.5;
        }
    }

    /// A part opened, then closed, with two stills after each.
    fn open_and_close(&mut self, index: usize, hard: bool) {
        let share = if hard { self.rng.random_range(0.3..0.75) } else { self.rng.random_range(0.6..0.95) };
        // People open a drawer or a dishwasher as far as they need, a door about as far as a right angle.
        let target = (share * self.kitchen.parts[index].upper).min(1.5);
        for action in [Action::Open, Action::Close] {
            self.clip(index, action, target);
            if hard {
                self.take.blur_last_clip(self.rng);
            }
            let last = self.take.frames.last().map(|f| f.world_from_camera);
            for _ in 0..2 {
                self.time += 0.4;
                if let Some(pose) = last {
                    self.take.still(self.time, pose, &self.openings);
                }
            }
        }
    }

    /// Where the person stands to move a part: eyes, world, metres.
    fn stand(&mut self, part: &OpenPart, along: &Vector) -> Point {
        let phi = part.articulation;
        // Stand on the handle's far side of a hinge, out of the door's way; straight before a drawer.
        let aside = match phi.kind {
            JointKind::Revolute if phi.axis.z.abs() > 0.5 => {
                let to_handle = crate::math::reject(&(part.handle - phi.origin), &phi.axis);
                along * (0.25 * to_handle.dot(along).signum())
            }
            _ => along * self.rng.random_range(-0.25..0.25),
        };
        let distance = if phi.kind == JointKind::Prismatic || phi.axis.z.abs() < 0.5 { 0.85 } else { 0.65 };
        let mut eye = part.handle + part.out * (distance + self.rng.random_range(0.0..0.15)) + aside;
        eye.z = self.plan.eye_height;
        eye
    }

    /// A part opened by `opened`, rad or m, or closed from there.
    fn clip(&mut self, index: usize, action: Action, opened: f64) {
        let kitchen = self.kitchen;
        let part = &kitchen.parts[index];
        let phi = part.articulation;
        let along = Vector::z().cross(&part.out);
        let eye = self.stand(part, &along);
        let shoulder = shoulder_of(&eye, &along);
        let mut slip = || self.rng.random_range(-0.01..0.01);
        let slack = Vector::new(slip(), slip(), slip());
        let seconds = self.rng.random_range(1.3..2.0);
        let moving = (seconds * FPS) as usize;
        let first = self.take.frames.len();
        let (start, end) = match action {
            Action::Open => (0.0, opened),
            Action::Close => (opened, 0.0),
        };
        let rest = rest_of(&shoulder, &part.out);
        let total = REACH + moving + LEAVE;
        for i in 0..total {
            let progress = smooth_step((i as f64 - REACH as f64) / moving as f64);
            let opening = start + (end - start) * progress;
            self.openings[index] = opening;
            let held = phi.motion(opening) * (part.handle + slack);
            let grasp = grasp_in(i, moving, &rest, &held);
            let contact = (REACH..REACH + moving).contains(&i);
            // The person follows the handle with the eyes and gives way to what comes out.
            let back = match phi.kind {
                JointKind::Prismatic => opening,
                JointKind::Revolute => 0.15 * opening,
            };
            let eye_now = eye + part.out * back + sway(self.time);
            let gaze = held + (part.bounds.center - held) * 0.3;
            let camera = look_at(&eye_now, &gaze);
            let frame = TrueFrame::with_hand(self.time, camera, &self.openings, grasp, &shoulder, contact);
            self.take.frames.push(frame);
            self.time += 1.0 / FPS;
        }
        self.take.clips.push(TakeClip::of_part(part, action, first, total));
    }
}

impl Take {
    /// For each frame the index of the clip during or after which it was taken; `None` before the first, and clips that
    /// move no joint do not count.
    #[must_use]
    pub fn segments(&self) -> Vec<Option<usize>> {
        let mut segments = vec![None; self.frames.len()];
        for (index, clip) in self.clips.iter().enumerate().filter(|(_, c)| c.part.is_some()) {
            for segment in segments.iter_mut().skip(clip.true_span[0]) {
                *segment = Some(index);
            }
        }
        segments
    }

    /// In a share `wrong` of clips the noun is one of the other joint type, in a share `vague` it is "it".
    pub(super) fn misname(&mut self, kitchen: &Kitchen, wrong: f64, vague: f64, rng: &mut Pcg64Mcg) {
        for clip in &mut self.clips {
            let Some(part) = kitchen.parts.iter().find(|p| clip.part.as_ref() == Some(&p.id)) else { continue };
            let draw: f64 = rng.random();
            if draw < wrong {
                let noun = if part.articulation.kind == JointKind::Revolute { "drawer" } else { "cupboard" };
                (clip.noun, clip.narration) = (noun.to_owned(), format!("{} the {noun}", clip.verb));
            } else if draw < wrong + vague {
                (clip.noun, clip.narration) = ("it".to_owned(), format!("{} it", clip.verb));
            }
        }
    }

    /// The same take moved as a whole.
    #[must_use]
    pub(super) fn moved(mut self, motion: &Pose) -> Self {
        for frame in &mut self.frames {
            frame.world_from_camera = motion * frame.world_from_camera;
            frame.grasp = frame.grasp.map(|(grasp, wrist)| (motion * grasp, motion * wrist));
            for shape in &mut frame.hand {
                *shape = shape.moved(motion);
            }
        }
        self
    }

    /// A frame without interaction.
    pub(super) fn still(&mut self, time_secs: f64, world_from_camera: Pose, openings: &[f64]) {
        self.frames.push(TrueFrame {
            time_secs,
            world_from_camera,
            openings: openings.to_vec(),
            hand: Vec::new(),
            grasp: None,
            contact: false,
            is_still: true,
        });
    }

    /// Shifts the last narration by up to two thirds of a second, and makes every third of them vague.
    fn blur_last_clip(&mut self, rng: &mut Pcg64Mcg) {
        let Some(clip) = self.clips.last_mut() else { return };
        let [first, last] = clip.true_span;
        let mut moved = |at: usize| (at as i64 + rng.random_range(-8..=8)).clamp(first as i64, last as i64) as usize;
        let (start, end) = (moved(clip.span[0]), moved(clip.span[1]));
        clip.span = [start.min(end), start.max(end).max(start.min(end) + 1).min(last)];
        if rng.random_bool(1.0 / 3.0) {
            clip.narration = format!("{} it", clip.verb);
            clip.noun = "it".to_owned();
        }
    }
}

/// 21 joints in MANO/OpenPose order: wrist, then thumb to little finger, each from the palm to its tip. The mean of the
/// thumb, index and middle tips is `grasp`.
#[must_use]
pub fn hand_joints(grasp: &Point, wrist: &Point) -> [Point; 21] {
    let along = unit(&(grasp - wrist)).unwrap_or_else(Vector::x);
    let across = crate::math::any_orthogonal(&along);
    // Fingers side by side; the three that grasp are centred on the grasp.
    let offsets = [-0.02, 0.0, 0.02, 0.038, 0.055];
    let mut joints = [*wrist; 21];
    for (finger, offset) in offsets.iter().enumerate() {
        let tip = grasp + across * *offset;
        for joint in 0..4 {
            joints[1 + 4 * finger + joint] = wrist + (tip - wrist) * (0.4 + 0.2 * joint as f64);
        }
    }
    joints
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_three_tips_average_to_the_grasp() {
        let (grasp, wrist) = (Point::new(1.0, 2.0, 3.0), Point::new(1.1, 2.1, 3.0));
        let j = hand_joints(&grasp, &wrist);
        let mean = (j[4].coords + j[8].coords + j[12].coords) / 3.0;
        assert!((mean - grasp.coords).norm() < 1e-12);
    }

    #[test]
    fn the_camera_looks_at_its_target_upright() {
        let pose = look_at(&Point::new(1.0, 0.0, 1.6), &Point::new(0.0, 2.0, 0.8));
        let local = pose.inverse() * Point::new(0.0, 2.0, 0.8);
        assert!(local.x.abs() < 1e-12 && local.y.abs() < 1e-12 && local.z > 0.0);
        assert!((pose.rotation * -Vector::y()).z > 0.5);
    }
}
