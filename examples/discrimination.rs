//! How well the physical proof tells right joints from wrong ones.
//!
//! `cargo run --release --example discrimination -- [TIERS] [SEED] [KITCHENS] [--json FILE]`
//!
//! Kitchens of the synthetic benchmark are played, not rendered: the hands as an estimator sees them go through the same
//! trimming and smoothing as those of a recording. Each part that the person opens is proved on its true joint and on wrong
//! siblings of it (`evaluation::siblings`), under each clip alone and under all clips together. The furniture is the true
//! one, whatever joint is tried in it. Told are the shares of each verdict and the area under the ROC (AUC) of two scores:
//! the tracking error, and the margin over the best rival.
//!
//! With `--answers DIR... --truth RECORDING...` the same for what `paws twin` answered, right or wrong. There the margin is
//! what the verdict rests on: the lesser of that over the best rival and the answer's own log odds.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Parser, ValueEnum};
use paws_twin::articulation::{Articulation, JointKind};
use paws_twin::config::{self, Config};
use paws_twin::error::Error;
use paws_twin::evaluation::bootstrap::Interval;
use paws_twin::evaluation::discrimination::{Scored, auc, auc_interval, paired, right_at, roc};
use paws_twin::evaluation::rules::measure;
use paws_twin::evaluation::siblings::{JointFault, siblings};
use paws_twin::evaluation::{Prediction, Predictions, Rule, Truth};
use paws_twin::fitting::joints::{Entry, JointsFile, Units, from_joints};
use paws_twin::hands::{self, Trajectory};
use paws_twin::inference::observed_range;
use paws_twin::json;
use paws_twin::math::{Vector, stats};
use paws_twin::recording::{AtWork, Recording, narration};
use paws_twin::report::table::aligned;
use paws_twin::synth::kitchen::OpenPart;
use paws_twin::synth::{Changes, Recorded, SynthOptions, Tier};
use paws_twin::twin::{OrientedBox, Part, Twin};
use paws_twin::validation::rivals::{Evidence, anchored};
use paws_twin::validation::{JointCheck, Validation, Verdict, log_odds, validate};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

type Failure = Box<dyn std::error::Error + Send + Sync>;

#[derive(Debug, Parser)]
struct Args {
    /// Tiers of the benchmark, separated by commas, or "all"; hand noise is varied on the first of them
    #[arg(default_value = "t2")]
    tiers: String,
    /// First seed
    #[arg(default_value_t = 1)]
    seed: u64,
    /// Kitchens of each tier, seed after seed; 0 for --answers alone
    #[arg(default_value_t = 10)]
    kitchens: u64,
    /// Parts that are opened in each kitchen
    #[arg(long, default_value_t = 6)]
    parts: usize,
    /// Write all numbers as JSON to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Folders that `paws twin` wrote
    #[arg(long, value_name = "DIR", num_args = 1.., requires = "truth")]
    answers: Vec<PathBuf>,
    /// The recordings of --answers, with their ground_truth.json
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    truth: Vec<PathBuf>,
}

const BENCHMARK: [Tier; 7] = [Tier::T0, Tier::T1, Tier::T2, Tier::Hd, Tier::T3, Tier::Short, Tier::Nonm];
/// Hand noise of the sweep, metres a direction.
const NOISES_M: [f64; 4] = [0.005, 0.01, 0.02, 0.03];
/// A wrong joint of the other type opens as such furniture does: about a right angle, a drawer's length.
const USUAL_RAD: f64 = 1.6;
const USUAL_M: f64 = 0.45;
/// And no joint opens farther than rivals do: half a turn, two metres.
const MOST_RAD: f64 = PI;
const MOST_M: f64 = 2.0;
/// More parts than any kitchen or twin has: numbers joints without naming them.
const PER_KITCHEN: usize = 1000;
/// The large twin of the timings, how often it is proved, and how many single clips are.
const LARGE_JOINTS: usize = 50;
const LARGE_RUNS: usize = 5;
const CLIP_RUNS: usize = 40;

/// A clip's hand and how far it really moved its part, rad or m.
struct Shown {
    clip: String,
    trajectory: Trajectory,
    moved: f64,
}

/// A kitchen that was played, as a twin with its true joints.
struct Kitchen {
    twin: Twin,
    /// All parts that were opened; some may not be in the twin.
    entries: Vec<Entry>,
    /// The clips of each piece of furniture.
    shown: Vec<Vec<Shown>>,
    /// The number of each true joint: the same for the same seed on every tier.
    joints: Vec<usize>,
    clips_without_hand: usize,
    not_built: Vec<String>,
}

/// What the proof says of one joint.
struct Trial {
    /// What is wrong about it; nothing about the true joint, unknown about an answer.
    fault: Option<JointFault>,
    verdict: Verdict,
    rms_m: f64,
    /// Not a number where there is none.
    margin_nats: f64,
}

impl Trial {
    fn of(fault: Option<JointFault>, check: &JointCheck) -> Self {
        let margin_nats = check.margin_nats.unwrap_or(f64::NAN);
        Self { fault, verdict: check.verdict, rms_m: check.rms_m, margin_nats }
    }

    /// What the verdict about an answer rests on: the lesser of the hands' margin and the answer's own log odds.
    fn of_answer(part: &Part, check: &JointCheck) -> Self {
        let trial = Self::of(None, check);
        let odds = part.joint.probability.map_or(f64::INFINITY, log_odds);
        Self { margin_nats: trial.margin_nats.min(odds), ..trial }
    }
}

/// A true joint and its siblings under one set of clips.
struct Case {
    joint: usize,
    kind: JointKind,
    /// The farthest that a clip moved the part, rad or m.
    opening: f64,
    clips: usize,
    trials: Vec<Trial>,
    /// Siblings whose simulation came to no finite state.
    not_simulated: usize,
}

/// An answer of the pipeline.
struct Answer {
    joint: usize,
    kind: JointKind,
    /// Under each of [`RULES`].
    right: [bool; 2],
    /// Proved by one clip alone (true) or as the twin was made, by all of its clips.
    alone: bool,
    trial: Trial,
}

const RULES: [Rule; 2] = [Rule::PawsLine, Rule::Sim];

/// A trial that counts, and how.
struct Judged<'a> {
    joint: usize,
    /// Trials under the same hand have the same number.
    hand: usize,
    right: bool,
    trial: &'a Trial,
}

/// How well a score tells right from wrong.
#[derive(Debug, Serialize)]
struct Score {
    auc: f64,
    /// 95 %, joints drawn.
    interval: Option<Interval>,
    /// Share in which the true joint beats the wrong one under the same hand.
    same_hand: Option<f64>,
    /// Share of right joints above a threshold that lets 5 % of the wrong ones pass.
    right_at_5_percent: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Summary {
    trials: usize,
    passed: f64,
    undetermined: f64,
    failed: f64,
    tracking_error: Option<Score>,
    margin: Option<Score>,
}

#[derive(Debug, Serialize)]
struct Row {
    joint: String,
    one_clip: Option<Summary>,
    all_clips: Option<Summary>,
}

#[derive(Debug, Serialize)]
struct Block {
    title: String,
    rows: Vec<Row>,
}

#[derive(Debug, Serialize)]
struct Timing {
    threads: usize,
    /// Median over single clips, each with its rivals.
    one_clip_ms: Option<f64>,
    one_clip_runs: usize,
    large_joints: usize,
    large_clips: usize,
    /// Median over the runs of the large twin.
    large_ms: Option<f64>,
    large_runs: usize,
}

#[derive(Debug, Default, Serialize)]
struct Output {
    tiers: Vec<&'static str>,
    seed: u64,
    kitchens: u64,
    parts_per_kitchen: usize,
    /// Clips of parts of the twins in which no hand was found.
    clips_without_hand: usize,
    not_built: Vec<String>,
    not_simulated: usize,
    blocks: Vec<Block>,
    answers: Vec<Block>,
    timing: Option<Timing>,
}

#[allow(clippy::print_stdout, reason = "an example prints")]
fn main() -> Result<(), Failure> {
    let args = Args::parse();
    let config = Config::default();
    let tiers = tiers(&args.tiers)?;
    let mut output = Output {
        tiers: tiers.iter().map(|t| t.name()).collect(),
        seed: args.seed,
        kitchens: args.kitchens,
        parts_per_kitchen: args.parts,
        ..Output::default()
    };
    if args.kitchens > 0 {
        kitchens(&args, &tiers, &config, &mut output)?;
    }
    if !args.answers.is_empty() {
        output.answers = answer_blocks(&answers(&args.answers, &args.truth)?);
    }
    for block in output.blocks.iter().chain(&output.answers) {
        println!("{}", text(block));
    }
    let clips = output.clips_without_hand;
    println!("{clips} clips without a hand; {} siblings that could not be simulated", output.not_simulated);
    for left in &output.not_built {
        println!("not built: {left}");
    }
    if let Some(t) = &output.timing {
        let ms = |ms: Option<f64>| ms.map_or("-".to_owned(), |ms| format!("{ms:.1} ms"));
        println!(
            "one clip with its rivals: {} (median of {}); {} joints with {} clips: {} (median of {}, {} threads)",
            ms(t.one_clip_ms),
            t.one_clip_runs,
            t.large_joints,
            t.large_clips,
            ms(t.large_ms),
            t.large_runs,
            t.threads
        );
    }
    if let Some(path) = &args.json {
        std::fs::write(path, json::text(&output)?)?;
    }
    Ok(())
}

fn tiers(names: &str) -> Result<Vec<Tier>, Failure> {
    if names == "all" {
        return Ok(BENCHMARK.to_vec());
    }
    names
        .split(',')
        .map(|name| {
            Tier::from_str(name, true).map_err(|_| {
                let all: Vec<&str> = Tier::value_variants().iter().map(|t| t.name()).collect();
                format!("\"{name}\" is no tier; there are {}, and \"all\" for the benchmark's", all.join(", ")).into()
            })
        })
        .collect()
}

/// Plays the kitchens of all tiers and fills in what they tell.
fn kitchens(args: &Args, tiers: &[Tier], config: &Config, output: &mut Output) -> Result<(), Failure> {
    let mut all: Vec<Case> = Vec::new();
    for (i, tier) in tiers.iter().enumerate() {
        let kitchens = play_all(args, *tier, None, config)?;
        for kitchen in &kitchens {
            output.clips_without_hand += kitchen.clips_without_hand;
            output.not_built.extend(kitchen.not_built.iter().cloned());
        }
        if i == 0 {
            output.timing = Some(timing(&kitchens, config)?);
        }
        let cases = cases(&kitchens, config)?;
        output.blocks.extend(blocks(tier.name(), &cases.iter().collect::<Vec<_>>()));
        all.extend(cases);
    }
    output.not_simulated = all.iter().map(|c| c.not_simulated).sum();
    if tiers.len() > 1 {
        output.blocks.extend(blocks("all tiers", &all.iter().collect::<Vec<_>>()));
    }
    if let Some(tier) = tiers.first() {
        for noise_m in NOISES_M {
            let noisy = cases(&play_all(args, *tier, Some(noise_m), config)?, config)?;
            let title = format!("{}, hand noise {:.1} cm", tier.name(), 100.0 * noise_m);
            for (kind, cases) in by_kind(&noisy.iter().collect::<Vec<_>>()) {
                output.blocks.push(Block { title: format!("{title}, {}s", kind.word()), rows: rows(&cases, family) });
            }
        }
    }
    Ok(())
}

fn play_all(args: &Args, tier: Tier, noise_m: Option<f64>, config: &Config) -> Result<Vec<Kitchen>, Failure> {
    (0..args.kitchens).into_par_iter().map(|i| play(args, tier, i, noise_m, config)).collect()
}

/// Plays a kitchen and builds the twin of the parts that were opened, with their true boxes and joints.
fn play(args: &Args, tier: Tier, number: u64, noise_m: Option<f64>, config: &Config) -> Result<Kitchen, Failure> {
    let seed = args.seed + number;
    let options = SynthOptions { seed, tier, width: 320, parts: args.parts };
    let recorded = Recorded::varied(&options, &Changes { hand_noise_m: noise_m, ..Changes::default() })?;
    let folder = tempfile::tempdir()?;
    for (name, text) in recorded.tables()? {
        std::fs::write(folder.path().join(name), text)?;
    }
    let recording = Recording::open(folder.path())?;
    let truth = Truth::read(folder.path())?;

    let opened: BTreeSet<&str> = truth.clips.values().flatten().map(|t| t.joint.as_str()).collect();
    let parts = &recorded.kitchen().parts;
    let entries: Vec<Entry> = parts.iter().filter(|p| opened.contains(p.id.as_str())).map(entry).collect();
    let scene = format!("{} {seed}", tier.name());
    let twin = built(scene.clone(), entries.clone(), config)?;
    let holds = hands::contact::holds(&recording, &AtWork::of(&recording), &config.hands)?;
    let shown: Vec<Vec<Shown>> = twin
        .furniture
        .iter()
        .map(|f| {
            let of_part = |clip: &str| {
                let truth = truth.clips.get(clip)?.as_ref()?;
                (truth.joint == f.part.id).then_some(truth.moved)
            };
            let clips = recording.clips.iter().zip(&holds).filter_map(|(clip, hold)| {
                let moved = of_part(&clip.clip)?;
                let hand = hands::trajectory(&recording, clip, &narration::read(clip), hold.as_ref(), &config.hands);
                let trajectory = hand.found()?.clone();
                Some(Shown { clip: clip.clip.clone(), trajectory, moved })
            });
            clips.collect()
        })
        .collect();
    let in_twin = |joint: &str| twin.furniture.iter().any(|f| f.part.id == joint);
    let clips = truth.clips.values().flatten().filter(|t| in_twin(&t.joint)).count();
    let place = |id: &str| parts.iter().position(|p| p.id == id).unwrap_or(0);
    let joints = twin.furniture.iter().map(|f| number as usize * PER_KITCHEN + place(&f.part.id)).collect();
    let not_built = twin.left_out.iter().map(|l| format!("{scene}, {}: {}", l.id, l.reason)).collect();
    let clips_without_hand = clips - shown.iter().map(Vec::len).sum::<usize>();
    Ok(Kitchen { twin, entries, shown, joints, clips_without_hand, not_built })
}

/// A true part in the form of the joints' file.
fn entry(part: &OpenPart) -> Entry {
    let joint = part.articulation;
    let kind = joint.kind.name();
    Entry {
        id: part.id.clone(),
        kind: Some(kind.to_owned()),
        axis: Some(joint.axis),
        origin: Some(joint.origin),
        range: Some([0.0, part.upper]),
        // The first box is the leaf or the front; handle and tray are made anew.
        part_box: part.blocks.first().map(|b| b.shape),
        handle: Some(part.handle),
        // A hinge tells it: a lid looks up, not out of its furniture.
        front: (joint.kind == JointKind::Prismatic).then_some(part.out),
        base_box: Some(part.base),
        label: Some(part.kind.to_owned()),
        boxes: Vec::new(),
    }
}

fn built(scene: String, joints: Vec<Entry>, config: &Config) -> Result<Twin, Failure> {
    let mut twin =
        from_joints(&JointsFile { scene, up: Vector::z(), units: Units::M, joints }, &config.fitting, &config.priors)?;
    for piece in &mut twin.furniture {
        let joint = &mut piece.part.joint;
        joint.balanced = is_carried(&joint.articulation);
    }
    Ok(twin)
}

/// In these kitchens every part stays where a hand leaves it: what turns about a level hinge has its weight carried.
fn is_carried(joint: &Articulation) -> bool {
    joint.kind == JointKind::Revolute && joint.axis.z.abs() <= 0.5
}

/// Each clip alone, then all of them.
fn sets(shown: &[Shown]) -> Vec<Vec<&Shown>> {
    let mut sets: Vec<Vec<&Shown>> = shown.iter().map(|s| vec![s]).collect();
    if shown.len() > 1 {
        sets.push(shown.iter().collect());
    }
    sets
}

fn cases(kitchens: &[Kitchen], config: &Config) -> Result<Vec<Case>, Failure> {
    let mut jobs = Vec::new();
    for kitchen in kitchens {
        for (index, shown) in kitchen.shown.iter().enumerate() {
            jobs.extend(sets(shown).into_iter().map(|set| (kitchen, index, set)));
        }
    }
    jobs.par_iter().map(|(kitchen, index, set)| case(kitchen, *index, set, config)).collect()
}

fn case(kitchen: &Kitchen, index: usize, set: &[&Shown], config: &Config) -> Result<Case, Failure> {
    let part = &kitchen.twin.furniture[index].part;
    let own = part.joint.articulation;
    let evidence: Vec<Evidence> = set.iter().filter_map(|s| Evidence::of(&s.trajectory, &config.validation)).collect();
    let wrong = siblings(part).into_iter().map(|s| (Some(s.fault), s.articulation));
    let (mut trials, mut not_simulated) = (Vec::new(), 0);
    for (fault, joint) in std::iter::once((None, own)).chain(wrong) {
        let twin = on(&kitchen.twin, index, joint, &evidence, &config.priors.resistance);
        let clips = set.iter().map(|s| (s.clip.clone(), &s.trajectory)).collect();
        match proved(&twin, index, clips, &config.validation)? {
            Some(check) => trials.push(Trial::of(fault, &check)),
            None => not_simulated += 1,
        }
    }
    Ok(Case {
        joint: kitchen.joints[index],
        kind: own.kind,
        opening: set.iter().map(|s| s.moved).fold(0.0, f64::max),
        clips: set.len(),
        trials,
        not_simulated,
    })
}

/// The twin with another joint in the same furniture. No joint is refuted by its limit: each reaches as far as the hands
/// went under it, as one that was inferred from them would.
fn on(twin: &Twin, index: usize, wanted: Articulation, hands: &[Evidence], table: &config::Resistance) -> Twin {
    let mut twin = twin.clone();
    let joint = &mut twin.furniture[index].part.joint;
    let (usual, most, damping, friction) = match wanted.kind {
        JointKind::Revolute => (USUAL_RAD, MOST_RAD, table.hinge_damping, table.hinge_friction),
        JointKind::Prismatic => (USUAL_M, MOST_M, table.slide_damping, table.slide_friction),
    };
    if joint.articulation.kind != wanted.kind {
        (joint.upper, joint.damping, joint.friction) = (usual, damping, friction);
    }
    let went = hands.iter().map(|h| observed_range(&wanted, &anchored(&wanted, h), &h.path)).fold(0.0, f64::max);
    joint.upper = joint.upper.max(went.min(most));
    joint.balanced = is_carried(&wanted);
    joint.articulation = wanted;
    twin
}

/// The proof of one joint of a twin; `None` where the simulation came to no finite state.
fn proved(
    twin: &Twin,
    index: usize,
    clips: Vec<(String, &Trajectory)>,
    config: &config::Validation,
) -> Result<Option<JointCheck>, Failure> {
    let mut hands = vec![Vec::new(); twin.furniture.len()];
    hands[index] = clips;
    match validate(twin, &hands, &Vector::z(), config) {
        Ok(validation) => Ok(validation.joints.into_iter().nth(index)),
        Err(Error::Simulation(_)) => Ok(None),
        Err(other) => Err(other.into()),
    }
}

/// The class of an opening, 0 for the smallest.
fn class(kind: JointKind, opening: f64) -> usize {
    let ends = match kind {
        JointKind::Revolute => [30f64, 60.0].map(f64::to_radians),
        JointKind::Prismatic => [0.1, 0.25],
    };
    ends.iter().filter(|end| opening >= **end).count()
}

/// The classes in words.
fn class_names(kind: JointKind) -> [&'static str; 3] {
    match kind {
        JointKind::Revolute => ["by less than 30 deg", "by 30 to 60 deg", "by more than 60 deg"],
        JointKind::Prismatic => ["by less than 10 cm", "by 10 to 25 cm", "by more than 25 cm"],
    }
}

/// Faults of one size, whatever the direction.
fn family(fault: JointFault) -> String {
    match fault {
        JointFault::Type | JointFault::Side | JointFault::Edge | JointFault::Inward => {
            "wrong type, side, edge or sense".to_owned()
        }
        JointFault::Shift(cm, _) => format!("pivot {cm} cm off"),
        JointFault::Tilt(deg, _) => format!("axis tilted by {deg} deg"),
    }
}

/// Hinges and slides apart, where there are any.
fn by_kind<'a>(cases: &[&'a Case]) -> Vec<(JointKind, Vec<&'a Case>)> {
    [JointKind::Revolute, JointKind::Prismatic]
        .into_iter()
        .map(|kind| (kind, cases.iter().copied().filter(|c| c.kind == kind).collect::<Vec<_>>()))
        .filter(|(_, cases)| !cases.is_empty())
        .collect()
}

/// Every fault for itself, then the classes of openings.
fn blocks(scope: &str, cases: &[&Case]) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (kind, cases) in by_kind(cases) {
        let title = format!("{scope}, {}s", kind.word());
        blocks.push(Block { title: title.clone(), rows: rows(&cases, JointFault::name) });
        for (i, words) in class_names(kind).into_iter().enumerate() {
            let of_class: Vec<&Case> = cases.iter().copied().filter(|c| class(kind, c.opening) == i).collect();
            if !of_class.is_empty() {
                blocks.push(Block { title: format!("{title} opened {words}"), rows: rows(&of_class, family) });
            }
        }
    }
    blocks
}

/// The right joint, the wrong ones by their labels, and all wrong ones.
fn rows(cases: &[&Case], label: fn(JointFault) -> String) -> Vec<Row> {
    let faults: BTreeSet<JointFault> = cases.iter().flat_map(|c| &c.trials).filter_map(|t| t.fault).collect();
    let mut labels: Vec<String> = faults.into_iter().map(label).collect();
    labels.dedup();
    let row = |name: &str, of_right: bool, wanted: &dyn Fn(JointFault) -> bool| {
        let summed = |several: bool| {
            let mut judged = Vec::new();
            for (hand, case) in cases.iter().enumerate().filter(|(_, c)| (c.clips > 1) == several) {
                for trial in case.trials.iter().filter(|t| t.fault.is_none_or(wanted)) {
                    judged.push(Judged { joint: case.joint, hand, right: trial.fault.is_none(), trial });
                }
            }
            summary(&judged, of_right)
        };
        Row { joint: name.to_owned(), one_clip: summed(false), all_clips: summed(true) }
    };
    let mut rows = vec![row("the right joint", true, &|_| false)];
    rows.extend(labels.iter().map(|name| row(name, false, &|fault| label(fault) == *name)));
    rows.push(row("all wrong joints", false, &|_| true));
    rows
}

/// Verdicts of the right or of the wrong joints, and how well both are told apart; `None` without any.
fn summary(judged: &[Judged], of_right: bool) -> Option<Summary> {
    let counted: Vec<&Trial> = judged.iter().filter(|j| j.right == of_right).map(|j| j.trial).collect();
    if counted.is_empty() {
        return None;
    }
    let share =
        |verdict: Verdict| counted.iter().filter(|t| t.verdict == verdict).count() as f64 / counted.len() as f64;
    Some(Summary {
        trials: counted.len(),
        passed: share(Verdict::Pass),
        undetermined: share(Verdict::Undetermined),
        failed: share(Verdict::Fail),
        tracking_error: score(judged, |t| -t.rms_m),
        margin: score(judged, |t| t.margin_nats),
    })
}

fn score(judged: &[Judged], of: fn(&Trial) -> f64) -> Option<Score> {
    let scored: Vec<Scored> =
        judged.iter().map(|j| Scored { right: j.right, score: of(j.trial), cluster: j.joint }).collect();
    let right: BTreeMap<usize, f64> = judged.iter().filter(|j| j.right).map(|j| (j.hand, of(j.trial))).collect();
    let pairs: Vec<(f64, f64)> = judged
        .iter()
        .filter(|j| !j.right)
        .filter_map(|j| right.get(&j.hand).map(|right| (*right, of(j.trial))))
        .collect();
    Some(Score {
        auc: auc(&scored)?,
        interval: auc_interval(&scored),
        same_hand: paired(&pairs),
        right_at_5_percent: right_at(&roc(&scored), 0.05),
    })
}

/// One table for single clips, one for all clips of a joint.
fn text(block: &Block) -> String {
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let area = |score: Option<&Score>| {
        score.map_or("-".to_owned(), |s| match s.interval {
            Some(i) => format!("{:.3} ({:.2}-{:.2})", s.auc, i.low, i.high),
            None => format!("{:.3}", s.auc),
        })
    };
    let same_hand = |score: Option<&Score>| score.and_then(|s| s.same_hand).map_or("-".to_owned(), percent);
    let right_at = |score: Option<&Score>| score.and_then(|s| s.right_at_5_percent).map_or("-".to_owned(), percent);
    let mut out = String::new();
    for (clips, together) in [("each clip alone", false), ("all clips together", true)] {
        let header = [
            "joint",
            "n",
            "pass",
            "undet.",
            "fail",
            "AUC error",
            "AUC margin",
            "same hand: error",
            "margin",
            "right at 5 % wrong",
        ];
        let mut lines = vec![header.map(str::to_owned).to_vec()];
        for row in &block.rows {
            let Some(s) = (if together { &row.all_clips } else { &row.one_clip }) else { continue };
            let (error, margin) = (s.tracking_error.as_ref(), s.margin.as_ref());
            lines.push(vec![
                row.joint.clone(),
                s.trials.to_string(),
                percent(s.passed),
                percent(s.undetermined),
                percent(s.failed),
                area(error),
                area(margin),
                same_hand(error),
                same_hand(margin),
                right_at(margin),
            ]);
        }
        if lines.len() > 1 {
            out += &format!("{}, {clips}\n{}\n", block.title, aligned(&lines));
        }
    }
    out
}

/// A joint's recorded hands, as `trajectories.json` has them.
#[derive(Debug, Deserialize)]
struct JointHands {
    joint: String,
    clips: Vec<(String, Trajectory)>,
}

/// The joints of twins with what the proof said of them, and what it says of each of their clips alone.
fn answers(folders: &[PathBuf], recordings: &[PathBuf]) -> Result<Vec<Answer>, Failure> {
    let truths: Vec<Truth> = recordings.iter().map(|r| Truth::read(r)).collect::<Result<_, _>>()?;
    let of_folders: Vec<Vec<Answer>> = folders
        .par_iter()
        .enumerate()
        .map(|(i, folder)| answers_of(folder, i * PER_KITCHEN, &truths))
        .collect::<Result<_, _>>()?;
    Ok(of_folders.into_iter().flatten().collect())
}

fn answers_of(folder: &Path, first: usize, truths: &[Truth]) -> Result<Vec<Answer>, Failure> {
    let twin: Twin = json::read(&folder.join("twin.json"))?;
    let hands: Vec<JointHands> = json::read(&folder.join("trajectories.json"))?;
    let written: Validation = json::read(&folder.join("validation.json"))?;
    let predictions = Predictions::read(&folder.join("predictions.json"))?.predictions;
    let config = Config::read(&folder.join("config.toml"))?;
    let mut answers = Vec::new();
    for (index, furniture) in twin.furniture.iter().enumerate() {
        let part = &furniture.part;
        let (joint, kind) = (first + index, part.joint.articulation.kind);
        let mut judged: BTreeMap<&str, [bool; 2]> = BTreeMap::new();
        for row in predictions.iter().filter(|p| p.joint.as_ref() == Some(&part.id)) {
            judged.insert(&row.clip, is_right(row, truths)?);
        }
        // The clips of a joint share its answer but for the range: it is right where more than half of them are.
        let right = [0, 1].map(|rule| 2 * judged.values().filter(|r| r[rule]).count() > judged.len());
        if let Some(check) = written.joints.iter().find(|j| j.id == part.id).filter(|_| !judged.is_empty()) {
            answers.push(Answer { joint, kind, right, alone: false, trial: Trial::of_answer(part, check) });
        }
        for (clip, trajectory) in hands.iter().filter(|h| h.joint == part.id).flat_map(|h| &h.clips) {
            let Some(right) = judged.get(clip.as_str()).copied() else { continue };
            if let Some(check) = proved(&twin, index, vec![(clip.clone(), trajectory)], &config.validation)? {
                answers.push(Answer { joint, kind, right, alone: true, trial: Trial::of_answer(part, &check) });
            }
        }
    }
    Ok(answers)
}

/// Whether a clip's answer is right under each of [`RULES`]; wrong where the clip moves no joint.
fn is_right(row: &Prediction, truths: &[Truth]) -> Result<[bool; 2], Failure> {
    let truth = truths
        .iter()
        .find(|t| t.recording == row.recording)
        .ok_or_else(|| format!("no truth of the recording {}; name its folder after --truth", row.recording))?;
    let clip = truth.clips.get(&row.clip).and_then(Option::as_ref);
    let measured = clip.and_then(|clip| measure(row, clip));
    Ok(RULES.map(|rule| measured.as_ref().is_some_and(|m| rule.judge(m)[2])))
}

fn answer_blocks(answers: &[Answer]) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (k, rule) in RULES.into_iter().enumerate() {
        for kind in [None, Some(JointKind::Revolute), Some(JointKind::Prismatic)] {
            let of_kind: Vec<&Answer> = answers.iter().filter(|a| kind.is_none_or(|kind| a.kind == kind)).collect();
            let row = |name: &str, of_right: bool| {
                let summed = |alone: bool| {
                    let judged: Vec<Judged> = of_kind
                        .iter()
                        .enumerate()
                        .filter(|(_, a)| a.alone == alone)
                        .map(|(hand, a)| Judged { joint: a.joint, hand, right: a.right[k], trial: &a.trial })
                        .collect();
                    summary(&judged, of_right)
                };
                Row { joint: name.to_owned(), one_clip: summed(true), all_clips: summed(false) }
            };
            let title = format!("answers under {}, {}", rule.name(), kind.map_or("all", JointKind::word));
            blocks.push(Block { title, rows: vec![row("right answers", true), row("wrong answers", false)] });
        }
    }
    blocks
}

/// What a proof costs: single clips in a piece of furniture that stands alone, one after the other, and a large twin.
fn timing(kitchens: &[Kitchen], config: &Config) -> Result<Timing, Failure> {
    let mut of_clips = Vec::new();
    for kitchen in kitchens {
        for (furniture, shown) in kitchen.twin.furniture.iter().zip(&kitchen.shown) {
            let alone = Twin { furniture: vec![furniture.clone()], ..kitchen.twin.clone() };
            for s in shown.iter().take(CLIP_RUNS - of_clips.len().min(CLIP_RUNS)) {
                let begin = Instant::now();
                proved(&alone, 0, vec![(s.clip.clone(), &s.trajectory)], &config.validation)?;
                of_clips.push(1000.0 * begin.elapsed().as_secs_f64());
            }
        }
    }
    let (twin, hands) = large(kitchens, config)?;
    let borrowed: Vec<Vec<(String, &Trajectory)>> =
        hands.iter().map(|clips| clips.iter().map(|(name, t)| (name.clone(), t)).collect()).collect();
    let mut of_runs = Vec::new();
    for _ in 0..LARGE_RUNS {
        let begin = Instant::now();
        validate(&twin, &borrowed, &Vector::z(), &config.validation)?;
        of_runs.push(1000.0 * begin.elapsed().as_secs_f64());
    }
    Ok(Timing {
        threads: rayon::current_num_threads(),
        one_clip_ms: stats::median(&of_clips),
        one_clip_runs: of_clips.len(),
        large_joints: twin.furniture.len(),
        large_clips: hands.iter().map(Vec::len).sum(),
        large_ms: stats::median(&of_runs),
        large_runs: of_runs.len(),
    })
}

/// The hands of each piece of furniture: (clip, trajectory).
type OwnedHands = Vec<Vec<(String, Trajectory)>>;

/// One twin of [`LARGE_JOINTS`] joints: the kitchens side by side, and again, until there are as many.
fn large(kitchens: &[Kitchen], config: &Config) -> Result<(Twin, OwnedHands), Failure> {
    // A kitchen with its room for opening fits into this.
    const APART_M: f64 = 12.0;
    const A_ROW: usize = 7;
    let mut entries: Vec<Entry> = Vec::new();
    let mut hands: BTreeMap<String, Vec<(String, Trajectory)>> = BTreeMap::new();
    for (slot, kitchen) in kitchens.iter().cycle().take(LARGE_JOINTS).enumerate() {
        let place = |i: usize| APART_M * (i as f64 - 0.5 * A_ROW as f64);
        let by = Vector::new(place(slot % A_ROW), place(slot / A_ROW), 0.0);
        for (furniture, shown) in kitchen.twin.furniture.iter().zip(&kitchen.shown) {
            let Some(entry) = kitchen.entries.iter().find(|e| e.id == furniture.part.id) else { continue };
            if entries.len() == LARGE_JOINTS {
                break;
            }
            let entry = shifted_entry(entry, &by, slot);
            let clips = shown.iter().map(|s| (s.clip.clone(), shifted(&s.trajectory, &by))).collect();
            hands.insert(entry.id.clone(), clips);
            entries.push(entry);
        }
    }
    let twin = built("large".to_owned(), entries, config)?;
    let in_order = twin.furniture.iter().map(|f| hands.remove(&f.part.id).unwrap_or_default()).collect();
    Ok((twin, in_order))
}

fn shifted_entry(entry: &Entry, by: &Vector, slot: usize) -> Entry {
    let shape = |b: OrientedBox| OrientedBox { center: b.center + by, ..b };
    Entry {
        id: format!("{}_{slot}", entry.id),
        origin: entry.origin.map(|p| p + by),
        handle: entry.handle.map(|p| p + by),
        part_box: entry.part_box.map(shape),
        base_box: entry.base_box.map(shape),
        ..entry.clone()
    }
}

fn shifted(trajectory: &Trajectory, by: &Vector) -> Trajectory {
    let mut moved = trajectory.clone();
    for sample in &mut moved.samples {
        sample.observed += *by;
        sample.smoothed += *by;
    }
    moved
}
