//! All axes that the touched part could have: lines, edges of the moving part, arcs of the hand, directions (§3.2).

use nalgebra::Point2;
use serde::{Deserialize, Serialize};

use super::face::Rect;
use super::{Face, LineTrack, ManhattanFrame};
use crate::articulation::{Articulation, JointKind};
use crate::config;
use crate::math::{Point, Vector, circle, unsigned_angle};

/// Where a candidate axis comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AxisSource {
    /// A 3D line seen in several views.
    Line,
    /// Where the face meets another side of the furniture.
    PlaneEdge,
    /// An edge of the part that was seen to move.
    PartEdge,
    /// An edge of the visible face, which may belong to the whole piece of furniture.
    FaceEdge,
    /// The circle that the hand drew.
    HandArc,
    /// The normal of the touched face.
    FaceNormal,
    /// An axis of the touched face, in the face.
    FaceAxis,
    /// A direction of the room.
    Manhattan,
    /// The principal direction of the hand's path.
    HandPath,
    /// Where a front of a usual size has its edge, which nobody saw.
    Assumed,
}

/// Which edge of the face a hinge lies at, seen by the person.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HingeSide {
    /// Left edge, upright axis.
    Left,
    /// Right edge, upright axis.
    Right,
    /// Upper edge, level axis.
    Top,
    /// Lower edge, level axis.
    Bottom,
}

/// One axis that the part could move about or along.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AxisCandidate {
    /// Type, axis and a point on it; the axis' sense opens outward where the face tells.
    pub joint: Articulation,
    /// Where it comes from.
    pub source: AxisSource,
    /// Edge of the face, for hinges in a face.
    pub side: Option<HingeSide>,
    /// Views that saw the line, for lines.
    pub views: usize,
    /// Length of the line, for lines and edges, metres.
    pub length_m: f64,
    /// How well its source places a hinge across its axis: a standard deviation, metres.
    pub position_std_m: f64,
    /// How far the hand's path has moved a hinge from where its source put it, in standard deviations of the source.
    pub shift: f64,
    /// For lines: share of the views shown to a language model in which it took the line for a hinge; 0 without one.
    #[serde(default)]
    pub named: f64,
}

impl AxisCandidate {
    /// A candidate of which no more is known than its joint and where it comes from.
    #[must_use]
    pub fn new(joint: Articulation, source: AxisSource, sources: &config::AxisSources) -> Self {
        let position_std_m = source.position_std_m(sources);
        Self { joint, source, side: None, views: 0, length_m: 0.0, position_std_m, shift: 0.0, named: 0.0 }
    }

    /// A hinge at a 3D line.
    fn at_line(track: &LineTrack, direction: Vector, named: f64, sources: &config::AxisSources) -> Self {
        let joint = Articulation { kind: JointKind::Revolute, axis: direction, origin: track.segment.middle() };
        let source = AxisSource::Line;
        Self {
            views: track.views.len(),
            length_m: track.segment.length(),
            position_std_m: source.position_std_m(sources).hypot(track.position_std_m()),
            named,
            ..Self::new(joint, source, sources)
        }
    }
}

impl AxisSource {
    /// How well the source places a hinge across its axis, metres.
    #[must_use]
    pub fn position_std_m(self, sources: &config::AxisSources) -> f64 {
        match self {
            Self::Line | Self::PlaneEdge => sources.line_std_m,
            Self::PartEdge => sources.part_edge_std_m,
            Self::FaceEdge => sources.face_edge_std_m,
            Self::Assumed => sources.assumed_std_m,
            _ => sources.other_std_m,
        }
    }
}

/// Moves a hinge across its axis to where the paths of the hand and the hinge's source agree best. Slides stay as they are.
#[must_use]
pub fn settled(candidate: &AxisCandidate, paths: &[Vec<Point>], reasoning: &config::Reasoning) -> AxisCandidate {
    if candidate.joint.kind == JointKind::Prismatic {
        return candidate.clone();
    }
    let axis = candidate.joint.axis;
    let e1 = crate::math::any_orthogonal(&axis);
    let e2 = axis.cross(&e1);
    let origin = candidate.joint.origin;
    let arcs: Vec<Vec<Point2<f64>>> = paths
        .iter()
        .map(|path| path.iter().map(|p| Point2::new((p - origin).dot(&e1), (p - origin).dot(&e2))).collect())
        .collect();
    let std_m = candidate.position_std_m;
    let prior = circle::CenterPrior {
        center: Point2::origin(),
        std_m,
        point_std_m: reasoning.hand_std_m,
        effective_samples: reasoning.effective_samples,
    };
    let center = circle::common_center(&arcs, &prior);
    // Farther than that it is another hinge, which has its own candidate.
    if !center.coords.norm().is_finite() || center.coords.norm() > reasoning.settled_within * std_m {
        return candidate.clone();
    }
    let joint = Articulation { origin: origin + e1 * center.x + e2 * center.y, ..candidate.joint };
    let shift = candidate.shift.hypot(center.coords.norm() / std_m);
    AxisCandidate { joint, shift, ..candidate.clone() }
}

/// What the candidates are made from.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// The touched face.
    pub face: Option<&'a Face>,
    /// The part of it that moved.
    pub rect: Option<&'a Rect>,
    /// 3D lines at the region.
    pub tracks: &'a [LineTrack],
    /// Points of the touched furniture, world.
    pub surface: &'a [Point],
    /// For each of them [`AxisCandidate::named`]; may be shorter.
    pub named: &'a [f64],
    /// The room's frame.
    pub manhattan: Option<&'a ManhattanFrame>,
    /// The grip at the closed end.
    pub grip: Point,
    /// The hand's smoothed path.
    pub path: &'a [Point],
}

/// Collects all candidates, hinges first.
#[must_use]
pub fn collect(evidence: &Evidence, config: &config::Inference) -> Vec<AxisCandidate> {
    let mut out = Vec::new();
    hinges(evidence, config, &mut out);
    slides(evidence, config, &mut out);
    for candidate in &mut out {
        if let Some(face) = evidence.face {
            candidate.joint = outward(candidate.joint, face, &evidence.grip);
        }
    }
    out
}

/// The axes of a part whose front is assumed: hinges at lines near the front and where fronts of usual sizes have their edges,
/// the hand's arcs, slides along the front's own directions. `evidence.path` leads from closed to open.
#[must_use]
pub fn on_assumed(evidence: &Evidence, config: &config::Inference, fronts: &config::Fronts) -> Vec<AxisCandidate> {
    let Some(face) = evidence.face else { return collect(evidence, config) };
    let snap = config.snap_deg.to_radians();
    let mut out = Vec::new();
    for track in evidence.tracks {
        let middle = track.segment.middle();
        let Some((direction, upright)) = snapped(face, &track.segment.line.direction, snap) else { continue };
        let [right, up, height] = face.coordinates(&middle);
        let aside = if upright { right } else { up };
        // The front's heading is off by some degrees, and its place by what handles stand off.
        if height.abs() <= config.at_face_m + snap.sin() * aside.abs() && aside.abs() >= config.min_radius_m {
            let side = Some(side_of(aside, upright));
            out.push(AxisCandidate { side, ..AxisCandidate::at_line(track, direction, 0.0, &config.sources) });
        }
    }
    for &offset in &fronts.usual_levers_m {
        for (axis, offset) in [(0, -offset), (0, offset), (1, -offset), (1, offset)] {
            out.push(edge(face, axis, [offset, 0.0], 0.0, AxisSource::Assumed, &config.sources));
        }
    }
    for direction in [face.up, face.right] {
        if let Some(joint) = arc_about(evidence.path, &direction) {
            let side = Some(side_at(face, &direction, &joint.origin));
            let shift = implausibility(face, &joint, &config.arcs);
            out.push(AxisCandidate { side, shift, ..AxisCandidate::new(joint, AxisSource::HandArc, &config.sources) });
        }
    }
    let origin = evidence.path.first().copied().unwrap_or(evidence.grip);
    let own = [face.normal, face.right, face.up];
    for (axis, source) in own.into_iter().zip([AxisSource::FaceNormal, AxisSource::FaceAxis, AxisSource::FaceAxis]) {
        let joint = Articulation { kind: JointKind::Prismatic, axis, origin };
        out.push(AxisCandidate::new(joint, source, &config.sources));
    }
    for candidate in &mut out {
        candidate.joint = outward(candidate.joint, face, &evidence.grip);
    }
    out
}

/// Geometry: below this share of the motion along the face's normal (17 degrees) the sign of that share is noise: the joint moves
/// within its face.
pub const IN_FACE: f64 = 0.3;

/// Whether a joint slides along a front of that outward normal, where a leaf shows no depth of its own.
#[must_use]
pub fn within_front(joint: &Articulation, normal: &Vector) -> bool {
    joint.kind == JointKind::Prismatic && joint.axis.dot(normal).abs() < IN_FACE
}

/// Share of the grip's first motion that leaves the face, -1..1; not a number for a hinge through the grip.
#[must_use]
pub fn outwardness(joint: &Articulation, face: &Face, grip: &Point) -> f64 {
    match joint.kind {
        JointKind::Revolute => joint.axis.cross(&(grip - joint.origin)).normalize().dot(&face.normal),
        JointKind::Prismatic => joint.axis.dot(&face.normal),
    }
}

/// Gives the axis the sense that moves the grip out of the face; a slide within the face keeps its sense.
#[must_use]
pub fn outward(joint: Articulation, face: &Face, grip: &Point) -> Articulation {
    if outwardness(&joint, face, grip) < -IN_FACE { joint.reversed() } else { joint }
}

fn hinges(evidence: &Evidence, config: &config::Inference, out: &mut Vec<AxisCandidate>) {
    let snap = config.snap_deg.to_radians();
    let named = |i: usize| evidence.named.get(i).copied().unwrap_or(0.0);
    if let Some(face) = evidence.face {
        for (i, track) in evidence.tracks.iter().enumerate() {
            let Some((direction, upright)) = snapped(face, &track.segment.line.direction, snap) else { continue };
            let [right, up, height] = face.coordinates(&track.segment.middle());
            // A hinge lies at its face: deeper or nearer lines are the carcass, the floor, other furniture.
            if height.abs() <= config.at_face_m {
                let side = Some(side_of(if upright { right } else { up }, upright));
                out.push(AxisCandidate { side, ..AxisCandidate::at_line(track, direction, named(i), &config.sources) });
            }
        }
        let middles = evidence.rect.map_or([0.0; 2], middles);
        for (axis, offset, length_m) in plane_edges(face, evidence.surface, &config.plane_edges) {
            out.push(edge(face, axis, [offset, middles[1 - axis]], length_m, AxisSource::PlaneEdge, &config.sources));
        }
        if let Some(rect) = evidence.rect {
            out.extend(edges(face, rect, AxisSource::PartEdge, &config.sources));
        }
        out.extend(edges(face, &Rect { bounds: face.extent }, AxisSource::FaceEdge, &config.sources));
    } else {
        let lines = evidence.tracks.iter().enumerate();
        out.extend(lines.map(|(i, t)| AxisCandidate::at_line(t, t.segment.line.direction, named(i), &config.sources)));
    }
    let directions: Vec<Vector> = match evidence.face {
        Some(face) => vec![face.up, face.right],
        None => evidence.manhattan.map_or_else(Vec::new, |m| m.axes.to_vec()),
    };
    for direction in directions {
        if let Some(joint) = arc_about(evidence.path, &direction) {
            let shift = evidence.face.map_or(0.0, |face| implausibility(face, &joint, &config.arcs));
            let side = evidence.face.map(|face| side_at(face, &direction, &joint.origin));
            out.push(AxisCandidate { side, shift, ..AxisCandidate::new(joint, AxisSource::HandArc, &config.sources) });
        }
    }
}

/// Hinges at the four sides of each outline that a part could have; sides next to each other are one. The sense moves the grip
/// (world) out of the face.
#[must_use]
pub fn at_sides(face: &Face, outlines: &[Rect], grip: &Point, sources: &config::AxisSources) -> Vec<AxisCandidate> {
    /// Geometry: sides that are nearer to each other are one, metres; less than an outline is known to.
    const ONE_M: f64 = 0.02;
    let mut out: Vec<AxisCandidate> = Vec::new();
    for mut hinge in outlines.iter().flat_map(|rect| edges(face, rect, AxisSource::PartEdge, sources)) {
        hinge.joint = outward(hinge.joint, face, grip);
        let line = hinge.joint.line();
        if !out.iter().any(|other| other.side == hinge.side && line.distance(&other.joint.origin) < ONE_M) {
            out.push(hinge);
        }
    }
    out
}

/// Hinges at the four sides of a rectangle on a face.
fn edges(
    face: &Face,
    rect: &Rect,
    source: AxisSource,
    sources: &config::AxisSources,
) -> impl Iterator<Item = AxisCandidate> {
    let (bounds, middles, size) = (rect.bounds, middles(rect), rect.size());
    [0, 1].into_iter().flat_map(move |axis| {
        bounds[axis].map(|offset| edge(face, axis, [offset, middles[1 - axis]], size[1 - axis], source, sources))
    })
}

fn middles(rect: &Rect) -> [f64; 2] {
    rect.bounds.map(|b| 0.5 * (b[0] + b[1]))
}

/// A hinge at an edge on a face: 0 = upright or 1 = level, its offset across and its middle along, its length, metres.
fn edge(
    face: &Face,
    axis: usize,
    [offset, middle]: [f64; 2],
    length_m: f64,
    source: AxisSource,
    sources: &config::AxisSources,
) -> AxisCandidate {
    let (axis, origin, upright) = match axis {
        0 => (face.up, face.point(offset, middle, 0.0), true),
        _ => (face.right, face.point(middle, offset, 0.0), false),
    };
    let joint = Articulation { kind: JointKind::Revolute, axis, origin };
    AxisCandidate { side: Some(side_of(offset, upright)), length_m, ..AxisCandidate::new(joint, source, sources) }
}

/// Where other sides of the furniture meet its face: (0 = upright edge or 1 = level one, its offset, the length seen), in face
/// coordinates. A side is a dense thin slab of points behind the face, square to it.
fn plane_edges(face: &Face, surface: &[Point], rules: &config::PlaneEdges) -> Vec<(usize, f64, f64)> {
    let [nearest_m, farthest_m] = rules.behind_m;
    let behind: Vec<[f64; 3]> =
        surface.iter().map(|p| face.coordinates(p)).filter(|c| (nearest_m..farthest_m).contains(&-c[2])).collect();
    let mut out = Vec::new();
    for axis in [0, 1] {
        let mut slabs: std::collections::BTreeMap<i64, Vec<[f64; 3]>> = std::collections::BTreeMap::new();
        for c in &behind {
            slabs.entry((c[axis] / rules.slab_m).floor() as i64).or_default().push(*c);
        }
        let empty = Vec::new();
        for (slab, points) in &slabs {
            // A side is seen over some depth and some length; a slab with a small share of all is the inside's clutter.
            let beside = [slab - 1, slab + 1].map(|s| slabs.get(&s).unwrap_or(&empty).len());
            if rules.most_slabs * points.len() < behind.len() || points.len() <= beside[0].max(beside[1]) {
                continue;
            }
            let spread = |k: usize| {
                let values: Vec<f64> = points.iter().map(|c| c[k]).collect();
                let low = crate::math::stats::quantile(&values, rules.rim_share);
                low.zip(crate::math::stats::quantile(&values, 1.0 - rules.rim_share)).map_or(0.0, |(l, h)| h - l)
            };
            let length = spread(1 - axis);
            if points.len() >= rules.least_points && length > rules.least_length_m && spread(2) > rules.least_depth_m {
                let values: Vec<f64> = points.iter().map(|c| c[axis]).collect();
                out.extend(crate::math::stats::median(&values).map(|offset| (axis, offset, length)));
            }
        }
    }
    out
}

/// How far the centre of an arc lies from where a hinge can be, in standard deviations: off the plane of the face, or
/// beyond the end of the furniture. A short noisy arc has its centre anywhere along its bisector.
fn implausibility(face: &Face, joint: &Articulation, arcs: &config::Arcs) -> f64 {
    let at = face.coordinates(&joint.origin);
    let across = usize::from(unsigned_angle(&joint.axis, &face.up) > unsigned_angle(&joint.axis, &face.right));
    let [low, high] = face.extent[across];
    let beyond = (low - at[across]).max(at[across] - high).max(0.0);
    (at[2] / arcs.off_plane_std_m).hypot(beyond / arcs.beyond_std_m)
}

/// The edge at which a hinge through `origin` along the face's `axis` lies.
#[must_use]
pub fn side_at(face: &Face, axis: &Vector, origin: &Point) -> HingeSide {
    let [right, up, _] = face.coordinates(origin);
    if unsigned_angle(axis, &face.up) < unsigned_angle(axis, &face.right) {
        side_of(right, true)
    } else {
        side_of(up, false)
    }
}

fn side_of(offset: f64, upright: bool) -> HingeSide {
    match (upright, offset < 0.0) {
        (true, true) => HingeSide::Left,
        (true, false) => HingeSide::Right,
        (false, true) => HingeSide::Bottom,
        (false, false) => HingeSide::Top,
    }
}

/// The face's up or right axis if the direction is near one, and whether it is the upright one.
fn snapped(face: &Face, direction: &Vector, tolerance: f64) -> Option<(Vector, bool)> {
    if unsigned_angle(direction, &face.up) <= tolerance {
        Some((face.up, true))
    } else if unsigned_angle(direction, &face.right) <= tolerance {
        Some((face.right, false))
    } else {
        None
    }
}

fn slides(evidence: &Evidence, config: &config::Inference, out: &mut Vec<AxisCandidate>) {
    let origin = evidence.path.first().copied().unwrap_or(evidence.grip);
    let mut push = |axis: Vector, source: AxisSource| {
        let joint = Articulation { kind: JointKind::Prismatic, axis, origin };
        out.push(AxisCandidate::new(joint, source, &config.sources));
    };
    if let Some(face) = evidence.face.filter(|_| config.use_face_normal) {
        push(face.normal, AxisSource::FaceNormal);
        push(face.right, AxisSource::FaceAxis);
        push(face.up, AxisSource::FaceAxis);
    }
    for axis in evidence.manhattan.iter().flat_map(|m| m.axes) {
        push(axis, AxisSource::Manhattan);
    }
    if evidence.face.is_none()
        && evidence.manhattan.is_none()
        && let (Some(first), Some(last)) = (evidence.path.first(), evidence.path.last())
        && let Some(axis) = crate::math::unit(&(last - first))
    {
        push(axis, AxisSource::HandPath);
    }
}

/// The circle about a fixed direction that the path draws; `None` where it bends too little to have one.
#[must_use]
pub fn arc_about(path: &[Point], direction: &Vector) -> Option<Articulation> {
    let e1 = crate::math::any_orthogonal(direction);
    let e2 = direction.cross(&e1);
    let mean = crate::math::centroid(path)?;
    let flat: Vec<Point2<f64>> = path.iter().map(|p| Point2::new((p - mean).dot(&e1), (p - mean).dot(&e2))).collect();
    let circle = circle::fit(&flat)?;
    let origin = mean + e1 * circle.center.x + e2 * circle.center.y;
    // The sense in which the path turns.
    let (first, last) = (path.first()? - origin, path.last()? - origin);
    let turn = direction.dot(&first.cross(&last));
    let axis = if turn < 0.0 { -*direction } else { *direction };
    Some(Articulation { kind: JointKind::Revolute, axis, origin })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn face() -> Face {
        Face {
            center: Point::new(0.0, 0.0, 1.0),
            right: Vector::x(),
            up: Vector::z(),
            normal: -Vector::y(),
            extent: [[-0.3, 0.3]; 2],
            support: 1.0,
        }
    }

    #[test]
    fn a_part_may_be_hung_at_each_side_of_each_outline_and_opens_outwards() {
        let face = face();
        // The second outline shares three sides with the first, up to less than outlines are known.
        let outlines = [Rect { bounds: [[-0.4, 0.1], [-0.2, 0.2]] }, Rect { bounds: [[-0.25, 0.11], [-0.2, 0.21]] }];
        let found = at_sides(&face, &outlines, &face.center, &config::AxisSources::default());
        let sides: Vec<(HingeSide, f64)> = found
            .iter()
            .map(|c| {
                let [right, up, _] = face.coordinates(&c.joint.origin);
                (c.side.unwrap(), if c.joint.axis.z.abs() > 0.5 { right } else { up })
            })
            .collect();
        let want = [
            (HingeSide::Left, -0.4),
            (HingeSide::Right, 0.1),
            (HingeSide::Bottom, -0.2),
            (HingeSide::Top, 0.2),
            (HingeSide::Left, -0.25),
        ];
        assert!(
            sides.len() == 5 && sides.iter().zip(want).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-12),
            "{sides:?}"
        );
        for c in &found {
            let way = c.joint.motion(0.3) * face.center - face.center;
            assert!(way.dot(&face.normal) > 0.01 && c.source == AxisSource::PartEdge, "{c:?}");
        }
    }

    #[test]
    fn a_side_of_a_cupboard_meets_its_front_at_its_edge() {
        let face = face();
        let side: Vec<Point> = (0..900)
            .map(|i| {
                Point::new(0.302 + 0.002 * f64::from(i % 3), 0.01 * f64::from(i % 30), 0.7 + 0.02 * f64::from(i / 30))
            })
            .collect();
        let found = plane_edges(&face, &side, &config::PlaneEdges::default());
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].0 == 0 && (found[0].1 - 0.304).abs() < 3e-3, "{found:?}");
    }

    #[test]
    fn the_arc_of_a_door_is_its_hinge() {
        let path: Vec<Point> = (0..30)
            .map(|i| {
                let a = f64::from(i) * 0.03;
                Point::new(2.0 + 0.5 * a.cos(), 1.0 + 0.5 * a.sin(), 1.1)
            })
            .collect();
        let joint = arc_about(&path, &Vector::z()).unwrap();
        assert!((joint.origin - Point::new(2.0, 1.0, 1.1)).norm() < 1e-6);
        assert!(joint.axis.z > 0.99);
    }
}
