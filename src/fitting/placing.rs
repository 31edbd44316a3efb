//! Where a piece of furniture fits among those that stand already.

use super::{Plan, Rules, build, overlap};
use crate::articulation::JointKind;
use crate::geometry::Rect;
use crate::twin::{Furniture, Role, Solid};

/// Why a piece does not stand.
pub(super) enum Unplaced {
    /// Something stands there already.
    NoSpace,
    /// It cannot be built anywhere, and why.
    Broken(String),
}

impl Unplaced {
    /// The reason in words; `no_space` is that of a piece whose place is taken.
    pub(super) fn told(self, no_space: &str) -> String {
        match self {
            Self::NoSpace => no_space.to_owned(),
            Self::Broken(reason) => reason,
        }
    }
}

/// Builds a piece that shares no space with what stands already: with a shallower carcass (pieces that meet at a corner),
/// then without the boards that are in the way, then with a smaller front.
pub(super) fn place(
    plan: &Plan,
    placed: &[(usize, Furniture)],
    rules: Rules,
) -> std::result::Result<Furniture, Unplaced> {
    let (config, boards) = (rules.config, &rules.priors.boards);
    let (deep, step_m) = (boards.carcass_depth_m, config.depth_step_m);
    let sides = plan.rect.bounds.map(|[low, high]| high - low - boards.gap_m);
    if sides.iter().any(|side| side.is_nan() || *side <= 0.0) {
        return Err(Unplaced::Broken("nothing of its front is left beside other parts at the same place".to_owned()));
    }
    // Only what can be built is asked for its space; one that could be, tells that space is what lacks.
    let mut unplaced = None;
    let mut stands = |f: &Furniture| match f.check() {
        Ok(()) if placed.iter().any(|(_, other)| overlap::furniture(other, f)) => {
            unplaced = Some(Unplaced::NoSpace);
            false
        }
        Ok(()) => true,
        Err(reason) => {
            unplaced.get_or_insert(Unplaced::Broken(reason));
            false
        }
    };
    for share in config.front_shares {
        let plan = Plan { rect: shrunk(plan, share), ..plan.clone() };
        let steps = ((deep - config.least_depth_m) / step_m).ceil().max(1.0) as usize;
        for step in 0..steps {
            let piece = build(&plan, deep - step as f64 * step_m, rules);
            if stands(&piece) {
                return Ok(piece);
            }
        }
        let mut piece = build(&plan, deep, rules);
        let blocked = |s: &Solid| placed.iter().any(|(_, other)| overlap::with(other, &s.shape));
        piece.carcass.retain(|s| !blocked(s));
        piece.part.solids.retain(|s| s.role != Role::Tray || !blocked(s));
        if !piece.carcass.is_empty() && stands(&piece) {
            return Ok(piece);
        }
    }
    Err(unplaced.unwrap_or(Unplaced::NoSpace))
}

/// The part's rectangle made smaller about the grip; a hinge's edge stays where it is.
fn shrunk(plan: &Plan, share: f64) -> Rect {
    let mut bounds = plan.rect.bounds;
    let hinge = (plan.articulation.kind == JointKind::Revolute).then(|| {
        usize::from(
            plan.articulation.axis.dot(&plan.face.up).abs() < plan.articulation.axis.dot(&plan.face.right).abs(),
        )
    });
    for (axis, b) in bounds.iter_mut().enumerate() {
        if hinge != Some(axis) {
            *b = b.map(|x| x * share);
        }
    }
    Rect { bounds }
}
