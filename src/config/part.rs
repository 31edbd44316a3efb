//! What depth says of a part that moves.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// What depth says of a part that moves (ours).
    Part, "part", {
        /// Depth this many standard deviations off a surface is another surface. How noisy depth is, each recording tells by
        /// itself, from surfaces that several frames see.
        depth_stds: f64 = 2.5, "-", "ours";
        /// Noise of depth at the camera, where a recording shows too little twice to tell its own. Measured: on rendered recordings
        /// with the errors of estimated depth 5 to 7 mm.
        assumed_floor_m: f64 = 0.005, "m", "ours";
        /// So much more noise of depth for every metre of distance, there. Measured: 3 to 8 mm a metre.
        assumed_per_m: f64 = 0.008, "m/m", "ours";
        /// Standard deviation of where a front is beside its depth: planes, lines and hinges are found to this. Judgement: a quarter of a
        /// voxel.
        surface_m: f64 = 0.0125, "m", "ours";
        /// Standard deviation of a front's points about its plane: frames, bevels, what hangs askew. Judgement.
        flat_m: f64 = 0.005, "m", "ours";
        /// Standard deviations behind a place at which what is seen is as likely another surface: cells of outlines. Judgement.
        there_stds: f64 = 1.5, "-", "ours";
        /// Hands hold parts no nearer to their hinge than this, where a way of the hand is made an angle. Judgement.
        least_lever_m: f64 = 0.1, "m", "ours";
        /// Log odds beyond the errors of depth, outline and hands that views and clips share: those are worth a few. Judgement.
        by_far_nats: f64 = 6.0, "nats", "ours";
        /// What the smallest front has about its grip, to each side. Judgement.
        smallest_half_m: f64 = 0.12, "m", "ours";
        /// Less of a front was seen to move by chance: the smallest drawer has 15 x 15 cm. Judgement.
        least_moved_m2: f64 = 0.02, "m^2", "ours";
    } parts {
        /// The depth of one pixel.
        pixel: PixelOdds;
        /// Views of the open state.
        views: OpenViews;
        /// What every ray of an open view meets.
        rays: RayOdds;
        /// What the open views show of a part's points.
        points: PointOdds;
        /// The two readings together.
        likelihood: JointOdds;
        /// A leaf at an opening.
        leaf: LeafRules;
        /// Where the part stands in each view, and its hinge.
        openings: OpeningFit;
        /// The part's outline without its joint.
        outline: OutlineVotes;
        /// The part's outline with its joint.
        front: FrontFit;
    }
}

block! {
    /// What the depth of one pixel tells of a place (ours). Judgements.
    PixelOdds, "part.pixel", {
        /// Pixels in which something before what is expected hides it: arms, hands, other doors.
        before: f64 = 0.25, "share", "ours";
        /// Pixels that go on behind where a surface is expected.
        behind: f64 = 0.15, "share", "ours";
        /// Pixels that meet a surface where the view is expected to go on.
        blocked: f64 = 0.1, "share", "ours";
        /// Over this far behind a surface a depth may lie anywhere: a kitchen's width.
        room_m: f64 = 4.0, "m", "ours";
        /// What furniture is deep: beyond it a depth is half as likely.
        inside_m: f64 = 1.0, "m", "ours";
        /// What is seen of a tray's inside behind the closed front.
        tray_m: f64 = 0.3, "m", "ours";
    }
}

block! {
    /// Views in which a part stands open (ours). Judgements.
    OpenViews, "part.views", {
        /// Views in which the hand holds the part.
        held: usize = 6, "frames", "ours";
        /// The hand holds it far from closed where it went more than this share of its farthest.
        far_share: f64 = 0.5, "share", "ours";
        /// Views of each sort in which the hand does not hold the part.
        free: usize = 3, "frames", "ours";
        /// Views in which the hand does not hold the part are taken of so many frames after it let go (or the narration ended).
        free_within: usize = 12, "frames", "ours";
        /// Contact flags are wrong now and then: after the hand let go the part's place is as unsure as this share of a grip that was
        /// lost.
        free_share: f64 = 0.5, "share", "ours";
        /// A surface nearer to the eye than this is none.
        nearest_m: f64 = 0.15, "m", "ours";
        /// A leaf seen at less than this slant (cosine) shows its edge.
        edge_on_cos: f64 = 0.2, "-", "ours";
    }
}

block! {
    /// What a joint says that every ray of an open view meets (ours). Judgements.
    RayOdds, "part.rays", {
        /// Rays of a view that are looked at, at most.
        most: usize = 200, "-", "ours";
        /// Rays that pass the part further away than this meet nothing of it, however it opens: beside its own size.
        reach_m: f64 = 0.6, "m", "ours";
        /// Half of what a part without an outline may measure across.
        unknown_half_m: f64 = 0.3, "m", "ours";
        /// Neighbouring rays and following views share their errors: all rays on a clip's part count as this many.
        independent: f64 = 3.0, "-", "ours";
        /// Probability that the part is where its outline says: an outline is seldom exact, and not all of a part is seen to move.
        on_part: f64 = 0.9, "share", "ours";
        /// Of a front's extent so much is front.
        filled: f64 = 0.95, "share", "ours";
        /// An outline is a few cells off: from inside to outside over this.
        rim_m: f64 = 0.12, "m", "ours";
        /// A part without an outline reaches this far from its handle, in the mean of all directions of all sorts of fronts.
        mean_reach_m: f64 = 0.12, "m", "ours";
        /// From this cosine with the front's normal on a slide comes out of it, with a tray behind (26 degrees).
        tray_cos: f64 = 0.9, "-", "ours";
    }
}

block! {
    /// What the open views show of a part's points (ours). Judgements.
    PointOdds, "part.points", {
        /// Points of a part are a grid of so many to each side.
        grid: usize = 9, "-", "ours";
        /// A share of fewer sights is noise: of seven tenths of the points in one view.
        least_sights: f64 = 0.7, "sights per point", "ours";
        /// So many sights tell all that points can tell.
        enough_sights: f64 = 1.4, "sights per point", "ours";
        /// Of the points that a right joint moves so many are seen in their place.
        right: f64 = 0.8, "share", "ours";
        /// Of a wrong one's, by chance.
        wrong: f64 = 0.3, "share", "ours";
        /// Neighbouring points share their fate: all of them count as this many.
        independent: f64 = 8.0, "-", "ours";
    }
}

block! {
    /// Rays and points together, over what the hand's opening may be off (ours). Judgements where nothing else is said.
    JointOdds, "part.likelihood", {
        /// What points count in the pool: of (1, 0), (0.75, 0.5) and (0.5, 1) the pair that explained the development seeds of four
        /// tiers best.
        points_weight: f64 = 0.75, "weight", "ours";
        /// What rays count in it.
        rays_weight: f64 = 0.5, "weight", "ours";
        /// What rays say before it is pooled, at most: where an outline is wrong all of its rays are wrong together.
        rays_most_nats: f64 = 10.0, "nats", "ours";
        /// Offsets of the hand's opening go so many standard deviations to each side.
        reach_stds: f64 = 2.0, "-", "ours";
        /// Between two offsets, at least: what the depth's tolerance bridges. They are half a standard deviation apart where that is
        /// more: finer ones cost twice as much and found no more joints.
        step_m: f64 = 0.03, "m", "ours";
        /// Hinges nearer to the hand are no candidates: as `inference.min_radius_m`.
        least_lever_m: f64 = 0.05, "m", "ours";
        /// Where points choose an offset the whole share is worth this: what it is in `part.points`, rounded.
        whole_share_nats: f64 = 18.0, "nats", "ours";
        /// Joints whose axes differ by less than this, a tenth of what depth tells apart, and whose hinges by less than `same_m`, are asked
        /// about once.
        same_rad: f64 = 0.005, "rad", "ours";
        /// Joints whose hinges differ by less than this, and whose axes by less than `same_rad`, are asked about once.
        same_m: f64 = 0.002, "m", "ours";
    }
}

block! {
    /// A leaf at an opening, compared with the depth of a view (ours). Judgements.
    LeafRules, "part.leaf", {
        /// A surface is worth so few points: the error of depth bends over a few decimetres.
        independent: f64 = 30.0, "-", "ours";
        /// Points of the leaf that are compared, each way.
        points: usize = 14, "-", "ours";
        /// Left out at each side: there an outline is off by a cell.
        rim_share: f64 = 0.06, "share", "ours";
        /// Points of the leaf that have to be seen: a person hides half of a leaf now and then, and what shows in less of it may be
        /// anything.
        least_seen: f64 = 0.3, "share", "ours";
        /// Beside the leaf, what is further off the front is another surface.
        same_m: f64 = 0.1, "m", "ours";
        /// Fewer points beside the leaf tell no error of the view.
        least_beside: usize = 20, "-", "ours";
    }
}

block! {
    /// Where the part stands in each view, and with that where its hinge is (ours). Judgements.
    OpeningFit, "part.openings", {
        /// Fewer points of the leaf in all views together are noise.
        least_points: usize = 100, "-", "ours";
        /// Of a leaf of which a smaller share is in its place nothing is known.
        least_in_place: f64 = 0.1, "share", "ours";
        /// Of a leaf with fewer points in its place nothing is known.
        least_in_place_points: f64 = 4.0, "-", "ours";
        /// Degrees of freedom of the hand's error: few, as some hands are lost before a part is closed.
        tail: f64 = 2.0, "-", "ours";
        /// While the opening is unsure what is seen counts up to so many times as far from the leaf as it does in the end.
        loose: f64 = 2.7, "-", "ours";
        /// The distance to which what is seen counts shrinks by this factor from step to step.
        tightens: f64 = 0.75, "share", "ours";
        /// Between two offsets of a clip's openings, at the grip: the depth's tolerance bridges it.
        offset_step_m: f64 = 0.02, "m", "ours";
        /// Standard deviations to each side in which an offset of openings is looked for: of a hand that holds the part.
        held_reach_stds: f64 = 3.0, "-", "ours";
        /// Standard deviations to each side in which an offset of openings is looked for: of a hand that was lost, or seen to let go by a
        /// flag that erred. It may have been at the start of its way.
        lost_reach_stds: f64 = 6.0, "-", "ours";
        /// Between two openings of a part that stands, at the outermost point of the leaf.
        step_m: f64 = 0.01, "m", "ours";
        /// No part opens further: half a turn, and the longest pull-out.
        widest: [f64; 2] = [std::f64::consts::PI, 1.0], "rad and m", "ours";
        /// Depth told an opening where the standard deviation is below this share of the hand's: half the variance.
        informed_share: f64 = 0.7, "share", "ours";
    }
}

block! {
    /// Which part of the front face moved, without knowing the joint (ours). Judgements.
    OutlineVotes, "part.outline", {
        /// Cells of a face go so far from the grip: the tallest doors are two metres and held at hip height.
        reach_m: f64 = 1.6, "m", "ours";
        /// Cells of a face go this far beyond its extent, which comes from the confident region: its rim is a voxel coarse.
        margin_m: f64 = 0.1, "m", "ours";
        /// Metric depth bends and scales by a few per cent: far from the grip a face's points leave its plane by this much.
        face_m: f64 = 0.06, "m", "ours";
        /// A cell is seen through where depth lies further behind it, beyond its noise: clearly more than a door's thickness.
        through_m: f64 = 0.04, "m", "ours";
        /// How far votes put a side from where it is: a standard deviation.
        side_std_m: f64 = 0.03, "m", "ours";
        /// What a line next to a side must be worth to be believed.
        line_worth: f64 = 0.25, "share", "ours";
        /// Nearer sides on lines are no rectangle.
        least_side_m: f64 = 0.05, "m", "ours";
        /// A line stops a part where it covers more than this share of its side.
        stop_share: f64 = 0.4, "share", "ours";
        /// The moved piece nearest to the grip is the part if it comes this near.
        piece_m: f64 = 0.25, "m", "ours";
        /// Fewer seen cells in a line across a slide are noise.
        vacated_cells: usize = 4, "-", "ours";
        /// Lines in a row that noise may make stay.
        vacated_still: usize = 2, "-", "ours";
        /// The strip that a leaf left begins at its end, near which its grip is.
        vacated_m: f64 = 0.15, "m", "ours";
    }
}

block! {
    /// The rectangle on its face that explains best what is seen of a part closed and open (ours). Judgements where nothing else is
    /// said.
    FrontFit, "part.front", {
        /// Fronts narrower than this are none.
        least_m: f64 = 0.08, "m", "ours";
        /// Cells are no smaller: sides come from lines.
        least_cell_m: f64 = 0.01, "m", "ours";
        /// Errors of depth share their fate over so much: a spot of that size that moved in all of many views is worth a nat.
        spot_m: f64 = 0.07, "m", "ours";
        /// A side all along a line, or all along an end of the surface, against one in the middle of it.
        on_line_nats: f64 = 3.0, "nats", "ours";
        /// Where no surface was seen while the part was closed there is hardly a front, whatever is seen there later: of what a cell
        /// that stayed counts.
        bare: f64 = 0.3, "share", "ours";
        /// Standard deviation of how far outside its part the grip may lie: 4 cm was too little at large errors of hands (development
        /// seeds).
        grip_std_m: f64 = 0.08, "m", "ours";
        /// Standard deviation of a hinge that was fitted to the depth of the open states.
        hinge_std_m: f64 = 0.03, "m", "ours";
        /// A hinge that is wrong costs no more than this.
        hinge_most_nats: f64 = 4.5, "nats", "ours";
        /// A hinge runs along a side from this cosine on.
        along_cos: f64 = 0.9, "-", "ours";
        /// Sides that were put on a line are that near to it.
        on_line_m: f64 = 0.005, "m", "ours";
        /// A line tells a side where it covers this share of it.
        lined_share: f64 = 0.5, "share", "ours";
        /// A cell moved at all from this of its weight on: where a part is half hidden its lines and its grip tell the rest, and they do
        /// so better than what was known before.
        moved: f64 = 0.02, "share", "ours";
        /// Surface points are samples of depth images: gaps of this size are none of the surface's.
        sample_gap_m: f64 = 0.02, "m", "ours";
        /// A rim is frayed by a cell or two.
        frayed_cells: usize = 1, "-", "ours";
        /// Gaps between fronts are narrower than this.
        gap_m: f64 = 0.05, "m", "ours";
    }
}
