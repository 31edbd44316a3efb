//! Frames that are told relative to each other, some of them moving (ROS' tf).

use std::collections::BTreeMap;

use super::join::PoseTrack;
use crate::math::Pose;

/// How far two transforms of a frame that does not move may be apart, metres and radians: rounding.
const STILL: f64 = 1e-6;

struct Edge {
    parent: String,
    poses: Vec<(f64, Pose)>,
}

/// The frames.
#[derive(Default)]
pub struct TransformTree {
    edges: BTreeMap<String, Edge>,
}

/// The way from one frame to another.
pub struct Chain {
    /// From the first frame up to the common one: to be inverted.
    up: Vec<PoseTrack>,
    /// From the common one down to the second frame.
    down: Vec<PoseTrack>,
    /// Times of the edge that moves most often, seconds.
    times: Vec<f64>,
}

impl TransformTree {
    /// Adds what was told of a frame at a time, seconds. A frame has one parent: the first one that is told.
    pub fn add(&mut self, parent: &str, child: &str, time_secs: f64, pose: Pose) {
        let edge =
            self.edges.entry(child.to_owned()).or_insert_with(|| Edge { parent: parent.to_owned(), poses: Vec::new() });
        if edge.parent == parent {
            edge.poses.push((time_secs, pose));
        }
    }

    /// A frame and those above it, the uppermost last.
    #[must_use]
    pub fn above<'a>(&'a self, frame: &'a str) -> Vec<&'a str> {
        let mut out = vec![frame];
        let mut at = frame;
        // Not more steps than frames: a ring ends too.
        for _ in 0..self.edges.len() {
            let Some(edge) = self.edges.get(at) else { break };
            at = &edge.parent;
            out.push(at);
        }
        out
    }

    /// Frames that move right below a frame, by their names.
    pub fn moving_below<'a>(&'a self, frame: &'a str) -> impl Iterator<Item = &'a str> {
        self.edges.iter().filter(move |(_, e)| e.parent == frame && e.moves()).map(|(child, _)| child.as_str())
    }

    /// Edges of frames in turn, up to one of them.
    fn edges_below(&self, frames: &[&str], end: &str) -> Vec<&Edge> {
        frames.iter().take_while(|f| **f != end).filter_map(|f| self.edges.get(*f)).collect()
    }

    /// The way from a frame to another; `None` where none is told.
    #[must_use]
    pub fn chain(&self, from: &str, to: &str) -> Option<Chain> {
        let (a, b) = (self.above(from), self.above(to));
        let common = a.iter().find(|f| b.contains(f))?;
        let (up, mut down) = (self.edges_below(&a, common), self.edges_below(&b, common));
        down.reverse();
        let busiest = up.iter().chain(&down).filter(|e| e.moves()).max_by_key(|e| e.poses.len());
        let mut times: Vec<f64> = busiest.map(|e| e.poses.iter().map(|(t, _)| *t).collect()).unwrap_or_default();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let tracks = |edges: Vec<&Edge>| edges.into_iter().map(|e| PoseTrack::of(e.poses.clone())).collect();
        Some(Chain { up: tracks(up), down: tracks(down), times })
    }
}

impl Edge {
    fn moves(&self) -> bool {
        let Some(((_, first), rest)) = self.poses.split_first() else { return false };
        rest.iter().any(|(_, pose)| {
            (pose.translation.vector - first.translation.vector).norm() > STILL
                || pose.rotation.angle_to(&first.rotation) > STILL
        })
    }
}

impl Chain {
    /// Times of the edge that moves most often, seconds; empty where nothing moves.
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The second frame in the first one at a time, seconds, between what is told before and after it.
    #[must_use]
    pub fn at(&self, time_secs: f64) -> Option<Pose> {
        let product = |tracks: &[PoseTrack]| {
            tracks.iter().try_fold(Pose::identity(), |sum, track| Some(sum * track.at(time_secs, f64::INFINITY)?))
        };
        // Upwards the first edge is the lowest one.
        let up =
            self.up.iter().try_fold(Pose::identity(), |sum, track| Some(track.at(time_secs, f64::INFINITY)? * sum))?;
        Some(up.inverse() * product(&self.down)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vector;

    fn step(x: f64, turn: f64) -> Pose {
        Pose::from_parts(Vector::new(x, 0.0, 0.0).into(), crate::math::rotation(&Vector::z(), turn))
    }

    #[test]
    fn frames_are_found_up_and_down_the_tree() {
        let mut tree = TransformTree::default();
        tree.add("map", "odom", 0.0, step(1.0, 0.5));
        for i in 0..5 {
            tree.add("odom", "base", f64::from(i), step(f64::from(i), 0.1 * f64::from(i)));
        }
        tree.add("base", "camera", 0.0, step(0.2, -0.3));
        tree.add("base", "arm", 0.0, step(-0.4, 1.0));
        let near = |a: Pose, b: Pose| {
            (a.inverse() * b).translation.vector.norm() < 1e-9 && a.rotation.angle_to(&b.rotation) < 1e-7
        };
        let camera = tree.chain("odom", "camera").unwrap();
        assert_eq!(camera.times(), [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert!(near(camera.at(2.0).unwrap(), step(2.0, 0.2) * step(0.2, -0.3)));
        let still = tree.chain("arm", "camera").unwrap();
        assert!(still.times().is_empty());
        assert!(near(still.at(7.0).unwrap(), step(-0.4, 1.0).inverse() * step(0.2, -0.3)));
        assert!(tree.chain("camera", "nowhere").is_none());
        assert_eq!(tree.moving_below("odom").collect::<Vec<_>>(), ["base"]);
        // A ring is wrong, and no reason to hang.
        tree.add("arm", "map", 0.0, step(9.0, 0.0));
        assert!(tree.above("map").len() < 10 && tree.chain("map", "nowhere").is_none());
    }
}
