//! A ray caster for boxes: colour, depth, normals and classes.

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use nalgebra::Matrix3;

use super::kitchen::ColoredBox;
use super::materials::{Coat, SurfacePlace};
use crate::error::{Error, Result};
use crate::math::{Pose, Vector};
use crate::recording::Camera;

/// One rendered frame, row-major.
#[derive(Debug, Clone)]
pub struct Rendering {
    /// Colour.
    pub rgb: Vec<[u8; 3]>,
    /// Depth along the optical axis, metres; 0 = nothing hit.
    pub depth: Vec<f32>,
    /// Unit normals in the camera frame, facing the camera; zero = nothing hit.
    pub normals: Vec<[f32; 3]>,
    /// Mask class.
    pub classes: Vec<u8>,
}

/// Where a ceiling lamp behind the person's shoulder is, world: a unit vector.
#[must_use]
pub fn lamp() -> Vector {
    Vector::new(0.25, 0.35, 0.9).normalize()
}

/// Casts a ray through every pixel.
#[must_use]
pub fn cast(blocks: &[ColoredBox], world_from_camera: &Pose, camera: &Camera) -> Rendering {
    cast_under(&lamp(), blocks, world_from_camera, camera)
}

/// The same under a lamp in a direction of the world, a unit vector.
#[must_use]
pub fn cast_under(light: &Vector, blocks: &[ColoredBox], world_from_camera: &Pose, camera: &Camera) -> Rendering {
    trace(light, blocks, world_from_camera, camera).0
}

/// The same where boxes have materials: one each, from the first box on; further boxes stay flat. Depth, normals and classes are
/// those of flat boxes.
#[must_use]
pub(super) fn cast_coated(
    light: &Vector,
    blocks: &[ColoredBox],
    coats: &[Coat],
    world_from_camera: &Pose,
    camera: &Camera,
) -> Rendering {
    let (mut picture, seen) = trace(light, blocks, world_from_camera, camera);
    let camera_from_world = world_from_camera.inverse();
    let coated: Vec<(&Coat, (Matrix3<f64>, Vector))> =
        coats.iter().zip(blocks.iter().map(|block| in_camera(block, &camera_from_world))).collect();
    for (i, (coat, (rotation, center))) in
        seen.iter().enumerate().filter_map(|(i, block)| Some((i, coated.get(*block)?)))
    {
        let ray = ray(i % camera.width, i / camera.width, camera);
        let z = f64::from(picture.depth[i]);
        let normal = Vector::from(picture.normals[i].map(f64::from));
        let cosine = -normal.dot(&ray) / ray.norm();
        let place = SurfacePlace::new(rotation * ray * z - center, (rotation * normal).iamax(), cosine, z / camera.fx);
        if let Some(color) = coat.color_at(&place) {
            let shade = shade(&(world_from_camera.rotation * normal), light);
            picture.rgb[i] = color.map(|c| (c * shade).clamp(0.0, 255.0) as u8);
        }
    }
    picture
}

/// The picture, and the number of the box that each pixel shows; `usize::MAX` for none.
fn trace(light: &Vector, blocks: &[ColoredBox], world_from_camera: &Pose, camera: &Camera) -> (Rendering, Vec<usize>) {
    let count = camera.width * camera.height;
    let mut picture = Rendering {
        rgb: vec![[225, 228, 232]; count],
        depth: vec![0.0; count],
        normals: vec![[0.0; 3]; count],
        classes: vec![0; count],
    };
    let mut seen = vec![usize::MAX; count];
    let camera_from_world = world_from_camera.inverse();
    for (number, block) in blocks.iter().enumerate() {
        let (rotation, center) = in_camera(block, &camera_from_world);
        let (x_range, y_range) = pixel_bounds(block, &camera_from_world, camera);
        for y in y_range {
            for x in x_range.clone() {
                let direction = rotation * ray(x, y, camera);
                let Some((z, axis)) = hit(&center, &direction, &block.shape.half) else { continue };
                let i = y * camera.width + x;
                if picture.depth[i] > 0.0 && z as f32 >= picture.depth[i] {
                    continue;
                }
                let sign = -direction[axis].signum();
                let mut local = Vector::zeros();
                local[axis] = sign;
                let normal = rotation.transpose() * local;
                let shade = shade(&(world_from_camera.rotation * normal), light);
                seen[i] = number;
                picture.depth[i] = z as f32;
                picture.normals[i] = [normal.x as f32, normal.y as f32, normal.z as f32];
                picture.classes[i] = block.class;
                picture.rgb[i] = block.color.map(|c| (f64::from(c) * shade).clamp(0.0, 255.0) as u8);
            }
        }
    }
    (picture, seen)
}

/// A box in the camera frame: from the camera's axes to its own, and its middle in the latter. Rays start at the origin with z = 1,
/// so their parameter is the depth.
fn in_camera(block: &ColoredBox, camera_from_world: &Pose) -> (Matrix3<f64>, Vector) {
    let rotation = (camera_from_world.rotation.to_rotation_matrix().matrix() * block.shape.rotation).transpose();
    let center = rotation * (camera_from_world * block.shape.center).coords;
    (rotation, center)
}

/// The ray of a pixel in the camera frame, z = 1.
fn ray(x: usize, y: usize, camera: &Camera) -> Vector {
    Vector::new((x as f64 - camera.cx) / camera.fx, (y as f64 - camera.cy) / camera.fy, 1.0)
}

/// How bright a side with a normal is under a lamp; both in the world, unit vectors.
fn shade(normal: &Vector, light: &Vector) -> f64 {
    0.55 + 0.45 * normal.dot(light).max(0.0) - 0.12 * (-normal.z).max(0.0)
}

/// Gaussian blur of a row-major image; nothing happens for a standard deviation of 0 pixels.
pub(super) fn blur(rgb: &mut [[u8; 3]], width: usize, sigma_px: f64) {
    if sigma_px <= 0.0 || width == 0 {
        return;
    }
    let reach = (2.5 * sigma_px).ceil() as i64;
    let weights: Vec<f32> = (-reach..=reach).map(|d| (-0.5 * (d as f64 / sigma_px).powi(2)).exp() as f32).collect();
    let total: f32 = weights.iter().sum();
    let height = rgb.len() / width;
    for is_row in [true, false] {
        let before = rgb.to_vec();
        for (i, pixel) in rgb.iter_mut().enumerate() {
            let (x, y) = (i % width, i / width);
            let (at, size) = if is_row { (x, width) } else { (y, height) };
            let mut sum = [0.0f32; 3];
            for (d, weight) in (-reach..=reach).zip(&weights) {
                let there = (at as i64 + d).clamp(0, size as i64 - 1) as usize;
                let from = if is_row { y * width + there } else { there * width + x };
                for (s, c) in sum.iter_mut().zip(before[from]) {
                    *s += weight * f32::from(c);
                }
            }
            *pixel = sum.map(|s| (s / total).round() as u8);
        }
    }
}

/// Nearest positive ray parameter at which a ray from the origin enters a box at `center` (box axes), and the entered side.
fn hit(center: &Vector, direction: &Vector, half: &Vector) -> Option<(f64, usize)> {
    let (mut enter, mut leave, mut axis) = (NEAR_M, f64::INFINITY, usize::MAX);
    for k in 0..3 {
        let d = direction[k];
        if d.abs() < 1e-12 {
            if center[k].abs() > half[k] {
                return None;
            }
            continue;
        }
        let (a, b) = ((center[k] - half[k]) / d, (center[k] + half[k]) / d);
        let (near, far) = if a < b { (a, b) } else { (b, a) };
        if near > enter {
            (enter, axis) = (near, k);
        }
        leave = leave.min(far);
        if enter > leave {
            return None;
        }
    }
    (axis < 3).then_some((enter, axis))
}

/// Nothing nearer to the camera than this is seen, metres.
const NEAR_M: f64 = 0.02;

/// Pixels that a box may cover.
fn pixel_bounds(
    block: &ColoredBox,
    camera_from_world: &Pose,
    camera: &Camera,
) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
    let corners = block.shape.corners().map(|c| camera_from_world * c);
    if corners.iter().all(|c| c.z < NEAR_M) {
        return (0..0, 0..0);
    }
    // What lies before the camera: the corners there, and where edges that reach behind it pass the near plane. Edges join
    // corners whose numbers differ in one bit.
    let before = corners.iter().filter(|c| c.z >= NEAR_M).copied();
    let crossings = (0..8).flat_map(|i| [1, 2, 4].map(|bit| (i, i ^ bit))).filter_map(|(i, j)| {
        let (a, b) = (corners[i], corners[j]);
        (a.z >= NEAR_M && b.z < NEAR_M).then(|| a + (b - a) * ((a.z - NEAR_M) / (a.z - b.z)))
    });
    let mut low = [f64::INFINITY; 2];
    let mut high = [f64::NEG_INFINITY; 2];
    for p in before.chain(crossings) {
        let (u, v) = (camera.fx * p.x / p.z + camera.cx, camera.fy * p.y / p.z + camera.cy);
        low = [low[0].min(u), low[1].min(v)];
        high = [high[0].max(u), high[1].max(v)];
    }
    let range = |k: usize, size: usize| {
        let from = low[k].floor().clamp(0.0, size as f64) as usize;
        let to = (high[k].ceil() + 1.0).clamp(0.0, size as f64) as usize;
        from..to.max(from)
    };
    (range(0, camera.width), range(1, camera.height))
}

/// The files of a frame: (name, bytes).
///
/// # Errors
/// Where an image cannot be encoded, which would be a bug.
pub fn encode(
    picture: &Rendering,
    camera: &Camera,
    frame: usize,
    with_normals: bool,
) -> Result<Vec<(String, Vec<u8>)>> {
    let (w, h) = (camera.width as u32, camera.height as u32);
    let fail = |e: image::ImageError| Error::Export(format!("frame {frame}: {e}"));
    let mut files = Vec::new();
    let mut jpeg = Vec::new();
    let rgb: Vec<u8> = picture.rgb.iter().flatten().copied().collect();
    JpegEncoder::new_with_quality(&mut jpeg, 90).write_image(&rgb, w, h, ExtendedColorType::Rgb8).map_err(fail)?;
    files.push((format!("frames/{frame:06}.jpg"), jpeg));
    let png = |data: &[u8], color: ExtendedColorType| -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
            .write_image(data, w, h, color)
            .map_err(fail)?;
        Ok(bytes)
    };
    let depth: Vec<u8> =
        picture.depth.iter().flat_map(|z| ((z * 1000.0).round().clamp(0.0, 65535.0) as u16).to_ne_bytes()).collect();
    files.push((format!("depth/{frame:06}.png"), png(&depth, ExtendedColorType::L16)?));
    files.push((format!("masks/{frame:06}.png"), png(&picture.classes, ExtendedColorType::L8)?));
    if with_normals {
        let normals: Vec<u8> = picture
            .normals
            .iter()
            .flat_map(|n| if *n == [0.0; 3] { [0; 3] } else { n.map(|c| (c * 127.0 + 128.0).round() as u8) })
            .collect();
        files.push((format!("normals/{frame:06}.png"), png(&normals, ExtendedColorType::Rgb8)?));
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point;
    use crate::twin::OrientedBox;

    #[test]
    fn a_blurred_point_keeps_its_light_and_spreads_evenly() {
        let mut rgb = vec![[0u8; 3]; 21 * 21];
        rgb[10 * 21 + 10] = [250; 3];
        blur(&mut rgb, 21, 0.8);
        let sum: u32 = rgb.iter().map(|p| u32::from(p[1])).sum();
        assert!((240..=260).contains(&sum), "{sum}");
        let at = |x: usize, y: usize| rgb[y * 21 + x][0];
        assert!(at(9, 10) == at(11, 10) && at(10, 9) == at(10, 11) && at(11, 10) < at(10, 10) && at(11, 10) > 10);
        // Rows are rounded to whole levels before columns are blurred.
        assert!(at(10, 9).abs_diff(at(11, 10)) <= 1);
    }

    #[test]
    fn a_wall_two_metres_ahead_is_two_metres_deep_everywhere() {
        let camera = Camera { width: 32, height: 24, fx: 20.0, fy: 20.0, cx: 15.5, cy: 11.5 };
        let wall = ColoredBox {
            shape: OrientedBox {
                center: Point::new(0.0, 0.0, 2.5),
                half: Vector::new(9.0, 9.0, 0.5),
                rotation: nalgebra::Matrix3::identity(),
            },
            color: [100; 3],
            class: 3,
        };
        let p = cast(&[wall], &Pose::identity(), &camera);
        assert!(p.depth.iter().all(|z| (z - 2.0).abs() < 1e-6));
        assert!(p.normals.iter().all(|n| n[2] < -0.999) && p.classes.iter().all(|c| *c == 3));
    }
}
