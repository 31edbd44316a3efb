//! `paws twin`: the whole way.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::bail;
use clap::Args;

use super::door::Door;
use super::many::Given;
use super::output::{Kind, Output};
use super::progress::Steps;
use super::words::{self as model, Asked, Exchange, WordsArgs};
use super::{Answer, ConfigFile, Opening, cache, keep, print, shown};
use crate::config::Config;
use crate::export::{ExportFormat, FORMATS, Purpose};
use crate::json;
use crate::look::Look;
use crate::make;
use crate::pipeline::{self, Scene};
use crate::recording::{LeftOut, Recording, origin};
use crate::report::page::{FileNote, PageContext};
use crate::report::table::aligned;
use crate::report::{drawings, files, page, page_frames, phrases};
use crate::twin::Twin;
use crate::validation::{Validation, Verdict};
use crate::vlm::Usage;
use crate::{fitting, primitives};

#[derive(Debug, Args)]
pub struct TwinArgs {
    /// The recording's folder; of several recordings of one place all folders, in the order of time: one twin of all of them
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// Folder for the twin
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    opening: Opening,
    #[command(flatten)]
    door: Door,
    #[command(flatten)]
    config: ConfigFile,
    /// Keep every intermediate result (trajectories, voxels, lines, candidates, marked images, questions to a language
    /// model) in DIR/steps
    #[arg(long)]
    keep: bool,
    /// Show plain boxes: no textures from the images, and no recorded frames on the page
    #[arg(long)]
    no_textures: bool,
    /// The recordings already share one world (poses of one map): do not align them
    #[arg(long)]
    one_frame: bool,
    /// Keep intermediate results in DIR; a later run, such as one with one more recording, reuses them. The twin is the same
    /// with and without
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    #[command(flatten)]
    words: WordsArgs,
    /// End when standard input does: for programs that start this one, so that it does not outlive them
    #[arg(long, hide = true)]
    with_parent: bool,
}

/// The folder of a look's files, as pages name it.
const LOOK: &str = "look/";

/// Files of the folder that are no exports.
const OTHER_FILES: [FileNote; 11] = [
    FileNote { name: LOOK, what: "meshes and pictures that scene.urdf, scene.xml, kitchen.xml and scene.usda show" },
    FileNote { name: "index.html", what: "this page" },
    FileNote { name: "articulations.json", what: "every joint and every clip with its evidence" },
    FileNote { name: "predictions.json", what: "one row a clip, for `paws evaluate`" },
    FileNote { name: "twin.json", what: "boxes, joints and masses: the model behind all formats" },
    FileNote { name: "validation.json", what: "every replay: errors, forces, contacts, ranges, rivals, the margin" },
    FileNote {
        name: "primitives.json",
        what: "for robots: grasp, path of the gripper and Dynamic Movement Primitive of each joint",
    },
    FileNote { name: "proof/", what: "the pictures of this page, one a joint" },
    FileNote { name: "trajectories.json", what: "the recorded hands that belong to each joint" },
    FileNote { name: "config.toml", what: "the parameters that were used" },
    FileNote { name: "steps/", what: "intermediate results, with --keep" },
];

/// The formats that every twin's folder has.
fn model_formats() -> Vec<&'static ExportFormat> {
    FORMATS.iter().filter(|format| format.purpose == Purpose::Model).collect()
}

/// The files of a twin's folder, in the page's order.
fn file_notes() -> Vec<FileNote> {
    let models = model_formats().into_iter().flat_map(|format| format.files);
    models.map(|file| FileNote { name: file.name, what: file.what }).chain(OTHER_FILES).collect()
}

/// Ends this process when its standard input ends, which it does when the program at its other end is gone.
fn end_with_parent() {
    std::thread::spawn(|| {
        let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
        std::process::exit(2);
    });
}

pub fn run(args: &TwinArgs) -> anyhow::Result<Answer> {
    if args.with_parent {
        end_with_parent();
    }
    let (config, asked) = (args.config.read()?, args.words.open()?);
    let given = Given {
        recordings: &args.recordings,
        opening: args.opening,
        door: args.door,
        one_frame: args.one_frame,
        cache: args.cache.as_deref(),
    };
    if let Some(asked) = asked.as_ref().filter(|a| a.is_dry()) {
        let recording = match args.recordings.as_slice() {
            [dir] => args.opening.open(dir)?,
            _ => given.open(&config, &Steps::new())?,
        };
        return asked.count(&[recording], &config);
    }
    let wishes = Wishes { steps: args.keep, textures: !args.no_textures };
    make(given, &args.out, &config, wishes, asked.as_ref())
}

/// What is to be made beside the twin.
#[derive(Debug, Clone, Copy)]
pub struct Wishes {
    /// Every intermediate result.
    pub steps: bool,
    /// What it looks like.
    pub textures: bool,
}

pub fn make(
    given: Given,
    out: &Path,
    config: &Config,
    wishes: Wishes,
    asked: Option<&Asked>,
) -> anyhow::Result<Answer> {
    let begin = Instant::now();
    refuse_within(out, asked.and_then(Asked::answers), "answers", "--answers")?;
    refuse_within(out, given.cache, "looks", "--cache")?;
    let inputs: Vec<&Path> = given.recordings.iter().map(PathBuf::as_path).collect();
    let output = Output::new(out, Kind::Twin, &inputs)?;
    let steps = Steps::new();
    let recording = given.open(config, &steps)?;
    let store = cache::open(given.cache, config)?;
    let how = model::How { config, asked, store: &*store, keep: wishes.steps };
    let inferred = model::infer(&recording, how, &steps)?;
    let mut built = Built::of(&recording, inferred, config, wishes, &steps)?;
    steps.report("writing", 0, 1);
    let glb = built.write(&output, config)?;
    let folders: Vec<String> = given.recordings.iter().map(|dir| shown(dir)).collect();
    let command = format!("paws twin {} --out {}", folders.join(" "), shown(out));
    output.write("index.html", built.page(&recording, &command, &glb, config, wishes)?)?;
    if wishes.steps {
        let Built { scene, twin, exchanges, .. } = &built;
        let unwritten = keep::write(&recording, scene, twin, exchanges, &output);
        built.lost.extend(unwritten);
    }
    output.finish()?;
    let times = steps.finish();
    let times: Vec<String> = times.iter().map(|(s, t)| format!("{s} {:.2} s", t.as_secs_f64())).collect();
    built.tell(out, asked, &format!("{:.2} s ({})", begin.elapsed().as_secs_f64(), times.join(", ")))?;
    Ok(built.answer(&recording))
}

/// Refuses to replace a folder in which something is kept for later runs.
fn refuse_within(out: &Path, kept: Option<&Path>, what: &str, option: &str) -> anyhow::Result<()> {
    if let Some(kept) = kept
        && std::path::absolute(kept)?.starts_with(std::path::absolute(out)?)
    {
        let [kept, out] = [kept, out].map(shown);
        bail!("{kept}: {what} kept there would go when {out} is replaced; choose another {option}");
    }
    Ok(())
}

/// All that is written of a recording.
struct Built {
    scene: Scene,
    /// Who answered.
    reasoner: String,
    /// What a model was asked, where one is.
    usage: Option<Usage>,
    exchanges: Vec<Exchange>,
    /// Pictures that could not be read.
    unread: Vec<String>,
    twin: Twin,
    hands: Vec<make::JointHands>,
    validation: Validation,
    look: Option<Look>,
    /// What could not be done, a sentence each.
    lost: Vec<String>,
}

impl Built {
    /// Fits, replays and, where it is wished, dresses the twin. An error costs the look, not the twin.
    fn of(
        recording: &Recording,
        inferred: model::Inferred,
        config: &Config,
        wishes: Wishes,
        steps: &Steps,
    ) -> anyhow::Result<Self> {
        let model::Inferred { mut scene, reasoner, usage, exchanges, lost: unread } = inferred;
        super::infer::weigh(&mut scene, recording, config, steps);
        steps.report("fitting boxes", 0, 1);
        let twin = fitting::fit(&scene, &recording.up(), &config.fitting, &config.priors);
        steps.report("simulating", 0, 1);
        let hands = make::joint_hands(&scene, &twin);
        let (validation, lost) = make::replay(&twin, &hands, &recording.up(), &config.validation)?;
        let look = None;
        let mut built = Self { scene, reasoner, usage, exchanges, unread, twin, hands, validation, look, lost };
        if wishes.textures {
            steps.report("textures", 0, 1);
            let look = make::look(recording, &built.scene, &built.twin, config);
            built.look = built.kept(look, "textures").flatten();
        }
        Ok(built)
    }

    /// What a step for eyes alone gives; what it lost, or why it gives nothing, is noted once.
    fn kept<T>(&mut self, made: crate::error::Result<(T, Vec<String>)>, step: &str) -> Option<T> {
        match made {
            Ok((made, unseen)) => {
                let is_new = |why: &String| !self.unread.contains(why) && !self.lost.contains(why);
                let new: Vec<String> = unseen.into_iter().filter(is_new).collect();
                self.lost.extend(new);
                Some(made)
            }
            Err(error) => {
                self.lost.push(format!("{step}: {error}"));
                None
            }
        }
    }

    /// Writes all files but the page and the steps; returns the model for viewers.
    fn write(&self, output: &Output, config: &Config) -> anyhow::Result<Vec<u8>> {
        let Self { scene, reasoner, twin, hands, validation, look, .. } = self;
        let glb = models(output, twin, look.as_ref(), validation)?;
        output.write("articulations.json", files::articulations(scene, reasoner)?)?;
        let rows = files::predictions(scene, twin);
        output.write("predictions.json", json::text(&rows)?)?;
        output.write("twin.json", json::text(twin)?)?;
        output.write("validation.json", json::text(validation)?)?;
        let verdicts = validation.words();
        let seen = super::primitives::seen(hands, &verdicts, &rows);
        let moves = primitives::of(twin, &seen, &config.hands.grips, &config.primitives);
        output.write("primitives.json", json::text(&moves)?)?;
        for (furniture, check) in twin.furniture.iter().zip(&validation.joints) {
            output.write(&format!("proof/{}.svg", file_name(&check.id)), drawings::proof(furniture, check))?;
        }
        output.write("trajectories.json", json::text(hands)?)?;
        output.write("config.toml", config.to_toml())?;
        Ok(glb)
    }

    /// The page to look at, with recorded frames beside the twin where textures are wished.
    fn page(
        &mut self,
        recording: &Recording,
        command: &str,
        glb: &[u8],
        config: &Config,
        wishes: Wishes,
    ) -> anyhow::Result<String> {
        let is_there = |note: &FileNote| match note.name {
            "steps/" => wishes.steps,
            LOOK => self.look.is_some(),
            _ => true,
        };
        let notes: Vec<FileNote> = file_notes().into_iter().filter(is_there).collect();
        let mut frames = Vec::new();
        if wishes.textures {
            let seen = make::forgiving(recording, &config.pictures, |recording| {
                page_frames::frames(recording, &self.scene, &self.twin, config)
            });
            frames = self.kept(seen, "recorded frames of the page").unwrap_or_default();
        }
        let origins = origin::read(&recording.dir);
        let around = PageContext { command, files: &notes, frames: &frames, origins: &origins };
        Ok(page::render(&self.scene, &self.twin, &self.validation, glb, &around)?)
    }

    /// What a person reads in the terminal. `times`: how long all of it took.
    fn tell(&self, out: &Path, asked: Option<&Asked>, times: &str) -> anyhow::Result<()> {
        print(&summary(&self.scene, &self.twin, &self.validation))?;
        for why in &self.lost {
            eprintln!("not done: {why}");
        }
        if let Some((asked, usage)) = asked.zip(self.usage.as_ref()) {
            eprintln!("{}", usage.sentence(asked.model()));
        }
        eprintln!("{times}");
        let page = shown(&out.join("index.html"));
        print(&format!("\nlook:  {page}   (the scene in 3D, every verdict with its reason)\n"))?;
        let [urdf, mjcf, gltf, usd] =
            ["scene.urdf", "scene.xml", "scene.glb", "scene.usda"].map(|name| shown(&out.join(name)));
        print(&format!("use:   {urdf}   {mjcf}   {gltf}   {usd}\n"))
    }

    /// Whether all was read and built, and nothing of it is refuted.
    fn answer(&self, recording: &Recording) -> Answer {
        let Self { scene, usage, unread, twin, validation, lost, .. } = self;
        let is_refuted = validation.joints.iter().any(|j| j.verdict == Verdict::Fail);
        let is_damaged = usage.as_ref().is_some_and(|u| !u.damaged.is_empty());
        let read_whole = unread.is_empty() && recording.left_out == LeftOut::default() && !is_damaged;
        let all_joined = scene.videos.left_out.is_empty();
        let is_whole = lost.is_empty() && read_whole && twin.left_out.is_empty() && all_joined;
        if is_refuted || twin.furniture.is_empty() || !is_whole { Answer::No } else { Answer::Yes }
    }
}

/// Writes the twin in all formats; returns the file for viewers.
fn models(output: &Output, twin: &Twin, look: Option<&Look>, validation: &Validation) -> anyhow::Result<Vec<u8>> {
    let mut glb = Vec::new();
    for (name, bytes) in make::files(twin, look, &validation.words())? {
        output.write(&name, &bytes)?;
        if name == "scene.glb" {
            glb = bytes;
        }
    }
    Ok(glb)
}

/// A joint's name as that of a file: joints of models from elsewhere may be called anything.
fn file_name(id: &str) -> String {
    id.chars().map(|c| if c.is_alphanumeric() || c == '_' || c == '-' { c } else { '_' }).collect()
}

/// The table that a person reads.
pub fn summary(scene: &Scene, twin: &Twin, validation: &Validation) -> String {
    let header =
        ["joint", "furniture", "type", "axis", "range", "clips", "tracking error", "peak force", "margin", "verdict"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    let mut reasons = String::new();
    for (f, check) in twin.furniture.iter().zip(&validation.joints) {
        let joint = scene.joints.iter().find(|j| j.id == f.part.id);
        let kind = f.part.joint.articulation.kind;
        rows.push(vec![
            f.part.id.clone(),
            f.part.label.clone(),
            kind.word().to_owned(),
            phrases::axis(&f.part, joint.and_then(|j| j.face.as_ref())),
            phrases::amount(kind, f.part.joint.upper),
            joint.map_or(0, |j| j.clips.len()).to_string(),
            phrases::centimetres(check.rms_m),
            format!("{:.0} N", check.peak_force_n),
            phrases::margin(check.margin_nats),
            check.verdict.word().to_owned(),
        ]);
        if check.verdict != Verdict::Pass {
            reasons += &format!("{}: {}: {}\n", check.id, check.verdict.word(), check.reason);
        }
    }
    let mut text = format!("{}\n\n", scene.recording);
    if twin.furniture.is_empty() {
        text += "no joint was found\n";
    } else {
        text += &aligned(&rows);
    }
    if let Some(note) = phrases::assumed(scene) {
        text += &format!("\n{note}\n");
    }
    for left in &twin.left_out {
        reasons += &format!("{}: not built: {}\n", left.id, left.reason);
    }
    for joint in &scene.joints {
        for why in phrases::refuted(joint) {
            reasons += &format!("{}: physics speaks against {why}\n", joint.id);
        }
    }
    if !reasons.is_empty() {
        text += &format!("\n{reasons}");
    }
    let abstained: Vec<&pipeline::ClipResult> =
        scene.clips.iter().filter(|c| scene.joint_of(&c.clip.clip).is_none()).collect();
    if !abstained.is_empty() {
        text += &format!("\n{} of {} clips without an answer:\n", abstained.len(), scene.clips.len());
        for c in abstained {
            text += &format!("  {}: {}\n", c.clip.clip, c.joint.reason().unwrap_or("no joint was found for its part"));
        }
    }
    text
}
