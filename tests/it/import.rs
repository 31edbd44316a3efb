//! A synthetic kitchen written as others write recordings, and imported again.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::UnitQuaternion;
use paws_twin::import::capture::{
    At, CameraAxes, Capture, ClipAt, HandAt, HandStream, ImageAt, ImageSource, JointFrame, PoseAt, Poses, RawPose,
};
use paws_twin::import::joint_orders::JointOrder;
use paws_twin::import::optics::Optics;
use paws_twin::import::{ImportOptions, assemble, blob::Blob};
use paws_twin::math::{Pose, Vector};
use paws_twin::recording::Recording;
use serde_json::Value;

use crate::common::{SMALL, paws, stderr};

/// Frames that a test writes: enough to join, few enough to be quick.
pub(crate) const FRAMES: usize = 48;

pub(crate) fn small() -> Recording {
    Recording::open(SMALL.path()).unwrap()
}

pub(crate) fn write(path: &Path, bytes: impl AsRef<[u8]>) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(path, bytes).unwrap();
}

pub(crate) fn still(name: &str, frame: usize) -> PathBuf {
    SMALL.path().join(name).join(format!("{frame:06}.{}", if name == "frames" { "jpg" } else { "png" }))
}

pub(crate) fn copy(from: &Path, to: &Path) {
    write(to, std::fs::read(from).unwrap());
}

/// Runs `paws import` and expects it to do its work.
pub(crate) fn import(args: &[&str], dir: &Path) -> String {
    let mut all = vec!["import"];
    all.extend(args);
    all.extend(["--out", "out"]);
    let out = paws(&all, dir);
    assert_eq!(out.status.code(), Some(0), "{args:?}: {}", stderr(&out));
    String::from_utf8(out.stdout).unwrap()
}

pub(crate) fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The poses of an imported recording.
pub(crate) fn poses(out: &Path) -> Vec<Pose> {
    let cameras = json(&out.join("cameras.json"));
    let read = |v: &Value| -> Vec<f64> { serde_json::from_value(v.clone()).unwrap() };
    cameras["frames"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| {
            let (p, q) = (read(&f["position"]), read(&f["rotation_wxyz"]));
            let q = nalgebra::Quaternion::new(q[0], q[1], q[2], q[3]);
            Pose::from_parts(Vector::new(p[0], p[1], p[2]).into(), UnitQuaternion::from_quaternion(q))
        })
        .collect()
}

pub(crate) fn same_bytes(a: &Path, b: &Path) -> bool {
    std::fs::read(a).unwrap() == std::fs::read(b).unwrap()
}

pub(crate) fn depth_mm(path: &Path) -> Vec<u16> {
    match image::open(path).unwrap() {
        image::DynamicImage::ImageLuma16(image) => image.into_raw(),
        other => panic!("{:?}", other.color()),
    }
}

/// Largest distance of two sets of poses, metres and degrees.
pub(crate) fn apart(a: &[Pose], b: &[Pose]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold((0.0, 0.0), |(m, deg), (a, b)| {
        let distance = (a.translation.vector - b.translation.vector).norm();
        (f64::max(m, distance), f64::max(deg, a.rotation.angle_to(&b.rotation).to_degrees()))
    })
}

/// Stray Scanner: Y up, its own intrinsics, depth and confidence.
pub(crate) fn write_stray(root: &Path) -> Vec<Pose> {
    let recording = small();
    let y_up = UnitQuaternion::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2);
    let mut odometry = "timestamp, frame, x, y, z, qx, qy, qz, qw\n".to_owned();
    let mut out = Vec::new();
    for (i, frame) in recording.frames.iter().take(FRAMES).enumerate() {
        let pose = y_up * frame.world_from_camera;
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        let time = 5000.0 + frame.timestamp_secs;
        writeln!(odometry, "{time}, {i:06}, {}, {}, {}, {}, {}, {}, {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w).unwrap();
        copy(&still("depth", i), &root.join(format!("depth/{i:06}.png")));
        out.push(frame.world_from_camera);
    }
    write(&root.join("odometry.csv"), odometry);
    let c = recording.camera;
    write(
        &root.join("camera_matrix.csv"),
        format!("{}, 0.0, {}\n0.0, {}, {}\n0.0, 0.0, 1.0\n", c.fx, c.cx, c.fy, c.cy),
    );
    let sure = |value: u8| image::GrayImage::from_pixel(c.width as u32, c.height as u32, image::Luma([value]));
    std::fs::create_dir_all(root.join("confidence")).unwrap();
    sure(0).save(root.join("confidence/000000.png")).unwrap();
    sure(2).save(root.join("confidence/000001.png")).unwrap();
    out
}

#[test]
fn stray_scanner_comes_back_as_it_was() {
    let dir = tempfile::tempdir().unwrap();
    let truth = write_stray(&dir.path().join("scan"));
    let text = import(&["scan", "--fps", "0"], dir.path());
    let (m, deg) = apart(&truth, &poses(&dir.path().join("out")));
    assert!(m < 1e-9 && deg < 1e-5, "{m} m, {deg} degrees");
    assert_eq!(depth_mm(&dir.path().join("out/depth/000001.png")), depth_mm(&still("depth", 1)));
    // What the LiDAR is not sure of is no value.
    assert!(depth_mm(&dir.path().join("out/depth/000000.png")).iter().all(|z| *z == 0));
    for word in ["stray scan", "time", "missing: hands", "missing: images", "missing: clips"] {
        assert!(text.contains(word), "{word}: {text}");
    }
    let report = json(&dir.path().join("out/import.json"));
    assert_eq!(report["sources"][0]["kind"], "stray");
}

#[test]
fn frames_are_thinned_by_time_and_poses_stay_with_them() {
    let dir = tempfile::tempdir().unwrap();
    let truth = write_stray(&dir.path().join("scan"));
    let recording = small();
    let first = recording.frames[0].timestamp_secs;
    let slots: std::collections::BTreeSet<i64> =
        recording.frames.iter().take(FRAMES).map(|f| (f.timestamp_secs - first).round() as i64).collect();
    import(&["scan", "--fps", "1"], dir.path());
    let found = poses(&dir.path().join("out"));
    assert!(slots.len() < FRAMES);
    assert_eq!(found.len(), slots.len());
    for pose in found {
        assert!(truth.iter().any(|t| apart(&[*t], &[pose]).0 < 1e-9));
    }
}

/// A program that takes ffmpeg's arguments and gives the recording's images; each call is a line of `calls`.
#[cfg(unix)]
fn false_ffmpeg(dir: &Path) -> PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let path = dir.join("ffmpeg");
    let script = format!(
        "#!/bin/sh\necho \"$@\" >> \"{0}/calls\"\nfor last; do :; done\nfolder=$(dirname \"$last\")\ni=1\n\
         for f in \"{1}\"/*.jpg; do\n  cp \"$f\" \"$folder/$(printf %06d $i).jpg\"\n  i=$((i + 1))\ndone\n",
        dir.display(),
        SMALL.path().join("frames").display()
    );
    write(&path, script);
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

#[cfg(unix)]
#[test]
fn a_video_is_decoded_once_without_its_rotation() {
    let dir = tempfile::tempdir().unwrap();
    write_stray(&dir.path().join("scan"));
    write(&dir.path().join("scan/rgb.mp4"), "not read by the test's program");
    let ffmpeg = false_ffmpeg(dir.path());
    import(&["scan", "--fps", "0", "--ffmpeg", ffmpeg.to_str().unwrap()], dir.path());
    for i in [0, 7, FRAMES - 1] {
        assert!(same_bytes(&still("frames", i), &dir.path().join(format!("out/frames/{i:06}.jpg"))), "frame {i}");
    }
    let calls = std::fs::read_to_string(dir.path().join("calls")).unwrap();
    assert_eq!(calls.lines().count(), 1, "{calls}");
    assert!(calls.contains("-noautorotate") && calls.contains(&format!("between(n\\,0\\,{})", FRAMES - 1)), "{calls}");
    assert!(!dir.path().join("out/.video").exists());
}

#[test]
fn without_ffmpeg_the_rest_of_a_recording_is_imported_and_the_way_out_told() {
    let dir = tempfile::tempdir().unwrap();
    write_stray(&dir.path().join("scan"));
    write(&dir.path().join("scan/rgb.mp4"), "nobody reads it");
    let text = import(&["scan", "--fps", "0", "--ffmpeg", "/nowhere/ffmpeg"], dir.path());
    assert!(text.contains("install ffmpeg") && text.contains("missing: images"), "{text}");
    assert_eq!(poses(&dir.path().join("out")).len(), FRAMES);
    assert!(json(&dir.path().join("out/cameras.json"))["frames"][0].get("file").is_none());
}

/// TUM RGB-D: lists of files, 5000 counts a metre. With or without the trajectory.
fn write_tum(root: &Path, with_poses: bool) -> Vec<Pose> {
    let recording = small();
    let mut lists = ["# timestamp filename\n".to_owned(), "# timestamp filename\n".to_owned()];
    let mut trajectory = "# timestamp tx ty tz qx qy qz qw\n".to_owned();
    let mut out = Vec::new();
    for (i, frame) in recording.frames.iter().take(FRAMES).enumerate() {
        let time = 1_305_031_102.0 + frame.timestamp_secs;
        writeln!(lists[0], "{time:.6} rgb/{i:06}.jpg").unwrap();
        // The depth camera is a few milliseconds late.
        writeln!(lists[1], "{:.6} depth/{i:06}.png", time + 0.004).unwrap();
        let pose = frame.world_from_camera;
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        writeln!(trajectory, "{time:.6} {} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w).unwrap();
        copy(&still("frames", i), &root.join(format!("rgb/{i:06}.jpg")));
        let counts: Vec<u16> = depth_mm(&still("depth", i)).iter().map(|mm| mm.saturating_mul(5)).collect();
        let c = recording.camera;
        let image: image::ImageBuffer<image::Luma<u16>, Vec<u16>> =
            image::ImageBuffer::from_raw(c.width as u32, c.height as u32, counts).unwrap();
        std::fs::create_dir_all(root.join("depth")).unwrap();
        image.save(root.join(format!("depth/{i:06}.png"))).unwrap();
        out.push(pose);
    }
    write(&root.join("rgb.txt"), &lists[0]);
    write(&root.join("depth.txt"), &lists[1]);
    if with_poses {
        write(&root.join("groundtruth.txt"), trajectory);
    }
    let c = recording.camera;
    write(&root.join("calibration.txt"), format!("{} {} {} {}\n", c.fx, c.fy, c.cx, c.cy));
    out
}

#[test]
fn tum_sequences_come_back_as_they_were() {
    let dir = tempfile::tempdir().unwrap();
    let truth = write_tum(&dir.path().join("seq"), true);
    import(&["seq", "--fps", "0", "--up", "z"], dir.path());
    let (m, deg) = apart(&truth, &poses(&dir.path().join("out")));
    assert!(m < 1e-6 && deg < 1e-4, "{m} m, {deg} degrees");
    assert!(same_bytes(&still("frames", 3), &dir.path().join("out/frames/000003.jpg")));
    let (back, there) = (depth_mm(&dir.path().join("out/depth/000003.png")), depth_mm(&still("depth", 3)));
    // Beyond 13 m sixteen bits of 5000 a metre end.
    assert!(back.iter().zip(&there).all(|(a, b)| a == b || *b > 13_000));
}

/// COLMAP of the same kitchen in a world of its own: turned, moved, of another scale.
pub(crate) fn write_colmap(root: &Path, is_binary: bool, metres_per_unit: f64) -> Vec<Pose> {
    let recording = small();
    let turn = Pose::from_parts(Vector::new(0.3, -1.0, 2.0).into(), UnitQuaternion::from_euler_angles(0.5, -0.4, 1.0));
    let c = recording.camera;
    let mut images = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n".to_owned();
    let mut binary_images = (FRAMES as u64).to_le_bytes().to_vec();
    let (mut points, mut binary_points) = (String::new(), Vec::new());
    let mut count = 0u64;
    let mut out = Vec::new();
    for (i, frame) in recording.frames.iter().take(FRAMES).enumerate() {
        let moved = turn * frame.world_from_camera;
        let scaled = Pose::from_parts((moved.translation.vector / metres_per_unit).into(), moved.rotation);
        let inverse = scaled.inverse();
        let (t, q) = (inverse.translation.vector, inverse.rotation.coords);
        let name = format!("{i:06}.jpg");
        // The second line, of observations, is empty.
        writeln!(images, "{} {} {} {} {} {} {} {} 1 {name}\n", i + 1, q.w, q.x, q.y, q.z, t.x, t.y, t.z).unwrap();
        binary_images.extend((i as u32 + 1).to_le_bytes());
        for v in [q.w, q.x, q.y, q.z, t.x, t.y, t.z] {
            binary_images.extend(v.to_le_bytes());
        }
        binary_images.extend(1u32.to_le_bytes());
        binary_images.extend(name.as_bytes());
        binary_images.push(0);
        binary_images.extend(2u64.to_le_bytes());
        binary_images.extend([0u8; 48]);
        copy(&still("frames", i), &root.join("images").join(&name));
        let depth = recording.depth(i).unwrap().unwrap();
        for (k, z) in depth.data.iter().enumerate().step_by(151).filter(|(_, z)| **z > 0.0) {
            let p = c.unproject((k % c.width) as f64, (k / c.width) as f64, f64::from(*z));
            let p = moved * p / metres_per_unit;
            count += 1;
            writeln!(points, "{count} {} {} {} 1 2 3 0.5 1 0", p.x, p.y, p.z).unwrap();
            binary_points.extend(count.to_le_bytes());
            for v in [p.x, p.y, p.z] {
                binary_points.extend(v.to_le_bytes());
            }
            binary_points.extend([1u8, 2, 3]);
            binary_points.extend(0.5f64.to_le_bytes());
            binary_points.extend(1u64.to_le_bytes());
            binary_points.extend([0u8; 8]);
        }
        out.push(frame.world_from_camera);
    }
    let sparse = root.join("sparse/0");
    if is_binary {
        let mut cameras = 1u64.to_le_bytes().to_vec();
        cameras.extend(1u32.to_le_bytes());
        cameras.extend(1u32.to_le_bytes());
        cameras.extend((c.width as u64).to_le_bytes());
        cameras.extend((c.height as u64).to_le_bytes());
        for v in [c.fx, c.fy, c.cx + 0.5, c.cy + 0.5] {
            cameras.extend(v.to_le_bytes());
        }
        write(&sparse.join("cameras.bin"), cameras);
        write(&sparse.join("images.bin"), binary_images);
        write(&sparse.join("points3D.bin"), [count.to_le_bytes().to_vec(), binary_points].concat());
    } else {
        let line = format!("1 PINHOLE {} {} {} {} {} {}\n", c.width, c.height, c.fx, c.fy, c.cx + 0.5, c.cy + 0.5);
        write(&sparse.join("cameras.txt"), line);
        write(&sparse.join("images.txt"), images);
        write(&sparse.join("points3D.txt"), points);
    }
    out
}

#[test]
fn colmap_gets_its_scale_and_gravity_from_metric_depth() {
    for is_binary in [false, true] {
        let dir = tempfile::tempdir().unwrap();
        let truth = write_colmap(&dir.path().join("work"), is_binary, 2.5);
        write_tum(&dir.path().join("depth"), false);
        import(&["work", "depth", "--fps", "0"], dir.path());
        let out = dir.path().join("out");
        let found = poses(&out);
        assert_eq!(found.len(), FRAMES);
        let report = json(&out.join("import.json"));
        let scale = report["scale"]["metres_per_unit"].as_f64().unwrap();
        assert!((scale / 2.5 - 1.0).abs() < 0.01, "{scale}");
        let span = |p: &[Pose]| (p[FRAMES - 1].translation.vector - p[0].translation.vector).norm();
        assert!((span(&found) - span(&truth)).abs() < 0.02 * span(&truth) + 1e-3);
        // Where the world's up is seen by each camera.
        let up = |p: &Pose| p.rotation.inverse() * Vector::z();
        for (a, b) in found.iter().zip(&truth) {
            assert!(up(a).angle(&up(b)).to_degrees() < 3.0, "{}", up(a).angle(&up(b)).to_degrees());
        }
        assert!(same_bytes(&still("frames", 5), &out.join("frames/000005.jpg")));
        let depth = depth_mm(&out.join("depth/000005.png"));
        assert!(depth.iter().filter(|z| **z > 0).count() > depth.len() / 2);
        assert!(out.join("reconstruction.ply").is_file());
    }
}

#[test]
fn a_scale_that_nothing_tells_is_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    write_colmap(&dir.path().join("work"), true, 2.5);
    let out = paws(&["import", "work", "--out", "out"], dir.path());
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("--scale"), "{}", stderr(&out));
    assert!(!dir.path().join("out").exists());
    // Up is not z of that world, which would be told.
    import(&["work", "--scale", "2.5"], dir.path());
}

/// Time of a frame of the capture below, seconds: the recording's own repeat where a person waits.
fn secs(frame: usize) -> f64 {
    100.0 + 0.1 * frame as f64
}

/// The small recording as a capture: poses of an OpenGL camera, hands in it at times between the frames'.
fn capture(recording: &Recording, order: JointOrder) -> Capture {
    let flip = nalgebra::Matrix3::from_diagonal(&Vector::new(1.0, -1.0, -1.0));
    let items = |(i, f): (usize, &paws_twin::recording::Frame)| {
        let m = f.world_from_camera.rotation.to_rotation_matrix().into_inner() * flip;
        let t = f.world_from_camera.translation.vector;
        let row = |i: usize| [m[(i, 0)], m[(i, 1)], m[(i, 2)], t[i]];
        PoseAt {
            at: At::time(secs(i)),
            pose: RawPose::from_rows(&[row(0), row(1), row(2)].concat()).unwrap(),
            optics: None,
        }
    };
    let joint_count = if order == JointOrder::Mano { 21 } else { 26 };
    let hands = recording.hands.iter().map(|h| {
        let frame = &recording.frames[h.frame];
        let camera_from_world = frame.world_from_camera.inverse();
        let tips = h.tips.map(|p| <[f64; 3]>::from(flip * (camera_from_world * p).coords));
        let mut joints = vec![Some(tips[0]); joint_count];
        let places = if order == JointOrder::Mano { [4, 8, 12] } else { [5, 10, 15] };
        for (place, tip) in places.into_iter().zip(tips) {
            joints[place] = Some(tip);
        }
        HandAt { at: At::time(secs(h.frame)), side: h.side, joints, contact: h.contact, score: Some(0.9) }
    });
    let c = recording.camera;
    Capture {
        kind: "test".to_owned(),
        source: PathBuf::from("recording"),
        world: paws_twin::import::capture::SourceWorld { up: Some(Vector::z()), ..Default::default() },
        optics: Some(Optics::pinhole(c.width, c.height, [c.fx, c.fy, c.cx, c.cy])),
        poses: Some(Poses {
            axes: CameraAxes::Opengl,
            items: recording.frames.iter().enumerate().map(items).collect(),
            ..Poses::default()
        }),
        images: (0..recording.frames.len())
            .map(|i| ImageAt {
                at: At::time(secs(i)),
                picture: ImageSource::Still(Blob::File(still("frames", i))),
                optics: None,
            })
            .collect(),
        hands: Some(HandStream {
            frame: JointFrame::Camera(CameraAxes::Opengl),
            order,
            unit_m: 1.0,
            items: hands.collect(),
        }),
        clips: recording
            .clips
            .iter()
            .map(|c| ClipAt {
                name: c.clip.clone(),
                start: At::time(secs(c.start_frame)),
                end: At::time(secs(c.end_frame)),
                narration: c.narration.clone(),
                verb: c.verb.clone(),
                noun: c.noun.clone(),
            })
            .collect(),
        ..Capture::default()
    }
}

/// Hands, contact and narrations of an imported recording are those of the first one, in every order of joints.
#[test]
fn hands_of_a_camera_come_back_in_the_world() {
    let recording = small();
    for order in [JointOrder::Mano, JointOrder::Openxr] {
        let options = ImportOptions { fps: 0.0, ..ImportOptions::default() };
        let imported = assemble(vec![capture(&recording, order)], &options).unwrap();
        let dir = tempfile::tempdir().unwrap();
        let mut names = std::collections::BTreeSet::new();
        for frame in 0..imported.frames.len() {
            let written = imported.images(frame);
            assert!(written.faults.is_empty(), "{:?}", written.faults);
            for (name, bytes) in written.files {
                write(&dir.path().join(&name), bytes);
                names.insert(name);
            }
        }
        for (name, text) in imported.tables(&names).unwrap() {
            write(&dir.path().join(name), text);
        }
        let back = Recording::open(dir.path()).unwrap();
        assert_eq!(back.hands.len(), recording.hands.len());
        for (a, b) in back.hands.iter().zip(&recording.hands) {
            assert_eq!((a.frame, a.side, a.contact), (b.frame, b.side, b.contact));
            for (p, q) in a.tips.iter().zip(&b.tips) {
                assert!((p - q).norm() < 1e-6, "{order:?}: {p} {q}");
            }
        }
        assert_eq!(back.clips, recording.clips);
    }
}

#[test]
fn hands_of_which_nobody_says_whether_they_hold_are_told_as_such() {
    let recording = small();
    let mut capture = capture(&recording, JointOrder::Mano);
    for hand in capture.hands.iter_mut().flat_map(|h| &mut h.items) {
        hand.contact = None;
    }
    let imported = assemble(vec![capture], &ImportOptions { fps: 0.0, ..ImportOptions::default() }).unwrap();
    assert!(imported.report.missing.iter().any(|m| m.what == "contact"), "{:?}", imported.report.missing);
    let tables = imported.tables(&std::collections::BTreeSet::new()).unwrap();
    let (_, hands) = tables.iter().find(|(name, _)| name == "hands.json").unwrap();
    assert!(!hands.contains("\"contact\""));
}

/// The recording and its hands as two sources; what is added to the hands' times, seconds.
fn apart_by(later_secs: f64) -> Vec<Capture> {
    let mut first = capture(&small(), JointOrder::Mano);
    let mut hands = first.hands.take();
    for hand in hands.iter_mut().flat_map(|h| &mut h.items) {
        hand.at = hand.at.later(later_secs);
    }
    let second = Capture { kind: "hands".to_owned(), source: PathBuf::from("hands"), hands, ..Capture::default() };
    vec![first, second]
}

#[test]
fn hands_whose_times_count_from_the_video_are_those_of_frames_on_another_clock() {
    let options = ImportOptions { fps: 0.0, ..ImportOptions::default() };
    let imported = assemble(apart_by(-secs(0)), &options).unwrap();
    let row = imported.report.streams.iter().find(|s| s.stream == "hands").unwrap();
    assert_eq!((row.count, row.of), (small().hands.len(), small().hands.len()), "{row:?}");
    let told = &imported.report.changes;
    assert!(told.iter().any(|c| c == "hands' times are taken to count from the first frame"), "{told:?}");
}

#[test]
fn hands_that_meet_no_frame_are_told_as_such_and_not_as_absent() {
    let imported = assemble(apart_by(9000.0), &ImportOptions::default()).unwrap();
    let missing = imported.report.missing.iter().find(|m| m.what == "hands").unwrap();
    assert!(missing.why.contains("meets a frame") && missing.command.contains("--hand-lag"), "{missing:?}");
}

/// Breaks a source and expects `paws import` to name all of `words`, and to leave nothing behind.
pub(crate) fn refused(name: &str, words: &[&str], break_it: impl Fn(&Path)) {
    let dir = tempfile::tempdir().unwrap();
    break_it(dir.path());
    let out = paws(&["import", "source", "--out", "out"], dir.path());
    let message = stderr(&out);
    assert_eq!(out.status.code(), Some(2), "{name}: {message}");
    assert!(!dir.path().join("out").exists(), "{name}: {message}");
    names_all(name, words, &message);
}

/// Breaks a part of a source and expects `paws import` to name all of `words`, to leave that out and to use the rest.
pub(crate) fn costs_itself(name: &str, words: &[&str], break_it: impl Fn(&Path)) {
    let dir = tempfile::tempdir().unwrap();
    break_it(dir.path());
    let out = paws(&["import", "source", "--out", "out"], dir.path());
    let message = format!("{}{}", stderr(&out), String::from_utf8_lossy(&out.stdout));
    assert!(out.status.code().is_some_and(|code| code < 2), "{name}: {message}");
    assert!(dir.path().join("out/cameras.json").is_file() && message.contains("left out: "), "{name}: {message}");
    names_all(name, words, &message);
}

fn names_all(name: &str, words: &[&str], message: &str) {
    for word in words {
        assert!(message.contains(word), "{name}: \"{word}\" is not in: {message}");
    }
    assert!(!message.contains("panicked"), "{name}: {message}");
}

/// Replaces a text in a file.
pub(crate) fn edit(path: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{from}");
    std::fs::write(path, text.replacen(from, to, 1)).unwrap();
}

#[test]
fn broken_sources_are_named() {
    let stray = |change: fn(&Path)| {
        move |dir: &Path| {
            write_stray(&dir.join("source"));
            change(&dir.join("source"));
        }
    };
    refused("nothing", &["source: no such file"], |_| {});
    refused("an empty folder", &["none of the formats", "--list"], |d| std::fs::create_dir(d.join("source")).unwrap());
    refused(
        "a column",
        &["odometry.csv: line 1", "no column \"qw\""],
        stray(|s| edit(&s.join("odometry.csv"), "qw", "q")),
    );
    costs_itself(
        "a word",
        &["odometry.csv: line 2: column timestamp", "not a number"],
        stray(|s| {
            edit(&s.join("odometry.csv"), "\n5", "\nfive");
        }),
    );
    refused(
        "cut short",
        &["odometry.csv", "cells, the header has 9"],
        stray(|s| {
            let text = std::fs::read_to_string(s.join("odometry.csv")).unwrap();
            let cut = text.rfind(',').unwrap();
            std::fs::write(s.join("odometry.csv"), &text[..cut]).unwrap();
        }),
    );
    refused(
        "no rows",
        &["odometry.csv: rows"],
        stray(|s| write(&s.join("odometry.csv"), "timestamp,frame,x,y,z,qx,qy,qz,qw\n")),
    );
    refused(
        "the matrix",
        &["camera_matrix.csv: line 1", "2 cells"],
        stray(|s| write(&s.join("camera_matrix.csv"), "1,2\n")),
    );
    refused("a traversal", &["outside"], |d| {
        write_tum(&d.join("source"), true);
        edit(&d.join("source/rgb.txt"), "rgb/000000.jpg", "../../etc/passwd");
    });
    refused("NaN", &["groundtruth.txt: line 2", "not finite"], |d| {
        write_tum(&d.join("source"), true);
        write(&d.join("source/groundtruth.txt"), "# t\n1 nan 0 0 0 0 0 1\n");
    });
    refused("no poses", &["no source has camera poses", "colmap"], |d| {
        write_tum(&d.join("source"), false);
    });
    refused("another clock", &["no frame has a pose", "--max-gap"], |d| {
        write_tum(&d.join("source"), true);
        write(&d.join("source/groundtruth.txt"), "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n");
    });
    refused("the lens", &["cameras.txt: line 1", "FOV", "image_undistorter"], |d| {
        write_colmap(&d.join("source"), false, 1.0);
        write(&d.join("source/sparse/0/cameras.txt"), "1 FOV 160 120 100 100 80 60 0.9\n");
    });
    refused("half a file", &["images.bin: image 48", "copied as a whole"], |d| {
        write_colmap(&d.join("source"), true, 1.0);
        let file = d.join("source/sparse/0/images.bin");
        let bytes = std::fs::read(&file).unwrap();
        std::fs::write(&file, &bytes[..bytes.len() - 30]).unwrap();
    });
    refused("a count", &["images.bin", "copied as a whole"], |d| {
        write_colmap(&d.join("source"), true, 1.0);
        let mut bytes = std::fs::read(d.join("source/sparse/0/images.bin")).unwrap();
        bytes[..8].copy_from_slice(&u64::MAX.to_le_bytes());
        std::fs::write(d.join("source/sparse/0/images.bin"), bytes).unwrap();
    });
}

#[test]
fn one_bad_image_costs_only_itself() {
    let dir = tempfile::tempdir().unwrap();
    write_tum(&dir.path().join("seq"), true);
    write(&dir.path().join("seq/depth/000002.png"), "no image");
    let text = import(&["seq", "--fps", "0", "--up", "z"], dir.path());
    assert!(text.contains("depth/000002.png") && text.contains("cannot be read"), "{text}");
    let out = dir.path().join("out");
    assert!(!out.join("depth/000002.png").exists() && out.join("depth/000003.png").is_file());
    assert!(out.join("frames/000002.jpg").is_file());
}

#[test]
fn the_formats_are_listed() {
    let dir = tempfile::tempdir().unwrap();
    let out = paws(&["import", "--list"], dir.path());
    let text = String::from_utf8(out.stdout).unwrap();
    for name in ["stray", "stera", "mcap", "record3d", "polycam", "egodex", "ego-vision", "colmap", "tum", "frames"] {
        assert!(text.contains(name), "{text}");
    }
    assert_eq!(out.status.code(), Some(0));
}

/// A right source under a wrong option: the options that undo it are named, and `--fix` sets them.
#[test]
fn wrong_conventions_of_three_formats_are_named_and_corrected() {
    let dir = tempfile::tempdir().unwrap();
    let stray = write_stray(&dir.path().join("stray"));
    let tum = write_tum(&dir.path().join("tum"), true);
    write_colmap(&dir.path().join("colmap"), true, 2.5);
    write_tum(&dir.path().join("depth"), false);
    // Sources, whether what `--fix` makes of them is held against the truth, the wrong options, the option that is named.
    type Case = (&'static [&'static str], bool, &'static [&'static str], &'static str);
    let cases: [Case; 11] = [
        (&["stray"], true, &["--poses", "camera-from-world"], "--poses world-from-camera"),
        (&["stray"], true, &["--camera-axes", "opengl"], "--camera-axes opencv"),
        (&["stray"], true, &["--quaternion", "wxyz"], "--quaternion xyzw"),
        (&["stray"], false, &["--unit", "0.001"], "--unit "),
        (&["stray"], true, &["--up", "z"], "--up y"),
        (&["tum"], true, &["--poses", "camera-from-world", "--up", "z"], "--poses world-from-camera"),
        (&["tum"], true, &["--camera-axes", "opengl", "--up", "z"], "--camera-axes opencv"),
        (&["tum"], false, &["--up", "y"], "--up z"),
        (&["tum"], false, &["--unit", "0.4", "--up", "z"], "--unit "),
        (&["colmap", "depth"], false, &["--poses", "world-from-camera", "--scale", "2.5"], "--poses camera-from-world"),
        (&["colmap", "depth"], false, &["--scale", "1"], "--scale "),
    ];
    assert!(apart(&stray, &tum).0 < 1e-9);
    for (sources, is_held, wrong, option) in cases {
        let mut args = vec!["import"];
        args.extend(sources);
        args.extend(wrong);
        args.extend(["--fps", "0", "--out", "out"]);
        let out = paws(&args, dir.path());
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        assert_eq!(out.status.code(), Some(1), "{args:?}: {text}{}", stderr(&out));
        assert!(text.contains("doubtful") && text.contains(option), "{args:?}: {text}");
        if !is_held {
            continue;
        }
        args.push("--fix");
        let out = paws(&args, dir.path());
        let text = String::from_utf8_lossy(&out.stdout).into_owned();
        assert!(text.contains("corrected by") && out.status.code() == Some(0), "{args:?}: {text}{}", stderr(&out));
        let (m, deg) = apart(&stray, &poses(&dir.path().join("out")));
        assert!(m < 1e-6 && deg < 1e-4, "{args:?}: {m} m, {deg} degrees");
    }
}
