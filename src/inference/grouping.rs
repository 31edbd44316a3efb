//! Which clips show one part: one pass over all clips in the order of time, with a hand or without (§C.2, ours).
//!
//! Each part that is known has a state: how likely it stands open. A clip is given to the part that is likeliest to have been
//! moved in it, or to a new one. This is asked of
//!
//! - what was seen: [`same_part`](super::same_part), of the clip and of those of the part's clips that saw it best,
//! - what was done: a part is opened and closed in turn, but for motions that no clip shows; a closing that follows an opening is
//!   mostly of the same part,
//! - what is known before: a part that was used is used again.
//!
//! A clip in which no hand was followed has its name and its action. It changes the state of the parts that it may have moved, each
//! as far as it may have. A wrong part in a group spoils the joint of both, so that a clip joins a part only where this is clearly
//! likelier than all else.

use super::paper;
use super::same_part::{HandOdds, Model, Name, Sight, Terms, averaged, log_odds, nats, together};
use crate::articulation::Action;
use crate::config::{Config, GroupingMethod, SamePart};
use crate::math::Point;

/// A clip with a hand.
#[derive(Debug, Clone, Copy)]
pub struct Held<'a> {
    /// What it shows of the closed part.
    pub sight: Sight<'a>,
    /// Opening or closing.
    pub action: Action,
    /// The grip at the open end, world.
    pub open: Point,
    /// Standard deviation of `open` along the motion, metres.
    pub open_std_m: f64,
    /// The hand's way, world.
    pub path: &'a [Point],
    /// Confident voxels of the touched furniture, sorted; none where it was not found.
    pub voxels: &'a [[i32; 3]],
}

/// A clip that moves something, in which no hand was followed.
#[derive(Debug, Clone, Copy)]
pub struct Missed<'a> {
    /// How many of the clips with a hand come before it.
    pub after: usize,
    /// Opening or closing, where the narration says so.
    pub action: Option<Action>,
    /// What the narration calls the part.
    pub name: Name<'a>,
}

/// A clip without a hand that moves a part of which there are clips with one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tie {
    /// Index of the clip without a hand.
    pub missed: usize,
    /// Index of the clip with a hand that opened what this one closes, or closes what this one opened.
    pub with: usize,
    /// What the clip without a hand does.
    pub action: Action,
}

/// The parts of all clips.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Grouped {
    /// Indices of the clips with a hand that show each part, in the order of time.
    pub parts: Vec<Vec<usize>>,
    /// Clips without a hand, as far as it is known what they move.
    pub ties: Vec<Tie>,
}

/// Groups clips that show one part, given in the order of time, as `missed` is.
///
/// The paper's grouping asks for their voxels instead ([`paper::same_voxels`]); it knows no clips without a hand.
#[must_use]
pub fn group(clips: &[Held], missed: &[Missed], config: &Config) -> Grouped {
    let rules = &config.inference;
    if !rules.merge_clips {
        return Grouped { parts: (0..clips.len()).map(|i| vec![i]).collect(), ties: Vec::new() };
    }
    if rules.grouping == GroupingMethod::Voxels {
        let voxels: Vec<&[[i32; 3]]> = clips.iter().map(|c| c.voxels).collect();
        return Grouped { parts: paper::same_voxels(&voxels, rules), ties: Vec::new() };
    }
    let mut pass = Pass { clips, missed, config, model: Model::of(config), parts: Vec::new() };
    let mut heard = (0..missed.len()).peekable();
    for clip in 0..clips.len() {
        while let Some(m) = heard.next_if(|&m| missed[m].after <= clip) {
            pass.hear(m);
        }
        pass.see(clip);
    }
    heard.for_each(|m| pass.hear(m));
    pass.grouped()
}

/// A part as far as the pass has come.
#[derive(Debug, Clone)]
struct Part {
    /// Clips with a hand that show it, in the order of time. None of a part that was only told of.
    members: Vec<usize>,
    /// Those of them that are asked: those that saw it best, and the last one.
    asked: Vec<usize>,
    /// Clips without a hand that move it.
    heard: Vec<Heard>,
    /// How likely there is such a part: less than 1 where a clip without a hand may have moved another one.
    exists: f64,
    /// How likely it stands open.
    open: f64,
    /// How likely the motion before opened it.
    just_opened: f64,
}

/// A clip without a hand that moves a part.
#[derive(Debug, Clone, Copy)]
struct Heard {
    /// Its index.
    missed: usize,
    /// How likely it does.
    share: f64,
    /// How likely the part stood open before; none of the clip by which the part became known.
    open_before: Option<f64>,
}

/// The pass.
struct Pass<'a> {
    clips: &'a [Held<'a>],
    missed: &'a [Missed<'a>],
    config: &'a Config,
    model: Model<'a>,
    parts: Vec<Part>,
}

impl Pass<'_> {
    /// Gives a clip with a hand to a part.
    fn see(&mut self, clip: usize) {
        self.time_goes_by();
        let odds: Vec<(usize, f64)> =
            (0..self.parts.len()).filter_map(|part| Some((part, self.odds(part, clip)?))).collect();
        let best = odds.iter().copied().reduce(|best, next| if next.1 > best.1 { next } else { best });
        let likeliest = best.map(|(part, odds_of_it)| (part, self.share(part, odds_of_it, &odds)));
        let (home, share) = likeliest.filter(|(_, share)| *share >= self.model.rules.joins).unwrap_or_else(|| {
            self.parts.push(Part::new(1.0, 0.0));
            (self.parts.len() - 1, 1.0)
        });
        self.join(home, clip, share);
    }

    /// What nobody closes in sight does not stand open for ever.
    fn time_goes_by(&mut self) {
        for part in &mut self.parts {
            part.open *= self.model.rules.stays_open;
        }
    }

    /// Log odds, nats, that a clip moves such a part, against a part beside it that no clip moved before; none where it is too far
    /// away.
    fn odds(&self, part: usize, clip: usize) -> Option<f64> {
        let part = &self.parts[part];
        let Held { action, sight, .. } = self.clips[clip];
        let rules = self.model.rules;
        let seen = match part.heard.first() {
            // It is anywhere in the room.
            Some(heard) if part.members.is_empty() => {
                let name = self.model.names(self.missed[heard.missed].name, sight.name);
                name.unwrap_or(0.0) + nats(part.exists / rules.parts)
            }
            _ => self.seen(part, clip)?,
        };
        Some(seen + rules.used_again_nats + turn(part, action, rules))
    }

    /// The same by what was seen alone.
    fn seen(&self, part: &Part, clip: usize) -> Option<f64> {
        let (model, held) = (&self.model, &self.clips[clip]);
        let near = |j: &usize| (self.clips[*j].sight.grip - held.sight.grip).norm() <= model.rules.near_m;
        if !part.asked.iter().any(near) {
            return None;
        }
        let sights: Vec<(f64, Terms)> = part
            .asked
            .iter()
            .map(|&j| {
                let other = &self.clips[j];
                let closes = (other.action, held.action) == (Action::Open, Action::Close);
                let hands = match closes && part.members.last() == Some(&j) {
                    true => handed_over(other, held, model),
                    false => model.grips(&other.sight, &held.sight),
                };
                (model.worth(&other.sight), model.terms(&other.sight, &held.sight, hands))
            })
            .collect();
        Some(together(&sights, model.rules.badly_seen))
    }

    /// How likely a clip shows the part of such odds, among all other ones. Parts that may be this one under two names do not stand
    /// against it.
    fn share(&self, part: usize, odds: f64, all: &[(usize, f64)]) -> f64 {
        let rivals = all.iter().filter(|(other, _)| *other != part && !self.may_be_one(part, *other));
        let others: f64 = rivals.map(|(_, other)| other.exp()).sum();
        odds.exp() / (odds.exp() + others + 1.0)
    }

    fn may_be_one(&self, a: usize, b: usize) -> bool {
        let sight = |part: usize| self.parts[part].asked.first().map(|&j| &self.clips[j].sight);
        sight(a).zip(sight(b)).is_some_and(|(a, b)| log_odds(a, b, self.config) > 0.0)
    }

    /// Adds a clip with a hand to a part that is likely its own by such a share.
    fn join(&mut self, home: usize, clip: usize, share: f64) {
        let (clips, missed, rules) = (self.clips, self.missed, self.model.rules);
        let action = clips[clip].action;
        for part in &mut self.parts {
            part.just_opened = 0.0;
        }
        let part = &mut self.parts[home];
        if part.members.is_empty() {
            part.heard.iter_mut().for_each(|heard| heard.share *= share);
        }
        let last = part.members.last().copied();
        if let Some(heard) = part.heard.last_mut().filter(|h| last.is_none_or(|last| missed[h.missed].after > last)) {
            heard.reconsider(missed[heard.missed].action, action, rules);
        }
        part.members.push(clip);
        part.asked.push(clip);
        if part.asked.len() > rules.asked {
            let least = least_seen(&part.asked[..rules.asked], clips);
            part.asked.remove(least);
        }
        part.exists = 1.0;
        part.open = stands_open(Some(action));
        part.just_opened = part.open;
    }

    /// Lets a clip without a hand change the states of the parts that it may have moved.
    fn hear(&mut self, index: usize) {
        self.time_goes_by();
        let rules = self.model.rules;
        let Missed { action, .. } = self.missed[index];
        let odds: Vec<f64> = self.parts.iter().map(|part| self.told(part, index).exp()).collect();
        let all = odds.iter().sum::<f64>() + rules.parts;
        let mut known = false;
        for (part, odds) in self.parts.iter_mut().zip(odds) {
            let (share, open_before) = (odds / all, Some(part.open));
            part.open += share * (stands_open(action) - part.open);
            part.just_opened = if action == Some(Action::Open) { share } else { 0.0 };
            if share >= rules.told_of {
                known = true;
                part.heard.push(Heard { missed: index, share, open_before });
            }
        }
        // What was opened then is closed by somebody.
        if !known && action == Some(Action::Open) {
            let heard = vec![Heard { missed: index, share: 1.0, open_before: None }];
            self.parts.push(Part { heard, just_opened: 1.0, ..Part::new(rules.parts / all, 1.0) });
        }
    }

    /// Log odds, nats, that a clip without a hand moves such a part, against a single one that no clip moved before.
    fn told(&self, part: &Part, index: usize) -> f64 {
        let Missed { action, name, .. } = self.missed[index];
        let (model, rules) = (&self.model, self.model.rules);
        let called = match part.heard.first() {
            Some(heard) if part.members.is_empty() => {
                model.names(self.missed[heard.missed].name, name).unwrap_or(0.0) + nats(part.exists)
            }
            _ => {
                let of = |&j: &usize| {
                    let sight = &self.clips[j].sight;
                    Some((model.worth(sight), model.names(sight.name, name)?.exp()))
                };
                nats(averaged(part.asked.iter().filter_map(of)))
            }
        };
        called + rules.used_again_nats + action.map_or(0.0, |action| turn(part, action, rules))
    }

    fn grouped(self) -> Grouped {
        let mut out = Grouped::default();
        for part in self.parts.iter().filter(|part| !part.members.is_empty()) {
            out.parts.push(part.members.clone());
            let sure = part.heard.iter().filter(|heard| heard.share >= self.model.rules.told_of);
            out.ties.extend(sure.filter_map(|heard| self.tie(part, heard.missed)));
        }
        out.parts.sort();
        out.ties.sort_by_key(|tie| tie.missed);
        out
    }

    /// The clip with a hand that goes with one without: the motion the other way that is next to it.
    fn tie(&self, part: &Part, index: usize) -> Option<Tie> {
        let Missed { after, action, .. } = self.missed[index];
        let action = action?;
        let with = match action {
            Action::Close => part.members.iter().rev().find(|&&j| j < after),
            Action::Open => part.members.iter().find(|&&j| j >= after),
        };
        with.filter(|&&j| self.clips[j].action != action).map(|&with| Tie { missed: index, with, action })
    }
}

impl Part {
    fn new(exists: f64, open: f64) -> Self {
        Self { members: Vec::new(), asked: Vec::new(), heard: Vec::new(), exists, open, just_opened: 0.0 }
    }
}

impl Heard {
    /// What its part does next tells whether it had moved it: nobody closes what was closed before.
    fn reconsider(&mut self, did: Option<Action>, next: Action, rules: &SamePart) {
        let Some(open_before) = self.open_before else { return };
        let [moved, still] = [stands_open(did), open_before].map(|open| likely(next, open, rules));
        self.share *= moved / (self.share * moved + (1.0 - self.share) * still);
    }
}

/// How likely a part stands open after a motion.
fn stands_open(action: Option<Action>) -> f64 {
    match action {
        Some(Action::Open) => 1.0,
        Some(Action::Close) => 0.0,
        None => 0.5,
    }
}

/// How likely the next motion of a part that a clip shows is such a one, where it is likely so far that the part stands open: the
/// other one may have been in no clip. Up to what both have in common.
fn likely(action: Action, open: f64, rules: &SamePart) -> f64 {
    let SamePart { unseen_openings, unseen_closings, .. } = *rules;
    match action {
        Action::Open => (1.0 - unseen_openings) * ((1.0 - open) + open * unseen_closings),
        Action::Close => (1.0 - unseen_closings) * (open + (1.0 - open) * unseen_openings),
    }
}

/// Log odds, nats, of a motion of a part in its state, against one of a part of which nothing is known and which stands closed.
fn turn(part: &Part, action: Action, rules: &SamePart) -> f64 {
    let state = nats(likely(action, part.open, rules) / likely(action, 0.0, rules));
    let at_once = rules.closed_at_once / (1.0 - rules.closed_at_once) * rules.parts;
    state + if action == Action::Close { (part.just_opened * at_once).ln_1p() } else { 0.0 }
}

/// Odds of one part by the hands of an opening and the closing that follows: the part stands where it was left, so that its open
/// ends tell, too, and that one hand went where the other one did. If all was seen well, the ends are compared that were seen better.
/// If a closed end was not, the face and the hinge that were looked for near it say nothing, but the other end and the way do.
fn handed_over(opened: &Held, closed: &Held, model: &Model) -> HandOdds {
    let (a, b) = (&opened.sight, &closed.sight);
    let shut_m2 = model.variance(a.grip_std_m, b.grip_std_m);
    let open_m2 = model.variance(opened.open_std_m, closed.open_std_m);
    let way_m2 = model.variance(a.grip_std_m.min(opened.open_std_m), b.grip_std_m.min(closed.open_std_m));
    let shut = model.grips(a, b);
    let open = model.near((opened.open - closed.open).norm(), open_m2);
    let way = model.near(apart(opened.path, closed.path), way_m2);
    let ends = if open_m2 < shut_m2 { open.well } else { shut.well };
    // Where no end was seen by both hands, the way tells as much.
    let well = if way_m2 < shut_m2.min(open_m2) { 0.5 * (ends + way.well) } else { ends };
    HandOdds { well, badly: (shut.badly + open.well + way.well) / 3.0 }
}

/// Shortest distance between the points of two paths; infinite where one has none.
fn apart(a: &[Point], b: &[Point]) -> f64 {
    a.iter().flat_map(|p| b.iter().map(move |q| (p - q).norm())).fold(f64::INFINITY, f64::min)
}

/// Which of a part's clips saw it worst, the oldest of equals: an outline is the best that a clip can have seen, then its grip.
fn least_seen(asked: &[usize], clips: &[Held]) -> usize {
    let seen = |k: &usize| {
        let sight = &clips[asked[*k]].sight;
        (sight.outline.is_some(), -sight.grip_std_m)
    };
    let less = |a: &usize, b: &usize| seen(a).0.cmp(&seen(b).0).then(seen(a).1.total_cmp(&seen(b).1));
    (0..asked.len()).min_by(less).unwrap_or(0)
}

/// Which of the parts are one after all, by what all their clips together show of them: no two parts cover the same piece of a
/// face. Indices into `fronts`, each part with those that join it, in order.
#[must_use]
pub fn same_fronts(fronts: &[Option<Sight>], config: &Config) -> Vec<Vec<usize>> {
    let rules = &config.inference;
    // The paper's grouping knows no fronts.
    let asked = rules.merge_clips && rules.grouping == GroupingMethod::Places;
    let SamePart { joins, near_m, .. } = rules.same_part;
    let enough = nats(joins / (1.0 - joins));
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for (i, front) in fronts.iter().enumerate() {
        let one =
            |a: Sight, b: Sight| asked && (a.grip - b.grip).norm() <= near_m && log_odds(&a, &b, config) >= enough;
        let meets = |&j: &usize| front.zip(fronts[j]).is_some_and(|(a, b)| one(a, b));
        let (mut joined, apart): (Vec<Vec<usize>>, _) = sets.into_iter().partition(|set| set.iter().any(meets));
        joined.push(vec![i]);
        let mut set = joined.concat();
        set.sort_unstable();
        sets = apart;
        sets.push(set);
    }
    sets.sort();
    sets
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::{Articulation, JointKind};
    use crate::config::Inference;
    use crate::geometry::{Face, Rect};
    use crate::math::Vector;

    fn face(center: Point) -> Face {
        let (right, up, normal) = (-Vector::x(), Vector::z(), Vector::y());
        Face { center, normal, up, right, extent: [[-1.0, 1.0]; 2], support: 1.0 }
    }

    /// A clip of which both ends were seen, on a face through the origin.
    fn held(action: Action, closed: [f64; 3], open: [f64; 3]) -> Held<'static> {
        let (grip, open) = (Point::from(closed), Point::from(open));
        let face = Some(face(Point::new(grip.x, 0.0, grip.z)));
        let name = Name::default();
        let sight = Sight { grip, grip_std_m: 0.03, face, outline: None, joint: None, name };
        Held { sight, action, open, open_std_m: 0.03, path: &[], voxels: &[] }
    }

    fn name(furniture: &'static str) -> Name<'static> {
        let kind = if furniture == "drawer" { JointKind::Prismatic } else { JointKind::Revolute };
        Name { furniture: Some(furniture), kind: Some(kind) }
    }

    /// A clip of which nothing but a drawer's place at `x` and a name is known.
    fn pulled(action: Action, x: f64, name: Name<'static>) -> Held<'static> {
        let [closed, open] = [[x, 0.0, 0.7], [x, 0.3, 0.7]];
        let clip = held(action, closed, open);
        Held { sight: Sight { name, ..clip.sight }, path: [closed, open].map(Point::from).to_vec().leak(), ..clip }
    }

    fn parts(clips: &[Held], missed: &[Missed]) -> Vec<Vec<usize>> {
        group(clips, missed, &Config::default()).parts
    }

    #[test]
    fn drawers_of_a_stack_stay_apart() {
        let clips = [
            held(Action::Open, [0.0, 0.0, 0.7], [0.0, 0.4, 0.7]),
            held(Action::Open, [0.0, 0.0, 0.5], [0.0, 0.4, 0.5]),
            held(Action::Close, [0.0, 0.02, 0.52], [0.0, 0.38, 0.5]),
            held(Action::Close, [0.0, 0.02, 0.69], [0.0, 0.4, 0.7]),
        ];
        assert_eq!(parts(&clips, &[]), [vec![0, 3], vec![1, 2]]);
    }

    #[test]
    fn the_papers_grouping_asks_for_voxels_and_for_nothing_else() {
        let rows: [Vec<[i32; 3]>; 3] = [0..9, 20..29, 1..9].map(|xs| xs.map(|x| [x, 0, 0]).collect());
        let [here, far, again] = &rows;
        // One grip when closed, which tells them to be one part.
        let clip = |voxels| Held { voxels, ..pulled(Action::Open, 0.0, name("drawer")) };
        let clips = [here, far, again].map(|row| clip(row.as_slice()));
        let with = |merge_clips, grouping| {
            let inference = Inference { merge_clips, grouping, ..Default::default() };
            group(&clips, &[], &Config { inference, ..Default::default() }).parts
        };
        assert_eq!(with(true, GroupingMethod::Places), [vec![0, 1, 2]]);
        assert_eq!(with(true, GroupingMethod::Voxels), [vec![0, 2], vec![1]]);
        assert_eq!(with(false, GroupingMethod::Voxels).len(), 3);
    }

    #[test]
    fn a_closing_whose_end_was_not_seen_belongs_to_the_opening_before_it() {
        let opened = held(Action::Open, [0.0, 0.0, 0.7], [0.3, 0.4, 0.7]);
        let closed = held(Action::Close, [0.25, 0.3, 0.7], [0.31, 0.42, 0.72]);
        let lost = |clip: Held<'static>| Held { sight: Sight { grip_std_m: 0.12, ..clip.sight }, ..clip };
        assert_eq!(parts(&[opened, lost(closed)], &[]), [vec![0, 1]]);
        // No end was seen by both: one hand went where the other one did, or far beside.
        let open_lost = Held { open_std_m: 0.12, ..opened };
        let way = |x: f64| [[x, 0.1, 0.7], [x, 0.3, 0.7]].map(Point::from).to_vec().leak();
        let model = Config::default();
        let odds = |x: f64| {
            handed_over(
                &Held { path: way(0.1), ..open_lost },
                &Held { path: way(x), ..lost(closed) },
                &Model::of(&model),
            )
            .well
        };
        assert!(odds(0.1) > 5.0 * odds(0.6), "{} {}", odds(0.1), odds(0.6));
    }

    #[test]
    fn what_is_closed_is_what_stands_open() {
        let (here, near, far) = (0.0, 0.25, 3.0);
        let open = |x: f64| pulled(Action::Open, x, name("drawer"));
        let close = |x: f64| pulled(Action::Close, x, name("drawer"));
        // Seen 25 cm apart, with another drawer opened in between.
        assert_eq!(parts(&[open(here), open(far), close(near)], &[]), [vec![0, 2], vec![1]]);
        // Two stand open: the distance alone does not tell.
        assert_eq!(parts(&[open(here), open(0.5), open(far), close(near)], &[]).len(), 4);
        // Unless one of them was opened just before.
        assert_eq!(parts(&[open(here), open(far), open(0.5), close(near)], &[]), [vec![0], vec![1], vec![2, 3]]);
        // Closed already, and called by another name right after it was opened.
        assert_eq!(parts(&[open(here), close(here), close(near)], &[]).len(), 2);
        let oven = pulled(Action::Close, 0.2, name("oven"));
        assert_eq!(parts(&[open(here), oven], &[]).len(), 1);
        // Unless that is elsewhere, or something was opened since.
        assert_eq!(parts(&[open(far), oven], &[]).len(), 2);
        assert_eq!(parts(&[open(here), open(far), oven], &[]).len(), 3);
        // Without a name, it is what stands open there.
        let it = pulled(Action::Close, 0.2, Name::default());
        assert_eq!(parts(&[open(here), it], &[]).len(), 1);
        assert_eq!(parts(&[open(here), open(far), it], &[]), [vec![0, 2], vec![1]]);
    }

    #[test]
    fn what_was_opened_twice_was_closed_by_somebody_where_the_hands_meet() {
        let at = |x: f64| pulled(Action::Open, x, name("drawer"));
        assert_eq!(parts(&[at(0.0), at(0.0)], &[]), [vec![0, 1]]);
        // A hand's width beside it, that is said of a part that was closed only.
        let closed = pulled(Action::Close, 0.0, name("drawer"));
        assert_eq!(parts(&[at(0.0), at(0.12)], &[]).len(), 2);
        assert_eq!(parts(&[at(0.0), closed, at(0.06)], &[]).len(), 1);
    }

    #[test]
    fn a_clip_without_a_hand_may_have_closed_what_stood_open() {
        let missed = |furniture: Option<&'static str>| {
            [Missed { after: 1, action: Some(Action::Close), name: furniture.map(name).unwrap_or_default() }]
        };
        let opened = pulled(Action::Open, 0.0, name("drawer"));
        let closed = |furniture| pulled(Action::Close, 0.25, name(furniture));
        assert_eq!(parts(&[opened, closed("oven")], &missed(Some("drawer"))).len(), 2);
        assert_eq!(parts(&[opened, closed("drawer")], &missed(Some("drawer"))).len(), 2);
        assert_eq!(parts(&[opened, closed("drawer")], &missed(None)).len(), 2);
        // One of another name did not.
        let near = pulled(Action::Close, 0.2, name("drawer"));
        assert_eq!(parts(&[opened, near], &missed(Some("oven"))).len(), 1);
    }

    #[test]
    fn what_nobody_saw_opened_is_closed_first() {
        let missed = [Missed { after: 1, action: Some(Action::Open), name: name("drawer") }];
        let clips = [(Action::Open, 0.0), (Action::Close, 0.4)].map(|(action, x)| pulled(action, x, name("drawer")));
        let found = group(&clips, &missed, &Config::default());
        assert_eq!(found.parts.len(), 2);
        assert_eq!(found.ties, [Tie { missed: 0, with: 1, action: Action::Open }]);
    }

    /// Ties of clips at one place, by action, name and whether a hand was followed; `first` is where the first one is.
    fn ties(said: &[(Action, &'static str, bool)], first: f64) -> Vec<[usize; 2]> {
        let (mut clips, mut missed): (Vec<Held>, Vec<Missed>) = (Vec::new(), Vec::new());
        for &(action, word, hand) in said {
            let name = if word == "it" { Name::default() } else { name(word) };
            let x = if clips.is_empty() { first } else { 0.0 };
            match hand {
                true => clips.push(pulled(action, x, name)),
                false => missed.push(Missed { after: clips.len(), action: Some(action), name }),
            }
        }
        group(&clips, &missed, &Config::default()).ties.iter().map(|tie| [tie.missed, tie.with]).collect()
    }

    #[test]
    fn a_clip_without_a_hand_moves_what_its_narration_says() {
        use Action::{Close, Open};
        assert_eq!(ties(&[(Open, "oven", true), (Close, "oven", false)], 0.0), [[0, 0]]);
        assert_eq!(ties(&[(Open, "drawer", false), (Close, "it", true)], 0.0), [[0, 0]]);
        for said in [
            [(Open, "oven", true), (Close, "drawer", false)],
            [(Close, "oven", true), (Close, "oven", false)],
            [(Open, "oven", false), (Open, "oven", true)],
            [(Open, "oven", false), (Close, "oven", false)],
            [(Open, "oven", true), (Close, "oven", true)],
        ] {
            assert!(ties(&said, 0.0).is_empty(), "{said:?}");
        }
        // What is shut already is not closed, what stands open not opened, unless the other clip moved another part.
        let open_twice = [(Open, "oven", true), (Open, "it", false), (Close, "oven", true)];
        assert!(ties(&open_twice, 0.0).is_empty());
        assert_eq!(ties(&open_twice, 3.0), [[0, 1]]);
        let shut_twice = [(Open, "oven", true), (Close, "it", false), (Close, "oven", true)];
        assert!(ties(&shut_twice, 0.0).is_empty());
        assert_eq!(ties(&shut_twice, 3.0), [[0, 0]]);
    }

    #[test]
    fn many_clips_of_two_parts_are_two_parts() {
        let action = |i: usize| if i.is_multiple_of(2) { Action::Open } else { Action::Close };
        // Errors of a few centimetres that add up to none.
        let off = |i: usize| 0.02 * ((i * 7 % 5) as f64 - 2.0);
        let place = |i: usize| if i % 4 < 2 { 0.0 } else { 0.6 };
        let clip = |i: usize| pulled(action(i), place(i) + off(i), name("drawer"));
        let clips: Vec<Held> = (0..400).map(clip).collect();
        let found = parts(&clips, &[]);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [200, 200]);
    }

    #[test]
    fn no_two_parts_cover_one_piece_of_a_face() {
        let front = |depth: f64, [left, right]: [f64; 2], [low, high]: [f64; 2], grip: [f64; 2]| {
            let face = face(Point::new(0.0, depth, 0.5));
            let outline = Some(Rect { bounds: [[left, right], [low, high]] });
            let grip = face.point(grip[0], grip[1], 0.0);
            Some(Sight { grip, grip_std_m: 0.03, face: Some(face), outline, joint: None, name: Name::default() })
        };
        let config = Config::default();
        let drawer = front(0.0, [-0.3, 0.3], [-0.1, 0.1], [0.0, 0.05]);
        let again = front(0.02, [-0.25, 0.3], [-0.1, 0.1], [0.05, 0.0]);
        let below = front(0.0, [-0.3, 0.3], [-0.3, -0.1], [0.0, -0.2]);
        // Seen to reach over the one below.
        let tall = front(0.0, [-0.3, 0.3], [-0.3, 0.1], [0.0, 0.05]);
        // Behind a door.
        let inner = front(-0.15, [-0.3, 0.3], [-0.1, 0.1], [0.0, 0.0]);
        assert_eq!(same_fronts(&[drawer, below, None, again], &config), [vec![0, 3], vec![1], vec![2]]);
        assert_eq!(same_fronts(&[tall, below, inner], &config), [vec![0], vec![1], vec![2]]);
        // Hinges at both outer edges, under outlines that reach over both leaves.
        let hinge =
            |x: f64| Articulation { kind: JointKind::Revolute, axis: Vector::z(), origin: Point::new(x, 0.0, 0.5) };
        let hung = |front: Option<Sight<'static>>, x: f64| front.map(|f| Sight { joint: Some(hinge(x)), ..f });
        assert_eq!(same_fronts(&[hung(drawer, -0.3), hung(again, 0.3)], &config).len(), 2);
        // A lid seen from its other side.
        let turned = again.map(|f| {
            let turn =
                |Rect { bounds: [[left, right], [low, high]] }| Rect { bounds: [[-right, -left], [-high, -low]] };
            let face = f.face.map(|face| Face { right: -face.right, up: -face.up, ..face });
            Sight { face, outline: f.outline.map(turn), ..f }
        });
        assert_eq!(same_fronts(&[drawer, turned], &config).len(), 1);
        let alone = Inference { merge_clips: false, ..Default::default() };
        assert_eq!(same_fronts(&[drawer, again], &Config { inference: alone, ..config }).len(), 2);
    }
}
