//! A synthetic kitchen as phones, headsets and their tools write it, and imported again.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use hdf5_pure::{AttrValue, FileBuilder};
use nalgebra::{Matrix3, UnitQuaternion};
use paws_twin::math::{Point, Pose, Vector};
use paws_twin::recording::{Recording, Side};
use serde_json::json;

use crate::common::{paws, stderr};
use crate::import::{FRAMES, apart, copy, depth_mm, edit, import, json, poses, same_bytes, small, still, write};

/// Frames of the recording that are written: some before the first hand, and those after it.
pub fn frames(recording: &Recording) -> Vec<usize> {
    let first = recording.hands.iter().map(|h| h.frame).min().unwrap().saturating_sub(4);
    (first..recording.frames.len().min(first + FRAMES)).collect()
}

/// Time of the n-th frame that is written, seconds.
pub fn secs(n: usize) -> f64 {
    1000.0 + n as f64 / 30.0
}

/// A world whose y is up from one whose z is.
pub fn y_up() -> Pose {
    let turn = UnitQuaternion::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2);
    Pose::from_parts(Vector::zeros().into(), turn)
}

/// 21 joints in the world: the tips where they are, and a palm of 9 cm.
fn joints(tips: &[Point; 3]) -> [Point; 21] {
    let mut out = [tips[0]; 21];
    for (place, tip) in [4, 8, 12].into_iter().zip(tips) {
        out[place] = *tip;
    }
    out[0] = tips[1];
    out[9] = tips[1] + Vector::new(0.0, 0.0, 0.09);
    out
}

/// World joints of a side at a frame.
fn hand(recording: &Recording, frame: usize, side: Side) -> Option<[Point; 21]> {
    recording.hands.iter().find(|h| h.frame == frame && h.side == side).map(|h| joints(&h.tips))
}

/// Checks that the hands of an imported recording are those of the frames that were written.
fn hands_are_back(out: &Path, recording: &Recording, frames: &[usize]) {
    let table = json(&out.join("hands.json"));
    let mut found = BTreeMap::new();
    for entry in table["frames"].as_array().unwrap() {
        for hand in entry["hands"].as_array().unwrap() {
            let joints: Vec<[f64; 3]> = serde_json::from_value(hand["joints_world"].clone()).unwrap();
            found
                .insert((entry["frame"].as_u64().unwrap() as usize, hand["side"].as_str().unwrap().to_owned()), joints);
        }
    }
    let mut count = 0;
    for (n, frame) in frames.iter().enumerate() {
        for (side, name) in [(Side::Left, "left"), (Side::Right, "right")] {
            let Some(truth) = hand(recording, *frame, side) else { continue };
            let back = &found[&(n, name.to_owned())];
            for (a, b) in back.iter().zip(&truth) {
                assert!((Point::from(*a) - b).norm() < 1e-5, "frame {n}, {name}: {a:?} {b}");
            }
            count += 1;
        }
    }
    assert!(count > 0 && found.len() == count, "{count} {}", found.len());
}

fn truth(recording: &Recording, frames: &[usize]) -> Vec<Pose> {
    frames.iter().map(|f| recording.frames[*f].world_from_camera).collect()
}

/// Checks poses, one image and one image of depth.
pub fn is_back(out: &Path, truth: &[Pose], frames: &[usize], metres: f64) {
    let (m, deg) = apart(truth, &poses(out));
    assert!(m < metres && deg < 1e-2, "{m} m, {deg} degrees");
    for n in [0, 7, frames.len() - 1] {
        let name = format!("frames/{n:06}.jpg");
        assert!(same_bytes(&still("frames", frames[n]), &out.join(&name)), "{name}");
        assert_eq!(depth_mm(&out.join(format!("depth/{n:06}.png"))), depth_mm(&still("depth", frames[n])), "{n}");
    }
}

/// Depth in metres, least significant byte first.
pub fn depth_f32(frame: usize) -> Vec<u8> {
    depth_mm(&still("depth", frame)).iter().flat_map(|mm| (f32::from(*mm) * 1e-3).to_le_bytes()).collect()
}

/// Rows of a pose whose camera has OpenGL axes.
fn opengl(pose: &Pose) -> (Matrix3<f64>, Vector) {
    let flip = Matrix3::from_diagonal(&Vector::new(1.0, -1.0, -1.0));
    (pose.rotation.to_rotation_matrix().into_inner() * flip, pose.translation.vector)
}

fn unit_quaternion(turn: Matrix3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(turn))
}

/// Expects `paws import SOURCE` to name all of `words`, and to leave nothing behind.
pub fn refused(source: &str, words: &[&str], build: impl FnOnce(&Path)) {
    let dir = tempfile::tempdir().unwrap();
    build(dir.path());
    let out = paws(&["import", source, "--out", "out"], dir.path());
    let message = stderr(&out);
    assert_eq!(out.status.code(), Some(2), "{source} {words:?}: {message}");
    for word in words {
        assert!(message.contains(word), "{source}: \"{word}\" is not in: {message}");
    }
    assert!(!message.contains("panicked") && !dir.path().join("out").exists(), "{source}: {message}");
}

/// Record3D's archive. Depth and confidence are packed; older versions of the app leave out dw, dh and times.
fn write_record3d(path: &Path, is_old: bool) -> Vec<Pose> {
    let recording = small();
    let frames = frames(&recording);
    let c = recording.camera;
    let mut zip = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let mut rows = Vec::new();
    for (n, frame) in frames.iter().enumerate() {
        let (turn, t) = opengl(&(y_up() * recording.frames[*frame].world_from_camera));
        let q = unit_quaternion(turn);
        rows.push([q.i, q.j, q.k, q.w, t.x, t.y, t.z]);
        let sure = vec![if n == 1 { 0u8 } else { 2 }; c.width * c.height];
        let packed = |bytes: &[u8]| {
            let mut out = Vec::new();
            lzfse_rust::encode_bytes(bytes, &mut out).unwrap();
            out
        };
        let jpg = std::fs::read(still("frames", *frame)).unwrap();
        for (ending, bytes) in [("jpg", jpg), ("depth", packed(&depth_f32(*frame))), ("conf", packed(&sure))] {
            zip.start_file(format!("rgbd/{n}.{ending}"), options).unwrap();
            zip.write_all(&bytes).unwrap();
        }
    }
    let mut metadata = json!({"w": c.width, "h": c.height, "fps": 30, "K": [c.fx, 0, 0, 0, c.fy, 0, c.cx, c.cy, 1],
        "poses": rows});
    if !is_old {
        metadata["dw"] = json!(c.width);
        metadata["dh"] = json!(c.height);
        metadata["initPose"] = json!(rows[0]);
        metadata["frameTimestamps"] = json!((0..frames.len()).map(secs).collect::<Vec<f64>>());
        metadata["perFrameIntrinsicCoeffs"] = json!(vec![[c.fx, c.fy, c.cx, c.cy]; frames.len()]);
    }
    zip.start_file("metadata", options).unwrap();
    zip.write_all(metadata.to_string().as_bytes()).unwrap();
    zip.finish().unwrap();
    truth(&recording, &frames)
}

#[test]
fn record3d_comes_back_as_it_was() {
    let recording = small();
    let frames = frames(&recording);
    for is_old in [false, true] {
        let dir = tempfile::tempdir().unwrap();
        let truth = write_record3d(&dir.path().join("scan.r3d"), is_old);
        import(&["scan.r3d", "--fps", "0"], dir.path());
        let out = dir.path().join("out");
        is_back(&out, &truth, &frames, 1e-6);
        // What the LiDAR is not sure of is no value.
        assert!(depth_mm(&out.join("depth/000001.png")).iter().all(|z| *z == 0));
    }
}

/// Polycam's folder: one camera, image, depth and confidence a time.
fn write_polycam(root: &Path, cameras: &str, pictures: &str) -> Vec<Pose> {
    let recording = small();
    let frames = frames(&recording);
    let c = recording.camera;
    let keyframes = root.join("keyframes");
    for (n, frame) in frames.iter().enumerate() {
        let (turn, t) = opengl(&(y_up() * recording.frames[*frame].world_from_camera));
        let mut camera = json!({"fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy, "width": c.width, "height": c.height,
            "blur_score": 71.5, "t_03": t.x, "t_13": t.y, "t_23": t.z});
        for i in 0..3 {
            for j in 0..3 {
                camera[format!("t_{i}{j}")] = json!(turn[(i, j)]);
            }
        }
        let name = format!("{:.0}", 1e6 * secs(n));
        write(&keyframes.join(cameras).join(format!("{name}.json")), camera.to_string());
        copy(&still("frames", *frame), &keyframes.join(pictures).join(format!("{name}.jpg")));
        copy(&still("depth", *frame), &keyframes.join("depth").join(format!("{name}.png")));
        let sure = if n == 1 { 0 } else { 127 };
        let sure = image::GrayImage::from_pixel(c.width as u32, c.height as u32, image::Luma([sure]));
        std::fs::create_dir_all(keyframes.join("confidence")).unwrap();
        sure.save(keyframes.join("confidence").join(format!("{name}.png"))).unwrap();
    }
    truth(&recording, &frames)
}

#[test]
fn polycam_comes_back_as_it_was_and_one_bad_camera_costs_only_itself() {
    let recording = small();
    let frames = frames(&recording);
    let dir = tempfile::tempdir().unwrap();
    let truth = write_polycam(&dir.path().join("scan"), "corrected_cameras", "corrected_images");
    // Uncorrected ones beside them are worse and not taken.
    write(&dir.path().join("scan/keyframes/cameras/1.json"), "{}");
    import(&["scan", "--fps", "0"], dir.path());
    let out = dir.path().join("out");
    is_back(&out, &truth, &frames, 1e-9);
    assert!(depth_mm(&out.join("depth/000001.png")).iter().all(|z| *z == 0));

    let dir = tempfile::tempdir().unwrap();
    write_polycam(&dir.path().join("scan"), "cameras", "images");
    let name = format!("{:.0}.json", 1e6 * secs(2));
    edit(&dir.path().join("scan/keyframes/cameras").join(&name), "\"fx\":", "\"f\":");
    import(&["scan", "--fps", "0"], dir.path());
    assert_eq!(poses(&dir.path().join("out")).len(), frames.len() - 1);
    let report = json(&dir.path().join("out/import.json"))["sources"][0]["notes"].to_string();
    assert!(report.contains(&name) && report.contains("drift"), "{report}");
}

/// Numbers of a world joint or a camera as 4 x 4 matrices.
fn matrices(poses: impl Iterator<Item = Pose>) -> Vec<f64> {
    poses.flat_map(|p| p.to_homogeneous().transpose().iter().copied().collect::<Vec<f64>>()).collect()
}

/// EgoDex: matrices of all joints in a world whose y is up.
fn write_egodex(path: &Path) {
    let recording = small();
    let frames = frames(&recording);
    let c = recording.camera;
    let count = frames.len() as u64;
    let mut file = FileBuilder::new();
    file.set_attr("llm_description", AttrValue::String("open the cupboard".to_owned()));
    let mut transforms = file.create_group("transforms");
    let cameras = matrices(frames.iter().map(|f| y_up() * recording.frames[*f].world_from_camera));
    transforms.create_dataset("camera").with_f64_data(&cameras).with_shape(&[count, 4, 4]);
    let mut confidences = file.create_group("confidences");
    for (side, name) in [(Side::Left, "left"), (Side::Right, "right")] {
        let hands: Vec<Option<[Point; 21]>> = frames.iter().map(|f| hand(&recording, *f, side)).collect();
        let sure: Vec<f64> = hands.iter().map(|h| if h.is_some() { 0.9 } else { 0.0 }).collect();
        for (i, joint) in paws_twin::import::joint_orders::ARKIT_NAMES.iter().enumerate() {
            let place = |h: &Option<[Point; 21]>| y_up() * h.map_or_else(Point::origin, |h| h[i]);
            let poses = hands.iter().map(|h| Pose::from_parts(place(h).coords.into(), UnitQuaternion::identity()));
            let rows = matrices(poses);
            transforms.create_dataset(&format!("{name}{joint}")).with_f64_data(&rows).with_shape(&[count, 4, 4]);
            confidences.create_dataset(&format!("{name}{joint}")).with_f64_data(&sure);
        }
    }
    file.add_group(transforms.finish());
    file.add_group(confidences.finish());
    let mut camera = file.create_group("camera");
    let k = [c.fx, 0.0, 0.5 * c.width as f64, 0.0, c.fy, 0.5 * c.height as f64, 0.0, 0.0, 1.0];
    camera.create_dataset("intrinsic").with_f64_data(&k).with_shape(&[3, 3]);
    file.add_group(camera.finish());
    file.write(path).unwrap();
}

#[test]
fn egodex_comes_back_with_hands_and_its_narration() {
    let recording = small();
    let frames = frames(&recording);
    let dir = tempfile::tempdir().unwrap();
    write_egodex(&dir.path().join("7.hdf5"));
    let text = import(&["7.hdf5", "--fps", "0"], dir.path());
    let out = dir.path().join("out");
    let (m, deg) = apart(&truth(&recording, &frames), &poses(&out));
    assert!(m < 1e-9 && deg < 1e-5, "{m} m, {deg} degrees");
    hands_are_back(&out, &recording, &frames);
    let clip = &json(&out.join("clips.json"))["clips"][0];
    assert_eq!(clip["narration"], "open the cupboard");
    assert_eq!(clip["end_frame"], frames.len() - 1);
    assert!(text.contains("missing: depth") && text.contains("missing: images"), "{text}");
}

/// ego-vision: bare NaN where there is nothing, a hand that was filled in, intrinsics frame by frame.
fn ego_vision() -> String {
    let recording = small();
    let frames = frames(&recording);
    let c = recording.camera;
    let k = format!(
        "[[{}, 0.0, {}], [0.0, {}, {}], [0.0, 0.0, 1.0]]",
        c.fx,
        0.5 * c.width as f64,
        c.fy,
        0.5 * c.height as f64
    );
    let cameras: Vec<String> = frames
        .iter()
        .map(|f| {
            let m = recording.frames[*f].world_from_camera.to_homogeneous();
            let row = |i: usize| format!("[{}, {}, {}, {}]", m[(i, 0)], m[(i, 1)], m[(i, 2)], m[(i, 3)]);
            format!("[{}]", (0..4).map(row).collect::<Vec<_>>().join(", "))
        })
        .collect();
    let side = |side: Side| {
        let (mut joints, mut sure, mut filled) = (Vec::new(), Vec::new(), Vec::new());
        for (n, frame) in frames.iter().enumerate() {
            let hand = hand(&recording, *frame, side);
            sure.push(if hand.is_some() { "0.8" } else { "NaN" });
            filled.push(if hand.is_none() && n % 2 == 0 { "true" } else { "false" });
            let rows: Vec<String> = match hand {
                Some(hand) => hand.iter().map(|p| format!("[{}, {}, {}]", p.x, p.y, p.z)).collect(),
                None if n % 2 == 0 => vec!["[0.5, 0.5, 0.5]".to_owned(); 21],
                None => vec!["[NaN, NaN, NaN]".to_owned(); 21],
            };
            joints.push(format!("[{}]", rows.join(", ")));
        }
        let (joints, sure, filled) = (joints.join(", "), sure.join(", "), filled.join(", "));
        format!("{{\"joints_world\": [{joints}], \"confidence\": [{sure}], \"infilled\": [{filled}]}}")
    };
    let mut text = "{\"episode_id\": \"NaN\", \"fps\": 30.0, ".to_owned();
    write!(text, "\"camera_trajectory\": [{}], \"intrinsics\": [{k}, {k}], ", cameras.join(", ")).unwrap();
    write!(text, "\"hands_world\": {{\"left\": {}, \"right\": {}}}", side(Side::Left), side(Side::Right)).unwrap();
    text + ", \"metadata\": {\"seq\": Infinity}}"
}

#[test]
fn ego_vision_comes_back_with_the_hands_that_were_seen() {
    let recording = small();
    let frames = frames(&recording);
    let dir = tempfile::tempdir().unwrap();
    write(&dir.path().join("result.json"), ego_vision());
    let text = import(&["result.json", "--fps", "0", "--up", "z"], dir.path());
    let out = dir.path().join("out");
    let (m, deg) = apart(&truth(&recording, &frames), &poses(&out));
    assert!(m < 1e-9 && deg < 1e-5, "{m} m, {deg} degrees");
    hands_are_back(&out, &recording, &frames);
    assert!(text.contains("VIDEO.mp4"), "{text}");
}

/// The Stera app's camera in its body: x right is z, y down is -y, z forward is x.
pub fn stera_body() -> Pose {
    let rows = Matrix3::new(0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0);
    let turn = unit_quaternion(rows);
    Pose::from_parts(Vector::zeros().into(), turn)
}

/// The pose of the Stera app's body at a frame, in its world.
pub fn stera_pose(recording: &Recording, frame: usize) -> Pose {
    y_up() * recording.frames[frame].world_from_camera * stera_body().inverse()
}

/// Numbers as numpy saves them.
pub fn npy(shape: &str, numbers: &[f64]) -> Vec<u8> {
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    out
}

/// The SDK's episode. `coordinates`: what it says the hands are in.
fn write_episode(root: &Path, coordinates: &str) {
    let recording = small();
    let frames = frames(&recording);
    let c = recording.camera;
    let count = frames.len() as u64;
    let times: Vec<f64> = (0..frames.len()).map(secs).collect();
    let mut file = FileBuilder::new();
    let mut group = file.create_group("depth");
    let (h, w) = (c.height as u64, c.width as u64);
    let counts: Vec<u16> = frames.iter().flat_map(|f| depth_mm(&still("depth", *f))).collect();
    let dataset = group.create_dataset("frames").with_u16_data(&counts).with_shape(&[count, h, w]);
    dataset.with_chunks(&[1, h, w]).with_deflate(4);
    group.create_dataset("timestamps").with_f64_data(&times);
    let valid: Vec<u8> = (0..frames.len()).map(|n| u8::from(n != 2)).collect();
    group.create_dataset("valid").with_u8_data(&valid);
    file.add_group(group.finish());
    let mut group = file.create_group("cam-pose");
    let poses: Vec<Pose> = frames.iter().map(|f| stera_pose(&recording, *f)).collect();
    let places: Vec<f32> =
        poses.iter().flat_map(|p| p.translation.vector.map(|x| x as f32).as_slice().to_vec()).collect();
    let turns: Vec<f32> = poses
        .iter()
        .flat_map(|p| p.rotation.to_rotation_matrix().into_inner().transpose().map(|x| x as f32).as_slice().to_vec())
        .collect();
    group.create_dataset("timestamps").with_f64_data(&times);
    group.create_dataset("translations").with_f32_data(&places).with_shape(&[count, 3]);
    group.create_dataset("rotations").with_f32_data(&turns).with_shape(&[count, 3, 3]);
    file.add_group(group.finish());
    let mut group = file.create_group("hand-pose");
    group.set_attr("coord_frame", AttrValue::String(coordinates.to_owned()));
    group.create_dataset("timestamps").with_f64_data(&times);
    for (side, name) in [(Side::Left, "left"), (Side::Right, "right")] {
        let hands: Vec<Option<[Point; 21]>> = frames.iter().map(|f| hand(&recording, *f, side)).collect();
        let seen: Vec<u8> = hands.iter().map(|h| u8::from(h.is_some())).collect();
        let mut rows: Vec<f32> = Vec::new();
        for (frame, hand) in frames.iter().zip(&hands) {
            let camera = recording.frames[*frame].world_from_camera.inverse();
            match hand {
                Some(hand) => {
                    rows.extend(hand.iter().flat_map(|p| <[f64; 3]>::from((camera * p).coords)).map(|x| x as f32))
                }
                None => rows.extend([f32::NAN; 63]),
            }
        }
        group.create_dataset(&format!("{name}_joints")).with_f32_data(&rows).with_shape(&[count, 21, 3]);
        group.create_dataset(&format!("{name}_valid")).with_u8_data(&seen);
        group.create_dataset(&format!("{name}_confidence")).with_f32_data(&vec![0.7; frames.len()]);
    }
    file.add_group(group.finish());
    std::fs::create_dir_all(root.join("calibrations")).unwrap();
    file.write(root.join("annotation.hdf5")).unwrap();
    let size = json!({"width": c.width, "height": c.height, "distortion_model": "plumb_bob"});
    write(&root.join("calibrations/meta.json"), json!({"rgb": size, "depth": size}).to_string());
    let k = npy("(3, 3)", &[c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0]);
    write(&root.join("calibrations/rgb_K.npy"), &k);
    write(&root.join("calibrations/depth_K.npy"), &k);
}

#[test]
fn stera_episodes_come_back_with_depth_and_hands() {
    let recording = small();
    let frames = frames(&recording);
    let dir = tempfile::tempdir().unwrap();
    write_episode(&dir.path().join("episode"), "camera_3d");
    import(&["episode", "--fps", "0"], dir.path());
    let out = dir.path().join("out");
    let found = poses(&out);
    // The frame without depth is none where there is no video.
    let kept: Vec<usize> = frames.iter().enumerate().filter(|(n, _)| *n != 2).map(|(_, f)| *f).collect();
    let (m, deg) = apart(&truth(&recording, &kept), &found);
    assert!(m < 1e-5 && deg < 1e-2, "{m} m, {deg} degrees");
    for n in [0, 5] {
        assert_eq!(depth_mm(&out.join(format!("depth/{n:06}.png"))), depth_mm(&still("depth", kept[n])), "{n}");
    }
    hands_are_back(&out, &recording, &kept);

    let dir = tempfile::tempdir().unwrap();
    write_episode(&dir.path().join("episode"), "image_2d");
    let text = import(&["episode/annotation.hdf5", "--fps", "0"], dir.path());
    assert!(text.contains("missing: hands"), "{text}");
    let notes = json(&dir.path().join("out/import.json"))["sources"][0]["notes"].to_string();
    assert!(notes.contains("image_2d"), "{notes}");
}

/// Files that the projects' own writers made (h5py, mcap): a few frames of 8 x 6 pixels.
fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/import").join(name)
}

#[test]
fn files_of_the_projects_own_writers_are_read() {
    for (name, kind, depth) in [
        ("episode", "stera", true),
        ("egodex/0.hdf5", "egodex", false),
        ("zstd.mcap", "stera", true),
        ("lz4.mcap", "stera", true),
    ] {
        let dir = tempfile::tempdir().unwrap();
        let source = sample(name);
        import(&[source.to_str().unwrap(), "--fps", "0"], dir.path());
        let out = dir.path().join("out");
        // The camera moves by a tenth of a metre a frame along the world's x.
        let found = poses(&out);
        assert_eq!(found.len(), 4, "{name}");
        for (n, pose) in found.iter().enumerate() {
            assert!((pose.translation.vector.x - 0.1 * n as f64).abs() < 1e-6, "{name}: {pose}");
        }
        assert_eq!(json(&out.join("import.json"))["sources"][0]["kind"], kind);
        if depth {
            // Depth is 1000 mm and one more each frame.
            for n in 0..4u16 {
                let z = depth_mm(&out.join(format!("depth/{n:06}.png")));
                assert!(z.iter().all(|z| *z == 1000 + n), "{name}: {z:?}");
            }
        }
    }
}

#[test]
fn broken_devices_are_named() {
    let r3d = |change: fn(&Path)| {
        move |dir: &Path| {
            write_record3d(&dir.join("a.r3d"), false);
            change(&dir.join("a.r3d"));
        }
    };
    refused(
        "a.r3d",
        &["a.r3d: archive", "copied as a whole"],
        r3d(|f| {
            let bytes = std::fs::read(f).unwrap();
            std::fs::write(f, &bytes[..bytes.len() / 2]).unwrap();
        }),
    );
    let metadata = |text: &'static str| {
        move |dir: &Path| {
            let mut zip = zip::ZipWriter::new(std::fs::File::create(dir.join("a.r3d")).unwrap());
            let options = zip::write::SimpleFileOptions::default();
            for (name, bytes) in [("metadata", text), ("../escape.jpg", "x")] {
                if !text.is_empty() || name != "metadata" {
                    zip.start_file(name, options).unwrap();
                    zip.write_all(bytes.as_bytes()).unwrap();
                }
            }
            zip.finish().unwrap();
        }
    };
    refused("a.r3d", &["a.r3d: metadata", "not in the archive"], metadata(""));
    refused(
        "a.r3d",
        &["a.r3d", "poses[0]"],
        metadata(r#"{"w": 4, "h": 3, "K": [1,0,0,0,1,0,2,2,1], "poses": [["0", 0, 0, 1, 0, 0, 0]]}"#),
    );
    refused("a.r3d", &["a.r3d", "K"], metadata(r#"{"w": 4, "h": 3, "K": [1, 0], "poses": []}"#));
    refused(
        "a.r3d",
        &["poses", "stopped at once"],
        metadata(r#"{"w": 4, "h": 3, "K": [1,0,0,0,1,0,2,2,1], "poses": []}"#),
    );

    refused("scan", &["cameras", "export"], |d| {
        for name in ["cameras", "images"] {
            std::fs::create_dir_all(d.join("scan/keyframes").join(name)).unwrap();
        }
    });
    refused("scan", &["json", "t_00"], |d| {
        let camera = r#"{"fx": 1, "fy": 1, "cx": 1, "cy": 1, "width": 2, "height": 2}"#;
        write(&d.join("scan/keyframes/cameras/1.json"), camera);
        std::fs::create_dir_all(d.join("scan/keyframes/images")).unwrap();
    });

    let json = |text: &'static str| move |dir: &Path| write(&dir.join("a.json"), text);
    refused("a.json", &["a.json", "camera_trajectory"], json(r#"{"camera_trajectory": [[["1", 0, 0, 0]]]}"#));
    refused("a.json", &["camera_trajectory[0]", "3 or 4 rows"], json(r#"{"camera_trajectory": [[[1, 0, 0]]]}"#));
    refused("a.json", &["holds no cameras"], json(r#"{"camera_trajectory": []}"#));
    refused("a.json", &["a.json", "line 1"], json(r#"{"camera_trajectory": [[[1, 0, 0, 0],"#));

    let episode = |change: fn(&mut FileBuilder)| {
        move |dir: &Path| {
            let mut file = FileBuilder::new();
            change(&mut file);
            std::fs::create_dir_all(dir.join("e")).unwrap();
            file.write(dir.join("e/annotation.hdf5")).unwrap();
        }
    };
    refused(
        "e",
        &["cam-pose/rotations", "expected [1, 3, 3]"],
        episode(|file| {
            let mut group = file.create_group("cam-pose");
            group.create_dataset("timestamps").with_f64_data(&[0.0]);
            group.create_dataset("translations").with_f64_data(&[0.0; 3]).with_shape(&[1, 3]);
            group.create_dataset("rotations").with_f64_data(&[0.0; 4]).with_shape(&[1, 2, 2]);
            file.add_group(group.finish());
        }),
    );
    refused("stera=e/annotation.hdf5", &["annotation.hdf5: HDF5", "copied as a whole"], |d| {
        write_episode(&d.join("e"), "camera_3d");
        let file = d.join("e/annotation.hdf5");
        let bytes = std::fs::read(&file).unwrap();
        std::fs::write(&file, &bytes[..40]).unwrap();
    });
    refused("egodex=7.hdf5", &["transforms/camera", "cannot be read"], |d| {
        let mut file = FileBuilder::new();
        file.create_dataset("x").with_f64_data(&[1.0]);
        file.write(d.join("7.hdf5")).unwrap();
    });
}
