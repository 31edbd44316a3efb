//! Axes, handedness, directions and quaternion orders: the one place where they change.
//!
//! A capture's poses become `world_from_camera` with OpenCV cameras, metres where the source is metric, in the source's world
//! made right-handed. [`upright`] then turns a world to +Z up.

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};

use super::capture::{CameraAxes, Capture, Direction, Poses, QuaternionOrder, RawPose, RawRotation, SourceWorld};
use super::choices::ImportOptions;
use crate::math::{Point, Pose, Vector, any_orthogonal, unit};

/// How far a rotation in a file may be from one: the norm of a quaternion, the determinant of a matrix.
const ROTATION_SLACK: f64 = 0.02;

/// The camera's axes in OpenCV axes: a vector of the camera is this times the vector in OpenCV axes. Its own inverse.
#[must_use]
pub fn camera_matrix(axes: CameraAxes) -> Matrix3<f64> {
    let diagonal = match axes {
        CameraAxes::Opencv => Vector::new(1.0, 1.0, 1.0),
        CameraAxes::Opengl => Vector::new(1.0, -1.0, -1.0),
        CameraAxes::Unity => Vector::new(1.0, -1.0, 1.0),
    };
    Matrix3::from_diagonal(&diagonal)
}

/// The right-handed world's axes from the source's.
fn world_matrix(left_handed: bool) -> Matrix3<f64> {
    let z = if left_handed { -1.0 } else { 1.0 };
    Matrix3::from_diagonal(&Vector::new(1.0, 1.0, z))
}

/// A quaternion of a file; `None` where its norm is not one.
#[must_use]
pub fn quaternion(values: [f64; 4], order: QuaternionOrder) -> Option<UnitQuaternion<f64>> {
    let [a, b, c, d] = values;
    let q = match order {
        QuaternionOrder::Xyzw => Quaternion::new(d, a, b, c),
        QuaternionOrder::Wxyz => Quaternion::new(a, b, c, d),
    };
    let norm = q.norm();
    ((norm - 1.0).abs() <= ROTATION_SLACK).then(|| UnitQuaternion::from_quaternion(q))
}

fn turn_matrix(turn: &RawRotation, order: QuaternionOrder) -> Option<Matrix3<f64>> {
    match turn {
        RawRotation::Quaternion(values) => Some(quaternion(*values, order)?.to_rotation_matrix().into_inner()),
        RawRotation::AxisAngle(v) => {
            let v = Vector::from(*v);
            v.norm().is_finite().then(|| UnitQuaternion::from_scaled_axis(v).to_rotation_matrix().into_inner())
        }
        RawRotation::Matrix([a, b, c]) => {
            let m = Matrix3::from_rows(&[
                nalgebra::RowVector3::from_row_slice(a),
                nalgebra::RowVector3::from_row_slice(b),
                nalgebra::RowVector3::from_row_slice(c),
            ]);
            let is_rotation = ((m * m.transpose()) - Matrix3::identity()).norm() <= 3.0 * ROTATION_SLACK
                && (m.determinant() - 1.0).abs() <= 3.0 * ROTATION_SLACK;
            is_rotation.then_some(m)
        }
    }
}

/// The nearest rotation of a matrix that nearly is one.
fn rotation(m: Matrix3<f64>) -> UnitQuaternion<f64> {
    // What is left of a file's rounding goes when the quaternion is made a unit one.
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m));
    UnitQuaternion::new_normalize(q.into_inner())
}

/// How poses and world of a capture are read, with the user's options over what the source declares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convention {
    /// What poses map.
    pub direction: Direction,
    /// Axes of the posed camera or body.
    pub axes: CameraAxes,
    /// Order of quaternions.
    pub quaternion: QuaternionOrder,
    /// Whether the world is left-handed.
    pub left_handed: bool,
    /// Metres per unit; 1 where the source's scale is arbitrary.
    pub unit_m: f64,
    /// The colour camera in the posed body.
    pub body_from_camera: Option<Pose>,
}

impl Convention {
    /// Of a capture.
    #[must_use]
    pub fn of(capture: &Capture, options: &ImportOptions) -> Self {
        let none = Poses::default();
        let poses = capture.poses.as_ref().unwrap_or(&none);
        let SourceWorld { unit_m, left_handed, .. } = capture.world;
        Self {
            direction: options.poses.unwrap_or(poses.direction),
            axes: options.camera_axes.unwrap_or(poses.axes),
            quaternion: options.quaternion.unwrap_or(poses.quaternion),
            left_handed,
            unit_m: options.unit_m.or(unit_m).unwrap_or(1.0),
            body_from_camera: poses.body_from_camera,
        }
    }

    /// `world_from_body` of a pose in a file, right-handed, metres; `None` where the numbers are no rigid transform, or
    /// where mirrored axes of the world and not of the camera would leave a mirror image.
    #[must_use]
    pub fn world_from_body(&self, raw: &RawPose) -> Option<Pose> {
        let (mut r, mut t) = (turn_matrix(&raw.turn, self.quaternion)?, Vector::from(raw.position));
        if self.direction == Direction::CameraFromWorld {
            r = r.transpose();
            t = -(r * t);
        }
        let world = world_matrix(self.left_handed);
        let turned = world * r * camera_matrix(self.axes);
        let position = world * t * self.unit_m;
        let is_proper = turned.determinant() > 0.0 && position.iter().all(|x| x.is_finite());
        is_proper.then(|| Pose::from_parts(position.into(), rotation(turned)))
    }

    /// `world_from_camera` of a pose in a file.
    #[must_use]
    pub fn world_from_camera(&self, raw: &RawPose) -> Option<Pose> {
        let body = self.world_from_body(raw)?;
        Some(self.body_from_camera.map_or(body, |camera| body * camera))
    }

    /// The pose as its numbers stood in the file, of a `world_from_camera` of this convention: metres and the file's axes.
    #[must_use]
    pub fn raw(&self, world_from_camera: &Pose) -> Pose {
        let body = self.body_from_camera.map_or(*world_from_camera, |camera| world_from_camera * camera.inverse());
        let world = world_matrix(self.left_handed);
        let turn = world * body.rotation.to_rotation_matrix().into_inner() * camera_matrix(self.axes);
        let raw = Pose::from_parts((world * body.translation.vector).into(), rotation(turn));
        if self.direction == Direction::CameraFromWorld { raw.inverse() } else { raw }
    }

    /// A direction of the right-handed world in the source's own axes.
    #[must_use]
    pub fn source_vector(&self, v: &Vector) -> Vector {
        world_matrix(self.left_handed) * v
    }

    /// A point of the source's world, right-handed, metres.
    #[must_use]
    pub fn point(&self, p: &Point) -> Point {
        Point::from(world_matrix(self.left_handed) * p.coords * self.unit_m)
    }

    /// A direction of the source's world, right-handed.
    #[must_use]
    pub fn vector(&self, v: &Vector) -> Vector {
        world_matrix(self.left_handed) * v
    }
}

/// The rotation that takes `up` to +Z by the shortest way; straight down goes about any level axis.
#[must_use]
pub fn upright(up: &Vector) -> UnitQuaternion<f64> {
    let Some(up) = unit(up) else { return UnitQuaternion::identity() };
    UnitQuaternion::rotation_between(&up, &Vector::z())
        .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(any_orthogonal(&up) * std::f64::consts::PI))
}

/// A direction by name: `x`, `+x`, `-x`, and so on.
///
/// # Errors
/// What to write instead.
pub fn axis(text: &str) -> Result<Vector, String> {
    let (sign, name) = match text.strip_prefix('-') {
        Some(rest) => (-1.0, rest),
        None => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    let axis = match name {
        "x" | "X" => Vector::x(),
        "y" | "Y" => Vector::y(),
        "z" | "Z" => Vector::z(),
        _ => return Err(format!("\"{text}\" is no axis; write x, y, z, -x, -y or -z")),
    };
    Ok(axis * sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some_pose() -> Pose {
        Pose::from_parts(Vector::new(1.0, -2.0, 0.5).into(), UnitQuaternion::from_euler_angles(0.3, -0.7, 1.9))
    }

    fn convention() -> Convention {
        Convention {
            direction: Direction::WorldFromCamera,
            axes: CameraAxes::Opencv,
            quaternion: QuaternionOrder::Xyzw,
            left_handed: false,
            unit_m: 1.0,
            body_from_camera: None,
        }
    }

    fn near(a: &Pose, b: &Pose) -> bool {
        (a.translation.vector - b.translation.vector).norm() < 1e-9 && a.rotation.angle_to(&b.rotation) < 1e-7
    }

    #[test]
    fn a_pose_comes_back_from_every_way_to_write_it() {
        let pose = some_pose();
        let plain = RawPose::from_pose(&pose);
        assert!(near(&convention().world_from_camera(&plain).unwrap(), &pose));

        let inverse = RawPose::from_pose(&pose.inverse());
        let c = Convention { direction: Direction::CameraFromWorld, ..convention() };
        assert!(near(&c.world_from_camera(&inverse).unwrap(), &pose));

        let q = pose.rotation.quaternion();
        let wxyz = RawPose { turn: RawRotation::Quaternion([q.w, q.i, q.j, q.k]), ..plain };
        let c = Convention { quaternion: QuaternionOrder::Wxyz, ..convention() };
        assert!(near(&c.world_from_camera(&wxyz).unwrap(), &pose));

        let gl = pose.to_homogeneous() * camera_matrix(CameraAxes::Opengl).to_homogeneous();
        let rows: Vec<f64> = gl.transpose().iter().copied().collect();
        let c = Convention { axes: CameraAxes::Opengl, ..convention() };
        assert!(near(&c.world_from_camera(&RawPose::from_rows(&rows).unwrap()).unwrap(), &pose));
    }

    #[test]
    fn the_numbers_of_a_file_are_found_again() {
        let pose = some_pose();
        for direction in [Direction::WorldFromCamera, Direction::CameraFromWorld] {
            for (axes, left_handed) in
                [(CameraAxes::Opencv, false), (CameraAxes::Opengl, false), (CameraAxes::Unity, true)]
            {
                let camera = Pose::translation(0.1, 0.0, -0.2);
                let c = Convention { direction, axes, left_handed, body_from_camera: Some(camera), ..convention() };
                let raw = RawPose::from_pose(&c.raw(&pose));
                assert!(near(&c.world_from_camera(&raw).unwrap(), &pose), "{direction:?} {axes:?}");
            }
        }
    }

    /// A left-handed world with a left-handed camera shows the same points at the same pixels.
    #[test]
    fn unity_is_mirrored_as_a_whole() {
        let pose = some_pose();
        let mirror = world_matrix(true);
        let unity = mirror * pose.rotation.to_rotation_matrix().into_inner() * camera_matrix(CameraAxes::Unity);
        let t = mirror * pose.translation.vector;
        let row = |i: usize| [unity[(i, 0)], unity[(i, 1)], unity[(i, 2)]];
        let raw = RawPose { position: t.into(), turn: RawRotation::Matrix([row(0), row(1), row(2)]) };
        let c = Convention { axes: CameraAxes::Unity, left_handed: true, ..convention() };
        assert!(near(&c.world_from_camera(&raw).unwrap(), &pose));
        let p = Point::new(0.3, 0.2, 1.0);
        assert!((c.point(&Point::from(mirror * p.coords)) - p).norm() < 1e-12);
        // Only one of both is no rigid motion.
        assert!(Convention { axes: CameraAxes::Opencv, ..c }.world_from_camera(&raw).is_none());
    }

    #[test]
    fn no_rotation_is_no_pose() {
        let c = convention();
        for turn in [
            RawRotation::Quaternion([0.0; 4]),
            RawRotation::Quaternion([f64::NAN, 0.0, 0.0, 1.0]),
            RawRotation::Matrix([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]),
            RawRotation::Matrix([[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]]),
        ] {
            assert!(c.world_from_camera(&RawPose { position: [0.0; 3], turn }).is_none(), "{turn:?}");
        }
    }

    #[test]
    fn up_becomes_z_even_from_upside_down() {
        for up in [Vector::y(), -Vector::y(), -Vector::z(), Vector::z(), Vector::new(0.1, 0.9, 0.2)] {
            assert!((upright(&up) * up.normalize() - Vector::z()).norm() < 1e-9, "{up}");
        }
        assert_eq!(axis("-y").unwrap(), -Vector::y());
        assert!(axis("up").unwrap_err().contains("no axis"));
    }
}
