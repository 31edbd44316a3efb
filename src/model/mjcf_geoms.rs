//! An MJCF's geoms: what they are made of, what they weigh, what they touch.

use nalgebra::Matrix3;

use super::links::Shape;
use super::mjcf_builder::{MjcfBuilder, Portion};
use super::mjcf_context::{Context, Resolved, from_z};
use super::shapes::Primitive;
use super::xml;
use crate::error::Result;
use crate::math::{Point, Pose, Vector, unit};

/// MuJoCo's default density: that of water, kg/m^3.
const WATER: f64 = 1000.0;

impl MjcfBuilder {
    /// Adds a geom to a link; `place` is the frame that it stands in.
    pub(super) fn geom(&mut self, c: &Context, r: &Resolved, link: usize, place: &Pose) -> Result<()> {
        let kind = r.get("type").unwrap_or("sphere");
        let name = r.element.get("name").map(|_| r.element.own_name()).transpose()?;
        if kind == "plane" {
            return Ok(());
        }
        let mut pose = c.pose(r)?;
        let masks = masks(r)?;
        let primitive = if let Some(mesh) = r.get("mesh") {
            self.mesh(c, r, link, (mesh, kind, masks))?
        } else {
            let sized = sized(r, kind, &mut pose)?;
            if sized.is_none() {
                self.pass_over(&format!("geom of type {kind}"));
            }
            sized
        };
        let Some(primitive) = primitive else { return Ok(()) };
        let pose = place * pose;
        let bounds = primitive.bounds(&pose);
        if weighs(c, r)? {
            let (mass, density) = (r.number("mass")?, r.number("density")?);
            let mass_of = |volume: f64| density.unwrap_or(WATER) * volume;
            let weighs = mass.or_else(|| primitive.volume().map(mass_of)).or((density == Some(0.0)).then_some(0.0));
            let turn = pose.rotation.to_rotation_matrix();
            let moments = weighs.and_then(|m| primitive.moments(m));
            let own = moments.map_or(Matrix3::zeros(), |m| Matrix3::from_diagonal(&m));
            if weighs != Some(0.0) {
                self.portions[link].push(Portion {
                    mass: weighs.filter(|_| moments.is_some()),
                    center: bounds.center,
                    inertia: turn.matrix() * own * turn.matrix().transpose(),
                    assumed: mass.or(density).is_none(),
                });
            }
        }
        let visual = masks == [0, 0];
        let (exact, is_mesh) = (primitive.is_box(), matches!(primitive, Primitive::Mesh(_)));
        self.model.links[link].shapes.push(Shape { name, bounds, exact, is_mesh, visual, masks });
        Ok(())
    }

    /// The box around a mesh; none where it cannot be measured, which makes its link incomplete.
    fn mesh(
        &mut self,
        c: &Context,
        r: &Resolved,
        link: usize,
        (mesh, kind, masks): (&str, &str, [u32; 2]),
    ) -> Result<Option<Primitive>> {
        let at = &mut self.model.links[link];
        at.meshes.push(mesh.to_owned());
        at.collides_as_mesh |= ["mesh", "sdf"].contains(&kind) && masks != [0, 0];
        // That there is no such mesh is said where names are looked up.
        let Some(found) = c.meshes.get(mesh) else {
            at.incomplete = true;
            return Ok(None);
        };
        match self.measured.entry(mesh.to_owned()).or_insert_with(|| found.bounds()) {
            Ok(corners) => Ok(Some(Primitive::Mesh(*corners))),
            Err(why) => {
                at.incomplete = true;
                let note = format!("{}: mesh {} is not read: {why}", at.name, xml::brief(mesh));
                self.model.notes.push(note);
                if weighs(c, r)? {
                    self.portions[link].push(Portion {
                        mass: None,
                        center: Point::origin(),
                        inertia: Matrix3::zeros(),
                        assumed: r.get("mass").or(r.get("density")).is_none(),
                    });
                }
                Ok(None)
            }
        }
    }
}

/// Whether a geom's group is one of those that weigh something.
fn weighs(c: &Context, r: &Resolved) -> Result<bool> {
    let group = r.number("group")?.unwrap_or(0.0);
    Ok((c.weighing[0]..=c.weighing[1]).contains(&group))
}

/// `contype` and `conaffinity`; both are 1 unless the file says otherwise.
pub(super) fn masks(r: &Resolved) -> Result<[u32; 2]> {
    let mask = |attribute: &str| -> Result<u32> {
        // Masks are whole numbers of 32 bits; what is outside meets everything.
        Ok(r.number(attribute)?
            .map_or(1, |v| if (0.0..=f64::from(u32::MAX)).contains(&v) { v as u32 } else { u32::MAX }))
    };
    Ok([mask("contype")?, mask("conaffinity")?])
}

/// A geom's solid from `type`, `size` and `fromto`; `None` for types that are not read. `fromto` replaces the pose.
fn sized(r: &Resolved, kind: &str, pose: &mut Pose) -> Result<Option<Primitive>> {
    if !["box", "sphere", "ellipsoid", "cylinder", "capsule"].contains(&kind) {
        return Ok(None);
    }
    let mut size = r.numbers("size", 1..=3)?.unwrap_or_default();
    if let Some(ends) = r.numbers("fromto", 6..=6)?.filter(|_| kind != "sphere") {
        let (a, b) = (Vector::from_row_slice(&ends[..3]), Vector::from_row_slice(&ends[3..]));
        let along = unit(&(b - a)).ok_or_else(|| r.element.error("fromto: both ends are the same point"))?;
        *pose = Pose::from_parts(((a + b) * 0.5).into(), from_z(&along));
        let half = 0.5 * (b - a).norm();
        let radius = size.first().copied().unwrap_or(0.0);
        size = if ["cylinder", "capsule"].contains(&kind) { vec![radius, half] } else { vec![radius, radius, half] };
    }
    let wanted = match kind {
        "sphere" => 1,
        "cylinder" | "capsule" => 2,
        _ => 3,
    };
    if size.len() < wanted || size.iter().take(wanted).any(|s| *s <= 0.0) {
        return Err(r.element.error(format!("a {kind} needs {wanted} positive numbers as size")));
    }
    let whole = |size: &[f64]| Vector::new(size[0], size[1], size[2]);
    Ok(Some(match kind {
        "box" => Primitive::Cuboid(whole(&size)),
        "ellipsoid" => Primitive::Ellipsoid(whole(&size)),
        "sphere" => Primitive::Sphere(size[0]),
        "cylinder" => Primitive::Cylinder(size[0], size[1]),
        _ => Primitive::Capsule(size[0], size[1]),
    }))
}
