//! From joints to boxes: the moving part around what was seen to move, its handle, the furniture behind it, how far it opens
//! and what it resists with, and the room around it (ours).

mod cells;
mod cover;
mod joint_front;
pub mod joints;
mod limits;
pub mod overlap;
mod placing;
mod planes;
mod resistance;
mod room;
mod turned;

use nalgebra::Matrix3;

use crate::articulation::{Articulation, JointKind};
use crate::config::{self, Boards, Priors};
use crate::geometry::{Face, Rect, fronts};
use crate::hands::Trajectory;
use crate::math::{Vector, reject, unit};
use crate::pipeline::{Scene, SceneJoint};
use crate::twin::{Furniture, Joint, LeftOut, OrientedBox, Part, Role, Solid, Twin};
use placing::place;
pub use room::{body, sweep};

/// What a piece is built by.
#[derive(Debug, Clone, Copy)]
struct Rules<'a> {
    config: &'a config::Fitting,
    priors: &'a Priors,
}

/// A joint with its face and the rectangle of its part, ready to be built.
#[derive(Debug, Clone)]
struct Plan<'a> {
    joint: &'a SceneJoint,
    /// Largest opening that a clip went through under the joint as built.
    observed: f64,
    articulation: Articulation,
    face: Face,
    rect: Rect,
    seen: bool,
    /// Whether nothing of the furniture was seen, not even its front's plane ([`Scene::is_assumed`]).
    assumed: bool,
    /// Against gravity, unit.
    up: Vector,
}

/// Builds the twin of a scene.
#[must_use]
pub fn fit(scene: &Scene, up: &Vector, config: &config::Fitting, priors: &Priors) -> Twin {
    fit_joints(scene, &scene.joints, up, config, priors)
}

/// The same with other joints in the place of the scene's own: what the twin would be under another hypothesis.
#[must_use]
pub fn fit_joints(
    scene: &Scene,
    joints: &[SceneJoint],
    up: &Vector,
    config: &config::Fitting,
    priors: &Priors,
) -> Twin {
    let rules = Rules { config, priors };
    let mut plans: Vec<Plan> = joints.iter().map(|j| plan(j, scene.is_assumed(j), up, rules)).collect();
    let mut rects: Vec<(Face, Rect)> = plans.iter().map(|p| (p.face, p.rect)).collect();
    overlap::separate(&mut rects, &priors.boards);
    for (plan, (_, rect)) in plans.iter_mut().zip(rects) {
        plan.rect = rect;
    }
    // What is surer stands; what is less sure gives way.
    let mut order: Vec<usize> = (0..plans.len()).collect();
    // Where nobody computed how sure the types are, the clips alone count.
    let sureness = |i: usize| {
        let joint = plans[i].joint;
        joint.type_probability.unwrap_or(1.0) * (joint.clips.len() as f64).min(3.0)
    };
    order.sort_by(|&a, &b| sureness(b).total_cmp(&sureness(a)).then(a.cmp(&b)));
    let mut placed: Vec<(usize, Furniture)> = Vec::new();
    let mut left_out = Vec::new();
    for i in order {
        match place(&plans[i], &placed, rules) {
            Ok(furniture) => placed.push((i, furniture)),
            Err(why) => left_out.push(LeftOut {
                id: plans[i].joint.id.clone(),
                reason: why.told("its front shares space with furniture that is surer"),
            }),
        }
    }
    let mut ranked: Vec<(usize, usize, Furniture)> =
        placed.into_iter().enumerate().map(|(rank, (i, f))| (i, rank, f)).collect();
    ranked.sort_by_key(|(i, ..)| *i);
    let mut ranks: Vec<usize> = ranked.iter().map(|(_, rank, _)| *rank).collect();
    let mut joints: Vec<&SceneJoint> = ranked.iter().map(|(i, ..)| plans[*i].joint).collect();
    let mut furniture: Vec<Furniture> = ranked.into_iter().map(|(.., f)| f).collect();

    // The room leaves free where parts were seen to go, and limits what nobody saw.
    limits::before_neighbours(&mut furniture, &priors.boards);
    // A part that its neighbours hold shut is wrong about where it is: it goes, and what it held is free.
    while let Some(&worst) = limits::within_observed(&mut furniture, &ranks, config).iter().max_by_key(|&&i| ranks[i]) {
        left_out.push(LeftOut {
            id: furniture[worst].part.id.clone(),
            reason: "surer furniture beside it would hold it shut".to_owned(),
        });
        furniture.remove(worst);
        joints.remove(worst);
        ranks.remove(worst);
    }
    let surroundings = scene.surroundings.as_ref().filter(|_| config.room);
    let mut room = surroundings.map_or_else(Vec::new, |cells| room::boxes(cells, &furniture, config));
    room.retain(|solid| solid.check().is_ok());
    limits::beyond_observed(&mut furniture, &room);
    for (piece, joint) in furniture.iter_mut().zip(joints) {
        resist(&mut piece.part, &hands(scene, joint), up, rules);
    }
    // Whatever a step made of a piece: one that no simulator would load costs itself.
    furniture.retain(|piece| match piece.check() {
        Ok(()) => true,
        Err(reason) => {
            left_out.push(LeftOut { id: piece.part.id.clone(), reason });
            false
        }
    });
    Twin {
        name: scene.recording.clone(),
        density_kg_per_m3: priors.boards.density_kg_per_m3,
        drives: priors.drives.clone(),
        furniture,
        room,
        left_out,
    }
}

/// The hands of a joint's clips, in the order of time.
fn hands<'a>(scene: &'a Scene, joint: &SceneJoint) -> Vec<&'a Trajectory> {
    let mut hands: Vec<&Trajectory> = scene
        .clips
        .iter()
        .filter(|c| joint.clips.contains(&c.clip.clip))
        .filter_map(|c| c.trajectory.as_ref())
        .filter(|t| !t.samples.is_empty())
        .collect();
    let start = |t: &Trajectory| t.samples.first().map_or(f64::NEG_INFINITY, |s| s.time_secs);
    hands.sort_by(|&a, &b| start(a).total_cmp(&start(b)));
    hands
}

/// Damping, friction and whether a spring carries the weight, as far as the hands show them.
fn resist(part: &mut Part, hands: &[&Trajectory], up: &Vector, rules: Rules) {
    let density = rules.priors.boards.density_kg_per_m3;
    let config = rules.config;
    let left = resistance::left_open(&part.joint.articulation, hands, &config.coast);
    let table = [part.joint.damping, part.joint.friction];
    if let Some([damping, friction]) = resistance::seen(part, &left, table, up, density, &config.coast) {
        part.joint.damping = damping;
        part.joint.friction = friction;
        part.joint.resistance_seen = true;
    }
    // Left open is what hangs about where the hand let go of it.
    let stayed: Vec<f64> =
        left.iter().filter(|l| l.found >= config.coast.stayed_share * l.released).map(|l| l.found).collect();
    part.joint.balanced = limits::balanced(part, up, density, &stayed, config);
}

/// Face, rectangle and the joint moved onto them.
fn plan<'a>(joint: &'a SceneJoint, assumed: bool, up: &Vector, rules: Rules) -> Plan<'a> {
    let Rules { config, priors } = rules;
    let config::Boards { thickness_m, gap_m, .. } = priors.boards;
    let can_be = |f: &Face| !f.is_assumed() || fronts::may_be_front(f, &joint.joint, &joint.grip);
    let seen_face = joint
        .face
        .filter(|f| is_front_of(f, joint, up) && can_be(f))
        .unwrap_or_else(|| fronts::of_joint(&joint.joint, &joint.grip, up, priors.handles.standoff_m));
    let face = levelled(&seen_face, up, config.level_deg);
    let mut articulation = joint.joint;
    articulation.axis = squared(&articulation.axis, &face, up, config.level_deg);
    if articulation.kind == JointKind::Revolute {
        let [r, u, h] = seen_face.coordinates(&articulation.origin);
        let level = articulation.axis.dot(&face.up).abs() < articulation.axis.dot(&face.right).abs();
        let (u, h) = if level && u > 0.0 && !face.is_horizontal(up) {
            (u - 0.5 * thickness_m - gap_m, -0.5 * thickness_m - config.hung_m)
        } else {
            // The hinge runs along the front edge of the leaf or just before it: about an axis behind it the leaf's edge
            // would swing into its neighbour.
            (u, h.clamp(0.0, thickness_m))
        };
        articulation.origin = face.point(r, u, h);
    }
    let usual = assumed.then(|| usual_bounds(&articulation, &face, &priors.fronts));
    let (rect, seen) = rectangle(joint, &articulation, &face, usual, rules);
    let observed = joint.observed_range;
    Plan { joint, observed, articulation, face, rect, seen, assumed, up: *up }
}

/// The bounds of a front of which only the hand was seen, about the grip: of a usual size. A hinge sets its own side later.
fn usual_bounds(articulation: &Articulation, face: &Face, fronts: &config::Fronts) -> [[f64; 2]; 2] {
    let wide = 0.5 * fronts.assumed_width_m;
    let high = match limits::comes_out(articulation, face) {
        true => 0.5 * fronts.assumed_drawer_m,
        false => 0.5 * fronts.assumed_door_m,
    };
    [[-wide, wide], [-high, high]]
}

/// Whether a face can be the front of what moves: a drawer is not pulled along a lid or a worktop.
fn is_front_of(face: &Face, joint: &SceneJoint, up: &Vector) -> bool {
    joint.joint.kind == JointKind::Revolute || joint.joint.axis.dot(&face.normal).abs() > 0.5 || !face.is_horizontal(up)
}

/// A direction made upright or level where it nearly is: gravity opens a door whose hinge leans by a thousandth of a radian,
/// where a simulator has no friction to hold it.
fn plumb(direction: &Vector, up: &Vector, within_deg: f64) -> Vector {
    let along = direction.dot(up);
    let near = within_deg.to_radians();
    if along.abs() > near.cos() {
        *up * along.signum()
    } else if along.abs() < near.sin() {
        unit(&reject(direction, up)).unwrap_or(*direction)
    } else {
        *direction
    }
}

/// A face with its own axes plumb, turned about its centre.
fn levelled(face: &Face, up: &Vector, within_deg: f64) -> Face {
    let normal = plumb(&face.normal, up, within_deg);
    match unit(&reject(&plumb(&face.up, up, within_deg), &normal)) {
        Some(face_up) => Face { right: face_up.cross(&normal), up: face_up, normal, ..*face },
        None => *face,
    }
}

/// A joint's axis: the direction of the face that it nearly has, else itself made plumb.
fn squared(axis: &Vector, face: &Face, up: &Vector, within_deg: f64) -> Vector {
    let near = within_deg.to_radians().cos();
    [face.right, face.up, face.normal]
        .into_iter()
        .flat_map(|d| [d, -d])
        .find(|d| d.dot(axis) > near)
        .unwrap_or_else(|| plumb(axis, up, within_deg))
}

/// The part's rectangle: what was seen to move, brought to the hinge; else what the grip and the hinge suggest, from `usual` bounds
/// where the face is assumed.
fn rectangle(
    joint: &SceneJoint,
    articulation: &Articulation,
    face: &Face,
    usual: Option<[[f64; 2]; 2]>,
    rules: Rules,
) -> (Rect, bool) {
    let least_m = rules.config.least_front_m;
    let around_m = rules.config.around_grip_m;
    let rim_m = rules.priors.handles.from_edge_m;
    let seen = joint.part.is_some();
    let mut bounds = joint.part.map(|r| r.bounds).or(usual).unwrap_or_else(|| {
        let [r, u] = face.extent;
        // The extent may be a whole row of furniture: a part is no wider than one front and no taller than the row.
        let [wide, high] = rules.config.most_half_m;
        [[r[0].max(-wide), r[1].min(wide)], [u[0].max(-high), u[1].min(high)]]
    });
    if articulation.kind == JointKind::Revolute {
        let [r, u, _] = face.coordinates(&articulation.origin);
        let upright = articulation.axis.dot(&face.up).abs() >= articulation.axis.dot(&face.right).abs();
        let (axis, at) = if upright { (0, r) } else { (1, u) };
        // The hinge is one edge of the leaf, the grip is near the other.
        if at < 0.0 {
            bounds[axis] = [at, if seen { bounds[axis][1].max(at + least_m) } else { rim_m }];
        } else {
            bounds[axis] = [if seen { bounds[axis][0].min(at - least_m) } else { -rim_m }, at];
        }
    }
    for b in &mut bounds {
        // The handle is on the part.
        b[0] = b[0].min(-around_m);
        b[1] = b[1].max(around_m);
        if b[1] - b[0] < least_m {
            let middle = 0.5 * (b[0] + b[1]);
            *b = [middle - 0.5 * least_m, middle + 0.5 * least_m];
        }
    }
    (Rect { bounds }, seen)
}

/// A box in face coordinates: `[right, up, out][min, max]`.
fn face_box(face: &Face, bounds: [[f64; 2]; 3]) -> OrientedBox {
    let middle = bounds.map(|b| 0.5 * (b[0] + b[1]));
    OrientedBox {
        center: face.point(middle[0], middle[1], middle[2]),
        half: Vector::from_iterator(bounds.iter().map(|b| 0.5 * (b[1] - b[0]))),
        rotation: Matrix3::from_columns(&[face.right, face.up, face.normal]),
    }
}

fn build(plan: &Plan, depth: f64, rules: Rules) -> Furniture {
    let face = &plan.face;
    let id = &plan.joint.id;
    let Rules { config, priors } = rules;
    let gap = priors.boards.gap_m;
    let board = priors.boards.thickness_m;
    let [r, u] = plan.rect.bounds;
    let inset = 0.5 * gap;
    let (front_r, front_u) = ([r[0] + inset, r[1] - inset], [u[0] + inset, u[1] - inset]);
    let solid = |name: &str, role: Role, bounds: [[f64; 2]; 3], seen: bool| Solid {
        name: format!("{id}_{name}"),
        role,
        shape: face_box(face, bounds),
        seen,
    };
    let mut solids = vec![solid("front", Role::Front, [front_r, front_u, [-board, 0.0]], plan.seen)];
    solids.extend(handle(plan, [front_r, front_u], rules, &solid));

    let slide = plan.articulation.kind == JointKind::Prismatic;
    // How far the part can go at all.
    let mut most = std::f64::consts::PI;
    // A sliding door runs along its face and has no tray behind it.
    if limits::comes_out(&plan.articulation, face) {
        let out = [-(depth - board - 2.0 * gap), -board];
        solids.extend(tray([r, u, out], &priors.boards, &solid));
        most = out[1] - out[0];
    } else if slide {
        // A sliding door stays in its frame.
        let axis = plan.articulation.axis;
        most = axis.dot(&face.right).abs() * (r[1] - r[0]) + axis.dot(&face.up).abs() * (u[1] - u[0]);
    }
    let mut carcass = carcass([r, u, [-depth, -board - gap]], board, &solid);
    carcass.retain(|s| s.shape.half.iter().all(|h| *h > config.least_board_half_m));

    let (damping, friction) = if slide {
        (priors.resistance.slide_damping, priors.resistance.slide_friction)
    } else {
        (priors.resistance.hinge_damping, priors.resistance.hinge_friction)
    };
    let bounds = bounds_of(&solids, face);
    let mut articulation = plan.articulation;
    articulation.origin = match articulation.kind {
        JointKind::Revolute => articulation.line().project(&bounds.center),
        JointKind::Prismatic => bounds.center,
    };
    let handle = solids.iter().find(|s| s.role == Role::Handle).map_or(plan.joint.grip, |s| s.shape.center);
    let travel = limits::Travel { observed: plan.observed, depth, most };
    // What nobody named.
    let word = plan.joint.furniture.as_deref().unwrap_or(match articulation.kind {
        JointKind::Revolute => "door",
        JointKind::Prismatic if limits::comes_out(&plan.articulation, face) => "drawer",
        JointKind::Prismatic => "sliding door",
    });
    Furniture {
        name: format!("{id}_base"),
        carcass,
        part: Part {
            id: id.clone(),
            label: word.to_owned(),
            joint: Joint {
                articulation,
                upper: plan.observed.min(most).max(limits::least(plan.articulation.kind)),
                observed: plan.observed,
                expected: limits::expected(&plan.articulation, face, &plan.up, &travel, &priors.ranges),
                damping,
                friction,
                resistance_seen: false,
                balanced: false,
                probability: plan.joint.hypotheses.first().map(|h| h.share),
            },
            solids,
            handle,
            bounds,
        },
    }
}

/// A board by name, role and bounds along right, up and out of the face, and whether it was seen.
type Board<'a> = &'a dyn Fn(&str, Role, [[f64; 2]; 3], bool) -> Solid;

/// The boards of a drawer behind its front; none where they would not fit. `r`, `u`: bounds of the front; `out`: of the tray.
fn tray([r, u, out]: [[f64; 2]; 3], boards: &Boards, solid: Board) -> Vec<Solid> {
    let Boards { thickness_m: board, gap_m: gap, tray_thickness_m: thin, tray_height_share, .. } = *boards;
    let inner_r = [r[0] + board + 2.0 * gap, r[1] - board - 2.0 * gap];
    // A tray's walls are lower than its front.
    let (low, free) = (u[0] + board + 2.0 * gap, u[1] - u[0] - 2.0 * board - 4.0 * gap);
    let inner_u = [low, low + tray_height_share * free];
    if inner_r[1] - inner_r[0] <= 4.0 * board || inner_u[1] - inner_u[0] <= 2.0 * board {
        return Vec::new();
    }
    let between = [inner_r[0] + thin, inner_r[1] - thin];
    let above = [inner_u[0] + thin, inner_u[1]];
    vec![
        solid("tray_left", Role::Tray, [[inner_r[0], inner_r[0] + thin], inner_u, out], false),
        solid("tray_right", Role::Tray, [[inner_r[1] - thin, inner_r[1]], inner_u, out], false),
        solid("tray_bottom", Role::Tray, [between, [inner_u[0], inner_u[0] + thin], out], false),
        solid("tray_back", Role::Tray, [between, above, [out[0], out[0] + thin]], false),
    ]
}

/// The five boards around what a front closes.
fn carcass([r, u, out]: [[f64; 2]; 3], board: f64, solid: Board) -> Vec<Solid> {
    let between_r = [r[0] + board, r[1] - board];
    let between_u = [u[0] + board, u[1] - board];
    vec![
        solid("carcass_left", Role::Carcass, [[r[0], r[0] + board], u, out], false),
        solid("carcass_right", Role::Carcass, [[r[1] - board, r[1]], u, out], false),
        solid("carcass_bottom", Role::Carcass, [between_r, [u[0], u[0] + board], out], false),
        solid("carcass_top", Role::Carcass, [between_r, [u[1] - board, u[1]], out], false),
        solid("carcass_back", Role::Carcass, [between_r, between_u, [out[0], out[0] + board]], false),
    ]
}

/// A bar on two posts where the hand was; upright beside an upright hinge, level otherwise.
fn handle(plan: &Plan, bounds: [[f64; 2]; 2], rules: Rules, solid: Board) -> Vec<Solid> {
    let upright = plan.articulation.kind == JointKind::Revolute
        && plan.articulation.axis.dot(&plan.face.up).abs() > plan.articulation.axis.dot(&plan.face.right).abs();
    let along = usize::from(upright);
    let config::Handles { standoff_m, bar_half_width_m: half_m, bar_half_length_m, .. } = rules.priors.handles;
    let half: [f64; 2] = std::array::from_fn(|i| {
        let wanted = if i == along { bar_half_length_m } else { half_m };
        wanted.min(rules.config.bar_most_share * (bounds[i][1] - bounds[i][0]))
    });
    // The grip is the face's origin; the whole bar stays on the front.
    let center: [f64; 2] = std::array::from_fn(|i| {
        let [low, high] = [bounds[i][0] + half[i], bounds[i][1] - half[i]];
        if low <= high { 0f64.clamp(low, high) } else { 0.5 * (low + high) }
    });
    let span = |i: usize| [center[i] - half[i], center[i] + half[i]];
    let bar_out = [standoff_m - half_m, standoff_m + half_m];
    // Where the hand was a handle is; how it stands off a front that nobody saw is assumed as the front is.
    let bar_seen = !plan.assumed;
    let mut solids = vec![solid("handle_bar", Role::Handle, [span(0), span(1), bar_out], bar_seen)];
    for (name, end) in [("handle_post_a", -1.0), ("handle_post_b", 1.0)] {
        let mut post = [span(0), span(1), [0.0, bar_out[0]]];
        let at = center[along] + end * (half[along] - half_m);
        post[along] = [at - half_m, at + half_m];
        solids.push(solid(name, Role::Handle, post, false));
    }
    solids
}

/// The box around solids in the axes of a face.
fn bounds_of(solids: &[Solid], face: &Face) -> OrientedBox {
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
    for corner in solids.iter().flat_map(|s| s.shape.corners()) {
        for (b, c) in bounds.iter_mut().zip(face.coordinates(&corner)) {
            b[0] = b[0].min(c);
            b[1] = b[1].max(c);
        }
    }
    face_box(face, bounds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Point;

    fn scene_joint(kind: JointKind) -> SceneJoint {
        let face = Face {
            center: Point::new(0.2, 0.0, 0.8),
            right: Vector::x(),
            up: Vector::z(),
            normal: -Vector::y(),
            extent: [[-0.5, 0.5], [-0.5, 0.5]],
            support: 1.0,
        };
        let joint = match kind {
            JointKind::Revolute => Articulation { kind, axis: -Vector::z(), origin: Point::new(-0.35, 0.01, 0.5) },
            JointKind::Prismatic => Articulation { kind, axis: -Vector::y(), origin: Point::new(0.2, 0.0, 0.8) },
        };
        SceneJoint {
            id: "joint_0".to_owned(),
            joint,
            clips: vec![],
            furniture: None,
            type_probability: Some(1.0),
            joint_probability: Some(1.0),
            told: Vec::new(),
            uncertainty: None,
            grip: Point::new(0.2, -0.035, 0.8),
            face: Some(face),
            part: Some(Rect { bounds: [[-0.5, 0.06], [-0.3, 0.1]] }),
            observed_range: 0.4,
            moved: vec![],
            hypotheses: vec![],
        }
    }

    fn twin(joints: Vec<SceneJoint>) -> Twin {
        let scene = Scene {
            recording: "r".to_owned(),
            manhattan: None,
            depth_factors: Default::default(),
            videos: Default::default(),
            clips: vec![],
            joints,
            surroundings: None,
        };
        fit(&scene, &Vector::z(), &config::Fitting::default(), &Priors::default())
    }

    #[test]
    fn a_door_hangs_on_its_hinge_and_its_handle_is_where_the_hand_was() {
        let twin = twin(vec![scene_joint(JointKind::Revolute)]);
        let part = &twin.furniture[0].part;
        let front = &part.solids[0].shape;
        assert!((front.center.x - 0.5 * front.half.x * 0.0 - (-0.35 + 0.26) / 2.0).abs() < 1e-9, "{front:?}");
        assert!((part.handle - Point::new(0.2, -0.035, 0.8)).norm() < 1e-9);
        // The opened handle comes towards the person.
        assert!((part.joint.articulation.motion(0.5) * part.handle).y < -0.2);
    }

    #[test]
    fn parts_and_boards_do_not_touch_when_closed_nor_on_the_way() {
        let mut neighbour = scene_joint(JointKind::Prismatic);
        neighbour.id = "joint_1".to_owned();
        for b in neighbour.part.iter_mut().flat_map(|r| &mut r.bounds[0]) {
            *b += 0.55;
        }
        let twin = twin(vec![scene_joint(JointKind::Revolute), neighbour, scene_joint(JointKind::Prismatic)]);
        for furniture in &twin.furniture[..2] {
            for step in 0..=20 {
                let motion =
                    furniture.part.joint.articulation.motion(furniture.part.joint.upper * f64::from(step) / 20.0);
                for moving in &furniture.part.solids {
                    for board in &furniture.carcass {
                        let moved = moving.shape.moved(&motion);
                        assert!(!overlap::boxes(&moved, &board.shape), "{} {} {step}", moving.name, board.name);
                    }
                }
            }
        }
    }

    #[test]
    fn what_nearly_stands_upright_does() {
        let mut leaning = scene_joint(JointKind::Revolute);
        let tilt = crate::math::rotation(&Vector::y(), 0.02);
        let face = leaning.face.as_mut().unwrap();
        (face.right, face.up, face.normal) = (tilt * face.right, tilt * face.up, tilt * face.normal);
        leaning.joint.axis = tilt * leaning.joint.axis;
        let part = &twin(vec![leaning]).furniture[0].part;
        assert_eq!(part.joint.articulation.axis, -Vector::z());
        assert_eq!(part.solids[0].shape.rotation.column(1).into_owned(), Vector::z());
        assert!((part.handle - Point::new(0.2, -0.035, 0.8)).norm() < 2e-3);
    }

    #[test]
    fn a_part_that_cannot_be_built_costs_itself() {
        let mut lost = scene_joint(JointKind::Prismatic);
        lost.id = "joint_1".to_owned();
        lost.observed_range = f64::INFINITY;
        lost.grip = Point::new(1e200, 0.0, 0.0);
        lost.face = None;
        let twin = twin(vec![scene_joint(JointKind::Revolute), lost]);
        assert_eq!(twin.furniture.iter().map(|f| f.part.id.as_str()).collect::<Vec<_>>(), ["joint_0"]);
        assert_eq!(twin.left_out.iter().map(|l| l.id.as_str()).collect::<Vec<_>>(), ["joint_1"]);
        assert!(twin.left_out[0].reason.contains("within 1000 m"), "{:?}", twin.left_out);
    }

    #[test]
    fn parts_at_one_place_leave_one_of_them() {
        let mut again = scene_joint(JointKind::Revolute);
        again.id = "joint_1".to_owned();
        let twin = twin(vec![scene_joint(JointKind::Revolute), again]);
        assert_eq!((twin.furniture.len(), twin.left_out.len()), (1, 1), "{:?}", twin.left_out);
        twin.furniture[0].check().unwrap();
    }

    #[test]
    fn the_weight_of_a_leaf_that_hangs_shuts_it() {
        let mut flap = scene_joint(JointKind::Revolute);
        flap.joint.axis = Vector::x();
        flap.joint.origin = Point::new(0.2, 0.0, 1.2);
        let twin = twin(vec![flap]);
        let part = &twin.furniture[0].part;
        let mass = crate::twin::mass_properties(&part.solids, twin.density_kg_per_m3).unwrap();
        let phi = part.joint.articulation;
        // The sense in which the axis opens lifts the handle out of the front.
        let opens = phi.axis.cross(&(part.handle - phi.origin)).dot(&-Vector::y()).signum();
        let weight = phi.axis.dot(&(mass.center - phi.origin).cross(&(-Vector::z() * mass.mass)));
        assert!(opens * weight < 0.0, "{opens} {weight}");
    }
}
