//! The synthetic kitchen as Project Aria's glasses write it, and imported again.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use nalgebra::UnitQuaternion;
use paws_twin::import::optics::{LensModel, Optics};
use paws_twin::math::{Point, Pose, Vector};
use paws_twin::recording::Recording;
use serde_json::{Value, json};

use crate::common::SMALL;
use crate::import::{apart, copy, costs_itself, depth_mm, edit, import, json, poses, refused, small, still, write};

/// Frames that a test writes: hands come into view among them.
pub const FRAMES: std::ops::Range<usize> = 14..38;

/// Joints of the recording's hands in MANO's order, by frame (counted from the first written one) and side.
pub fn hands() -> BTreeMap<(usize, String), Vec<Vector>> {
    let table = json(&SMALL.path().join("hands.json"));
    let mut out = BTreeMap::new();
    for frame in table["frames"].as_array().unwrap() {
        let number = frame["frame"].as_u64().unwrap() as usize;
        if !FRAMES.contains(&number) {
            continue;
        }
        for hand in frame["hands"].as_array().unwrap() {
            let joints: Vec<[f64; 3]> = serde_json::from_value(hand["joints_world"].clone()).unwrap();
            let joints = joints.into_iter().map(Vector::from).collect();
            out.insert((number - FRAMES.start, hand["side"].as_str().unwrap().to_owned()), joints);
        }
    }
    assert!(out.len() > 8, "{} hands", out.len());
    out
}

/// Expects the tips of an imported recording's hands to be those of the recording.
pub fn hands_are_back(out: &Path, tolerance_m: f64) {
    let mut found: BTreeMap<(usize, String), [Vector; 3]> = BTreeMap::new();
    if let Ok(text) = std::fs::read_to_string(out.join("fingertips.csv")) {
        for line in text.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |i: usize| cells[i].parse::<f64>().unwrap();
            let tip = |i: usize| Vector::new(number(5 + 3 * i), number(6 + 3 * i), number(7 + 3 * i));
            found.insert((cells[0].parse().unwrap(), cells[2].to_owned()), [tip(0), tip(1), tip(2)]);
        }
    } else {
        for frame in json(&out.join("hands.json"))["frames"].as_array().unwrap() {
            for hand in frame["hands"].as_array().unwrap() {
                let joints: Vec<[f64; 3]> = serde_json::from_value(hand["joints_world"].clone()).unwrap();
                let key = (frame["frame"].as_u64().unwrap() as usize, hand["side"].as_str().unwrap().to_owned());
                found.insert(key, [4, 8, 12].map(|i| Vector::from(joints[i])));
            }
        }
    }
    let truth = hands();
    assert_eq!(found.keys().collect::<Vec<_>>(), truth.keys().collect::<Vec<_>>());
    for (key, tips) in &found {
        for (tip, index) in tips.iter().zip([4, 8, 12]) {
            let off = (tip - truth[key][index]).norm();
            assert!(off < tolerance_m, "{key:?}: {off} m");
        }
    }
}

/// Expects an imported recording to have the written frames' poses.
pub fn poses_are_back(out: &Path, recording: &Recording, tolerance_m: f64) {
    let truth: Vec<Pose> = recording.frames[FRAMES].iter().map(|f| f.world_from_camera).collect();
    let (m, deg) = apart(&truth, &poses(out));
    assert!(m < tolerance_m && deg < 60.0 * tolerance_m + 1e-4, "{m} m, {deg} degrees");
}

/// The pixel of the recording that a pixel of the imported camera sees; both cameras are at one place.
fn same_ray(out: &Value, recording: &Recording, x: usize, y: usize) -> Option<(f64, f64)> {
    let of = |key: &str| out[key].as_f64().unwrap();
    let ray = Point::new((x as f64 - of("cx")) / of("fx"), (y as f64 - of("cy")) / of("fy"), 1.0);
    recording.camera.project(&ray).filter(|&(u, v)| recording.camera.contains(u, v))
}

/// Share of the pixels whose colour and depth are those of the recording; pixels that it does not show do not count.
pub fn pixels_are_back(out: &Path, recording: &Recording, index: usize) -> (f64, f64) {
    let camera = json(&out.join("cameras.json"));
    let image = image::open(out.join(format!("frames/{index:06}.jpg"))).map(|i| i.into_rgb8()).ok();
    let depth = out.join(format!("depth/{index:06}.png"));
    let depth = depth.is_file().then(|| depth_mm(&depth));
    let truth = image::open(still("frames", FRAMES.start + index)).unwrap().into_rgb8();
    let true_depth = recording.depth(FRAMES.start + index).unwrap().unwrap();
    let (width, height) = (camera["width"].as_u64().unwrap() as usize, camera["height"].as_u64().unwrap() as usize);
    let (mut colors, mut depths) = (Vec::new(), Vec::new());
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let Some((u, v)) = same_ray(&camera, recording, x, y) else { continue };
        if let Some(image) = &image {
            let (a, b) = (image.get_pixel(x as u32, y as u32).0, truth.get_pixel(u.round() as u32, v.round() as u32).0);
            colors.push(a.iter().zip(b).all(|(a, b)| a.abs_diff(b) < 30));
        }
        let z = true_depth.nearest(u, v).unwrap();
        if let (Some(depth), true) = (&depth, z > 0.0) {
            depths.push((f32::from(depth[y * width + x]) / 1000.0 / z - 1.0).abs() < 0.03);
        }
    }
    let share = |list: &[bool]| list.iter().filter(|x| **x).count() as f64 / list.len().max(1) as f64;
    (share(&colors), share(&depths))
}

/// Points of the recording's surfaces.
fn surface(recording: &Recording) -> Vec<Point> {
    let c = recording.camera;
    let mut out = Vec::new();
    for i in FRAMES.step_by(4) {
        let depth = recording.depth(i).unwrap().unwrap();
        for (k, z) in depth.data.iter().enumerate().step_by(37).filter(|(_, z)| **z > 0.0) {
            let p = c.unproject((k % c.width) as f64, (k / c.width) as f64, f64::from(*z));
            out.push(recording.frames[i].world_from_camera * p);
        }
    }
    out
}

fn packed(text: &str) -> Vec<u8> {
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packer.write_all(text.as_bytes()).unwrap();
    packer.finish().unwrap()
}

/// A turn about the optical axis, quarters clockwise of the image.
fn quarter() -> Pose {
    Pose::from_parts(
        Vector::zeros().into(),
        UnitQuaternion::from_scaled_axis(Vector::z() * -std::f64::consts::FRAC_PI_2),
    )
}

/// The glasses' colour camera: a fisheye that lies on its side.
fn fisheye() -> Optics {
    let lens = LensModel::FisheyeRadTanThinPrism {
        k: [0.02, -0.01, 0.0, 0.0, 0.0, 0.0],
        p: [0.0003, -0.0002],
        s: [0.001, -0.0001, -0.0004, 0.0001],
    };
    Optics { lens, ..Optics::pinhole(200, 200, [90.0, 90.0, 101.0, 98.0]) }
}

/// Its place on the glasses.
fn device_from_camera() -> Pose {
    Pose::from_parts(Vector::new(0.02, -0.01, 0.05).into(), UnitQuaternion::from_euler_angles(0.2, -0.6, 1.3))
}

/// The glasses in the world when the fisheye, once stood upright, is where the recording's camera is.
fn device(world_from_camera: &Pose) -> Pose {
    world_from_camera * quarter().inverse() * device_from_camera().inverse()
}

/// Microseconds of the glasses' clock.
fn micros(secs: f64) -> u64 {
    (1e6 * (1200.0 + secs)).round() as u64
}

const CLOSED: &str = "graph_uid,tracking_timestamp_us,utc_timestamp_ns,tx_world_device,ty_world_device,tz_world_device,\
                      qx_world_device,qy_world_device,qz_world_device,qw_world_device,gravity_x_world,gravity_y_world,\
                      gravity_z_world,quality_score,geo_available";

fn closed_row(graph: &str, us: u64, pose: &Pose) -> String {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    format!("{graph},{us},0,{},{},{},{},{},{},{},0.0,0.0,-9.81,1.0,0\n", t.x, t.y, t.z, q.x, q.y, q.z, q.w)
}

/// Trajectory, points and hands of the glasses.
fn write_mps(root: &Path, with_normals: bool) {
    let recording = small();
    let mut walk = format!("{CLOSED}\n");
    for frame in &recording.frames {
        walk += &closed_row("g", micros(frame.timestamp_secs), &device(&frame.world_from_camera));
    }
    walk += &closed_row("lost", micros(500.0), &Pose::identity());
    write(&root.join("slam/closed_loop_trajectory.csv"), walk);
    let mut points = "uid,graph_uid,px_world,py_world,pz_world,inv_dist_std,dist_std\n".to_owned();
    for (i, p) in surface(&recording).iter().enumerate() {
        writeln!(points, "{i},g,{},{},{},0.001,0.002", p.x, p.y, p.z).unwrap();
        writeln!(points, "{i},g,{},{},{},0.1,0.002", p.x + 9.0, p.y, p.z).unwrap();
    }
    write(&root.join("slam/semidense_points.csv.gz"), packed(&points));
    write(&root.join("hand_tracking/hand_tracking_results.csv"), hand_table(&recording, with_normals));
}

/// Joints of MANO at Aria's numbers; 20, the palm, is nobody's.
const ARIA: [Option<usize>; 21] = {
    let mut out = [None; 21];
    let of_mano =
        [(0, 5), (2, 6), (3, 7), (4, 0), (5, 8), (6, 9), (7, 10), (8, 1), (9, 11), (10, 12), (11, 13), (12, 2)];
    let mut i = 0;
    while i < of_mano.len() {
        out[of_mano[i].1] = Some(of_mano[i].0);
        i += 1;
    }
    out
};

fn hand_table(recording: &Recording, with_normals: bool) -> String {
    let mut text = "tracking_timestamp_us".to_owned();
    for side in ["left", "right"] {
        write!(text, ",{side}_tracking_confidence").unwrap();
        for i in 0..21 {
            write!(text, ",tx_{side}_landmark_{i}_device,ty_{side}_landmark_{i}_device,tz_{side}_landmark_{i}_device")
                .unwrap();
        }
        if with_normals {
            write!(text, ",nx_{side}_palm_device,ny_{side}_palm_device,nz_{side}_palm_device").unwrap();
        }
    }
    text.push('\n');
    let hands = hands();
    for (i, frame) in recording.frames[FRAMES].iter().enumerate() {
        write!(text, "{}", micros(frame.timestamp_secs)).unwrap();
        let device_from_world = device(&frame.world_from_camera).inverse();
        for side in ["left", "right"] {
            let joints = hands.get(&(i, side.to_owned()));
            text += if joints.is_some() { ",0.9" } else { ",-1" };
            for mano in ARIA {
                let p = joints.map(|j| device_from_world * Point::from(j[mano.unwrap_or(0)])).unwrap_or_default();
                write!(text, ",{},{},{}", p.x, p.y, p.z).unwrap();
            }
            text += if with_normals { ",0,0,1" } else { "" };
        }
        text.push('\n');
    }
    text
}

/// The recording's images as the fisheye sees them.
fn write_fisheye(root: &Path) {
    let recording = small();
    let o = fisheye();
    let pixel = |k: usize| {
        let ray = o.direction((k % o.width) as f64, (k / o.width) as f64)?;
        let (u, v) = recording.camera.project(&Point::new(-ray.y, ray.x, ray.z))?;
        recording.camera.contains(u, v).then(|| (u.round() as u32, v.round() as u32))
    };
    let map: Vec<Option<(u32, u32)>> = (0..o.width * o.height).map(pixel).collect();
    std::fs::create_dir_all(root.join("rgb")).unwrap();
    for i in FRAMES {
        let seen = image::open(still("frames", i)).unwrap().into_rgb8();
        let image = image::RgbImage::from_fn(o.width as u32, o.height as u32, |x, y| {
            map[y as usize * o.width + x as usize].map_or(image::Rgb([0; 3]), |(u, v)| *seen.get_pixel(u, v))
        });
        let ns = 1000 * micros(recording.frames[i].timestamp_secs);
        image.save(root.join(format!("rgb/{ns}.png"))).unwrap();
    }
}

fn params(o: &Optics) -> Vec<f64> {
    let LensModel::FisheyeRadTanThinPrism { k, p, s } = o.lens else { panic!("{:?}", o.lens) };
    [[o.fx, o.cx, o.cy].as_slice(), k.as_slice(), p.as_slice(), s.as_slice()].concat()
}

fn calibration_line() -> String {
    let (o, pose) = (fisheye(), device_from_camera());
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    json!({"tracking_timestamp_us": 1_200_000_000, "utc_timestamp_ns": 0, "ImageSizes": [[640, 480], [o.width, o.height]],
        "CameraCalibrations": [{"Label": "camera-slam-left"}, {"Label": "camera-rgb", "SerialNumber": "1",
            "Projection": {"Name": "FisheyeRadTanThinPrism", "Params": params(&o)},
            "T_Device_Camera": {"Translation": [t.x, t.y, t.z], "UnitQuaternion": [q.w, [q.x, q.y, q.z]]}}]})
    .to_string()
}

#[test]
fn aria_glasses_with_their_services_come_back_upright_and_without_distortion() {
    let recording = small();
    for with_normals in [false, true] {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("walk");
        // In one result folder beside the images, as its command-line tool writes it.
        write_mps(&root.join("mps_walk_vrs"), with_normals);
        write(&root.join("mps_walk_vrs/slam/online_calibration.jsonl"), calibration_line());
        write_fisheye(&root);
        let text = import(&["walk", "--fps", "0", "--rotate", "90", "--fov", "60"], dir.path());
        let out = dir.path().join("out");
        poses_are_back(&out, &recording, 1e-5);
        hands_are_back(&out, 1e-5);
        let (colors, _) = pixels_are_back(&out, &recording, 6);
        assert!(colors > 0.85, "{colors}");
        assert!(text.contains("aria walk"), "{text}");
        let report = json(&out.join("import.json"));
        assert!(report["sources"][0]["notes"].to_string().contains("1 poses are in another frame"), "{report}");
        // Unsure points are left out.
        let ply = std::fs::read_to_string(out.join("reconstruction.ply")).unwrap();
        assert!(ply.contains(&format!("element vertex {}\n", surface(&recording).len())), "{}", &ply[..60]);
    }
}

/// `vrs_to_mp4` turns pictures upright: their camera is turned with them, no option is needed.
#[test]
fn a_video_of_the_glasses_stands_upright_by_itself() {
    let dir = tempfile::tempdir().unwrap();
    let root = dir.path().join("walk");
    write_mps(&root, true);
    write(&root.join("slam/online_calibration.jsonl"), calibration_line());
    let recording = small();
    let mut table = "mp4_time_ns,relative_vrs_device_time_ns,vrs_device_time_ns\n".to_owned();
    for frame in &recording.frames[FRAMES] {
        writeln!(table, "0.0,0,{}", 1000 * micros(frame.timestamp_secs)).unwrap();
    }
    write(&root.join("walk_mp4_to_vrs_time_ns.csv"), table);
    write(&root.join("walk.mp4"), "nobody reads it");
    let text = import(&["walk", "--fps", "0", "--ffmpeg", "/nowhere/ffmpeg"], dir.path());
    let out = dir.path().join("out");
    poses_are_back(&out, &recording, 1e-5);
    hands_are_back(&out, 1e-5);
    assert!(text.contains("install ffmpeg"), "{text}");
}

/// Depth and rectified images of the pilot data; `along_ray`: what its depth measures.
fn write_pilot(root: &Path, along_ray: bool) {
    let recording = small();
    let c = recording.camera;
    write_mps(&root.join("mps"), true);
    let mut list = Vec::new();
    for (k, i) in FRAMES.enumerate() {
        let frame = &recording.frames[i];
        let (t, q) = (frame.world_from_camera.translation.vector, frame.world_from_camera.rotation.coords);
        list.push(json!({"index": k, "frameTimestampNs": 1000 * micros(frame.timestamp_secs),
            "T_world_camera": {"QuaternionXYZW": [q.x, q.y, q.z, q.w], "Translation": [t.x, t.y, t.z]},
            "camera": {"ModelName": "Linear:fu,fv,u0,v0", "Parameters": [c.fx, c.fy, c.cx, c.cy]}}));
        let mut counts = depth_mm(&still("depth", i));
        if along_ray {
            for (k, mm) in counts.iter_mut().enumerate() {
                let ray = c.unproject((k % c.width) as f64, (k / c.width) as f64, 1.0);
                *mm = (f64::from(*mm) * ray.coords.norm()).round() as u16;
            }
        }
        let depth: image::ImageBuffer<image::Luma<u16>, Vec<u16>> =
            image::ImageBuffer::from_raw(c.width as u32, c.height as u32, counts).unwrap();
        for folder in ["depth/depth", "depth/rectified_images"] {
            std::fs::create_dir_all(root.join(folder)).unwrap();
        }
        depth.save(root.join(format!("depth/depth/depth_{k:08}.png"))).unwrap();
        let grey = image::open(still("frames", i)).unwrap().into_luma8();
        grey.save(root.join(format!("depth/rectified_images/image_{k:08}.png"))).unwrap();
    }
    write(&root.join("depth/pinhole_camera_parameters.json"), Value::from(list).to_string());
}

#[test]
fn the_pilots_depth_is_told_from_its_geometry_and_stands_for_missing_images() {
    let recording = small();
    for along_ray in [false, true] {
        let dir = tempfile::tempdir().unwrap();
        write_pilot(&dir.path().join("walk"), along_ray);
        import(&["walk", "--fps", "0"], dir.path());
        let out = dir.path().join("out");
        poses_are_back(&out, &recording, 1e-5);
        hands_are_back(&out, 1e-5);
        let (back, truth) = (depth_mm(&out.join("depth/000004.png")), depth_mm(&still("depth", FRAMES.start + 4)));
        let off = back.iter().zip(&truth).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(off <= 1, "along the ray {along_ray}: {off} mm");
        assert!(out.join("frames/000004.jpg").is_file());
        let notes = json(&out.join("import.json"))["sources"][0]["notes"].to_string();
        let what = if along_ray { "depth is along the ray" } else { "depth is along the optical axis" };
        assert!(notes.contains(what), "{notes}");
    }
}

/// A storage folder of HD-EPIC's tools with one video: its first picture has no pose.
fn write_hdepic(root: &Path, narrations_as: &str) {
    let recording = small();
    let mut walk = format!("{CLOSED}\n");
    let mut times = "mp4_time_ns,relative_vrs_device_time_ns,vrs_device_time_ns\n".to_owned();
    walk += "UNDEFINED_ROW,0,0,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,nan,0\n";
    writeln!(times, "0.0,0,{}", 1000 * (micros(0.0) - 100_000)).unwrap();
    for (i, frame) in recording.frames.iter().enumerate() {
        let us = micros(frame.timestamp_secs);
        walk += &closed_row("g", us, &device(&frame.world_from_camera));
        writeln!(times, "{:.1},0,{}", (i + 1) as f64 * 1e9 / 30.0, 1000 * us).unwrap();
    }
    let (video, data) = ("P01-20240202-161948", root.join("intermediate_data"));
    write(&data.join(format!("mp4_trajectory/{video}.csv")), walk);
    write(&root.join(format!("Videos/P01/{video}_mp4_to_vrs_time_ns.csv")), times);
    let (o, m) = (fisheye(), device_from_camera().to_homogeneous());
    let rows: Vec<Vec<f64>> = (0..3).map(|r| (0..4).map(|c| m[(r, c)]).collect()).collect();
    let calibration = json!({"label": "camera-rgb", "model_name.name": "FISHEYE624", "projection_params": params(&o),
        "T_Device_Camera.mat3x4": rows, "image_width": o.width, "image_height": o.height, "serial_number": "1"});
    write(&data.join(format!("rgb_camera_calibration/{video}.json")), calibration.to_string());
    let mut text = String::new();
    if narrations_as == "csv" {
        text += "unique_narration_id,video_id,narration,start_timestamp,end_timestamp,verbs,nouns\n";
    }
    for clip in &recording.clips {
        let secs = [clip.start_frame as f64 + 0.9, clip.end_frame as f64 + 1.1].map(|f| f / 30.0);
        for video in [video, "P02-20240101-000000"] {
            if narrations_as == "csv" {
                let (name, words) = (&clip.clip, &clip.narration);
                let [verb, noun] = [&clip.verb, &clip.noun];
                writeln!(text, "{name},{video},\"{words}\",{},{},\"['{verb}', 'x']\",\"['{noun}']\"", secs[0], secs[1])
                    .unwrap();
            } else {
                let line = json!({"unique_narration_id": clip.clip, "video_id": video, "narration": clip.narration,
                    "start_timestamp": secs[0], "end_timestamp": secs[1], "verbs": [clip.verb, "x"], "nouns": [clip.noun]});
                writeln!(text, "{line}").unwrap();
            }
        }
    }
    write(&root.join(format!("HD_EPIC_Narrations.{narrations_as}")), text);
    let maps = root.join("SLAM-and-Gaze/P01/SLAM/multi");
    write(&maps.join("vrs_to_multi_slam.json"), json!({format!("P01/{video}.vrs"): "0"}).to_string());
    let points = "uid,graph_uid,px_world,py_world,pz_world,inv_dist_std,dist_std\n0,g,1,2,3,0.001,0.002\n";
    write(&maps.join("0/slam/semidense_points.csv.gz"), packed(points));
}

#[test]
fn hd_epic_comes_back_with_its_narrations() {
    let recording = small();
    for narrations_as in ["csv", "jsonl"] {
        let dir = tempfile::tempdir().unwrap();
        write_hdepic(&dir.path().join("storage"), narrations_as);
        let text = import(&["storage", "--fps", "0", "--width", "200"], dir.path());
        let out = dir.path().join("out");
        let truth: Vec<Pose> = recording.frames.iter().map(|f| f.world_from_camera).collect();
        let (m, deg) = apart(&truth, &poses(&out));
        assert!(m < 1e-5 && deg < 1e-3, "{m} m, {deg} degrees");
        let clips = json(&out.join("clips.json"));
        let clips: Vec<paws_twin::recording::Clip> = serde_json::from_value(clips["clips"].clone()).unwrap();
        assert_eq!(clips, recording.clips);
        assert!(text.contains("missing: images") && text.contains("missing: hands"), "{text}");
        assert!(std::fs::read_to_string(out.join("reconstruction.ply")).unwrap().contains("element vertex 1\n"));
    }
}

/// Takes bytes from the end of a file.
pub fn cut(path: &Path, bytes: usize) {
    let all = std::fs::read(path).unwrap();
    std::fs::write(path, &all[..all.len() - bytes]).unwrap();
}

#[test]
fn broken_recordings_of_glasses_are_named() {
    let aria = |change: fn(&Path)| {
        move |dir: &Path| {
            write_mps(&dir.join("source"), false);
            write(&dir.join("source/slam/online_calibration.jsonl"), calibration_line());
            change(&dir.join("source"));
        }
    };
    let walk = "slam/closed_loop_trajectory.csv";
    refused(
        "a column",
        &["closed_loop_trajectory.csv: line 1", "no column \"qw_world_device\""],
        aria(|s| {
            edit(&s.join("slam/closed_loop_trajectory.csv"), "qw_world_device", "qw");
        }),
    );
    costs_itself(
        "no number",
        &[walk, "line 2: column tracking_timestamp_us", "not a number"],
        aria(|s| {
            edit(&s.join("slam/closed_loop_trajectory.csv"), "\ng,1", "\ng,one");
        }),
    );
    refused(
        "no rows",
        &[walk, "no pose"],
        aria(|s| write(&s.join("slam/closed_loop_trajectory.csv"), format!("{CLOSED}\n"))),
    );
    refused("half an archive", &["semidense_points.csv.gz", "copied as a whole"], |d| {
        aria(|_| {})(d);
        cut(&d.join("source/slam/semidense_points.csv.gz"), 20);
    });
    refused(
        "no calibration",
        &["online_calibration.jsonl", "aria_vrs.py"],
        aria(|s| {
            std::fs::remove_file(s.join("slam/online_calibration.jsonl")).unwrap();
        }),
    );
    refused("half a line", &["online_calibration.jsonl: line 1", "no JSON"], |d| {
        aria(|_| {})(d);
        cut(&d.join("source/slam/online_calibration.jsonl"), 9);
    });
    refused(
        "numbers as words",
        &["online_calibration.jsonl: line 1", "camera-rgb", "expected a number, found \"90.0\""],
        aria(|s| {
            edit(&s.join("slam/online_calibration.jsonl"), "[90.0,", "[\"90.0\",");
        }),
    );
    refused(
        "another lens",
        &["online_calibration.jsonl: line 1", "\"Spherical\"", "none that is read"],
        aria(|s| {
            edit(&s.join("slam/online_calibration.jsonl"), "FisheyeRadTanThinPrism", "Spherical");
        }),
    );
    refused(
        "a hand's column",
        &["hand_tracking_results.csv: line 1", "tz_right_landmark_20_device"],
        aria(|s| {
            edit(&s.join("hand_tracking/hand_tracking_results.csv"), "tz_right_landmark_20_device", "z");
        }),
    );
    refused("videos", &["holds 2 videos", "hdepic="], |d| {
        write_hdepic(&d.join("source"), "csv");
        let data = d.join("source/intermediate_data");
        copy(&data.join("mp4_trajectory/P01-20240202-161948.csv"), &data.join("mp4_trajectory/P01-2.csv"));
        copy(
            &data.join("rgb_camera_calibration/P01-20240202-161948.json"),
            &data.join("rgb_camera_calibration/P01-2.json"),
        );
    });
    refused("seconds in quotes", &["HD_EPIC_Narrations.jsonl: line 1", "start_timestamp"], |d| {
        write_hdepic(&d.join("source"), "jsonl");
        edit(&d.join("source/HD_EPIC_Narrations.jsonl"), "\"start_timestamp\":", "\"start_timestamp\":\"1\",\"x\":");
    });
}
