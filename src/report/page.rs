//! One self-contained page: the scene in 3D, the joints with their verdicts, every clip with its outcome.

use std::io::Write;

use base64::Engine;
use minijinja::Environment;
use serde::Serialize;

use super::page_frames::PageFrame;
use super::{drawings, phrases};
use crate::error::{Error, Result};
use crate::pipeline::Scene;
use crate::recording::Clip;
use crate::recording::origin::Origin;
use crate::twin::Twin;
use crate::validation::{Validation, Verdict};

const TEMPLATE: &str = include_str!("../../templates/page.html");
const VIEWER: &str = include_str!("../../assets/viewer/viewer.js");

/// A file of the output folder and what it is.
#[derive(Debug, Clone, Serialize)]
pub struct FileNote {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub what: &'static str,
}

#[derive(Serialize)]
struct JointRow {
    id: String,
    label: String,
    kind: &'static str,
    axis: String,
    range: String,
    sure: String,
    tracking: String,
    force: String,
    verdict: &'static str,
    reason: String,
    clips: String,
    /// SVG.
    picture: String,
}

/// What the page has beside the scene.
#[derive(Debug, Clone, Copy)]
pub struct PageContext<'a> {
    /// The command that made it.
    pub command: &'a str,
    /// Files of the output folder.
    pub files: &'a [FileNote],
    /// Recorded frames to look from.
    pub frames: &'a [PageFrame],
    /// What the recording was made of and by.
    pub origins: &'a [Origin],
}

#[derive(Serialize)]
struct PageFrameRow {
    label: String,
    /// What the viewer takes, as JSON.
    view: String,
    /// JPEG.
    base64: String,
}

fn frame_row(frame: &PageFrame) -> PageFrameRow {
    let [width, height] = frame.size;
    let [fx, fy, cx, cy] = frame.lens;
    let openings: std::collections::BTreeMap<&str, f64> =
        frame.openings.iter().map(|(id, opening)| (id.as_str(), *opening)).collect();
    let view = serde_json::json!({
        "pose": frame.pose, "width": width, "height": height, "fx": fx, "fy": fy, "cx": cx, "cy": cy, "openings": openings,
    });
    PageFrameRow {
        label: frame.label.clone(),
        view: view.to_string(),
        base64: base64::engine::general_purpose::STANDARD.encode(&frame.jpeg),
    }
}

#[derive(Serialize)]
struct ClipRow<'a> {
    clip: &'a str,
    narration: String,
    outcome: String,
    reason: String,
}

/// What a clip is said to show; of one that nobody narrated what was found out.
fn said(clip: &Clip) -> String {
    match clip.narration.trim() {
        "" => format!("{} {}", clip.verb, clip.noun).trim().to_owned(),
        narration => narration.to_owned(),
    }
}

#[derive(Serialize)]
struct VideoRow<'a> {
    name: &'a str,
    /// How many of its clips have an answer, of how many.
    clips: String,
    /// What they show: labels, each once.
    shows: String,
    /// Where it lies, or why it was left out.
    place: String,
    left_out: bool,
}

/// The videos of a scene of several, then those that were left out.
fn videos<'a>(scene: &'a Scene, joints: &[JointRow]) -> Vec<VideoRow<'a>> {
    let joined = scene.videos.joined.iter().map(|video| {
        let of_video = |clip: &str| scene.videos.of_clip(clip).is_some_and(|(v, _)| v.name == video.name);
        let own: Vec<&str> = scene.clips.iter().map(|c| c.clip.clip.as_str()).filter(|clip| of_video(clip)).collect();
        let shown: Vec<&str> = own.iter().filter_map(|clip| Some(scene.joint_of(clip)?.id.as_str())).collect();
        let labels = joints.iter().filter(|j| shown.contains(&j.id.as_str()));
        VideoRow {
            name: &video.name,
            clips: format!("{} of {}", shown.len(), own.len()),
            shows: labels.map(|j| format!("{} ({})", j.label, j.id)).collect::<Vec<String>>().join(", "),
            place: video.placement.words(),
            left_out: false,
        }
    });
    let left_out = scene.videos.left_out.iter().map(|left| VideoRow {
        name: &left.name,
        clips: "-".to_owned(),
        shows: "left out".to_owned(),
        place: left.reason.clone(),
        left_out: true,
    });
    joined.chain(left_out).collect()
}

/// A file as text for the page: compressed, or the triangles of a look would weigh three times as much.
fn packed(glb: &[u8]) -> Result<String> {
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    let bytes = packer.write_all(glb).and_then(|()| packer.finish());
    let bytes = bytes.map_err(|e| Error::Export(format!("page.html: {e}")))?;
    Ok(base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// The joints of a twin with their verdicts, in the twin's order.
fn joint_rows(scene: &Scene, twin: &Twin, validation: &Validation) -> Vec<JointRow> {
    twin.furniture
        .iter()
        .zip(&validation.joints)
        .map(|(f, check)| {
            let joint = scene.joints.iter().find(|j| j.id == f.part.id);
            JointRow {
                id: f.part.id.clone(),
                label: f.part.label.clone(),
                kind: f.part.joint.articulation.kind.word(),
                axis: phrases::axis(&f.part, joint.and_then(|j| j.face.as_ref())),
                range: phrases::amount(f.part.joint.articulation.kind, f.part.joint.upper),
                sure: joint.and_then(|j| j.type_probability).map_or("-".to_owned(), phrases::sure),
                tracking: phrases::centimetres(check.rms_m),
                force: format!("{:.0} N", check.peak_force_n),
                verdict: check.verdict.word(),
                reason: check.reason.clone(),
                clips: joint.map_or(String::new(), |j| j.clips.join(", ")),
                picture: drawings::proof(f, check),
            }
        })
        .collect()
}

/// The clips with what became of them, in the scene's order.
fn clip_rows<'a>(scene: &'a Scene, twin: &Twin) -> Vec<ClipRow<'a>> {
    scene
        .clips
        .iter()
        .map(|c| {
            let joint = scene.joint_of(&c.clip.clip);
            let left = joint.and_then(|j| twin.left_out.iter().find(|left| left.id == j.id));
            let not_built = left.map_or_else(String::new, |left| format!("; not built: {}", left.reason));
            ClipRow {
                clip: &c.clip.clip,
                narration: said(&c.clip),
                outcome: joint.map_or("abstained".to_owned(), |j| j.id.clone()),
                reason: phrases::clip_reason(c, joint) + &not_built,
            }
        })
        .collect()
}

/// The page as HTML.
///
/// # Errors
/// Where the template cannot be filled, which would be a bug.
pub fn render(scene: &Scene, twin: &Twin, validation: &Validation, glb: &[u8], around: &PageContext) -> Result<String> {
    let count = |v: Verdict| validation.joints.iter().filter(|j| j.verdict == v).count();
    let joints = joint_rows(scene, twin, validation);
    let clips = clip_rows(scene, twin);
    let answered = clips.iter().filter(|c| c.outcome != "abstained").count();
    let frames: Vec<PageFrameRow> = around.frames.iter().map(frame_row).collect();
    let mut environment = Environment::new();
    let fail = |e: minijinja::Error| Error::Export(format!("page.html: {e:#}"));
    environment.add_template("page.html", TEMPLATE).map_err(fail)?;
    environment
        .get_template("page.html")
        .map_err(fail)?
        .render(minijinja::value::Serde(&serde_json::json!({
            "title": scene.recording,
            "recording": scene.recording,
            "version": env!("CARGO_PKG_VERSION"),
            "command": around.command,
            "note": phrases::assumed(scene),
            "counts": {
                "clips": clips.len(), "answered": answered, "abstained": clips.len() - answered,
                "joints": joints.len(), "passed": count(Verdict::Pass), "failed": count(Verdict::Fail),
                "undetermined": count(Verdict::Undetermined),
            },
            "joints": joints,
            "videos": videos(scene, &joints),
            "clips": clips,
            "files": around.files,
            "frames": frames,
            "origins": around.origins,
            "viewer_js": VIEWER,
            "glb_base64": packed(glb)?,
        })))
        .map_err(fail)
}
