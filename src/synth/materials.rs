//! What the surfaces of the synthetic kitchens are made of: wood, brushed steel, stone, tiles and paint, as functions of the place
//! on a box. Nothing is stored and nothing comes from elsewhere.
//!
//! A material makes a box's flat colour lighter and darker about itself. No random number is drawn: noise is a hash of piece and
//! place, so that a surface looks the same in every frame and take, moves with its part, and leaves all that is drawn for depth, hands
//! and poses as it is. What is finer than a pixel fades.
//!
//! Grain of wood and steel is too faint and too soft to be found as a line where hinges are looked for: less than 3 grey values a
//! pixel, the least gradient of `geometry`'s detector, at any distance. Joints between tiles are lines, on walls and floors.

use std::f64::consts::TAU;

use super::fitted::{GLASS, STRIPE, TILE};
use super::kitchen::{ColoredBox, FLOOR, FRONTS, HANDLE, Kitchen, PLINTH, STEEL, STONE, WALL, rail};
use crate::math::Vector;

/// Those of [`FRONTS`] that are wood; the others are painted.
const WOODEN: [[u8; 3]; 2] = [FRONTS[0], FRONTS[4]];

/// From ring to ring of a tree, metres. Assumed: broad, as veneers show them.
const RING_M: f64 = 0.022;
/// By how much rings are lighter and darker than the mean, a share of it. Assumed, with the streaks less than 6 % from trough to
/// crest: fainter than a seam between two fronts.
const RING: f64 = 0.018;
/// The same of fine streaks along the grain.
const STREAK: f64 = 0.009;
const _: () = assert!(2.0 * (RING + STREAK) <= 0.06);
/// The same of a board's slow changes, which end nowhere and make no line.
const DRIFT: f64 = 0.03;
/// The same of whole boards, planks and tiles beside each other.
const PIECE: f64 = 0.025;
/// The same of strokes in brushed steel.
const STROKE: f64 = 0.014;
/// The same of clouds in paint.
const CLOUD: f64 = 0.012;
/// The same of grains in stone, which have no direction.
const SPECKLE: f64 = 0.16;
/// What grout is of its tiles' brightness. Assumed: grey between light tiles.
const GROUT: f64 = 0.7;
/// How much of a change of brightness red, green and blue have in wood: dark grain is redder.
const WARM: Color = [0.85, 1.0, 1.2];
/// Planks of a floor, metres: width, length. Six are a board of the fitted kitchens' floors.
const PLANK_M: [f64; 2] = [0.15, 1.2];
/// From the side of such a floor to its first board, metres: as thick as the wall above it.
const PLANKS_FROM_M: f64 = 0.05;
/// The panel of the fitted kitchens, whose joints are boxes.
const PANEL: TileGrid = TileGrid { size_m: [0.3, 0.26], joint_m: 0.0, heights_m: None };
/// On a bare wall, from the worktop to the wall cupboards.
const SPLASH: TileGrid = TileGrid { size_m: [0.26, 0.13], joint_m: 0.004, heights_m: Some([0.86, 1.38]) };
/// On a bare floor.
const SLABS: TileGrid = TileGrid { size_m: [0.5, 0.5], joint_m: 0.005, heights_m: None };
/// A side that is seen at a more grazing angle than this cosine does not fade further.
const LEAST_COSINE: f64 = 0.05;

/// Red, green and blue, each from 0 to 255.
type Color = [f64; 3];

/// Tiles in rows, from the corner of their box.
#[derive(Debug, Clone, Copy, PartialEq)]
struct TileGrid {
    /// Width and height of a tile with its joint, metres.
    size_m: [f64; 2],
    /// Width of a joint, metres; 0 where boxes are the joints.
    joint_m: f64,
    /// Low and high end over the box's foot, metres; paint elsewhere. `None`: all of it.
    heights_m: Option<[f64; 2]>,
}

/// What a box is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Finish {
    /// Its flat colour.
    Plain,
    Paint,
    Wood,
    Steel,
    Stone,
    Tiles(TileGrid),
    /// Boards along the box's x.
    Planks,
}

/// The surface of one box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coat {
    finish: Finish,
    /// Mean colour.
    color: Color,
    /// Half the edges of the box, metres.
    half: Vector,
    /// Its axes, the longest first: along the grain, across it, through the board.
    axes: [usize; 3],
    /// Which piece of the material it is cut from.
    piece: u64,
}

/// A place on a box that a pixel shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfacePlace {
    /// From the middle of the box, in its axes, metres.
    at: Vector,
    /// Number of the axis that leaves the box there.
    side: usize,
    /// How wide a patch of the surface the pixel shows, metres.
    patch_m: f64,
}

impl SurfacePlace {
    /// `at` in the box's axes; `cosine` between its side and the ray; `pixel_m` is the width of a pixel at that distance, metres.
    pub(super) fn new(at: Vector, side: usize, cosine: f64, pixel_m: f64) -> Self {
        Self { at, side, patch_m: pixel_m / cosine.max(LEAST_COSINE) }
    }
}

/// The surfaces of a kitchen, in the order of the boxes of [`Kitchen::posed`]; hands have none.
#[must_use]
pub(super) fn coats(kitchen: &Kitchen, seed: u64) -> Vec<Coat> {
    let has_panel = kitchen.fixed.iter().any(|block| block.color == TILE);
    let blocks = kitchen.fixed.iter().chain(kitchen.parts.iter().flat_map(|part| &part.blocks));
    let coat = |(i, block): (usize, &ColoredBox)| {
        let class = usize::from(block.class).checked_sub(1).and_then(|i| kitchen.classes.get(i)).copied();
        let (finish, color) = finish(block.color, class, has_panel);
        let half = block.shape.half;
        Coat { finish, color: color.map(f64::from), half, axes: axes(&half), piece: hash(seed, [i as i64, 0, 0]) }
    };
    blocks.enumerate().map(coat).collect()
}

/// Numbers of a box's axes, the longest first.
fn axes(half: &Vector) -> [usize; 3] {
    let mut axes: [usize; 3] = [0, 1, 2];
    axes.sort_by(|a, b| half[*b].total_cmp(&half[*a]));
    axes
}

/// What a box of a colour is made of, and its mean colour. Each surface of these kitchens has a colour of its own.
fn finish(color: [u8; 3], class: Option<&str>, has_panel: bool) -> (Finish, [u8; 3]) {
    let made_of = match color {
        HANDLE | STEEL => Finish::Steel,
        STONE => Finish::Stone,
        TILE => Finish::Tiles(PANEL),
        WALL if !has_panel => Finish::Tiles(SPLASH),
        FLOOR if !has_panel => Finish::Tiles(SLABS),
        FLOOR => Finish::Planks,
        GLASS | STRIPE | PLINTH => Finish::Plain,
        // A fridge in the colour of the fronts is none that anybody sells.
        _ if class == Some("fridge") && FRONTS.contains(&color) => return (Finish::Steel, STEEL),
        _ if WOODEN.iter().any(|wood| color == *wood || color == rail(*wood)) => Finish::Wood,
        _ => Finish::Paint,
    };
    (made_of, color)
}

impl Coat {
    /// Its colour at a place, without light; `None` where that is the flat one.
    pub(super) fn color_at(&self, place: &SurfacePlace) -> Option<Color> {
        let patch = place.patch_m;
        let at = self.axes.map(|k| place.at[k]);
        let color = match self.finish {
            Finish::Plain => return None,
            Finish::Paint => self.tone(paint(self.piece, at, patch)),
            Finish::Stone => self.tone(stone(self.piece, at, patch)),
            Finish::Steel => self.tone(steel(self.piece, at, patch)),
            Finish::Wood => self.warm(wood(self.piece, at, patch)),
            Finish::Tiles(grid) => self.tone(self.tiles(&grid, place)),
            Finish::Planks => self.warm(self.planks(place)),
        };
        Some(color)
    }

    /// Its colour, lighter by a share.
    fn tone(&self, lighter: f64) -> Color {
        self.color.map(|c| c * (1.0 + lighter))
    }

    /// The same as wood is.
    fn warm(&self, lighter: f64) -> Color {
        std::array::from_fn(|k| self.color[k] * (1.0 + lighter * WARM[k]))
    }

    fn tiles(&self, grid: &TileGrid, place: &SurfacePlace) -> f64 {
        let height = place.at.z + self.half.z;
        let from = grid.heights_m.map_or(0.0, |[low, _]| low);
        let cloud = paint(self.piece, self.axes.map(|k| place.at[k]), place.patch_m);
        if grid.heights_m.is_some_and(|[low, high]| !(low..high).contains(&height)) {
            return cloud;
        }
        // The side's own two axes: along the wall and up it, or both across the floor.
        let [first, second]: [usize; 2] = [[1, 2], [0, 2], [0, 1]][place.side.min(2)];
        let [u, v] = [first, second].map(|k| place.at[k] + self.half[k]);
        let on = [u, if second == 2 { v - from } else { v }];
        let cell = [0, 1].map(|k| (on[k] / grid.size_m[k]).floor() as i64);
        let bare = [0, 1].map(|k| {
            let into = on[k].rem_euclid(grid.size_m[k]);
            1.0 - covered(into.min(grid.size_m[k] - into), grid.joint_m, place.patch_m)
        });
        let joint = 1.0 - bare[0] * bare[1];
        let tile = PIECE * unit(hash(self.piece, [cell[0], cell[1], 1])) + cloud;
        tile * (1.0 - joint) + (GROUT - 1.0) * joint
    }

    fn planks(&self, place: &SurfacePlace) -> f64 {
        let [width, length] = PLANK_M;
        let row = ((place.at.y + self.half.y - PLANKS_FROM_M) / width).floor() as i64;
        // Ends do not meet in one line.
        let shift = length * unit(hash(self.piece, [row, 0, 2]));
        let plank = ((place.at.x + shift) / length).floor() as i64;
        let piece = hash(self.piece, [row, plank, 3]);
        wood(piece, [place.at.x, place.at.y - width * row as f64, place.at.z], place.patch_m)
    }
}

/// Wood of a tree that grew along the first axis: rings about its heart, which lies behind the board, streaks, slow changes.
fn wood(piece: u64, at: [f64; 3], patch_m: f64) -> f64 {
    let [along, across, deep] = at;
    let [aside, behind, board] = [0, 1, 2].map(|k| unit(hash(piece, [k, 0, 4])));
    let bend = noise(piece, [along / 0.35, across / 0.3, deep / 0.3]);
    let from_heart = (across - 0.15 * aside).hypot(deep + 0.1 + 0.06 * behind) + 0.025 * bend;
    let ring = (TAU * from_heart / RING_M).sin() * left(RING_M, patch_m);
    let streak = noise(piece ^ 1, [along / 0.2, across / 0.009, deep / 0.009]) * left(0.018, patch_m);
    let drift = noise(piece ^ 2, [along / 0.5, across / 0.2, deep / 0.2]);
    RING * ring + STREAK * streak + DRIFT * drift + PIECE * board
}

/// Steel brushed along the first axis.
fn steel(piece: u64, at: [f64; 3], patch_m: f64) -> f64 {
    let [along, across, deep] = at;
    let fine = noise(piece, [along / 0.15, across / 0.002, deep / 0.002]) * left(0.004, patch_m);
    let coarse = noise(piece ^ 1, [along / 0.4, across / 0.012, deep / 0.012]) * left(0.024, patch_m);
    let sheen = noise(piece ^ 2, [along / 0.6, across / 0.25, deep / 0.25]);
    STROKE * (0.4 * fine + 0.6 * coarse) + DRIFT * sheen
}

/// Polished stone: grains of two sizes.
fn stone(piece: u64, at: [f64; 3], patch_m: f64) -> f64 {
    let coarse = noise(piece, at.map(|c| c / 0.012)) * left(0.024, patch_m);
    let fine = noise(piece ^ 1, at.map(|c| c / 0.004)) * left(0.008, patch_m);
    let drift = noise(piece ^ 2, at.map(|c| c / 0.15));
    SPECKLE * (0.6 * coarse + 0.4 * fine) + 2.0 * DRIFT * drift
}

/// Paint as a roller leaves it, and as it fades.
fn paint(piece: u64, at: [f64; 3], patch_m: f64) -> f64 {
    let broad = noise(piece, at.map(|c| c / 0.35));
    let small = noise(piece ^ 1, at.map(|c| c / 0.05)) * left(0.1, patch_m);
    CLOUD * (broad + 0.4 * small)
}

/// What is left of a pattern of a wavelength in pixels that are so wide: nothing of two pixels a wave, all of it from ten on.
fn left(wavelength_m: f64, patch_m: f64) -> f64 {
    ((wavelength_m / patch_m - 2.0) / 8.0).clamp(0.0, 1.0)
}

/// The share of a pixel that a line covers whose middle is at a distance from the pixel's; all in metres.
fn covered(distance_m: f64, width_m: f64, patch_m: f64) -> f64 {
    let both = (0.5 * (width_m + patch_m) - distance_m).min(width_m).min(patch_m);
    both.max(0.0) / patch_m
}

/// Value noise between -1 and 1: a hash at every whole place, smooth in between.
fn noise(piece: u64, at: [f64; 3]) -> f64 {
    let low = at.map(f64::floor);
    let share: [f64; 3] = std::array::from_fn(|k| {
        let t = at[k] - low[k];
        t * t * (3.0 - 2.0 * t)
    });
    let corner = |bits: u8| {
        let is_high = |k: usize| (bits >> k) & 1 == 1;
        let cell: [i64; 3] = std::array::from_fn(|k| low[k] as i64 + i64::from(is_high(k)));
        let weight: f64 = (0..3).map(|k| if is_high(k) { share[k] } else { 1.0 - share[k] }).product();
        weight * unit(hash(piece, cell))
    };
    (0..8).map(corner).sum()
}

/// 64 bits of a cell of a piece, without pattern.
fn hash(piece: u64, cell: [i64; 3]) -> u64 {
    // Odd numbers without pattern keep the cells apart; splitmix64's finish mixes them.
    const SPREAD: [u64; 3] = [0x9e37_79b9_7f4a_7c15, 0xd1b5_4a32_d192_ed03, 0x8cb9_2ba7_2f3d_8dd7];
    let mut h = piece;
    for (c, spread) in cell.into_iter().zip(SPREAD) {
        h = (h ^ (c as u64).wrapping_mul(spread)).rotate_left(23);
    }
    h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    h ^ (h >> 31)
}

/// A number from -1 up to 1.
fn unit(h: u64) -> f64 {
    (h >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What people see of a colour (BT.601).
    fn grey(color: Color) -> f64 {
        0.299 * color[0] + 0.587 * color[1] + 0.114 * color[2]
    }

    /// A door's front in the brightest light.
    fn door(finish: Finish, color: [u8; 3]) -> Coat {
        let half = Vector::new(0.3, 0.009, 0.36);
        Coat { finish, color: color.map(f64::from), half, axes: axes(&half), piece: 7 }
    }

    /// Grey values of pixels along a line on the front.
    fn row(coat: &Coat, upright: bool, patch_m: f64) -> Vec<f64> {
        (0..400)
            .map(|i| patch_m * f64::from(i) - 200.0 * patch_m)
            .map(|t| if upright { Vector::new(0.11, 0.009, t) } else { Vector::new(t, 0.009, 0.07) })
            .map(|at| grey(coat.color_at(&SurfacePlace::new(at, 1, 1.0, patch_m)).unwrap()))
            .collect()
    }

    #[test]
    fn grain_is_never_steep_enough_for_a_line() {
        for (finish, color) in [(Finish::Wood, WOODEN[0]), (Finish::Wood, WOODEN[1]), (Finish::Steel, STEEL)] {
            for patch_m in [0.0005, 0.001, 0.002, 0.003, 0.005, 0.008, 0.015, 0.03] {
                for upright in [false, true] {
                    let row = row(&door(finish, color), upright, patch_m);
                    let steepest = row.windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
                    assert!(steepest < 3.0, "{finish:?} at {patch_m}: {steepest}");
                }
            }
        }
    }

    #[test]
    fn grain_shows_and_keeps_within_a_few_percent_of_the_colour() {
        let flat = grey(WOODEN[0].map(f64::from));
        let row = row(&door(Finish::Wood, WOODEN[0]), false, 0.003);
        let (low, high) = row.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        assert!(high - low > 0.03 * flat, "{low} {high}");
        assert!(low > 0.9 * flat && high < 1.1 * flat, "{low} {high} of {flat}");
    }

    #[test]
    fn joints_are_dark_lines_that_fade_with_distance() {
        let wall = Coat { half: Vector::new(2.0, 0.025, 1.3), ..door(Finish::Tiles(SPLASH), WALL) };
        let at = |x: f64, z: f64, patch_m: f64| {
            let place = SurfacePlace::new(Vector::new(x - 2.0, 0.025, z - 1.3), 1, 1.0, patch_m);
            grey(wall.color_at(&place).unwrap()) / grey(wall.color)
        };
        assert!((at(0.52, 0.9, 0.001) - GROUT).abs() < 1e-9);
        assert!((at(0.65, 0.92, 0.001) - 1.0).abs() < 0.05);
        let far = at(0.52, 0.92, 0.04);
        assert!(far > 0.9, "{far}");
        // Paint above and below.
        assert!((at(0.52, 0.5, 0.001) - 1.0).abs() < 0.05 && (at(0.52, 1.6, 0.001) - 1.0).abs() < 0.05);
        assert!((covered(0.0, 0.004, 0.002) - 1.0).abs() < 1e-12);
        assert!((covered(0.002, 0.004, 0.002) - 0.5).abs() < 1e-12 && covered(0.003, 0.004, 0.002) < 1e-12);
        assert!((covered(0.0, 0.004, 0.016) - 0.25).abs() < 1e-12);
    }

    #[test]
    fn noise_is_smooth_within_its_bounds_and_another_piece_has_another() {
        let line =
            |piece: u64| -> Vec<f64> { (0..4000).map(|i| noise(piece, [0.01 * f64::from(i), -3.3, 7.7])).collect() };
        let (one, other) = (line(1), line(2));
        assert!(one.iter().all(|v| v.abs() <= 1.0) && one == line(1) && one != other);
        assert!(one.windows(2).all(|w| (w[1] - w[0]).abs() < 0.04));
        let mean = one.iter().sum::<f64>() / 4000.0;
        let high = one.iter().copied().fold(0.0, f64::max);
        assert!(mean.abs() < 0.2 && high > 0.3, "{mean} {high}");
    }

    #[test]
    fn surfaces_are_told_by_their_colours() {
        assert_eq!(finish(FRONTS[0], Some("cupboard"), true), (Finish::Wood, FRONTS[0]));
        assert_eq!(finish(rail(FRONTS[4]), None, true).0, Finish::Wood);
        assert_eq!(finish(FRONTS[1], Some("drawer"), true).0, Finish::Paint);
        assert_eq!(finish(FRONTS[0], Some("fridge"), false), (Finish::Steel, STEEL));
        assert_eq!([finish(FLOOR, None, true).0, finish(FLOOR, None, false).0], [Finish::Planks, Finish::Tiles(SLABS)]);
        assert_eq!([finish(WALL, None, true).0, finish(GLASS, None, true).0], [Finish::Paint, Finish::Plain]);
    }
}
