//! Names in a URDF that name nothing: materials that nobody describes, transmissions of joints that are not there.

use std::collections::BTreeSet;

use super::xml::{Element, brief};

/// Everything of this kind.
pub(super) fn undefined(root: &Element) -> Vec<String> {
    let mut faults = materials(root);
    faults.extend(transmissions(root));
    faults
}

/// Materials that are only called by their name.
fn materials(root: &Element) -> Vec<String> {
    let visuals = || root.all("link").flat_map(|link| link.all("visual").map(move |visual| (link, visual)));
    let described = |material: &&Element| material.child("color").or(material.child("texture")).is_some();
    let own = visuals().flat_map(|(_, visual)| visual.all("material"));
    let known: BTreeSet<&str> =
        root.all("material").chain(own).filter(described).filter_map(|material| material.get("name")).collect();
    let mut told = BTreeSet::new();
    let mut faults = Vec::new();
    for (link, visual) in visuals() {
        let Some(material) = visual.child("material").filter(|m| !described(m)) else { continue };
        let Some(name) = material.get("name").filter(|n| !n.is_empty() && !known.contains(n)) else { continue };
        if told.insert(name) {
            let owner = link.get("name").map_or_else(|| link.label(), brief);
            faults.push(format!(
                "{owner}: material {} (line {}) is described nowhere: ROS and viewers complain, and show the part in a \
                 colour of their own; write its <color>",
                brief(name),
                material.line
            ));
        }
    }
    faults
}

/// Transmissions to joints that are not there.
fn transmissions(root: &Element) -> Vec<String> {
    let joints: BTreeSet<&str> = root.all("joint").filter_map(|joint| joint.get("name")).collect();
    let tell = |transmission: &Element| {
        let drives = |joint: &&Element| joint.get("name").is_some_and(|name| !joints.contains(name));
        let joint = transmission.all("joint").find(drives)?;
        Some(format!(
            "{}: its joint {} (line {}) does not exist: ros_control refuses it",
            transmission.label(),
            brief(joint.get("name").unwrap_or_default()),
            joint.line
        ))
    };
    root.all("transmission").filter_map(tell).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::xml;
    use super::*;

    #[test]
    fn names_that_name_nothing_are_told_once() {
        let said = |body: &str| undefined(&xml::parse(Path::new("m.urdf"), &format!("<robot>{body}</robot>")).unwrap());
        let link = |material: &str| format!("<link name=\"door\"><visual>{material}</visual></link>");
        let red = "<material name=\"red\"><color rgba=\"1 0 0 1\"/></material>";
        for good in [
            link(red),
            format!("{red}{}", link("<material name=\"red\"/>")),
            format!("{}{}", link("<material name=\"red\"/>"), link(red)),
            link("<material name=\"\"/>"),
            "<joint name=\"j\"/><transmission name=\"t\"><joint name=\"j\"/></transmission>".to_owned(),
        ] {
            assert!(said(&good).is_empty(), "{good}: {:?}", said(&good));
        }
        let oak = said(&[link("<material name=\"oak\"/>"), link("<material name=\"oak\"/>")].concat());
        assert!(oak.len() == 1 && oak[0].starts_with("door: material oak (line 1) is described nowhere"), "{oak:?}");
        let driven = said("<transmission name=\"t\"><joint name=\"nope\"/></transmission>");
        assert!(driven.len() == 1 && driven[0].contains("its joint nope (line 1) does not exist"), "{driven:?}");
    }
}
