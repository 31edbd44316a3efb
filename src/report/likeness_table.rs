//! A twin beside the recorded frames: tables, and pictures of both with their difference.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::phrases;
use super::table::aligned;
use crate::error::{Error, Result};
use crate::evaluation::front_errors::FrontErrors;
use crate::evaluation::likeness::{ComparedFrame, ContenderSummary};
use crate::evaluation::surface_scores::ShapeScore;
use crate::raster::NOTHING;

/// Where there is no surface.
const NO_SURFACE: [u8; 3] = [255, 0, 255];
/// Where nothing is compared.
const NOT_COMPARED: [u8; 3] = [40; 3];
/// Differences are drawn brighter by this.
const BRIGHTER: u8 = 2;

fn or_dash(value: Option<f64>, text: impl Fn(f64) -> String) -> String {
    value.map_or_else(|| "-".to_owned(), text)
}

/// How alike contenders and frames are, one row a contender and kind of frame.
#[must_use]
pub fn likeness(summaries: &[ContenderSummary]) -> String {
    let header = ["what", "over", "frames", "coverage", "PSNR", "SSIM", "PSNR, exposure fitted"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    let decibels = |v: f64| format!("{v:.2} dB");
    for s in summaries {
        rows.push(vec![
            s.name.clone(),
            s.over.words().to_owned(),
            s.frames.to_string(),
            format!("{:.3}", s.coverage),
            or_dash(s.psnr_db, decibels),
            or_dash(s.ssim, |v| format!("{v:.3}")),
            or_dash(s.psnr_fitted_db, decibels),
        ]);
    }
    aligned(&rows)
}

/// Shapes of what does not move, one row a contender.
#[must_use]
pub fn shapes(scores: &[(String, ShapeScore)]) -> String {
    let Some((_, first)) = scores.first() else { return String::new() };
    let header = ["the room's shape", "precision", "recall", "F-score"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    for (name, s) in scores {
        let shares = [s.precision, s.recall, s.f_score].map(|v| format!("{v:.3}"));
        rows.push(std::iter::once(name.clone()).chain(shares).collect());
    }
    format!("{}points are right within {}\n", aligned(&rows), phrases::centimetres(first.within_m))
}

/// Edges and boxes of the parts.
#[must_use]
pub fn fronts(fronts: &FrontErrors) -> String {
    let header = ["front", "joint", "left", "right", "bottom", "top", "worst edge", "box IoU"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    for front in &fronts.fronts {
        let mut row = vec![front.joint.clone(), front.predicted.clone().unwrap_or_else(|| "-".to_owned())];
        row.extend(front.edges_m.map(|e| format!("{:+.1} cm", 100.0 * e)));
        row.push(phrases::centimetres(front.worst_m()));
        row.push(format!("{:.2}", front.iou));
        rows.push(row);
    }
    format!(
        "{}{} of {} parts; edges: median {}, worst {}; boxes: median IoU {}\n",
        aligned(&rows),
        fronts.fronts.len(),
        fronts.parts,
        or_dash(fronts.median_edge_m, phrases::centimetres),
        or_dash(fronts.worst_edge_m, phrases::centimetres),
        or_dash(fronts.median_iou, |v| format!("{v:.2}"))
    )
}

/// A frame, what each contender shows, and the difference, beside each other; one row a contender. PNG.
///
/// # Errors
/// Where the picture cannot be encoded, which would be a bug.
pub fn panel(sight: &ComparedFrame) -> Result<Vec<u8>> {
    let (width, height) = (sight.frame.width, sight.frame.height);
    let mut rgb: Vec<u8> = Vec::with_capacity(9 * width * height * sight.views.len());
    for view in &sight.views {
        let is_there = |i: usize| view.owner.data[i] != NOTHING;
        let shown = |i: usize| if is_there(i) { view.rgb.data[i] } else { NO_SURFACE };
        let difference = |i: usize| -> [u8; 3] {
            if !(sight.counts.data[i] && is_there(i)) {
                return NOT_COMPARED;
            }
            let (a, b) = (sight.frame.data[i], view.rgb.data[i]);
            std::array::from_fn(|k| a[k].abs_diff(b[k]).saturating_mul(BRIGHTER))
        };
        for row in 0..height {
            let line = row * width..(row + 1) * width;
            rgb.extend(line.clone().flat_map(|i| sight.frame.data[i]));
            rgb.extend(line.clone().flat_map(shown));
            rgb.extend(line.flat_map(difference));
        }
    }
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&rgb, 3 * width as u32, (height * sight.views.len()) as u32, ExtendedColorType::Rgb8)
        .map_err(|e| Error::Export(format!("a picture of the comparison: {e}")))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::RenderedView;
    use crate::recording::Grid;

    #[test]
    fn a_panel_shows_frame_view_and_difference() {
        let counts = Grid { width: 2, height: 1, data: vec![true, true] };
        let view = RenderedView {
            rgb: Grid { width: 2, height: 1, data: vec![[90, 110, 100], [0; 3]] },
            depth: Grid { width: 2, height: 1, data: vec![1.0, 0.0] },
            owner: Grid { width: 2, height: 1, data: vec![0, NOTHING] },
        };
        let frame = Grid { width: 2, height: 1, data: vec![[100; 3], [50; 3]] };
        let sight = ComparedFrame { frame, opened: counts.clone(), counts, views: vec![view] };
        let picture = image::load_from_memory(&panel(&sight).unwrap()).unwrap().into_rgb8();
        let pixels: Vec<[u8; 3]> = picture.pixels().map(|p| p.0).collect();
        assert_eq!(pixels, [[100; 3], [50; 3], [90, 110, 100], NO_SURFACE, [20, 20, 0], NOT_COMPARED]);
    }
}
