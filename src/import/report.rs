//! What an import did: the content of `import.json` and of the command's table.

use serde::Serialize;

use super::capture::{Capture, Missing};
use super::finding::ImportFinding;

/// A source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SourceReport {
    /// The format's name.
    pub kind: String,
    /// The file or folder, without the folders above it.
    pub source: String,
    /// What it is.
    pub title: String,
    /// The licence of its data, where the format has one.
    pub licence: Option<String>,
    /// What was declared about world, poses and lens, in words.
    pub conventions: Vec<String>,
    /// What the reader took for granted or left out.
    pub notes: Vec<String>,
}

/// A stream of the result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StreamReport {
    /// Its name.
    pub stream: String,
    /// Items in the result.
    pub count: usize,
    /// Items in the source.
    pub of: usize,
    /// Kind and name of the source.
    pub source: String,
    /// What it was joined to the frames by.
    pub joined_by: String,
}

/// A length scale that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scale {
    /// Metres per unit of the source.
    pub metres_per_unit: f64,
    /// Its standard deviation as a share; `None` where the user gave it.
    pub relative_std: Option<f64>,
    /// What told it.
    pub from: String,
}

/// An up direction that was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Up {
    /// In the axes of the source with the poses.
    pub direction: [f64; 3],
    /// About how far it may be off, degrees.
    pub std_deg: f64,
    /// What told it.
    pub from: String,
}

/// What an import did.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ImportReport {
    /// The sources, in the order of their priority.
    pub sources: Vec<SourceReport>,
    /// The streams.
    pub streams: Vec<StreamReport>,
    /// The scale, where the source with the poses had none or the user gave one.
    pub scale: Option<Scale>,
    /// Up.
    pub up: Option<Up>,
    /// What was turned, undistorted, taken for granted.
    pub changes: Vec<String>,
    /// What was left out, and why.
    pub dropped: Vec<String>,
    /// What a recording needs and no source has.
    pub missing: Vec<Missing>,
    /// Items that could not be read, one sentence each.
    pub faults: Vec<String>,
    /// What the checks found: see [`super::checks`].
    pub findings: Vec<ImportFinding>,
}

/// A source's name for people: kind and the last part of its path.
#[must_use]
pub fn source_name(capture: &Capture) -> String {
    format!("{} {}", capture.kind, last_part(capture))
}

fn last_part(capture: &Capture) -> String {
    capture.source.file_name().map_or_else(|| ".".to_owned(), |n| n.to_string_lossy().into_owned())
}

impl SourceReport {
    /// Of a capture.
    #[must_use]
    pub fn of(capture: &Capture) -> Self {
        let mut conventions = Vec::new();
        let world = &capture.world;
        if let Some(poses) = &capture.poses {
            conventions.push(format!("poses {:?}, camera axes {:?}", poses.direction, poses.axes));
            conventions.push(match world.unit_m {
                Some(unit) => format!("world in units of {unit} m"),
                None => "world of arbitrary scale".to_owned(),
            });
            conventions.push(match world.up {
                Some(up) => format!("up is {:?}", <[f64; 3]>::from(up)),
                None => "up is not told".to_owned(),
            });
            if world.left_handed {
                conventions.push("world left-handed".to_owned());
            }
        }
        if let Some(optics) = &capture.optics {
            conventions.push(format!("{} x {} pixels, lens {:?}", optics.width, optics.height, optics.lens));
        }
        Self {
            kind: capture.kind.clone(),
            source: last_part(capture),
            title: capture.title.clone(),
            licence: capture.licence.clone(),
            conventions,
            notes: capture.notes.clone(),
        }
    }
}

/// What to do about streams that no source has, by the stream's name: what it costs, and the step that fills it.
pub(super) const NEEDED: [(&str, &str, &str); 6] = [
    ("images", "lines and pictures of proof need them", "add the video: paws import SOURCE VIDEO.mp4 --out DIR"),
    (
        "poses",
        "nothing can be placed in a world without them",
        "colmap automatic_reconstructor --image_path IMAGES --workspace_path WORK; paws import IMAGES WORK/sparse/0 --out DIR",
    ),
    (
        "depth",
        "without it joints come from the hand's path, names and lines in the images, and are less sure; fronts and boxes are \
         assumed",
        "run a metric depth network on the source's own images (MoGe-2: moge infer -i IMAGES -o DEPTH --maps) and import its \
         folder too",
    ),
    (
        "hands",
        "the hand's path is the evidence",
        "run a hand tracker on the source's own images or video and import its output too",
    ),
    (
        "contact",
        "when a hand holds something is told from depth around it; a detector adds evidence",
        "run a contact detector on the source's own images and import its output too",
    ),
    (
        "clips",
        "interactions are found by the hands; narrations add names",
        "import narrations too (SRT, or CSV with start, end, narration), or write clips.json: \
         {\"clips\": [{\"clip\", \"start_frame\", \"end_frame\", \"narration\"}]}",
    ),
];

/// What points that do not cover surfaces are worth in place of depth.
pub(super) const SPARSE: &str = "points with holes between them tell fronts, not what moved: joints come from the hand's path and are \
     less sure, boxes are assumed";

/// What to do about a stream that a source has and that meets no frame.
pub(super) const UNMET: &str = "streams meet by time, by the image's name or by the frame's number: run networks on the source's \
     own images, tell the rate of frames without times (--source-fps), move hands in time (--hand-lag)";
