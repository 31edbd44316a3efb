//! A look in every format: what is written is read back by other code, and hides the boxes that it stands for.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Read;
use std::path::Path;

use paws_twin::articulation::{Articulation, JointKind};
use paws_twin::export::{self, ExportContext, FORMATS, Purpose, dress};
use paws_twin::look::{Look, Texture, TexturedMesh};
use paws_twin::math::{Point, Vector};
use paws_twin::twin::{Furniture, Joint, OrientedBox, Part, Role, Solid, Twin};

fn solid(name: &str, role: Role, center: [f64; 3], half: [f64; 3]) -> Solid {
    let shape =
        OrientedBox { center: Point::from(center), half: Vector::from(half), rotation: nalgebra::Matrix3::identity() };
    Solid { name: name.to_owned(), role, shape, seen: true }
}

/// A cupboard with a door that is hinged at x = -0.3, and a floor.
fn twin() -> Twin {
    let front = solid("front_0", Role::Front, [0.0, -0.01, 1.0], [0.3, 0.01, 0.4]);
    let hinge = Point::new(-0.3, -0.02, 1.0);
    let joint = Joint {
        articulation: Articulation { kind: JointKind::Revolute, axis: -Vector::z(), origin: hinge },
        upper: 1.9,
        observed: 1.5,
        expected: 1.9,
        probability: None,
        damping: 0.5,
        friction: 0.5,
        resistance_seen: false,
        balanced: false,
    };
    let part = Part {
        id: "joint_0".to_owned(),
        label: "cupboard".to_owned(),
        joint,
        bounds: front.shape,
        solids: vec![front],
        handle: Point::new(0.25, -0.05, 1.0),
    };
    let furniture = Furniture {
        name: "cupboard_0".to_owned(),
        carcass: vec![solid("back_0", Role::Carcass, [0.0, 0.5, 1.0], [0.3, 0.01, 0.4])],
        part,
    };
    Twin {
        name: "kitchen".to_owned(),
        density_kg_per_m3: 600.0,
        drives: paws_twin::config::Drives::default(),
        furniture: vec![furniture],
        room: vec![solid("room_floor", Role::Room, [0.0, 0.0, -0.05], [2.0, 2.0, 0.05])],
        left_out: vec![],
    }
}

/// Four corners in order, as two triangles.
fn quad(corners: [[f64; 3]; 4], texture: usize) -> TexturedMesh {
    let positions = corners.map(Point::from);
    let normal = (positions[1] - positions[0]).cross(&(positions[2] - positions[0])).normalize();
    TexturedMesh {
        positions: positions.to_vec(),
        normals: vec![normal; 4],
        uv: vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.25], [0.0, 0.25]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        texture,
        seen: 0.75,
    }
}

/// A floor, flat, a corner, which is not, and the door's front.
fn look() -> Look {
    let picture =
        |name: &str, colour: [u8; 3]| Texture { name: name.to_owned(), width: 4, height: 4, rgb: colour.repeat(16) };
    let floor = quad([[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [2.0, 2.0, 0.0], [-2.0, 2.0, 0.0]], 0);
    let behind = quad([[-2.0, 2.0, 0.0], [2.0, 2.0, 0.0], [2.0, 2.0, 2.0], [-2.0, 2.0, 2.0]], 0);
    let aside = quad([[-2.0, -2.0, 0.0], [-2.0, 2.0, 0.0], [-2.0, 2.0, 2.0], [-2.0, -2.0, 2.0]], 0);
    let corner = joined(behind, aside);
    let door = quad([[-0.3, -0.02, 0.6], [0.3, -0.02, 0.6], [0.3, -0.02, 1.4], [-0.3, -0.02, 1.4]], 1);
    Look {
        textures: vec![picture("atlas_0", [200, 40, 40]), picture("atlas_1", [40, 200, 40])],
        room: vec![floor, corner],
        parts: BTreeMap::from([("joint_0".to_owned(), vec![door])]),
    }
}

fn files() -> BTreeMap<String, Vec<u8>> {
    dress::files(&twin(), &look()).unwrap().into_iter().collect()
}

/// All files of a twin with a look.
fn write_all(dir: &Path, twin: &Twin, look: &Look, verdicts: &[(String, String)]) {
    let mut all: BTreeMap<String, Vec<u8>> = dress::files(twin, look).unwrap().into_iter().collect();
    let beside = ExportContext { look: Some(look), verdicts, ..ExportContext::default() };
    for format in FORMATS.iter().filter(|format| format.purpose == Purpose::Model) {
        let written = (format.write)(twin, &beside).unwrap().files;
        all.extend(format.files.iter().map(|file| file.name.to_owned()).zip(written));
    }
    all.insert("twin.json".to_owned(), paws_twin::json::text(twin).unwrap().into_bytes());
    for (name, bytes) in all {
        let path = dir.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
}

/// Gives the twin of a folder that `paws twin` wrote a look: its own boxes, and a flat floor.
pub fn dress_up(folder: &Path) {
    let twin: Twin = paws_twin::json::read(&folder.join("twin.json")).unwrap();
    let validation: paws_twin::validation::Validation = paws_twin::json::read(&folder.join("validation.json")).unwrap();
    if folder.join("look").exists() {
        std::fs::remove_dir_all(folder.join("look")).unwrap();
    }
    let boxes = |solids: &[Solid]| solids.iter().flat_map(|s| sides(&s.shape)).collect::<Vec<_>>();
    let fixed: Vec<Solid> = twin.furniture.iter().flat_map(|f| &f.carcass).chain(&twin.room).cloned().collect();
    let mut dressed = look();
    dressed.room.truncate(1);
    dressed.room.extend(boxes(&fixed).into_iter().reduce(joined));
    dressed.parts = twin
        .furniture
        .iter()
        .map(|f| (f.part.id.clone(), boxes(&f.part.solids).into_iter().reduce(joined).into_iter().collect()))
        .collect();
    write_all(folder, &twin, &dressed, &validation.words());
}

/// Two meshes as one.
fn joined(mut a: TexturedMesh, b: TexturedMesh) -> TexturedMesh {
    let first = u32::try_from(a.positions.len()).unwrap();
    a.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + first)));
    a.positions.extend(b.positions);
    a.normals.extend(b.normals);
    a.uv.extend(b.uv);
    a
}

/// The six sides of a box.
fn sides(b: &OrientedBox) -> Vec<TexturedMesh> {
    let corner = |axis: usize, sign: f64, along: f64, across: f64| -> [f64; 3] {
        let mut local = Vector::zeros();
        (local[axis], local[(axis + 1) % 3], local[(axis + 2) % 3]) = (sign, along * sign, across);
        (b.center + b.rotation * local.component_mul(&b.half)).coords.into()
    };
    let side = |axis: usize, sign: f64| {
        quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(u, v)| corner(axis, sign, u, v)), 1)
    };
    (0..3).flat_map(|axis| [side(axis, -1.0), side(axis, 1.0)]).collect()
}

#[test]
fn gltf_holds_pictures_and_meshes_in_the_frames_of_their_links() {
    let bytes = export::gltf::write(&twin(), Some(&look()), &[]).unwrap();
    let gltf = gltf::Gltf::from_slice(&bytes).unwrap();
    let blob = gltf.blob.as_deref().unwrap();
    let colours: Vec<[u8; 3]> = gltf
        .images()
        .map(|image| {
            let gltf::image::Source::View { view, mime_type } = image.source() else { panic!("not embedded") };
            assert_eq!(mime_type, "image/jpeg");
            let picture = image::load_from_memory(&blob[view.offset()..view.offset() + view.length()]).unwrap();
            assert_eq!((picture.width(), picture.height()), (4, 4));
            picture.into_rgb8().get_pixel(1, 1).0
        })
        .collect();
    assert!(colours[0][0] > 150 && colours[0][1] < 90 && colours[1][1] > 150 && colours[1][0] < 90, "{colours:?}");

    let node = |name: &str| gltf.nodes().find(|n| n.name() == Some(name)).unwrap();
    let children = |name: &str| node(name).children().map(|n| n.name().unwrap().to_owned()).collect::<Vec<_>>();
    assert_eq!(children("joint_0"), ["front_0", "joint_0_look_0", "joint_0_handle"]);
    assert_eq!(children("room"), ["room_floor", "room_look_0", "room_look_1"]);
    assert!(["front_0", "back_0", "room_floor"].iter().all(|name| node(name).mesh().is_none()));
    let extras: serde_json::Value =
        serde_json::from_str(node("joint_0_look_0").extras().as_ref().unwrap().get()).unwrap();
    assert_eq!(extras, serde_json::json!({"look": {"link": "joint_0", "seen": 0.75}}));

    let door = node("joint_0_look_0").mesh().unwrap().primitives().next().unwrap();
    let material = door.material().pbr_metallic_roughness();
    assert_eq!((material.metallic_factor(), material.roughness_factor()), (0.0, 1.0));
    assert_eq!(material.base_color_texture().unwrap().texture().source().index(), 1);
    let reader = door.reader(|_| Some(blob));
    let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
    assert_eq!(positions, [[0.0, 0.0, -0.4], [0.6, 0.0, -0.4], [0.6, 0.0, 0.4], [0.0, 0.0, 0.4]]);
    let normals: Vec<[f32; 3]> = reader.read_normals().unwrap().collect();
    assert_eq!(normals, [[0.0, -1.0, 0.0]; 4]);
    let uv: Vec<[f32; 2]> = reader.read_tex_coords(0).unwrap().into_f32().collect();
    assert!(uv[0] == [0.0, 1.0] && uv[2][0] == 1.0 && (uv[2][1] - 0.25).abs() < 1e-4, "{uv:?}");
    let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
    assert_eq!(indices, [0, 1, 2, 0, 2, 3]);
    let corner = node("room_look_1").mesh().unwrap().primitives().next().unwrap();
    assert_eq!(corner.reader(|_| Some(blob)).read_indices().unwrap().into_u32().count(), 12);
}

#[test]
fn meshes_are_obj_that_open_under_their_pictures() {
    let files = files();
    let names: Vec<&str> = files.keys().map(String::as_str).collect();
    let wanted = ["atlas_0.png", "atlas_1.png", "joint_0_look_0.obj", "look.mtl", "room_look_0.obj", "room_look_1.obj"];
    assert_eq!(names, wanted.map(|name| format!("look/{name}")));
    let (materials, by_name) = tobj::load_mtl_buf(&mut files["look/look.mtl"].as_slice()).unwrap();
    assert_eq!(materials[by_name["look_atlas_1"]].diffuse_texture.as_deref(), Some("atlas_1.png"));
    // Flat ones have a pebble of four triangles behind them, or MuJoCo refuses them.
    for (name, triangles, pebble) in [("joint_0_look_0", 2, 4), ("room_look_0", 2, 4), ("room_look_1", 4, 0)] {
        let options = tobj::LoadOptions { single_index: true, ..Default::default() };
        let material = |path: &Path| {
            assert_eq!(path, Path::new("look.mtl"));
            tobj::load_mtl_buf(&mut files["look/look.mtl"].as_slice())
        };
        let mut text = files[&format!("look/{name}.obj")].as_slice();
        let (models, _) = tobj::load_obj_buf(&mut text, &options, material).unwrap();
        let mesh = &models[0].mesh;
        assert_eq!((models.len(), mesh.indices.len() / 3), (1, triangles + pebble), "{name}");
        assert!(mesh.material_id.is_some(), "{name}");
        assert_eq!(mesh.texcoords.len() / 2, mesh.positions.len() / 3, "{name}");
        // OBJ counts texture coordinates from below.
        assert_eq!(mesh.texcoords[..2], [0.0, 0.0], "{name}");
    }
    let picture = image::load_from_memory(&files["look/atlas_0.png"]).unwrap().into_rgb8();
    assert_eq!(picture.into_raw(), look().textures[0].rgb);
}

/// The value of an attribute in every line that has it.
fn values<'a>(text: &'a str, element: &str, attribute: &str) -> Vec<&'a str> {
    let (element, attribute) = (format!("<{element} "), format!(" {attribute}=\""));
    let lines = text.lines().filter(|line| line.trim_start().starts_with(&element));
    lines.filter_map(|line| line.split(attribute.as_str()).nth(1)?.split('"').next()).collect()
}

#[test]
fn mjcf_and_urdf_name_files_that_are_there_and_show_no_box_below_a_mesh() {
    let (twin, look) = (twin(), look());
    let files = files();
    for text in
        [export::mjcf::write(&twin, Some(&look)).unwrap(), export::mjcf::write_model(&twin, Some(&look)).unwrap()]
    {
        let named: BTreeSet<&str> =
            values(&text, "mesh", "file").into_iter().chain(values(&text, "texture", "file")).collect();
        assert_eq!(named.len(), 5);
        assert!(named.iter().all(|file| files.contains_key(*file)), "{named:?}");
        assert_eq!(values(&text, "geom", "mesh"), ["joint_0_look_0", "room_look_0", "room_look_1"]);
        assert!(!text.contains("_visual\""), "{text}");
        assert_eq!(text.matches("class=\"collision\" pos").count(), 3);
        let geom = text.lines().find(|line| line.contains("mesh=\"joint_0_look_0\"")).unwrap();
        assert!(geom.contains("class=\"visual\"") && geom.contains("mass=\"0\""), "{geom}");
    }
    let urdf = export::urdf::write(&twin, Some(&look)).unwrap();
    assert!(urdf.contains("strippath=\"false\"") && !urdf.contains("_visual"), "{urdf}");
    let robot = urdf_rs::read_from_string(&urdf).unwrap();
    let meshes = |link: &str| -> Vec<String> {
        let link = robot.links.iter().find(|l| l.name == link).unwrap();
        let file = |visual: &urdf_rs::Visual| match &visual.geometry {
            urdf_rs::Geometry::Mesh { filename, .. } => filename.clone(),
            _ => panic!("a box is shown"),
        };
        link.visual.iter().map(file).collect()
    };
    assert_eq!(meshes("joint_0_link"), ["look/joint_0_look_0.obj"]);
    assert_eq!(meshes("room"), ["look/room_look_0.obj", "look/room_look_1.obj"]);
    assert!(meshes("cupboard_0").is_empty());
    assert!(robot.links.iter().all(|l| l.name == "world" || l.collision.len() == 1));
}

#[test]
fn usd_has_texture_coordinates_and_a_package_that_needs_no_unpacking() {
    let text = export::usd::write(&twin(), Some(&look())).unwrap();
    assert_eq!(text.matches("texCoord2f[] primvars:st = [").count(), 3);
    assert_eq!(text.matches("uniform token purpose = \"guide\"").count(), 3);
    assert!(text.contains("asset inputs:file = @./look/atlas_1.png@"), "{text}");
    assert!(text.contains("point3f[] points = [(0,0,-0.4),(0.6,0,-0.4),(0.6,0,0.4),(0,0,0.4)]"), "{text}");

    let package = export::usd::write_package(&twin(), Some(&look())).unwrap();
    let mut zip = zip::ZipArchive::new(std::io::Cursor::new(&package)).unwrap();
    let names: Vec<String> = (0..zip.len()).map(|i| zip.by_index(i).unwrap().name().unwrap().into_owned()).collect();
    assert_eq!(names, ["scene.usda", "look/atlas_0.jpg", "look/atlas_1.jpg"]);
    for i in 0..zip.len() {
        let mut file = zip.by_index(i).unwrap();
        assert_eq!((file.compression(), file.data_start().unwrap() % 64), (zip::CompressionMethod::Stored, 0));
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        if i == 0 {
            assert_eq!(String::from_utf8(bytes).unwrap(), text.replace(".png@", ".jpg@"));
        } else {
            assert!(bytes.starts_with(&[0xff, 0xd8]));
        }
    }
}

#[test]
fn a_look_without_triangles_is_none() {
    let twin = twin();
    let mut empty = look();
    empty.parts.clear();
    for mesh in &mut empty.room {
        // Corners at one place have no area.
        mesh.triangles = vec![[0, 0, 1], [2, 1, 2]];
    }
    assert!(!dress::shows(&twin, &empty).unwrap() && dress::shows(&twin, &look()).unwrap());
    assert!(dress::files(&twin, &empty).unwrap().is_empty());
    assert_eq!(export::mjcf::write(&twin, Some(&empty)).unwrap(), export::mjcf::write(&twin, None).unwrap());
    assert_eq!(export::urdf::write(&twin, Some(&empty)).unwrap(), export::urdf::write(&twin, None).unwrap());
    assert_eq!(export::usd::write(&twin, Some(&empty)).unwrap(), export::usd::write(&twin, None).unwrap());
    assert_eq!(export::gltf::write(&twin, Some(&empty), &[]).unwrap(), export::gltf::write(&twin, None, &[]).unwrap());
}

#[test]
fn a_look_that_cannot_be_shown_is_refused_with_its_place() {
    for (break_it, words) in [
        ((|l: &mut Look| l.room[1].uv.truncate(3)) as fn(&mut Look), "mesh 1 of room: each vertex needs"),
        (|l: &mut Look| l.room[0].triangles[1][2] = 4, "mesh 0 of room: a triangle has a vertex"),
        (|l: &mut Look| l.room[0].texture = 2, "a texture that is not there"),
        (|l: &mut Look| l.room[0].positions[0].x = f64::NAN, "not finite"),
        (|l: &mut Look| l.textures[0].rgb.truncate(5), "atlas_0\": it needs three bytes a pixel"),
        (|l: &mut Look| l.textures[1].name = "ATLAS_0".to_owned(), "its name is used twice"),
        (|l: &mut Look| l.textures[1].name = "../a".to_owned(), "letters, digits"),
        (|l: &mut Look| drop(l.parts.insert("joint_7".to_owned(), vec![])), "the twin has no part joint_7"),
    ] {
        let (twin, mut look) = (twin(), look());
        break_it(&mut look);
        for error in [
            export::urdf::write(&twin, Some(&look)).unwrap_err().to_string(),
            export::mjcf::write(&twin, Some(&look)).unwrap_err().to_string(),
            export::gltf::write(&twin, Some(&look), &[]).unwrap_err().to_string(),
            export::usd::write(&twin, Some(&look)).unwrap_err().to_string(),
            dress::files(&twin, &look).unwrap_err().to_string(),
        ] {
            assert!(error.contains(words), "{error}, not {words}");
        }
    }
    let mut taken = twin();
    taken.room[0].name = "joint_0_look_0".to_owned();
    let error = export::urdf::write(&taken, Some(&look())).unwrap_err().to_string();
    assert!(error.contains("joint_0_look_0") && error.contains("used twice"), "{error}");
}

#[test]
fn the_look_of_a_twins_folder_is_exported_again_byte_for_byte() {
    let dir = tempfile::tempdir().unwrap();
    write_all(&dir.path().join("made"), &twin(), &look(), &[]);
    let out = crate::common::paws(&["export", "made", "--out", "again"], dir.path());
    assert!(out.status.success(), "{}", crate::common::stderr(&out));
    let mut expected: Vec<String> = files().into_keys().collect();
    expected.extend(export::names_of(Purpose::Model).map(str::to_owned));
    for name in expected {
        let [made, again] = ["made", "again"].map(|folder| std::fs::read(dir.path().join(folder).join(&name)));
        assert!(made.unwrap() == again.unwrap(), "{name} differs");
    }
    let out = crate::common::paws(&["export", "made", "--no-textures", "--out", "bare"], dir.path());
    assert!(out.status.success() && !dir.path().join("bare/look").exists());
    assert_eq!(
        std::fs::read_to_string(dir.path().join("bare/scene.xml")).unwrap(),
        export::mjcf::write(&twin(), None).unwrap()
    );
}

#[test]
fn what_is_checked_of_a_dressed_twin_is_what_is_checked_of_a_bare_one() {
    let dir = tempfile::tempdir().unwrap();
    write_all(&dir.path().join("made"), &twin(), &look(), &[]);
    let bare = crate::common::paws(&["export", "made", "--no-textures", "--out", "bare"], dir.path());
    assert!(bare.status.success());
    for name in ["scene.urdf", "scene.xml", "kitchen.xml", "scene.glb"] {
        let said = ["made", "bare"].map(|folder| {
            let out = crate::common::paws(&["check", &format!("{folder}/{name}")], dir.path());
            let text = String::from_utf8_lossy(&out.stdout).replace(&format!("{folder}/"), "");
            (out.status.code(), text)
        });
        assert_eq!(said[0], said[1], "{name}");
    }
}
