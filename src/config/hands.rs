//! What the hands do.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// Fingertips to a smoothed trajectory (§3.1, §A.2).
    Hands, "hands", {
        /// Correlation time of the hand's velocity. The paper's value, "length scale 10.0 m", has the unit of a length; it is read as
        /// ten frames at 30 fps.
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
        /// Where no frame has depth, an interaction that nobody told needs this much evidence of motion and flags: two rests and
        /// one line or arc between them are 16 of a steady hand, 11 of one that trembles by 1.5 cm.
        found_by_motion_nats: f64 = 8.0, "nats", "ours";
        /// Fewer samples in contact than this give no answer.
        min_samples: usize = 1, "samples", "ours";
        /// Seen within this before and after a hold a hand took hold and let go: a blink of the detector; a hand takes as long to reach
        /// a handle. Judgement.
        seen_secs: f64 = 0.35, "s", "ours";
        /// A hand that is not seen for longer may have let go. Judgement.
        gap_secs: f64 = 0.5, "s", "ours";
        /// A part moves from this long before its contact flags begin until this long after they end: flags begin late and end early
        /// by a fraction of a second. Judgement.
        moves_around_secs: f64 = 0.3, "s", "ours";
    } parts {
        /// How well a hand tells where it holds a part.
        grips: Grips;
        /// A hand by the depth around it, and what a single sample is worth.
        contact: Contact;
        /// The way of a hand.
        motion: HandMotion;
        /// A hand without depth around it.
        alone: HandAlone;
        /// Interactions that nobody told.
        found: Found;
    }
}

block! {
    /// How well a hand tells where it holds a part, along the motion: standard deviations (ours). Judgements.
    Grips, "hands.grips", {
        /// Of a grip where the hand was seen to take hold or let go.
        seen_std_m: f64 = 0.03, "m", "ours";
        /// Of a grip where the hand was lost on the way: about a third of what a drawer or the handle of a door travels.
        lost_std_m: f64 = 0.12, "m", "ours";
    }
}

block! {
    /// When a hand holds something by the depth around its fingertips (ours). Judgements where nothing else is said.
    Contact, "hands.contact", {
        /// Nothing is looked for farther from the fingertips: twice a hand's breadth and more is not contact.
        reach_m: f64 = 0.3, "m", "ours";
        /// Distances of a hand in the air fall off with this: about half of the way that a hand reaches.
        free_m: f64 = 0.3, "m", "ours";
        /// Share of the samples of a hold that say nothing: hands that are placed wrongly, depth of something else.
        astray_share: f64 = 0.25, "share", "ours";
        /// How long people hold what they open or close, the middle; two thirds of all holds last half to twice as long.
        hold_secs: f64 = 1.5, "s", "ours";
        /// Standard deviation of the logarithm of how long people hold what they open; it keeps a single near sample from being a hold.
        hold_log_std: f64 = 0.7, "-", "ours";
        /// A hold of one sample lasts as long as a frame: not less than this.
        hold_least_secs: f64 = 0.05, "s", "ours";
        /// One sample says no more than this for or against contact: its neighbours have the same error.
        says_at_most_nats: f64 = 3.0, "nats", "ours";
        /// Neighbouring flags are wrong together: so much of each is news.
        flag_news: f64 = 0.5, "share", "ours";
        /// Before anything is seen flags count as if so many had been wrong, and so many right: wrong one time in ten.
        flags_before: [f64; 2] = [1.0, 9.0], "samples", "ours";
        /// Still frames before and after the clip that are looked at.
        still_frames: usize = 3, "frames", "ours";
        /// How far from the clip, in time, still frames may be.
        still_within_secs: f64 = 4.0, "s", "ours";
        /// How much the distances of a hand from what it holds vary before anything is measured: estimated hands and depth are off by a
        /// few centimetres.
        unknown_std_m: f64 = 0.06, "m", "ours";
        /// Distances of a hand from what it holds vary by no less than this: fingers lie around a handle, depth is smooth over its edge.
        /// The samples that are taken for contact are the near ones, so that what they show is too little.
        least_std_m: f64 = 0.03, "m", "ours";
        /// Distances of a hand from what it holds vary by no less than this from clip to clip.
        least_between_m: f64 = 0.01, "m", "ours";
        /// Neighbouring samples share their error: one in so many is news.
        samples_a_news: f64 = 3.0, "-", "ours";
        /// The middle of a hold is steadier than its ends, which vary more by this factor.
        ends_widen: f64 = 1.3, "-", "ours";
        /// Holds, widths and flags explain each other in so many rounds.
        rounds: usize = 3, "-", "ours";
        /// Between two looks at the depth, up to so many times `contact_every_secs` apart, distances are interpolated.
        between_looks: f64 = 2.5, "-", "ours";
        /// Surfaces are sampled this finely.
        surface_step_m: f64 = 0.012, "m", "ours";
        /// Half of a finger's breadth and what a tracked hand is off sideways.
        finger_half_m: f64 = 0.03, "m", "ours";
        /// Masks are off at a hand's rim by the image's width over this: four pixels of 640, what segmenters smear.
        mask_rims: f64 = 160.0, "-", "ours";
    }
}

block! {
    /// What the way of a hand says about contact: rests, lines and arcs (ours). All are judgements.
    HandMotion, "hands.motion", {
        /// How long a hand rests where it takes hold or lets go.
        rest_secs: f64 = 0.25, "s", "ours";
        /// A sample may come so much late.
        rest_slack_secs: f64 = 0.02, "s", "ours";
        /// In a rest a hand that reaches or withdraws goes this far: the mean of an exponential; half a metre a second.
        reached_m: f64 = 0.12, "m", "ours";
        /// A rest is wider than what hands tremble by this factor.
        rest_widens: f64 = 1.3, "-", "ours";
        /// A hand that rests gives way by this, beside what it trembles.
        gives_way_m: f64 = 0.01, "m", "ours";
        /// So far from the line or arc of a held part a free hand is: the mean of an exponential.
        beside_m: f64 = 0.15, "m", "ours";
        /// A hand that holds something wanders off its line or arc by this, beside what it trembles.
        wanders_m: f64 = 0.015, "m", "ours";
        /// Samples whose neighbours are farther apart in time tell no tremble.
        neighbours_secs: f64 = 0.3, "s", "ours";
        /// Places are calmed by the median over this time to each side.
        calmed_half_secs: f64 = 0.18, "s", "ours";
        /// Hands are not faster, apart from an error of the estimate (`jump_m`).
        fastest_m_per_s: f64 = 4.0, "m/s", "ours";
        /// Error of the estimate by which a hand may jump, whatever its speed.
        jump_m: f64 = 0.3, "m", "ours";
        /// A path of fewer samples tells no arc.
        least_samples: usize = 8, "samples", "ours";
        /// An arc has one more freedom than a line, and has to be better by this factor.
        arc_handicap: f64 = 1.25, "-", "ours";
        /// Handles go around hinges at such radii.
        radii_m: [f64; 2] = [0.08, 3.0], "m", "ours";
    }
}

block! {
    /// When a hand holds something by its motion alone, where a recording has no depth (ours). All are judgements.
    HandAlone, "hands.alone", {
        /// Ends at which a hand surely does not rest are not tried: so much against a rest.
        unrest_nats: f64 = 1.0, "nats", "ours";
        /// Holds are no longer than this.
        longest_secs: f64 = 8.0, "s", "ours";
        /// What is opened moves by at least this, and by `least_trembles`.
        least_move_m: f64 = 0.04, "m", "ours";
        /// What is opened moves by at least so many times what hands tremble.
        least_trembles: f64 = 3.0, "-", "ours";
        /// Of the farthest that a hold went, its end is at least this far: there and back are two interactions.
        one_way_share: f64 = 0.65, "share", "ours";
        /// Errors of neighbouring samples hang together: a path tells no more than so many samples that have nothing to do with each
        /// other.
        independent: f64 = 8.0, "-", "ours";
        /// Narrations are off by about this.
        narration_std_secs: f64 = 1.0, "s", "ours";
        /// Ends of a hold are tried this often.
        tried_secs: f64 = 0.06, "s", "ours";
        /// Of a measure of the hand a sample says no more than this for or against contact, and neighbours say the same.
        measure_nats: f64 = 0.25, "nats", "ours";
        /// Fewer samples inside or outside of holds tell no measure.
        least_samples: usize = 20, "samples", "ours";
        /// Beside longer gaps a hand has no speed.
        gap_secs: f64 = 0.5, "s", "ours";
        /// Means that differ by less than this many of their standard deviations are one.
        differ_stds: f64 = 0.3, "-", "ours";
        /// Of two standard deviations the smaller one is at least this share of the larger.
        least_std_share: f64 = 0.3, "share", "ours";
    }
}

block! {
    /// Interactions that nobody told (ours). Judgements where nothing else is said.
    Found, "hands.found", {
        /// Interactions that nobody told last no longer than this.
        longest_secs: f64 = 6.0, "s", "ours";
        /// A hand that is not seen for longer may have let go.
        gap_secs: f64 = 1.0, "s", "ours";
        /// Samples of a hand are taken at most this often: twelve a second follow any hand.
        sample_secs: f64 = 0.08, "s", "ours";
        /// What is opened moves by at least this, and by `least_trembles`.
        least_move_m: f64 = 0.06, "m", "ours";
        /// What is opened moves by at least so many times what hands tremble.
        least_trembles: f64 = 3.0, "-", "ours";
        /// Of the farthest that a hold went, its end is at least this far: there and back are two interactions.
        one_way_share: f64 = 0.8, "share", "ours";
        /// Frames at this distance in time are looked at for how things stand.
        view_secs: f64 = 0.4, "s", "ours";
        /// Frames that are looked at for how things stand are no farther in time from their moment.
        views_within_secs: f64 = 6.0, "s", "ours";
        /// Views that are asked before and after a moment.
        views: usize = 2, "views", "ours";
        /// What is this near in time is the moment itself.
        now_secs: f64 = 0.2, "s", "ours";
        /// A place that is nearer to the camera is not seen.
        nearest_m: f64 = 0.1, "m", "ours";
        /// A view counts only where no hand is nearer to the place than this.
        hands_away_m: f64 = 0.35, "m", "ours";
        /// A hold needs this much evidence as if all samples were independent: odds of fifty to one.
        held_nats: f64 = 4.0, "nats", "ours";
        /// A hold that is so far below before its path is asked stays below: most of them, and the path is what takes time.
        hopeless_nats: f64 = 5.0, "nats", "ours";
        /// An interaction needs more than this, where samples within the time that errors of a hand last count as one, and with what
        /// depth shows before and after: likelier than not.
        enough_nats: f64 = 0.0, "nats", "ours";
        /// Ends at which a hand surely does not rest are not tried: so much against a rest.
        unrest_nats: f64 = 0.5, "nats", "ours";
        /// Fingertips are about this far from what they hold: estimated hands, estimated depth.
        held_at_m: f64 = 0.05, "m", "ours";
        /// The distance of fingertips from what they hold varies by so much.
        held_std_m: f64 = 0.04, "m", "ours";
        /// What a clip shows beside the hold itself: reaching and withdrawing.
        around_secs: f64 = 0.5, "s", "ours";
        /// Two interactions overlap where they share more than this of the shorter one.
        shared: f64 = 0.25, "share", "ours";
        /// Two hands that go one way, to this share of it, are at one part.
        together_share: f64 = 0.5, "share", "ours";
        /// Right before a hold and right after it a hand is elsewhere, by this.
        elsewhere_m: f64 = 0.08, "m", "ours";
        /// Within this time before a hold and after it a hand is elsewhere.
        elsewhere_within_secs: f64 = 0.8, "s", "ours";
        /// A hand pauses no longer than this in one go.
        pause_secs: f64 = 0.6, "s", "ours";
        /// In a pause a hand moves by no more than this.
        pause_m: f64 = 0.15, "m", "ours";
        /// Hands take hold of one handle within this at the open end; at the closed end, which both reach, too.
        same_m: f64 = 0.2, "m", "ours";
        /// What takes a move back goes the other way by more than this share of the longer one, as squares go.
        back_share: f64 = 0.25, "share", "ours";
        /// A change around the way is seen in so many openings: short ones, dark insides and doors seen edge-on are missed.
        changed_openings: f64 = 0.8, "share", "ours";
        /// A change around the way is seen in so many moves that open nothing: a person, a thing that was carried away.
        changed_others: f64 = 0.1, "share", "ours";
        /// Surfaces so near to the ends of the way are compared, beside the way's own length.
        changed_around_m: f64 = 0.35, "m", "ours";
        /// Surfaces that are compared for a change are sampled this finely.
        changed_step_m: f64 = 0.03, "m", "ours";
        /// Surfaces have changed where they are off by this, and by `changed_stds`.
        changed_m: f64 = 0.06, "m", "ours";
        /// Surfaces have changed where they are off by so many standard deviations of the frames' depth, and by `changed_m`.
        changed_stds: f64 = 4.0, "-", "ours";
        /// Share of what both frames see that has to have changed.
        changed_share: f64 = 0.05, "share", "ours";
        /// Fewer common samples tell nothing.
        changed_samples: usize = 60, "samples", "ours";
    }
}
