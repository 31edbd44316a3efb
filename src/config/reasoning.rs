//! The motion type and the plausible hinges.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// The motion type and the plausible hinges (§3.3, §A.6).
    Reasoning, "reasoning", {
        /// Frames of a clip shown to a language model for the motion type (the geometric heuristic looks at none).
        vlm_frames: usize = 10, "frames", "B.1";
        /// Longest projected lines per view offered to a language model (the geometric heuristic weighs all).
        vlm_lines_per_view: usize = 4, "lines", "B.1";
        /// Global views in which a language model is asked for the hinge; fewer cost less.
        vlm_views: usize = 50, "views", "A.6";
        /// Pictures of a clip shown to a language model for the name of the furniture, where nobody named it.
        vlm_name_frames: usize = 4, "frames", "ours";
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
        /// Without depth: how often a plane through sparse points before which a hand takes hold is the front that it opens.
        points_front_share: f64 = 0.8, "share", "ours";
        /// Log likelihoods of hand and depth are divided by this before they meet priors and words: they share errors. Of 1,
        /// 1.5, 2 and 3 the one that explains the development seeds of four tiers best, and leaves probabilities calibrated.
        evidence_temperature: f64 = 2.0, "-", "ours";
        /// A slide runs along a direction of its face from this cosine of the angle between them on (20 degrees). Judgement.
        same_way_cos: f64 = 0.94, "-", "ours";
        /// Added to a line's length where lines share their prior by it: short ones are edges of furniture, too. Judgement.
        line_length_least_m: f64 = 0.05, "m", "ours";
        /// By how much a line's share of the prior grows where a language model names it in every view, beside its own. Judgement.
        vlm_line_gain: f64 = 4.0, "-", "ours";
        /// The balance of a language model's frames counts in full from one over this on. Judgement.
        vlm_balance_gain: f64 = 1.5, "-", "ours";
        /// From this many frames on a language model's errors have averaged out as far as they do. Judgement.
        vlm_enough_frames: usize = 4, "frames", "ours";
        /// What `vlm_enough_frames` frames are worth beside fewer. Judgement.
        vlm_enough_gain: f64 = 1.4, "-", "ours";
        /// Pictures are sent no larger: models shrink what is larger themselves, and it would only cost.
        vlm_picture_px: usize = 1024, "px", "ours";
        /// Of what a language model said of a frame, so much goes into its summary.
        vlm_note_chars: usize = 120, "characters", "ours";
        /// Shorter lines cannot be told from their number: share of the shorter side of the image. Judgement.
        vlm_shortest_line: f64 = 0.06, "share", "ours";
        /// Lines that are nearer to each other than the shorter side of the image over this are one to whoever looks. Judgement.
        vlm_lines_apart: f64 = 50.0, "-", "ours";
        /// A line is hidden where depth is nearer than it by this much, metres, and by this share of its distance. Judgement: what
        /// estimated depth is off by.
        vlm_hidden_behind: [f64; 2] = [0.06, 0.04], "m, share", "ours";
        /// Parts of a line that are nearer to the camera are not drawn.
        vlm_nearest_m: f64 = 0.1, "m", "ours";
        /// An edge of furniture is an edge of its mask: so far beside it a line still touches. Judgement.
        vlm_mask_rim_px: f64 = 2.0, "px", "ours";
        /// Hand and source move a hinge by no more than so many standard deviations of its source: farther it is another hinge, which
        /// has its own candidate. Judgement.
        settled_within: f64 = 3.0, "-", "ours";
    } parts {
        /// What each source of hypotheses is worth.
        sources: Sources;
        /// How well directions are known.
        directions: Directions;
    }
}

block! {
    /// How likely the joint is one of a source before anything else is asked, beside the other sources of its type (ours). All are
    /// judgements.
    Sources, "reasoning.sources", {
        /// A 3D line seen in several views.
        line: f64 = 0.5, "weight", "ours";
        /// Where the face meets another side of the furniture.
        plane_edge: f64 = 0.1, "weight", "ours";
        /// An edge of the part that was seen to move.
        part_edge: f64 = 0.35, "weight", "ours";
        /// An edge of the visible face.
        face_edge: f64 = 0.1, "weight", "ours";
        /// The circle that the hand drew.
        hand_arc: f64 = 0.12, "weight", "ours";
        /// The normal of the touched face; where the face is known, how slides run in it is `priors.hung`.
        face_normal: f64 = 0.8, "weight", "ours";
        /// An axis of the touched face, in the face.
        face_axis: f64 = 0.05, "weight", "ours";
        /// A direction of the room. Where the face is known its own axes come first; without one the room's are all there is.
        manhattan: f64 = 0.1, "weight", "ours";
        /// The principal direction of the hand's path.
        hand_path: f64 = 0.04, "weight", "ours";
        /// Where a front of a usual size has its edge: what edges of seen parts and faces have together, where no part was seen.
        assumed: f64 = 0.45, "weight", "ours";
    }
}

block! {
    /// How well directions are known, whatever the hand does (ours).
    Directions, "reasoning.directions", {
        /// A face's and the room's axes, about each of two directions across them. Normals with fifteen degrees of noise leave the
        /// room's frame to a degree, and gravity, to which fronts are set upright, is known no better.
        frame_std_deg: f64 = 1.0, "deg", "ours";
        /// A 3D line's own direction: ends half a metre apart, each off by a centimetre.
        line_std_rad: f64 = 0.03, "rad", "ours";
        /// Where only the hand tells the direction: the largest tilt that a covariance can speak of.
        free_std_rad: f64 = 0.5, "rad", "ours";
    }
}
