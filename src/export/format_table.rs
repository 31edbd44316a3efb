//! Every format that a twin is written in, in one table: a row more is a format more.
//!
//! The command line, the page of a twin's folder and the tests read the table; nothing else lists formats.

use super::annotations::{self, Shown};
use super::{gltf, mjcf, urdf, usd};
use crate::error::{Error, Result};
use crate::import::ply::Cloud;
use crate::look::Look;
use crate::twin::Twin;

/// What a format is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// The whole twin, for simulators and viewers; every twin's folder has it.
    Model,
    /// What a robot needs to open the joints.
    Robot,
    /// Joints in the form of another data set.
    DataSet,
}

/// What a format is made of, or has beside it, besides the twin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// The twin alone, or what [`ExportContext`] has in any case.
    Nothing,
    /// Its files name those of [`super::dress::files`], which have to lie beside them.
    LookFiles,
    /// `primitives.json` as text.
    Primitives,
    /// Clips with their joints.
    Clips,
    /// The points of a reconstruction.
    Points,
}

/// What there is besides the twin. What no chosen format needs may be left empty.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExportContext<'a> {
    /// What the twin looks like.
    pub look: Option<&'a Look>,
    /// Joints by id, and what their replay says.
    pub verdicts: &'a [(String, String)],
    /// Clips with their joints.
    pub clips: &'a [Shown],
    /// The reconstruction, in the twin's frame.
    pub cloud: Option<&'a Cloud>,
    /// What robots need, as `primitives.json` has it; the exporters stand below it.
    pub primitives: &'a str,
}

/// The contents of a format's files.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ExportedFiles {
    /// In the order of [`ExportFormat::files`].
    pub files: Vec<Vec<u8>>,
    /// What had to be left out, each with its reason.
    pub left_out: Vec<String>,
}

impl ExportedFiles {
    /// Files without anything left out.
    fn whole(files: Vec<Vec<u8>>) -> Self {
        Self { files, left_out: Vec::new() }
    }
}

/// A file of a format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ExportFile {
    /// Its name in the output folder.
    pub name: &'static str,
    /// What it is, for people.
    pub what: &'static str,
}

/// A format.
#[derive(Debug, Clone, Copy)]
pub struct ExportFormat {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, in one line.
    pub help: &'static str,
    /// What it is for.
    pub purpose: Purpose,
    /// What it needs besides the twin.
    pub need: Need,
    /// Its files.
    pub files: &'static [ExportFile],
    /// Writes them. The error says why the twin cannot be written so.
    pub write: fn(&Twin, &ExportContext) -> Result<ExportedFiles>,
}

/// All formats.
pub static FORMATS: [ExportFormat; 9] = [
    ExportFormat {
        name: "urdf",
        help: "Robot description for ROS, PyBullet, Drake, Pinocchio",
        purpose: Purpose::Model,
        need: Need::LookFiles,
        files: &[ExportFile { name: "scene.urdf", what: "the twin for ROS, PyBullet, Drake, Pinocchio" }],
        write: |twin, beside| Ok(ExportedFiles::whole(vec![urdf::write(twin, beside.look)?.into_bytes()])),
    },
    ExportFormat {
        name: "mjcf",
        help: "MuJoCo model",
        purpose: Purpose::Model,
        need: Need::LookFiles,
        files: &[
            ExportFile { name: "scene.xml", what: "the twin for MuJoCo, with floor, light and keyframes" },
            ExportFile {
                name: "kitchen.xml",
                what: "the same without floor and light, to include in a MuJoCo scene of your own",
            },
        ],
        write: |twin, beside| {
            let (scene, model) =
                rayon::join(|| mjcf::write(twin, beside.look), || mjcf::write_model(twin, beside.look));
            Ok(ExportedFiles::whole(vec![scene?.into_bytes(), model?.into_bytes()]))
        },
    },
    ExportFormat {
        name: "gltf",
        help: "Binary glTF 2.0 with animations, for viewers",
        purpose: Purpose::Model,
        need: Need::Nothing,
        files: &[ExportFile {
            name: VIEWED,
            what: "the twin for viewers and game engines, with an animation per joint",
        }],
        write: |twin, beside| Ok(ExportedFiles::whole(vec![gltf::write(twin, beside.look, beside.verdicts)?])),
    },
    ExportFormat {
        name: "gltf-physics",
        help: "Binary glTF 2.0 with KHR_physics_rigid_bodies, for engines",
        purpose: Purpose::Model,
        need: Need::Nothing,
        files: &[ExportFile { name: "physics.glb", what: "the twin for engines that read KHR_physics_rigid_bodies" }],
        write: |twin, _| Ok(ExportedFiles::whole(vec![gltf::write_physics(twin)?])),
    },
    ExportFormat {
        name: "usd",
        help: "OpenUSD with UsdPhysics, for Isaac: as text, and with its pictures as one file",
        purpose: Purpose::Model,
        need: Need::LookFiles,
        files: &[
            ExportFile { name: "scene.usda", what: "the twin for Isaac and OpenUSD, with UsdPhysics" },
            ExportFile { name: "scene.usdz", what: "the same with its pictures in one file, also for phones" },
        ],
        write: |twin, beside| {
            let (text, package) =
                rayon::join(|| usd::write(twin, beside.look), || usd::write_package(twin, beside.look));
            Ok(ExportedFiles::whole(vec![text?.into_bytes(), package?]))
        },
    },
    ExportFormat {
        name: "primitives",
        help: "What a robot needs to open each joint: grasp, path, Dynamic Movement Primitive (primitives.json; \
               docs/primitives.md)",
        purpose: Purpose::Robot,
        need: Need::Primitives,
        files: &[ExportFile {
            name: "primitives.json",
            what: "for robots: grasp, path of the gripper and Dynamic Movement Primitive of each joint",
        }],
        write: |_, beside| Ok(ExportedFiles::whole(vec![beside.primitives.as_bytes().to_vec()])),
    },
    ExportFormat {
        name: "arti4d",
        help: "Arti4D's list of joints (arti4d.json)",
        purpose: Purpose::DataSet,
        need: Need::Nothing,
        files: &[ExportFile { name: "arti4d.json", what: "joints as Arti4D lists them" }],
        write: |twin, _| Ok(ExportedFiles::whole(vec![annotations::arti4d(twin)?.into_bytes()])),
    },
    ExportFormat {
        name: "egoarti",
        help: "EgoArti's list of clips and their annotations (egoarti_list.json, egoarti.json)",
        purpose: Purpose::DataSet,
        need: Need::Clips,
        files: &[
            ExportFile { name: "egoarti_list.json", what: "clips with their furniture as EgoArti lists them" },
            ExportFile { name: "egoarti.json", what: "the joints of these clips as EgoArti annotates them" },
        ],
        write: |twin, beside| {
            Ok(ExportedFiles::whole(annotations::egoarti(twin, beside.clips)?.map(String::into_bytes).into()))
        },
    },
    ExportFormat {
        name: "usdnet",
        help: "What USDNet is trained on: parts as points of --points, with their joints (usdnet_articulation.json, \
               usdnet.npy, usdnet_instance_gt.txt)",
        purpose: Purpose::DataSet,
        need: Need::Points,
        files: &[
            ExportFile { name: "usdnet_articulation.json", what: "parts as points with their joints, for USDNet" },
            ExportFile { name: "usdnet.npy", what: "the points with their labels, for USDNet" },
            ExportFile { name: "usdnet_instance_gt.txt", what: "the part of each point, for USDNet" },
        ],
        write: usdnet,
    },
];

/// The file that the page and the viewers of others show.
pub const VIEWED: &str = "scene.glb";

/// The format of a name.
#[must_use]
pub fn named(name: &str) -> Option<&'static ExportFormat> {
    FORMATS.iter().find(|format| format.name == name)
}

/// The names of the files of some formats, in the order of the table.
pub fn names_of(purpose: Purpose) -> impl Iterator<Item = &'static str> {
    FORMATS.iter().filter(move |format| format.purpose == purpose).flat_map(|format| format.files).map(|file| file.name)
}

/// Parts as points; parts on which none lies are left out.
fn usdnet(twin: &Twin, beside: &ExportContext) -> Result<ExportedFiles> {
    let Some(cloud) = beside.cloud else {
        return Err(Error::Export("usdnet: parts are points of a reconstruction: give it".to_owned()));
    };
    let parts = annotations::usdnet(twin, cloud)?;
    let unseen = |id: &String| format!("{id}: no point of the reconstruction lies on it; it is left out");
    Ok(ExportedFiles {
        files: vec![parts.articulation.into_bytes(), parts.points, parts.instances.into_bytes()],
        left_out: parts.unseen.iter().map(unseen).collect(),
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_of_formats_and_files_are_each_there_once() {
        let names: BTreeSet<&str> = FORMATS.iter().map(|f| f.name).collect();
        assert_eq!(names.len(), FORMATS.len());
        let files: Vec<&str> = FORMATS.iter().flat_map(|f| f.files).map(|f| f.name).collect();
        assert_eq!(files.iter().collect::<BTreeSet<_>>().len(), files.len());
        assert!(FORMATS.iter().all(|f| named(f.name).is_some_and(|found| found.name == f.name)));
        assert!(named("stl").is_none());
    }

    #[test]
    fn every_format_writes_the_files_that_it_lists() {
        let twin = Twin {
            name: "empty".to_owned(),
            density_kg_per_m3: 700.0,
            drives: crate::config::Drives::default(),
            furniture: Vec::new(),
            room: Vec::new(),
            left_out: Vec::new(),
        };
        let beside = ExportContext { primitives: "{}", ..ExportContext::default() };
        // There is no part without furniture, and no point on one.
        for format in FORMATS.iter().filter(|f| f.need != Need::Points) {
            let written = (format.write)(&twin, &beside).unwrap();
            assert_eq!(written.files.len(), format.files.len(), "{}", format.name);
        }
    }
}
