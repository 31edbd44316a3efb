//! The hand in the simulation.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// The hand in the simulation, and what counts as explained (ours).
    Validation, "validation", {
        /// Step of the simulation.
        step_secs: f64 = 1.0 / 240.0, "s", "ours";
        /// Friction between the boxes of a part and what it touches: boards and fronts of furniture slide on each other more than they
        /// stick. Judgement.
        board_friction: f64 = 0.2, "-", "ours";
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
        /// A hand that was recorded at fewer places refutes no joint by not being followed: between them it is not known.
        least_samples: usize = 5, "samples", "ours";
        /// A hand that is faster than this refutes no joint by not being followed: no arm that holds a door is, so that its times are
        /// wrong.
        hand_speed_max_m_per_s: f64 = 3.0, "m/s", "ours";
        /// A hinge this far beside the right one is a wrong one: rivals stand there on all four sides.
        rival_shift_m: f64 = 0.25, "m", "ours";
        /// Joints in doubt are built and replayed under each of their hypotheses; what physics refutes loses weight.
        feedback: bool = true, "-", "ours";
        /// What a hypothesis loses where physics refutes it by what was seen; half by what was assumed. 3 is twenty to one:
        /// evidence, not a veto.
        refuted_nats: f64 = 3.0, "nats", "ours";
        /// For a smaller share of the time a hand pushes or strains while it takes hold or turns round. Judgement.
        blocked_time_share: f64 = 1.0 / 3.0, "share", "ours";
        /// An arm strains from this share of its most force on.
        strained_share: f64 = 0.99, "share", "ours";
        /// At rest between the way there and the way back, and after them.
        rest_secs: f64 = 0.25, "s", "ours";
        /// A person opens a part within seconds: a longer motion is in another unit.
        longest_secs: f64 = 600.0, "seconds", "ours";
        /// The hand's damping is critical on the part's mass, and on no less than this.
        least_mass_kg: f64 = 0.1, "kg", "ours";
        /// Share of a velocity that the hand's damper may take in one step: a part of which it takes more flies.
        taken_share: f64 = 0.75, "share", "ours";
        /// Rows a second of a replay's trace.
        trace_hz: f64 = 30.0, "Hz", "ours";
        /// Within so many radians or metres of a stop the part stands at it.
        at_stop: f64 = 1e-3, "rad or m", "ours";
        /// No hand that opens furniture throws it: a ball thrown hard is this fast.
        thrown_m_per_s: f64 = 20.0, "m/s", "ours";
        /// A part has no more energy than so many times the work that was done on it, which is as good as the steps are short, and
        /// `spare_j`.
        spare_work: f64 = 2.0, "-", "ours";
        /// Energy that a part may have beside `spare_work`: what a neighbour that falls onto it may add.
        spare_j: f64 = 1.0, "J", "ours";
        /// A hand's speed is taken over this time, in which noise adds little to it.
        speed_window_secs: f64 = 0.1, "s", "ours";
        /// A hand's speed is the one that this share of its motion exceeds.
        speed_share: f64 = 0.1, "share", "ours";
        /// Axes that differ by less go one way.
        same_way_rad: f64 = 0.3, "rad", "ours";
        /// No hinge of a front is its rival that is nearer to it than half of this, or than a quarter of the front.
        least_half_m: f64 = 0.1, "m", "ours";
        /// A hinge through the hand explains nothing and would not be built.
        least_lever_m: f64 = 0.05, "m", "ours";
        /// A rival that slides gets all the room it wants.
        rival_slide_m: f64 = 2.0, "m", "ours";
        /// An error that makes the hands less likely by this is seen: the nats of two standard deviations.
        seen_nats: f64 = 2.0, "nats", "ours";
        /// A hand that went less far was seen for a moment, not in motion.
        glimpse_m: f64 = 0.02, "m", "ours";
    }
}
