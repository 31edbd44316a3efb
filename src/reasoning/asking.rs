//! Asking a language model about a clip (§3.3, §A.6): the pictures that it is shown, the questions, and the count of its answers.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use super::answers::{self, Motion};
use super::heuristic::Geometric;
use super::marks::{self, Image, Mark};
use super::prompts::{AxisChoice, MotionType, Prompts, Summary};
use super::words::{AskedClip, LineVote, Words};
use super::{Answer, Question, Reasoner};
use crate::articulation::JointKind;
use crate::config;
use crate::error::Result;
use crate::geometry::LineTrack;
use crate::math::{sampling, segment_distance};
use crate::recording::{Clip, Grid};
use crate::vlm::{self, EncodedPicture, LanguageModel, Sampling};

/// The geometric heuristic, with a language model's words as further evidence.
#[derive(Clone, Copy)]
pub struct Asking<'a> {
    /// Weighs everything.
    pub geometric: &'a Geometric,
    /// Who is asked.
    pub model: &'a dyn LanguageModel,
    /// How.
    pub prompts: &'a Prompts,
    /// Questions of one clip under way at the same time.
    pub at_once: usize,
}

impl Reasoner for Asking<'_> {
    fn words(&self, sight: &AskedClip) -> Result<Option<Words>> {
        self.ask(sight)
    }

    fn answer(&self, question: &Question) -> Answer {
        self.geometric.answer(question)
    }

    fn name(&self) -> &'static str {
        "geometric heuristic with a language model"
    }
}

/// The usable answer of one view: the lines that it offered, and which of them were chosen.
type ViewVote = (Vec<usize>, Vec<usize>);

impl Asking<'_> {
    /// Both questions about one clip; `None` where there is nothing to show.
    ///
    /// # Errors
    /// Images that cannot be decoded, and what [`LanguageModel::ask`] calls an error.
    pub fn ask(&self, sight: &AskedClip) -> Result<Option<Words>> {
        let frames = self.frames(sight);
        let mut words = Words::default();
        let notes = in_order(frames.len(), self.at_once, |i| self.about_frame(sight, frames[i], i + 1, frames.len()))?;
        let mut names: Vec<String> = Vec::new();
        for note in &notes {
            let said = note.as_deref().map(answers::motion).unwrap_or_default();
            match said.kind {
                Some(JointKind::Revolute) => words.revolute += 1,
                Some(JointKind::Prismatic) => words.prismatic += 1,
                None => words.unknown += 1,
            }
            names.extend(said.furniture);
        }
        words.furniture = most_frequent(&names);
        if notes.iter().any(Option::is_some) {
            let summary = self.about_clip(sight, &notes)?;
            words.summary = summary.kind;
            words.furniture = summary.furniture.or(words.furniture);
        }

        // What slides has no hinge to choose; where nobody knows, the hinge is asked for.
        let views = if words.log_odds(&self.geometric.reasoning) < 0.0 { Vec::new() } else { self.views(sight) };
        let votes =
            in_order(views.len(), self.at_once, |i| self.about_view(sight, views[i], words.furniture.as_deref()))?;
        words.lines = tally(votes.into_iter().flatten());
        Ok((!frames.is_empty() || !views.is_empty()).then_some(words))
    }

    fn question(
        &self,
        sight: &AskedClip,
        name: &str,
        text: String,
        pictures: Vec<EncodedPicture>,
    ) -> vlm::PictureQuestion {
        let reasoning = &self.geometric.reasoning;
        vlm::PictureQuestion {
            purpose: format!("{}/{name}", sight.clip.clip),
            text,
            pictures,
            sampling: Sampling {
                temperature: reasoning.vlm_temperature,
                top_p: reasoning.vlm_top_p,
                max_tokens: reasoning.vlm_max_tokens,
            },
        }
    }

    /// Frames of the clip to show, evenly spread (§A.6).
    fn frames(&self, sight: &AskedClip) -> Vec<usize> {
        let seen: Vec<usize> = (sight.clip.start_frame..=sight.clip.end_frame)
            .filter(|&f| sight.recording.frames.get(f).is_some_and(|f| f.files.rgb.is_some()))
            .collect();
        sampling::evenly(&seen, self.geometric.reasoning.vlm_frames)
    }

    /// Views in which to ask for the hinge, evenly spread.
    fn views(&self, sight: &AskedClip) -> Vec<usize> {
        if sight.lines.is_empty() {
            Vec::new()
        } else {
            sampling::evenly(sight.views, self.geometric.reasoning.vlm_views)
        }
    }

    /// How does the part move, as far as one frame tells?
    fn about_frame(&self, sight: &AskedClip, frame: usize, number: usize, total: usize) -> Result<Option<String>> {
        let Some(image) = sight.recording.rgb(frame)? else { return Ok(None) };
        let text = self.prompts.motion_type(&MotionType {
            frame_number: number,
            total_frames: total,
            narration: narration(sight.clip),
            fixture: sight.fixture(),
        })?;
        let picture = marks::jpeg(&marks::shrunk(&image, self.geometric.reasoning.vlm_picture_px))?;
        self.model.ask(&self.question(sight, &format!("motion_{number:02}_frame_{frame:06}"), text, vec![picture]))
    }

    /// How does it move in the whole clip, given what was said of its frames?
    fn about_clip(&self, sight: &AskedClip, notes: &[Option<String>]) -> Result<Motion> {
        // A note is a line; a model that wrote an essay is cut short.
        let most = self.geometric.reasoning.vlm_note_chars;
        let line = |note: &Option<String>| -> String {
            let words: Vec<&str> = note.as_deref().unwrap_or("no answer").split_whitespace().collect();
            words.join(" ").chars().take(most).collect()
        };
        let lines: Vec<String> = notes.iter().map(line).collect();
        let text = self.prompts.summary(&Summary {
            total_frames: notes.len(),
            narration: narration(sight.clip),
            fixture: sight.fixture(),
            answers: &lines,
        })?;
        let answer = self.model.ask(&self.question(sight, "summary", text, Vec::new()))?;
        Ok(answer.as_deref().map(answers::motion).unwrap_or_default())
    }

    /// Which of the lines of one view could be the hinge? `None` without lines, or without a usable answer.
    fn about_view(&self, sight: &AskedClip, view: usize, furniture: Option<&str>) -> Result<Option<ViewVote>> {
        let Some((image, shown)) = marked_view(sight, view, &self.geometric.reasoning)? else {
            return Ok(None);
        };
        let text = self.prompts.axis_choice(&AxisChoice {
            count: shown.len(),
            numbers: &numbers(shown.len()),
            furniture: furniture.or_else(|| sight.fixture()),
            narration: narration(sight.clip),
        })?;
        let picture = marks::jpeg(&image)?;
        let answer = self.model.ask(&self.question(sight, &format!("axis_view_{view:06}"), text, vec![picture]))?;
        let chosen = answer.and_then(|a| answers::lines(&a, shown.len()));
        Ok(chosen.map(|numbers| {
            let chosen = numbers.iter().map(|n| shown[n - 1]).collect();
            (shown, chosen)
        }))
    }
}

/// A view with the longest of its visible lines (`vlm_lines_per_view`) marked on it, and which lines those are; `None` where it shows none.
///
/// # Errors
/// Images that cannot be decoded.
pub fn marked_view(sight: &AskedClip, view: usize, config: &config::Reasoning) -> Result<Option<(Image, Vec<usize>)>> {
    let recording = sight.recording;
    let Some(image) = recording.rgb(view)? else { return Ok(None) };
    let (depth, mask) = (recording.depth(view)?, recording.mask(view)?);
    let eye = Eye { sight, view, depth: depth.as_ref(), mask: mask.as_ref() };
    let mut seen: Vec<(usize, Mark)> =
        sight.lines.iter().enumerate().filter_map(|(i, line)| Some((i, eye.mark(line, config)?))).collect();
    let length = |[a, b]: &Mark| (a[0] - b[0]).hypot(a[1] - b[1]);
    seen.sort_by(|(i, a), (j, b)| length(b).total_cmp(&length(a)).then(i.cmp(j)));
    // Of two that lie on each other in the picture nobody could say which is meant.
    let too_near_px = image.width.min(image.height) as f64 / config.vlm_lines_apart;
    let mut kept: Vec<(usize, Mark)> = Vec::new();
    for (i, mark) in seen {
        if kept.len() < config.vlm_lines_per_view
            && !kept.iter().any(|(_, other)| on_each_other(&mark, other, too_near_px))
        {
            kept.push((i, mark));
        }
    }
    if kept.is_empty() {
        return Ok(None);
    }
    let small = marks::shrunk(&image, config.vlm_picture_px);
    let scale = small.width as f64 / image.width as f64;
    let (shown, marks): (Vec<usize>, Vec<Mark>) =
        kept.into_iter().map(|(i, mark)| (i, mark.map(|end| end.map(|c| (c + 0.5) * scale - 0.5)))).unzip();
    Ok(Some((marks::draw(&small, &marks), shown)))
}

/// One view of the scene, decoded.
struct Eye<'a> {
    sight: &'a AskedClip<'a>,
    view: usize,
    depth: Option<&'a Grid<f32>>,
    mask: Option<&'a Grid<u8>>,
}

impl Eye<'_> {
    /// The stretch of a line that lies on the image; `None` where it is too short to see, mostly hidden, or off the mask
    /// of the touched furniture (§3.3).
    fn mark(&self, line: &LineTrack, config: &config::Reasoning) -> Option<Mark> {
        /// Arithmetic: places along a line that are looked at.
        const STEPS: usize = 128;
        let [hidden_m, hidden_share] = config.vlm_hidden_behind;
        let camera = self.sight.recording.camera_of(self.view);
        let camera_from_world = self.sight.recording.frames.get(self.view)?.world_from_camera.inverse();
        let [a, b] = line.segment.ends().map(|p| camera_from_world * p);
        let (mut ends, mut inside, mut open, mut touching): (Option<Mark>, usize, usize, usize) = (None, 0, 0, 0);
        for i in 0..=STEPS {
            let p = a + (b - a) * (i as f64 / STEPS as f64);
            let Some((u, v)) = camera.project(&p).filter(|&(u, v)| p.z > config.vlm_nearest_m && camera.contains(u, v))
            else {
                continue;
            };
            ends = Some(ends.map_or([[u, v]; 2], |[first, _]| [first, [u, v]]));
            inside += 1;
            // A line that other things hide would be drawn on them.
            let seen = self.depth.and_then(|d| d.nearest(u, v)).map_or(0.0, f64::from);
            open += usize::from(seen <= 0.0 || seen > p.z - (hidden_m + hidden_share * p.z));
            touching += usize::from(self.on_mask(u, v, config.vlm_mask_rim_px));
        }
        let ends = ends?;
        let length = (ends[0][0] - ends[1][0]).hypot(ends[0][1] - ends[1][1]);
        let long = length >= config.vlm_shortest_line * camera.width.min(camera.height) as f64;
        (long && 2 * open >= inside && touching > 0).then_some(ends)
    }

    /// Whether a pixel, or one beside it, shows the touched furniture. Without masks every line counts: lines are tracked
    /// at the region only.
    fn on_mask(&self, u: f64, v: f64, rim_px: f64) -> bool {
        // An edge of furniture is an edge of its mask.
        let reach = [-rim_px, 0.0, rim_px];
        let (Some(mask), Some(class)) = (self.mask, self.sight.region.class) else { return true };
        reach.iter().any(|dv| reach.iter().any(|du| mask.nearest(u + du, v + dv) == Some(class)))
    }
}

/// Whether two marks lie on each other along the shorter of them.
fn on_each_other(a: &Mark, b: &Mark, within: f64) -> bool {
    let on = |a: &Mark, b: &Mark| a.iter().all(|end| segment_distance(*end, b[0], b[1]) < within);
    on(a, b) || on(b, a)
}

/// Counts the votes of all views, by line.
fn tally(votes: impl Iterator<Item = ViewVote>) -> Vec<LineVote> {
    let mut counts: BTreeMap<usize, [usize; 2]> = BTreeMap::new();
    for (shown, chosen) in votes {
        for line in shown {
            let count = counts.entry(line).or_default();
            count[0] += 1;
            count[1] += usize::from(chosen.contains(&line));
        }
    }
    counts.into_iter().map(|(line, [offered, chosen])| LineVote { line, offered, chosen }).collect()
}

/// What the person is said to do; the verb and the noun where there is no sentence.
fn narration(clip: &Clip) -> &str {
    [&clip.narration, &clip.noun, &clip.verb].into_iter().find(|s| !s.trim().is_empty()).map_or("", |s| s.trim())
}

/// "1", "1 and 2", "1, 2 and 3".
fn numbers(count: usize) -> String {
    let all: Vec<String> = (1..=count).map(|n| n.to_string()).collect();
    match all.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => all.join(""),
    }
}

/// The most frequent of some names, the earliest of equals.
fn most_frequent(names: &[String]) -> Option<String> {
    let times = |name: &String| names.iter().filter(|n| *n == name).count();
    names.iter().rev().max_by_key(|name| times(name)).cloned()
}

/// Results of `job(0)`, `job(1)`, ... in order, up to `at_once` of them under way at the same time: they wait for a server,
/// not for this machine. The first error ends all.
pub(super) fn in_order<T: Send>(
    count: usize,
    at_once: usize,
    job: impl Fn(usize) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<T>)>> = Mutex::default();
    std::thread::scope(|scope| {
        for _ in 0..at_once.max(1).min(count) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= count {
                        break;
                    }
                    let result = job(i);
                    if result.is_err() {
                        next.store(count, Ordering::Relaxed);
                    }
                    done.lock().unwrap_or_else(PoisonError::into_inner).push((i, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn votes_are_counted_by_line() {
        let votes = [(vec![0, 2], vec![2]), (vec![2, 5], vec![2, 5]), (vec![2], vec![])];
        let expected =
            [(0, 1, 0), (2, 3, 2), (5, 1, 1)].map(|(line, offered, chosen)| LineVote { line, offered, chosen });
        assert_eq!(tally(votes.into_iter()), expected);
    }

    #[test]
    fn names_and_numbers_read_well() {
        assert_eq!((1..=3).map(numbers).collect::<Vec<_>>(), ["1", "1 and 2", "1, 2 and 3"]);
        let names = ["oven", "fridge", "fridge", "oven"].map(str::to_owned);
        assert_eq!(most_frequent(&names).as_deref(), Some("oven"));
        assert_eq!(most_frequent(&[]), None);
    }

    #[test]
    fn jobs_come_back_in_order_and_the_first_error_ends_them() {
        let squares = in_order(20, 3, |i| Ok(i * i)).unwrap();
        assert_eq!(squares, (0..20).map(|i| i * i).collect::<Vec<_>>());
        assert_eq!(in_order(0, 3, Ok).unwrap(), [0usize; 0]);
        let ran = AtomicUsize::new(0);
        let failed = in_order(1000, 2, |i| {
            ran.fetch_add(1, Ordering::Relaxed);
            if i == 3 { Err(crate::error::Error::Vlm("no".to_owned())) } else { Ok(i) }
        });
        assert!(failed.is_err() && ran.load(Ordering::Relaxed) < 1000);
    }

    #[test]
    fn lines_on_each_other_are_told_from_lines_that_meet() {
        let line = [[0.0, 0.0], [100.0, 0.0]];
        assert!(on_each_other(&[[20.0, 3.0], [60.0, 4.0]], &line, 5.0));
        assert!(on_each_other(&line, &[[20.0, 3.0], [60.0, 4.0]], 5.0));
        assert!(!on_each_other(&[[0.0, 0.0], [0.0, 50.0]], &line, 5.0));
        assert!(!on_each_other(&[[0.0, 9.0], [100.0, 9.0]], &line, 5.0));
    }
}
