//! Trajectory and geometry to a joint.

use serde::{Deserialize, Serialize};

use super::{GroupingMethod, InferenceMethod, Row};

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
        /// (the log odds of `inference.same_part`: grips, faces, outlines, hinges and names, and that what is closed was open).
        grouping: GroupingMethod = GroupingMethod::Places, "-", "ours";
        /// Grouping "voxels": least intersection over union of two clips of one joint. The paper has no number; on development
        /// seeds of three tiers this finds a third of the pairs, with one wrong one for three right ones.
        merge_voxel_iou: f64 = 0.1, "share", "ours";
        /// A hinge's line lies this near to its face: deeper or nearer lines are the carcass, the floor, other furniture. Judgement.
        at_face_m: f64 = 0.08, "m", "ours";
        /// A path of smaller extent is the trembling of a hand that holds still. Judgement.
        least_extent_m: f64 = 0.03, "m", "ours";
        /// Draws of the RANSAC for the hand's direction under the paper's rules; with half of the samples off, no clean pair is
        /// drawn once in ten million.
        prismatic_draws: usize = 60, "-", "ours";
    } parts {
        /// How well what a hinge was found from places it.
        sources: AxisSources;
        /// Hinges where the face meets another side of the furniture.
        plane_edges: PlaneEdges;
        /// Hinges in the middle of the arc that a hand drew.
        arcs: Arcs;
        /// Joints of bare trajectories.
        bare: Bare;
        /// Whether clips show one part.
        same_part: SamePart;
        /// Clips of one part to one joint.
        scene: SceneRules;
        /// Which clip saw a part closed best.
        closed: ClosedFronts;
        /// Hinge and openings from the depth of all clips' open states.
        states: OpenStateRules;
    }
}

block! {
    /// How well what a hinge was found from places it across its axis: standard deviations (ours). All are judgements.
    AxisSources, "inference.sources", {
        /// Of lines, and of edges where the face meets another side: a hinge is set back from the edge that one sees. What a line's own
        /// fit adds is its own.
        line_std_m: f64 = 0.02, "m", "ours";
        /// Of edges of the part that was seen to move: next to a hinge a door hardly moves, so the outline ends a few centimetres short
        /// of it.
        part_edge_std_m: f64 = 0.06, "m", "ours";
        /// Of edges of the visible face, which may belong to the whole piece of furniture.
        face_edge_std_m: f64 = 0.08, "m", "ours";
        /// Of fronts of a usual size, whose edge nobody saw: half of the way between two usual sizes.
        assumed_std_m: f64 = 0.08, "m", "ours";
        /// Of the arc that the hand drew, and of whatever else: the fit itself tells more.
        other_std_m: f64 = 0.2, "m", "ours";
    }
}

block! {
    /// Where other sides of the furniture meet its face: dense thin slabs of points behind it (ours). All are judgements.
    PlaneEdges, "inference.plane_edges", {
        /// Thickness of a slab.
        slab_m: f64 = 0.02, "m", "ours";
        /// Behind the front board and its noise, not as deep as the wall.
        behind_m: [f64; 2] = [0.05, 0.5], "m", "ours";
        /// A slab with less than one over this of all points is the inside's clutter.
        most_slabs: usize = 3, "-", "ours";
        /// Points left out at each end where a slab's length and depth are measured.
        rim_share: f64 = 0.05, "share", "ours";
        /// Fewer points are no side.
        least_points: usize = 100, "-", "ours";
        /// A side of the furniture is longer than this.
        least_length_m: f64 = 0.15, "m", "ours";
        /// A side of the furniture is deeper than this.
        least_depth_m: f64 = 0.1, "m", "ours";
    }
}

block! {
    /// How far the centre of an arc may lie from where a hinge can be: a short noisy arc has its centre anywhere along its bisector
    /// (ours). Judgements.
    Arcs, "inference.arcs", {
        /// How far an arc's centre may lie off the plane of the face: a standard deviation.
        off_plane_std_m: f64 = 0.05, "m", "ours";
        /// How far an arc's centre may lie beyond the end of the furniture: a standard deviation.
        beyond_std_m: f64 = 0.08, "m", "ours";
    }
}

block! {
    /// A joint from points that moved with a part, and its orientations (ours).
    Bare, "inference.bare", {
        /// Fewer positions tell no joint.
        least_positions: usize = 5, "samples", "ours";
        /// Fewer orientations tell no turn.
        least_orientations: usize = 10, "samples", "ours";
        /// A part that turns by more than this has a hinge, whatever its path looks like: markers are read to a few degrees.
        turned_rad: f64 = 0.26, "rad", "ours";
        /// A part that went farther than this without turning slides.
        slid_m: f64 = 0.1, "m", "ours";
        /// A type from whose path the points are further away does not explain them: as `validation.pass_rms_m`.
        explains_m: f64 = 0.05, "m", "ours";
        /// One type is taken for sure where it is this much likelier than the other: as `validation.margin_nats`.
        sure_nats: f64 = 3.0, "nats", "ours";
        /// Rails and hinges have play: no mechanism is straighter or rounder than this. Judgement.
        play_m: f64 = 1e-3, "m", "ours";
        /// Independent samples that one motion is worth, at most: as `reasoning.effective_samples`.
        effective_samples: f64 = 8.0, "-", "ours";
        /// A path goes somewhere where it goes so many times as far along a line as beside it, as variances go. Judgement.
        along_line: f64 = 3.0, "-", "ours";
        /// A path goes somewhere where it goes so many times as far along its circle as beside it, which fits any cloud better than a
        /// line does. Judgement.
        along_circle: f64 = 10.0, "-", "ours";
        /// The direction in which a path's orientations turn contradicts the one in which the path bends from this angle on:
        /// markers are wrong by less. Judgement.
        contradicts_rad: f64 = 0.52, "rad", "ours";
        /// Points that leave their own circle so many times less than that about the orientations' axis know its plane better, as
        /// variances go. Judgement.
        own_circle: f64 = 4.0, "-", "ours";
        /// A single point that is so many steps away from the median of its neighbourhood is no motion. Judgement.
        jump_steps: f64 = 4.0, "-", "ours";
    }
}

block! {
    /// Whether two clips show one part, and which part a clip moves: noise, how parts lie beside each other, and how people use them
    /// (ours). Judgements.
    SamePart, "inference.same_part", {
        /// What all hands of a clip are off by together: 3 to 5 % of their distance from the camera.
        hand_bias_m: f64 = 0.04, "m", "ours";
        /// Hands and outlines that were seen badly.
        badly_seen: f64 = 0.2, "share", "ours";
        /// Faces and hinges of a sure type that are others after all.
        odd: f64 = 0.05, "share", "ours";
        /// So far off is what was seen badly, a standard deviation; so deep behind each other lie fronts that are not in one plane.
        elsewhere_m: f64 = 0.25, "m", "ours";
        /// Noise between the normals of two clips of one face.
        face_deg: f64 = 10.0, "deg", "ours";
        /// Noise between the depths of two clips of one face: two planes fitted to depth differ by a few centimetres.
        plane_m: f64 = 0.04, "m", "ours";
        /// What two outlines of one part lack to cover each other, and two of neighbours overlap, on average.
        outline_off: f64 = 0.2, "share", "ours";
        /// Noise between two hinges of one part.
        hinge_m: f64 = 0.12, "m", "ours";
        /// How far hinges of neighbours are apart, a standard deviation: doors side by side are hinged at their outer edges.
        hinges_apart_m: f64 = 0.6, "m", "ours";
        /// Fronts on a square metre of furniture: 30 by 40 cm each.
        parts_per_m2: f64 = 8.0, "1/m^2", "ours";
        /// Parts in reach of a person who works in a room.
        parts: f64 = 20.0, "-", "ours";
        /// Of parts beside each other, so many lie in one plane.
        one_plane: f64 = 0.8, "share", "ours";
        /// Of parts beside each other, so many open alike.
        alike: f64 = 0.6, "share", "ours";
        /// Pairs of clips with one name: of those of one part, and of those of two parts that open alike.
        one_name: [f64; 2] = [0.8, 0.6], "share", "ours";
        /// Openings that are in no clip: a part was seen to be closed twice.
        unseen_openings: f64 = 0.05, "share", "ours";
        /// Closings that are in no clip: people close in passing, and seldom say so.
        unseen_closings: f64 = 0.35, "share", "ours";
        /// Of parts that stand open and of which nothing is seen, so many do so still at the next motion of any part.
        stays_open: f64 = 0.97, "share", "ours";
        /// Of closings that follow an opening, so many are of the same part, whatever else stands open.
        closed_at_once: f64 = 0.25, "share", "ours";
        /// For a part that was used before, against one beside it that was not.
        used_again_nats: f64 = 0.8, "nats", "ours";
        /// A clip joins a part that is its own with this probability: a wrong part spoils two joints, a missed one leaves each clip its
        /// own answer.
        joins: f64 = 0.8, "share", "ours";
        /// A clip without a hand is told of a part that it moves with this probability: nothing else speaks for it.
        told_of: f64 = 0.8, "share", "ours";
        /// Closed grips of one part are no farther apart: a door's width.
        near_m: f64 = 0.8, "m", "ours";
        /// So many clips of a part, those that saw it best, are asked whether another one shows it.
        asked: usize = 6, "-", "ours";
    }
}

block! {
    /// Clips of one part to one joint of the scene (ours). Judgements.
    SceneRules, "inference.scene", {
        /// A joint's hinge tells two parts apart where its type is this sure.
        sure: f64 = 0.7, "share", "ours";
        /// So many clips of a part, those that saw it closed best, offer their candidates. All clips judge them, so that the work
        /// grows with the number of clips; more would offer the same again.
        offering: usize = 6, "-", "ours";
        /// A way in which a part could move is kept from this share on: no evidence of a few nats brings less back.
        kept_share: f64 = 0.01, "share", "ours";
        /// Ways in which a part could move that are kept at most.
        kept: usize = 5, "-", "ours";
        /// Fronts of a part that are tried beside the first, where hands do not bear it out.
        other_fronts: usize = 3, "-", "ours";
        /// Less likely joints seldom become the answer in a second look, and all of them find their place under the others'
        /// outlines.
        outlined_share: f64 = 0.05, "share", "ours";
        /// So often hinge and openings, then the outline with them, are fitted: more than the leaf that was known at first shows where
        /// the hinge is. A third round changes hardly a hinge.
        rounds: usize = 2, "-", "ours";
        /// Two clips' joints of one part agree, and are averaged, where their axes differ by less than this.
        agree_deg: f64 = 10.0, "deg", "ours";
        /// The same of hinges: across their axis they are no farther apart.
        agree_m: f64 = 0.12, "m", "ours";
        /// Without depth: what a clip believes in so much less than in its answer no other clip of its part brings back.
        believed_nats: f64 = 15.0, "nats", "ours";
    }
}

block! {
    /// How well a clip saw the closed part, to compare clips of one part (ours). Judgements.
    ClosedFronts, "inference.closed", {
        /// What parts open, standard deviation: so far before its front a hand of another clip may have been lost.
        travel_m: f64 = 0.3, "m", "ours";
        /// Hands that seemed to be seen to take hold or let go and were lost: flags of contacts are wrong, too.
        wrong_flags: f64 = 0.2, "share", "ours";
        /// Hands of other parts, wrong depth: anywhere within a metre.
        odd: f64 = 0.02, "share", "ours";
        /// A clip that saw the part move counts so many times as much.
        moved: f64 = 2.0, "-", "ours";
        /// Fronts of two clips of one part are one where their normals differ by less than this.
        one_front_deg: f64 = 25.0, "deg", "ours";
        /// Fronts of two clips of one part are one where neither is deeper than this: two planes fitted to depth differ by a few
        /// centimetres.
        one_front_m: f64 = 0.08, "m", "ours";
        /// Under the paper's rules, which ask no other clip's hand, a thin front may do: added to a face's support.
        thin_support: f64 = 0.2, "share", "ours";
    }
}

block! {
    /// Where a hinge is and how far each clip went, from the depth of all its open states (ours). Judgements.
    OpenStateRules, "inference.states", {
        /// Error of a place that no number of views makes smaller: depth is off alike wherever the same surface is seen from about the
        /// same distance.
        spot_std_m: f64 = 0.015, "m", "ours";
        /// Standard deviations that the line at a part's side and depth may be apart.
        agree_stds: f64 = 2.5, "-", "ours";
        /// Two clips are at odds beyond so many standard deviations of the fit, which are too small (`inference.shared_errors`): of the
        /// true ones about two.
        at_odds_stds: f64 = 4.0, "-", "ours";
        /// Along its front a leaf's opening is told by the place that it left, to so many cells of `fitting.cell_m`.
        vacated_cells: f64 = 2.0, "-", "ours";
    }
}
