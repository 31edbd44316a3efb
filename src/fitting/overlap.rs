//! Boxes that must not share space.

use parry3d::math::Pose as ParryPose;
use parry3d::query;
use parry3d::shape::Cuboid;

use crate::config;
use crate::geometry::Face;
use crate::geometry::Rect;
use crate::twin::{Furniture, OrientedBox};

/// Numerics: overlap below this is contact, not shared space, metres; single precision tells no less.
const CONTACT_M: f64 = 1e-4;

/// Whether two boxes share space.
#[must_use]
pub fn boxes(a: &OrientedBox, b: &OrientedBox) -> bool {
    // Most pairs are far apart, which their spheres tell.
    if (a.center - b.center).norm_squared() > (a.half.norm() + b.half.norm()).powi(2) {
        return false;
    }
    let shrunk = |o: &OrientedBox| {
        let h = o.half.map(|h| (h - 0.5 * CONTACT_M).max(1e-6)).cast::<f32>();
        Cuboid::new(h.into())
    };
    let pose = |o: &OrientedBox| -> ParryPose { o.pose().cast::<f32>().into() };
    query::intersection_test(&pose(a), &shrunk(a), &pose(b), &shrunk(b)).is_ok_and(|hit| hit.intersecting)
}

/// Whether a box shares space with a piece of furniture, closed.
#[must_use]
pub fn with(piece: &Furniture, shape: &OrientedBox) -> bool {
    piece.carcass.iter().chain(&piece.part.solids).any(|s| boxes(&s.shape, shape))
}

/// Whether two pieces of furniture share space, closed.
#[must_use]
pub fn furniture(a: &Furniture, b: &Furniture) -> bool {
    b.carcass.iter().chain(&b.part.solids).any(|s| with(a, &s.shape))
}

/// Cuts rectangles of one plane that overlap at the middle of the overlap, across its narrower direction.
pub fn separate(rects: &mut [(Face, Rect)], boards: &config::Boards) {
    // Faces of one front: parallel within 10 degrees and within a few boards of one plane.
    let plane_m = 3.0 * boards.thickness_m;
    for i in 0..rects.len() {
        for j in 0..i {
            let (a, b) = (rects[i], rects[j]);
            let parallel = a.0.normal.dot(&b.0.normal) > 10f64.to_radians().cos();
            let [dr, du, dn] = a.0.coordinates(&b.0.center);
            if !parallel || dn.abs() > plane_m {
                continue;
            }
            // The other rectangle in this one's coordinates; both are upright, so only the offset matters.
            let other = [b.1.bounds[0].map(|x| x + dr), b.1.bounds[1].map(|x| x + du)];
            let overlap = [0, 1].map(|k| (a.1.bounds[k][1].min(other[k][1])) - (a.1.bounds[k][0].max(other[k][0])));
            if overlap.iter().any(|o| *o <= 0.0) {
                continue;
            }
            let k = usize::from(overlap[1] < overlap[0]);
            let shift = if k == 0 { dr } else { du };
            let mine_is_lower = a.1.bounds[k][0] + a.1.bounds[k][1] < other[k][0] + other[k][1];
            let (low, high) = (a.1.bounds[k][0].max(other[k][0]), a.1.bounds[k][1].min(other[k][1]));
            // One inside the other along this direction: the larger gives way up to the smaller's near edge.
            let inside = |inner: [f64; 2], outer: [f64; 2]| inner[0] >= outer[0] && inner[1] <= outer[1];
            let (mut mine, mut theirs) = (a.1.bounds[k], other[k]);
            if inside(theirs, mine) {
                mine[usize::from(mine_is_lower)] = if mine_is_lower { low } else { high };
            } else if inside(mine, theirs) {
                theirs[usize::from(!mine_is_lower)] = if mine_is_lower { high } else { low };
            } else {
                let cut = 0.5 * (low + high);
                mine[usize::from(mine_is_lower)] = cut;
                theirs[usize::from(!mine_is_lower)] = cut;
            }
            rects[i].1.bounds[k] = mine;
            rects[j].1.bounds[k] = theirs.map(|x| x - shift);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Point, Vector};

    #[test]
    fn neighbours_share_their_edge() {
        let face = |x: f64| Face {
            center: Point::new(x, 0.0, 0.0),
            right: Vector::x(),
            up: Vector::z(),
            normal: -Vector::y(),
            extent: [[0.0; 2]; 2],
            support: 1.0,
        };
        let mut rects = [
            (face(0.0), Rect { bounds: [[-0.3, 0.3], [-0.2, 0.2]] }),
            (face(0.5), Rect { bounds: [[-0.24, 0.3], [-0.2, 0.2]] }),
        ];
        separate(&mut rects, &config::Boards::default());
        assert!((rects[0].1.bounds[0][1] - 0.28).abs() < 1e-12);
        assert!((rects[1].1.bounds[0][0] + 0.22).abs() < 1e-12);
        assert_eq!(rects[0].1.bounds[1], [-0.2, 0.2]);
    }

    #[test]
    fn a_small_part_inside_a_large_one_stays_whole() {
        let face = Face {
            center: Point::origin(),
            right: Vector::x(),
            up: Vector::z(),
            normal: -Vector::y(),
            extent: [[0.0; 2]; 2],
            support: 1.0,
        };
        let mut rects =
            [(face, Rect { bounds: [[-0.3, 0.3], [-0.4, 0.4]] }), (face, Rect { bounds: [[-0.3, 0.3], [0.04, 0.2]] })];
        separate(&mut rects, &config::Boards::default());
        assert_eq!(rects[1].1.bounds[1], [0.04, 0.2]);
        assert_eq!(rects[0].1.bounds[1], [-0.4, 0.04]);
    }
}
