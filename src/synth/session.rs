//! The benchmark's person: opens and closes parts of a fitted kitchen as people do, part-way, in two goes, eyes elsewhere.

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::kitchen::{Kitchen, OpenPart, limb};
use super::noise::{chance, normal};
use super::person::{FPS, LEAVE, REACH, Take, TrueClip, TrueFrame, look_at, smooth_step};
use super::tiers::Sizes;
use crate::articulation::{Action, JointKind};
use crate::math::{Point, Vector, unit};

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

/// Plays a take in which `count` parts (at most as many as the kitchen has) get `clips` clips each. The same draws play
/// the same take on every tier, as far as its sizes allow.
#[must_use]
pub fn play(kitchen: &Kitchen, count: usize, clips: usize, sizes: &Sizes, rng: &mut Pcg64Mcg) -> Take {
    let chosen = choose(kitchen, count.min(kitchen.parts.len()), rng);
    let floor = kitchen.parts.iter().map(|p| p.base.center.z - p.base.half.z).fold(f64::INFINITY, f64::min);
    let eye_height = floor + between(EYE_M, rng.random());
    let openings = vec![0.0; kitchen.parts.len()];
    let mut session = Session { kitchen, sizes, take: Take::default(), openings, time: 0.0, eye_height, rng };
    session.look_around(&chosen);
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

/// Parts dealt from decks of kinds: the frequent kinds more often, no part twice.
fn choose(kitchen: &Kitchen, count: usize, rng: &mut Pcg64Mcg) -> Vec<usize> {
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
    sizes: &'a Sizes,
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
        self.take.clips.push(TrueClip::distraction(self.take.frames.len().saturating_sub(1)));
    }

    fn clip(&mut self, index: usize, action: Action, path: [f64; 2]) {
        let kitchen = self.kitchen;
        let part = &kitchen.parts[index];
        let phi = part.articulation;
        let along = Vector::z().cross(&part.out);
        let across = part.out.cross(&part.handle_along);
        // All draws first, whatever they are used for: the tiers play the same takes.
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
        let mut slide = normal(self.rng);

        // Stand on the handle's far side of an upright hinge, out of the door's way; anywhere before the rest.
        let aside = if phi.kind == JointKind::Revolute && phi.axis.z.abs() > 0.5 {
            0.25 * (part.handle - phi.origin).dot(&along).signum()
        } else {
            sideways
        };
        let stand = self.place(part, distance, aside, self.eye_height);
        let away = if leave_side < 0.5 { -1.2 } else { 1.2 };
        let elsewhere = part.handle + along * away + Vector::z() * (0.6 * leave_side - 0.3);

        let moving = (seconds * FPS) as usize;
        let total = REACH + moving + LEAVE;
        let first = self.take.frames.len();
        let widest = path[0].max(path[1]).max(f64::EPSILON);
        let keep_slide = (-1.0 / (FPS * SLIDE_SECS)).exp();
        let follow = 1.0 - (-1.0 / (FPS * GAZE_SECS)).exp();
        let shoulder_of = |eye: &Point| eye - Vector::z() * 0.28 + along * 0.15;
        let rest_of = |shoulder: &Point| shoulder + part.out * -0.15 - Vector::z() * 0.25;
        let mut gaze = phi.motion(path[0]) * part.handle;
        for i in 0..total {
            let share = (i as f64 - REACH as f64) / moving as f64;
            let opening = path[0] + (path[1] - path[0]) * progress(share, reversal);
            self.openings[index] = opening;
            slide = slide * keep_slide + normal(self.rng) * (1.0 - keep_slide * keep_slide).sqrt();
            let offset = slack
                + drift * (opening / widest)
                + part.handle_along * (slide * self.sizes.grip_slide_m).clamp(-0.06, 0.06);
            let motion = phi.motion(opening);
            let held = motion * (part.handle + offset);
            // Step back from what comes out, and along with what slides sideways.
            let moved = motion * part.handle - part.handle;
            let sideways = if phi.kind == JointKind::Prismatic { 0.5 * moved.dot(&along) } else { 0.0 };
            let t = self.time;
            let sway = Vector::new(0.01 * (1.7 * t).sin(), 0.01 * (1.3 * t).cos(), 0.005 * (2.1 * t).sin());
            let eye = stand + part.out * moved.dot(&part.out).max(0.0) + along * sideways + sway;
            let shoulder = shoulder_of(&eye);
            let rest = rest_of(&shoulder);
            let grasp = if i < REACH {
                rest + (held - rest) * smooth_step((i + 1) as f64 / REACH as f64)
            } else if i >= REACH + moving {
                held + (rest - held) * smooth_step((i + 1 - REACH - moving) as f64 / LEAVE as f64)
            } else {
                held
            };
            let aim = if share >= leave_at { elsewhere } else { held + (part.bounds.center - held) * 0.3 };
            gaze += (aim - gaze) * follow;
            let wrist = grasp + unit(&(shoulder - grasp)).unwrap_or_else(Vector::z) * 0.16;
            self.take.frames.push(TrueFrame {
                time_secs: t,
                world_from_camera: look_at(&eye, &gaze),
                openings: self.openings.clone(),
                hand: vec![limb(&grasp, &wrist, 0.035), limb(&wrist, &shoulder, 0.04)],
                grasp: Some((grasp, wrist)),
                contact: (REACH..REACH + moving).contains(&i),
                is_still: false,
            });
            self.time += 1.0 / FPS;
        }
        let verb = if action == Action::Open { "open" } else { "close" };
        self.take.clips.push(TrueClip {
            span: [first + REACH / 2, first + total - 1 - LEAVE / 2],
            true_span: [first, first + total - 1],
            part: Some(part.id.clone()),
            action: Some(action),
            narration: format!("{verb} the {}", part.noun),
            verb: verb.to_owned(),
            noun: part.noun.to_owned(),
        });
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
