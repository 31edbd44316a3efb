//! How fine a chart's texels are worth to be: as fine as the pixels of the frames that show it best.

use rayon::prelude::*;

use super::charts::Chart;
use super::frame_sights::FrameSight;
use super::local::{Local, RigidMotion};
use super::texels::{LEAST_COSINE, pose_of, tolerance};
use crate::config;

/// Triangles of a chart that are asked at the most.
const ASKED: usize = 24;
/// Where they are asked, as shares of their corners.
const PLACES: [[f32; 3]; 4] = [[1.0 / 3.0; 3], [0.7, 0.15, 0.15], [0.15, 0.7, 0.15], [0.15, 0.15, 0.7]];
/// Of the places that are seen this one decides, the sharpest first: a quarter of a chart may be sharper than its texels.
const QUARTER: usize = 4;
/// The largest texels, against the smallest: what no frame shows at the places that are asked may still be seen beside them.
const COARSEST: f32 = 4.0;

/// Sets how fine the texels of each chart are worth to be. `motions` are camera from local of each part, by sight.
pub(super) fn choose(
    charts: &mut [Chart],
    sights: &[FrameSight],
    motions: &[Vec<Option<RigidMotion>>],
    config: &config::Appearance,
) {
    let per_pixel = config.texels_per_pixel as f32;
    let coarsest = COARSEST * config.texel_m as f32;
    charts.par_iter_mut().filter(|chart| chart.assumed.is_none()).for_each(|chart| {
        let mut pixels: Vec<f32> = places(chart)
            .iter()
            .filter_map(|(place, normal)| smallest_pixel(chart.owner, place, normal, sights, motions))
            .collect();
        pixels.sort_unstable_by(f32::total_cmp);
        let deciding = pixels.get(pixels.len() / QUARTER);
        chart.finest = deciding.map_or(coarsest, |pixel| (pixel / per_pixel).min(coarsest));
    });
}

/// Places on a chart with their unit normals, local.
fn places(chart: &Chart) -> Vec<(Local, Local)> {
    let stride = chart.triangles.len().div_ceil(ASKED).max(1);
    let of = |triangle: &[u32; 3]| {
        let corners = triangle.map(|v| chart.positions[v as usize]);
        let across = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let normal = across.try_normalize(1e-12).unwrap_or(chart.axes[2]);
        PLACES.map(|shares| {
            let place = corners.iter().zip(shares).fold(Local::zeros(), |sum, (corner, share)| sum + corner * share);
            (place, normal)
        })
    };
    chart.triangles.iter().step_by(stride).flat_map(of).collect()
}

/// The edge of the smallest pixel that shows a place, metres on a surface square to it; `None` where no frame shows it.
fn smallest_pixel(
    owner: Option<usize>,
    place: &Local,
    normal: &Local,
    sights: &[FrameSight],
    motions: &[Vec<Option<RigidMotion>>],
) -> Option<f32> {
    let mut least = None;
    for (sight, motions) in sights.iter().zip(motions) {
        let Some(pose) = pose_of(owner, sight, motions) else { continue };
        let p = pose.apply(place);
        let pixel = p.z / (sight.lens.focal[0].min(sight.lens.focal[1]) * sight.step as f32);
        if p.z < 0.1 || least.is_some_and(|l| pixel >= l) {
            continue;
        }
        let faces = -(pose.rotation * normal).dot(&p) >= LEAST_COSINE * p.norm();
        if faces && sight.agrees(sight.lens.project(&p), p.z, tolerance(owner, p.z), owner.is_none()).is_some() {
            least = Some(pixel);
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::super::frame_choice::State;
    use super::super::sight_camera::SightCamera;
    use super::*;

    /// A camera that looks along +z at a wall at a distance, from the local origin.
    fn before_a_wall(distance_mm: u32, step: usize) -> FrameSight {
        let lens = SightCamera { width: 64, height: 48, focal: [50.0; 2], center: [31.5, 23.5] };
        let pose = RigidMotion { rotation: nalgebra::Matrix3::identity(), translation: Local::zeros() };
        let samples = vec![distance_mm | (255 << 16); 64 * 48];
        FrameSight { frame: 0, step, lens, pose, states: vec![State::Closed], samples }
    }

    fn square(z: f32) -> Chart {
        let positions = [[-0.1, -0.1], [-0.1, 0.1], [0.1, 0.1], [0.1, -0.1]].map(|[x, y]| Local::new(x, y, z)).to_vec();
        Chart::new(positions, vec![-Local::z(); 4], vec![[0, 1, 2], [0, 2, 3]], &-Local::z())
    }

    #[test]
    fn texels_are_as_fine_as_the_pixels_of_the_frame_that_shows_a_chart_best() {
        let config = config::Appearance { texel_m: 0.004, texels_per_pixel: 2.0, ..Default::default() };
        let mut charts = vec![square(2.0), square(1.0)];
        // Every second pixel is kept of the second frame, which is no nearer.
        let sights = vec![before_a_wall(2000, 1), before_a_wall(2000, 2)];
        choose(&mut charts, &sights, &[Vec::new(), Vec::new()], &config);
        assert!((charts[0].finest - 2.0 / 100.0 / 2.0).abs() < 1e-6, "{}", charts[0].finest);
        // A metre before the wall nothing is seen.
        assert!((charts[1].finest - 0.016).abs() < 1e-6, "{}", charts[1].finest);
    }
}
