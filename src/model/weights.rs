//! Masses and inertias with which MuJoCo refuses a file.

use std::collections::BTreeSet;

use super::links::{JointType, Link, MassSource, Model, ModelFormat};

/// What a file's `<compiler>` mends by itself.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mended {
    /// Light bodies are made heavier than nothing (`boundmass`, `boundinertia`).
    pub bounded: bool,
    /// Moments that no body has are made equal (`balanceinertia`).
    pub balanced: bool,
}

/// Below this MuJoCo takes a mass or a moment for 0, kg and kg m^2.
const NOTHING: f64 = 1e-15;
/// The least moment that MuJoCo takes of a whole tensor, kg m^2.
const MIN_MOMENT: f64 = 1e-14;
/// Above every body, kg m^2; beyond, eigenvalues are no numbers any more.
const MAX_MOMENT: f64 = 1e9;

/// Links with moments that no body has, and those that move without a weight.
pub(super) fn refused(model: &Model, mended: Mended) -> Vec<String> {
    let mut faults = Vec::new();
    let mut told = BTreeSet::new();
    for (i, link) in model.links.iter().enumerate().filter(|(_, l)| l.mass_source == MassSource::Stated) {
        if let Some(fault) = tensor(model, link, mended) {
            faults.push(fault);
            told.insert(i);
        }
    }
    // What was not read may weigh something.
    if !mended.bounded && model.unread.is_empty() {
        weightless(model, &told, &mut faults);
    }
    faults
}

/// Moments of inertia in ascending order; none where they are no numbers.
fn moments(link: &Link) -> Option<[f64; 3]> {
    if !link.inertia.iter().all(|x| x.abs() < MAX_MOMENT) {
        return None;
    }
    let mut moments: Vec<f64> = link.inertia.symmetric_eigenvalues().iter().copied().collect();
    moments.sort_by(f64::total_cmp);
    moments.try_into().ok()
}

/// What is wrong with a tensor that is written with a link. One of zeros counts as not written.
fn tensor(model: &Model, link: &Link, mended: Mended) -> Option<String> {
    let [a, b, c] = moments(link).filter(|_| link.inertia.iter().any(|x| *x != 0.0))?;
    // A URDF gives whole tensors; an MJCF's moments may be 0 one by one in what stands still.
    let least = match model.format {
        ModelFormat::Urdf { .. } if !mended.bounded => MIN_MOMENT,
        _ => -MIN_MOMENT,
    };
    let name = &link.name;
    if a < least {
        return Some(format!(
            "{name}: its inertia has no positive moments about all axes: MuJoCo refuses the file; work the tensor out again"
        ));
    }
    (!mended.balanced && a + b < c * (1.0 - 1e-9)).then(|| {
        format!(
            "{name}: one of its moments of inertia exceeds the sum of the others: MuJoCo refuses the file; work the \
             tensor out again, or write <compiler balanceinertia=\"true\"/>"
        )
    })
}

/// Bodies that move, and of which neither they nor what is fixed to them weigh anything; `told` are links of which
/// something else was said.
fn weightless(model: &Model, told: &BTreeSet<usize>, faults: &mut Vec<String>) {
    let Ok(tree) = model.tree() else { return };
    let links = &model.links;
    let mut weighs = vec![false; links.len()];
    for (i, (link, body)) in links.iter().zip(&tree.body).enumerate() {
        weighs[*body] |= told.contains(&i) || has_weight(model, link);
    }
    for (i, link) in links.iter().enumerate() {
        let moves = tree.carrier[i].is_some_and(|joint| model.joints[joint].kind != JointType::Fixed);
        if moves && !link.between && !weighs[tree.body[i]] {
            faults.push(format!(
                "{}: moves, and neither it nor what is fixed to it has mass and inertia: MuJoCo refuses it; write \
                 <inertial>, or a density for its shapes",
                link.name
            ));
        }
    }
}

/// Whether MuJoCo finds mass and inertia in a link; what only a mesh would tell is taken to have both.
fn has_weight(model: &Model, link: &Link) -> bool {
    match (link.mass_source, link.mass) {
        // Of a URDF's link without <inertial> the colliding shapes weigh as much as water.
        (MassSource::Nothing, _) if matches!(model.format, ModelFormat::Urdf { .. }) => {
            link.collides_as_mesh || link.incomplete || link.shapes.iter().any(|s| !s.visual)
        }
        (MassSource::Nothing, _) | (MassSource::Stated, None) => false,
        (_, None) => true,
        // Moments beyond all numbers are told elsewhere.
        (_, Some(mass)) => mass > NOTHING && moments(link).is_none_or(|[least, ..]| least > NOTHING),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{mjcf, urdf, xml};
    use super::*;

    const GOOD: &str = r#"ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0""#;

    /// What is said of a URDF: a base, a part that is fixed to it, and one that turns.
    fn told(compiler: &str, base: (f64, &str), part: (f64, &str)) -> Vec<String> {
        let inertial =
            |(mass, inertia): (f64, &str)| format!("<inertial><mass value=\"{mass}\"/><inertia {inertia}/></inertial>");
        let text = format!(
            "<robot name=\"r\">{compiler}<link name=\"base\">{}</link><link name=\"part\">{}</link>\
             <joint name=\"j\" type=\"revolute\"><parent link=\"base\"/><child link=\"part\"/>\
             <limit lower=\"0\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint></robot>",
            inertial(base),
            inertial(part)
        );
        let path = Path::new("m.urdf");
        let model = urdf::from_element(path, &text, &xml::parse(path, &text).unwrap()).unwrap();
        match model.format {
            ModelFormat::Urdf { faults, .. } => faults,
            ModelFormat::Mjcf { .. } => Vec::new(),
        }
    }

    #[test]
    fn a_urdf_is_refused_where_mujoco_refuses_it() {
        let [zero, flat, long, off] = [
            r#"ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0""#,
            r#"ixx="1" iyy="1" izz="0" ixy="0" ixz="0" iyz="0""#,
            r#"ixx="1" iyy="1" izz="5" ixy="0" ixz="0" iyz="0""#,
            r#"ixx="1" iyy="1" izz="1" ixy="3" ixz="0" iyz="0""#,
        ];
        let plain = "";
        let balance = "<mujoco><compiler balanceinertia=\"true\"/></mujoco>";
        let bound = "<mujoco><compiler boundmass=\"0.1\" boundinertia=\"0.1\"/></mujoco>";
        // As MuJoCo 4.0 has them.
        for (compiler, base, part, words) in [
            (plain, (1.0, GOOD), (1.0, GOOD), &[][..]),
            (plain, (1.0, zero), (1.0, GOOD), &[][..]),
            (plain, (0.0, GOOD), (1.0, GOOD), &[][..]),
            (plain, (1.0, GOOD), (1.0, zero), &["part: moves, and neither it"][..]),
            (plain, (1.0, GOOD), (0.0, GOOD), &["part: moves, and neither it"][..]),
            (plain, (1.0, flat), (1.0, GOOD), &["base: its inertia has no positive"][..]),
            (plain, (1.0, GOOD), (1.0, off), &["part: its inertia has no positive"][..]),
            (plain, (1.0, long), (1.0, long), &["base: one of its moments", "part: one of its moments"][..]),
            (balance, (1.0, long), (1.0, long), &[][..]),
            (bound, (0.0, zero), (0.0, zero), &[][..]),
            (bound, (1.0, flat), (1.0, long), &["part: one of its moments"][..]),
        ] {
            let found = told(compiler, base, part);
            let right = found.len() == words.len() && found.iter().zip(words).all(|(f, w)| f.starts_with(*w));
            assert!(right, "{compiler} {base:?} {part:?}: {found:?}");
        }
    }

    #[test]
    fn an_mjcf_may_have_moments_of_0_where_nothing_moves() {
        for (joint, inertia, word) in [
            ("", "diaginertia=\"1 1 0\"", ""),
            ("<joint/>", "diaginertia=\"1 1 0\"", "moves, and neither it"),
            ("", "diaginertia=\"1 1 5\"", "one of its moments"),
            ("", "fullinertia=\"1 1 1 3 0 0\"", "no positive moments"),
        ] {
            let text = format!(
                "<mujoco><worldbody><body name=\"b\">{joint}<inertial pos=\"0 0 0\" mass=\"1\" {inertia}/></body></worldbody></mujoco>"
            );
            let root = xml::parse(Path::new("m.xml"), &text).unwrap();
            let model = mjcf::from_element(Path::new("m.xml"), root).unwrap();
            let found: Vec<_> = model.faults.iter().filter(|(point, _)| *point == 1).collect();
            assert_eq!(found.is_empty(), word.is_empty(), "{inertia}: {found:?}");
            assert!(found.iter().all(|(_, f)| f.contains(word)), "{inertia}: {found:?}");
        }
    }
}
