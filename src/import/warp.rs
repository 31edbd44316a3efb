//! Images of a source's camera as the output's camera sees them: undistorted, smaller, turned.

use image::RgbImage;

use super::capture::{Layer, Normals};
use super::decode;
use super::optics::Optics;
use super::output_view::OutputView;
use crate::error::Result;
use crate::math::{Point, Pose, Vector, unit};
use crate::recording::Grid;
use crate::recording::segments::Ends;

/// Distance and angle below which two cameras are one: a pixel at arm's length (metres, radians).
const SAME_PLACE: f64 = 1e-4;

/// Pixel of the source for each pixel of the output, row by row; `None` where the lens sees nothing.
fn sources(view: &OutputView, optics: &Optics) -> impl Iterator<Item = Option<(f64, f64)>> {
    let (width, height) = (view.camera.width, view.camera.height);
    let (view, optics) = (*view, *optics);
    (0..height).flat_map(move |y| (0..width).map(move |x| optics.project(&Point::from(view.ray(x as f64, y as f64)))))
}

/// A colour image. Where the output is smaller, each of its pixels is the mean of as many of the source's as it covers.
#[must_use]
pub fn color(image: &RgbImage, view: &OutputView, optics: &Optics) -> Vec<u8> {
    let optics = optics.resized(image.width() as usize, image.height() as usize);
    let reach = (optics.fx / view.camera.fx).round().clamp(1.0, 16.0) as i64;
    let mut out = Vec::with_capacity(3 * view.camera.width * view.camera.height);
    for source in sources(view, &optics) {
        let pixel = source.and_then(|(u, v)| if reach > 1 { block(image, u, v, reach) } else { bilinear(image, u, v) });
        out.extend(pixel.unwrap_or([0; 3]));
    }
    out
}

fn rgb(image: &RgbImage, x: i64, y: i64) -> Option<[u8; 3]> {
    let (x, y) = (u32::try_from(x).ok()?, u32::try_from(y).ok()?);
    image.get_pixel_checked(x, y).map(|p| p.0)
}

/// The mean of a square of pixels about a place; `None` outside.
fn block(image: &RgbImage, u: f64, v: f64, size: i64) -> Option<[u8; 3]> {
    let first = |c: f64| (c - 0.5 * (size - 1) as f64).round() as i64;
    let (x0, y0) = (first(u), first(v));
    let (mut sum, mut count) = ([0u32; 3], 0u32);
    for y in y0..y0.saturating_add(size) {
        for x in x0..x0.saturating_add(size) {
            let Some(pixel) = rgb(image, x, y) else { continue };
            for (s, c) in sum.iter_mut().zip(pixel) {
                *s += u32::from(c);
            }
            count += 1;
        }
    }
    (count > 0).then(|| sum.map(|s| ((s + count / 2) / count) as u8))
}

fn bilinear(image: &RgbImage, u: f64, v: f64) -> Option<[u8; 3]> {
    let (w, h) = (f64::from(image.width()), f64::from(image.height()));
    if !(u >= -0.5 && v >= -0.5 && u < w - 0.5 && v < h - 0.5) {
        return None;
    }
    let (u, v) = (u.clamp(0.0, w - 1.0), v.clamp(0.0, h - 1.0));
    let (x, y) = (u.floor(), v.floor());
    let (a, b) = (u - x, v - y);
    let at = |dx: i64, dy: i64| {
        let x = (x as i64 + dx).min(i64::from(image.width()) - 1);
        let y = (y as i64 + dy).min(i64::from(image.height()) - 1);
        rgb(image, x, y).unwrap_or([0; 3]).map(f64::from)
    };
    let [p, q, r, s] = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
    let mix = |i: usize| (1.0 - b) * ((1.0 - a) * p[i] + a * q[i]) + b * ((1.0 - a) * r[i] + a * s[i]);
    Some([0, 1, 2].map(|i| mix(i).round() as u8))
}

/// The value of the nearest pixel; `none` where there is none. Never a mean: between two depths or classes lies no third.
fn nearest<T: Copy>(grid: &Grid<T>, view: &OutputView, optics: &Optics, none: T) -> Grid<T> {
    let optics = optics.resized(grid.width, grid.height);
    let data = sources(view, &optics).map(|s| s.and_then(|(u, v)| grid.nearest(u, v)).unwrap_or(none)).collect();
    Grid { width: view.camera.width, height: view.camera.height, data }
}

/// The depth camera of an image of depth: a model, or a direction for every pixel.
#[derive(Debug, Clone, Copy)]
pub enum DepthCamera<'a> {
    /// A camera.
    Optics(Optics),
    /// Directions, row by row, any length.
    Rays(&'a [[f32; 3]]),
}

/// Depth along the optical axis of the output's camera, metres. `depth` is what `camera` measured, along its own axis or
/// along its rays; `color_from_depth` leads from it to the colour camera of the source.
#[must_use]
pub fn depth(
    depth: &Grid<f32>,
    along_ray: bool,
    camera: DepthCamera,
    color_from_depth: Option<&Pose>,
    view: &OutputView,
) -> Grid<f32> {
    let apart =
        color_from_depth.filter(|p| p.translation.vector.norm() > SAME_PLACE || p.rotation.angle() > SAME_PLACE);
    match (camera, apart) {
        (DepthCamera::Optics(optics), None) => {
            let optics = optics.resized(depth.width, depth.height);
            if along_ray {
                nearest(&along_axis(depth, &optics), view, &optics, 0.0)
            } else {
                nearest(depth, view, &optics, 0.0)
            }
        }
        (DepthCamera::Optics(optics), Some(pose)) => {
            let optics = optics.resized(depth.width, depth.height);
            let focal = 0.5 * (optics.fx + optics.fy);
            reprojected(depth, along_ray, |x, y| optics.direction(x as f64, y as f64), focal, pose, view)
        }
        (DepthCamera::Rays(rays), _) => {
            let ray = |x: usize, y: usize| {
                let [a, b, c] = *rays.get(y * depth.width + x)?;
                unit(&Vector::new(f64::from(a), f64::from(b), f64::from(c)))
            };
            let pose = color_from_depth.copied().unwrap_or_else(Pose::identity);
            reprojected(depth, along_ray, ray, ray_focal(rays, depth.width), &pose, view)
        }
    }
}

/// Pixels per unit of slope in the middle of a table of rays.
fn ray_focal(rays: &[[f32; 3]], width: usize) -> f64 {
    let middle = rays.len() / 2 + width / 2;
    let slope = |i: usize| rays.get(i).filter(|r| r[2] > 0.0).map(|r| f64::from(r[0] / r[2]));
    match (slope(middle), slope(middle + 1)) {
        (Some(a), Some(b)) if (b - a).abs() > 1e-9 => 1.0 / (b - a).abs(),
        _ => width as f64,
    }
}

/// Distances along rays as distances along the axis.
fn along_axis(depth: &Grid<f32>, optics: &Optics) -> Grid<f32> {
    let mut out = depth.clone();
    for (i, z) in out.data.iter_mut().enumerate() {
        if *z > 0.0 {
            let ray = optics.direction((i % depth.width) as f64, (i / depth.width) as f64);
            *z = ray.map_or(0.0, |r| (f64::from(*z) * r.z).max(0.0) as f32);
        }
    }
    out
}

/// Depth of another camera: each pixel a small square of its own size, the nearest one wins.
fn reprojected(
    depth: &Grid<f32>,
    along_ray: bool,
    ray: impl Fn(usize, usize) -> Option<Vector>,
    focal: f64,
    color_from_depth: &Pose,
    view: &OutputView,
) -> Grid<f32> {
    let camera = &view.camera;
    let output_from_source = view.source_from_output.inverse();
    let mut out = Grid::filled(camera.width, camera.height, 0.0f32);
    for y in 0..depth.height {
        for x in 0..depth.width {
            let Some(z) = depth.get(x, y).map(f64::from).filter(|z| *z > 0.0) else { continue };
            let Some(ray) = ray(x, y).filter(|r| r.z > 1e-3) else { continue };
            let length = if along_ray { z } else { z / ray.z };
            let p = output_from_source * (color_from_depth * Point::from(ray * length));
            let Some((u, v)) = camera.project(&p).filter(|&(u, v)| camera.contains(u, v)) else { continue };
            // Half of the pixel's width as the output sees it.
            let reach = (0.5 * camera.fx / focal * (length * ray.z) / p.z).clamp(0.0, 16.0);
            let low = |c: f64| (c - reach).round().max(0.0) as usize;
            let high = |c: f64, size: usize| ((c + reach).round().max(0.0) as usize).min(size.saturating_sub(1));
            for oy in low(v)..=high(v, camera.height) {
                for ox in low(u)..=high(u, camera.width) {
                    if let Some(d) = out.data.get_mut(oy * camera.width + ox)
                        && (*d == 0.0 || p.z < f64::from(*d))
                    {
                        *d = p.z as f32;
                    }
                }
            }
        }
    }
    out
}

/// Classes of the output's pixels from the layers of a mask.
///
/// # Errors
/// Where a layer cannot be decoded, or has another shape than the colour image.
pub fn mask(layers: &[Layer], view: &OutputView, optics: &Optics) -> Result<Grid<u8>> {
    let mut out = Grid::filled(view.camera.width, view.camera.height, 0u8);
    for layer in layers {
        let (grid, class) = match layer {
            Layer::Classes(blob) => (decode::grey(blob)?, None),
            Layer::Binary { class, blob } => {
                let image = decode::picture(blob)?.into_luma8();
                let (width, height) = (image.width() as usize, image.height() as usize);
                (Grid { width, height, data: image.into_raw() }, Some(*class))
            }
            Layer::Runs { class, width, height, runs } => (columns(*width, *height, runs), Some(*class)),
        };
        if !optics.has_shape(grid.width, grid.height) {
            let message = format!(
                "the mask is {} x {}, the colour image {} x {}: another shape",
                grid.width, grid.height, optics.width, optics.height
            );
            return Err(match layer {
                Layer::Classes(blob) | Layer::Binary { blob, .. } => blob.fault(message),
                Layer::Runs { .. } => crate::error::Error::Config(format!("import: {message}")),
            });
        }
        let seen = nearest(&grid, view, optics, 0);
        for (o, s) in out.data.iter_mut().zip(&seen.data) {
            if *s != 0 {
                *o = class.unwrap_or(*s);
            }
        }
    }
    Ok(out)
}

/// Runs of COCO, column by column, as pixels of 0 and 1. Runs beyond the image are cut.
fn columns(width: usize, height: usize, runs: &[u32]) -> Grid<u8> {
    // A mask that claims more than any image has is empty, and of no image's shape.
    if width.saturating_mul(height) > 64 << 20 {
        return Grid { width: 0, height: 0, data: Vec::new() };
    }
    let mut grid = Grid::filled(width, height, 0u8);
    let total = width * height;
    let mut at = 0usize;
    for (i, run) in runs.iter().enumerate() {
        let end = at.saturating_add(*run as usize).min(total);
        if i % 2 == 1 {
            for k in at..end {
                if let Some(pixel) = grid.data.get_mut((k % height) * width + k / height) {
                    *pixel = 1;
                }
            }
        }
        at = end;
    }
    grid
}

/// Normals in the output's camera, 8-bit RGB as recordings have them; 0 0 0 where there is none.
///
/// # Errors
/// Where the image cannot be decoded or has another shape than the colour image.
pub fn normals(blob: &super::blob::Blob, how: &Normals, view: &OutputView, optics: &Optics) -> Result<Vec<u8>> {
    let image = decode::picture(blob)?.into_rgb8();
    let (width, height) = (image.width() as usize, image.height() as usize);
    if !optics.has_shape(width, height) {
        return Err(blob.fault(format!(
            "is {width} x {height}, the colour image {} x {}: another shape",
            optics.width, optics.height
        )));
    }
    let grid = Grid { width, height, data: image.pixels().map(|p| p.0).collect() };
    let seen = nearest(&grid, view, optics, [0; 3]);
    let output_from_source = view.source_from_output.inverse();
    let turned = |p: &[u8; 3]| {
        let n = Vector::from_fn(|i, _| (f64::from(p[i]) - how.zero) * how.factor[i]);
        // What is far from unit length is a mark for "no value".
        if *p == [0; 3] || !(0.8..1.2).contains(&n.norm()) {
            return [0; 3];
        }
        let n = output_from_source * n.normalize();
        let n = if n.z > 0.0 { -n } else { n };
        [n.x, n.y, n.z].map(|c| (c * 127.0 + 128.0).round() as u8)
    };
    Ok(seen.data.iter().flat_map(turned).collect())
}

/// Segments in pixels of the output; those with an end outside are left out.
#[must_use]
pub fn segments(segments: &[Ends], view: &OutputView, optics: &Optics) -> Vec<Ends> {
    let place = |end: &[f64; 2]| {
        let ray = view.source_from_output.inverse() * optics.direction(end[0], end[1])?;
        view.camera.project(&Point::from(ray)).filter(|&(u, v)| view.camera.contains(u, v)).map(|(u, v)| [u, v])
    };
    segments.iter().filter_map(|[a, b]| Some([place(a)?, place(b)?])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::ImportOptions;
    use crate::import::optics::LensModel;

    fn optics() -> Optics {
        Optics::pinhole(64, 48, [40.0, 40.0, 31.5, 23.5])
    }

    /// A wall before the camera: z = 2 at every pixel.
    #[test]
    fn a_wall_stays_a_wall_for_any_lens_and_either_measure() {
        for lens in [LensModel::Pinhole, LensModel::Fisheye { k: [0.02, 0.0, 0.0, 0.0] }] {
            let camera = Optics { lens, ..optics() };
            let view = OutputView::of(&camera, &ImportOptions { fov_deg: Some(60.0), ..ImportOptions::default() });
            let mut ranges = Grid::filled(64, 48, 2.0f32);
            for (i, r) in ranges.data.iter_mut().enumerate() {
                let ray = camera.direction((i % 64) as f64, (i / 64) as f64).unwrap();
                *r = (2.0 / ray.z) as f32;
            }
            let out = depth(&ranges, true, DepthCamera::Optics(camera), None, &view);
            assert!(out.data.iter().all(|z| (z - 2.0).abs() < 0.1), "{lens:?}");
            // The middle is exact.
            let middle = out.get(view.camera.width / 2, view.camera.height / 2).unwrap();
            assert!((middle - 2.0).abs() < 2e-3, "{middle}");
        }
    }

    #[test]
    fn depth_from_beside_covers_the_image_without_holes() {
        let color_from_depth = Pose::translation(0.05, 0.0, 0.1);
        let small = Grid::filled(32, 24, 2.0f32);
        let view = OutputView::of(&optics(), &ImportOptions::default());
        let out = depth(&small, false, DepthCamera::Optics(optics().resized(32, 24)), Some(&color_from_depth), &view);
        let middle = out.get(32, 24).unwrap();
        assert!((middle - 2.1).abs() < 1e-5, "{middle}");
        let filled = (10..54).flat_map(|x| (8..40).map(move |y| (x, y))).all(|(x, y)| out.get(x, y).unwrap() > 0.0);
        assert!(filled);
    }

    #[test]
    fn coco_runs_go_down_the_columns() {
        let grid = columns(2, 3, &[1, 2, 1, 9]);
        assert_eq!(grid.data, [0, 0, 1, 1, 1, 1]);
    }

    #[test]
    fn an_image_that_is_the_outputs_stays_as_it_is() {
        let image = RgbImage::from_fn(64, 48, |x, y| image::Rgb([x as u8, y as u8, 7]));
        let view = OutputView::of(&optics(), &ImportOptions::default());
        assert!(view.is_same(&optics()));
        assert_eq!(color(&image, &view, &optics()), image.into_raw());
    }
}
