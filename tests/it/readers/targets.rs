//! The readers: one function each.

use std::fmt::{Display, Write};
use std::hint::black_box;
use std::path::Path;
use std::sync::OnceLock;

use paws_twin::config::{self, Config};
use paws_twin::evaluation::stages::SceneTruth;
use paws_twin::evaluation::{Predictions, Truth};
use paws_twin::fitting::joints::{self, JointsFile};
use paws_twin::import::blob::{self, Blob};
use paws_twin::import::capture::{ByteOrder, Depth, DepthCoding};
use paws_twin::import::decode;
use paws_twin::import::formats::{self, ImportFormat, surface};
use paws_twin::model::{self, check, furniture};
use paws_twin::reasoning::answers;
use paws_twin::recording::trajectory::{self, LengthUnit};
use paws_twin::recording::{AtWork, Camera, Clip, Recording, images, narration, segments};
use paws_twin::twin::Twin;
use paws_twin::vlm::absent::{DryRun, StoredOnly};
use paws_twin::vlm::store::Stored;
use paws_twin::vlm::{LanguageModel as _, PictureQuestion, Sampling};
use paws_twin::{export, json};

use super::files::Files;
use super::imports;

/// A reader on a folder of files and the bytes of an input.
pub type Reader = fn(&mut Files, &[u8]);

/// All readers but those of `paws import`. Each has a folder of seeds in `fuzz/corpus`; `NAME_check` has those of `NAME`.
const TARGETS: &[(&str, Reader)] = &[
    ("cameras", |f, b| recording(f, "cameras.json", b)),
    ("clips", |f, b| recording(f, "clips.json", b)),
    ("hands", |f, b| recording(f, "hands.json", b)),
    ("fingertips", |f, b| recording(f, "fingertips.csv", b)),
    ("labels", |f, b| recording(f, "labels.json", b)),
    ("ply", |f, b| recording(f, "reconstruction.ply", b)),
    ("obj", |f, b| recording(f, "reconstruction.obj", b)),
    ("image", image),
    ("npz", |f, b| drop(told(segments::read(&f.put("000000.npz", b))))),
    ("segments", |f, b| drop(told(segments::read(&f.put("segments_0.txt", b))))),
    ("trajectory", trajectory),
    ("joints", joints),
    ("predictions", |f, b| drop(told(Predictions::read(&f.put("predictions.json", b))))),
    ("truth", truth),
    ("twin", twin),
    ("answers", spoken),
    ("stored", stored),
    ("narration", narrated),
    ("config", configured),
    ("urdf", |f, b| drop(model(f, "m.urdf", b))),
    ("mjcf", |f, b| drop(model(f, "m.xml", b))),
    ("glb", |f, b| drop(told(model::glb::read(&f.put("m.glb", b))))),
    ("urdf_check", |f, b| checked(f, "m.urdf", b)),
    ("mjcf_check", |f, b| checked(f, "m.xml", b)),
    ("glb_check", scene),
    ("mesh_obj", |f, b| mesh(f, "a.obj", b)),
    ("mesh_stl", |f, b| mesh(f, "a.stl", b)),
    ("surface_ply", |f, b| drop(told(surface::read(&f.put("m.ply", b))))),
    ("surface_obj", |f, b| drop(told(surface::read(&f.put("m.obj", b))))),
    ("surface_glb", |f, b| drop(told(surface::read(&f.put("m.glb", b))))),
    ("depth", depth),
    ("picture", |_, b| drop(told(decode::picture(&Blob::Inline(b.into()))))),
    ("zip", zip),
];

/// Before the name of a format of `paws import`.
pub const IMPORT: &str = "import-";

/// A reader.
pub enum Target {
    Own(Reader),
    Import(&'static ImportFormat),
}

impl Target {
    /// The reader of a name.
    pub fn named(name: &str) -> Option<Self> {
        let own = TARGETS.iter().find(|(n, _)| *n == name).map(|(_, reader)| Self::Own(*reader));
        own.or_else(|| name.strip_prefix(IMPORT).and_then(formats::named).map(Self::Import))
    }

    /// Reads one input.
    pub fn run(&self, files: &mut Files, bytes: &[u8]) {
        match self {
            Self::Own(reader) => reader(files, bytes),
            Self::Import(format) => {
                imports::run(format, files, bytes);
            }
        }
    }
}

/// The names of all readers.
pub fn names() -> Vec<String> {
    let own = TARGETS.iter().map(|(name, _)| (*name).to_owned());
    own.chain(formats::ALL.iter().map(|format| format!("{IMPORT}{}", format.name))).collect()
}

/// What a reader gives; its error is told, as a user would see it.
pub fn told<T, E: Display>(result: Result<T, E>) -> Option<T> {
    match result {
        Ok(value) => Some(black_box(value)),
        Err(error) => {
            black_box(error.to_string());
            None
        }
    }
}

const CAMERAS: &str = r#"{"width":16,"height":12,"fx":10.0,"fy":10.0,"cx":7.5,"cy":5.5,"frames":[
{"frame":0,"timestamp":0.0,"position":[0,0,1.5],"rotation_wxyz":[1,0,0,0]},
{"frame":1,"timestamp":0.1,"position":[0.1,0,1.5],"rotation_wxyz":[1,0,0,0]}]}"#;
const CLIPS: &str = r#"{"clips":[{"clip":"a","start_frame":0,"end_frame":1,"narration":"open the fridge"}]}"#;
const HANDS: &str = "frame,side,contact,thumb_x,thumb_y,thumb_z,index_x,index_y,index_z,middle_x,middle_y,middle_z
0,right,1,0.0,0.0,2.0,0.05,0.0,2.0,0.06,0.0,2.0
";

/// A recording in which one file is the input.
fn recording(files: &mut Files, name: &str, bytes: &[u8]) {
    files.put("cameras.json", CAMERAS.as_bytes());
    files.put("clips.json", CLIPS.as_bytes());
    // hands.json comes before fingertips.csv where both are there.
    files.put("fingertips.csv", HANDS.as_bytes());
    files.put(name, bytes);
    let Some(recording) = told(Recording::open(files.root())) else { return };
    black_box(AtWork::of(&recording));
    for clip in &recording.clips {
        black_box(narration::read(clip));
    }
    if !recording.reconstruction.is_empty() {
        told(recording.depth(0));
    }
}

/// Images of a recording, whose size is known.
fn image(files: &mut Files, bytes: &[u8]) {
    let path = files.put("000000.png", bytes);
    let camera = Camera { width: 16, height: 12, fx: 10.0, fy: 10.0, cx: 7.5, cy: 5.5 };
    told(images::rgb(&path, &camera));
    told(images::depth(&path, &camera));
    told(images::classes(&path, &camera));
    told(images::normals(&path, &camera));
}

fn trajectory(files: &mut Files, bytes: &[u8]) {
    let path = files.put("t.txt", bytes);
    told(trajectory::read(&path));
    told(trajectory::read_in(&path, Some(LengthUnit::Millimetre)));
}

/// Joints found elsewhere, built.
fn joints(files: &mut Files, bytes: &[u8]) {
    let Some(file) = told(json::read::<JointsFile>(&files.put("joints.json", bytes))) else { return };
    if let Some(twin) = told(joints::from_joints(&file, &config::Fitting::default(), &config::Priors::default())) {
        told(export::check(&twin));
    }
}

fn truth(files: &mut Files, bytes: &[u8]) {
    files.put("clips.json", CLIPS.as_bytes());
    files.put("ground_truth.json", bytes);
    told(Truth::read(files.root()));
    told(SceneTruth::read(files.root()));
}

/// A twin, written again in every format.
fn twin(files: &mut Files, bytes: &[u8]) {
    let Some(twin) = told(json::read::<Twin>(&files.put("twin.json", bytes))) else { return };
    told(export::check(&twin));
    told(export::urdf::write(&twin, None));
    told(export::mjcf::write(&twin, None));
    told(export::usd::write(&twin, None));
    told(export::gltf::write_physics(&twin));
}

/// What a language model said.
fn spoken(_: &mut Files, bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    black_box(answers::motion(&text));
    black_box(answers::lines(&text, 9));
}

/// A stored answer, in the place where its question looks for it.
fn stored(files: &mut Files, bytes: &[u8]) {
    static NAME: OnceLock<String> = OnceLock::new();
    let question = PictureQuestion {
        purpose: "clip/motion".to_owned(),
        text: "How does it move?".to_owned(),
        pictures: Vec::new(),
        sampling: Sampling { temperature: 0.0, top_p: 1.0, max_tokens: 9 },
    };
    let name = NAME.get_or_init(|| {
        let first = Stored::new(DryRun::new("model"), files.root()).expect("the folder is there");
        first.ask(&question).expect("nobody is asked");
        let entries = std::fs::read_dir(files.root()).expect("the folder is there");
        let mut names = entries.filter_map(|e| e.ok()?.file_name().into_string().ok());
        names.find(|n| n.ends_with(".json")).expect("the answer was kept")
    });
    files.put(name, bytes);
    told(Stored::reading(StoredOnly::new("model"), files.root()).ask(&question));
}

fn narrated(_: &mut Files, bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.splitn(3, '\n').map(str::to_owned);
    let mut next = || lines.next().unwrap_or_default();
    let (verb, noun, narration) = (next(), next(), next());
    let clip = Clip { clip: "a".to_owned(), start_frame: 0, end_frame: 1, narration, verb, noun };
    let reading = narration::read(&clip);
    black_box(config::Hanging::default().level_share(reading.furniture.as_deref(), 0.9));
}

fn configured(_: &mut Files, bytes: &[u8]) {
    told(Config::parse(&String::from_utf8_lossy(bytes), Path::new("config.toml")));
}

fn model(files: &mut Files, name: &str, bytes: &[u8]) -> Option<model::Model> {
    let model = told(model::read(&files.put(name, bytes)))?;
    black_box(model.tree().is_ok());
    Some(model)
}

/// Every point of "simulation-ready", and the way to a twin.
fn checked(files: &mut Files, name: &str, bytes: &[u8]) {
    let Some(model) = model(files, name, bytes) else { return };
    black_box(check::model(&model, None));
    black_box(furniture::to_ruled_twin(&model));
}

fn scene(files: &mut Files, bytes: &[u8]) {
    let Some(scene) = told(model::glb::read(&files.put("m.glb", bytes))) else { return };
    black_box(check::scene(&scene, None));
}

/// A mesh that a model names.
fn mesh(files: &mut Files, name: &str, bytes: &[u8]) {
    files.put(name, bytes);
    let mut text = String::new();
    let written = write!(
        text,
        "<robot name='r'><link name='l'><collision><geometry><mesh filename='{name}'/></geometry></collision></link></robot>"
    );
    if written.is_ok() {
        told(model::read(&files.put("m.urdf", text.as_bytes())));
    }
}

/// Depth in the coding that the first byte says.
fn depth(_: &mut Files, bytes: &[u8]) {
    let Some((first, rest)) = bytes.split_first() else { return };
    let (width, height, unit_m) = (4, 3, 1e-3);
    let order = if first & 8 == 0 { ByteOrder::Little } else { ByteOrder::Big };
    let coding = match first % 6 {
        0 => DepthCoding::Png16 { unit_m },
        1 => DepthCoding::Pgm16 { unit_m },
        2 => DepthCoding::Exr,
        3 => DepthCoding::Npy { unit_m },
        4 => DepthCoding::RawF32 { width, height, order },
        _ => DepthCoding::RawU16 { width, height, order, unit_m },
    };
    let how = Depth::of(coding, Vec::new());
    told(decode::depth(&Blob::Inline(rest.into()), None, &how));
}

/// An archive and what is in it.
fn zip(files: &mut Files, bytes: &[u8]) {
    let Some(entries) = told(blob::entries(&files.put("a.zip", bytes))) else { return };
    for (_, blob) in entries.iter().take(8) {
        told(blob.read());
    }
}
