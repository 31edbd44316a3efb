//! The front face of the touched furniture: its plane, its own axes, its visible extent.

use serde::{Deserialize, Serialize};

use super::manhattan::ManhattanFrame;
use crate::config;
use crate::localization::Region;
use crate::math::plane::Plane;
use crate::math::ransac::{Search, lo_ransac};
use crate::math::stats::quantile;
use crate::math::{Point, Vector, any_orthogonal, reject, unit};

/// A front face with a right-handed frame (`right`, `up`, `normal`) seen from the person's side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// The grip projected onto the face: origin of the face's coordinates.
    pub center: Point,
    /// To the viewer's right, in the face.
    pub right: Vector,
    /// Up in the face; on a lid, away from the person.
    pub up: Vector,
    /// Out of the furniture.
    pub normal: Vector,
    /// Visible extent `[right, up][min, max]` of the region in face coordinates, metres. It covers the whole piece of
    /// furniture where masks do.
    pub extent: [[f64; 2]; 2],
    /// Share of the region's points near the grip that lie on the plane.
    pub support: f64,
}

impl Face {
    /// Face coordinates (right, up, out) of a world point.
    #[must_use]
    pub fn coordinates(&self, p: &Point) -> [f64; 3] {
        let d = p - self.center;
        [d.dot(&self.right), d.dot(&self.up), d.dot(&self.normal)]
    }

    /// World point at face coordinates.
    #[must_use]
    pub fn point(&self, right: f64, up: f64, out: f64) -> Point {
        self.center + self.right * right + self.up * up + self.normal * out
    }

    /// Whether the face is nearer to horizontal than to vertical: a lid, a chest.
    #[must_use]
    pub fn is_horizontal(&self, world_up: &Vector) -> bool {
        self.normal.dot(world_up).abs() > 0.7
    }
}

/// Points this near to the grip vote for the face's plane.
const NEIGHBOURHOOD_M: f64 = 0.45;

/// Fits the face that the grip stands off, oriented to the viewpoint. `None` where no plane is near the grip.
#[must_use]
pub fn fit(
    region: &Region,
    manhattan: Option<&ManhattanFrame>,
    world_up: &Vector,
    config: &config::Geometry,
    seed: u64,
) -> Option<Face> {
    let near: Vec<Point> =
        region.points.iter().copied().filter(|p| (p - region.grip).norm() < NEIGHBOURHOOD_M).collect();
    // Every n-th point is enough for a plane, and keeps the cost independent of the image size.
    let near: Vec<Point> = near.iter().copied().step_by((near.len() / 3000).max(1)).collect();
    if near.len() < 30 {
        return None;
    }
    let tolerance = config.face_tolerance_m;
    // How well a plane explains the surroundings, and how well the grip stands where hands hold handles.
    let score = |plane: &Plane| {
        let share = near.iter().filter(|p| plane.height(p).abs() <= tolerance).count() as f64 / near.len() as f64;
        let standoff = (plane.height(&region.grip) - config.grip_standoff_m) / 0.05;
        share * (0.15 + 0.85 * (-0.5 * standoff * standoff).exp())
    };
    let refine = |plane: Plane| {
        let inliers: Vec<Point> = near.iter().copied().filter(|p| plane.height(p).abs() <= tolerance).collect();
        Plane::fit(&inliers).map_or(plane, |p| p.facing(&region.viewpoint))
    };
    let mut candidates: Vec<Plane> = Vec::new();
    for axis in manhattan.iter().flat_map(|m| m.axes) {
        let normal = if (region.viewpoint - region.grip).dot(&axis) < 0.0 { -axis } else { axis };
        let mut heights: Vec<f64> = near.iter().map(|p| normal.dot(&p.coords)).collect();
        heights.sort_by(f64::total_cmp);
        let best = densest(&heights, 2.0 * tolerance).map(|offset| Plane { normal, offset });
        candidates.extend(best);
        candidates.extend(best.map(refine));
    }
    // Furniture turned against the room, or no room frame at all: planes from the points themselves. Several rounds, each
    // without the points that the planes before it explained.
    let mut left: Vec<Point> = near.clone();
    for round in 0..3 {
        let found = lo_ransac::<Plane, 3>(
            left.len(),
            Search { draws: 120, tolerance, seed: seed ^ round },
            |s| Plane::through(&left[s[0]], &left[s[1]], &left[s[2]]),
            |ids| Plane::fit(&ids.iter().map(|&i| left[i]).collect::<Vec<_>>()),
            |plane, i| plane.height(&left[i]),
        );
        let Some(found) = found else { break };
        candidates.push(found.model.facing(&region.viewpoint));
        left.retain(|p| found.model.height(p).abs() > 2.0 * tolerance);
        if left.len() < 30 {
            break;
        }
    }
    let plane = candidates.into_iter().max_by(|a, b| score(a).total_cmp(&score(b)))?;
    let support = near.iter().filter(|p| plane.height(p).abs() <= tolerance).count() as f64 / near.len() as f64;
    // A tenth of the neighbourhood on the plane by chance is easy; a face fills far more.
    if support < 0.1 {
        return None;
    }
    let normal = plane.normal;
    let up = face_up(&normal, world_up, &(region.viewpoint - region.grip));
    let right = up.cross(&normal);
    let mut face = Face { center: plane.project(&region.grip), right, up, normal, extent: [[0.0; 2]; 2], support };
    let on_face: Vec<[f64; 3]> = region
        .points
        .iter()
        .map(|p| face.coordinates(p))
        .filter(|c| c[2].abs() <= config.face_tolerance_m + 0.02)
        .collect();
    for axis in 0..2 {
        let values: Vec<f64> = on_face.iter().map(|c| c[axis]).collect();
        face.extent[axis] = [quantile(&values, 0.02)?.min(0.0), quantile(&values, 0.98)?.max(0.0)];
    }
    Some(face)
}

/// Up within the face; on a lid, away from the person.
fn face_up(normal: &Vector, world_up: &Vector, towards_person: &Vector) -> Vector {
    let reference = if normal.dot(world_up).abs() > 0.7 { -towards_person } else { *world_up };
    unit(&reject(&reference, normal)).unwrap_or_else(|| any_orthogonal(normal))
}

/// Middle of the densest window of a sorted list.
fn densest(sorted: &[f64], window: f64) -> Option<f64> {
    let mut best: Option<(usize, f64)> = None;
    let mut start = 0;
    for end in 0..sorted.len() {
        while sorted[end] - sorted[start] > window {
            start += 1;
        }
        let count = end - start + 1;
        if best.is_none_or(|b| count > b.0) {
            best = Some((count, 0.5 * (sorted[start] + sorted[end])));
        }
    }
    best.map(|b| b.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cabinet front at y = 0 with a worktop above it: the front is the face, its frame looks at the person.
    #[test]
    fn the_front_is_chosen_over_the_worktop() {
        let mut points = Vec::new();
        for i in 0..40 {
            for j in 0..40 {
                let (a, b) = (f64::from(i) * 0.02 - 0.4, f64::from(j) * 0.02);
                points.push(Point::new(a, 0.0, b));
                points.push(Point::new(a, b, 0.82));
            }
        }
        let region = Region {
            voxel_m: 0.05,
            voxels: vec![],
            min_views: 4,
            points,
            class: None,
            local_frames: vec![],
            viewpoint: Point::new(0.2, -0.8, 1.6),
            grip: Point::new(0.05, -0.035, 0.7),
        };
        let face = fit(&region, None, &Vector::z(), &config::Geometry::default(), 0).unwrap();
        assert!((face.normal + Vector::y()).norm() < 1e-6, "{face:?}");
        assert!((face.right - Vector::x()).norm() < 1e-6 && (face.up - Vector::z()).norm() < 1e-6);
        assert!((face.coordinates(&Point::new(0.05, -0.035, 0.7))[2] - 0.035).abs() < 1e-9);
        assert!((face.extent[0][0] + 0.45).abs() < 0.03 && (face.extent[1][1] - 0.1).abs() < 0.05, "{face:?}");
    }
}
