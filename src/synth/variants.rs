//! What is recorded: which kitchen, how noisy, and what a study changes about it.

use crate::error::{Error, Result};

/// How noisy a recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Tier {
    /// Exact depth, poses and masks; hands to 3 mm
    Clean,
    /// Errors of estimated hands, poses, depth and contact as they are on real recordings
    Realistic,
    /// Twice as large ones, short motions, shifted narrations of which a third say only "open it"
    Hard,
    /// Benchmark: nearly exact
    T0,
    /// Benchmark: good estimators
    T1,
    /// Benchmark: estimators as they are
    T2,
    /// Benchmark: between T2 and T3, words mostly right, camera poses with errors
    Hd,
    /// Benchmark: bad estimators
    T3,
    /// Benchmark: T2 with motions of 10 to 22 degrees, 5 to 9 cm
    Short,
    /// Benchmark: T2 with all furniture turned 12 to 33 degrees against the room
    Nonm,
}

impl Tier {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Clean,
        Self::Realistic,
        Self::Hard,
        Self::T0,
        Self::T1,
        Self::T2,
        Self::Hd,
        Self::T3,
        Self::Short,
        Self::Nonm,
    ];

    /// Whether it is one of the benchmark's, with its kitchens and its person.
    #[must_use]
    pub fn is_benchmark(self) -> bool {
        !matches!(self, Self::Clean | Self::Realistic | Self::Hard)
    }

    /// Its name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::Realistic => "realistic",
            Self::Hard => "hard",
            Self::T0 => "t0",
            Self::T1 => "t1",
            Self::T2 => "t2",
            Self::Hd => "hd",
            Self::T3 => "t3",
            Self::Short => "short",
            Self::Nonm => "nonm",
        }
    }
}

/// What a study changes about a tier; the default changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Changes {
    /// Clips of each part (tiers of the benchmark only); two where nothing is said.
    pub clips_per_part: Option<usize>,
    /// Standard deviation of hand positions, metres a direction: slow and fast errors together, without outliers and
    /// without the clip's error of distance.
    pub hand_noise_m: Option<f64>,
    /// Relative standard deviation of the hand's distance: of one draw a clip (tiers of the benchmark) or a recording.
    pub depth_bias: Option<f64>,
    /// Hand samples that remain of each clip, all with contact.
    pub few_hands: Option<usize>,
    /// Share of clips whose noun is of the wrong joint type.
    pub word_error: Option<f64>,
    /// Share of clips in whose frames the masks give the touched part's class to a neighbour of another class.
    pub mask_error: Option<f64>,
    /// No masks at all.
    pub no_masks: bool,
    /// Which take of the kitchen: the same kitchen and parts, other motions, views and errors. Take 0 is the recording that
    /// nothing is changed about.
    pub take: u64,
    /// The recording's world is its own: turned about the vertical and moved against that of the kitchen's other takes.
    pub own_world: bool,
    /// Surfaces look as what they are made of, in the place of flat colours. Pictures alone differ: depth, hands, poses, masks and
    /// normals are the same bytes.
    pub materials: bool,
}

impl Changes {
    /// What the sizes of hand errors (metres a direction) are multiplied by.
    pub(super) fn hand_factor(&self, lateral: f64, ray: f64, white: f64) -> f64 {
        let per_axis = ((2.0 * lateral * lateral + ray * ray) / 3.0 + white * white).sqrt();
        self.hand_noise_m.map_or(1.0, |wanted| wanted / per_axis)
    }

    /// Refuses changes that are none.
    pub(super) fn check(&self, tier: Tier) -> Result<()> {
        let wrong = |text: String| Err(Error::Config(format!("synth: {text}")));
        for (name, share) in [("word error", self.word_error), ("mask error", self.mask_error)] {
            if let Some(share) = share.filter(|s| !(0.0..=1.0).contains(s)) {
                return wrong(format!("a {name} of {share} is not a share between 0 and 1"));
            }
        }
        for (name, size) in [("hand noise", self.hand_noise_m), ("depth bias", self.depth_bias)] {
            if let Some(size) = size.filter(|s| !s.is_finite() || *s < 0.0) {
                return wrong(format!("a {name} of {size} is not a size; give a number from 0 on"));
            }
        }
        if self.few_hands == Some(0) || self.clips_per_part == Some(0) {
            return wrong("0 hands or clips per part leave nothing to infer from; give 1 or more".to_owned());
        }
        if self.clips_per_part.is_some() && !tier.is_benchmark() {
            let tier = tier.name();
            return wrong(format!(
                "a number of clips per part can be asked for on the tiers t0 to nonm, not on {tier}"
            ));
        }
        Ok(())
    }
}

/// What to record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SynthOptions {
    /// Which kitchen and which person.
    pub seed: u64,
    /// How noisy.
    pub tier: Tier,
    /// Image width, pixels; the height is three quarters of it.
    pub width: usize,
    /// Parts that are opened and closed.
    pub parts: usize,
}

impl Default for SynthOptions {
    fn default() -> Self {
        Self { seed: 0, tier: Tier::Realistic, width: 320, parts: 4 }
    }
}
