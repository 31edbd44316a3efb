//! What gets built: boxes, joints and masses of a scene, all in the world frame with everything closed.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use serde::{Deserialize, Serialize};

use crate::articulation::{Articulation, JointKind};
use crate::config::Drives;
use crate::math::{Point, Pose, Vector};

/// Definition: of gravity, m/s^2, as simulators have it.
pub(crate) const GRAVITY: f64 = 9.81;

/// A box of any orientation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "BoxFile", into = "BoxFile")]
pub struct OrientedBox {
    /// Centre, world, metres.
    pub center: Point,
    /// Half sizes along the box's own axes, metres.
    pub half: Vector,
    /// The box's axes in the world as columns: `world_from_box` rotation.
    pub rotation: Matrix3<f64>,
}

/// The same as rows of `R`, as the recording format has it.
#[derive(Serialize, Deserialize)]
struct BoxFile {
    center: Point,
    half: Vector,
    #[serde(rename = "R")]
    rows: [[f64; 3]; 3],
}

impl From<BoxFile> for OrientedBox {
    fn from(file: BoxFile) -> Self {
        Self { center: file.center, half: file.half, rotation: Matrix3::from_fn(|r, c| file.rows[r][c]) }
    }
}

impl From<OrientedBox> for BoxFile {
    fn from(b: OrientedBox) -> Self {
        Self { center: b.center, half: b.half, rows: [0, 1, 2].map(|r| [0, 1, 2].map(|c| b.rotation[(r, c)])) }
    }
}

impl OrientedBox {
    /// Volume, m^3.
    #[must_use]
    pub fn volume(&self) -> f64 {
        8.0 * self.half.product()
    }

    /// `world_from_box`.
    #[must_use]
    pub fn pose(&self) -> Pose {
        Pose::from_parts(self.center.coords.into(), self.orientation())
    }

    /// Rotation `world_from_box`.
    #[must_use]
    pub fn orientation(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(self.rotation))
    }

    /// The same box moved.
    #[must_use]
    pub fn moved(&self, motion: &Pose) -> Self {
        Self {
            center: motion * self.center,
            half: self.half,
            rotation: motion.rotation.to_rotation_matrix().matrix() * self.rotation,
        }
    }

    /// The eight corners.
    #[must_use]
    pub fn corners(&self) -> [Point; 8] {
        std::array::from_fn(|i| {
            let sign = |bit: usize| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let local = Vector::new(sign(0) * self.half.x, sign(1) * self.half.y, sign(2) * self.half.z);
            self.center + self.rotation * local
        })
    }

    /// Whether a point is inside.
    #[must_use]
    pub fn contains(&self, p: &Point) -> bool {
        let local = self.rotation.transpose() * (p - self.center);
        (0..3).all(|i| local[i].abs() <= self.half[i])
    }

    /// The same box with no side thinner than `thickness`.
    #[must_use]
    pub fn thickened(&self, thickness: f64) -> Self {
        Self { half: self.half.map(|h| h.max(0.5 * thickness)), ..*self }
    }

    /// Inertia of the solid box about its own centre in world axes for a mass, kg m^2.
    #[must_use]
    pub fn inertia(&self, mass: f64) -> Matrix3<f64> {
        let [x, y, z] = [0, 1, 2].map(|i| (2.0 * self.half[i]).powi(2));
        let own = Matrix3::from_diagonal(&(Vector::new(y + z, x + z, x + y) * (mass / 12.0)));
        self.rotation * own * self.rotation.transpose()
    }
}

/// Intersection over union of two boxes, by a grid of 24^3 points in each; good to about 0.02.
#[must_use]
pub fn box_iou(a: &OrientedBox, b: &OrientedBox) -> f64 {
    /// Numerics: points along each side of a box.
    const N: usize = 24;
    let share = |from: &OrientedBox, of: &OrientedBox| {
        let at = |i: usize| (i as f64 + 0.5) / N as f64 * 2.0 - 1.0;
        let inside = (0..N * N * N)
            .filter(|i| {
                let local = Vector::new(at(i % N), at(i / N % N), at(i / N / N)).component_mul(&from.half);
                of.contains(&(from.center + from.rotation * local))
            })
            .count();
        inside as f64 / (N * N * N) as f64 * from.volume()
    };
    let both = 0.5 * (share(a, b) + share(b, a));
    let union = a.volume() + b.volume() - both;
    if union > 0.0 { both / union } else { 0.0 }
}

/// What a box stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Door leaf or drawer front.
    Front,
    /// Bar or post of a handle.
    Handle,
    /// Side, bottom or back of a drawer.
    Tray,
    /// Board of the fixed furniture.
    Carcass,
    /// Walls, worktops and whatever else of the room does not move.
    Room,
}

/// One solid box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Solid {
    /// Name, unique in the twin.
    pub name: String,
    /// What it is.
    pub role: Role,
    /// Its box when closed.
    pub shape: OrientedBox,
    /// Seen in the recording (true) or assumed (false).
    pub seen: bool,
}

/// The joint of a part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Type, axis (positive opens) and origin: on a hinge the point nearest to the part's middle.
    pub articulation: Articulation,
    /// Upper limit, rad or m; the lower one is 0 = closed. As far as is expected while nothing is in the way; below what was
    /// observed where seen or surer furniture is.
    pub upper: f64,
    /// Largest opening that was observed, rad or m.
    pub observed: f64,
    /// The opening that a person would expect of such furniture, rad or m; what stands in the way is not counted.
    #[serde(default)]
    pub expected: f64,
    /// Probability of just this joint (8 degrees, 8 cm) after hand, depth, words and physics; `None` where no inference made
    /// the joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// Viscous damping, N m s/rad or N s/m.
    pub damping: f64,
    /// Dry friction, N m or N.
    pub friction: f64,
    /// Damping and friction are those that the recorded hand showed (true) or of a table (false).
    #[serde(default)]
    pub resistance_seen: bool,
    /// The part's weight is carried by a spring, as that of an oven's or a dishwasher's door is: gravity does not move it.
    #[serde(default)]
    pub balanced: bool,
}

/// Mass, centre of mass and inertia.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MassProperties {
    /// kg.
    pub mass: f64,
    /// World, closed.
    pub center: Point,
    /// About the centre, world axes, kg m^2.
    pub inertia: Matrix3<f64>,
}

/// A moving part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Name: the joint's id.
    pub id: String,
    /// Words for people.
    pub label: String,
    /// The joint.
    pub joint: Joint,
    /// The boxes of the part.
    pub solids: Vec<Solid>,
    /// Where the hand holds it when closed, world.
    pub handle: Point,
    /// Box around the whole part, in the axes of its face.
    pub bounds: OrientedBox,
}

/// A piece of furniture: fixed boards and the part that moves in them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Furniture {
    /// Name, unique in the twin.
    pub name: String,
    /// Fixed boards.
    pub carcass: Vec<Solid>,
    /// The moving part.
    pub part: Part,
}

/// The whole scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Twin {
    /// Name of the scene.
    pub name: String,
    /// Density of all boxes, kg/m^3.
    pub density_kg_per_m3: f64,
    /// The most that moves a joint, as the formats have limits of it.
    #[serde(default, skip_serializing_if = "is_usual")]
    pub drives: Drives,
    /// Furniture in the order of the joints.
    pub furniture: Vec<Furniture>,
    /// What stands around the furniture and does not move; shares no space with any part on its way.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub room: Vec<Solid>,
    /// Joints that could not be built, with the reason.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
}

#[cfg(test)]
impl Twin {
    /// Such furniture of the usual density in an empty room.
    pub(crate) fn of(furniture: Vec<Furniture>) -> Self {
        Self {
            name: "kitchen".to_owned(),
            density_kg_per_m3: 600.0,
            drives: Drives::default(),
            furniture,
            room: Vec::new(),
            left_out: Vec::new(),
        }
    }
}

fn is_usual(drives: &Drives) -> bool {
    *drives == Drives::default()
}

/// A joint that is not in the twin.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// The joint's id.
    pub id: String,
    /// Why.
    pub reason: String,
}

/// Which solids of a twin touch each other, where the model that it comes from says so. By default all do.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ContactRules {
    /// What each solid may touch, by its name; one that is not here touches all.
    pub solids: BTreeMap<String, ContactRule>,
    /// Pairs of links without contacts, the smaller number first.
    pub excluded: BTreeSet<[usize; 2]>,
    /// Pairs of rigid bodies without contacts because one carries the other, the smaller number first.
    pub family: BTreeSet<[usize; 2]>,
}

/// What a solid may touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ContactRule {
    /// Number of the link that it belongs to.
    pub link: usize,
    /// Number of the link that stands for all that are rigidly connected with it.
    pub body: usize,
    /// `contype` and `conaffinity` as MuJoCo has them; both 0 where the solid is only seen.
    pub masks: [u32; 2],
}

impl ContactRules {
    /// Whether two solids, by their names, can touch.
    #[must_use]
    pub fn meet(&self, a: &str, b: &str) -> bool {
        let (Some(a), Some(b)) = (self.solids.get(a), self.solids.get(b)) else { return true };
        let pair = |x: usize, y: usize| [x.min(y), x.max(y)];
        let masks = a.masks[0] & b.masks[1] != 0 || b.masks[0] & a.masks[1] != 0;
        masks && !self.excluded.contains(&pair(a.link, b.link)) && !self.family.contains(&pair(a.body, b.body))
    }
}

/// Mass properties of boxes of one density; `None` for no boxes.
#[must_use]
pub fn mass_properties(solids: &[Solid], density: f64) -> Option<MassProperties> {
    let mass: f64 = solids.iter().map(|s| s.shape.volume() * density).sum();
    if mass <= 0.0 {
        return None;
    }
    let center =
        solids.iter().fold(Vector::zeros(), |sum, s| sum + s.shape.center.coords * (s.shape.volume() * density)) / mass;
    let inertia = solids.iter().fold(Matrix3::zeros(), |sum, s| {
        let m = s.shape.volume() * density;
        let d = s.shape.center.coords - center;
        sum + s.shape.inertia(m) + (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * m
    });
    Some(MassProperties { mass, center: Point::from(center), inertia: (inertia + inertia.transpose()) * 0.5 })
}

/// Format: metres; a home is smaller, and single precision still tells millimetres there.
pub(crate) const FAR_M: f64 = 1e3;

fn is_rotation(m: &Matrix3<f64>) -> bool {
    (m.transpose() * m - Matrix3::identity()).norm() < 1e-6 && m.determinant() > 0.0
}

fn is_near(p: &Point) -> bool {
    p.coords.iter().all(|c| c.abs() < FAR_M)
}

impl Solid {
    /// Whether a simulator can load it.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn check(&self) -> Result<(), String> {
        let b = &self.shape;
        let sizes = b.half.iter().all(|h| *h > 0.0 && *h < FAR_M);
        if sizes && is_rotation(&b.rotation) && is_near(&b.center) {
            return Ok(());
        }
        Err(format!(
            "box {}: sizes must be positive, axes right-handed and orthonormal, all within {FAR_M} m",
            self.name
        ))
    }
}

impl Furniture {
    /// Whether a simulator can load it, names apart.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn check(&self) -> Result<(), String> {
        let id = &self.part.id;
        self.carcass.iter().chain(&self.part.solids).try_for_each(Solid::check)?;
        if self.part.solids.is_empty() || self.carcass.is_empty() {
            return Err(format!("{id}: a part and its base need at least one box each"));
        }
        let joint = &self.part.joint;
        let unit = (joint.articulation.axis.norm() - 1.0).abs() < 1e-6;
        // A turn, or the length of a room.
        let most = match joint.articulation.kind {
            JointKind::Revolute => std::f64::consts::TAU,
            JointKind::Prismatic => 10.0,
        };
        let opens = joint.upper > 0.0 && joint.upper <= most;
        let resists = [joint.damping, joint.friction].iter().all(|x| x.is_finite() && *x >= 0.0);
        if !(unit && opens && resists && is_near(&joint.articulation.origin) && is_near(&self.part.handle)) {
            return Err(format!(
                "{id}: the axis must be a unit vector, the upper limit positive and at most {most:.2}, damping and friction \
                 not negative, origin and handle within {FAR_M} m"
            ));
        }
        let openings = [joint.observed, joint.expected].iter().all(|x| x.is_finite());
        if !(openings && is_rotation(&self.part.bounds.rotation)) {
            return Err(format!(
                "{id}: observed and expected opening must be finite, the axes of its bounds a rotation"
            ));
        }
        Ok(())
    }
}

impl Part {
    /// Whether its weight (boxes of `density`, kg/m^3) overcomes its friction when it is closed and no spring carries it.
    #[must_use]
    pub fn opens_by_itself(&self, up: &Vector, density: f64) -> bool {
        mass_properties(&self.solids, density).is_some_and(|mass| {
            let weight = up * (-GRAVITY * mass.mass);
            self.joint.articulation.effort(&mass.center, &weight) > self.joint.friction
        })
    }
}

impl Joint {
    /// The most force (N) or torque (N m) an actuator or a person may apply through the joint.
    #[must_use]
    pub fn effort(&self, drives: &Drives) -> f64 {
        match self.articulation.kind {
            JointKind::Revolute => drives.hinge_effort,
            JointKind::Prismatic => drives.slide_effort,
        }
    }

    /// Velocity limit, rad/s or m/s.
    #[must_use]
    pub fn velocity(&self, drives: &Drives) -> f64 {
        match self.articulation.kind {
            JointKind::Revolute => drives.hinge_velocity,
            JointKind::Prismatic => drives.slide_velocity,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(center: Point, half: f64) -> OrientedBox {
        OrientedBox { center, half: Vector::repeat(half), rotation: Matrix3::identity() }
    }

    #[test]
    fn iou_of_half_overlapping_cubes_is_a_third() {
        let a = cube(Point::origin(), 0.5);
        let b = cube(Point::new(0.5, 0.0, 0.0), 0.5);
        assert!((box_iou(&a, &b) - 1.0 / 3.0).abs() < 0.02);
        assert!((box_iou(&a, &a) - 1.0).abs() < 1e-9);
        assert_eq!(box_iou(&a, &cube(Point::new(9.0, 0.0, 0.0), 0.5)), 0.0);
    }

    #[test]
    fn two_half_boxes_weigh_like_the_whole() {
        let solid = |center: Point, half: Vector| Solid {
            name: String::new(),
            role: Role::Front,
            shape: OrientedBox { center, half, rotation: Matrix3::identity() },
            seen: true,
        };
        let whole = mass_properties(&[solid(Point::origin(), Vector::new(0.4, 0.1, 0.3))], 700.0).unwrap();
        let halves = mass_properties(
            &[
                solid(Point::new(-0.2, 0.0, 0.0), Vector::new(0.2, 0.1, 0.3)),
                solid(Point::new(0.2, 0.0, 0.0), Vector::new(0.2, 0.1, 0.3)),
            ],
            700.0,
        )
        .unwrap();
        assert!((whole.mass - halves.mass).abs() < 1e-9 && (whole.inertia - halves.inertia).norm() < 1e-9);
    }

    #[test]
    fn drives_are_written_where_they_are_not_the_usual_ones() {
        let mut twin = Twin {
            name: String::new(),
            density_kg_per_m3: 700.0,
            drives: Drives::default(),
            furniture: Vec::new(),
            room: Vec::new(),
            left_out: Vec::new(),
        };
        assert!(!serde_json::to_string(&twin).unwrap().contains("drives"));
        twin.drives.hinge_effort = 30.0;
        let back: Twin = serde_json::from_str(&serde_json::to_string(&twin).unwrap()).unwrap();
        assert_eq!(back, twin);
    }

    #[test]
    fn boxes_are_written_as_rows_and_read_back() {
        let b = OrientedBox {
            center: Point::new(1.0, 2.0, 3.0),
            half: Vector::new(0.1, 0.2, 0.3),
            rotation: *Rotation3::from_euler_angles(0.1, 0.2, 0.3).matrix(),
        };
        let text = serde_json::to_string(&b).unwrap();
        let back: OrientedBox = serde_json::from_str(&text).unwrap();
        assert!((back.rotation - b.rotation).norm() < 1e-12);
        assert!(text.contains("\"R\":[[0.93"), "{text}");
    }
}
