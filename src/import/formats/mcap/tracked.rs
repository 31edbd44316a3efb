//! Where the camera was: an odometry, poses with time stamps, or the frames of tf.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};

use super::bag::Bag;
use crate::error::{Error, Result};
use crate::import::ImportOptions;
use crate::import::capture::{At, PoseAt, Poses, RawPose, SourceWorld};
use crate::import::ros::{self, RosPose};
use crate::math::{Pose, Vector};

/// World frames whose z axis is up by ROS' rule.
const UPRIGHT: [&str; 4] = ["map", "odom", "world", "earth"];
/// The Stera app's body: x forward, y up, z to the right.
const STERA_BODY: &str = "camera_link";

/// Poses, and the world that they are in.
pub(super) struct TrackedCamera {
    /// The poses.
    pub poses: Poses,
    /// Their world.
    pub world: SourceWorld,
}

/// The camera's poses; `camera` is its frame. `None` where nothing tells them.
///
/// # Errors
/// Where the topic that the user told holds none.
pub(super) fn poses(
    path: &Path,
    bag: &Bag,
    camera: &str,
    is_stera: bool,
    options: &ImportOptions,
    notes: &mut Vec<String>,
) -> Result<Option<TrackedCamera>> {
    let told = options.topics.get("poses").map(String::as_str);
    let topic = match told {
        Some("tf") => None,
        Some(topic) => match bag.poses.get_key_value(topic) {
            Some(found) => Some(found),
            None => {
                let names: Vec<&str> = bag.poses.keys().map(String::as_str).collect();
                let message = format!("holds no poses; these do: tf, {}", names.join(", "));
                return Err(Error::format(path, format!("topic {topic}"), message));
            }
        },
        // A pose whose body tf ties to the camera is of more use than one whose body nobody knows.
        None => bag.poses.iter().max_by_key(|(name, items)| {
            let is_tied = items.first().is_some_and(|p| body(bag, p, camera, is_stera).is_some());
            (is_tied, name.contains("camera"), items.len())
        }),
    };
    let found = match topic {
        Some((name, items)) => of_topic(bag, name, items, camera, is_stera, notes),
        None => of_tf(bag, camera, notes),
    };
    Ok(found.map(|(poses, frame)| {
        let up = match frame.as_str() {
            _ if is_stera => Some(Vector::y()),
            name if UPRIGHT.contains(&name) => Some(Vector::z()),
            _ => None,
        };
        TrackedCamera { poses, world: SourceWorld { up, ..SourceWorld::default() } }
    }))
}

/// The body's frame that a pose is of.
fn body<'a>(bag: &'a Bag, posed: &'a RosPose, camera: &str, is_stera: bool) -> Option<&'a str> {
    match &posed.body {
        Some(body) => Some(body.as_str()),
        None if is_stera => Some(STERA_BODY),
        // What tf moves in the frame of the poses is what they are of.
        None => bag.tree.moving_below(&posed.header.frame).find(|b| bag.tree.chain(b, camera).is_some()),
    }
}

/// Poses of a topic, and the name of their world.
fn of_topic(
    bag: &Bag,
    topic: &str,
    items: &[RosPose],
    camera: &str,
    is_stera: bool,
    notes: &mut Vec<String>,
) -> Option<(Poses, String)> {
    let first = items.first()?;
    notes.push(format!("poses are {topic}"));
    let body = body(bag, first, camera, is_stera);
    let chain = body.and_then(|b| bag.tree.chain(b, camera));
    let mut poses = Poses::default();
    let moving = match chain {
        Some(chain) if chain.times().is_empty() => {
            poses.body_from_camera = chain.at(first.header.time_secs).filter(|p| *p != Pose::identity());
            None
        }
        Some(chain) => Some(chain),
        None if is_stera => {
            poses.body_from_camera = Some(stera_camera());
            None
        }
        None => {
            let of = body.map_or_else(String::new, |b| format!(" (tf does not lead from {b} to \"{camera}\")"));
            notes.push(format!("they are taken for the colour camera's own, OpenCV axes{of}"));
            None
        }
    };
    poses.items = items
        .iter()
        .filter_map(|posed| {
            let time_secs = posed.header.time_secs;
            let pose = match &moving {
                None => posed.pose,
                Some(chain) => RawPose::from_pose(&(ros::rigid(&posed.pose)? * chain.at(time_secs)?)),
            };
            Some(PoseAt { at: At::time(time_secs), pose, optics: None })
        })
        .collect();
    Some((poses, first.header.frame.clone()))
}

/// Poses of the camera in the uppermost frame of tf, and that frame's name.
fn of_tf(bag: &Bag, camera: &str, notes: &mut Vec<String>) -> Option<(Poses, String)> {
    let root = *bag.tree.above(camera).last()?;
    let chain = bag.tree.chain(root, camera)?;
    let items: Vec<PoseAt> = chain
        .times()
        .iter()
        .filter_map(|t| Some(PoseAt { at: At::time(*t), pose: RawPose::from_pose(&chain.at(*t)?), optics: None }))
        .collect();
    if items.is_empty() {
        return None;
    }
    notes.push(format!("poses are tf's, of {camera} in {root}"));
    Some((Poses { items, ..Poses::default() }, root.to_owned()))
}

/// The Stera app's camera in its body, where tf does not tell it: half a turn about the bisector of x and z.
fn stera_camera() -> Pose {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(0.0, half, 0.0, half));
    Pose::from_parts(Vector::zeros().into(), turn)
}
