//! The pinhole camera of the output.

use nalgebra::UnitQuaternion;

use super::choices::ImportOptions;
use super::optics::{LensModel, Optics, scaled_center};
use crate::math::Vector;
use crate::recording::Camera;

/// Field of view that a fisheye's output gets where nothing is asked, degrees: beyond it a pinhole image is mostly rim, and
/// hands at work are within it.
const FISHEYE_FOV_DEG: f64 = 100.0;
/// The widest field of view that a pinhole image can have here, degrees: at 150 the rim is stretched 15 times.
const MAX_FOV_DEG: f64 = 150.0;

/// The output's camera and how it is turned against the source's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputView {
    /// The pinhole camera of the output.
    pub camera: Camera,
    /// Turns directions of the output's camera into the source's: about the optical axis only.
    pub source_from_output: UnitQuaternion<f64>,
}

impl OutputView {
    /// The camera of the output for a source's: a pinhole, not wider than asked, never enlarged, fisheyes cut to a field of
    /// view, turned by quarters.
    #[must_use]
    pub fn of(optics: &Optics, options: &ImportOptions) -> Self {
        let quarters = options.rotate_quarters % 4;
        let (w, h) = (optics.width as f64, optics.height as f64);
        // Clockwise: what was the left side is the top.
        let (width, height, fx, fy, cx, cy) = match quarters {
            1 => (h, w, optics.fy, optics.fx, h - 1.0 - optics.cy, optics.cx),
            2 => (w, h, optics.fx, optics.fy, w - 1.0 - optics.cx, h - 1.0 - optics.cy),
            3 => (h, w, optics.fy, optics.fx, optics.cy, w - 1.0 - optics.cx),
            _ => (w, h, optics.fx, optics.fy, optics.cx, optics.cy),
        };
        let limit_deg = options.fov_deg.or(optics.is_fisheye().then_some(FISHEYE_FOV_DEG));
        let seen_deg = if quarters.is_multiple_of(2) {
            field_deg(optics, [(-0.5, optics.cy), (w - 0.5, optics.cy)])
        } else {
            field_deg(optics, [(optics.cx, -0.5), (optics.cx, h - 0.5)])
        };
        let most = options.width.clamp(16, 8192) as f64;
        let camera = match limit_deg.map(|d| d.clamp(10.0, MAX_FOV_DEG)) {
            Some(limit) if optics.is_fisheye() || seen_deg.is_none_or(|seen| seen > limit) => {
                let half = (0.5 * limit.min(seen_deg.unwrap_or(limit))).to_radians().tan();
                let out = most.min(width).min((2.0 * fx * half).floor().max(16.0));
                let focal = 0.5 * out / half;
                let rows = (out * height / width).round().max(1.0);
                pinhole(out, rows, [focal, focal, 0.5 * (out - 1.0), 0.5 * (rows - 1.0)])
            }
            _ => {
                let out = most.min(width);
                let rows = (out * height / width).round().max(1.0);
                let (sx, sy) = (out / width, rows / height);
                pinhole(out, rows, [fx * sx, fy * sy, scaled_center(cx, sx), scaled_center(cy, sy)])
            }
        };
        let angle = -std::f64::consts::FRAC_PI_2 * f64::from(quarters);
        Self { camera, source_from_output: UnitQuaternion::from_scaled_axis(Vector::z() * angle) }
    }

    /// Direction in the source camera's frame of a pixel of the output; its z is 1.
    #[must_use]
    pub fn ray(&self, u: f64, v: f64) -> Vector {
        self.source_from_output * self.camera.unproject(u, v, 1.0).coords
    }

    /// Whether an image of the source's camera is the output's as it is.
    #[must_use]
    pub fn is_same(&self, optics: &Optics) -> bool {
        let c = &self.camera;
        let near = |a: f64, b: f64| (a - b).abs() < 1e-6;
        optics.lens == LensModel::Pinhole
            && (optics.width, optics.height) == (c.width, c.height)
            && near(optics.fx, c.fx)
            && near(optics.fy, c.fy)
            && near(optics.cx, c.cx)
            && near(optics.cy, c.cy)
            && self.source_from_output.angle() < 1e-9
    }
}

fn pinhole(width: f64, height: f64, [fx, fy, cx, cy]: [f64; 4]) -> Camera {
    Camera { width: width as usize, height: height as usize, fx, fy, cx, cy }
}

/// Angle between two pixels' rays and the optical axis, added, degrees; `None` where the lens does not reach that far.
fn field_deg(optics: &Optics, ends: [(f64, f64); 2]) -> Option<f64> {
    let mut sum = 0.0;
    for (u, v) in ends {
        sum += optics.direction(u, v)?.z.clamp(-1.0, 1.0).acos();
    }
    Some(sum.to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point;

    #[test]
    fn a_quarter_turn_puts_the_left_side_on_top() {
        let optics = Optics::pinhole(640, 480, [400.0, 410.0, 310.0, 250.0]);
        let options = ImportOptions { rotate_quarters: 1, ..ImportOptions::default() };
        let view = OutputView::of(&optics, &options);
        assert_eq!((view.camera.width, view.camera.height), (480, 640));
        // The source's pixel (0, 100) is in the first row of the output, 100 from its right side.
        let ray = view.ray(479.0 - 100.0, 0.0);
        let (u, v) = optics.project(&Point::from(ray)).unwrap();
        assert!((u - 0.0).abs() < 1e-9 && (v - 100.0).abs() < 1e-9, "{u} {v}");
    }

    #[test]
    fn output_is_never_larger_than_the_source_and_fisheyes_are_cut() {
        let small = OutputView::of(&Optics::pinhole(320, 240, [200.0, 200.0, 159.5, 119.5]), &ImportOptions::default());
        assert_eq!((small.camera.width, small.camera.fx), (320, 200.0));
        let fish = Optics {
            lens: LensModel::Fisheye { k: [0.0; 4] },
            ..Optics::pinhole(1408, 1408, [610.0, 610.0, 703.5, 703.5])
        };
        let view = OutputView::of(&fish, &ImportOptions::default());
        let fov = 2.0 * (0.5 * view.camera.width as f64 / view.camera.fx).atan().to_degrees();
        assert!((fov - FISHEYE_FOV_DEG).abs() < 1e-6 && view.camera.fx < 610.0, "{fov}");
    }
}
