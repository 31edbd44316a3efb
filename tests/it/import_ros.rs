//! A synthetic kitchen as ROS 2 records it, and imported again: MCAP files written to the letter.

use std::io::Write as _;
use std::path::Path;

use paws_twin::math::{Pose, Vector};

use crate::common::{paws, stderr};
use crate::import::{apart, depth_mm, import, json, poses, small, still, write};
use crate::import_devices::{depth_f32, frames, is_back, refused, secs, stera_pose};

/// How chunks are packed.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Chunks {
    None,
    Stored,
    Lz4,
    Zstd,
}

/// A file that is written.
struct Bag {
    file: Vec<u8>,
    chunk: Vec<u8>,
    chunks: Chunks,
    encoding: &'static str,
}

fn record(out: &mut Vec<u8>, opcode: u8, body: &[u8]) {
    out.push(opcode);
    out.extend((body.len() as u64).to_le_bytes());
    out.extend(body);
}

fn text(out: &mut Vec<u8>, text: &str) {
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(text.as_bytes());
}

impl Bag {
    fn new(chunks: Chunks) -> Self {
        let mut file = b"\x89MCAP0\r\n".to_vec();
        let mut header = Vec::new();
        text(&mut header, "ros2");
        text(&mut header, "test");
        record(&mut file, 1, &header);
        Self { file, chunk: Vec::new(), chunks, encoding: "cdr" }
    }

    fn push(&mut self, opcode: u8, body: &[u8]) {
        if self.chunks == Chunks::None {
            return record(&mut self.file, opcode, body);
        }
        record(&mut self.chunk, opcode, body);
        if self.chunk.len() > 50_000 {
            self.flush();
        }
    }

    fn flush(&mut self) {
        let plain = std::mem::take(&mut self.chunk);
        if plain.is_empty() {
            return;
        }
        let (name, packed) = match self.chunks {
            Chunks::None | Chunks::Stored => ("", plain.clone()),
            Chunks::Lz4 => {
                let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
                encoder.write_all(&plain).unwrap();
                ("lz4", encoder.finish().unwrap())
            }
            Chunks::Zstd => {
                let level = ruzstd::encoding::CompressionLevel::Fastest;
                ("zstd", ruzstd::encoding::compress_to_vec(plain.as_slice(), level))
            }
        };
        let mut body = vec![0; 16];
        body.extend((plain.len() as u64).to_le_bytes());
        body.extend([0; 4]);
        text(&mut body, name);
        body.extend((packed.len() as u64).to_le_bytes());
        body.extend(packed);
        record(&mut self.file, 6, &body);
    }

    fn channel(&mut self, id: u16, topic: &str, schema: &str) {
        let mut body = (id + 1).to_le_bytes().to_vec();
        for part in [schema, "ros2msg", "# left out"] {
            text(&mut body, part);
        }
        self.push(3, &body);
        let mut body = id.to_le_bytes().to_vec();
        body.extend((id + 1).to_le_bytes());
        text(&mut body, topic);
        text(&mut body, self.encoding);
        body.extend([0; 4]);
        self.push(4, &body);
    }

    fn message(&mut self, id: u16, time_secs: f64, message: Cdr) {
        let mut body = id.to_le_bytes().to_vec();
        body.extend([0; 4]);
        for _ in 0..2 {
            body.extend(((time_secs * 1e9) as u64).to_le_bytes());
        }
        body.extend(message.bytes);
        self.push(5, &body);
    }

    fn finish(mut self) -> Vec<u8> {
        self.flush();
        record(&mut self.file, 0x0F, &[0; 4]);
        record(&mut self.file, 2, &[0; 20]);
        self.file.extend(b"\x89MCAP0\r\n");
        self.file
    }
}

/// A message that is written, field by field.
struct Cdr {
    bytes: Vec<u8>,
    is_big: bool,
}

impl Cdr {
    fn new(is_big: bool) -> Self {
        Self { bytes: vec![0, u8::from(!is_big), 0, 0], is_big }
    }

    fn number<const N: usize>(mut self, mut little: [u8; N]) -> Self {
        while !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0);
        }
        if self.is_big {
            little.reverse();
        }
        self.bytes.extend(little);
        self
    }

    fn u8(self, value: u8) -> Self {
        self.number([value])
    }

    fn u32(self, value: u32) -> Self {
        self.number(value.to_le_bytes())
    }

    fn f64s(self, values: &[f64]) -> Self {
        values.iter().fold(self, |cdr, v| cdr.number(v.to_le_bytes()))
    }

    fn data(mut self, bytes: &[u8]) -> Self {
        self = self.u32(bytes.len() as u32);
        self.bytes.extend(bytes);
        self
    }

    fn text(self, text: &str) -> Self {
        let mut bytes = text.as_bytes().to_vec();
        bytes.push(0);
        self.data(&bytes)
    }

    fn header(self, time_secs: f64, frame: &str) -> Self {
        let secs = time_secs.floor();
        let nanos = ((time_secs - secs) * 1e9).round() as u32;
        self.number((secs as i32).to_le_bytes()).u32(nanos).text(frame)
    }

    fn pose(self, pose: &Pose) -> Self {
        let (t, q) = (pose.translation.vector, pose.rotation.coords);
        self.f64s(&[t.x, t.y, t.z, q.x, q.y, q.z, q.w])
    }

    fn image(self, size: [usize; 2], encoding: &str, pixel_bytes: usize, data: &[u8]) -> Self {
        let [width, height] = size;
        let head = self.u32(height as u32).u32(width as u32).text(encoding);
        let order = u8::from(head.is_big);
        head.u8(order).u32((width * pixel_bytes) as u32).data(data)
    }
}

/// A camera of the recording's intrinsics; `frame` is its images'.
fn camera(time_secs: f64, frame: &str, is_big: bool) -> Cdr {
    let c = small().camera;
    let head = Cdr::new(is_big).header(time_secs, frame).u32(c.height as u32).u32(c.width as u32);
    let lens = head.text("plumb_bob").u32(5).f64s(&[0.0; 5]);
    lens.f64s(&[c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0])
        .f64s(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
        .f64s(&[c.fx, 0.0, c.cx, 0.0, 0.0, c.fy, c.cy, 0.0, 0.0, 0.0, 1.0, 0.0])
        .u32(0)
        .u32(0)
}

/// The Stera app's recording.
fn stera(chunks: Chunks, is_big: bool) -> (Vec<u8>, Vec<Pose>) {
    let recording = small();
    let c = recording.camera;
    let mut bag = Bag::new(chunks);
    bag.channel(1, "/camera/rgb/compressed", "sensor_msgs/msg/CompressedImage");
    bag.channel(2, "/camera/depth", "sensor_msgs/msg/Image");
    bag.channel(3, "/camera/pose", "geometry_msgs/msg/PoseStamped");
    bag.channel(4, "/camera/camera_info", "sensor_msgs/msg/CameraInfo");
    bag.channel(5, "/device/imu", "sensor_msgs/msg/Imu");
    let mut truth = Vec::new();
    for (n, frame) in frames(&recording).into_iter().enumerate() {
        let (t, optical) = (secs(n), "camera_optical_frame");
        let cdr = || Cdr::new(is_big);
        let jpg = std::fs::read(still("frames", frame)).unwrap();
        bag.message(1, t, cdr().header(t, optical).text("jpeg").data(&jpg));
        let counts: Vec<u8> = depth_mm(&still("depth", frame))
            .iter()
            .flat_map(|mm| if is_big { mm.to_be_bytes() } else { mm.to_le_bytes() })
            .collect();
        bag.message(2, t, cdr().header(t, optical).image([c.width, c.height], "16UC1", 2, &counts));
        bag.message(3, t, cdr().header(t, "world").pose(&stera_pose(&recording, frame)));
        bag.message(4, t, camera(t, optical, is_big));
        bag.message(5, t, cdr().header(t, "imu").f64s(&[0.0; 37]));
        truth.push(recording.frames[frame].world_from_camera);
    }
    (bag.finish(), truth)
}

#[test]
fn stera_recordings_come_back_however_they_are_packed() {
    let recording = small();
    for (chunks, is_big) in [
        (Chunks::None, false),
        (Chunks::Stored, false),
        (Chunks::Lz4, false),
        (Chunks::Zstd, false),
        (Chunks::None, true),
    ] {
        let dir = tempfile::tempdir().unwrap();
        let (bytes, truth) = stera(chunks, is_big);
        write(&dir.path().join("take.mcap"), bytes);
        import(&["take.mcap", "--fps", "0"], dir.path());
        is_back(&dir.path().join("out"), &truth, &frames(&recording), 1e-7);
        let source = &json(&dir.path().join("out/import.json"))["sources"][0];
        assert_eq!(source["kind"], "stera", "{chunks:?} {source}");
    }
}

/// Depth of a robot's recording.
#[derive(Clone, Copy, PartialEq)]
enum Layout {
    /// Metres, of the colour camera.
    Aligned,
    /// A camera of its own, 5 cm beside.
    Beside,
}

fn base_from_optical() -> [Pose; 2] {
    let link = Pose::from_parts(Vector::new(0.1, 0.02, 1.2).into(), paws_twin::math::rotation(&Vector::y(), 0.2));
    let optical = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(0.5, -0.5, 0.5, -0.5));
    [link, Pose::from_parts(Vector::zeros().into(), optical)]
}

fn map_from_odom() -> Pose {
    Pose::from_parts(Vector::new(3.0, -1.0, 0.0).into(), paws_twin::math::rotation(&Vector::z(), 0.7))
}

/// A robot's recording: odometry of its base, the camera's place by tf, raw images, an infrared camera that nobody wants.
fn robot(layout: Layout) -> (Vec<u8>, Vec<Pose>) {
    let recording = small();
    let c = recording.camera;
    let size = [c.width, c.height];
    let mut bag = Bag::new(Chunks::Lz4);
    bag.channel(1, "/camera/color/image_raw", "sensor_msgs/msg/Image");
    bag.channel(2, "/camera/color/camera_info", "sensor_msgs/msg/CameraInfo");
    bag.channel(3, "/camera/depth/image_raw", "sensor_msgs/msg/Image");
    bag.channel(4, "/camera/depth/camera_info", "sensor_msgs/msg/CameraInfo");
    bag.channel(5, "/odom", "nav_msgs/msg/Odometry");
    bag.channel(6, "/tf_static", "tf2_msgs/msg/TFMessage");
    bag.channel(7, "/tf", "tf2_msgs/msg/TFMessage");
    bag.channel(8, "/camera/infra/image_raw", "sensor_msgs/msg/Image");
    let cdr = || Cdr::new(false);
    let [link, optical] = base_from_optical();
    let depth_frame = if layout == Layout::Aligned { "color_optical" } else { "depth_optical" };
    let beside = Pose::translation(0.05, 0.0, 0.0);
    // One message holds all of them; numbers of the second one are aligned anew.
    let fixed = cdr().u32(3).header(0.0, "base").text("camera_link").pose(&link);
    let fixed = fixed.header(0.0, "camera_link").text("color_optical").pose(&optical);
    bag.message(6, secs(0), fixed.header(0.0, "color_optical").text("depth_optical").pose(&beside));
    let mut truth = Vec::new();
    for (n, frame) in frames(&recording).into_iter().enumerate() {
        let t = secs(n);
        let camera_pose = recording.frames[frame].world_from_camera;
        let base = camera_pose * (link * optical).inverse();
        let image = image::open(still("frames", frame)).unwrap().into_rgb8();
        let bgr: Vec<u8> = image.pixels().flat_map(|p| [p.0[2], p.0[1], p.0[0]]).collect();
        bag.message(1, t, cdr().header(t, "color_optical").image(size, "bgr8", 3, &bgr));
        bag.message(2, t, camera(t, "color_optical", false));
        bag.message(3, t, cdr().header(t, depth_frame).image(size, "32FC1", 4, &depth_f32(frame)));
        bag.message(4, t, camera(t, depth_frame, false));
        let odometry = cdr().header(t, "odom").text("base").pose(&base).f64s(&[0.0; 36]);
        bag.message(5, t, odometry.f64s(&[0.0; 42]));
        bag.message(7, t, cdr().u32(1).header(t, "odom").text("base").pose(&base));
        bag.message(7, t, cdr().u32(1).header(t, "map").text("odom").pose(&map_from_odom()));
        for _ in 0..2 {
            bag.message(8, t, cdr().header(t, "infra").image(size, "mono8", 1, &vec![0; c.width * c.height]));
        }
        truth.push(camera_pose);
    }
    (bag.finish(), truth)
}

#[test]
fn a_robots_recording_comes_back_through_odometry_and_through_tf() {
    let recording = small();
    let frames = frames(&recording);
    let dir = tempfile::tempdir().unwrap();
    let (bytes, truth) = robot(Layout::Aligned);
    write(&dir.path().join("bag/metadata.yaml"), "rosbag2_bagfile_information:\n");
    write(&dir.path().join("bag/bag_0.mcap"), bytes);
    import(&["bag", "--fps", "0"], dir.path());
    let out = dir.path().join("out");
    let (m, deg) = apart(&truth, &poses(&out));
    assert!(m < 1e-6 && deg < 1e-4, "{m} m, {deg} degrees");
    assert_eq!(depth_mm(&out.join("depth/000003.png")), depth_mm(&still("depth", frames[3])));
    // Raw pixels become a JPEG of ours.
    let [a, b] =
        [out.join("frames/000003.jpg"), still("frames", frames[3])].map(|f| image::open(f).unwrap().into_rgb8());
    let off: f64 = a.iter().zip(b.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.len() as f64;
    assert!(a.dimensions() == b.dimensions() && off < 3.0, "{off}");
    let notes = json(&out.join("import.json"))["sources"][0]["notes"].to_string();
    for word in ["colour is /camera/color/image_raw", "depth is /camera/depth/image_raw", "poses are /odom"] {
        assert!(notes.contains(word), "{word}: {notes}");
    }

    import(&["bag", "--fps", "0", "--topic", "poses=tf"], dir.path());
    let moved: Vec<Pose> = truth.iter().map(|p| map_from_odom() * p).collect();
    let (m, deg) = apart(&moved, &poses(&out));
    assert!(m < 1e-6 && deg < 1e-4, "{m} m, {deg} degrees");
}

#[test]
fn depth_of_a_camera_beside_is_brought_to_colour() {
    let dir = tempfile::tempdir().unwrap();
    write(&dir.path().join("bag.mcap"), robot(Layout::Beside).0);
    import(&["bag.mcap", "--fps", "0"], dir.path());
    let recording = small();
    let frames = frames(&recording);
    let (back, there) = (depth_mm(&dir.path().join("out/depth/000003.png")), depth_mm(&still("depth", frames[3])));
    // Seen from 5 cm to the left, what is a metre away is 5 % of the focal length further right.
    let (w, c) = (recording.camera.width, recording.camera);
    let mut right = 0;
    let mut count = 0;
    for (i, z) in there.iter().enumerate().filter(|(_, z)| **z > 0) {
        let x = (i % w) as f64 + c.fx * 0.05 / (1e-3 * f64::from(*z));
        let place = i / w * w + x.round() as usize;
        if x.round() < w as f64 - 1.0 {
            count += 1;
            right += usize::from(back[place].abs_diff(*z) < 20 + *z / 20);
        }
    }
    assert!(back != there && right * 10 > count * 7, "{right} of {count}");
}

#[test]
fn a_file_that_ends_early_is_read_as_far_as_it_goes() {
    let dir = tempfile::tempdir().unwrap();
    for chunks in [Chunks::None, Chunks::Zstd] {
        let (bytes, truth) = stera(chunks, false);
        write(&dir.path().join("take.mcap"), &bytes[..bytes.len() * 2 / 3]);
        import(&["take.mcap", "--fps", "0"], dir.path());
        let out = dir.path().join("out");
        let found = poses(&out).len();
        assert!(found > 2 && found < truth.len(), "{chunks:?}: {found}");
        let notes = json(&out.join("import.json"))["sources"][0]["notes"].to_string();
        assert!(notes.contains("mcap recover"), "{chunks:?}: {notes}");
    }
}

#[test]
fn a_chunk_that_does_not_unpack_costs_only_itself() {
    let dir = tempfile::tempdir().unwrap();
    let (mut bytes, truth) = stera(Chunks::Lz4, false);
    // The fourth chunk: its packing's name, its size, and then the first bytes of an LZ4 frame.
    let chunk = bytes.windows(7).enumerate().filter(|(_, w)| *w == b"\x03\0\0\0lz4").map(|(i, _)| i).nth(3).unwrap();
    bytes[chunk + 15..chunk + 19].fill(0x5A);
    write(&dir.path().join("take.mcap"), bytes);
    import(&["take.mcap", "--fps", "0"], dir.path());
    let out = dir.path().join("out");
    assert!((3..truth.len()).contains(&poses(&out).len()));
    let notes = json(&out.join("import.json"))["sources"][0]["notes"].to_string();
    assert!(notes.contains("cannot be unpacked"), "{notes}");
}

#[test]
fn broken_recordings_of_ros_are_named() {
    let file = |name: &'static str, bytes: Vec<u8>| move |dir: &Path| write(&dir.join(name), &bytes);
    refused("a.mcap", &["a.mcap: first bytes", "no MCAP"], file("a.mcap", b"RIFF0000".to_vec()));
    refused("a.mcap", &["a.mcap: first bytes"], file("a.mcap", Vec::new()));
    refused("a.mcap", &["a.mcap: topics", "it has no topics"], file("a.mcap", Bag::new(Chunks::None).finish()));
    refused("a.db3", &["only MCAP", "rosbags-convert"], file("a.db3", b"SQLite".to_vec()));
    refused("a.bag", &["only MCAP", "rosbags-convert"], file("a.bag", b"#ROSBAG V2.0".to_vec()));

    let mut bag = Bag::new(Chunks::None);
    bag.channel(1, "/scan", "sensor_msgs/msg/LaserScan");
    refused("a.mcap", &["its topics: /scan", "no images, depth or poses"], file("a.mcap", bag.finish()));

    let mut bag = Bag::new(Chunks::None);
    bag.encoding = "ros1";
    bag.channel(1, "/camera", "sensor_msgs/Image");
    refused("a.mcap", &["encoded as ros1", "rosbags-convert"], file("a.mcap", bag.finish()));

    // A length that no file has, a channel that ends early, a packing that nobody knows.
    let mut bag = Bag::new(Chunks::None).file;
    bag.push(5);
    bag.extend(u64::MAX.to_le_bytes());
    refused("a.mcap", &["no topics"], file("a.mcap", bag));
    let mut bag = Bag::new(Chunks::None);
    record(&mut bag.file, 4, &[1, 0]);
    refused("a.mcap", &["a.mcap: byte", "built wrongly"], file("a.mcap", bag.finish()));
    let mut bag = Bag::new(Chunks::None);
    let mut chunk = vec![0; 28];
    text(&mut chunk, "brotli");
    chunk.extend([0; 8]);
    record(&mut bag.file, 6, &chunk);
    refused("a.mcap", &["packed with brotli", "mcap compress"], file("a.mcap", bag.finish()));
}

#[test]
fn a_topic_that_is_not_there_is_told_with_those_that_are() {
    let dir = tempfile::tempdir().unwrap();
    write(&dir.path().join("take.mcap"), stera(Chunks::None, false).0);
    for (topic, words) in [
        ("color=/nowhere", ["topic /nowhere", "/camera/rgb/compressed"]),
        ("depth=/camera/rgb/compressed", ["no images of depth", "/camera/depth"]),
        ("poses=/nowhere", ["holds no poses", "/camera/pose"]),
    ] {
        let out = paws(&["import", "take.mcap", "--out", "out", "--topic", topic], dir.path());
        assert_eq!(out.status.code(), Some(2), "{topic}");
        for word in words {
            assert!(stderr(&out).contains(word), "{topic}: {}", stderr(&out));
        }
    }
}
