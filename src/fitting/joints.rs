//! Joints that another program found, built as our own are.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, UnitQuaternion};
use serde::Deserialize;

use super::joint_front::{LEAF_M, front_of, front_side};
use super::{Plan, Rules, bounds_of, limits, overlap, placing::place};
use crate::articulation::{Articulation, JointKind};
use crate::config::{self, Priors};
use crate::error::{Error, Result};
use crate::geometry::{Face, Rect};
use crate::math::{Point, Vector, length, plain, reject, rounded, unit};
use crate::pipeline::SceneJoint;
use crate::twin::{Furniture, LeftOut, OrientedBox, Role, Solid, Twin};

/// Format: coordinates beyond this are millimetres or centimetres that nobody has converted: no home is as wide.
const FAR_M: f64 = 100.0;
/// Format: half sizes and travels beyond this are, too.
const LARGE_M: f64 = 10.0;
/// Format: a hinge opens by half a turn at most, radians; files round.
const MOST_TURN_RAD: f64 = std::f64::consts::PI + 0.1;
/// Format: boxes are measured to centimetres, and rails pull out a little further than a drawer is long, metres.
const OVERRUN_M: f64 = 0.05;

/// Format: how deep furniture is taken to be, whatever a file says, metres.
const DEPTHS_M: [f64; 2] = [0.15, 5.0];

/// Length of one unit of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Units {
    /// Metres.
    #[default]
    M,
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
}

impl Units {
    fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 0.01,
            Self::Mm => 0.001,
        }
    }
}

/// Joints of a scene, as `docs/joints-format.md` has them.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointsFile {
    /// Name of the scene.
    pub scene: String,
    /// Up in the file's frame; the twin is turned so that it becomes +Z.
    #[serde(default = "Vector::z")]
    pub up: Vector,
    /// Unit of all lengths.
    #[serde(default)]
    pub units: Units,
    /// The joints.
    pub joints: Vec<Entry>,
}

/// One joint with its part, closed. What is needed is optional here so that an error can name the joint it is missing in.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Name, unique in the file: letters, digits and `_`.
    pub id: String,
    /// Needed: `revolute` or `prismatic`.
    #[serde(rename = "type")]
    pub kind: Option<String>,
    /// Needed: unit vector.
    pub axis: Option<Vector>,
    /// Needed: a point on the hinge; of a slide, any point.
    pub origin: Option<Point>,
    /// Needed: lower and upper limit along the axis, rad or a length; 0 is closed.
    pub range: Option<[f64; 2]>,
    /// Needed: box around the moving part without its handle.
    pub part_box: Option<OrientedBox>,
    /// Where a hand holds it.
    pub handle: Option<Point>,
    /// Direction that its face looks in.
    pub front: Option<Vector>,
    /// Box around the furniture: says how deep it is.
    pub base_box: Option<OrientedBox>,
    /// Words for people.
    pub label: Option<String>,
    /// The part's own boxes, instead of the front and the tray that would be made.
    #[serde(default)]
    pub boxes: Vec<OrientedBox>,
}

/// A joint ready to be built.
struct Found {
    joint: SceneJoint,
    face: Face,
    rect: Rect,
    depth: f64,
    boxes: Vec<OrientedBox>,
}

/// Builds a twin of joints found elsewhere: fronts, handles, trays and furniture as for our own joints, +Z up, metres.
///
/// A range that opens to the negative side is turned around, axis and all; one that goes both ways keeps its longer side.
///
/// # Errors
/// Naming the joint, the field, and what it should be.
pub fn from_joints(file: &JointsFile, config: &config::Fitting, priors: &Priors) -> Result<Twin> {
    if file.joints.is_empty() {
        return Err(Error::Export("joints: the list is empty".to_owned()));
    }
    let frame = Frame { turn: upright(&file.up)?, metres: file.units.metres() };
    let mut ids = BTreeSet::new();
    let mut all = Vec::with_capacity(file.joints.len());
    for entry in &file.joints {
        if !ids.insert(entry.id.as_str()) {
            return Err(fault(&entry.id, "id", "is used twice"));
        }
        all.push(found(entry, &frame, priors)?);
    }
    let mut rects: Vec<(Face, Rect)> = all.iter().map(|f| (f.face, f.rect)).collect();
    overlap::separate(&mut rects, &priors.boards);
    let mut placed: Vec<(usize, Furniture)> = Vec::new();
    let mut left_out = Vec::new();
    for (i, (found, (face, rect))) in all.iter().zip(rects).enumerate() {
        let plan = Plan {
            joint: &found.joint,
            observed: found.joint.observed_range,
            articulation: found.joint.joint,
            face,
            rect,
            seen: true,
            assumed: false,
            up: Vector::z(),
        };
        let boards = config::Boards { carcass_depth_m: found.depth, ..priors.boards.clone() };
        let own = Priors { boards, ..priors.clone() };
        let built = place(&plan, &placed, Rules { config, priors: &own })
            .map_err(|why| why.told("its front shares space with furniture before it in the list"))
            .and_then(|piece| finished(piece, found, &placed, Rules { config, priors }).map_err(str::to_owned))
            .and_then(|piece| piece.check().map(|()| piece));
        match built {
            Ok(piece) => placed.push((i, piece)),
            Err(reason) => left_out.push(LeftOut { id: found.joint.id.clone(), reason }),
        }
    }
    Ok(Twin {
        name: file.scene.clone(),
        density_kg_per_m3: priors.boards.density_kg_per_m3,
        drives: priors.drives.clone(),
        furniture: placed.into_iter().map(|(_, f)| f).collect(),
        room: Vec::new(),
        left_out,
    })
}

/// A piece with the part's own boxes, where there are any, and without the boards that its part would hit on its way.
fn finished(
    mut piece: Furniture,
    found: &Found,
    placed: &[(usize, Furniture)],
    rules: Rules,
) -> std::result::Result<Furniture, &'static str> {
    /// Numerics: poses on the way that are looked at.
    const STEPS: u32 = 20;
    let part = &mut piece.part;
    // The range is given: nothing is expected beyond it.
    (part.joint.upper, part.joint.expected) = (found.joint.observed_range, found.joint.observed_range);
    if !found.boxes.is_empty() {
        let own = found.boxes.iter().enumerate().map(|(i, shape)| Solid {
            name: format!("{}_box_{i}", part.id),
            role: Role::Front,
            shape: *shape,
            seen: true,
        });
        let handle = part.solids.iter().filter(|s| s.role == Role::Handle).cloned();
        part.solids = own.chain(handle).collect();
        part.bounds = bounds_of(&part.solids, &found.face);
    }
    part.joint.balanced =
        limits::balanced(part, &Vector::z(), rules.priors.boards.density_kg_per_m3, &[], rules.config);
    let (joint, solids) = (part.joint, &part.solids);
    let way: Vec<OrientedBox> = (0..=STEPS)
        .map(|i| joint.articulation.motion(joint.upper * f64::from(i) / f64::from(STEPS)))
        .flat_map(|motion| solids.iter().map(move |s| s.shape.moved(&motion)))
        .collect();
    piece.carcass.retain(|board| !way.iter().any(|b| overlap::boxes(b, &board.shape)));
    if piece.carcass.is_empty() {
        return Err("every board of its furniture would be in its way");
    }
    if placed.iter().any(|(_, other)| overlap::furniture(other, &piece)) {
        return Err("its boxes share space with furniture before it in the list");
    }
    Ok(piece)
}

/// An error that names the joint and the field.
pub(super) fn fault(id: &str, field: &str, message: &str) -> Error {
    Error::Export(format!("joint {id}: {field}: {message}"))
}

/// From the file's frame and unit to the twin's.
struct Frame {
    turn: UnitQuaternion<f64>,
    metres: f64,
}

impl Frame {
    fn point(&self, id: &str, field: &str, p: &Point) -> Result<Point> {
        if !p.coords.iter().all(|c| c.is_finite()) {
            return Err(fault(id, field, "has a coordinate that is not a finite number"));
        }
        let p = Point::from(self.turn * p.coords * self.metres);
        let far = length(&p.coords);
        if far > FAR_M {
            return Err(fault(id, field, &format!("lies {} m from the origin; {HINT}", rounded(far, 0))));
        }
        Ok(p)
    }

    fn direction(&self, id: &str, field: &str, d: &Vector) -> Result<Vector> {
        match unit(d) {
            Some(direction) => Ok(self.turn * direction),
            None => Err(fault(id, field, "is no direction")),
        }
    }

    fn shape(&self, id: &str, field: &str, b: &OrientedBox) -> Result<OrientedBox> {
        let center = self.point(id, &format!("{field}.center"), &b.center)?;
        let half = b.half * self.metres;
        if !half.iter().all(|h| h.is_finite() && *h > 0.0) {
            return Err(fault(id, &format!("{field}.half"), "half sizes must be positive"));
        }
        if half.max() > LARGE_M {
            let message = format!("a half size is {} m; {HINT}", rounded(half.max(), 0));
            return Err(fault(id, &format!("{field}.half"), &message));
        }
        // Files round: orthonormal to three digits is meant to be a rotation.
        let column = |i: usize| b.rotation.column(i).into_owned();
        let squared = unit(&column(0))
            .and_then(|x| unit(&reject(&column(1), &x)).map(|y| Matrix3::from_columns(&[x, y, x.cross(&y)])))
            .filter(|m| (m - b.rotation).norm() < 1e-2);
        match squared {
            Some(m) => Ok(OrientedBox { center, half, rotation: self.turn.to_rotation_matrix().matrix() * m }),
            None => Err(fault(
                id,
                &format!("{field}.R"),
                "its columns must be unit vectors, right-handed, square to each other",
            )),
        }
    }
}

const HINT: &str = "are these millimetres or centimetres? (\"units\": \"mm\" or \"cm\")";

/// The turn that brings a direction to +Z: how a twin lies in its file's frame.
///
/// # Errors
/// Where it is no direction.
pub fn upright(up: &Vector) -> Result<UnitQuaternion<f64>> {
    let Some(up) = unit(up) else {
        return Err(Error::Export("up: is no direction".to_owned()));
    };
    // Straight down, half a turn about any level direction does.
    Ok(UnitQuaternion::rotation_between(&up, &Vector::z())
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector::x_axis(), std::f64::consts::PI)))
}

/// A joint with its axis turned so that positive opens, and how far it opens.
fn articulation(entry: &Entry, frame: &Frame) -> Result<(Articulation, f64)> {
    let id = entry.id.as_str();
    let missing = |field: &str| fault(id, field, "is missing");
    let kind = match entry.kind.as_deref() {
        Some("revolute") => JointKind::Revolute,
        Some("prismatic") => JointKind::Prismatic,
        Some(other) => {
            let message = format!("\"{other}\" is neither \"revolute\" nor \"prismatic\"");
            return Err(fault(id, "type", &message));
        }
        None => return Err(missing("type")),
    };
    let axis = entry.axis.ok_or_else(|| missing("axis"))?;
    let long = length(&axis);
    // Not a number is not near one either.
    if (long - 1.0).abs().is_nan() || (long - 1.0).abs() > 1e-3 {
        return Err(fault(id, "axis", &format!("has length {}: a unit vector is needed", rounded(long, 4))));
    }
    let axis = frame.direction(id, "axis", &axis)?;
    let origin = frame.point(id, "origin", &entry.origin.ok_or_else(|| missing("origin"))?)?;
    let range = entry.range.ok_or_else(|| missing("range"))?;
    let [low, high] = match kind {
        JointKind::Revolute => range,
        JointKind::Prismatic => range.map(|q| q * frame.metres),
    };
    if !(low.is_finite() && high.is_finite()) {
        return Err(fault(id, "range", "has a limit that is not a finite number"));
    }
    if low >= high {
        return Err(fault(
            id,
            "range",
            &format!("[{}, {}] is reversed: the lower limit comes first, 0 is closed", plain(low), plain(high)),
        ));
    }
    let joint = Articulation { kind, axis, origin };
    let (joint, upper) = if high >= -low { (joint, high) } else { (joint.reversed(), -low) };
    let opens = rounded(upper, 1);
    match kind {
        JointKind::Revolute if upper > std::f64::consts::TAU => {
            Err(fault(id, "range", &format!("opens by {opens} rad: are these degrees?")))
        }
        JointKind::Revolute if upper > MOST_TURN_RAD => {
            let message = format!("opens by {opens} rad, more than half a turn: are these degrees? 0 is closed");
            Err(fault(id, "range", &message))
        }
        JointKind::Prismatic if upper > LARGE_M => Err(fault(id, "range", &format!("opens by {opens} m; {HINT}"))),
        _ => Ok((joint, upper)),
    }
}

/// Checks an entry and finds its front.
fn found(entry: &Entry, frame: &Frame, priors: &Priors) -> Result<Found> {
    let id = entry.id.as_str();
    if id.is_empty()
        || !id.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        || id.starts_with(|c: char| c.is_ascii_digit())
    {
        return Err(fault(id, "id", "only letters, digits and _, the first no digit, are safe in all formats"));
    }
    let (joint, upper) = articulation(entry, frame)?;
    let part = entry.part_box.ok_or_else(|| fault(id, "part_box", "is missing: the box around the part, closed"))?;
    let part = frame.shape(id, "part_box", &part)?;
    hangs_at(id, &joint, &part)?;
    let handle = entry.handle.map(|p| frame.point(id, "handle", &p)).transpose()?;
    let front = entry.front.map(|d| frame.direction(id, "front", &d)).transpose()?;
    let base = entry.base_box.map(|b| frame.shape(id, "base_box", &b)).transpose()?;
    let boxes: Vec<OrientedBox> = entry
        .boxes
        .iter()
        .enumerate()
        .map(|(i, b)| frame.shape(id, &format!("boxes[{i}]"), b))
        .collect::<Result<_>>()?;

    let out = front_side(id, &joint, &part, handle.as_ref(), front.as_ref())?;
    let (face, rect, thick) = front_of(id, &joint, &part, handle.as_ref(), &out, &priors.handles)?;
    let grip = handle.unwrap_or(face.center);
    // As deep as its furniture, else as a part that is a drawer, else as furniture is.
    let depth = match base {
        Some(base) => base.corners().iter().map(|c| -face.coordinates(c)[2]).fold(0.0, f64::max),
        None if thick > LEAF_M => thick + priors.boards.thickness_m + 2.0 * priors.boards.gap_m,
        None => priors.boards.carcass_depth_m,
    };
    stays_in(id, &joint, upper, &[Some(part), base], if thick > LEAF_M { 0.0 } else { depth })?;
    let joint = SceneJoint {
        id: entry.id.clone(),
        joint,
        clips: Vec::new(),
        told: Vec::new(),
        furniture: entry.label.clone(),
        type_probability: None,
        grip,
        face: Some(face),
        part: Some(rect),
        joint_probability: None,
        uncertainty: None,
        moved: Vec::new(),
        observed_range: upper,
        hypotheses: Vec::new(),
    };
    Ok(Found { joint, face, rect, depth: depth.clamp(DEPTHS_M[0], DEPTHS_M[1]), boxes })
}

/// A drawer stays in its furniture: it opens by no more than one of some boxes is long along its axis, or, where only its front
/// is known, than furniture is deep.
fn stays_in(id: &str, joint: &Articulation, upper: f64, boxes: &[Option<OrientedBox>], depth: f64) -> Result<()> {
    if joint.kind == JointKind::Revolute {
        return Ok(());
    }
    let along = |b: &OrientedBox| 2.0 * (b.rotation.transpose() * joint.axis).abs().dot(&b.half);
    let long = boxes.iter().flatten().map(along).fold(depth, f64::max);
    if upper <= long + OVERRUN_M {
        return Ok(());
    }
    let message = format!(
        "opens by {upper:.2} m, and what slides is {long:.2} m long: a slide opens by its length at most; give the part's whole \
         box, or the furniture's (base_box)"
    );
    Err(fault(id, "range", &message))
}

/// A leaf hangs at its hinge: one whose line passes it farther off than the leaf is large is in another frame or unit.
fn hangs_at(id: &str, joint: &Articulation, part: &OrientedBox) -> Result<()> {
    let radius = part.half.norm();
    let distance = (joint.line().project(&part.center) - part.center).norm();
    // From the middle to the rim, and the whole diagonal beyond it.
    if joint.kind == JointKind::Prismatic || distance <= 3.0 * radius {
        return Ok(());
    }
    let message = format!(
        "the hinge passes {:.1} m beside the part, which measures {:.1} m from corner to corner; give a point on the hinge and \
         the part's box in one frame and one unit",
        distance - radius,
        2.0 * radius
    );
    Err(fault(id, "origin", &message))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    fn file(text: &str) -> JointsFile {
        serde_json::from_str(text).unwrap()
    }

    const UPRIGHT: &str = "[[1,0,0],[0,1,0],[0,0,1]]";

    /// A door with its hinge on the left, looking to -y, and a drawer beside it.
    fn example() -> JointsFile {
        file(&format!(
            r#"{{"scene": "s", "joints": [
                {{"id": "door", "type": "revolute", "axis": [0,0,-1], "origin": [-0.3,0,1], "range": [0, 1.6],
                 "handle": [0.25,-0.04,1],
                 "part_box": {{"center": [0,0.01,1], "half": [0.3,0.01,0.35], "R": {UPRIGHT}}}}},
                {{"id": "drawer", "type": "prismatic", "axis": [0,-1,0], "origin": [0.7,0,0.8], "range": [0, 0.3],
                 "label": "cutlery",
                 "part_box": {{"center": [0.7,0.2,0.8], "half": [0.3,0.2,0.1], "R": {UPRIGHT}}}}}]}}"#
        ))
    }

    fn built(file: &JointsFile) -> Twin {
        let twin = from_joints(file, &config::Fitting::default(), &Priors::default()).unwrap();
        assert!(twin.left_out.is_empty(), "{:?}", twin.left_out);
        twin
    }

    #[test]
    fn what_was_given_is_what_is_built() {
        let twin = built(&example());
        let [door, drawer] = [0, 1].map(|i| &twin.furniture[i].part);
        assert_eq!((door.joint.articulation.axis, door.joint.upper), (-Vector::z(), 1.6));
        let line = door.joint.articulation.line();
        assert!((line.project(&Point::new(-0.3, 0.0, 1.0)) - Point::new(-0.3, 0.0, 1.0)).norm() < 1e-12);
        assert!((door.handle - Point::new(0.25, -0.035, 1.0)).norm() < 1e-9, "{}", door.handle);
        assert!((door.joint.articulation.motion(1.0) * door.handle).y < -0.3);
        assert_eq!((drawer.label.as_str(), drawer.joint.upper), ("cutlery", 0.3));
        assert!((drawer.handle - Point::new(0.7, -0.035, 0.8)).norm() < 1e-9, "{}", drawer.handle);
    }

    #[test]
    fn negative_ranges_other_units_and_other_ups_are_the_same_twin() {
        let wanted = built(&example());
        let mut other = example();
        other.units = Units::Mm;
        other.up = Vector::y();
        // File from twin: its +Y is up.
        let turn = Rotation3::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2);
        let long = |p: Point| turn * p * 1000.0;
        for e in &mut other.joints {
            e.axis = e.axis.map(|a| -(turn * a));
            e.range = e.range.map(|[low, high]| {
                let unit = if e.kind.as_deref() == Some("prismatic") { 1000.0 } else { 1.0 };
                [-high * unit, -low * unit]
            });
            (e.origin, e.handle) = (e.origin.map(long), e.handle.map(long));
            e.part_box = e.part_box.map(|b| OrientedBox {
                center: long(b.center),
                half: b.half * 1000.0,
                rotation: turn.matrix() * b.rotation,
            });
        }
        let twin = built(&other);
        for (a, b) in twin.furniture.iter().zip(&wanted.furniture) {
            assert!((a.part.joint.articulation.axis - b.part.joint.articulation.axis).norm() < 1e-9);
            assert!(
                (a.part.handle - b.part.handle).norm() < 1e-9 && (a.part.joint.upper - b.part.joint.upper).abs() < 1e-9
            );
            for (s, t) in a.carcass.iter().chain(&a.part.solids).zip(b.carcass.iter().chain(&b.part.solids)) {
                assert!((s.shape.center - t.shape.center).norm() < 1e-9, "{}", s.name);
            }
        }
    }

    #[test]
    fn a_parts_own_boxes_take_the_place_of_ours() {
        let mut given = example();
        given.joints[0].boxes = given.joints[0].part_box.into_iter().collect();
        let twin = built(&given);
        let solids = &twin.furniture[0].part.solids;
        assert_eq!(solids.iter().filter(|s| s.role == Role::Front).count(), 1);
        assert_eq!(Some(solids[0].shape), given.joints[0].part_box);
        assert!(solids.iter().any(|s| s.role == Role::Handle));
    }

    #[test]
    fn a_slide_opens_by_its_length_at_most() {
        let mut given = example();
        for (upper, half_depth, fits) in [(0.42, 0.2, true), (3.0, 0.2, false), (0.5, 0.01, true), (1.0, 0.01, false)] {
            let drawer = &mut given.joints[1];
            drawer.range = Some([0.0, upper]);
            drawer.part_box = drawer.part_box.map(|b| OrientedBox { half: Vector::new(0.3, half_depth, 0.1), ..b });
            let made = from_joints(&given, &config::Fitting::default(), &Priors::default());
            assert_eq!(made.is_ok(), fits, "{upper} {half_depth}: {:?}", made.err().map(|e| e.to_string()));
        }
        given.joints[1].base_box =
            given.joints[1].part_box.map(|b| OrientedBox { half: Vector::new(0.3, 0.5, 0.1), ..b });
        assert!(from_joints(&given, &config::Fitting::default(), &Priors::default()).is_ok());
    }

    #[test]
    fn errors_name_the_joint_and_the_field() {
        type Break = (fn(&mut Entry), &'static str);
        let breaks: [Break; 19] = [
            (|e| e.axis = Some(Vector::new(0.0, 0.0, 2.0)), "joint door: axis: has length 2"),
            (|e| e.axis = Some(Vector::repeat(f64::NAN)), "joint door: axis"),
            (|e| e.axis = None, "joint door: axis: is missing"),
            (|e| e.kind = Some("hinge".to_owned()), "joint door: type: \"hinge\""),
            (|e| e.range = Some([1.0, 0.0]), "joint door: range: [1, 0] is reversed"),
            (|e| e.range = Some([0.0, 90.0]), "joint door: range: opens by 90.0 rad: are these degrees?"),
            (|e| e.range = Some([0.0, f64::INFINITY]), "joint door: range"),
            (|e| e.range = Some([0.0, 5.0]), "joint door: range: opens by 5.0 rad, more than half a turn"),
            (|e| e.range = Some([0.0, 1e200]), "joint door: range: opens by 1e200 rad"),
            (|e| e.handle = Some(Point::new(0.25, -0.9, 1.0)), "joint door: handle: is 0.90 m before"),
            (|e| e.origin = Some(Point::new(1e200, 0.0, 1.0)), "joint door: origin: lies 1e200 m"),
            (|e| e.origin = Some(Point::new(-300.0, 0.0, 1000.0)), "joint door: origin: lies 1044 m"),
            (|e| e.origin = Some(Point::new(-30.0, 0.0, 1.0)), "joint door: origin: the hinge passes 29.5 m beside"),
            (|e| e.part_box = None, "joint door: part_box: is missing"),
            (|e| e.part_box = e.part_box.map(|b| OrientedBox { half: b.half * 1e3, ..b }), "joint door: part_box.half"),
            (|e| e.part_box = e.part_box.map(|b| OrientedBox { rotation: -b.rotation, ..b }), "joint door: part_box.R"),
            (|e| e.handle = Some(Point::new(2.0, 0.0, 1.0)), "joint door: handle: is 1.70 m beside"),
            (|e| e.id = "a door".to_owned(), "joint a door: id"),
            (|e| e.id = "drawer".to_owned(), "joint drawer: id: is used twice"),
        ];
        for (break_it, words) in breaks {
            let mut broken = example();
            break_it(&mut broken.joints[0]);
            let error = from_joints(&broken, &config::Fitting::default(), &Priors::default()).unwrap_err().to_string();
            assert!(error.contains(words), "{error}, not {words}");
        }
    }
}
