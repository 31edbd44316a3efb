//! The synthetic kitchen as headsets write it, and imported again.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Matrix3, Matrix4, Rotation3, UnitQuaternion};
use paws_twin::math::{Point, Pose, Vector};
use paws_twin::recording::Grid;
use serde_json::{Value, json};

use crate::import::{copy, costs_itself, depth_mm, edit, import, json, refused, small, still, write};
use crate::import_glasses::{FRAMES, cut, hands, hands_are_back, pixels_are_back, poses_are_back};

/// The recording's world with +Y up.
fn y_up() -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector::x_axis(), -std::f64::consts::FRAC_PI_2)
}

/// Numbers of a matrix, row by row, each behind a comma.
fn row_by_row(m: &Matrix4<f64>) -> String {
    m.transpose().iter().fold(String::new(), |text, v| text + &format!(",{v}"))
}

/// Ticks of 100 ns since 1601.
fn ticks(secs: f64) -> u64 {
    132_870_000_000_000_000 + (secs * 1e7).round() as u64
}

/// Joints of MANO at OpenXR's numbers; palm and metacarpals are the wrist.
fn openxr(joints: &[Vector]) -> Vec<Vector> {
    let mut out = vec![joints[0]; 26];
    for (mano, place) in
        [1, 2, 3, 4, 5, 7, 8, 9, 10, 12, 13, 14, 15, 17, 18, 19, 20, 22, 23, 24, 25].into_iter().enumerate()
    {
        out[place] = joints[mano];
    }
    out
}

fn write_hololens(root: &Path) {
    let recording = small();
    let (c, hands) = (recording.camera, hands());
    let gl = Matrix4::from_diagonal(&nalgebra::Vector4::new(1.0, -1.0, -1.0, 1.0));
    let camera_from_rig =
        Pose::from_parts(Vector::new(0.1, 0.02, -0.03).into(), UnitQuaternion::from_euler_angles(0.4, 0.1, -0.2));
    let mut pv = format!("{},{},{},{}\n", c.cx + 0.5, c.cy + 0.5, c.width, c.height);
    let (mut rigs, mut eyes) = (String::new(), String::new());
    let ray = |k: usize| c.unproject((k % c.width) as f64, (k / c.width) as f64, 1.0).coords;
    for (i, frame) in recording.frames[FRAMES].iter().enumerate() {
        let pose = y_up() * frame.world_from_camera;
        let t = ticks(frame.timestamp_secs);
        writeln!(pv, "{t},{},{}{}", c.fx, c.fy, row_by_row(&(pose.to_homogeneous() * gl))).unwrap();
        let source = FRAMES.start + i;
        if i % 2 == 0 {
            copy(&still("frames", source), &root.join(format!("PV/{t}.jpg")));
        } else {
            let image = image::open(still("frames", source)).unwrap().into_rgb8();
            let bytes: Vec<u8> = image.pixels().flat_map(|p| [p.0[2], p.0[1], p.0[0], 255]).collect();
            write(&root.join(format!("PV/{t}.bytes")), bytes);
        }
        writeln!(rigs, "{t}{}", row_by_row(&(pose * camera_from_rig).to_homogeneous())).unwrap();
        let mut pgm = format!("P5\n{} {}\n65535\n", c.width, c.height).into_bytes();
        for (k, mm) in depth_mm(&still("depth", source)).into_iter().enumerate() {
            pgm.extend(((f64::from(mm) * ray(k).norm()).round() as u16).to_be_bytes());
        }
        write(&root.join(format!("Depth Long Throw/{t}.pgm")), pgm);
        write!(eyes, "{t}{}", row_by_row(&Matrix4::identity())).unwrap();
        for side in ["left", "right"] {
            let joints = hands.get(&(i, side.to_owned()));
            write!(eyes, ",{}", usize::from(joints.is_some())).unwrap();
            for p in joints.map_or_else(|| vec![Vector::zeros(); 26], |j| openxr(j)) {
                eyes += &row_by_row(&Matrix4::new_translation(&(y_up() * p)));
            }
        }
        eyes += ",0,0,0,0,0,0,0,0,0,0\n";
    }
    write(&root.join("20240101_pv.txt"), pv);
    write(&root.join("20240101_head_hand_eye.csv"), eyes);
    write(&root.join("Depth Long Throw_rig2world.txt"), rigs);
    write(&root.join("Depth Long Throw_extrinsics.txt"), &row_by_row(&camera_from_rig.to_homogeneous())[1..]);
    let table: Vec<u8> = (0..c.width * c.height)
        .flat_map(|k| ray(k).normalize().iter().flat_map(|x| (*x as f32).to_le_bytes()).collect::<Vec<u8>>())
        .collect();
    write(&root.join("Depth Long Throw_lut.bin"), table);
}

#[test]
fn hololens_recordings_come_back_whole() {
    let dir = tempfile::tempdir().unwrap();
    write_hololens(&dir.path().join("holo"));
    import(&["holo", "--fps", "0"], dir.path());
    let (out, recording) = (dir.path().join("out"), small());
    poses_are_back(&out, &recording, 1e-6);
    hands_are_back(&out, 1e-6);
    for index in [4, 5] {
        let (colors, depths) = pixels_are_back(&out, &recording, index);
        assert!(colors > 0.97 && depths > 0.8, "{index}: {colors} {depths}");
    }
}

/// A pose in Unity: the world's z mirrored, the camera's y up. Position, and quaternion x y z w.
fn unity(pose: &Pose) -> [f64; 7] {
    let pose = y_up() * pose;
    let world = Matrix3::from_diagonal(&Vector::new(1.0, 1.0, -1.0));
    let camera = Matrix3::from_diagonal(&Vector::new(1.0, -1.0, 1.0));
    let turn = world * pose.rotation.to_rotation_matrix().into_inner() * camera;
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn)).coords;
    let t = world * pose.translation.vector;
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
}

fn joined(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
}

/// Milliseconds since 1970 and seconds of the running clock.
fn quest_times(secs: f64) -> (u64, f64) {
    let ms = 1_700_000_000_000 + (1000.0 * secs).round() as u64;
    (ms, 300.0 + (ms - 1_700_000_000_000) as f64 / 1000.0)
}

fn write_quest(root: &Path, is_mruk: bool) {
    let recording = small();
    let c = recording.camera;
    let mut head = "unix_time,ovr_timestamp,pos_x,pos_y,pos_z,rot_x,rot_y,rot_z,rot_w\n".to_owned();
    let mut frames = "frame_index,file_name,unix_time_ms,timestamp_us_realtime,width,height,pose_pos_x,pose_pos_y,\
                      pose_pos_z,pose_rot_x,pose_rot_y,pose_rot_z,pose_rot_w,pose_ok\n"
        .to_owned();
    let mut depths = "timestamp_ms,ovr_timestamp,create_pose_location_x,create_pose_location_y,create_pose_location_z,\
                      create_pose_rotation_x,create_pose_rotation_y,create_pose_rotation_z,create_pose_rotation_w,\
                      fov_left_angle_tangent,fov_right_angle_tangent,fov_top_angle_tangent,fov_down_angle_tangent,near_z,\
                      far_z,width,height\n"
        .to_owned();
    let (w, h) = (c.width as f64, c.height as f64);
    let fov = [(c.cx + 0.5) / c.fx, (w - c.cx - 0.5) / c.fx, (c.cy + 0.5) / c.fy, (h - c.cy - 0.5) / c.fy];
    for (i, frame) in recording.frames[FRAMES].iter().enumerate() {
        let (ms, running) = quest_times(frame.timestamp_secs);
        let pose = joined(&unity(&frame.world_from_camera));
        writeln!(head, "{ms},{running},{pose}").unwrap();
        writeln!(frames, "{i},{ms}000.rgba,{ms},{ms}000,{},{},{pose},true", c.width, c.height).unwrap();
        writeln!(depths, "{ms},{running},{pose},{},0.1,Infinity,{},{}", joined(&fov), c.width, c.height).unwrap();
        let source = FRAMES.start + i;
        let image = image::open(still("frames", source)).unwrap().into_rgb8();
        if is_mruk {
            let rows: Vec<Vec<u8>> =
                image.rows().map(|row| row.flat_map(|p| [p.0[0], p.0[1], p.0[2], 255]).collect()).collect();
            let bytes: Vec<u8> = rows.into_iter().rev().flatten().collect();
            write(&root.join(format!("left_camera_mruk_rgba/{ms}000.rgba")), bytes);
        } else {
            std::fs::create_dir_all(root.join("left_camera_rgb")).unwrap();
            image.save(root.join(format!("left_camera_rgb/{ms}.png"))).unwrap();
        }
        let depth: Grid<f32> = recording.depth(source).unwrap().unwrap();
        let buffer: Vec<u8> =
            depth.data.iter().flat_map(|z| (if *z > 0.0 { 1.0 - 0.1 / z } else { 0.0 }).to_le_bytes()).collect();
        write(&root.join(format!("left_depth/{ms}.raw")), buffer);
    }
    write(&root.join("hmd_poses.csv"), head);
    write(&root.join("left_depth_descriptors.csv"), depths);
    let pair = |x: f64, y: f64| json!({"x": x, "y": y});
    if is_mruk {
        write(&root.join("left_camera_mruk_frame_metadata.csv"), frames);
        let intrinsics = json!({"backend": "MRUK", "imageFormat": "RGBA32", "focalLength": pair(c.fx, c.fy),
            "principalPoint": pair(c.cx + 0.5, c.cy + 0.5), "resolution": {"width": c.width, "height": c.height}});
        write(&root.join("left_camera_mruk_intrinsics.json"), intrinsics.to_string());
    } else {
        // A camera in the middle of the headset that looks ahead.
        let characteristics = json!({"pose": {"translation": [0.0, 0.0, 0.0], "rotation": [1.0, 0.0, 0.0, 0.0]},
            "intrinsics": {"fx": c.fx, "fy": c.fy, "cx": c.cx + 0.5, "cy": c.cy + 0.5, "skew": 0.0},
            "sensor": {"activeArraySize": {"left": 0, "top": 0, "right": c.width, "bottom": c.height}}});
        write(&root.join("left_camera_characteristics.json"), characteristics.to_string());
    }
}

/// What a program writes down of Hand Tracking Streamer.
fn streamed_hands() -> String {
    let recording = small();
    let mirror = Matrix3::from_diagonal(&Vector::new(1.0, 1.0, -1.0));
    let wrist_turn = UnitQuaternion::from_euler_angles(0.3, -0.9, 0.5);
    let mut text = String::new();
    for ((frame, side), joints) in hands() {
        let (_, running) = quest_times(recording.frames[FRAMES.start + frame].timestamp_secs);
        let side = if side == "left" { "Left" } else { "Right" };
        let ns = (running * 1e9).round() as u64;
        let joints: Vec<Vector> = joints.iter().map(|p| mirror * (y_up() * p)).collect();
        let (q, wrist) = (wrist_turn.coords, joints[0]);
        let pose = joined(&[wrist.x, wrist.y, wrist.z, q.x, q.y, q.z, q.w]);
        let local: Vec<f64> = joints.iter().flat_map(|p| (wrist_turn.inverse() * (p - wrist)).data.0[0]).collect();
        writeln!(
            text,
            "{side} wrist | f = 1 | t = {ns}:, {pose}\n{side} landmarks | f = 1 | t = {ns}:, {}",
            joined(&local)
        )
        .unwrap();
    }
    text
}

#[test]
fn quest_recordings_come_back_from_either_backend_with_streamed_hands() {
    let recording = small();
    for is_mruk in [true, false] {
        let dir = tempfile::tempdir().unwrap();
        write_quest(&dir.path().join("quest"), is_mruk);
        write(&dir.path().join("hands.txt"), streamed_hands());
        import(&["quest", "hands.txt", "--fps", "0"], dir.path());
        let out = dir.path().join("out");
        poses_are_back(&out, &recording, 1e-5);
        hands_are_back(&out, 1e-5);
        let (colors, depths) = pixels_are_back(&out, &recording, 5);
        assert!(colors > 0.97 && depths > 0.99, "{is_mruk}: {colors} {depths}");
    }
}

fn write_visionpro(root: &Path) {
    let recording = small();
    let (c, hands) = (recording.camera, hands());
    let flip =
        Pose::from_parts(Vector::zeros().into(), UnitQuaternion::from_scaled_axis(Vector::x() * std::f64::consts::PI));
    // The camera, OpenCV axes, above the head, ARKit axes.
    let head_from_camera = Pose::translation(0.0, 0.04, -0.06)
        * Pose::from_parts(Vector::zeros().into(), UnitQuaternion::from_euler_angles(0.1, 0.05, 0.0))
        * flip;
    let column = |m: &Matrix4<f64>| m.iter().copied().collect::<Vec<f64>>();
    let wrist_turn = UnitQuaternion::from_euler_angles(0.3, -0.9, 0.5);
    let mut text = String::new();
    for (i, frame) in recording.frames[FRAMES].iter().enumerate() {
        let head = y_up() * frame.world_from_camera * head_from_camera.inverse();
        let mut line = json!({"timestamp": frame.timestamp_secs, "systemTime": 1.7e9 + frame.timestamp_secs,
            "headMatrix": column(&head.to_homogeneous()), "videoFrameIndex": i, "videoWidth": c.width,
            "videoHeight": c.height});
        for (side, key) in [("left", "leftHand"), ("right", "rightHand")] {
            line[key] = match hands.get(&(i, side.to_owned())) {
                Some(joints) => visionpro_hand(joints, &wrist_turn),
                // Never tracked, or no longer.
                None => json!({"wrist": column(&Matrix4::identity())}),
            };
        }
        writeln!(text, "{line}").unwrap();
    }
    write(&root.join("tracking.jsonl"), text);
    let intrinsics = json!({"isStereo": false, "leftIntrinsics": {"fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy,
        "distortionCoeffs": [0.0, 0.0, 0.0, 0.0, 0.0], "imageWidth": c.width, "imageHeight": c.height}});
    let extrinsics = json!({"leftHeadToCamera": column(&head_from_camera.inverse().to_homogeneous())});
    let metadata = json!({"version": "1.0", "hasVideo": false, "intrinsicCalibration": intrinsics.to_string(),
        "extrinsicCalibration": extrinsics.to_string()});
    write(&root.join("metadata.json"), metadata.to_string());
}

/// A hand: its wrist in the world, the others in the wrist's frame.
fn visionpro_hand(joints: &[Vector], wrist_turn: &UnitQuaternion<f64>) -> Value {
    let column = |m: &Matrix4<f64>| m.iter().copied().collect::<Vec<f64>>();
    let wrist = Pose::from_parts((y_up() * joints[0]).into(), *wrist_turn);
    let mut hand = json!({"wrist": column(&wrist.to_homogeneous())});
    let mut put = |name: &str, p: &Vector| {
        let local = wrist.inverse() * Point::from(y_up() * p);
        hand[name] = json!(column(&Matrix4::new_translation(&local.coords)));
    };
    for (finger, first) in [("thumb", 1), ("index", 5), ("middle", 9), ("ring", 13), ("little", 17)] {
        for (k, part) in ["Knuckle", "IntermediateBase", "IntermediateTip", "Tip"].into_iter().enumerate() {
            put(&format!("{finger}{part}"), &joints[first + k]);
        }
        put(&format!("{finger}Metacarpal"), &joints[first]);
    }
    hand
}

#[test]
fn vision_pro_recordings_come_back_and_hands_that_repeat_are_left_out() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("vision");
    write_visionpro(&root);
    import(&["vision", "--fps", "0"], dir.path());
    poses_are_back(&dir.path().join("out"), &small(), 1e-6);
    hands_are_back(&dir.path().join("out"), 1e-6);
    // A second line with the values of the one before: the hand is no longer seen.
    let text = std::fs::read_to_string(root.join("tracking.jsonl")).unwrap();
    let mut lines: Vec<Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let last = lines.len() - 1;
    for key in ["leftHand", "rightHand"] {
        lines[last][key] = lines[last - 1][key].clone();
    }
    let text: Vec<String> = lines.iter().map(Value::to_string).collect();
    write(&root.join("tracking.jsonl"), text.join("\n"));
    std::fs::remove_dir_all(dir.path().join("out")).unwrap();
    import(&["vision", "--fps", "0"], dir.path());
    let table = json(&dir.path().join("out/hands.json"));
    assert!(table["frames"].as_array().unwrap().iter().all(|f| f["frame"].as_u64().unwrap() < last as u64));
}

#[test]
fn broken_recordings_of_headsets_are_named() {
    let holo = |change: fn(&Path)| {
        move |dir: &Path| {
            write_hololens(&dir.join("source"));
            change(&dir.join("source"));
        }
    };
    costs_itself(
        "cells",
        &["20240101_pv.txt: line 2", "cells, expected"],
        holo(|s| {
            edit(&s.join("20240101_pv.txt"), ",0,0,0,1\n", "\n");
        }),
    );
    refused("a hand cut short", &["head_hand_eye.csv: line", "expected 851"], |d| {
        holo(|_| {})(d);
        cut(&d.join("source/20240101_head_hand_eye.csv"), 2000);
    });
    costs_itself(
        "infinity",
        &["20240101_pv.txt: line 2: cell 2", "not finite"],
        holo(|s| {
            edit(&s.join("20240101_pv.txt"), ",96,", ",inf,");
        }),
    );
    refused("rays", &["Depth Long Throw_lut.bin", "three float32"], |d| {
        holo(|_| {})(d);
        cut(&d.join("source/Depth Long Throw_lut.bin"), 2);
    });
    refused("a traversal", &["outside"], |d| {
        write_quest(&d.join("source"), true);
        edit(&d.join("source/left_camera_mruk_frame_metadata.csv"), "0,1700", "0,../../1700");
    });
    refused("no lens", &["left_camera_mruk_intrinsics.json", "focalLength.x"], |d| {
        write_quest(&d.join("source"), true);
        edit(&d.join("source/left_camera_mruk_intrinsics.json"), "\"focalLength\"", "\"focus\"");
    });
    costs_itself("a head", &["tracking.jsonl: line 1", "headMatrix"], |d| {
        write_visionpro(&d.join("source"));
        edit(&d.join("source/tracking.jsonl"), "\"headMatrix\":[", "\"headMatrix\":[\"x\",");
    });
    refused("a calibration", &["metadata.json: intrinsicCalibration", "no JSON"], |d| {
        write_visionpro(&d.join("source"));
        edit(&d.join("source/metadata.json"), "\"intrinsicCalibration\":\"{", "\"intrinsicCalibration\":\"");
    });
}
