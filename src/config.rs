//! Every number that can be chosen: the paper's hyperparameters (§B.1, the defaults), what the paper leaves open, and what is
//! believed of furniture ([`Priors`], whose numbers are data).
//!
//! A file a step; a block that grows has parts (`hands.contact`). What stays in code is geometry, arithmetic, formats and how
//! finely something is computed, and says so (`tests/it/constants.rs`).

#[macro_use]
mod block;
mod alignment;
mod appearance;
mod comparison;
mod fitting;
mod geometry;
mod hands;
mod inference;
mod localization;
mod part;
mod pictures;
mod primitives;
mod priors;
mod reasoning;
mod source;
mod validation;
mod values;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
pub use alignment::*;
pub use appearance::*;
pub use comparison::*;
pub use fitting::*;
pub use geometry::*;
pub use hands::*;
pub use inference::*;
pub use localization::*;
pub use part::*;
pub use pictures::*;
pub use primitives::*;
pub use priors::{Boards, Drives, Fronts, Handles, Hanging, Hung, Named, PriorSet, Priors, Ranges, Resistance};
pub use reasoning::*;
pub use validation::*;
use values::{overlay, wrong};

/// One configurable value, for `paws config` and for the docs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// `block.key`.
    pub key: String,
    /// The value as TOML.
    pub value: String,
    /// Unit, or "-".
    pub unit: &'static str,
    /// Where the value is from: "paper B.1" (the section), "source" (its name stands beside it), "ours: measured",
    /// "ours: judgement", or "ours" alone where the meaning says why it is this one.
    pub source: String,
    /// What a measurement or a judgement rests on, or the source's name; empty where that is not told apart from the meaning.
    pub grounds: &'static str,
    /// What it does.
    pub meaning: String,
}

/// How 3D lines are made from the segments of several views.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LineMethod {
    /// The paper's: a line fitted to the unprojected points of all views.
    Unprojected,
    /// Ours: the line that the views' planes have in common.
    Triangulated,
}

/// How the room's frame is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ManhattanMethod {
    /// The paper's: k-means of each frame's normals, then mean shift.
    Clustered,
    /// Ours: the heading of upright surfaces about the vertical, then all normals and gravity, robustly.
    Gravity,
}

/// How a joint is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum InferenceMethod {
    /// The paper's: type from words, direction of the room, line of least variance.
    Paper,
    /// Ours: all hypotheses weighed by hand, depth, shape and words.
    Posterior,
}

/// How clips of one part are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum GroupingMethod {
    /// The paper's: confident voxels that overlap.
    Voxels,
    /// Ours: the log odds of one part, and that what is closed was open.
    Places,
}

/// Which set of values the others start from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The paper's, as far as it says.
    Paper,
    /// What we found to be better.
    #[default]
    Ours,
}

/// The whole configuration. `Config::default()` is what `paws` runs without `--config`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// What the values that a file leaves out are: ours, or the paper's.
    pub method: Method,
    /// Seed of every random draw.
    pub seed: u64,
    /// What is believed of furniture (ours).
    pub priors: Priors,
    /// Ours.
    pub pictures: Pictures,
    /// §3.1, §A.2.
    pub hands: Hands,
    /// §3.1, §A.3.
    pub localization: Localization,
    /// §3.2, §A.4, §A.5.
    pub geometry: Geometry,
    /// What depth says of a part that moves.
    pub part: Part,
    /// §3.3, §A.6.
    pub reasoning: Reasoning,
    /// §3.4, §A.7, §C.2.
    pub inference: Inference,
    /// Ours.
    pub alignment: Alignment,
    /// Ours.
    pub fitting: Fitting,
    /// Ours.
    pub appearance: Appearance,
    /// Ours.
    pub validation: Validation,
    /// Ours.
    pub primitives: Primitives,
    /// Ours.
    pub comparison: Comparison,
}

impl Config {
    /// Reads a TOML file; keys that are absent keep their defaults, unknown keys and impossible values are errors.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&std::fs::read_to_string(path).map_err(|e| Error::io(path, &e))?, path)
    }

    /// The same from the text of a file; `path` is named in errors.
    ///
    /// # Errors
    /// Unknown keys and impossible values.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let wrong = |e: toml::de::Error| Error::Config(format!("{}: {}", path.display(), e.to_string().trim_end()));
        // The file's own words first, so that a slip is told with its line; then its values over those of its method.
        let config: Self = toml::from_str(text).map_err(wrong)?;
        let config = if (config.method, config.priors.set) == (Method::Ours, PriorSet::Usual) {
            config
        } else {
            let method = if config.method == Method::Paper { Self::paper() } else { Self::default() };
            let under = Self { priors: Priors::of(config.priors.set), ..method };
            let mut values = toml::Table::try_from(under).map_err(|e| Error::Config(e.to_string()))?;
            overlay(&mut values, toml::from_str(text).map_err(wrong)?);
            toml::Value::Table(values).try_into().map_err(wrong)?
        };
        config.sound().map_err(|e| Error::Config(format!("{}: {e}", path.display())))?;
        Ok(config)
    }

    /// The paper's method, PAWS: every clip for itself. Where the paper is silent our value stands; where this stands in for
    /// something, or differs, is listed in ARCHITECTURE.md.
    #[must_use]
    pub fn paper() -> Self {
        let mut config = Self { method: Method::Paper, ..Self::default() };
        config.hands.contact_from_depth = false;
        config.hands.contact_from_words = false;
        config.hands.restart_after = 0;
        config.hands.min_samples = 3;
        config.hands.widen_secs = 0.0;
        config.localization.closed_state_frames = false;
        config.localization.occlusion = false;
        config.geometry.depth_scale = false;
        config.geometry.lines = LineMethod::Unprojected;
        config.geometry.manhattan = ManhattanMethod::Clustered;
        config.inference.method = InferenceMethod::Paper;
        config.inference.use_face_normal = false;
        config.inference.merge_clips = false;
        config.inference.grouping = GroupingMethod::Voxels;
        config.inference.refit = false;
        config.inference.second_look = false;
        config.validation.feedback = false;
        config
    }

    /// The paper's PAWS-s: the same with the clips of one part made one joint (§C.2).
    #[must_use]
    pub fn paper_s() -> Self {
        let mut config = Self::paper();
        config.inference.merge_clips = true;
        config
    }

    /// All values with unit, source and meaning, in the order of the pipeline.
    #[must_use]
    pub fn rows(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        self.priors.rows(&mut rows);
        self.pictures.rows(&mut rows);
        self.hands.rows(&mut rows);
        self.localization.rows(&mut rows);
        self.geometry.rows(&mut rows);
        self.part.rows(&mut rows);
        self.reasoning.rows(&mut rows);
        self.inference.rows(&mut rows);
        self.alignment.rows(&mut rows);
        self.fitting.rows(&mut rows);
        self.appearance.rows(&mut rows);
        self.validation.rows(&mut rows);
        self.primitives.rows(&mut rows);
        self.comparison.rows(&mut rows);
        rows
    }

    /// The whole configuration as TOML with unit, section and meaning as comments; [`Config::read`] takes it back.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let method = if self.method == Method::Paper { "paper" } else { "ours" };
        let mut text = format!(
            "# Which set of defaults: \"ours\", or the \"paper\"'s.\nmethod = \"{method}\"\n\
             # Seed of every random draw.\nseed = {}\n",
            self.seed
        );
        let mut block = "";
        let rows = self.rows();
        for row in &rows {
            let Some((name, key)) = row.key.rsplit_once('.') else { continue };
            if name != block {
                block = name;
                text += &format!("\n[{name}]\n");
            }
            let grounds = if row.grounds.is_empty() { String::new() } else { format!(": {}", row.grounds) };
            text += &format!("# {} [{}; {}{grounds}]\n{key} = {}\n", row.meaning, row.unit, row.source, row.value);
        }
        text
    }

    /// Refuses values that no step could work with. Reading a file does so, and so does [`crate::make`] before anything is
    /// inferred; whoever calls a step alone with values of their own asks here.
    ///
    /// # Errors
    /// Naming the key, its value and what it can be.
    pub fn check(&self) -> Result<()> {
        self.sound().map_err(Error::Config)
    }

    fn sound(&self) -> std::result::Result<(), String> {
        if let Some(why) = self.rows().iter().find_map(wrong) {
            return Err(why);
        }
        self.priors.check()?;
        if self.inference.torus_tolerance_min_m > self.inference.torus_tolerance_max_m {
            return Err("inference.torus_tolerance_min_m is above torus_tolerance_max_m".to_owned());
        }
        let pixel = &self.part.pixel;
        if pixel.before + pixel.behind.max(pixel.blocked) >= 1.0 {
            return Err("part.pixel: before and behind, and before and blocked, must add up to less than 1".to_owned());
        }
        let [least, most] = self.pictures.depth_per_distance;
        if least >= most {
            return Err("pictures.depth_per_distance must be two numbers, the smaller one first".to_owned());
        }
        if self.localization.min_views > self.localization.local_frames {
            return Err("localization.min_views is above local_frames: no voxel could ever be confident".to_owned());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
