//! What networks, data sets and annotators write of a synthetic kitchen, alone and joined with each other.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, SmallVec, WritableImage};
use nalgebra::UnitQuaternion;
use paws_twin::math::{Point, Pose, Vector};
use paws_twin::recording::{Recording, Side};
use serde_json::{Value, json};

use crate::common::{SMALL, paws, skipped, stderr};
use crate::import::{
    FRAMES, apart, copy, costs_itself, depth_mm, edit, import, json as read_json, poses, refused, same_bytes, small,
    still, write, write_colmap,
};

/// Rows of `world_from_camera` of an OpenGL camera.
fn opengl_rows(pose: &Pose) -> Vec<[f64; 4]> {
    let m = pose.rotation.to_rotation_matrix().into_inner();
    let t = pose.translation.vector;
    (0..3).map(|i| [m[(i, 0)], -m[(i, 1)], -m[(i, 2)], t[i]]).chain([[0.0, 0.0, 0.0, 1.0]]).collect()
}

fn write_nerfstudio(root: &Path) -> Vec<Pose> {
    let recording = small();
    let c = recording.camera;
    let mut frames = Vec::new();
    let mut out = Vec::new();
    for (i, frame) in recording.frames.iter().take(FRAMES).enumerate() {
        let name = format!("images/frame_{i:05}.jpg");
        let depth = format!("depth/frame_{i:05}.png");
        copy(&still("frames", i), &root.join(&name));
        copy(&still("depth", i), &root.join(&depth));
        frames.push(json!({"file_path": name, "depth_file_path": depth,
                           "transform_matrix": opengl_rows(&frame.world_from_camera)}));
        out.push(frame.world_from_camera);
    }
    let transforms = json!({"camera_model": "OPENCV", "w": c.width, "h": c.height, "fl_x": c.fx, "fl_y": c.fy,
                            "cx": c.cx + 0.5, "cy": c.cy + 0.5, "k1": 0.0, "frames": frames});
    write(&root.join("transforms.json"), transforms.to_string());
    out
}

#[test]
fn nerfstudio_comes_back_as_it_was() {
    let dir = tempfile::tempdir().unwrap();
    let truth = write_nerfstudio(&dir.path().join("scene"));
    import(&["scene", "--fps", "0", "--up", "z"], dir.path());
    let out = dir.path().join("out");
    let (m, deg) = apart(&truth, &poses(&out));
    assert!(m < 1e-9 && deg < 1e-5, "{m} m, {deg} degrees");
    assert!(same_bytes(&still("frames", 3), &out.join("frames/000003.jpg")));
    assert_eq!(depth_mm(&out.join("depth/000003.png")), depth_mm(&still("depth", 3)));
}

/// ARKitScenes: a file a frame for images, depth, confidence and intrinsics, named by times that differ in the last digit.
fn write_arkitscenes(root: &Path) -> Vec<Pose> {
    let recording = small();
    let c = recording.camera;
    let mut trajectory = String::new();
    let mut out = Vec::new();
    for (i, frame) in recording.frames.iter().take(FRAMES).enumerate() {
        let time = 305.0 + frame.timestamp_secs;
        let name = format!("41069021_{time:.3}.png");
        let inverse = frame.world_from_camera.inverse();
        let (r, t) = (inverse.rotation.scaled_axis(), inverse.translation.vector);
        writeln!(trajectory, "{time:.3} {} {} {} {} {} {}", r.x, r.y, r.z, t.x, t.y, t.z).unwrap();
        let image = image::open(still("frames", i)).unwrap();
        std::fs::create_dir_all(root.join("lowres_wide")).unwrap();
        image.save(root.join("lowres_wide").join(&name)).unwrap();
        copy(&still("depth", i), &root.join("lowres_depth").join(&name));
        let sure = image::GrayImage::from_pixel(c.width as u32, c.height as u32, image::Luma([u8::from(i != 2) * 2]));
        std::fs::create_dir_all(root.join("confidence")).unwrap();
        sure.save(root.join("confidence").join(&name)).unwrap();
        write(
            &root.join(format!("lowres_wide_intrinsics/41069021_{:.3}.pincam", time + 0.001)),
            format!("{} {} {} {} {} {}\n", c.width, c.height, c.fx, c.fy, c.cx, c.cy),
        );
        out.push(frame.world_from_camera);
    }
    write(&root.join("lowres_wide.traj"), trajectory);
    out
}

#[test]
fn arkitscenes_come_back_as_they_were() {
    let dir = tempfile::tempdir().unwrap();
    let truth = write_arkitscenes(&dir.path().join("41069021"));
    import(&["41069021", "--fps", "0"], dir.path());
    let out = dir.path().join("out");
    let (m, deg) = apart(&truth, &poses(&out));
    assert!(m < 1e-6 && deg < 1e-4, "{m} m, {deg} degrees");
    assert_eq!(depth_mm(&out.join("depth/000003.png")), depth_mm(&still("depth", 3)));
    assert!(depth_mm(&out.join("depth/000002.png")).iter().all(|z| *z == 0));
    assert_eq!(image::open(out.join("frames/000003.jpg")).unwrap().width(), 160);
}

/// Arti4D: a tracker on the camera, images turned by half.
fn write_arti4d(set: &Path, is_turned: bool) -> (PathBuf, Vec<Pose>) {
    let recording = small();
    let c = recording.camera;
    let root = set.join("raw/kitchen/scene_1");
    let base_from_depth =
        Pose::from_parts(Vector::new(0.02, -0.1, 0.05).into(), UnitQuaternion::from_euler_angles(0.2, 0.1, 1.2));
    let depth_from_rgb = Pose::translation(-0.03, 0.0, 0.0);
    let half = if is_turned { std::f64::consts::PI } else { 0.0 };
    let turn = Pose::from_parts(Vector::zeros().into(), UnitQuaternion::from_scaled_axis(Vector::z() * half));
    let mut odometry = "timestamp, x, y, z, qx, qy, qz, qw\n".to_owned();
    let mut out = Vec::new();
    for (i, frame) in recording.frames.iter().take(FRAMES).enumerate() {
        // Two of the recording's frames may have one time where a person waits.
        let time = 1_729_084_123.0 + 0.1 * i as f64;
        let nanoseconds = 1_729_084_123_000_000_000u64 + 100_000_000 * i as u64;
        let tracker = frame.world_from_camera * (base_from_depth * depth_from_rgb * turn).inverse();
        let (t, q) = (tracker.translation.vector, tracker.rotation.coords);
        writeln!(odometry, "{time}, {}, {}, {}, {}, {}, {}, {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w).unwrap();
        copy(&still("frames", i), &root.join(format!("rgb/rgb_{nanoseconds}.jpg")));
        copy(&still("depth", i), &root.join(format!("depth/depth_{nanoseconds}.png")));
        out.push(frame.world_from_camera);
    }
    let info = format!(
        "header: \n  seq: 1\nheight: {}\nwidth: {}\nD: (0.0, 0.0, 0.0, 0.0, 0.0)\nK: ({}, 0.0, {}, 0.0, {}, {}, 0.0, 0.0, 1.0)\n",
        c.height, c.width, c.fx, c.cx, c.fy, c.cy
    );
    write(&root.join("rgb/camera_info.txt"), &info);
    write(&root.join("depth/camera_info.txt"), &info);
    write(&root.join("odom/scene_1.csv"), odometry);
    write(&root.join("matched_cues.csv"), "CUE_START,CUE_END,VERIFICATION\n3,9,VERIFIED\n10,12,REJECTED\n");
    let transform = |p: &Pose| {
        let (t, q) = (p.translation.vector, p.rotation.coords);
        json!({"rotation": {"x": q.x, "y": q.y, "z": q.z, "w": q.w}, "translation": {"x": t.x, "y": t.y, "z": t.z}})
    };
    let tf = json!({"base_T_depth": transform(&base_from_depth), "depth_T_rgb": transform(&depth_from_rgb)});
    write(&set.join("meta/calibration/azure_tf.json"), tf.to_string());
    (root, out)
}

#[test]
fn arti4d_comes_back_whether_images_were_turned_or_not() {
    for is_turned in [false, true] {
        let dir = tempfile::tempdir().unwrap();
        let (root, truth) = write_arti4d(dir.path(), is_turned);
        import(&[root.to_str().unwrap(), "--fps", "0"], dir.path());
        let out = dir.path().join("out");
        let (m, deg) = apart(&truth, &poses(&out));
        // Doubles of seconds since 1970 are a quarter of a microsecond apart.
        assert!(m < 1e-5 && deg < 1e-3, "{is_turned}: {m} m, {deg} degrees");
        assert_eq!(depth_mm(&out.join("depth/000003.png")), depth_mm(&still("depth", 3)));
        let clips = read_json(&out.join("clips.json"));
        assert_eq!((&clips["clips"][0]["start_frame"], &clips["clips"][0]["end_frame"]), (&json!(3), &json!(9)));
        assert_eq!(clips["clips"].as_array().unwrap().len(), 1);
    }
}

/// The recording's hands: frame, entry of hands.json, joints in the camera (OpenCV axes).
fn hands_in_camera(recording: &Recording) -> Vec<(usize, Value, Vec<[f64; 3]>)> {
    let hands = read_json(&SMALL.path().join("hands.json"));
    let mut out = Vec::new();
    for entry in hands["frames"].as_array().unwrap() {
        let frame = entry["frame"].as_u64().unwrap() as usize;
        let camera_from_world = recording.frames[frame].world_from_camera.inverse();
        for hand in entry["hands"].as_array().unwrap() {
            let world: Vec<[f64; 3]> = serde_json::from_value(hand["joints_world"].clone()).unwrap();
            let joints = world.iter().map(|p| (camera_from_world * Point::from(*p)).coords.into()).collect();
            out.push((frame, hand.clone(), joints));
        }
    }
    out
}

fn image_name(frame: usize) -> String {
    format!("frame_{frame:010}")
}

/// EPIC-Fields: a COLMAP world of its own scale, poses and points in one file, images in a folder beside it.
fn write_epic_fields(dir: &Path, metres_per_unit: f64) {
    let recording = small();
    let c = recording.camera;
    let turn = Pose::from_parts(Vector::new(0.3, -1.0, 2.0).into(), UnitQuaternion::from_euler_angles(0.5, -0.4, 1.0));
    let mut images = serde_json::Map::new();
    let mut points = Vec::new();
    for (i, frame) in recording.frames.iter().enumerate() {
        let moved = turn * frame.world_from_camera;
        let inverse = Pose::from_parts((moved.translation.vector / metres_per_unit).into(), moved.rotation).inverse();
        let (t, q) = (inverse.translation.vector, inverse.rotation.coords);
        images.insert(format!("{}.jpg", image_name(i)), json!([q.w, q.x, q.y, q.z, t.x, t.y, t.z]));
        copy(&still("frames", i), &dir.join(format!("P01_01/{}.jpg", image_name(i))));
        let depth = recording.depth(i).unwrap().unwrap();
        for (k, z) in depth.data.iter().enumerate().step_by(397).filter(|(_, z)| **z > 0.0) {
            let p = moved * c.unproject((k % c.width) as f64, (k / c.width) as f64, f64::from(*z)) / metres_per_unit;
            points.push(json!([p.x, p.y, p.z, 1, 2, 3]));
        }
    }
    let params = [c.fx, c.fy, c.cx + 0.5, c.cy + 0.5, 0.0, 0.0, 0.0, 0.0];
    let file = json!({"camera": {"id": 1, "model": "OPENCV", "width": c.width, "height": c.height, "params": params},
                      "images": images, "points": points});
    write(&dir.join("P01_01.json"), file.to_string());
}

/// MoGe-2: a folder an image; depth as OpenEXR with infinities where it is masked, normals with y and z mirrored.
fn write_moge(root: &Path) {
    let recording = small();
    let c = recording.camera;
    for i in (0..recording.frames.len()).step_by(3) {
        let folder = root.join(image_name(i));
        copy(&still("frames", i), &folder.join("image.jpg"));
        let grid = recording.depth(i).unwrap().unwrap();
        let values = grid.data.iter().map(|z| if *z > 0.0 { *z } else { f32::INFINITY }).collect();
        let mut list = SmallVec::new();
        list.push(AnyChannel::new("Y", FlatSamples::F32(values)));
        let image = Image::from_channels((grid.width, grid.height), AnyChannels::sort(list));
        image.write().to_file(folder.join("depth.exr")).unwrap();
        // All face the camera: n = (0, 0, -1), written as trunc(255 (n [0.5, -0.5, -0.5] + 0.5)).
        let normals = image::RgbImage::from_pixel(c.width as u32, c.height as u32, image::Rgb([127, 127, 255]));
        normals.save(folder.join("normal.png")).unwrap();
        write(&folder.join("fov.json"), r#"{"fov_x": 20.0, "fov_y": 15.0}"#);
    }
}

/// Hands as the exporters write them, in the camera, by the image's name.
fn write_hands(path: &Path) {
    let mut text = "{\"format\": \"paws-hands\", \"space\": \"camera\", \"fps\": 30}\n".to_owned();
    for (frame, hand, joints) in hands_in_camera(&small()) {
        let row = json!({"image": image_name(frame), "side": hand["side"], "joints": joints, "score": 0.9});
        writeln!(text, "{row}").unwrap();
    }
    write(path, text);
}

/// Hands23: numbers as strings; a hand without contact is there too.
fn write_hands23(path: &Path) {
    let images: Vec<Value> = hands_in_camera(&small())
        .iter()
        .map(|(frame, hand, _)| {
            let side = format!("{}_hand", hand["side"].as_str().unwrap());
            let state = if hand["contact"] == json!(true) { "object_contact" } else { "no_contact" };
            json!({"file_name": format!("P01_01/{}.jpg", image_name(*frame)), "predictions": [
                {"hand_id": 0, "hand_bbox": ["1.0", "2.0", "3.0", "4.0"], "contact_state": state, "hand_side": side,
                 "obj_bbox": null, "obj_touch": "None", "hand_pred_score": "1.0", "obj_pred_score": "None"}]})
        })
        .collect();
    write(path, json!({"save_dir": "results", "images": images}).to_string());
}

/// EPIC-KITCHENS: narrations of two videos in one table, by time and by number of image.
fn write_narrations(path: &Path) {
    let mut text =
        "narration_id,participant_id,video_id,narration_timestamp,start_timestamp,stop_timestamp,start_frame,\
                    stop_frame,narration,verb,verb_class,noun,noun_class,all_nouns,all_noun_classes\n"
            .to_owned();
    text += "P01_010_0,P01,P01_010,00:00:01.0,00:00:01.00,00:00:02.00,3,9,turn on tap,turn-on,6,tap,0,['tap'],[0]\n";
    for (i, clip) in small().clips.iter().enumerate() {
        writeln!(
            text,
            "P01_01_{i},P01,P01_01,00:00:01.0,00:00:{:05.2},00:00:{:05.2},{},{},\"{}\",{},3,{},3,\"['{}', 'x']\",\"[3, 4]\"",
            clip.start_frame as f64 / 60.0,
            clip.end_frame as f64 / 60.0,
            clip.start_frame,
            clip.end_frame,
            clip.narration,
            clip.verb,
            clip.noun,
            clip.noun
        )
        .unwrap();
    }
    write(path, text);
}

#[test]
fn poses_depth_hands_contact_and_words_of_five_sources_make_one_recording() {
    let dir = tempfile::tempdir().unwrap();
    let recording = small();
    write_epic_fields(dir.path(), 2.5);
    write_moge(&dir.path().join("moge"));
    write_hands(&dir.path().join("hands.jsonl"));
    write_hands23(&dir.path().join("result.json"));
    write_narrations(&dir.path().join("EPIC_100_train.csv"));
    let sources =
        ["P01_01.json", "P01_01", "moge=moge", "hands=hands.jsonl", "hands23=result.json", "EPIC_100_train.csv"];
    let text = import(&[&sources[..], &["--fps", "0"]].concat(), dir.path());
    let out = dir.path().join("out");
    let report = read_json(&out.join("import.json"));
    let scale = report["scale"]["metres_per_unit"].as_f64().unwrap();
    assert!((scale / 2.5 - 1.0).abs() < 0.02, "{scale}");
    for (stream, by) in
        [("poses", "name"), ("depth", "name"), ("hands", "name"), ("contact", "name"), ("clips", "name")]
    {
        let rows = report["streams"].as_array().unwrap();
        let row = rows.iter().find(|r| r["stream"] == stream).unwrap_or_else(|| panic!("no {stream}: {text}"));
        assert_eq!(row["joined_by"], by, "{stream}");
    }
    let back = Recording::open(&out).unwrap();
    assert_eq!(back.frames.len(), recording.frames.len());
    // The camera is COLMAP's, not the one that the depth network guessed.
    assert!((back.camera.fx - recording.camera.fx).abs() < 1e-9);
    assert_eq!(back.clips.len(), recording.clips.len(), "{text}");
    for (a, b) in back.clips.iter().zip(&recording.clips) {
        assert_eq!(
            (a.start_frame, a.end_frame, &a.narration, &a.noun),
            (b.start_frame, b.end_frame, &b.narration, &b.noun)
        );
    }
    // Each hand is where its camera saw it, and holds what it held.
    assert_eq!(back.hands.len(), recording.hands.len());
    for (a, b) in back.hands.iter().zip(&recording.hands) {
        assert_eq!((a.frame, a.side, a.contact), (b.frame, b.side, b.contact));
        let seen = |r: &Recording, p: &Point| r.frames[a.frame].world_from_camera.inverse() * p;
        for (p, q) in a.tips.iter().zip(&b.tips) {
            assert!((seen(&back, p) - seen(&recording, q)).norm() < 1e-6, "frame {}", a.frame);
        }
    }
    let (found, truth) = (depth_mm(&out.join("depth/000030.png")), depth_mm(&still("depth", 30)));
    assert!(found.iter().zip(&truth).all(|(a, b)| a.abs_diff(*b) <= 1));
    assert!(!out.join("depth/000031.png").exists());
    let normal = image::open(out.join("normals/000030.png")).unwrap().into_rgb8();
    assert_eq!(normal.get_pixel(80, 60).0, [128, 128, 1]);
}

#[test]
fn narrations_of_other_videos_are_told_and_left_out() {
    let dir = tempfile::tempdir().unwrap();
    write_nerfstudio(&dir.path().join("scene"));
    write_narrations(&dir.path().join("EPIC_100_train.csv"));
    let text = import(&["scene", "EPIC_100_train.csv", "--up", "z"], dir.path());
    assert!(text.contains("narrations of 2 videos") && text.contains("missing: clips"), "{text}");
}

#[test]
fn subtitles_count_from_the_first_frame_of_a_clock_that_began_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    write_arti4d(dir.path(), false);
    write(&dir.path().join("said.srt"), "1\n00:00:00,250 --> 00:00:01,000\nopen the drawer\n");
    let sequence = "raw/kitchen/scene_1";
    std::fs::remove_file(dir.path().join(sequence).join("matched_cues.csv")).unwrap();
    import(&[sequence, "said.srt", "--fps", "0"], dir.path());
    let clips = read_json(&dir.path().join("out/clips.json"));
    assert_eq!((&clips["clips"][0]["start_frame"], &clips["clips"][0]["end_frame"]), (&json!(3), &json!(10)));
    assert_eq!(clips["clips"][0]["narration"], "open the drawer");
}

/// WiLoR's meshes of a hand whose fingertips are known, as its demo writes them: OpenGL axes, a focal length that is not the
/// camera's.
fn write_wilor(root: &Path, frame: usize, tips: &[Point; 3], side: Side) {
    let c = small().camera;
    let (w, h) = (c.width as f64, c.height as f64);
    let focal = 5000.0 / 256.0 * w.max(h);
    let middle = Point::from((tips[0].coords + tips[1].coords + tips[2].coords) / 3.0);
    // The same pixels and the same size at the demo's focal length.
    let z = middle.z * focal / c.fx;
    let (u, v) = c.project(&middle).unwrap();
    let there = Point::new((u - 0.5 * (w - 1.0)) / focal * z, (v - 0.5 * (h - 1.0)) / focal * z, z);
    let mut vertices = vec![Vector::zeros(); 778];
    for (vertex, tip) in [744, 320, 443].into_iter().zip(tips) {
        vertices[vertex] = tip - middle;
    }
    // The other two fingers, about the middle too, so that the mean is the hand's.
    let mut text = String::new();
    for vertex in vertices {
        let p = there + vertex;
        writeln!(text, "v {} {} {} 0.6 0.7 0.8", p.x, -p.y, -p.z).unwrap();
    }
    text += if side == Side::Right { "f 93 39 235\n" } else { "f 93 235 39\n" };
    write(&root.join(format!("{frame:06}_0.obj")), text);
    copy(&still("frames", frame), &root.join(format!("{frame:06}.jpg")));
}

#[test]
fn wilors_hands_go_where_the_cameras_own_focal_length_has_them() {
    let dir = tempfile::tempdir().unwrap();
    let recording = small();
    write_colmap(&dir.path().join("work"), false, 1.0);
    let mut truth = Vec::new();
    for hand in recording.hands.iter().filter(|h| h.frame < FRAMES) {
        let camera_from_world = recording.frames[hand.frame].world_from_camera.inverse();
        let tips = hand.tips.map(|p| camera_from_world * p);
        write_wilor(&dir.path().join("wilor"), hand.frame, &tips, hand.side);
        truth.push((hand.frame, hand.side, tips));
    }
    assert!(!truth.is_empty());
    import(&["work", "wilor", "--fps", "0", "--scale", "1"], dir.path());
    let out = dir.path().join("out");
    let table = std::fs::read_to_string(out.join("fingertips.csv")).unwrap();
    let cameras = poses(&out);
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.len(), truth.len(), "{table}");
    for (row, (frame, side, tips)) in rows.iter().zip(&truth) {
        assert_eq!(
            (row[0].parse::<usize>().unwrap(), row[2]),
            (*frame, if *side == Side::Left { "left" } else { "right" })
        );
        for (k, tip) in tips.iter().enumerate() {
            let number = |i: usize| row[5 + 3 * k + i].parse::<f64>().unwrap();
            let seen = cameras[*frame].inverse() * Point::new(number(0), number(1), number(2));
            assert!((seen - tip).norm() < 1e-6, "frame {frame}: {seen} {tip}");
        }
    }
}

#[test]
fn masks_and_segments_come_by_the_images_names() {
    let dir = tempfile::tempdir().unwrap();
    write_colmap(&dir.path().join("work"), false, 1.0);
    let c = small().camera;
    let total = (c.width * c.height) as u64;
    // The first 40 columns; in another image by runs that are one pixel too long.
    let column = |class: &str| {
        json!({"image_path": "work/images/000004.jpg", "annotations": [
            {"class_name": class, "bbox": [0, 0, 1, 1], "score": [0.8],
             "segmentation": {"size": [c.height, c.width], "counts": [0, 40 * c.height, total - 40 * c.height as u64]}}],
            "box_format": "xyxy", "img_width": c.width, "img_height": c.height})
    };
    write(&dir.path().join("sam/000004_results.json"), column("drawer.").to_string());
    write(
        &dir.path().join("sam/000005_results.json"),
        column("drawer").to_string().replace("[0,", "[1,").replace("000004", "000005"),
    );
    write(&dir.path().join("limap/segments/segments_7.txt"), "2\n10 20 30 40\n5.5 6.5 7.5 8.5\n");
    write(&dir.path().join("limap/image_list.txt"), "number of images, 1\n7, images/000004.jpg\n");
    let text = import(&["work", "sam", "limap", "--fps", "0", "--scale", "1"], dir.path());
    let out = dir.path().join("out");
    let mask = image::open(out.join("masks/000004.png")).unwrap().into_luma8();
    assert_eq!((mask.get_pixel(39, 7).0, mask.get_pixel(40, 7).0), ([1], [0]));
    assert_eq!(read_json(&out.join("labels.json"))["1"], "drawer");
    let lines = std::fs::read_to_string(out.join("segments/000004.txt")).unwrap();
    assert!(lines.starts_with("2\n10.000 20.000 30.000 40.000\n"), "{lines}");
    let notes = read_json(&out.join("import.json"))["sources"].to_string();
    assert!(notes.contains("000005_results.json") && notes.contains("do not fill"), "{text} {notes}");
}

#[test]
fn a_cloud_gives_a_world_without_points_its_scale() {
    let dir = tempfile::tempdir().unwrap();
    write_epic_fields(dir.path(), 2.0);
    write_moge(&dir.path().join("moge"));
    let mut fields = read_json(&dir.path().join("P01_01.json"));
    let mut cloud = "x,y,z\n".to_owned();
    for p in fields["points"].as_array().unwrap() {
        writeln!(cloud, "{},{},{}", p[0], p[1], p[2]).unwrap();
    }
    fields["points"] = json!([]);
    write(&dir.path().join("P01_01.json"), fields.to_string());
    write(&dir.path().join("scan.csv"), cloud);
    let text = import(&["P01_01.json", "P01_01", "moge", "scan.csv"], dir.path());
    let report = read_json(&dir.path().join("out/import.json"));
    let scale = report["scale"]["metres_per_unit"].as_f64().unwrap();
    assert!((scale / 2.0 - 1.0).abs() < 0.02, "{scale}");
    assert!(dir.path().join("out/reconstruction.ply").is_file());
    assert!(report["changes"].to_string().contains("are taken to be in the world of"), "{text}");
}

#[test]
fn mapanythings_models_are_in_metres() {
    let dir = tempfile::tempdir().unwrap();
    let truth = write_colmap(&dir.path().join("work"), true, 1.0);
    import(&["mapanything=work", "--fps", "0"], dir.path());
    let found = poses(&dir.path().join("out"));
    let span = |p: &[Pose]| (p[FRAMES - 1].translation.vector - p[0].translation.vector).norm();
    assert!((span(&found) - span(&truth)).abs() < 1e-6);
}

/// What the exporters of `examples/import` do without the networks: axes, quaternions, names.
#[test]
fn exporters_write_what_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let recording = small();
    let poses_of = |f: usize| {
        let pose = recording.frames[f].world_from_camera;
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        json!([t.x, t.y, t.z, q.x, q.y, q.z, q.w])
    };
    let hands = read_json(&SMALL.path().join("hands.json"));
    let first = &hands["frames"][0];
    let frame = first["frame"].as_u64().unwrap() as usize;
    let input = json!({"frame": frame, "camera": poses_of(frame), "side": first["hands"][0]["side"],
                       "joints": first["hands"][0]["joints_world"], "names": ["a/0_2.json", "b/5_5.json"]});
    write(&dir.path().join("input.json"), input.to_string());
    let script = "import json, sys\nsys.dont_write_bytecode = True\nsys.path.insert(0, sys.argv[1])\nimport hawor, hoi4d\n\
                  d = json.load(open('input.json'))\nassert hawor.observed(d['names']) == {0, 1, 2, 5}\n\
                  r = hawor.rotation(d['camera'][3:])\nq = hoi4d.quaternion(r)\n\
                  assert abs(abs(sum(a * b for a, b in zip(q, d['camera'][3:]))) - 1) < 1e-9\n\
                  log = '4 4 5\\n' + '\\n'.join(' '.join(map(str, r[i] + [d['camera'][i]])) for i in range(3)) + '\\n0 0 0 1\\n'\n\
                  assert all(abs(a - b) < 1e-9 for a, b in zip(hoi4d.cameras(log)[4][:3], d['camera'][:3]))\n\
                  rows = hawor.rows({d['frame']: d['camera']}, [(d['frame'], d['side'], d['joints'])])\n\
                  open('hands.jsonl', 'w').write(''.join(json.dumps(r) + '\\n' for r in rows))\n";
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/import");
    let ran = Command::new("python3")
        .args(["-c", script])
        .arg(&scripts)
        .current_dir(dir.path())
        .stdin(Stdio::null())
        .output();
    let out = match ran {
        Ok(out) => out,
        Err(e) => return skipped(&format!("python3: {e}: the exporters of examples/import are not run")),
    };
    assert!(out.status.success(), "{}", stderr(&out));
    let camera = recording.camera;
    let numbers = format!("{},{},{},{},{},{}", camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy);
    import(&["hands.jsonl", "--camera", &numbers, "--up", "z"], dir.path());
    let back = read_json(&dir.path().join("out/hands.json"));
    let read = |v: &Value| -> Vec<[f64; 3]> { serde_json::from_value(v.clone()).unwrap() };
    let found = read(&back["frames"][0]["hands"][0]["joints_world"]);
    for (a, b) in found.iter().zip(read(&first["hands"][0]["joints_world"])) {
        assert!((Point::from(*a) - Point::from(b)).norm() < 1e-9);
    }
}

#[test]
fn broken_files_of_tools_are_named() {
    type Break = fn(&Path);
    let nerf: [(&str, &[&str], Break); 5] = [
        ("a matrix", &["transforms.json", "frame images/frame_00000.jpg", "transform_matrix"], |s| {
            edit(&s.join("transforms.json"), "[0.0,0.0,0.0,1.0]", "[0.0,0.0,1.0]");
        }),
        ("a word", &["transforms.json", "fl_x"], |s| {
            edit(&s.join("transforms.json"), "\"fl_x\":", "\"fl_x\":\"wide\",\"x\":")
        }),
        ("a lens", &["transforms.json", "EQUIRECTANGULAR", "undistorted"], |s| {
            edit(&s.join("transforms.json"), "\"OPENCV\"", "\"EQUIRECTANGULAR\"");
        }),
        ("a traversal", &["outside"], |s| {
            edit(&s.join("transforms.json"), "images/frame_00003.jpg", "../../etc/passwd")
        }),
        ("half a file", &["transforms.json: line 1"], |s| {
            let file = s.join("transforms.json");
            let text = std::fs::read_to_string(&file).unwrap();
            write(&file, &text[..text.len() / 2]);
        }),
    ];
    for (name, words, break_it) in nerf {
        let broken = |d: &Path| {
            write_nerfstudio(&d.join("source"));
            break_it(&d.join("source"));
        };
        // Without one frame the others are used.
        if name == "a matrix" { costs_itself(name, words, broken) } else { refused(name, words, broken) }
    }
    refused("a short line", &["lowres_wide.traj: line 1", "6 numbers"], |d| {
        write_arkitscenes(&d.join("source"));
        write(&d.join("source/lowres_wide.traj"), "1 0 0 0 0 0\n");
    });
    refused("an infinite pose", &["lowres_wide.traj: line 1", "not finite"], |d| {
        write_arkitscenes(&d.join("source"));
        write(&d.join("source/lowres_wide.traj"), "1 0 0 0 0 0 inf\n");
    });
    let epic = |numbers: &'static str| {
        move |d: &Path| {
            let text = format!(
                r#"{{"camera": {{"model": "OPENCV", "width": 456, "height": 256, "params": [1]}}, "images": {{"a.jpg": {numbers}}}}}"#
            );
            write(&d.join("source"), &text);
            std::fs::rename(d.join("source"), d.join("source.json")).unwrap();
        }
    };
    let dir = tempfile::tempdir().unwrap();
    epic("[1, 0, 0]")(dir.path());
    let out = paws(&["import", "source.json", "--out", "out"], dir.path());
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("source.json: camera") && stderr(&out).contains("8 parameters"), "{}", stderr(&out));
    let dir = tempfile::tempdir().unwrap();
    let (root, _) = write_arti4d(dir.path(), false);
    std::fs::remove_dir_all(dir.path().join("meta")).unwrap();
    let out = paws(&["import", root.to_str().unwrap(), "--out", "out"], dir.path());
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("azure_tf.json") && stderr(&out).contains("arti4d-meta.zip"), "{}", stderr(&out));
}

/// Folders as MoGe writes them for the images in `frames/` of a recording, with the recording's own depth.
fn write_moge_of(recording: &Path, root: &Path) -> usize {
    let mut count = 0;
    while recording.join(format!("frames/{count:06}.jpg")).is_file() {
        let depth = image::open(recording.join(format!("depth/{count:06}.png"))).unwrap().into_luma16();
        let size = (depth.width() as usize, depth.height() as usize);
        let metres = depth.into_raw().into_iter().map(|mm| 1e-3 * f32::from(mm)).collect();
        let mut list = SmallVec::new();
        list.push(AnyChannel::new("Y", FlatSamples::F32(metres)));
        let folder = root.join(format!("{count:06}"));
        std::fs::create_dir_all(&folder).unwrap();
        Image::from_channels(size, AnyChannels::sort(list)).write().to_file(folder.join("depth.exr")).unwrap();
        count += 1;
    }
    count
}

#[test]
fn what_networks_make_of_the_frames_of_a_recording_meets_them_again() {
    let dir = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let out = paws(args, dir.path());
        assert_eq!(out.status.code(), Some(0), "{args:?}: {}", stderr(&out));
        String::from_utf8(out.stdout).unwrap()
    };
    let source = SMALL.path().to_str().unwrap();
    // Fewer frames, numbered anew.
    run(&["import", source, "--fps", "3", "--out", "rec"]);
    let rec = dir.path().join("rec");
    let count = write_moge_of(&rec, &dir.path().join("moge"));
    assert!(2 < count && 2 * count < small().frames.len(), "{count}");
    let text = run(&["import", "moge", "rec", "--fps", "0", "--out", "joined"]);
    assert!(text.contains("moge"), "{text}");
    let joined = dir.path().join("joined");
    let (m, deg) = apart(&poses(&rec), &poses(&joined));
    assert!(m < 1e-9 && deg < 1e-5, "{m} m, {deg} degrees");
    for i in 0..count {
        let name = format!("depth/{i:06}.png");
        assert_eq!(depth_mm(&rec.join(&name)), depth_mm(&joined.join(&name)), "{i}");
    }
    let tables = |of: &Path, name: &str| read_json(&of.join(name));
    assert_eq!(tables(&rec, "clips.json"), tables(&joined, "clips.json"));
    assert_eq!(tables(&rec, "hands.json")["frames"].as_array().map(Vec::len), {
        tables(&joined, "hands.json")["frames"].as_array().map(Vec::len)
    });
    assert_eq!(read_json(&joined.join("import.json"))["sources"][1]["kind"], "recording");
}

#[test]
fn one_bad_depth_of_a_network_costs_only_itself() {
    let dir = tempfile::tempdir().unwrap();
    write_epic_fields(dir.path(), 1.0);
    write_moge(&dir.path().join("moge"));
    let broken = dir.path().join("moge").join(image_name(3)).join("depth.exr");
    let bytes = std::fs::read(&broken).unwrap();
    write(&broken, &bytes[..bytes.len() / 2]);
    let text = import(&["P01_01.json", "P01_01", "moge", "--fps", "0"], dir.path());
    assert!(text.contains("depth.exr"), "{text}");
    let out = dir.path().join("out");
    assert!(!out.join("depth/000003.png").exists() && out.join("depth/000006.png").is_file());
}
