//! Lines, directions, faces, the scale of depth.

use serde::{Deserialize, Serialize};

use super::{LineMethod, ManhattanMethod, Row};

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
        /// Without depth: frames in which nobody is at work whose lines are looked for around a grip.
        sighting_frames: usize = 16, "frames", "ours";
    } parts {
        /// The built-in detector of segments.
        detector: EdgeDetector;
        /// The face of the touched furniture.
        face: FaceRules;
        /// Fronts that nobody saw.
        fronts: AssumedFronts;
        /// 2D segments and their depth.
        segments: SegmentRules;
        /// Segments of several views that are one line.
        tracks: Tracks;
        /// Lines along known directions, without depth.
        directed: Directed;
        /// The room's frame.
        frame: RoomFrame;
        /// The scale of each frame's depth.
        scales: DepthScales;
    }
}

block! {
    /// What the built-in detector of 2D segments takes for an edge (ours). Judgements.
    EdgeDetector, "geometry.detector", {
        /// Of an edge's profile the part above this share of its steepest place makes the region; the foot below it belongs to the
        /// edge too but blurs with its surroundings.
        foot_share: f64 = 0.2, "share", "ours";
        /// A gradient that no camera's quantisation makes.
        least_gradient: f64 = 3.0, "grey values/px", "ours";
        /// Gradients below so many standard deviations of the image's noise are not looked at.
        noise_stds: f64 = 4.0, "-", "ours";
    }
}

block! {
    /// The plane of a front, its axes and its extent (ours). Judgements where nothing else is said.
    FaceRules, "geometry.face", {
        /// Points this near to the grip vote for the plane.
        neighbourhood_m: f64 = 0.45, "m", "ours";
        /// So many points around the grip, evenly: enough for a plane, and the cost does not grow with the image.
        points: usize = 3000, "-", "ours";
        /// Fewer points tell no plane.
        least_points: usize = 30, "-", "ours";
        /// Where a handle's face would be: so far behind the grip, and before it.
        behind_grip_m: [f64; 2] = [0.12, 0.03], "m", "ours";
        /// Planes from the points themselves, each without those that the planes before it explained.
        rounds: u64 = 3, "-", "ours";
        /// Draws of the LO-RANSAC of each.
        draws: usize = 120, "-", "ours";
        /// A smaller share of the neighbourhood lies on a plane by chance; a face fills far more.
        least_support: f64 = 0.05, "share", "ours";
        /// Points left out at each end of the extent.
        rim_share: f64 = 0.01, "share", "ours";
        /// Edge of the cells in which surface counts as seen: that of the confident region's voxels.
        cell_m: f64 = 0.05, "m", "ours";
        /// A point or two may be noise.
        cell_points: usize = 3, "-", "ours";
        /// A front that leans by less is upright: furniture stands on its feet, and a drawer that runs downhill opens by itself.
        upright_deg: f64 = 15.0, "deg", "ours";
        /// A shorter way of the hand tells nothing about the face that it leaves.
        least_travel_m: f64 = 0.06, "m", "ours";
        /// Who stands within this cosine of the normal stands before the face (60 degrees).
        before_cos: f64 = 0.5, "-", "ours";
        /// Cosines of the normal with the vertical between which a face is neither upright nor level.
        aslant_cos: [f64; 2] = [0.15, 0.99], "-", "ours";
        /// Angles to the room's directions below which a face lies along them, and nearly does.
        walls_deg: [f64; 2] = [0.2, 8.0], "deg", "ours";
        /// Lines this near to a face's plane are its edges.
        edges_within_m: f64 = 0.05, "m", "ours";
        /// Edges of a face are ends of parts on it where they run along one of its axes from this cosine on.
        edges_along_cos: f64 = 0.98, "-", "ours";
        /// On a level face: lines are its edges where they are level to this sine.
        edges_level_sin: f64 = 0.2, "-", "ours";
        /// Spread of the directions of lines of one edge.
        edges_spread_rad: f64 = 0.05, "rad", "ours";
        /// The room's walls count as so much edge: a lid has two of half a metre that can be seen well, or none.
        walls_m: f64 = 1.0, "m", "ours";
    }
}

block! {
    /// Fronts of which only a hand, lines, sparse points, the room and the person tell (ours). All are judgements.
    AssumedFronts, "geometry.fronts", {
        /// A way of the hand that is shorter has no heading.
        least_way_m: f64 = 0.03, "m", "ours";
        /// Lines that are tried as a front's edge.
        most_lines: usize = 6, "lines", "ours";
        /// From this cosine with the vertical on a line is upright (11 degrees).
        upright_cos: f64 = 0.98, "-", "ours";
        /// Headings that differ by less are one.
        same_rad: f64 = 3.0 * std::f64::consts::PI / 180.0, "rad", "ours";
        /// A front stands along a wall that it is this near to.
        aligned_deg: f64 = 8.0, "deg", "ours";
        /// People stand before what they open: at a slant, but no farther behind its plane than by this sine (6 degrees).
        behind_cos: f64 = 0.1, "-", "ours";
        /// Who stands within this cosine of the normal stands before the front (60 degrees).
        before_cos: f64 = 0.5, "-", "ours";
        /// A hand lifts a lid where its way leads away from the person from this cosine on.
        lifted_cos: f64 = 0.3, "-", "ours";
    }
}

block! {
    /// 2D segments of a view, lifted with its depth (ours). Judgements.
    SegmentRules, "geometry.segments", {
        /// An edge between a hand and what is behind it lies so far beside the hand's mask.
        hand_margin_px: f64 = 3.0, "px", "ours";
        /// Where each side of a segment is sampled, from it, in an image 640 wide: beyond the smear of a depth edge.
        side_px: [f64; 3] = [2.5, 4.0, 5.5], "px", "ours";
        /// Noise of depth as a share of the distance, where a segment's ends are found.
        depth_std: f64 = 0.015, "share", "ours";
        /// Two sides whose depths differ by less are one surface.
        one_surface: f64 = 0.03, "share", "ours";
        /// Depth beyond one over this tells no end.
        least_inverse_depth: f64 = 0.02, "1/m", "ours";
        /// Points left out at each end of a line that was fitted to unprojected ones.
        rim_share: f64 = 0.05, "share", "ours";
    }
}

block! {
    /// Segments of several views that are one line, and the noise of what they are made from (ours). Judgements.
    Tracks, "geometry.tracks", {
        /// Standard deviation of a detected line in the image, ends included.
        detection_std_px: f64 = 1.0, "px", "ours";
        /// Standard deviation of a camera's place: what poses of head-worn cameras are good to.
        pose_std_m: f64 = 0.004, "m", "ours";
        /// Standard deviation of depth along the ray, as a share of the distance, once its scale is corrected.
        depth_std: f64 = 0.03, "share", "ours";
        /// A sight within this many standard deviations belongs to a line.
        tolerance: f64 = 3.0, "-", "ours";
        /// Two planes that differ by less than this sine have no usable line in common (2 degrees).
        least_sine: f64 = 0.035, "-", "ours";
        /// Shorter segments tell no more of a direction than one of this length.
        least_length_m: f64 = 0.03, "m", "ours";
        /// Shorter lines fitted to unprojected points tell no more of a direction than one of this lever.
        least_lever_m: f64 = 0.02, "m", "ours";
        /// Grouped, fitted and assigned in so many rounds: of two edges a few centimetres apart the better seen one wins a group, and
        /// what it leaves makes a group of its own in the next round.
        rounds: usize = 3, "-", "ours";
        /// A line broken by a hand or a glare leaves a gap; a wider one is another edge.
        gap_m: f64 = 0.1, "m", "ours";
        /// A segment is a line's where its direction as depth has it is within this of the line's.
        assigned_turn_rad: f64 = 0.35, "rad", "ours";
        /// A segment is a line's where its plane is within this: twice what detection and poses are good to; a board's two edges are
        /// further apart.
        assigned_rad: f64 = 0.07, "rad", "ours";
        /// A segment is a line's where its depth is within two standard deviations and this.
        depth_slack_m: f64 = 0.03, "m", "ours";
        /// A segment is on a line's stretch up to this far beyond its ends.
        beyond_m: f64 = 0.05, "m", "ours";
        /// Lines whose directions differ by less are one, where they are within `one_m`.
        one_rad: f64 = 0.06, "rad", "ours";
        /// Lines this near to each other are one, where their directions are within `one_rad`.
        one_m: f64 = 0.012, "m", "ours";
    }
}

block! {
    /// Lines along known directions, from the planes of several views alone (ours). Judgements.
    Directed, "geometry.directed", {
        /// Lines are looked for within this of the place, across them and along them: as far as a hinge is from a grip.
        reach_m: f64 = 1.2, "m", "ours";
        /// Segments of a view that are tried for one direction, the longest first.
        most_of_a_view: usize = 60, "-", "ours";
        /// Lines of one direction at the most.
        most_lines: usize = 16, "lines", "ours";
        /// A segment may run along a direction where its plane is this near to it, beside what its ends are off.
        along_sin: f64 = 0.03, "-", "ours";
        /// Two views of a line that differ by less leave its place open (the sine of three degrees).
        least_sine: f64 = 0.05, "-", "ours";
        /// Stretches of one line in two views share at least this.
        shared_m: f64 = 0.05, "m", "ours";
        /// Edge of the cells in which crossings are counted: what poses and segments are good to at two metres.
        cell_m: f64 = 0.04, "m", "ours";
        /// A sight within so many standard deviations of a line shows it.
        tolerance: f64 = 2.5, "-", "ours";
        /// A line that is known no better across itself is none.
        worst_std_m: f64 = 0.06, "m", "ours";
        /// How well the directions themselves are known: gravity, and the walls that follow from it, to a degree.
        direction_std_deg: f64 = 1.0, "deg", "ours";
        /// Pieces of one edge in a view lie this near to each other: a board's two edges are farther apart.
        pieces_m: f64 = 0.004, "m", "ours";
    }
}

block! {
    /// The room's frame from surface normals (ours). Judgements.
    RoomFrame, "geometry.frame", {
        /// Surfaces whose normals have a smaller cosine with the vertical are upright (within 20 degrees).
        upright_sin: f64 = 0.35, "-", "ours";
        /// Fewer normals of upright surfaces tell no heading.
        least_normals: u32 = 50, "-", "ours";
        /// Headings are smoothed over so many degrees to each side: about the spread of noisy normals that remains in a mean.
        smoothed_deg: i64 = 4, "deg", "ours";
        /// Beyond this a normal belongs to another structure.
        cut_deg: f64 = 25.0, "deg", "ours";
        /// The noise of normals, which is measured, lies between these.
        noise_deg: [f64; 2] = [3.0, 15.0], "deg", "ours";
        /// Gravity weighs as much as this share of the normals: it is known to a degree, and some rooms show neither floor nor worktop.
        gravity_share: f64 = 0.02, "share", "ours";
        /// Normals follow from the depth so many pixels to each side.
        slope_px: usize = 4, "px", "ours";
        /// Where depth bends by more than this share of itself there is an edge.
        bend_share: f64 = 0.02, "share", "ours";
        /// Clustered: three orthogonal directions cost 0; a frame that sees one wall and its noise costs more than this.
        orthogonal_cost: f64 = 0.6, "-", "ours";
        /// Clustered: modes within this of orthogonal are the room's.
        orthogonal_deg: f64 = 15.0, "deg", "ours";
        /// Views that the frame is found from, at most: it is known to a fraction of a degree from far fewer.
        views: usize = 30, "views", "ours";
        /// From so many views with a file of normals on these are enough.
        views_alone: usize = 5, "views", "ours";
        /// The room's own upright axis stands for up where it is this near to the world's, which may be off by a degree.
        up_deg: f64 = 5.0, "deg", "ours";
        /// Without depth: cosines with up of the normals of segments' planes between which what runs level tells its direction. In a
        /// plane that is nearer to upright upright edges lie, in one that is nearer to level every level direction.
        level_cos: [f64; 2] = [0.15, 0.95], "-", "ours";
        /// Without depth: directions this near to an axis keep to the room's walls; of such that are spread evenly 11 % do.
        segments_rad: f64 = 5.0 * std::f64::consts::PI / 180.0, "rad", "ours";
        /// Without depth: directions that keep to the walls, for these to stand out.
        segments_share: f64 = 0.4, "share", "ours";
        /// Without depth: what the heading of a front is off by.
        fronts_rad: f64 = 15.0 * std::f64::consts::PI / 180.0, "rad", "ours";
        /// Without depth: fewer fronts agree by chance.
        fronts_clips: usize = 6, "-", "ours";
        /// Without depth: fronts that agree, for them to tell the room.
        fronts_share: f64 = 0.6, "share", "ours";
    }
}

block! {
    /// The scale of each frame's depth, from surfaces that several frames see (ours). Judgements where nothing else is said.
    DepthScales, "geometry.scales", {
        /// Surface samples of a frame that take part.
        samples: usize = 700, "-", "ours";
        /// Frames that each frame is compared with.
        partners: usize = 10, "frames", "ours";
        /// Of how many its partners are chosen: in a long recording every n-th frame is candidate enough.
        candidates: usize = 600, "frames", "ours";
        /// Samples that are asked whether another frame sees them, where partners are chosen.
        probes: usize = 60, "-", "ours";
        /// Of the distance between two frames no more counts: more hardly helps and sees other things.
        most_baseline_m: f64 = 0.5, "m", "ours";
        /// Nearer places are hands and hair.
        nearest_m: f64 = 0.2, "m", "ours";
        /// Normals follow from depth over the image's width over this, to each side: wide enough to average pixel noise, narrow enough
        /// for a drawer's front.
        normal_reach: usize = 40, "-", "ours";
        /// Surfaces seen at a smaller slant (cosine) have no usable normal.
        least_slant_cos: f64 = 0.25, "-", "ours";
        /// Noise of one depth sample across its surface: pixel noise, the bending of estimated depth and poses.
        sample_std_m: f64 = 0.02, "m", "ours";
        /// Samples of a pair share their errors: together they are worth this many.
        independent: f64 = 6.0, "-", "ours";
        /// Spread of the frames' factors about their common one.
        frame_std: f64 = 0.03, "share", "ours";
        /// Spread of the common one about 1.
        common_std: f64 = 0.15, "share", "ours";
        /// Factors outside of these are a broken export.
        factors: [f64; 2] = [0.5, 2.0], "-", "ours";
        /// Surfaces this near to each other are taken for one: wide at first, to bridge the error of the scale, then narrow, to tell
        /// surfaces apart.
        gates_m: [f64; 3] = [0.2, 0.1, 0.05], "m", "ours";
        /// Of the samples every so many-th takes part at each gate: while surfaces are brought together a few tell as much as all.
        strides: [usize; 3] = [4, 4, 1], "-", "ours";
        /// Beside the gate, how far apart along the surface two places may be.
        same_place_m: f64 = 0.05, "m", "ours";
        /// A comparison's weight falls beyond this share of the gate.
        gate_scale: f64 = 0.4, "share", "ours";
        /// A few coincidences of all samples of two frames are no common surface.
        least_links: usize = 12, "-", "ours";
        /// Change of the factors from one comparison to the next, root mean square, that is none: a tenth of what they can be told to.
        /// Single frames that see little of what others see drift on for long.
        settled: f64 = 5e-4, "share", "ours";
        /// Every so many-th place that two frames see tells the noise of depth.
        noise_every: usize = 4, "-", "ours";
        /// Fewer such places tell none.
        noise_places: usize = 600, "-", "ours";
        /// Places at like distances tell one standard deviation together: equal shares of all of them, so many.
        noise_bins: usize = 6, "-", "ours";
    }
}
