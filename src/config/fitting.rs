//! Boxes, limits, the room.

use serde::{Deserialize, Serialize};

use super::Row;

block! {
    /// Boxes, handles, carcass, limits (ours).
    Fitting, "fitting", {
        /// Cell of the grid on the front face in which the moving part is found.
        cell_m: f64 = 0.02, "m", "ours";
        /// Build the rest of the room (walls, floor, worktops, furniture that nobody opened) as boxes that do not move.
        room: bool = true, "-", "ours";
        /// Edge of the cells in which the room is gathered.
        room_voxel_m: f64 = 0.05, "m", "ours";
        /// A cell of the room has been seen in at least this many views.
        room_min_views: usize = 3, "views", "ours";
        /// A cell of the room is empty where at least so many views saw through it, and no third of all saw a surface.
        room_free_views: usize = 2, "views", "ours";
        /// The room is built as far as this from the furniture that opens.
        room_reach_m: f64 = 6.0, "m", "ours";
        /// A box of the room has at least this much surface that no other one has, a square of 10 cm: less is clutter.
        room_box_m2: f64 = 0.01, "m^2", "ours";
        /// A box of the room is no thicker than this where nobody saw its inside: no furniture is deeper.
        room_solid_m: f64 = 1.0, "m", "ours";
        /// A box of the room is at least so thick: simulators lose contacts with thinner ones.
        room_box_thin_m: f64 = 0.01, "m", "ours";
        /// A box of the room is at least so wide.
        room_box_side_m: f64 = 0.04, "m", "ours";
        /// Boxes of the room at the most, beside floor and walls; the largest stay.
        room_boxes: usize = 40, "boxes", "ours";
        /// A direction nearer than this to upright or level is meant to be so. Judgement.
        level_deg: f64 = 5.0, "deg", "ours";
        /// A leaf that hangs turns about a line this far behind its middle, so that its weight shuts it. Its upper front corner then
        /// rises by half a board: the piece ends that much lower than its hinge was seen.
        hung_m: f64 = 0.002, "m", "ours";
        /// A front is at least so wide and so high. Judgement.
        least_front_m: f64 = 0.1, "m", "ours";
        /// The handle is on the part, which reaches at least so far around the grip.
        around_grip_m: f64 = 0.02, "m", "ours";
        /// Of a face that may be a whole row of furniture a part has no more than this to each side of the grip, and above and below.
        /// Judgement.
        most_half_m: [f64; 2] = [0.3, 0.35], "m", "ours";
        /// A handle's bar takes no more than this of its front, from its middle.
        bar_most_share: f64 = 0.4, "share", "ours";
        /// Boards of which half a side is shorter are left out.
        least_board_half_m: f64 = 1e-3, "m", "ours";
        /// Where furniture has no space, its carcass is made shallower in such steps.
        depth_step_m: f64 = 0.05, "m", "ours";
        /// Where furniture has no space, its carcass is made shallower down to this.
        least_depth_m: f64 = 0.1, "m", "ours";
        /// Where a shallower carcass has no space either, its front is made smaller by these factors.
        front_shares: [f64; 3] = [1.0, 0.85, 0.7], "-", "ours";
        /// The ends of an observed motion are known to about this: of a hinge in rad, of a slide in m. Judgement.
        observed_noise: [f64; 2] = [0.09, 0.03], "rad or m", "ours";
        /// Ajar: past the catch. Judgement.
        ajar_rad: f64 = 0.09, "rad", "ours";
        /// A lever of gravity that friction does not hold. Judgement.
        gravity_lever_m: f64 = 0.005, "m", "ours";
    } parts {
        /// Parts that a hand let go of while they moved.
        coast: Coast;
        /// The room as cells.
        gathered: GatheredRoom;
        /// The room as boxes.
        boxes: RoomBoxes;
        /// Few boxes for many cells.
        cover: Cover;
        /// Furniture that stands turned against the room.
        turned: Turned;
    }
}

block! {
    /// What a part shows of damping and friction that a hand let go of while it moved (ours). Judgements.
    Coast, "fitting.coast", {
        /// Speed at release is the slope over this time.
        window_secs: f64 = 0.3, "s", "ours";
        /// A hand is known to a few centimetres: over the window that is a speed of up to this, at the handle.
        least_speed_m_per_s: f64 = 0.3, "m/s", "ours";
        /// Hands of two clips differ by a few centimetres: a coast must be clearly longer, at the handle.
        least_coast_m: f64 = 0.15, "m", "ours";
        /// A part this near to its limit may have run into it, at the handle.
        stop_m: f64 = 0.05, "m", "ours";
        /// Further from the prior than this factor is no furniture but something that was not seen: a hand, a knock, a third clip.
        plausible: f64 = 5.0, "-", "ours";
        /// Level or upright to this: a slide that leans by more runs by itself.
        level_rad: f64 = 0.05, "rad", "ours";
        /// Left open is what hangs at least at this share of where the hand let go of it.
        stayed_share: f64 = 0.5, "share", "ours";
    }
}

block! {
    /// The room as cells in which views saw a surface, or saw through (ours). Judgements.
    GatheredRoom, "fitting.gathered", {
        /// Every so many-th sample of a view counts as surface: a cell at three metres still holds more than one of every other.
        stride: usize = 2, "-", "ours";
        /// Depth counts up to this: beyond, a metre-scale estimate is worth less than a voxel (as `localization.seen_m`).
        near_m: f64 = 3.0, "m", "ours";
        /// Nearer than this no camera of a head sees anything but the person.
        blind_m: f64 = 0.1, "m", "ours";
        /// A surface is this share of a cell's edge behind the middle of a cell that is seen through: from half an edge on it is
        /// outside.
        behind_share: f64 = 0.7, "share", "ours";
        /// A surface is this much further behind a cell that is seen through for each metre that it is away: poses and depth err with
        /// distance.
        behind_per_m: f64 = 0.015, "-", "ours";
    }
}

block! {
    /// The room as few large boxes: floor, walls, the rest (ours). Judgements.
    RoomBoxes, "fitting.boxes", {
        /// Free space kept around a part on its way.
        margin_m: f64 = 0.02, "m", "ours";
        /// Thickness of floor and walls, and of other surfaces behind which nothing was seen.
        wall_m: f64 = 0.05, "m", "ours";
        /// Surface is a slab's up to this share of a cell beside it.
        cell_share: f64 = 0.6, "share", "ours";
        /// Fewer connected cells than this are specks of noise.
        speck_cells: usize = 8, "-", "ours";
        /// Half the thickness of a flat surface.
        sheet_half_m: f64 = 0.01, "m", "ours";
        /// Smaller surfaces stay as their cells have them: a front of 40 x 50 cm.
        plane_m2: f64 = 0.2, "m^2", "ours";
        /// More planes along one axis are clutter.
        planes: usize = 16, "-", "ours";
        /// A box ends right before furniture, or the way of a part, that takes this share of the layer beside it.
        taken_share: f64 = 0.5, "share", "ours";
        /// A box ends before furniture or a way where less than this share of the layer beside it was seen through.
        free_share: f64 = 0.1, "share", "ours";
        /// A smaller level surface is no floor but a mat or a shelf.
        floor_m2: f64 = 0.5, "m^2", "ours";
        /// Furniture and floor are known to this.
        floor_noise_m: f64 = 0.1, "m", "ours";
        /// A smaller upright surface is no wall.
        wall_m2: f64 = 1.0, "m^2", "ours";
        /// A lower one is a row of base cupboards.
        wall_height_m: f64 = 1.2, "m", "ours";
        /// Share of all cells that may lie behind a wall: noise.
        behind_share: f64 = 0.02, "share", "ours";
        /// A surface of which more was seen through is a passage.
        through_share: f64 = 0.05, "share", "ours";
        /// Walls that end so near to each other meet: corners are dark, and furniture stands in them.
        met_m: f64 = 0.15, "m", "ours";
    }
}

block! {
    /// What a block of cells is worth; a cell with a surface that no other block has is worth 1000 (ours). Judgements.
    Cover, "fitting.cover", {
        /// A cell whose surface another block has: enough for a front to reach back below a worktop.
        covered: i32 = 100, "worth", "ours";
        /// What a cell that was seen through costs. Filled, it stands in a robot's way for good; what is missing may be worth a box of its
        /// own.
        seen_through: i32 = 3000, "worth", "ours";
        /// What a cell that nobody saw costs: of two blocks with the same surface the smaller one is better.
        unknown: i32 = 1, "worth", "ours";
        /// Cells between two seeds: on every front of 25 cm there is one.
        seed_cells: i32 = 5, "-", "ours";
        /// A layer is a face where surface was seen in this share of it.
        face_share: f64 = 0.25, "share", "ours";
    }
}

block! {
    /// Furniture that stands turned against the room (ours). Judgements.
    Turned, "fitting.turned", {
        /// Nearer than this to an axis of the room it is noise.
        least_deg: f64 = 8.0, "deg", "ours";
        /// Surfaces of one heading differ by less than this.
        spread_deg: f64 = 6.0, "deg", "ours";
        /// Less upright surface than this is no furniture.
        least_m2: f64 = 0.4, "m^2", "ours";
        /// Headings of one room, beside its own.
        headings: usize = 3, "-", "ours";
        /// Cells around a cell that must hold a surface, for it to have a heading: half of a face.
        least_cells: usize = 12, "-", "ours";
        /// Flatter than this is flat: thickness against the shorter extent, as variances.
        flat: f64 = 0.2, "-", "ours";
        /// Sine of the lean of what is upright, up to 20 degrees.
        lean_sin: f64 = 0.35, "-", "ours";
        /// Points left out at each end of its bounds.
        rim_share: f64 = 0.02, "share", "ours";
    }
}
