//! Other readings of the numbers of a pose.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

use crate::math::{Point, Pose};

/// What the numbers of a pose could mean instead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reading {
    /// What is declared.
    Declared,
    /// The whole transform the other way round: camera from world.
    Inverse,
    /// The rotation the other way round, the position right.
    TurnInverse,
    /// The rotation right, the translation that of the inverse.
    PlaceInverse,
    /// The four numbers of the quaternion with w last instead of first.
    WLast,
    /// The four numbers of the quaternion with w first instead of last.
    WFirst,
    /// Rotation angles that were taken for degrees and were radians: all rotations hardly turn.
    HardlyTurns,
}

impl Reading {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Declared => "the poses' numbers are read rightly",
            Self::Inverse => "the poses are inverted: they map the world into the camera",
            Self::TurnInverse => "the rotations of the poses are inverted, their positions are not",
            Self::PlaceInverse => "the positions are translations of camera_from_world, the rotations are not",
            Self::WLast => "the quaternions are in the order x y z w",
            Self::WFirst => "the quaternions are in the order w x y z, read as x y z w",
            Self::HardlyTurns => "the rotations hardly turn: radians were taken for degrees",
        }
    }

    /// What to do to the file.
    #[must_use]
    pub fn edit(self) -> &'static str {
        match self {
            Self::Declared => "",
            Self::Inverse => "invert every pose (rotation R^T, position -R^T t)",
            Self::TurnInverse => "invert every rotation (conjugate the quaternion)",
            Self::PlaceInverse => "replace every position t by -R t",
            Self::WLast => "write quaternions in the order w x y z",
            Self::WFirst => "read quaternions in the file's own order before they are written as w x y z",
            Self::HardlyTurns => "read rotation angles as radians",
        }
    }

    /// The declared pose under this reading.
    #[must_use]
    pub fn of(self, pose: &Pose) -> Pose {
        let (q, t) = (pose.rotation, pose.translation.vector);
        let c = q.quaternion().coords;
        let [i, j, k, w] = [c.x, c.y, c.z, c.w];
        let turned = |q: UnitQuaternion<f64>| Pose::from_parts(t.into(), q);
        match self {
            Self::Declared => *pose,
            Self::Inverse => pose.inverse(),
            Self::TurnInverse => turned(q.inverse()),
            Self::PlaceInverse => Pose::from_parts((-(q * t)).into(), q),
            // The file's numbers are [w, i, j, k]: the last one is w.
            Self::WLast => turned(UnitQuaternion::from_quaternion(Quaternion::new(k, w, i, j))),
            // The file's numbers are [i, j, k, w]: the first one is w.
            Self::WFirst => turned(UnitQuaternion::from_quaternion(Quaternion::new(i, j, k, w))),
            Self::HardlyTurns => turned(UnitQuaternion::from_scaled_axis(q.scaled_axis() * 1f64.to_degrees())),
        }
    }
}

/// All readings that poses can have had, beside the declared one.
#[must_use]
pub fn readings_of(poses: &[Pose]) -> Vec<(Reading, Vec<Pose>)> {
    let mut kinds =
        vec![Reading::Inverse, Reading::TurnInverse, Reading::PlaceInverse, Reading::WLast, Reading::WFirst];
    // Half a turn in degrees is 3.14 degrees when it is divided once more.
    if poses.iter().all(|p| p.rotation.angle() < std::f64::consts::PI / 57.0) {
        kinds.push(Reading::HardlyTurns);
    }
    kinds.into_iter().map(|kind| (kind, poses.iter().map(|p| kind.of(p)).collect())).collect()
}

/// All 48 ways in which three axes can be named and directed, the declared one first, then those that people mix up.
/// Rows: right, down, forward in the axes of the poses' camera.
pub(super) fn axes() -> Vec<Matrix3<f64>> {
    let diagonal = |x: f64, y: f64, z: f64| Matrix3::from_diagonal(&nalgebra::Vector3::new(x, y, z));
    let mut all = vec![
        diagonal(1.0, 1.0, 1.0),
        diagonal(1.0, -1.0, -1.0),
        diagonal(-1.0, 1.0, 1.0),
        diagonal(1.0, -1.0, 1.0),
        diagonal(1.0, 1.0, -1.0),
        diagonal(-1.0, -1.0, 1.0),
        diagonal(-1.0, 1.0, -1.0),
        diagonal(-1.0, -1.0, -1.0),
    ];
    let signs = all.clone();
    for [a, b, c] in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        let mut permuted: Matrix3<f64> = Matrix3::zeros();
        for (row, column) in [a, b, c].into_iter().enumerate() {
            permuted[(row, column)] = 1.0;
        }
        all.extend(signs.iter().map(|s| s * permuted));
    }
    all
}

/// Axes in words.
pub(super) fn axes_words(axes: &Matrix3<f64>) -> String {
    let row = |r: usize| {
        let names = ["x", "y", "z"];
        let at = (0..3).find(|c| axes[(r, *c)].abs() > 0.5).unwrap_or(0);
        let sign = if axes[(r, at)] < 0.0 { "-" } else { "+" };
        format!("{sign}{}", names[at])
    };
    let known = if is_opengl(axes) {
        " (OpenGL's axes)"
    } else if axes.determinant() < 0.0 {
        " (a mirror image)"
    } else if row(2) == "+x" {
        " (a robot's axes)"
    } else {
        ""
    };
    format!("the poses' camera has right = {}, down = {}, forward = {}{known}", row(0), row(1), row(2))
}

/// Whether only y and z are turned round.
pub(super) fn is_opengl(axes: &Matrix3<f64>) -> bool {
    (axes - Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, -1.0, -1.0))).norm() < 1e-9
}

/// A pose whose camera has these axes, as one of an OpenCV camera. A mirror image is mirrored as a whole: the world's x, too.
pub(super) fn with_axes(pose: &Pose, axes: &Matrix3<f64>) -> Pose {
    let mut world: Matrix3<f64> = Matrix3::identity();
    if axes.determinant() < 0.0 {
        world[(0, 0)] = -1.0;
    }
    let turn = world * pose.rotation.to_rotation_matrix().into_inner() * axes.transpose();
    let turn = nalgebra::Rotation3::from_matrix_unchecked(turn);
    let place = Point::from(world * pose.translation.vector);
    Pose::from_parts(place.coords.into(), UnitQuaternion::from_rotation_matrix(&turn))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vector;

    fn some_pose() -> Pose {
        Pose::from_parts(Vector::new(1.0, -2.0, 0.5).into(), UnitQuaternion::from_euler_angles(0.3, -0.7, 1.9))
    }

    #[test]
    fn every_misreading_is_undone_by_a_reading() {
        let pose = some_pose();
        for (wrong, right) in [
            (Reading::Inverse, Reading::Inverse),
            (Reading::TurnInverse, Reading::TurnInverse),
            (Reading::WLast, Reading::WFirst),
            (Reading::WFirst, Reading::WLast),
        ] {
            let back = right.of(&wrong.of(&pose));
            assert!((back.translation.vector - pose.translation.vector).norm() < 1e-9, "{wrong:?}");
            assert!(back.rotation.angle_to(&pose.rotation) < 1e-7, "{wrong:?}");
        }
    }

    #[test]
    fn there_are_48_axes_and_no_two_are_the_same() {
        let all = axes();
        assert_eq!(all.len(), 48);
        for (i, a) in all.iter().enumerate() {
            assert!((a.determinant().abs() - 1.0).abs() < 1e-12);
            assert!(all.iter().skip(i + 1).all(|b| (a - b).norm() > 0.5), "{a}");
        }
        assert!(axes_words(&all[1]).contains("down = -y, forward = -z (OpenGL"), "{}", axes_words(&all[1]));
        assert!(axes_words(&all[2]).contains("mirror image"), "{}", axes_words(&all[2]));
    }

    #[test]
    fn other_axes_keep_the_place_and_mirror_images_become_proper() {
        let pose = some_pose();
        for axes in axes() {
            let other = with_axes(&pose, &axes);
            let m = other.rotation.to_rotation_matrix().into_inner();
            assert!((m.determinant() - 1.0).abs() < 1e-9);
            assert!((other.translation.vector.norm() - pose.translation.vector.norm()).abs() < 1e-9);
        }
    }
}
