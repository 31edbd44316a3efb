//! What views of the open state say about a joint: is the part where the joint puts it, and gone from where it was (ours)?

use std::cmp::Ordering;
use std::collections::BTreeMap;

use super::Face;
use super::face::Rect;
use crate::articulation::{Action, Articulation};
use crate::hands::Trajectory;
use crate::math::{Point, Pose, Vector};
use crate::recording::sketch::Sketch;
use crate::recording::{Camera, Clip, Recording};

/// A view of the furniture, with the grip's position where the hand holds the part in it.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    camera_from_world: Pose,
    /// Where the camera is, world.
    pub(super) eye: Point,
    camera: Camera,
    sketch: &'a Sketch,
    /// What the sketch's depth is multiplied by.
    factor: f64,
    /// Where the hand holds the part, world.
    pub grip: Point,
    /// What ties the part's place to the hand.
    pub hold: Hold,
}

/// What ties the part's place in a view to the hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Hold {
    /// The hand holds the part, or was seen to let go of it.
    Sure,
    /// The hand is gone and was not seen to let go: the part may be on its way.
    Lost,
    /// The same after the narration's end (or before its start): the part stands.
    Left,
}

impl Hold {
    /// All of them.
    pub(super) const ALL: [Self; 3] = [Self::Sure, Self::Lost, Self::Left];

    /// What a grip of `grip_std_m` is worth in such a view, metres.
    pub(super) fn std_m(self, grip_std_m: f64) -> f64 {
        if self == Self::Sure { grip_std_m } else { grip_std_m.hypot(crate::hands::grip_std_m(false)) }
    }
}

/// A leaf seen at less than this slant (cosine) shows its edge.
pub(super) const GRAZING: f64 = 0.2;

impl View<'_> {
    /// Whether a surface at `p` with this normal is seen edge-on: a small error of its place is a large one of its depth.
    pub(super) fn grazes(&self, p: &Point, normal: &Vector) -> bool {
        crate::math::unit(&(p - self.eye)).is_none_or(|ray| normal.dot(&ray).abs() < GRAZING)
    }

    /// How far behind the world point `p` the seen surface lies (negative: in front of it), and the depth of `p`.
    /// `None` outside the image, under a hand or where there is no depth.
    pub(super) fn gap(&self, p: &Point) -> Option<(f64, f64)> {
        let local = self.camera_from_world * p;
        let (u, v) = self.camera.project(&local).filter(|_| local.z > 0.15)?;
        let (x, y) = self.sketch.sample(u, v)?;
        let z = f64::from(self.sketch.depth.data[y * self.sketch.depth.width + x]) * self.factor;
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
/// and just after or before it does.
#[must_use]
pub fn open_frames(recording: &Recording, clip: &Clip, trajectory: &Trajectory) -> Vec<OpenFrame> {
    const HELD: usize = 6;
    const FREE: usize = 3;
    let closed = trajectory.closed_grip();
    let travel = |p: &Point| (p - closed).norm();
    let furthest = trajectory.samples.iter().map(|s| travel(&s.smoothed)).fold(0.0, f64::max);
    let far: Vec<_> = trajectory.samples.iter().filter(|s| travel(&s.smoothed) > 0.5 * furthest).collect();
    let mut frames: Vec<OpenFrame> = (0..far.len().min(HELD))
        .map(|i| far[i * far.len() / far.len().min(HELD)])
        .map(|sample| OpenFrame { frame: sample.frame, grip: sample.smoothed, hold: Hold::Sure })
        .collect();
    // Once let go the part stays where it was left, until the next clip moves something.
    let [first, last] = trajectory.contact_frames();
    let in_other_clip = |f: usize| {
        recording
            .clips
            .iter()
            .any(|c| c.clip != clip.clip && c.end_frame > c.start_frame && (c.start_frame..=c.end_frame).contains(&f))
    };
    let grip = trajectory.open_grip();
    let mut after = |from: usize, hold: Hold| {
        let free: Vec<usize> = match trajectory.action {
            Action::Open => {
                (from + 1..recording.frames.len()).take_while(|f| !in_other_clip(*f)).take(4 * FREE).collect()
            }
            Action::Close => (0..from).rev().take_while(|f| !in_other_clip(*f)).take(4 * FREE).collect(),
        };
        let count = free.len().min(FREE);
        frames.extend((0..count).map(|i| OpenFrame { frame: free[i * free.len() / count], grip, hold }));
    };
    let end = if trajectory.action == Action::Open { last } else { first };
    if trajectory.open_end_seen() {
        after(end, Hold::Sure);
    } else {
        // A hand that was lost may have moved the part until the narration ends.
        after(end, Hold::Lost);
        after(
            if trajectory.action == Action::Open { last.max(clip.end_frame) } else { first.min(clip.start_frame) },
            Hold::Left,
        );
    }
    frames
}

/// The frames of [`open_frames`] that have a sketch.
#[must_use]
pub fn open_views<'a>(
    recording: &Recording,
    sketches: &'a BTreeMap<usize, Sketch>,
    clip: &Clip,
    trajectory: &Trajectory,
) -> Vec<View<'a>> {
    open_frames(recording, clip, trajectory)
        .into_iter()
        .filter_map(|OpenFrame { frame, grip, hold }| {
            let world_from_camera = recording.frames[frame].world_from_camera;
            Some(View {
                camera_from_world: world_from_camera.inverse(),
                eye: Point::from(world_from_camera.translation.vector),
                camera: recording.camera,
                sketch: sketches.get(&frame)?,
                factor: recording.depth_factor(frame),
                grip,
                hold,
            })
        })
        .collect()
}

/// How well a joint explains the open views: of the face's points that it moves clearly, the share that is seen where it
/// puts them rather than seen through there, and no longer where they were; and the number of such sights.
///
/// Hands and depth disagree by a few centimetres that stay the same over a clip (a hand's distance is the least certain thing
/// about it): the opening that the hand tells is taken with an offset of its own, the one that explains most, less what so
/// large an offset is believed in. `grip_std_m` is the spread of the offsets, metres.
#[must_use]
pub fn agreement(sights: &Sights, joint: &Articulation, grip: &Point, grip_std_m: f64) -> (f64, usize) {
    /// Between two offsets, metres: what the depth's tolerance bridges.
    const STEP_M: f64 = 0.02;
    /// Half a squared standard deviation against the log likelihood that the whole share is worth to the reasoner.
    const SHARE_PER_NAT: f64 = 1.0 / 18.0;
    let lever = joint.lever(grip).max(0.05);
    // Where a hand was lost before it let go, the views after that have an offset of their own.
    let of = |hold: Hold| -> (f64, usize) {
        let std_m = hold.std_m(grip_std_m);
        let at = |offset: f64| -> (f64, usize) {
            let (share, count) = seen_share(sights, joint, grip, hold, offset / lever);
            ((share - SHARE_PER_NAT * 0.5 * (offset / std_m).powi(2)).max(0.0), count)
        };
        // An offset under which nothing moves clearly explains nothing; of equal offsets the first is kept.
        let better = |best: (f64, (f64, usize)), offset: f64| -> (f64, (f64, usize)) {
            let found = at(offset);
            let order = (found.1 >= MIN_POINTS, found.0).partial_cmp(&(best.1.1 >= MIN_POINTS, best.1.0));
            if order == Some(Ordering::Greater) { (offset, found) } else { best }
        };
        // Two standard deviations to each side, from the middle outwards: far reaches by double steps first.
        let stride = if std_m > 2.0 * STEP_M { 2.0 * STEP_M } else { STEP_M };
        let reach = (2.0 * std_m / stride).round() as i32;
        let mut best = (0.0, at(0.0));
        for k in 1..=reach {
            best = better(better(best, -f64::from(k) * stride), f64::from(k) * stride);
        }
        if stride > STEP_M {
            let middle = best.0;
            best = better(better(best, middle - STEP_M), middle + STEP_M);
        }
        best.1
    };
    let (mut explained, mut count) = (0.0, 0);
    for hold in Hold::ALL.into_iter().filter(|h| sights.views.iter().any(|v| v.hold == *h)) {
        let (share, points) = of(hold);
        explained += share * points as f64;
        count += points;
    }
    (explained / count.max(1) as f64, count)
}

/// What [`agreement`] is worth, in nats: of the points that a right joint moves about four fifths are seen in their place, of
/// a wrong one's about a third by chance. Neighbouring points share their fate, so all of them count as a few.
#[must_use]
pub fn log_likelihood((share, count): (f64, usize)) -> f64 {
    const RIGHT: f64 = 0.8;
    const WRONG: f64 = 0.3;
    const INDEPENDENT: f64 = 8.0;
    // With few points the share is noise; with none it says nothing.
    let weight = INDEPENDENT * (count as f64 / 200.0).min(1.0);
    weight * (share * (RIGHT / WRONG).ln() + (1.0 - share) * ((1.0 - RIGHT) / (1.0 - WRONG)).ln())
}

/// A share of fewer points is noise.
pub const MIN_POINTS: usize = 100;

/// Points of a face's part, closed, and what the open views see there: the same for every joint that it could have.
#[derive(Debug, Clone)]
pub struct Sights<'a> {
    face: &'a Face,
    bounds: [[f64; 2]; 2],
    views: &'a [View<'a>],
    points: Vec<Point>,
    /// For each view and point [`View::gap`].
    closed: Vec<Vec<Option<(f64, f64)>>>,
}

impl<'a> Sights<'a> {
    /// A grid over the part, or over a piece of its face around the grip where the part is not known.
    #[must_use]
    pub fn of(face: &'a Face, rect: Option<&Rect>, views: &'a [View<'a>]) -> Self {
        // What the smallest front has.
        const HALF_M: f64 = 0.12;
        const STEPS: usize = 12;
        let bounds = rect.map_or([[-HALF_M, HALF_M]; 2], |r| r.bounds);
        let at = |k: usize, b: [f64; 2]| b[0] + (b[1] - b[0]) * (k as f64 + 0.5) / STEPS as f64;
        let points: Vec<Point> =
            (0..STEPS * STEPS).map(|i| face.point(at(i % STEPS, bounds[0]), at(i / STEPS, bounds[1]), 0.0)).collect();
        let closed = views.iter().map(|view| points.iter().map(|p| view.gap(p)).collect()).collect();
        Self { face, bounds, views, points, closed }
    }
}

/// The share of [`agreement`] in the views of one sort, with `offset` (rad or m) added to the opening that the hand tells.
pub(super) fn seen_share(sights: &Sights, joint: &Articulation, grip: &Point, hold: Hold, offset: f64) -> (f64, usize) {
    let Sights { face, bounds, .. } = sights;
    let (mut explained, mut count) = (0usize, 0usize);
    for (view, closed) in sights.views.iter().zip(&sights.closed).filter(|(v, _)| v.hold == hold) {
        let motion = joint.motion(joint.opening_at(grip, &view.grip) + offset);
        let back = motion.inverse();
        for (here, closed) in sights.points.iter().zip(closed) {
            let moved = motion * here;
            let travel = (moved - here).norm();
            // Less than twice the least tolerance is no motion anywhere.
            if travel < 2.0 * tolerance(0.0) {
                continue;
            }
            // Where it goes. Within the face there is a surface whether the part slid there or not.
            if let Some((gap, z)) = view.gap(&moved)
                && travel >= 2.0 * tolerance(z)
                && gap >= -tolerance(z)
                && face.coordinates(&moved)[2].abs() > tolerance(z)
            {
                count += 1;
                explained += usize::from(gap <= tolerance(z));
            }
            // Where it was, unless another piece of it is there now.
            if let Some((gap, z)) = *closed
                && travel >= 2.0 * tolerance(z)
                && gap >= -tolerance(z)
            {
                let [right, up, out] = face.coordinates(&(back * here));
                let within = |x: f64, b: [f64; 2]| (b[0]..=b[1]).contains(&x);
                let covered = out.abs() <= tolerance(z) && within(right, bounds[0]) && within(up, bounds[1]);
                if !covered {
                    count += 1;
                    explained += usize::from(gap > tolerance(z));
                }
            }
        }
    }
    (explained as f64 / count.max(1) as f64, count)
}

/// Depth noise that a surface at distance `z` may show: half a voxel and 2 % of the distance (metric depth estimates).
pub(super) fn tolerance(z: f64) -> f64 {
    0.025 + 0.02 * z
}

/// The opening in each view as the hand tells it, rad or m.
#[must_use]
pub fn told(joint: &Articulation, grip: &Point, views: &[View]) -> Vec<f64> {
    views.iter().map(|v| joint.opening_at(grip, &v.grip)).collect()
}

#[cfg(test)]
pub(super) mod drawn {
    //! Depth images of a leaf before the inside of its furniture and a wall, for tests.

    use super::*;
    use crate::recording::Grid;

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

    pub fn view<'a>(sketch: &'a Sketch, world_from_camera: &Pose, grip: Point) -> View<'a> {
        View {
            camera_from_world: world_from_camera.inverse(),
            eye: Point::from(world_from_camera.translation.vector),
            camera: camera(),
            sketch,
            factor: 1.0,
            grip,
            hold: Hold::Sure,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::articulation::JointKind;

    #[test]
    fn a_joint_explains_its_own_motion_and_a_slide_within_the_face_must_uncover_something() {
        let origin = Point::new(-0.25, 0.0, 0.0);
        let door = Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin };
        let out = Articulation { kind: JointKind::Prismatic, axis: -Vector::y(), origin };
        let aside = Articulation { axis: -Vector::x(), ..out };
        let poses = [drawn::pose(Point::new(0.3, -1.0, 0.5)), drawn::pose(Point::new(0.1, -1.1, 0.4))];
        let (face, rect, grip) = (drawn::face(), drawn::rect(), drawn::face().center);
        // The part moves by `opening`, the hand by `told`; the share of `claims` and the number of sights.
        let share = |moves: &Articulation, opening: f64, told: f64, claims: &Articulation| {
            let sketches = poses.map(|pose| drawn::sketch(&pose, moves, opening));
            let hand = moves.motion(told) * grip;
            let views: Vec<View> = sketches.iter().zip(&poses).map(|(s, pose)| drawn::view(s, pose, hand)).collect();
            agreement(&Sights::of(&face, Some(&rect), &views), claims, &grip, 0.03)
        };
        // Whoever claims the motion that was made explains nearly all.
        for (joint, opening) in [(door, 0.9), (out, 0.3), (aside, 0.3)] {
            let (own, count) = share(&joint, opening, opening, &joint);
            assert!(own > 0.9 && count > MIN_POINTS, "{joint:?} {own} {count}");
        }
        let (as_slide, _) = share(&door, 0.9, 0.9, &out);
        assert!(as_slide < 0.7, "{as_slide}");
        // A front that stayed shut has the surface of a slide's other end, and uncovered nothing.
        let (still, count) = share(&aside, 0.0, 0.3, &aside);
        assert!(still < 0.1 && count > MIN_POINTS, "{still} {count}");
    }
}
