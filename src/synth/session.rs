//! The benchmark's person: opens and closes parts of a fitted kitchen as people do, part-way, in two goes, eyes elsewhere.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::kitchen::{Kitchen, OpenPart};
use super::noise::{chance, normal};
use super::person::{
    FPS, LEAVE, REACH, Take, TakeClip, TrueFrame, grasp_in, look_at, rest_of, shoulder_of, smooth_step, sway,
};
use super::tiers::TierSizes;
use crate::articulation::{Action, JointKind};
use crate::math::{Point, Vector};

/// Height of the eyes over the floor, metres.
const EYE_M: [f64; 2] = [1.45, 1.75];
/// Level distance of the eyes from the closed handle, metres.
const STAND_M: [f64; 2] = [0.45, 0.75];
/// Views from which the kitchen is seen before anything is touched, and how many of them show each part that will be.
const VIEWS: usize = 30;
const VIEWS_A_PART: usize = 3;
/// A part is shut in front of the camera after this share of openings, out of sight after the others: 60 % of all clips
/// open, 40 % close.
const CLOSED_IN_SIGHT: f64 = 0.8;
/// Share of clips that go back a bit on their way.
const REVERSED: f64 = 0.1;
/// Share of clips that begin (opening) or end (closing) part-open, and how open that is.
const AJAR: f64 = 0.12;
const AJAR_SHARE: [f64; 2] = [0.1, 0.35];
/// Share of closings in which the eyes leave before the part is shut.
const EYES_LEAVE: f64 = 0.5;
/// Duration of a motion, seconds.
const MOTION_SECS: [f64; 2] = [0.8, 2.2];
/// The gaze follows the hand with this delay; the grip slides along the handle this slowly; seconds.
const GAZE_SECS: f64 = 0.2;
const SLIDE_SECS: f64 = 0.5;
/// Where on the handle it is held: within this of the middle, metres.
const GRIP_M: f64 = 0.01;
/// Free space around a head, metres.
const HEAD_M: f64 = 0.12;
/// Time between two parts and between two stills, seconds.
const WALK_SECS: f64 = 3.0;
const STILL_SECS: f64 = 0.4;

/// How often a kind stands in the deck from which parts are dealt, for every time that the rarest does. Kitchens have far
/// more drawers and doors than anything else.
fn cards(kind: &str) -> usize {
    match kind {
        "drawer" | "door" => 4,
        "sliding door" => 2,
        _ => 1,
    }
}

/// A number between two, by a draw between 0 and 1.
fn between(range: [f64; 2], draw: f64) -> f64 {
    range[0] + (range[1] - range[0]) * draw
}

fn shuffle<T>(list: &mut [T], rng: &mut Pcg64Mcg) {
    for i in (1..list.len()).rev() {
        list.swap(i, rng.random_range(0..=i));
    }
}

/// Plays a take in which each of the `chosen` parts gets `clips` clips. The same draws play the same take on every tier, as far
/// as its sizes allow.
#[must_use]
pub fn play(kitchen: &Kitchen, chosen: &[usize], clips: usize, sizes: &TierSizes, rng: &mut Pcg64Mcg) -> Take {
    let floor = kitchen.parts.iter().map(|p| p.base.center.z - p.base.half.z).fold(f64::INFINITY, f64::min);
    let eye_height = floor + between(EYE_M, rng.random());
    let openings = vec![0.0; kitchen.parts.len()];
    let mut session = Session { kitchen, sizes, take: Take::default(), openings, time: 0.0, eye_height, rng };
    session.look_around(chosen);
    let visits: Vec<Vec<Vec<Action>>> = chosen.iter().map(|_| session.visits(clips)).collect();
    let rounds = visits.iter().map(Vec::len).max().unwrap_or(0);
    let mut last = None;
    for round in 0..rounds {
        let mut turn: Vec<usize> = (0..chosen.len()).filter(|&i| visits[i].len() > round).collect();
        shuffle(&mut turn, session.rng);
        // Other clips stand between two visits to a part.
        if turn.len() > 1 && turn.first().copied() == last {
            turn.rotate_left(1);
        }
        for i in turn {
            session.visit(chosen[i], &visits[i][round]);
            if last.is_none() {
                session.distraction();
            }
            last = Some(i);
        }
    }
    session.take
}

/// `count` parts (at most as many as the kitchen has) dealt from decks of kinds: the frequent kinds more often, no part twice.
#[must_use]
pub fn choose(kitchen: &Kitchen, count: usize, rng: &mut Pcg64Mcg) -> Vec<usize> {
    let count = count.min(kitchen.parts.len());
    let mut kinds: Vec<&str> = Vec::new();
    for part in &kitchen.parts {
        if !kinds.contains(&part.kind) {
            kinds.push(part.kind);
        }
    }
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count {
        let mut deck: Vec<&str> = kinds.iter().flat_map(|kind| vec![*kind; cards(kind)]).collect();
        shuffle(&mut deck, rng);
        for kind in deck {
            let left: Vec<usize> =
                (0..kitchen.parts.len()).filter(|i| kitchen.parts[*i].kind == kind && !chosen.contains(i)).collect();
            if chosen.len() < count && !left.is_empty() {
                chosen.push(left[rng.random_range(0..left.len())]);
            }
        }
    }
    chosen
}

/// A take under way.
struct Session<'a> {
    kitchen: &'a Kitchen,
    sizes: &'a TierSizes,
    take: Take,
    openings: Vec<f64>,
    time: f64,
    eye_height: f64,
    rng: &'a mut Pcg64Mcg,
}

impl Session<'_> {
    fn draw(&mut self) -> f64 {
        self.rng.random()
    }

    /// Each part that will be used, and others, from a few places.
    fn look_around(&mut self, chosen: &[usize]) {
        let kitchen = self.kitchen;
        for view in 0..VIEWS {
            let index = if view < VIEWS_A_PART * chosen.len() {
                chosen[view % chosen.len()]
            } else {
                self.rng.random_range(0..kitchen.parts.len())
            };
            self.look(&kitchen.parts[index]);
            self.time += STILL_SECS;
        }
    }

    /// A still that shows a part from a metre or more.
    fn look(&mut self, part: &OpenPart) {
        let along = Vector::z().cross(&part.out);
        let (distance, side) = (between([0.9, 1.6], self.draw()), between([-0.7, 0.7], self.draw()));
        let (up, aim, below) = (self.draw(), between([-0.2, 0.2], self.draw()), between([0.0, 0.25], self.draw()));
        let height = self.eye_height + between([-0.1, 0.1], up);
        let eye = self.place(part, distance, side, height);
        let target = part.handle + along * aim - Vector::z() * below;
        self.take.still(self.time, look_at(&eye, &target), &self.openings);
    }

    /// Where the eyes are before a part, moved to its middle, then back, where something stands in the way.
    fn place(&self, part: &OpenPart, distance: f64, aside: f64, height: f64) -> Point {
        let along = Vector::z().cross(&part.out);
        let at = |distance: f64, aside: f64| {
            let p = part.handle + part.out * distance + along * aside;
            Point::new(p.x, p.y, height)
        };
        let tries = [1.0, 0.6, 0.2, -0.3, -0.8].map(|share| at(distance, share * aside));
        let free = tries.into_iter().find(|p| self.kitchen.is_free(p, HEAD_M));
        free.unwrap_or_else(|| at(distance + 0.3, 0.0))
    }

    /// What is done with a part each time that the person comes to it.
    fn visits(&mut self, clips: usize) -> Vec<Vec<Action>> {
        let mut visits = Vec::new();
        let mut left = clips;
        while left > 0 {
            let mut visit = vec![Action::Open];
            if self.draw() < CLOSED_IN_SIGHT && left > 1 {
                visit.push(Action::Close);
            }
            left -= visit.len();
            visits.push(visit);
        }
        visits
    }

    fn visit(&mut self, index: usize, actions: &[Action]) {
        let kitchen = self.kitchen;
        let part = &kitchen.parts[index];
        self.time += WALK_SECS;
        self.look(part);
        let is_short = self.draw() < self.sizes.short_share;
        let range = match (part.articulation.kind, is_short) {
            (JointKind::Revolute, false) => self.sizes.door_rad,
            (JointKind::Revolute, true) => self.sizes.short_door_rad,
            (JointKind::Prismatic, false) => self.sizes.drawer_m,
            (JointKind::Prismatic, true) => self.sizes.short_drawer_m,
        };
        let target = between(range, self.draw()).min(part.upper);
        for action in actions {
            let (is_ajar, share) = (self.draw() < AJAR, between(AJAR_SHARE, self.draw()));
            let ajar = if is_ajar { share * target } else { 0.0 };
            let path = if *action == Action::Open { [ajar, target] } else { [target, ajar] };
            self.clip(index, *action, path);
            let pose = self.take.frames.last().map(|f| f.world_from_camera);
            for _ in 0..2 {
                self.time += STILL_SECS;
                if let Some(pose) = pose {
                    self.take.still(self.time, pose, &self.openings);
                }
            }
        }
        // What stays open is shut out of sight.
        self.openings[index] = 0.0;
    }

    /// A narration that moves no joint.
    fn distraction(&mut self) {
        self.take.clips.push(TakeClip::distraction(self.take.frames.len().saturating_sub(1)));
    }

    /// All that is drawn for a clip comes first, whatever it is used for: the tiers play the same takes.
    fn draws(&mut self, part: &OpenPart, action: Action) -> Draws {
        let across = part.out.cross(&part.handle_along);
        let distance = between(STAND_M, self.draw());
        let sideways = between([-0.25, 0.25], self.draw());
        let slack = Vector::new(self.draw(), self.draw(), self.draw()).map(|d| between([-GRIP_M, GRIP_M], d));
        let drift = (part.handle_along * normal(self.rng) + across * normal(self.rng)) * self.sizes.grip_drift_m;
        let seconds = between(MOTION_SECS, self.draw());
        let is_reversed = chance(self.rng, REVERSED);
        let (turn, back) = (between([0.55, 0.75], self.draw()), between([0.1, 0.25], self.draw()));
        let reversal = is_reversed.then_some([turn, turn - back]);
        let leaves = chance(self.rng, EYES_LEAVE);
        let (leave_at, leave_side) = (between([0.5, 0.8], self.draw()), self.draw());
        let leave_at = if leaves && action == Action::Close { leave_at } else { f64::INFINITY };
        let slide = normal(self.rng);
        Draws { distance, sideways, slack, drift, seconds, reversal, leave_at, leave_side, slide }
    }

    /// How a part is moved along a path of its opening; where the person stands to do so.
    fn motion<'p>(&self, part: &'p OpenPart, path: [f64; 2], draws: Draws) -> ClipMotion<'p> {
        let phi = part.articulation;
        let along = Vector::z().cross(&part.out);
        // Stand on the handle's far side of an upright hinge, out of the door's way; anywhere before the rest.
        let aside = if phi.kind == JointKind::Revolute && phi.axis.z.abs() > 0.5 {
            0.25 * (part.handle - phi.origin).dot(&along).signum()
        } else {
            draws.sideways
        };
        let stand = self.place(part, draws.distance, aside, self.eye_height);
        let away = if draws.leave_side < 0.5 { -1.2 } else { 1.2 };
        let elsewhere = part.handle + along * away + Vector::z() * (0.6 * draws.leave_side - 0.3);
        let moving = (draws.seconds * FPS) as usize;
        ClipMotion { part, path, draws, along, stand, elsewhere, moving }
    }

    fn clip(&mut self, index: usize, action: Action, path: [f64; 2]) {
        let kitchen = self.kitchen;
        let part = &kitchen.parts[index];
        let draws = self.draws(part, action);
        let mut slide = draws.slide;
        let motion = self.motion(part, path, draws);
        let total = REACH + motion.moving + LEAVE;
        let first = self.take.frames.len();
        let keep_slide = (-1.0 / (FPS * SLIDE_SECS)).exp();
        let mut gaze = part.articulation.motion(path[0]) * part.handle;
        for i in 0..total {
            self.openings[index] = motion.opening(i);
            slide = slide * keep_slide + normal(self.rng) * (1.0 - keep_slide * keep_slide).sqrt();
            let slide_m = slide * self.sizes.grip_slide_m;
            let frame = motion.frame(i, self.time, &self.openings, slide_m, &mut gaze);
            self.take.frames.push(frame);
            self.time += 1.0 / FPS;
        }
        self.take.clips.push(TakeClip::of_part(part, action, first, total));
    }
}

/// What is drawn for a clip.
struct Draws {
    /// Of the eyes before the closed handle and beside it, metres.
    distance: f64,
    sideways: f64,
    /// Where on the handle it is held, metres.
    slack: Vector,
    /// How far the grip drifts on the way, metres.
    drift: Vector,
    /// Of the motion.
    seconds: f64,
    /// The shares of the way at which the motion turns back and goes on.
    reversal: Option<[f64; 2]>,
    /// After which share of the motion the eyes leave it, and to which side.
    leave_at: f64,
    leave_side: f64,
    /// Where the grip begins to slide, in standard deviations.
    slide: f64,
}

/// A part on its way, and the person before it.
struct ClipMotion<'a> {
    part: &'a OpenPart,
    /// Opening at both ends, rad or m.
    path: [f64; 2],
    draws: Draws,
    /// To the side, as the person sees it.
    along: Vector,
    /// Where the eyes are while the part is closed.
    stand: Point,
    /// Where the eyes look when they have left the part.
    elsewhere: Point,
    /// Frames in which the part moves.
    moving: usize,
}

impl ClipMotion<'_> {
    /// The share of the motion's time that has passed in frame `i` of the clip; beyond 0 to 1 the part stands.
    fn share(&self, i: usize) -> f64 {
        (i as f64 - REACH as f64) / self.moving as f64
    }

    /// The part's opening in frame `i`, rad or m.
    fn opening(&self, i: usize) -> f64 {
        self.path[0] + (self.path[1] - self.path[0]) * progress(self.share(i), self.draws.reversal)
    }

    /// Frame `i` of the clip at a time (s); `slide_m` is how far the grip slid along the handle, `gaze` follows the hand.
    fn frame(&self, i: usize, time: f64, openings: &[f64], slide_m: f64, gaze: &mut Point) -> TrueFrame {
        let (part, along) = (self.part, self.along);
        let opening = self.opening(i);
        let widest = self.path[0].max(self.path[1]).max(f64::EPSILON);
        let offset =
            self.draws.slack + self.draws.drift * (opening / widest) + part.handle_along * slide_m.clamp(-0.06, 0.06);
        let motion = part.articulation.motion(opening);
        let held = motion * (part.handle + offset);
        // Step back from what comes out, and along with what slides sideways.
        let moved = motion * part.handle - part.handle;
        let sideways = if part.articulation.kind == JointKind::Prismatic { 0.5 * moved.dot(&along) } else { 0.0 };
        let eye = self.stand + part.out * moved.dot(&part.out).max(0.0) + along * sideways + sway(time);
        let shoulder = shoulder_of(&eye, &along);
        let grasp = grasp_in(i, self.moving, &rest_of(&shoulder, &part.out), &held);
        let leaves = self.share(i) >= self.draws.leave_at;
        let aim = if leaves { self.elsewhere } else { held + (part.bounds.center - held) * 0.3 };
        *gaze += (aim - *gaze) * (1.0 - (-1.0 / (FPS * GAZE_SECS)).exp());
        let contact = (REACH..REACH + self.moving).contains(&i);
        TrueFrame::with_hand(time, look_at(&eye, gaze), openings, grasp, &shoulder, contact)
    }
}

/// Progress of a motion after a share of its time: straight, or to `reversal[0]`, back to `reversal[1]`, and on.
fn progress(share: f64, reversal: Option<[f64; 2]>) -> f64 {
    // When it turns back, and when it goes on.
    const TURNS: [f64; 2] = [0.45, 0.62];
    let Some([far, back]) = reversal else { return smooth_step(share) };
    let piece =
        |from: f64, to: f64, start: f64, end: f64| from + (to - from) * smooth_step((share - start) / (end - start));
    if share < TURNS[0] {
        piece(0.0, far, 0.0, TURNS[0])
    } else if share < TURNS[1] {
        piece(far, back, TURNS[0], TURNS[1])
    } else {
        piece(back, 1.0, TURNS[1], 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reversed_motion_is_continuous_and_arrives() {
        let path: Vec<f64> = (-10..=110).map(|i| progress(f64::from(i) / 100.0, Some([0.7, 0.5]))).collect();
        assert!(path.windows(2).all(|w| (w[1] - w[0]).abs() < 0.05));
        assert!(path.windows(2).any(|w| w[1] < w[0] - 1e-3));
        assert_eq!((path[0], path[120]), (0.0, 1.0));
    }
}
