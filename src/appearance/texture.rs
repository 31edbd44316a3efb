//! Colours of the charts: each texel keeps what its best few frames say of it, while these are decoded a few at a time.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::charts::{self, Chart};
use super::frame_choice::State;
use super::frame_sights::{FrameSight, Setting};
use super::local::{Local, RigidMotion};
use super::texels::{BEFORE_M, BEST, LEAST_COSINE, Texel, TexelSample, TexelTile, name, pose_of, tolerance};
use super::{blend, density};
use crate::error::Result;
use crate::look::Texture;
use crate::math::Pose;
use crate::recording::Grid;

/// Edge of a tile, texels.
const TILE: u32 = 16;
/// Frames that are decoded at a time.
const WINDOW: usize = 4;
/// Nearer than this an image is no sharper, metres.
const SHARP_M: f32 = 0.3;
/// Colour where there are no images, sRGB.
const GREY: u8 = 170;

/// Packs the charts and paints them. Returns the pages, and of each chart how many texels were seen and how many it has.
pub(super) fn paint(
    setting: &Setting,
    sights: &[FrameSight],
    charts: &mut [Chart],
) -> Result<(Vec<Texture>, Vec<[usize; 2]>)> {
    let has_colours =
        sights.iter().any(|s| setting.recording.frames.get(s.frame).is_some_and(|f| f.files.rgb.is_some()));
    if !has_colours {
        return Ok((grey(charts), vec![[0, 1]; charts.len()]));
    }
    let motions: Vec<Vec<Option<RigidMotion>>> = sights.iter().map(|sight| motions(setting, sight)).collect();
    density::choose(charts, sights, &motions, setting.config);
    let pages = charts::pack(charts, setting.config.texel_m, setting.config.texels);
    let mut tiles = tiles(charts);
    for (number, (some, motions)) in sights.chunks(WINDOW).zip(motions.chunks(WINDOW)).enumerate() {
        let images: Vec<Option<Grid<[u8; 3]>>> =
            some.par_iter().map(|s| setting.recording.rgb(s.frame)).collect::<Result<_>>()?;
        let views: Vec<PaintedView> = some
            .iter()
            .zip(&images)
            .zip(motions)
            .enumerate()
            .filter_map(|(i, ((sight, image), motions))| {
                let image = image.as_ref()?;
                let number = (number * WINDOW + i) as u16;
                Some(PaintedView { sight, number, image, sharpness: sharpness(image), motions })
            })
            .collect();
        tiles.par_iter_mut().for_each(|tile| {
            let chart = &charts[tile.chart];
            views.iter().for_each(|view| look_at(tile, chart, view));
        });
    }
    Ok(blend::pages(charts, &tiles, &pages, sights.len()))
}

/// A page of one colour that all charts share.
fn grey(charts: &mut [Chart]) -> Vec<Texture> {
    const SIZE: u32 = 4;
    for chart in charts {
        // Every corner falls onto the page's middle.
        chart.texel = 1e6;
        chart.low = [-0.5 * SIZE as f32 * chart.texel; 2];
        chart.size = [SIZE; 2];
    }
    vec![Texture { name: name(0), width: SIZE, height: SIZE, rgb: vec![GREY; (3 * SIZE * SIZE) as usize] }]
}

/// A frame with its image.
struct PaintedView<'a> {
    sight: &'a FrameSight,
    number: u16,
    image: &'a Grid<[u8; 3]>,
    sharpness: f32,
    /// Camera from local of each part where it is known where it stands.
    motions: &'a [Option<RigidMotion>],
}

/// Where each part is, seen from the camera.
fn motions(setting: &Setting, sight: &FrameSight) -> Vec<Option<RigidMotion>> {
    let from = Pose::translation(setting.origin.x, setting.origin.y, setting.origin.z);
    let part = |(piece, state): (&crate::twin::Furniture, &State)| {
        let opening = match state {
            State::Closed => return Some(sight.pose),
            State::Open(opening) => *opening,
            State::Moving => return None,
        };
        // Local from local: the motion is about the world's origin.
        let moved = RigidMotion::of(&(from.inverse() * piece.part.joint.articulation.motion(opening) * from));
        Some(RigidMotion {
            rotation: sight.pose.rotation * moved.rotation,
            translation: sight.pose.apply(&moved.translation),
        })
    };
    setting.twin.furniture.iter().zip(&sight.states).map(part).collect()
}

/// How sharp an image is, whatever it shows: squared change from one pixel to the next against that over four. A sharp edge has all
/// of its change in one step of four, a smooth one a quarter in each.
fn sharpness(image: &Grid<[u8; 3]>) -> f32 {
    let (mut near, mut wide) = (0u64, 1u64);
    for row in image.data.chunks_exact(image.width.max(1)).step_by(3) {
        for five in row.windows(5).step_by(3) {
            let change = |i: usize| u64::from(five[0][1].abs_diff(five[i][1])).pow(2);
            // Noise of a few levels is no edge.
            if change(4) >= 150 {
                near += change(1);
                wide += change(4);
            }
        }
    }
    (4.0 * near as f32 / wide as f32).clamp(0.1, 1.0)
}

/// The tiles of all charts, in their order.
fn tiles(charts: &[Chart]) -> Vec<TexelTile> {
    let by_chart: Vec<Vec<TexelTile>> = charts
        .par_iter()
        .enumerate()
        .map(|(i, chart)| if chart.assumed.is_some() { Vec::new() } else { tiles_of(i, chart) })
        .collect();
    by_chart.into_iter().flatten().collect()
}

fn tiles_of(number: usize, chart: &Chart) -> Vec<TexelTile> {
    let across = chart.size[0].div_ceil(TILE) as usize;
    let down = chart.size[1].div_ceil(TILE) as usize;
    let mut tiles: Vec<Vec<Texel>> = vec![Vec::new(); across * down];
    let mut taken = vec![false; chart.size[0] as usize * chart.size[1] as usize];
    for triangle in &chart.triangles {
        cover(chart, triangle, &mut |at: [u32; 2], height: f32, normal: Local| {
            let index = at[1] as usize * chart.size[0] as usize + at[0] as usize;
            if std::mem::replace(&mut taken[index], true) {
                return;
            }
            let tile = (at[1] / TILE) as usize * across + (at[0] / TILE) as usize;
            tiles[tile].push(Texel {
                at: at.map(|c| c as u16),
                height,
                normal: [normal.x, normal.y, normal.z].map(|c| (127.0 * c).round() as i8),
                samples: [TexelSample::default(); BEST],
            });
        });
    }
    let whole = |texels: Vec<Texel>| {
        let places: Vec<Local> = texels.iter().map(|t| place(chart, t)).collect();
        let middle = places.iter().fold(Local::zeros(), |sum, p| sum + p) / places.len().max(1) as f32;
        let radius = places.iter().map(|p| (p - middle).norm()).fold(0.0, f32::max);
        let normals: Vec<Local> = texels.iter().map(|t| Local::from(t.normal.map(f32::from)) / 127.0).collect();
        let sum = normals.iter().fold(Local::zeros(), |sum, n| sum + n);
        let normal = sum.try_normalize(1e-6).unwrap_or(chart.axes[2]);
        let spread = normals.iter().map(|n| n.dot(&normal).clamp(-1.0, 1.0).acos()).fold(0.0, f32::max);
        TexelTile { chart: number, middle, radius, normal, spread, least: 0, texels }
    };
    tiles.into_iter().filter(|t| !t.is_empty()).map(whole).collect()
}

/// Local place of a texel's middle.
fn place(chart: &Chart, texel: &Texel) -> Local {
    let [u, v] = [0, 1].map(|k| chart.low[k] + (f32::from(texel.at[k]) + 0.5) * chart.texel);
    chart.axes[0] * u + chart.axes[1] * v + chart.axes[2] * texel.height
}

/// Calls `take` with every texel whose middle a triangle covers, its height and its normal. A triangle that covers no middle takes
/// the texel of its own one.
fn cover(chart: &Chart, triangle: &[u32; 3], take: &mut impl FnMut([u32; 2], f32, Local)) {
    let corners = triangle.map(|v| chart.positions[v as usize]);
    let flat = corners.map(|p| chart.coordinates(&p).map(|c| c - 0.5));
    let heights = corners.map(|p| p.dot(&chart.axes[2]));
    let normal = |shares: [f32; 3]| {
        let mixed = (0..3).fold(Local::zeros(), |sum, k| sum + chart.normals[triangle[k] as usize] * shares[k]);
        mixed.try_normalize(1e-9).unwrap_or(chart.axes[2])
    };
    let [a, b, c] = flat;
    let twice = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let last = chart.size.map(|s| s - 1);
    let range = |k: usize| {
        let low = a[k].min(b[k]).min(c[k]).ceil().clamp(0.0, last[k] as f32) as u32;
        let high = a[k].max(b[k]).max(c[k]).floor().clamp(0.0, last[k] as f32) as u32;
        low..=high
    };
    let mut any = false;
    if twice.abs() > 1e-9 {
        for y in range(1) {
            for x in range(0) {
                let (px, py) = (x as f32, y as f32);
                let share =
                    |p: [f32; 2], q: [f32; 2]| ((q[0] - p[0]) * (py - p[1]) - (q[1] - p[1]) * (px - p[0])) / twice;
                let shares = [share(b, c), share(c, a), share(a, b)];
                // A seam between two triangles belongs to either.
                if shares.iter().all(|s| *s >= -1e-4) {
                    any = true;
                    let height = (0..3).map(|k| heights[k] * shares[k]).sum();
                    take([x, y], height, normal(shares));
                }
            }
        }
    }
    if !any {
        let third = [1.0 / 3.0; 3];
        let middle = [0, 1].map(|k| ((a[k] + b[k] + c[k]) / 3.0).round().clamp(0.0, last[k] as f32) as u32);
        take(middle, heights.iter().sum::<f32>() / 3.0, normal(third));
    }
}

/// Lets a frame say what it shows at a tile's texels.
fn look_at(tile: &mut TexelTile, chart: &Chart, view: &PaintedView) {
    let sight = view.sight;
    let Some(pose) = pose_of(chart.owner, sight, view.motions) else { return };
    let middle = pose.apply(&tile.middle);
    if !sight.lens.meets(&middle, tile.radius) || no_use(tile, &pose, &middle, view) {
        return;
    }
    let is_closed = |part: usize| matches!(sight.states.get(part), Some(State::Closed));
    let shut_in = chart.shut_in && chart.owner.is_some_and(is_closed);
    let axes: [Local; 3] = chart.axes.map(|axis| pose.rotation * axis);
    let base = pose.translation + axes[0] * chart.low[0] + axes[1] * chart.low[1];
    let (right, down) = (axes[0] * chart.texel, axes[1] * chart.texel);
    let turn: Matrix3<f32> = pose.rotation / 127.0;
    let [width, height] = [sight.lens.width as f32, sight.lens.height as f32];
    for texel in &mut tile.texels {
        let [x, y] = texel.at.map(|c| f32::from(c) + 0.5);
        let p = base + right * x + down * y + axes[2] * texel.height;
        if p.z < 0.1 {
            continue;
        }
        let normal = turn * Local::from(texel.normal.map(f32::from));
        let cosine = -normal.dot(&p) / p.norm();
        if cosine < LEAST_COSINE {
            continue;
        }
        let at = sight.lens.project(&p);
        let tolerance = tolerance(chart.owner, p.z);
        let (agreement, makeshift) = match sight.agrees(at, p.z, tolerance, chart.owner.is_none()) {
            Some(agreement) => (agreement, shut_in),
            None if chart.owner.is_none() && sight.shows_before(at, p.z, BEFORE_M) => (1.0, true),
            None => continue,
        };
        // Lenses are worse at the rim, and what is corrected there is stretched.
        let rim = (at[0].min(width - at[0]) / width).min(at[1].min(height - at[1]) / height);
        let near = p.z.max(SHARP_M);
        let score = view.sharpness * cosine * cosine * agreement * (20.0 * rim).clamp(0.1, 1.0) / (near * near);
        keep(texel, (score, makeshift), view, at);
    }
    let kept = tile.texels.iter().flat_map(|t| &t.samples).map(|s| if s.makeshift { 0 } else { s.score });
    tile.least = kept.min().unwrap_or(0);
}

/// Whether a view has nothing to say of a tile: it looks away, is hidden, or all of its texels have better ones.
fn no_use(tile: &TexelTile, pose: &RigidMotion, middle: &Local, view: &PaintedView) -> bool {
    let away = middle.norm();
    if away <= 2.0 * tile.radius {
        return false;
    }
    // Angle between the normal that turns most towards the camera and the ray that meets it best.
    let cosine = -(pose.rotation * tile.normal).dot(middle) / away;
    let angle = cosine.clamp(-1.0, 1.0).acos() - tile.spread - (tile.radius / away).asin();
    let best = angle.max(0.0).cos();
    let near = (middle.z - tile.radius).max(SHARP_M);
    best < LEAST_COSINE
        || ranked(view.sharpness * best * best / (near * near)) <= tile.least
        || view.sight.hides(middle, tile.radius)
}

/// A score as samples keep it.
fn ranked(score: f32) -> u16 {
    /// The best score, of a sharp image seen from [`SHARP_M`], is about 11; its root times this fits into 16 bits.
    const SCALE: f32 = 16_000.0;
    (score.sqrt() * SCALE).clamp(1.0, 65_535.0) as u16
}

/// Keeps a sample if it is among the best.
fn keep(texel: &mut Texel, (score, makeshift): (f32, bool), view: &PaintedView, at: [f32; 2]) {
    let new = TexelSample { score: ranked(score), sight: view.number, rgb: [0; 3], makeshift };
    let Some(worst) = texel.samples.iter_mut().min_by_key(|s| s.rank()) else { return };
    if worst.rank() >= new.rank() {
        return;
    }
    let step = view.sight.step as f32;
    let first = (view.sight.step / 2) as f32;
    *worst = TexelSample { rgb: bilinear(view.image, at.map(|c| c * step + first)), ..new };
}

/// Colour between pixels.
fn bilinear(image: &Grid<[u8; 3]>, [u, v]: [f32; 2]) -> [u8; 3] {
    let (x, y) = (u.max(0.0) as usize, v.max(0.0) as usize);
    let (x, y) = (x.min(image.width.saturating_sub(2)), y.min(image.height.saturating_sub(2)));
    let (fx, fy) = ((u - x as f32).clamp(0.0, 1.0), (v - y as f32).clamp(0.0, 1.0));
    let pixel = |dx: usize, dy: usize| image.get(x + dx, y + dy).unwrap_or_default().map(f32::from);
    let (a, b, c, d) = (pixel(0, 0), pixel(1, 0), pixel(0, 1), pixel(1, 1));
    std::array::from_fn(|k| {
        let top = a[k] + (b[k] - a[k]) * fx;
        let bottom = c[k] + (d[k] - c[k]) * fx;
        (top + (bottom - top) * fy + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Chart {
        let positions = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.1]].map(|[x, y]| Local::new(x, y, 0.7)).to_vec();
        let mut all = [Chart::new(positions, vec![Local::z(); 4], vec![[0, 1, 2], [0, 2, 3]], &Local::z())];
        charts::pack(&mut all, 0.01, 1 << 20);
        let [chart] = all;
        chart
    }

    #[test]
    fn two_triangles_of_a_square_cover_each_texel_once() {
        let chart = square();
        let texels: Vec<Texel> = tiles_of(0, &chart).into_iter().flat_map(|t| t.texels).collect();
        assert!((100..=121).contains(&texels.len()), "{}", texels.len());
        for texel in &texels {
            let p = place(&chart, texel);
            assert!((p.z - 0.7).abs() < 1e-5 && (-0.001..0.101).contains(&p.x) && (-0.001..0.101).contains(&p.y));
            assert_eq!(texel.normal, [0, 0, 127]);
        }
    }

    #[test]
    fn sharp_edges_are_sharper_than_smooth_ones() {
        let image = |edge: usize| {
            let level = |x: usize| (255 * (x % 16).min(16 - x % 16).min(edge) / edge) as u8;
            let row: Vec<[u8; 3]> = (0..64).map(|x| [level(x); 3]).collect();
            Grid { width: 64, height: 8, data: (0..8).flat_map(|_| row.clone()).collect() }
        };
        assert!(sharpness(&image(1)) > 1.5 * sharpness(&image(6)));
    }

    #[test]
    fn colours_between_pixels_are_mixed() {
        let image = Grid { width: 2, height: 2, data: vec![[0; 3], [100; 3], [200; 3], [100; 3]] };
        assert_eq!(bilinear(&image, [0.5, 0.0]), [50; 3]);
        assert_eq!(bilinear(&image, [0.0, 0.5]), [100; 3]);
        assert_eq!(bilinear(&image, [5.0, 5.0]), [100; 3]);
    }
}
