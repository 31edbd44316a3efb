//! Every number that can be chosen: the paper's hyperparameters (§B.1, the defaults) and what the paper leaves open.

mod values;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use values::{overlay, sensible};

/// One configurable value, for `paws config` and for the docs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// `block.key`.
    pub key: String,
    /// The value as TOML.
    pub value: String,
    /// Unit, or "-".
    pub unit: &'static str,
    /// Section of the paper, or "ours" where the paper has no number.
    pub section: &'static str,
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
    /// Ours: one closed grip, face and outline; what is closed was open.
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

/// Declares one block of the config with its defaults, units and sources in one place.
macro_rules! block {
    ($(#[doc = $block_doc:literal])* $block:ident, $name:literal, {
        $($(#[doc = $doc:literal])* $field:ident: $ty:ty = $default:expr, $unit:literal, $section:literal;)*
    }) => {
        $(#[doc = $block_doc])*
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $block { $($(#[doc = $doc])* pub $field: $ty,)* }

        impl Default for $block {
            fn default() -> Self { Self { $($field: $default,)* } }
        }

        impl $block {
            fn rows(&self, rows: &mut Vec<Row>) {
                $(rows.push(Row {
                    key: concat!($name, ".", stringify!($field)).to_owned(),
                    value: toml::Value::try_from(&self.$field).map(|v| v.to_string()).unwrap_or_default(),
                    unit: $unit,
                    section: $section,
                    meaning: [$($doc.trim()),*].join(" "),
                });)*
            }
        }
    };
}

block! {
    /// Fingertips to a smoothed trajectory (§3.1, §A.2).
    Hands, "hands", {
        /// Correlation time of the hand's velocity. The paper prints "length scale 10.0 m"; a length cannot be one, ten
        /// frames at 30 fps can.
        correlation_secs: f64 = 1.0 / 3.0, "s", "B.1";
        /// Stationary standard deviation of the hand's velocity. The paper prints "q = 0.01 m": 0.01 m a frame at 30 fps.
        speed_std_m_per_s: f64 = 0.3, "m/s", "B.1";
        /// Standard deviation of an observed fingertip mean.
        observation_std_m: f64 = 0.05, "m", "B.1";
        /// p-value of the chi-square gate with 3 degrees of freedom.
        gate_p_value: f64 = 0.05, "share", "B.1";
        /// Rejections in a row after which the filter starts again (0 = never).
        restart_after: usize = 3, "samples", "ours";
        /// Tell when a hand holds something; false takes every sample of a clip.
        use_contact: bool = true, "-", "A.2";
        /// Tell it from depth around the hand, too, with flags as evidence; false believes the flags alone.
        contact_from_depth: bool = true, "-", "ours";
        /// Frames with a hand whose depth is looked at for it: one in this time, a fraction of what reaching takes.
        contact_every_secs: f64 = 0.15, "s", "ours";
        /// Where no sample is flagged, all of the clip count if the narration names the furniture that they move.
        contact_from_words: bool = true, "-", "ours";
        /// Contact that begins inside a narration is followed beyond its bounds by at most this (0 = not at all).
        widen_secs: f64 = 2.0, "s", "ours";
        /// Fewer samples in contact than this give no answer.
        min_samples: usize = 1, "samples", "ours";
    }
}

block! {
    /// Where the touched furniture is (§3.1, §A.3).
    Localization, "localization", {
        /// Edge of a voxel.
        voxel_m: f64 = 0.05, "m", "B.1";
        /// A voxel seen in at least this many local frames is confident.
        min_views: usize = 4, "views", "B.1";
        /// Local frames per clip.
        local_frames: usize = 5, "frames", "B.1";
        /// Local frames from the closed state around the interaction (true), or from the interaction itself as the paper
        /// has it (false): a part that moves leaves the voxels that would count it.
        closed_state_frames: bool = true, "-", "ours";
        /// Global views for the geometry.
        global_views: usize = 50, "views", "B.1";
        /// Share of the confident voxels that a global view must have inside its frustum.
        min_visible_share: f64 = 0.3, "share", "ours";
        /// Global views count a voxel only where nothing stands before it.
        occlusion: bool = true, "-", "ours";
        /// Only what lies within this distance of the hand can be the touched furniture.
        reach_m: f64 = 1.5, "m", "ours";
        /// Frames of the whole room, outside the interactions, that help to find the scale of depth.
        survey_frames: usize = 60, "frames", "ours";
    }
}

block! {
    /// Lines and directions (§3.2, §A.4, §A.5, algorithm 1).
    Geometry, "geometry", {
        /// Correct each frame's depth by a factor, found from surfaces that several frames see.
        depth_scale: bool = true, "-", "ours";
        /// How 3D lines are made: "unprojected" (the paper: fitted to unprojected points) or "triangulated" (from the views'
        /// planes, depth only says what belongs together).
        lines: LineMethod = LineMethod::Triangulated, "-", "ours";
        /// Shorter 2D segments are dropped.
        min_segment_px: f64 = 25.0, "px", "ours";
        /// Depth samples along a 2D segment.
        samples_per_segment: usize = 24, "-", "ours";
        /// Inlier distance of the LO-RANSAC line fits.
        line_tolerance_m: f64 = 0.03, "m", "ours";
        /// Draws of the LO-RANSAC line fits.
        line_draws: usize = 60, "-", "ours";
        /// Segments of one track differ by no more than this.
        track_angle_deg: f64 = 10.0, "deg", "ours";
        /// Distance between segments of one track.
        track_distance_m: f64 = 0.04, "m", "ours";
        /// Views that must see a track.
        min_track_views: usize = 3, "views", "ours";
        /// Clusters of the per-frame k-means of normals.
        normal_clusters: usize = 6, "-", "ours";
        /// Normals sampled per frame.
        normals_per_frame: usize = 2000, "-", "ours";
        /// Bandwidth of the mean shift over the frames' axes.
        mean_shift_deg: f64 = 12.0, "deg", "ours";
        /// How the room's frame is found: "clustered" (the paper: k-means, then mean shift) or "gravity" (the heading of
        /// upright surfaces, then all normals robustly).
        manhattan: ManhattanMethod = ManhattanMethod::Gravity, "-", "ours";
        /// Slab half-width that belongs to a front face.
        face_tolerance_m: f64 = 0.015, "m", "ours";
        /// A grip is about this far in front of its face.
        grip_standoff_m: f64 = 0.035, "m", "ours";
    }
}

block! {
    /// The motion type and the plausible hinges (§3.3, §A.6).
    Reasoning, "reasoning", {
        /// Frames of a clip shown to a language model for the motion type (the geometric heuristic looks at none).
        vlm_frames: usize = 10, "frames", "B.1";
        /// Longest projected lines per view offered to a language model (the geometric heuristic weighs all).
        vlm_lines_per_view: usize = 4, "lines", "B.1";
        /// Global views in which a language model is asked for the hinge; fewer cost less.
        vlm_views: usize = 50, "views", "A.6";
        /// Sampling temperature of a language model.
        vlm_temperature: f64 = 0.5, "-", "B.1";
        /// Nucleus of a language model.
        vlm_top_p: f64 = 0.3, "-", "B.1";
        /// Longest answer of a language model; one that thinks aloud needs more.
        vlm_max_tokens: usize = 300, "tokens", "ours";
        /// How often a language model tells the motion type rightly.
        vlm_accuracy: f64 = 0.9, "share", "ours";
        /// How often the furniture's name tells rightly how it opens: the type, the hinge's edge, the slide's direction, and
        /// whether the face is a lid's.
        name_accuracy: f64 = 0.95, "share", "ours";
        /// Independent samples in one recorded motion: errors of neighbouring frames are correlated.
        effective_samples: f64 = 8.0, "-", "ours";
        /// Noise of a smoothed hand position when two explanations of it are compared.
        hand_std_m: f64 = 0.03, "m", "ours";
        /// Take the furniture's names from narrations and masks; false reads all of them as "it", for whatever asks for a name.
        /// A language model still sees what it is shown.
        use_names: bool = true, "-", "ours";
        /// Log likelihoods of hand and depth are divided by this before they meet priors and words: they share errors. Of 1,
        /// 1.5, 2 and 3 the one that explains the development seeds of four tiers best, and leaves probabilities calibrated.
        evidence_temperature: f64 = 2.0, "-", "ours";
    }
}

block! {
    /// Trajectory and geometry to a joint (§3.4, §A.7, §C.2).
    Inference, "inference", {
        /// How a joint is chosen: "paper" (type from words, slide along a direction of the room, hinge at the line of least
        /// variance) or "posterior" (all hypotheses weighed by hand, depth, shape and words).
        method: InferenceMethod = InferenceMethod::Posterior, "-", "ours";
        /// Tolerance of the torus test as a share of the mean radius.
        torus_tolerance_ratio: f64 = 0.15, "share", "B.1";
        /// Least torus tolerance.
        torus_tolerance_min_m: f64 = 0.015, "m", "B.1";
        /// Largest torus tolerance.
        torus_tolerance_max_m: f64 = 0.05, "m", "B.1";
        /// Largest radius of a rotation.
        max_radius_m: f64 = 1.0, "m", "B.1";
        /// Least radius of a rotation: nearer lines run through the hand.
        min_radius_m: f64 = 0.05, "m", "ours";
        /// A hand point this near the slide's line is an inlier.
        prismatic_tolerance_m: f64 = 0.02, "m", "B.1";
        /// Least share of inliers of a slide, counted within the larger of the tolerance and twice the hand noise.
        prismatic_min_inliers: f64 = 0.3, "share", "B.1";
        /// Add the normal of the touched face to the Manhattan directions (furniture turned against the room).
        use_face_normal: bool = true, "-", "ours";
        /// Hinge directions within this angle of an axis of the face are set to it.
        snap_deg: f64 = 12.0, "deg", "ours";
        /// Covariances of what is fitted to the depth of the open state are multiplied by this: its views share errors. Chosen
        /// on the development seeds of all tiers.
        shared_errors: f64 = 3.0, "-", "ours";
        /// Fit the hinge and the openings to the depth of the open state.
        refit: bool = true, "-", "ours";
        /// Judge each joint of the scene once more with the outlines that were fitted to what it could be: method "posterior"
        /// with `refit` only.
        second_look: bool = true, "-", "ours";
        /// Merge clips of one joint into one scene-level joint (the paper: PAWS-s with it, PAWS without).
        merge_clips: bool = true, "-", "C.2";
        /// How clips of one joint are found: "voxels" (the paper's for Epic-Fields: their confident voxels overlap) or "places"
        /// (one closed grip, face and outline, and what is closed was open).
        grouping: GroupingMethod = GroupingMethod::Places, "-", "ours";
        /// Grouping "voxels": least intersection over union of two clips of one joint. The paper has no number; on development
        /// seeds of three tiers this finds a third of the pairs, with one wrong one for three right ones.
        merge_voxel_iou: f64 = 0.1, "share", "ours";
        /// Clips whose closed grips are nearer than this can be one joint.
        merge_grip_m: f64 = 0.15, "m", "ours";
        /// A closing belongs to the only part of its name that stands open, if the hands' ways come nearer than this; where
        /// either clip names nothing, or nothing of that name stands open, to what the clip before it opened.
        merge_open_m: f64 = 0.5, "m", "ours";
        /// Clips whose front faces differ by less than this can be one joint.
        merge_angle_deg: f64 = 25.0, "deg", "ours";
    }
}

block! {
    /// Boxes, handles, carcass, limits (ours).
    Fitting, "fitting", {
        /// Cell of the grid on the front face in which the moving part is found.
        cell_m: f64 = 0.02, "m", "ours";
        /// Thickness of doors, fronts and boards.
        board_m: f64 = 0.018, "m", "ours";
        /// Free space between a moving part and whatever is fixed.
        clearance_m: f64 = 0.003, "m", "ours";
        /// Depth of a carcass where nothing tells it.
        carcass_depth_m: f64 = 0.55, "m", "ours";
        /// Density of boards.
        density_kg_per_m3: f64 = 700.0, "kg/m^3", "ours";
        /// Viscous damping of hinges.
        hinge_damping: f64 = 0.5, "N m s/rad", "ours";
        /// Dry friction of hinges.
        hinge_friction: f64 = 0.2, "N m", "ours";
        /// Viscous damping of slides.
        slide_damping: f64 = 5.0, "N s/m", "ours";
        /// Dry friction of slides.
        slide_friction: f64 = 2.0, "N", "ours";
        /// Build the rest of the room (walls, floor, worktops, furniture that nobody opened) as boxes that do not move.
        room: bool = true, "-", "ours";
        /// Edge of the cells in which the room is gathered.
        room_voxel_m: f64 = 0.05, "m", "ours";
        /// A cell of the room has been seen in at least this many views.
        room_min_views: usize = 3, "views", "ours";
        /// The room is built as far as this from the furniture that opens.
        room_reach_m: f64 = 6.0, "m", "ours";
        /// Boxes of the room at the most, beside floor and walls; the largest stay.
        room_boxes: usize = 300, "boxes", "ours";
    }
}

block! {
    /// Textured surfaces, for eyes alone (ours).
    Appearance, "appearance", {
        /// Frames that the room is fused from and textured with, spread over viewpoints; frames in which all is closed first. More
        /// of them see next to nothing new in one kitchen.
        frames: usize = 150, "frames", "ours";
        /// Frames for each part that show it standing open: its back, and what is behind it.
        open_frames: usize = 8, "frames", "ours";
        /// Depth beyond this is left out: estimates are worth less there than the fused surface is thick.
        depth_max_m: f64 = 5.0, "m", "ours";
        /// Edge of a voxel. It grows where the scene would not fit into `fuse_mb`.
        voxel_m: f64 = 0.01, "m", "ours";
        /// Depth counts within this distance of the surface that it shows: twice the noise of estimated depth. At least three
        /// voxels.
        truncation_m: f64 = 0.04, "m", "ours";
        /// Memory for voxels; 60 m^2 of surface at a centimetre take about half of it.
        fuse_mb: f64 = 500.0, "MB", "ours";
        /// What is nearer than this to fingertips, or to the forearm that they belong to, is a person.
        hand_m: f64 = 0.12, "m", "ours";
        /// What is seen nearer than this to a part's boards is the part and not the room: what fronts and depth are off by.
        slab_m: f64 = 0.05, "m", "ours";
        /// Pieces of surface that hang together with nothing and are smaller are noise: a hand's breadth by two.
        shard_m2: f64 = 0.02, "m^2", "ours";
        /// Triangles of the room.
        triangles: usize = 80_000, "triangles", "ours";
        /// Edge of a texel: a pixel of a VGA camera at a metre and a half. It grows where `texels` would not suffice.
        texel_m: f64 = 0.004, "m", "ours";
        /// Texels of all surfaces together: half of a page of 4096 x 4096.
        texels: usize = 8_000_000, "texels", "ours";
    }
}

block! {
    /// The hand in the simulation, and what counts as explained (ours).
    Validation, "validation", {
        /// Step of the simulation.
        step_secs: f64 = 1.0 / 240.0, "s", "ours";
        /// Stiffness of the hand's grip.
        hand_stiffness_n_per_m: f64 = 800.0, "N/m", "ours";
        /// The most a person's arm pulls.
        hand_force_max_n: f64 = 150.0, "N", "ours";
        /// Fingers move on the handle by this much before they pull.
        grip_slack_m: f64 = 0.01, "m", "ours";
        /// Tracking error up to which a motion counts as explained: a right joint shows 2 to 5 cm of it under the errors
        /// of estimated hands. More decides nothing; twice as much refutes the joint where the hand itself is steadier.
        pass_rms_m: f64 = 0.05, "m", "ours";
        /// Share of the observed range that the simulated joint must reach.
        pass_range_share: f64 = 0.8, "share", "ours";
        /// A joint must be this much more likely than its best rival, in nats over all clips: 3 is twenty to one; and so sure
        /// after all evidence. A rival that is as much more likely than the joint, and than chance among the rivals gives,
        /// refutes it.
        margin_nats: f64 = 3.0, "nats", "ours";
        /// Independent samples in one recorded motion, at most.
        effective_samples: f64 = 8.0, "-", "ours";
        /// Errors of the hand within this time are one error.
        hand_correlation_secs: f64 = 0.3, "s", "ours";
        /// Noise of a smoothed hand position when two explanations of it are compared.
        hand_std_m: f64 = 0.03, "m", "ours";
        /// A hinge this far beside the right one is a wrong one: rivals stand there on all four sides.
        rival_shift_m: f64 = 0.25, "m", "ours";
        /// Joints in doubt are built and replayed under each of their hypotheses; what physics refutes loses weight.
        feedback: bool = true, "-", "ours";
        /// What a hypothesis loses where physics refutes it by what was seen; half by what was assumed. 3 is twenty to one:
        /// evidence, not a veto.
        refuted_nats: f64 = 3.0, "nats", "ours";
    }
}

/// The whole configuration. `Config::default()` is what `paws` runs without `--config`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// What the values that a file leaves out are: ours, or the paper's.
    pub method: Method,
    /// Seed of every random draw.
    pub seed: u64,
    /// §3.1, §A.2.
    pub hands: Hands,
    /// §3.1, §A.3.
    pub localization: Localization,
    /// §3.2, §A.4, §A.5.
    pub geometry: Geometry,
    /// §3.3, §A.6.
    pub reasoning: Reasoning,
    /// §3.4, §A.7, §C.2.
    pub inference: Inference,
    /// Ours.
    pub fitting: Fitting,
    /// Ours.
    pub appearance: Appearance,
    /// Ours.
    pub validation: Validation,
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
        let config = match config.method {
            Method::Ours => config,
            Method::Paper => {
                let mut values = toml::Table::try_from(Self::paper()).map_err(|e| Error::Config(e.to_string()))?;
                overlay(&mut values, toml::from_str(text).map_err(wrong)?);
                toml::Value::Table(values).try_into().map_err(wrong)?
            }
        };
        config.check().map_err(|e| Error::Config(format!("{}: {e}", path.display())))?;
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
        self.hands.rows(&mut rows);
        self.localization.rows(&mut rows);
        self.geometry.rows(&mut rows);
        self.reasoning.rows(&mut rows);
        self.inference.rows(&mut rows);
        self.fitting.rows(&mut rows);
        self.appearance.rows(&mut rows);
        self.validation.rows(&mut rows);
        rows
    }

    /// The whole configuration as TOML with unit, section and meaning as comments; [`Config::read`] takes it back.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let method = if self.method == Method::Paper { "paper" } else { "ours" };
        let mut text = format!(
            "# What values left out are: \"ours\", or the \"paper\"'s.\nmethod = \"{method}\"\n\
             # Seed of every random draw.\nseed = {}\n",
            self.seed
        );
        let mut block = "";
        let rows = self.rows();
        for row in &rows {
            let Some((name, key)) = row.key.split_once('.') else { continue };
            if name != block {
                block = name;
                text += &format!("\n[{name}]\n");
            }
            let source = if row.section == "ours" { "ours".to_owned() } else { format!("paper, {}", row.section) };
            text += &format!("# {} [{}; {source}]\n{key} = {}\n", row.meaning, row.unit, row.value);
        }
        text
    }

    /// Refuses values that no step could work with.
    fn check(&self) -> std::result::Result<(), String> {
        for row in self.rows() {
            let Ok(value) = row.value.parse::<f64>() else { continue };
            let zero_is_fine = [
                "hands.restart_after",
                "hands.widen_secs",
                "localization.min_visible_share",
                "reasoning.vlm_temperature",
                "validation.grip_slack_m",
            ];
            if !value.is_finite() || value < 0.0 || (value == 0.0 && !zero_is_fine.contains(&row.key.as_str())) {
                return Err(format!("{} = {} must be a positive finite number ({})", row.key, row.value, row.unit));
            }
            let [low, high] = sensible(&row);
            if value != 0.0 && !(low..=high).contains(&value) {
                return Err(format!("{} = {} must lie between {low} and {high} ({})", row.key, row.value, row.unit));
            }
        }
        if self.inference.torus_tolerance_min_m > self.inference.torus_tolerance_max_m {
            return Err("inference.torus_tolerance_min_m is above torus_tolerance_max_m".to_owned());
        }
        if self.localization.min_views > self.localization.local_frames {
            return Err("localization.min_views is above local_frames: no voxel could ever be confident".to_owned());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_config_reads_back_as_itself() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("c.toml");
        std::fs::write(&path, Config::default().to_toml()).unwrap();
        assert_eq!(Config::read(&path).unwrap(), Config::default());
    }

    #[test]
    fn every_hyperparameter_of_the_paper_has_its_value() {
        let rows = Config::default().rows();
        let value = |key: &str| rows.iter().find(|r| r.key == key).map(|r| r.value.clone()).unwrap();
        for (key, expected) in [
            ("hands.observation_std_m", "0.05"),
            ("hands.gate_p_value", "0.05"),
            ("localization.voxel_m", "0.05"),
            ("localization.min_views", "4"),
            ("localization.local_frames", "5"),
            ("localization.global_views", "50"),
            ("reasoning.vlm_frames", "10"),
            ("reasoning.vlm_lines_per_view", "4"),
            ("reasoning.vlm_temperature", "0.5"),
            ("reasoning.vlm_top_p", "0.3"),
            ("inference.torus_tolerance_ratio", "0.15"),
            ("inference.torus_tolerance_min_m", "0.015"),
            ("inference.torus_tolerance_max_m", "0.05"),
            ("inference.max_radius_m", "1.0"),
            ("inference.prismatic_tolerance_m", "0.02"),
            ("inference.prismatic_min_inliers", "0.3"),
        ] {
            assert_eq!(value(key), expected, "{key}");
        }
    }

    #[test]
    fn the_papers_method_is_a_word_in_a_file_and_single_keys_may_differ() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("c.toml");
        std::fs::write(&path, "method = \"paper\"\n[geometry]\ndepth_scale = true\n").unwrap();
        let mut expected = Config::paper();
        expected.geometry.depth_scale = true;
        assert_eq!(Config::read(&path).unwrap(), expected);
        std::fs::write(&path, Config::paper().to_toml()).unwrap();
        assert_eq!(Config::read(&path).unwrap(), Config::paper());
        assert_ne!(Config::paper(), Config::default());
    }

    #[test]
    fn impossible_values_are_named() {
        let dir = tempfile::tempdir().unwrap();
        for (text, word) in [
            ("[hands]\nobservation_std_m = -1.0", "observation_std_m"),
            ("[hands]\nobservation_std_m = nan", "observation_std_m"),
            ("[hands]\nobservaton_std_m = 1.0", "observaton_std_m"),
            ("[localization]\nmin_views = 9", "min_views"),
            ("[hands", "c.toml"),
        ] {
            let path = dir.path().join("c.toml");
            std::fs::write(&path, text).unwrap();
            let error = Config::read(&path).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
