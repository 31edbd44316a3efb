//! Recordings that were never files: what a program holds in memory, checked like a folder.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use super::checks::{self, Faults};
use super::frames::{MemoryFrames, Source, unfit};
use super::segments::Ends;
use super::{Camera, Clip, Frame, FrameFiles, Grid, HandSample, Recording};
use crate::error::Result;
use crate::math::{Point, Pose};

/// Depth beyond this is another unit, metres: what 16 bits of millimetres hold, as in a folder.
const FARTHEST_M: f32 = 65.535;

/// A recording in memory: metres, seconds, +Z up, `world_from_camera`; [`Recording::from_memory`] takes it.
#[derive(Debug, Clone, PartialEq)]
pub struct MemoryRecording {
    /// A name; messages call the recording `memory:NAME`.
    pub name: String,
    /// Intrinsics of all frames; images are undistorted.
    pub camera: Camera,
    /// Frames in time order.
    pub frames: Vec<MemoryFrame>,
    /// When somebody opens or closes something; empty where nobody told (see [`crate::hands::find::interactions`]).
    pub clips: Vec<Clip>,
    /// Hands, in any order.
    pub hands: Vec<HandSample>,
    /// Mask class to name; 255 is a hand.
    pub labels: BTreeMap<u8, String>,
    /// Points of a static reconstruction, world; empty where there is none.
    pub reconstruction: Vec<Point>,
}

/// One frame of it. Pictures are as large as the camera says; each is optional.
#[derive(Debug, Clone, PartialEq)]
pub struct MemoryFrame {
    /// Seconds.
    pub timestamp_secs: f64,
    /// Camera to world.
    pub world_from_camera: Pose,
    /// Metres along the optical axis; what is not a positive number is none.
    pub depth: Option<Grid<f32>>,
    /// Colours, sRGB.
    pub rgb: Option<Grid<[u8; 3]>>,
    /// Class of each pixel.
    pub mask: Option<Grid<u8>>,
    /// Normals in the camera frame, facing the camera; zero = none.
    pub normals: Option<Grid<[f32; 3]>>,
    /// A line detector's own segments, pixels.
    pub segments: Option<Vec<Ends>>,
}

impl MemoryRecording {
    /// Nothing seen yet.
    #[must_use]
    pub fn new(name: impl Into<String>, camera: Camera) -> Self {
        Self {
            name: name.into(),
            camera,
            frames: Vec::new(),
            clips: Vec::new(),
            hands: Vec::new(),
            labels: BTreeMap::new(),
            reconstruction: Vec::new(),
        }
    }
}

impl MemoryFrame {
    /// A frame without pictures.
    #[must_use]
    pub fn new(timestamp_secs: f64, world_from_camera: Pose) -> Self {
        let (depth, rgb, mask, normals, segments) = (None, None, None, None, None);
        Self { timestamp_secs, world_from_camera, depth, rgb, mask, normals, segments }
    }
}

impl Recording {
    /// A recording of one camera with nothing in it: for `Recording { frames, ..Recording::empty(camera) }`. Pictures of its
    /// frames are files.
    #[must_use]
    pub fn empty(camera: Camera) -> Self {
        Self {
            name: "recording".to_owned(),
            dir: PathBuf::new(),
            camera,
            frames: Vec::new(),
            clips: Vec::new(),
            hands: Vec::new(),
            labels: BTreeMap::new(),
            reconstruction: Vec::new(),
            depth_factors: super::DepthFactors::default(),
            videos: super::Videos::default(),
            left_out: super::LeftOut::default(),
            source: Source::default(),
        }
    }

    /// A recording that a program put together, if it can be used: hands come into their order, clips and hands that cannot be
    /// worked with go to [`Recording::left_out`]. Pictures are not looked at.
    ///
    /// # Errors
    /// All faults at once, as [`Recording::open`] has them; each names its frame, clip or field.
    pub fn checked(mut self) -> Result<Self> {
        let mut faults = Faults::default();
        checks::all(&mut self, &mut faults);
        faults.finish(&self.place())?;
        Ok(self)
    }

    /// The recording of what a program holds in memory.
    ///
    /// # Errors
    /// As [`Self::checked`], and pictures of another size than the camera's, or with numbers that are no metres.
    pub fn from_memory(held: MemoryRecording) -> Result<Self> {
        let MemoryRecording { name, camera, frames, clips, hands, labels, reconstruction } = held;
        let mut recording = Self { name, clips, hands, labels, reconstruction, ..Self::empty(camera) };
        recording.dir = recording.place();
        let (mut faults, mut pictures) = (Faults::default(), MemoryFrames::default());
        for (index, frame) in frames.into_iter().enumerate() {
            let name = |of: &str| recording.dir.join(of).join(format!("{index:06}"));
            let (timestamp_secs, world_from_camera) = (frame.timestamp_secs, frame.world_from_camera);
            check_pictures(&frame, index, &camera, &mut faults);
            let files = FrameFiles {
                rgb: put(&mut pictures.rgb, name("frames"), frame.rgb),
                depth: put(&mut pictures.depth, name("depth"), frame.depth.map(only_metres)),
                normals: put(&mut pictures.normals, name("normals"), frame.normals.map(only_directions)),
                mask: put(&mut pictures.masks, name("masks"), frame.mask),
                segments: put(&mut pictures.segments, name("segments"), frame.segments),
            };
            recording.frames.push(Frame { timestamp_secs, world_from_camera, files });
        }
        if !recording.reconstruction.iter().all(|p| p.coords.iter().all(|c| c.is_finite())) {
            faults.add("reconstruction", "reconstruction: a point is not finite; leave it out".to_owned());
        }
        checks::all(&mut recording, &mut faults);
        faults.finish(&recording.dir)?;
        recording.source = Source::Given(Arc::new(pictures));
        Ok(recording)
    }

    /// What messages call the recording: its folder, or `memory:NAME` where it has none.
    fn place(&self) -> PathBuf {
        match self.dir.as_os_str().is_empty() {
            true => PathBuf::from(format!("memory:{}", self.name)),
            false => self.dir.clone(),
        }
    }
}

/// Keeps a picture by its name, and answers with the name.
fn put<T>(all: &mut BTreeMap<PathBuf, T>, name: PathBuf, picture: Option<T>) -> Option<PathBuf> {
    all.insert(name.clone(), picture?);
    Some(name)
}

/// Faults of a frame's pictures.
fn check_pictures(frame: &MemoryFrame, index: usize, camera: &Camera, faults: &mut Faults) {
    let sizes = [
        ("depth", frame.depth.as_ref().and_then(|picture| unfit(picture, camera))),
        ("rgb", frame.rgb.as_ref().and_then(|picture| unfit(picture, camera))),
        ("mask", frame.mask.as_ref().and_then(|picture| unfit(picture, camera))),
        ("normals", frame.normals.as_ref().and_then(|picture| unfit(picture, camera))),
    ];
    for (of, fault) in sizes {
        if let Some(fault) = fault {
            faults.add(of, format!("frame {index}: {of} {fault}"));
        }
    }
    if let Some(depth) = &frame.depth {
        let far = depth.data.iter().filter(|z| z.is_finite() && **z > FARTHEST_M).count();
        let known = depth.data.iter().filter(|z| z.is_finite() && **z > 0.0).count();
        if 2 * far > known {
            let fault = "depth is beyond 65 m in most pixels; give metres (are these millimetres?)";
            faults.add("depth unit", format!("frame {index}: {fault}"));
        }
    }
    if frame.segments.iter().flatten().flatten().flatten().any(|c| !c.is_finite()) {
        faults.add("segments", format!("frame {index}: segments: a coordinate is not finite; leave that segment out"));
    }
}

/// Depth as all steps take it: 0 where there is none.
fn only_metres(mut depth: Grid<f32>) -> Grid<f32> {
    for z in &mut depth.data {
        if !(z.is_finite() && *z > 0.0) {
            *z = 0.0;
        }
    }
    depth
}

/// Unit normals; zero where there is none. Those of unit length stay as they are, to the last bit.
fn only_directions(mut normals: Grid<[f32; 3]>) -> Grid<[f32; 3]> {
    const ROUNDING: f32 = 1e-5;
    for n in &mut normals.data {
        let norm = n.iter().map(|c| c * c).sum::<f32>().sqrt();
        if !(norm.is_finite() && norm > 0.0) {
            *n = [0.0; 3];
        } else if (norm - 1.0).abs() > ROUNDING {
            *n = n.map(|c| c / norm);
        }
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Side;
    use crate::recording::videos::{Placed, Placement, joined};

    const CAMERA: Camera = Camera { width: 4, height: 3, fx: 3.0, fy: 3.0, cx: 1.5, cy: 1.0 };

    fn held() -> MemoryRecording {
        let frame = |i: u32| MemoryFrame {
            depth: Some(Grid::filled(4, 3, 1.5)),
            ..MemoryFrame::new(0.1 * f64::from(i), Pose::identity())
        };
        let tips = [0.0, 0.05, 0.09].map(|x| Point::new(x, 0.0, 0.6));
        let hand = |frame: usize| HandSample { frame, side: Side::Right, contact: None, tips, joints: None };
        let mut held = MemoryRecording::new("kitchen", CAMERA);
        held.frames = (0..3).map(frame).collect();
        held.hands = vec![hand(2), hand(0)];
        held
    }

    fn faults(change: impl Fn(&mut MemoryRecording)) -> String {
        let mut held = held();
        change(&mut held);
        Recording::from_memory(held).map_or_else(|e| e.to_string(), |_| "none".to_owned())
    }

    #[test]
    fn what_is_held_is_given_and_hands_come_in_order() {
        let mut held = held();
        held.frames[1].depth = Some(Grid { width: 4, height: 3, data: [f32::NAN, -1.0, 2.0, f32::INFINITY].repeat(3) });
        let recording = Recording::from_memory(held).unwrap();
        assert_eq!(recording.hands.iter().map(|h| h.frame).collect::<Vec<_>>(), [0, 2]);
        assert_eq!(recording.depth(0).unwrap().unwrap().data, [1.5; 12]);
        assert_eq!(recording.depth(1).unwrap().unwrap().data[..4], [0.0, 0.0, 2.0, 0.0]);
        assert!(recording.has_depth(2) && recording.rgb(2).unwrap().is_none());
        assert_eq!(recording.dir, PathBuf::from("memory:kitchen"));
    }

    #[test]
    fn faults_name_the_frame_and_the_field_all_at_once() {
        assert_eq!(faults(|_| {}), "none");
        let said = faults(|held| {
            held.frames[1].rgb = Some(Grid::filled(3, 4, [0; 3]));
            held.frames[2].depth = Some(Grid::filled(4, 3, 1500.0));
            held.frames[2].timestamp_secs = 0.05;
            held.hands[0].frame = 7;
            held.camera.fx = 0.0;
        });
        for word in [
            "memory:kitchen: ",
            "frame 1: rgb is 3 x 4",
            "frame 2: depth is beyond 65 m",
            "frame 2: timestamp 0.05 s",
            "hands: frame 7: the video has 3 frames",
            "camera: fx 0",
        ] {
            assert!(said.contains(word), "{word}: {said}");
        }
        let said = faults(|held| held.frames[0].world_from_camera.translation.vector.x = f64::NAN);
        assert!(said.contains("frame 0: position"), "{said}");
        assert!(faults(|held| held.hands.clear()).contains("hands: no hand"));
        assert!(faults(|held| held.frames.clear()).contains("frames: there are none"));
    }

    #[test]
    fn a_bad_clip_costs_only_itself() {
        let clip = |name: &str, end_frame: usize| {
            let [narration, verb, noun] = [(); 3].map(|()| String::new());
            Clip { clip: name.to_owned(), start_frame: 0, end_frame, narration, verb, noun }
        };
        let mut held = held();
        held.clips = vec![clip("good", 2), clip("bad", 9)];
        let recording = Recording::from_memory(held).unwrap();
        assert_eq!((recording.clips.len(), recording.left_out.clips.len()), (1, 1));
        assert!(faults(|held| held.clips = vec![clip("bad", 9)]).contains("clips: clip bad: frames 0..=9"));
    }

    #[test]
    fn normals_become_unit_and_what_is_none_becomes_zero() {
        let grid =
            Grid { width: 4, height: 1, data: vec![[0.0, 0.0, -2.0], [0.6, 0.0, -0.8], [0.0; 3], [f32::NAN; 3]] };
        assert_eq!(only_directions(grid).data, [[0.0, 0.0, -1.0], [0.6, 0.0, -0.8], [0.0; 3], [0.0; 3]]);
    }

    #[test]
    fn of_a_joined_recording_each_video_gives_its_own_pictures() {
        let of = |name: &str, metres: f32| {
            let mut held = held();
            held.name = name.to_owned();
            held.frames.iter_mut().for_each(|f| f.depth = Some(Grid::filled(4, 3, metres)));
            let recording = Recording::from_memory(held).unwrap();
            Placed { recording, scene_from_own: Pose::identity(), placement: Placement::Told }
        };
        let all = joined(vec![of("a", 1.0), of("b", 2.0)], Vec::new(), 60.0).unwrap();
        assert_eq!([2, 3].map(|frame| all.depth(frame).unwrap().unwrap().data[0]), [1.0, 2.0]);
    }

    #[test]
    fn what_a_program_put_together_is_checked_too() {
        let recording = Recording::from_memory(held()).unwrap();
        assert!(recording.clone().checked().is_ok());
        let error = Recording { hands: Vec::new(), ..Recording::empty(CAMERA) }.checked().unwrap_err().to_string();
        assert!(error.starts_with("memory:recording: ") && error.contains("no hand"), "{error}");
    }
}
