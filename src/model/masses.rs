//! Masses, centres and inertias of a model's links: what engines refuse, and what no piece of furniture weighs.

use std::collections::BTreeSet;

use super::findings::Findings;
use super::links::{Link, MassSource, Model, ModelFormat, WORLD};
use super::tree::Tree;
use crate::math::{Vector, plain};
use crate::twin::{Twin, mass_properties};

/// Less is a hair, not a part.
const MIN_MASS_KG: f64 = 0.05;
/// More is a wall.
const MAX_MASS_KG: f64 = 200.0;

/// The third point; `twin` is the model that the file was written from, where there is one.
pub(super) fn masses(model: &Model, tree: Option<&Tree>, twin: Option<&Twin>) -> Findings {
    let moving: BTreeSet<&str> = model.moving().map(|(_, j)| j.child.as_str()).collect();
    // A wall may weigh what it likes; what moves, and what carries it, is furniture.
    let furniture: BTreeSet<&str> = model.moving().flat_map(|(_, j)| [j.child.as_str(), j.parent.as_str()]).collect();
    let mut said = Findings::about(false);
    let root = tree.and_then(|t| t.order.first().copied());
    for (i, link) in model.links.iter().enumerate() {
        let name = &link.name;
        let bare = link.shapes.is_empty() && link.meshes.is_empty();
        let frame_only = bare && link.mass_source == MassSource::Nothing && !moving.contains(name.as_str());
        // What is fixed to the world never moves and needs no mass; a link of the world's name is no body.
        let in_world =
            tree.zip(root).is_some_and(|(t, root)| t.body[i] == t.body[root] && model.links[root].name == WORLD);
        let massless = matches!(link.mass_source, MassSource::Nothing | MassSource::Assumed);
        if link.between || frame_only || (in_world && (massless || Some(i) == root)) {
            continue;
        }
        // MuJoCo takes bodies without joints, and what is fixed to them, as parts of the world: no force moves them.
        let stands =
            tree.is_some_and(|t| t.body.get(i).copied() == root) && matches!(model.format, ModelFormat::Mjcf { .. });
        if stands && (link.mass_source != MassSource::Stated || link.inertia.iter().all(|m| *m == 0.0)) {
            continue;
        }
        said.concerned = true;
        if stands {
            moments_of(&mut said, link);
            continue;
        }
        match (link.mass_source, link.mass) {
            (MassSource::Nothing, _) => said.fault(format!("{name}: no <inertial>; write mass, centre and inertia")),
            (MassSource::Assumed, _) => said.fault(format!(
                "{name}: neither <inertial>, mass nor density is written; MuJoCo takes it to be as heavy as water"
            )),
            (MassSource::Stated, None) => said.fault(format!("{name}: its <inertial> has no mass")),
            (MassSource::Shapes, None) => {
                said.tell(format!("{name}: its mass comes from a mesh and is not worked out here"));
            }
            (MassSource::Stated | MassSource::Shapes, Some(mass)) => {
                mass_of(&mut said, link, mass, furniture.contains(name.as_str()));
            }
        }
    }
    if let Some(twin) = twin {
        let bodies = twin.furniture.iter().flat_map(|f| {
            [(f.name.clone(), f.carcass.as_slice()), (format!("{}_link", f.part.id), f.part.solids.as_slice())]
        });
        for (name, solids) in bodies {
            let Some(wanted) = mass_properties(solids, twin.density_kg_per_m3) else { continue };
            let have = model.links.iter().find(|l| l.name == name).and_then(|l| l.mass);
            // Density times volume to a thousandth.
            if !have.is_some_and(|m| (m - wanted.mass).abs() <= 1e-3 * wanted.mass) {
                let have = have.map_or_else(|| "none".to_owned(), |m| format!("{m:.4} kg"));
                said.fault(format!("{name}: mass {have}; density times volume is {:.4} kg", wanted.mass));
            }
        }
    }
    said
}

fn mass_of(said: &mut Findings, link: &Link, mass: f64, is_furniture: bool) {
    let name = &link.name;
    if !(MIN_MASS_KG..=MAX_MASS_KG).contains(&mass) && (is_furniture || mass.is_nan() || mass <= 0.0) {
        said.fault(format!("{name}: {} kg; furniture's parts weigh {MIN_MASS_KG} to {MAX_MASS_KG} kg", plain(mass)));
    }
    if !moments_of(said, link) || link.shapes.is_empty() || link.incomplete {
        return;
    }
    let corners: Vec<Vector> = link.shapes.iter().flat_map(|s| s.bounds.corners()).map(|p| p.coords).collect();
    let (mut low, mut high) = (corners[0], corners[0]);
    for c in &corners {
        (low, high) = (low.inf(c), high.sup(c));
    }
    let outside = (0..3).map(|k| (low[k] - link.center[k]).max(link.center[k] - high[k])).fold(0.0, f64::max);
    if outside > 1e-6 {
        // Kilometres in millimetres would be a line of digits.
        let far = if outside < 1e4 { format!("{:.1} mm", 1000.0 * outside) } else { format!("{} m", plain(outside)) };
        said.fault(format!("{name}: its centre of mass lies {far} outside its boxes"));
    }
}

/// Says what no body has as moments of inertia; false where they are beyond all numbers.
fn moments_of(said: &mut Findings, link: &Link) -> bool {
    // Above every body, and where eigenvalues are no numbers any more.
    const MAX_MOMENT: f64 = 1e9;
    let name = &link.name;
    if !link.inertia.iter().all(|x| x.abs() < MAX_MOMENT) {
        said.fault(format!("{name}: its moments of inertia are beyond any body's"));
        return false;
    }
    let mut moments: Vec<f64> = link.inertia.symmetric_eigenvalues().iter().copied().collect();
    moments.sort_by(f64::total_cmp);
    let told: Vec<String> = moments.iter().map(|m| format!("{m:.3e}")).collect();
    let told = told.join(", ");
    if let [a, b, c] = moments[..] {
        if a <= 0.0 {
            said.fault(format!("{name}: moments of inertia {told} kg m^2 must be positive"));
        } else if a + b < c * (1.0 - 1e-9) {
            said.fault(format!(
                "{name}: no body has moments of inertia {told} kg m^2: none may exceed the sum of the others; work the \
                 tensor out again"
            ));
        }
    }
    true
}
