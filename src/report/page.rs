//! One self-contained page: the scene in 3D, the joints with their verdicts, every clip with its outcome.

use std::io::Write;

use base64::Engine;
use minijinja::Environment;
use serde::Serialize;

use super::{pictures, words};
use crate::error::{Error, Result};
use crate::pipeline::Scene;
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

#[derive(Serialize)]
struct ClipRow<'a> {
    clip: &'a str,
    narration: &'a str,
    outcome: String,
    reason: String,
}

/// A file as text for the page: compressed, or the triangles of a look would weigh three times as much.
fn packed(glb: &[u8]) -> Result<String> {
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    let bytes = packer.write_all(glb).and_then(|()| packer.finish());
    let bytes = bytes.map_err(|e| Error::Export(format!("page.html: {e}")))?;
    Ok(base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// The page as HTML.
///
/// # Errors
/// Where the template cannot be filled, which would be a bug.
pub fn render(
    scene: &Scene,
    twin: &Twin,
    validation: &Validation,
    glb: &[u8],
    command: &str,
    files: &[FileNote],
) -> Result<String> {
    let count = |v: Verdict| validation.joints.iter().filter(|j| j.verdict == v).count();
    let joints: Vec<JointRow> = twin
        .furniture
        .iter()
        .zip(&validation.joints)
        .map(|(f, check)| {
            let joint = scene.joints.iter().find(|j| j.id == f.part.id);
            JointRow {
                id: f.part.id.clone(),
                label: f.part.label.clone(),
                kind: f.part.joint.articulation.kind.word(),
                axis: words::axis(&f.part, joint.and_then(|j| j.face.as_ref())),
                range: words::amount(f.part.joint.articulation.kind, f.part.joint.upper),
                sure: joint.and_then(|j| j.type_probability).map_or("-".to_owned(), words::sure),
                tracking: words::centimetres(check.rms_m),
                force: format!("{:.0} N", check.peak_force_n),
                verdict: check.verdict.word(),
                reason: check.reason.clone(),
                clips: joint.map_or(String::new(), |j| j.clips.join(", ")),
                picture: pictures::proof(f, check),
            }
        })
        .collect();
    let clips: Vec<ClipRow> = scene
        .clips
        .iter()
        .map(|c| {
            let joint = scene.joint_of(&c.clip.clip);
            let left = joint.and_then(|j| twin.left_out.iter().find(|left| left.id == j.id));
            let not_built = left.map_or_else(String::new, |left| format!("; not built: {}", left.reason));
            ClipRow {
                clip: &c.clip.clip,
                narration: &c.clip.narration,
                outcome: joint.map_or("abstained".to_owned(), |j| j.id.clone()),
                reason: words::clip_reason(c, joint) + &not_built,
            }
        })
        .collect();
    let answered = clips.iter().filter(|c| c.outcome != "abstained").count();
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
            "command": command,
            "counts": {
                "clips": clips.len(), "answered": answered, "abstained": clips.len() - answered,
                "joints": joints.len(), "passed": count(Verdict::Pass), "failed": count(Verdict::Fail),
                "undetermined": count(Verdict::Undetermined),
            },
            "joints": joints,
            "clips": clips,
            "files": files,
            "viewer_js": VIEWER,
            "glb_base64": packed(glb)?,
        })))
        .map_err(fail)
}
