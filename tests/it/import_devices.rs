//! The synthetic kitchen as glasses and headsets write it, and imported again.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use nalgebra::{Matrix3, Matrix4, Rotation3, UnitQuaternion};
use paws_twin::import::optics::{Lens, Optics};
use paws_twin::math::{Point, Pose, Vector};
use paws_twin::recording::{Grid, Recording};
use serde_json::{Value, json};

use crate::common::SMALL;
use crate::import::{apart, copy, depth_mm, edit, import, json, poses, refused, small, still, write};

/// Frames that a test writes: hands come into view among them.
const FRAMES: std::ops::Range<usize> = 14..38;

/// Joints of the recording's hands in MANO's order, by frame (counted from the first written one) and side.
fn hands() -> BTreeMap<(usize, String), Vec<Vector>> {
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
fn hands_are_back(out: &Path, tolerance_m: f64) {
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
fn poses_are_back(out: &Path, recording: &Recording, tolerance_m: f64) {
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
fn pixels_are_back(out: &Path, recording: &Recording, index: usize) -> (f64, f64) {
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
    let lens = Lens::FisheyeRadTanThinPrism {
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
    let Lens::FisheyeRadTanThinPrism { k, p, s } = o.lens else { panic!("{:?}", o.lens) };
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
    write(&root.join("Depth Long Throw_extrinsics.txt"), row_by_row(&camera_from_rig.to_homogeneous())[1..].to_owned());
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
fn broken_recordings_of_devices_are_named() {
    let cut = |path: &Path, bytes: usize| {
        let all = std::fs::read(path).unwrap();
        std::fs::write(path, &all[..all.len() - bytes]).unwrap();
    };
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
    refused(
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
    let holo = |change: fn(&Path)| {
        move |dir: &Path| {
            write_hololens(&dir.join("source"));
            change(&dir.join("source"));
        }
    };
    refused(
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
    refused(
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
    refused("a head", &["tracking.jsonl: line 1", "headMatrix"], |d| {
        write_visionpro(&d.join("source"));
        edit(&d.join("source/tracking.jsonl"), "\"headMatrix\":[", "\"headMatrix\":[\"x\",");
    });
    refused("a calibration", &["metadata.json: intrinsicCalibration", "no JSON"], |d| {
        write_visionpro(&d.join("source"));
        edit(&d.join("source/metadata.json"), "\"intrinsicCalibration\":\"{", "\"intrinsicCalibration\":\"");
    });
}
