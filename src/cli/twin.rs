//! `paws twin`: the whole way.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::bail;
use clap::Args;

use super::door::Door;
use super::output::{Kind, Output};
use super::progress::Steps;
use super::words::{self as model, Asked, WordsArgs};
use super::{Answer, ConfigFile, Opening, keep, print, shown};
use crate::config::{self, Config};
use crate::hands::Trajectory;
use crate::json;
use crate::look::Look;
use crate::math::Vector;
use crate::pipeline::{self, Scene};
use crate::recording::Recording;
use crate::report::page::FileNote;
use crate::report::table::aligned;
use crate::report::{files, page, pictures, words};
use crate::twin::Twin;
use crate::validation::{self, Validation, Verdict, verdict::Hands};
use crate::{export, fitting, primitives};

#[derive(Debug, Args)]
pub struct TwinArgs {
    /// The recording's folder
    recording: PathBuf,
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
    /// Leave the furniture and the room the plain boxes that they collide as
    #[arg(long)]
    no_textures: bool,
    #[command(flatten)]
    words: WordsArgs,
    /// End when standard input does: for programs that start this one, so that it does not outlive them
    #[arg(long, hide = true)]
    with_parent: bool,
}

/// The folder of a look's files, as pages name it.
const LOOK: &str = "look/";

const FILES: [FileNote; 18] = [
    FileNote { name: "scene.urdf", what: "the twin for ROS, PyBullet, Drake, Pinocchio" },
    FileNote { name: "scene.xml", what: "the twin for MuJoCo, with floor, light and keyframes" },
    FileNote {
        name: "kitchen.xml",
        what: "the same without floor and light, to include in a MuJoCo scene of your own",
    },
    FileNote { name: "scene.glb", what: "the twin for viewers and game engines, with an animation per joint" },
    FileNote { name: "physics.glb", what: "the twin for engines that read KHR_physics_rigid_bodies" },
    FileNote { name: "scene.usda", what: "the twin for Isaac and OpenUSD, with UsdPhysics" },
    FileNote { name: "scene.usdz", what: "the same with its pictures in one file, also for phones" },
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
    if let Some(asked) = asked.as_ref().filter(|a| a.is_dry()) {
        return asked.count(&[args.opening.open(&args.recording)?], &config);
    }
    let given = Given { recording: &args.recording, opening: args.opening, door: args.door };
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

/// A joint's recorded hands, as `trajectories.json` has them.
#[derive(Debug, serde::Serialize, serde::Deserialize)]
pub struct JointHands {
    /// The joint.
    pub joint: String,
    /// Clip name and trajectory.
    pub clips: Vec<(String, Trajectory)>,
}

/// Hands of each joint of a scene, in the twin's order.
pub fn joint_hands(scene: &Scene, twin: &Twin) -> Vec<JointHands> {
    twin.furniture
        .iter()
        .map(|f| JointHands {
            joint: f.part.id.clone(),
            clips: scene
                .joints
                .iter()
                .filter(|j| j.id == f.part.id)
                .flat_map(|j| &j.clips)
                .filter_map(|name| scene.clips.iter().find(|c| c.clip.clip == *name))
                .filter_map(|c| c.trajectory.clone().map(|t| (c.clip.clip.clone(), t)))
                .collect(),
        })
        .collect()
}

/// Borrowed in the form that validation takes.
pub fn as_hands(joints: &[JointHands]) -> Vec<Hands<'_>> {
    joints.iter().map(|j| j.clips.iter().map(|(name, t)| (name.clone(), t)).collect()).collect()
}

/// A recording that is still to be read.
#[derive(Clone, Copy)]
pub struct Given<'a> {
    /// Its folder.
    pub recording: &'a Path,
    /// What may be read of it.
    pub opening: Opening,
    /// What is done where it contradicts itself.
    pub door: Door,
}

pub fn make(
    given: Given,
    out: &Path,
    config: &Config,
    wishes: Wishes,
    asked: Option<&Asked>,
) -> anyhow::Result<Answer> {
    let begin = Instant::now();
    if let Some(answers) = asked.and_then(Asked::answers)
        && std::path::absolute(answers)?.starts_with(std::path::absolute(out)?)
    {
        bail!(
            "{}: answers kept there would go when {} is replaced; choose another --answers",
            shown(answers),
            shown(out)
        );
    }
    let output = Output::new(out, Kind::Twin, &[given.recording])?;
    let recording = given.door.open(given.opening, given.recording)?;
    let steps = Steps::new();
    let model::Inferred { mut scene, reasoner, usage, exchanges, lost: unread } =
        model::infer(&recording, config, asked, &steps, wishes.steps)?;
    super::infer::weigh(&mut scene, &recording, config, &steps);
    steps.report("fitting boxes", 0, 1);
    let twin = fitting::fit(&scene, &recording.up(), &config.fitting);
    steps.report("simulating", 0, 1);
    let hands = joint_hands(&scene, &twin);
    let (validation, mut lost) = replayed(&twin, &hands, &recording.up(), &config.validation)?;
    let look = match wishes.textures {
        true => looked(&recording, &scene, &twin, config, &steps).unwrap_or_else(|error| {
            lost.push(format!("textures: {error}"));
            None
        }),
        false => None,
    };
    steps.report("writing", 0, 1);
    let glb = models(&output, &twin, look.as_ref(), &validation)?;
    output.write("articulations.json", files::articulations(&scene, &reasoner)?)?;
    let rows = files::predictions(&scene, &twin);
    output.write("predictions.json", json::text(&rows)?)?;
    output.write("twin.json", json::text(&twin)?)?;
    output.write("validation.json", json::text(&validation)?)?;
    let verdicts = validation.words();
    let moves = primitives::of(&twin, &super::primitives::seen(&hands, &verdicts, &rows));
    output.write("primitives.json", json::text(&moves)?)?;
    for (furniture, check) in twin.furniture.iter().zip(&validation.joints) {
        output.write(&format!("proof/{}.svg", file_name(&check.id)), pictures::proof(furniture, check))?;
    }
    output.write("trajectories.json", json::text(&hands)?)?;
    output.write("config.toml", config.to_toml())?;
    let command = format!("paws twin {} --out {}", shown(&recording.dir), shown(out));
    let is_there = |note: &&FileNote| match note.name {
        "steps/" => wishes.steps,
        LOOK => look.is_some(),
        _ => true,
    };
    let notes: Vec<FileNote> = FILES.iter().filter(is_there).cloned().collect();
    output.write("index.html", page::render(&scene, &twin, &validation, &glb, &command, &notes)?)?;
    if wishes.steps {
        lost.extend(keep::write(&recording, &scene, &twin, &exchanges, &output));
    }
    output.finish()?;
    let times = steps.finish();

    print(&summary(&scene, &twin, &validation))?;
    let times: Vec<String> = times.iter().map(|(s, t)| format!("{s} {:.2} s", t.as_secs_f64())).collect();
    for why in &lost {
        eprintln!("not done: {why}");
    }
    let damaged = usage.as_ref().is_some_and(|u| !u.damaged.is_empty());
    if let Some((asked, usage)) = asked.zip(usage) {
        eprintln!("{}", usage.sentence(asked.model()));
    }
    eprintln!("{:.2} s ({})", begin.elapsed().as_secs_f64(), times.join(", "));
    print(&format!(
        "\nlook:  {}   (the scene in 3D, every verdict with its reason)\n",
        shown(&out.join("index.html"))
    ))?;
    print(&format!(
        "use:   {}   {}   {}   {}\n",
        shown(&out.join("scene.urdf")),
        shown(&out.join("scene.xml")),
        shown(&out.join("scene.glb")),
        shown(&out.join("scene.usda"))
    ))?;
    let refuted = validation.joints.iter().any(|j| j.verdict == Verdict::Fail);
    let whole = lost.is_empty() && unread.is_empty() && twin.left_out.is_empty() && !damaged;
    Ok(if refuted || twin.furniture.is_empty() || !whole { Answer::No } else { Answer::Yes })
}

/// What the twin looks like; `None` where there is nothing to see. An error costs the look, not the twin: everything else is
/// written without it.
fn looked(
    recording: &Recording,
    scene: &Scene,
    twin: &Twin,
    config: &Config,
    steps: &Steps,
) -> crate::error::Result<Option<Look>> {
    steps.report("textures", 0, 1);
    worn(twin, crate::appearance::look(recording, scene, twin, &config.appearance)?)
}

/// A look that the exporters take, where there is anything in it.
fn worn(twin: &Twin, look: Look) -> crate::error::Result<Option<Look>> {
    Ok(export::dress::shows(twin, &look)?.then_some(look))
}

/// Writes the twin in all formats; returns the file for viewers.
fn models(output: &Output, twin: &Twin, look: Option<&Look>, validation: &Validation) -> anyhow::Result<Vec<u8>> {
    let glb = export::gltf::write(twin, look, &validation.words())?;
    output.write("scene.urdf", export::urdf::write(twin, look)?)?;
    output.write("scene.xml", export::mjcf::write(twin, look)?)?;
    output.write("kitchen.xml", export::mjcf::write_model(twin, look)?)?;
    output.write("scene.glb", &glb)?;
    output.write("physics.glb", export::gltf::write_physics(twin)?)?;
    output.write("scene.usda", export::usd::write(twin, look)?)?;
    output.write("scene.usdz", export::usd::write_package(twin, look)?)?;
    for (name, bytes) in look.map_or_else(|| Ok(Vec::new()), |look| export::dress::files(twin, look))? {
        output.write(&name, bytes)?;
    }
    Ok(glb)
}

/// The replay of all joints, and what had to be left out of it: a hand that cannot be replayed costs its clip, a joint that
/// cannot be simulated its hands.
pub fn replayed(
    twin: &Twin,
    hands: &[JointHands],
    up: &Vector,
    config: &config::Validation,
) -> crate::error::Result<(Validation, Vec<String>)> {
    let mut kept = as_hands(hands);
    if let Ok(validation) = validation::validate(twin, &kept, up, config) {
        return Ok((validation, Vec::new()));
    }
    let alone = |joint: usize, clips: Hands| -> crate::error::Result<()> {
        let mut all: Vec<Hands> = vec![Vec::new(); hands.len()];
        if let Some(own) = all.get_mut(joint) {
            *own = clips;
        }
        validation::validate(twin, &all, up, config).map(|_| ())
    };
    let mut lost = Vec::new();
    for (i, (clips, joint)) in kept.iter_mut().zip(hands).enumerate() {
        clips.retain(|(name, trajectory)| match alone(i, vec![(name.clone(), *trajectory)]) {
            Ok(()) => true,
            Err(error) => {
                lost.push(format!("replay of clip {name}: {error}"));
                false
            }
        });
        if let Err(error) = alone(i, clips.clone()) {
            lost.push(format!("replay of {}: {error}", joint.joint));
            clips.clear();
        }
    }
    Ok((validation::validate(twin, &kept, up, config)?, lost))
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
            words::axis(&f.part, joint.and_then(|j| j.face.as_ref())),
            words::amount(kind, f.part.joint.upper),
            joint.map_or(0, |j| j.clips.len()).to_string(),
            words::centimetres(check.rms_m),
            format!("{:.0} N", check.peak_force_n),
            words::margin(check.margin_nats),
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
    for left in &twin.left_out {
        reasons += &format!("{}: not built: {}\n", left.id, left.reason);
    }
    for joint in &scene.joints {
        for why in words::refuted(joint) {
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
