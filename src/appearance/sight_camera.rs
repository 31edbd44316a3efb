//! A pinhole camera in single precision.

use super::local::Local;
use crate::recording::Camera;

/// Nearer than this there are hands and hair, metres.
pub(super) const NEAREST_M: f32 = 0.15;

/// A pinhole camera in single precision.
#[derive(Debug, Clone, Copy)]
pub(super) struct SightCamera {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) focal: [f32; 2],
    pub(super) center: [f32; 2],
}

impl SightCamera {
    pub(super) fn of(camera: &Camera) -> Self {
        Self {
            width: camera.width,
            height: camera.height,
            focal: [camera.fx as f32, camera.fy as f32],
            center: [camera.cx as f32, camera.cy as f32],
        }
    }

    /// Pixel of a point before the camera.
    pub(super) fn project(&self, p: &Local) -> [f32; 2] {
        let inverse = 1.0 / p.z;
        [self.focal[0] * p.x * inverse + self.center[0], self.focal[1] * p.y * inverse + self.center[1]]
    }

    /// Whether some of a ball (camera frame) may be in the image.
    pub(super) fn meets(&self, middle: &Local, radius: f32) -> bool {
        if middle.z + radius < NEAREST_M {
            return false;
        }
        // Distance to each side plane of the frustum, which runs through the eye.
        let beyond = |along: f32, focal: f32, low: f32, high: f32| {
            let side = |edge: f32, sense: f32| {
                let slope = edge / focal;
                sense * (along - slope * middle.z) / slope.hypot(1.0) > radius
            };
            side(low, -1.0) || side(high, 1.0)
        };
        let [w, h] = [self.width as f32, self.height as f32];
        !beyond(middle.x, self.focal[0], -0.5 - self.center[0], w - 0.5 - self.center[0])
            && !beyond(middle.y, self.focal[1], -0.5 - self.center[1], h - 0.5 - self.center[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn balls_outside_the_image_are_told_from_those_at_its_rim() {
        let lens = SightCamera { width: 100, height: 80, focal: [50.0; 2], center: [49.5, 39.5] };
        for (middle, radius, expected) in [
            ([0.0, 0.0, 2.0], 0.1, true),
            ([2.1, 0.0, 2.0], 0.2, true),
            ([2.5, 0.0, 2.0], 0.2, false),
            ([0.0, -3.0, 2.0], 0.2, false),
            ([0.0, 0.0, -1.0], 0.2, false),
        ] {
            assert_eq!(lens.meets(&Local::from(middle), radius), expected, "{middle:?}");
        }
    }
}
