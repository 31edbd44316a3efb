//! The views in which a part stands open, and where the hand has it in them (ours).

use std::collections::BTreeMap;

use nalgebra::Matrix3;

use super::pixel::Noise;
use crate::articulation::{Action, Articulation};
use crate::config;
use crate::hands::{GripStd, Trajectory};
use crate::math::{Point, Pose, Vector};
use crate::recording::sketch::Sketch;
use crate::recording::{Camera, Clip, Recording};

/// A view of the furniture, with the grip's position where the hand holds the part in it.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// Rotation from the world's axes to the camera's; the rest of the pose is the eye.
    pub(super) camera_from_world: Matrix3<f64>,
    /// Where the camera is, world.
    pub(super) eye: Point,
    /// Its pixels are the sketch's samples.
    camera: Camera,
    sketch: &'a Sketch,
    /// What the sketch's depth is multiplied by.
    factor: f64,
    /// How far it is off then.
    pub(super) noise: Noise,
    pub(super) config: &'a config::Part,
    /// Where the hand holds the part, world.
    pub grip: Point,
    /// What ties the part's place to the hand.
    pub hold: Hold,
}

/// What ties the part's place in a view to the hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Hold {
    /// The hand holds the part.
    Sure,
    /// Just after the hand was seen to let go of the open part, or just before it was seen to take hold of it. Contact flags err.
    Free,
    /// The hand went out of sight while it held the part, which may still be on its way.
    Lost,
    /// Well after the hand was seen last and after the narration's end (closing: before its start): the part stands.
    Left,
}

impl Hold {
    /// All of them.
    pub(super) const ALL: [Self; 4] = [Self::Sure, Self::Free, Self::Lost, Self::Left];

    /// What a grip is worth in such a view: a standard deviation, metres.
    pub(super) fn std_m(self, grip: GripStd, config: &config::OpenViews) -> f64 {
        let after = match self {
            Self::Sure => 0.0,
            // Contact flags are wrong now and then.
            Self::Free => config.free_share * grip.lost_m,
            Self::Lost | Self::Left => grip.lost_m,
        };
        grip.closed_m.hypot(after)
    }
}

impl View<'_> {
    /// Whether a ray (of any length) meets a surface with this normal (unit, in the same frame) edge-on.
    pub(super) fn edge_on(&self, ray: &Vector, normal: &Vector) -> bool {
        let grazing = self.config.views.edge_on_cos;
        normal.dot(ray).powi(2) <= grazing * grazing * ray.norm_squared()
    }

    /// Whether a surface at `p` with this normal is seen edge-on: a small error of its place is a large one of its depth.
    pub(super) fn grazes(&self, p: &Point, normal: &Vector) -> bool {
        self.edge_on(&(p - self.eye), normal)
    }

    /// Rotation from the camera's axes to the world's.
    pub(super) fn world_from_camera(&self) -> Matrix3<f64> {
        self.camera_from_world.transpose()
    }

    /// Calls `take` with the direction in the camera's axes, per metre of depth, and the depth (metres) of every sample that has
    /// one.
    pub(super) fn each_depth(&self, mut take: impl FnMut(Vector, f64)) {
        let grid = &self.sketch.depth_mm;
        let columns: Vec<f64> = (0..grid.width).map(|x| self.camera.unproject(x as f64, 0.0, 1.0).x).collect();
        for (y, row) in grid.data.chunks_exact(grid.width.max(1)).enumerate() {
            let y = self.camera.unproject(0.0, y as f64, 1.0).y;
            for (&x, &mm) in columns.iter().zip(row).filter(|(_, mm)| **mm > 0) {
                take(Vector::new(x, y, 1.0), f64::from(f32::from(mm) * 1e-3) * self.factor);
            }
        }
    }

    /// How far behind the world point `p` the seen surface lies (negative: in front of it), and the depth of `p`.
    /// `None` outside the image, under a hand or where there is no depth.
    pub(super) fn gap(&self, p: &Point) -> Option<(f64, f64)> {
        self.gap_at(&Point::from(self.camera_from_world * (p - self.eye)))
    }

    /// [`View::gap`] of a point in the camera frame.
    pub(super) fn gap_at(&self, local: &Point) -> Option<(f64, f64)> {
        let (x, y) = self.camera.project(local).filter(|_| local.z > self.config.views.nearest_m)?;
        let (x, y) = self.sketch.nearest(x, y)?;
        let z = f64::from(self.sketch.depth_m(y * self.sketch.depth_mm.width + x)) * self.factor;
        (z > 0.0).then_some((z - local.z, local.z))
    }
}

/// A frame of the open state.
#[derive(Debug, Clone, Copy)]
pub struct OpenFrame {
    /// Frame index.
    pub frame: usize,
    /// See [`View::grip`].
    pub grip: Point,
    /// See [`View::hold`].
    pub hold: Hold,
}

/// Frames of the open state, with the grip where the hand holds the part in them: while the hand holds it far from closed,
/// just after or before it does, and after (closing: before) the narration.
#[must_use]
pub fn open_frames(
    recording: &Recording,
    clip: &Clip,
    trajectory: &Trajectory,
    config: &config::Part,
) -> Vec<OpenFrame> {
    let &config::OpenViews { held, free: most_free, free_within, far_share, .. } = &config.views;
    let closed = trajectory.closed_grip();
    let travel = |p: &Point| (p - closed).norm();
    let furthest = trajectory.samples.iter().map(|s| travel(&s.smoothed)).fold(0.0, f64::max);
    let far: Vec<_> = trajectory.samples.iter().filter(|s| travel(&s.smoothed) > far_share * furthest).collect();
    let mut frames: Vec<OpenFrame> = (0..far.len().min(held))
        .map(|i| far[i * far.len() / far.len().min(held)])
        .map(|sample| OpenFrame { frame: sample.frame, grip: sample.smoothed, hold: Hold::Sure })
        .collect();
    // Once let go the part stays where it was left, until the next clip moves something.
    let [first, last] = trajectory.contact_frames();
    let in_other_clip = |f: usize| {
        recording
            .clips
            .iter()
            .any(|c| (c.start_frame..=c.end_frame).contains(&f) && c.end_frame > c.start_frame && c.clip != clip.clip)
    };
    let grip = trajectory.open_grip();
    // Another video of the part was taken at another time.
    let video = recording.video_frames(clip.start_frame);
    let mut after = |from: usize, hold: Hold| {
        let free: Vec<usize> = match trajectory.action {
            Action::Open => (from + 1..video.end).take_while(|f| !in_other_clip(*f)).take(free_within).collect(),
            Action::Close => (video.start..from).rev().take_while(|f| !in_other_clip(*f)).take(free_within).collect(),
        };
        let count = free.len().min(most_free);
        frames.extend((0..count).map(|i| OpenFrame { frame: free[i * free.len() / count], grip, hold }));
    };
    let end = if trajectory.action == Action::Open { last } else { first };
    // Contact flags err, and a hand that was lost may have moved the part on: after the narration it stands.
    let stands = match trajectory.action {
        Action::Open => last.max(clip.end_frame),
        Action::Close => first.min(clip.start_frame),
    };
    let moves_on = stands.abs_diff(end) > free_within;
    let [from, to] = [end.min(stands), end.max(stands)];
    let meanwhile =
        |c: &Clip| c.start_frame < to && c.end_frame > from && c.end_frame > c.start_frame && c.clip != clip.clip;
    match trajectory.open_end_seen() {
        true => after(end, Hold::Free),
        false if moves_on => after(end, Hold::Lost),
        false => {}
    }
    // What another clip moved meanwhile may be this part.
    if (moves_on || !trajectory.open_end_seen()) && !recording.clips.iter().any(meanwhile) {
        after(stands, Hold::Left);
    }
    frames
}

/// Rotation from the world's axes to the camera's.
fn turn(world_from_camera: &Pose) -> Matrix3<f64> {
    world_from_camera.rotation.inverse().to_rotation_matrix().into_inner()
}

/// The frames of [`open_frames`] that have a sketch.
#[must_use]
pub fn open_views<'a>(
    recording: &Recording,
    sketches: &'a BTreeMap<usize, Sketch>,
    clip: &Clip,
    trajectory: &Trajectory,
    config: &'a config::Part,
) -> Vec<View<'a>> {
    views(recording, sketches, &open_frames(recording, clip, trajectory, config), config)
}

/// Those of `frames` that have a sketch, as views.
#[must_use]
pub fn views<'a>(
    recording: &Recording,
    sketches: &'a BTreeMap<usize, Sketch>,
    frames: &[OpenFrame],
    config: &'a config::Part,
) -> Vec<View<'a>> {
    let noise = Noise::of(recording, config);
    frames
        .iter()
        .filter_map(|&OpenFrame { frame, grip, hold }| {
            let world_from_camera = &recording.frames[frame].world_from_camera;
            let sketch = sketches.get(&frame)?;
            Some(View {
                camera_from_world: turn(world_from_camera),
                eye: Point::from(world_from_camera.translation.vector),
                camera: sketch.camera(recording.camera_of(frame)),
                sketch,
                factor: recording.depth_factor(frame),
                noise,
                config,
                grip,
                hold,
            })
        })
        .collect()
}

/// The opening in each view as the hand tells it, rad or m.
#[must_use]
pub fn told(joint: &Articulation, grip: &Point, views: &[View]) -> Vec<f64> {
    views.iter().map(|v| joint.opening_at(grip, &v.grip)).collect()
}

#[cfg(test)]
pub(super) mod drawn {
    //! Depth images of a leaf before the inside of its furniture and a wall, for tests.

    use std::sync::LazyLock;

    use super::*;
    use crate::geometry::face::{Face, Rect};
    use crate::recording::{DepthNoise, Grid};

    /// What is believed where nobody says otherwise.
    pub static CONFIG: LazyLock<config::Part> = LazyLock::new(config::Part::default);

    pub fn camera() -> Camera {
        Camera { width: 160, height: 120, fx: 90.0, fy: 90.0, cx: 79.5, cy: 59.5 }
    }

    /// A front of 0.5 x 0.7 m in the plane y = 0 that looks to -y, in a wall of such fronts.
    pub fn face() -> Face {
        Face {
            center: Point::new(0.2, 0.0, 0.0),
            right: Vector::x(),
            up: Vector::z(),
            normal: -Vector::y(),
            extent: [[-0.45, 0.05], [-0.35, 0.35]],
            support: 1.0,
        }
    }

    pub fn rect() -> Rect {
        Rect { bounds: face().extent }
    }

    /// Looks from `eye` at the front's middle.
    pub fn pose(eye: Point) -> Pose {
        let forward = (Point::origin() - eye).normalize();
        let right = forward.cross(&Vector::z()).normalize();
        let matrix = nalgebra::Matrix3::from_columns(&[right, forward.cross(&right), forward]);
        Pose::from_parts(
            eye.coords.into(),
            nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(matrix)),
        )
    }

    /// What a camera sees of the leaf at `opening` of `joint`: the wall of fronts, a hole of 0.5 m where the leaf was, the leaf.
    pub fn sketch(world_from_camera: &Pose, joint: &Articulation, opening: f64) -> Sketch {
        let (camera, face, rect) = (camera(), face(), rect());
        let motion = joint.motion(opening);
        let mut depth = Grid::filled(camera.width, camera.height, 0.0f32);
        let inside = |p: &Point| {
            let [right, up, _] = face.coordinates(p);
            (0..2).all(|k| (rect.bounds[k][0]..=rect.bounds[k][1]).contains(&[right, up][k]))
        };
        for i in 0..depth.data.len() {
            let pixel = camera.unproject((i % camera.width) as f64, (i / camera.width) as f64, 1.0);
            let (eye, ray) = (Point::from(world_from_camera.translation.vector), world_from_camera * pixel.coords);
            // Depth at which the ray meets the plane through `at` with this normal.
            let meets = |at: Point, normal: Vector| (at - eye).dot(&normal) / ray.dot(&normal);
            let front = meets(face.center, face.normal);
            let hole = meets(face.center - face.normal * 0.5, face.normal);
            let leaf = meets(motion * face.center, motion.rotation * face.normal);
            let on_leaf = leaf > 0.0 && inside(&(motion.inverse() * (eye + ray * leaf)));
            let behind = if inside(&(eye + ray * front)) { hole } else { front };
            depth.data[i] = if on_leaf { behind.min(leaf) } else { behind } as f32;
        }
        Sketch::of(0, &depth, None)
    }

    /// What is assumed where a recording does not tell its own.
    pub fn noise() -> Noise {
        Noise::new(DepthNoise { floor_m: CONFIG.assumed_floor_m, per_m: CONFIG.assumed_per_m }, &CONFIG)
    }

    /// Of depth that is drawn to the millimetre.
    pub fn exact_noise() -> Noise {
        Noise::new(DepthNoise { floor_m: 0.0003, per_m: 0.0 }, &CONFIG)
    }

    pub fn view<'a>(sketch: &'a Sketch, world_from_camera: &Pose, grip: Point) -> View<'a> {
        View {
            camera_from_world: turn(world_from_camera),
            eye: Point::from(world_from_camera.translation.vector),
            camera: sketch.camera(&camera()),
            sketch,
            factor: 1.0,
            noise: noise(),
            config: &CONFIG,
            grip,
            hold: Hold::Sure,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hands::Sample;
    use crate::recording::Frame;

    fn recording(clips: &[Clip]) -> Recording {
        let frame = |i: i32| Frame {
            timestamp_secs: f64::from(i) * 0.1,
            world_from_camera: Pose::identity(),
            files: Default::default(),
        };
        Recording { frames: (0..80).map(frame).collect(), clips: clips.to_vec(), ..Recording::empty(drawn::camera()) }
    }

    fn clip(name: &str, start_frame: usize, end_frame: usize) -> Clip {
        let [narration, verb, noun] = [(); 3].map(|()| String::new());
        Clip { clip: name.to_owned(), start_frame, end_frame, narration, verb, noun }
    }

    /// Where a part is looked at that a hand opens from frame 10 to 19 while the narration lasts from 8 to 40.
    fn looked_at(others: &[Clip]) -> Vec<(usize, Hold)> {
        let opening = clip("opening", 8, 40);
        let sample = |i: usize| {
            let at = Point::new(0.0, 0.03 * i as f64, 0.0);
            Sample { frame: 10 + i, time_secs: 0.1 * i as f64, observed: at, smoothed: at, accepted: true }
        };
        let samples = (0..10).map(sample).collect();
        let hand = Trajectory { side: None, samples, action: Action::Open, ends_seen: [true; 2] };
        let clips: Vec<Clip> = std::iter::once(opening.clone()).chain(others.iter().cloned()).collect();
        open_frames(&recording(&clips), &opening, &hand, &config::Part::default())
            .iter()
            .map(|f| (f.frame, f.hold))
            .collect()
    }

    #[test]
    fn a_part_stands_after_the_narration_unless_another_clip_moved_something() {
        let stands = |others: &[Clip]| {
            looked_at(others).into_iter().filter(|(_, hold)| *hold == Hold::Left).map(|(f, _)| f).collect::<Vec<_>>()
        };
        let alone = stands(&[]);
        assert!(!alone.is_empty() && alone.iter().all(|f| *f > 40), "{alone:?}");
        assert!(stands(&[clip("closing", 25, 35)]).is_empty());
        // Before it, or well after it.
        assert_eq!(stands(&[clip("before", 0, 5), clip("after", 60, 70)]), alone);
        // What is seen right after the hand let go is looked at in any case.
        assert!(looked_at(&[clip("closing", 25, 35)]).iter().any(|(f, hold)| *hold == Hold::Free && *f < 25));
    }
}
