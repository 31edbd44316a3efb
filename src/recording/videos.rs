//! Several videos of one place as one recording: one world, one clock, one list of clips.
//!
//! Videos follow each other in the order given, a pause between each two, so that nothing that looks at times runs over a cut;
//! what looks at frames asks [`Recording::video_frames`].

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::{Camera, Clip, Frame, HAND_CLASS, HandSample, Recording, Source};
use crate::error::{Error, Result};
use crate::math::{Point, Pose};

/// The videos that a recording was joined of.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Videos {
    /// In the order of time; none where the recording is one video.
    pub joined: Vec<Video>,
    /// Recordings that were to be joined and are not.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
}

impl Videos {
    /// Whether nothing was to be joined.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.joined.is_empty() && self.left_out.is_empty()
    }

    /// The video of a clip of the joined recording, and the clip's name there. `None` where nothing was joined.
    #[must_use]
    pub fn of_clip<'a>(&self, clip: &'a str) -> Option<(&Video, &'a str)> {
        let (video, own) = clip.split_once('/')?;
        Some((self.joined.iter().find(|v| v.name == video)?, own))
    }
}

/// One of the videos of a joined recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Video {
    /// Its recording's name; its clips are called `name/clip`.
    pub name: String,
    /// Its first frame in the joined recording.
    pub first_frame: usize,
    /// Number of its frames.
    pub frames: usize,
    /// Its camera.
    pub camera: Camera,
    /// Its own world to the joined recording's.
    pub scene_from_own: Pose,
    /// How that is known.
    pub placement: Placement,
    /// The joined recording's mask class of each of its own; empty where they are the same.
    #[serde(skip)]
    classes: Vec<u8>,
    /// Which of the joined recording's reconstructed points are its own.
    #[serde(skip)]
    points: Range<usize>,
    /// Who has its pictures.
    #[serde(skip)]
    source: Source,
}

/// How it is known where a video's world lies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "by", rename_all = "snake_case")]
pub enum Placement {
    /// Its world is the joined recording's.
    First,
    /// Somebody said that it is the same world.
    Told,
    /// Surfaces meet as the poses stand: it is the same world.
    SameWorld(Fit),
    /// Its surfaces were laid onto those of the others.
    Aligned(Fit),
}

/// How well surfaces of two videos meet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// Of the places that either sees and the other looks at, the share that the other sees, too, rather than through.
    pub agreement: f64,
    /// Of all places, the share that the other looks at.
    pub overlap: f64,
    /// How the brightness of what both see goes together, a correlation; `None` where there are no images.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub likeness: Option<f64>,
    /// Median distance of the surfaces that meet, across them, metres.
    pub residual_m: f64,
    /// How much better than the best other alignment it is, 0 to 1; `None` where no other was looked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lead: Option<f64>,
}

impl Fit {
    /// For people.
    #[must_use]
    pub fn words(&self) -> String {
        let lead = self.lead.map_or_else(String::new, |lead| format!(", {lead:.2} ahead of the next best alignment"));
        let likeness = self
            .likeness
            .map_or_else(String::new, |likeness| format!(", their brightness goes together by {likeness:.2}"));
        format!(
            "surfaces {:.1} cm apart, {:.0} % of what both look at agree ({:.0} % overlap){likeness}{lead}",
            100.0 * self.residual_m,
            100.0 * self.agreement,
            100.0 * self.overlap
        )
    }
}

impl Placement {
    /// For people.
    #[must_use]
    pub fn words(&self) -> String {
        match self {
            Self::First => "its world is the scene's".to_owned(),
            Self::Told => "in the same world, as was said".to_owned(),
            Self::SameWorld(fit) => format!("in the same world: {}", fit.words()),
            Self::Aligned(fit) => format!("aligned: {}", fit.words()),
        }
    }
}

/// A recording that was not joined.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Its name.
    pub name: String,
    /// Why.
    pub reason: String,
}

/// A recording with its place in the joined world.
#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    /// The recording.
    pub recording: Recording,
    /// Its world to the joined one.
    pub scene_from_own: Pose,
    /// How that is known.
    pub placement: Placement,
}

/// Joins recordings of one place, in the order of time, with a pause of `gap_secs` between each two. Depth factors are kept
/// for the frames that have their own.
///
/// # Errors
/// No recording at all, and two of one name.
pub fn joined(parts: Vec<Placed>, left_out: Vec<LeftOut>, gap_secs: f64) -> Result<Recording> {
    let Some(first) = parts.first() else {
        return Err(Error::Config("no recording is left to join; give at least one that can be used".to_owned()));
    };
    distinct(parts.iter().map(|p| &p.recording))?;
    let mut all = Recording {
        name: name_of(&parts),
        dir: first.recording.dir.clone(),
        labels: labels(&parts),
        videos: Videos { joined: Vec::new(), left_out },
        source: first.recording.source.clone(),
        ..Recording::empty(first.recording.camera)
    };
    for part in parts {
        append(&mut all, part, gap_secs);
    }
    Ok(all)
}

/// Refuses two recordings of one name: nobody could tell their clips apart.
///
/// # Errors
/// Names the second one's folder.
pub fn distinct<'a>(recordings: impl Iterator<Item = &'a Recording>) -> Result<()> {
    let mut names = BTreeSet::new();
    for Recording { name, dir, .. } in recordings {
        if !names.insert(name) {
            let fault = format!("an earlier recording is called {name}, too; rename one of the two folders");
            return Err(Error::Recording { path: dir.clone(), faults: vec![fault] });
        }
    }
    Ok(())
}

/// A name for all: both of two, the first of more.
fn name_of(parts: &[Placed]) -> String {
    match parts {
        [] => "recording".to_owned(),
        [one] => one.recording.name.clone(),
        [a, b] => format!("{}_and_{}", a.recording.name, b.recording.name),
        [a, rest @ ..] => format!("{}_and_{}_more", a.recording.name, rest.len()),
    }
}

/// Names of the classes of all: the first recording's numbers, then free ones.
fn labels(parts: &[Placed]) -> BTreeMap<u8, String> {
    let mut all = BTreeMap::new();
    for (class, name) in parts.iter().flat_map(|p| &p.recording.labels) {
        if *class == HAND_CLASS {
            all.insert(*class, name.clone());
        } else if *class != 0 && !all.values().any(|known| known == name) {
            let free =
                if all.contains_key(class) { (1..HAND_CLASS).find(|c| !all.contains_key(c)) } else { Some(*class) };
            // More than a byte can number are nothing in particular.
            if let Some(free) = free {
                all.insert(free, name.clone());
            }
        }
    }
    all
}

/// The number in `all` of each class of a video's own; empty where they are the same. A class without a name keeps its number
/// where that has no name in `all`, either.
fn classes(own: &BTreeMap<u8, String>, all: &BTreeMap<u8, String>) -> Vec<u8> {
    let number = |class: u8| match own.get(&class) {
        _ if class == 0 || class == HAND_CLASS => class,
        Some(name) => all.iter().find(|(_, known)| *known == name).map_or(0, |(number, _)| *number),
        None if all.contains_key(&class) => 0,
        None => class,
    };
    let table: Vec<u8> = (0..=u8::MAX).map(number).collect();
    if table.iter().zip(0..=u8::MAX).all(|(number, class)| *number == class) { Vec::new() } else { table }
}

fn append(all: &mut Recording, part: Placed, gap_secs: f64) {
    let Placed { recording, scene_from_own, placement } = part;
    let first_frame = all.frames.len();
    let moves = scene_from_own != Pose::identity();
    let there = |p: Point| if moves { scene_from_own * p } else { p };
    let start = recording.frames.first().map_or(0.0, |f| f.timestamp_secs);
    let later = all.frames.last().map_or(0.0, |last| last.timestamp_secs + gap_secs - start);
    let reconstruction: Vec<Point> = recording.reconstruction.into_iter().map(there).collect();
    let points = points_in(&mut all.reconstruction, &all.videos.joined, reconstruction);
    let count = recording.frames.len();
    all.frames.extend(recording.frames.into_iter().map(|f| Frame {
        timestamp_secs: f.timestamp_secs + later,
        world_from_camera: if moves { scene_from_own * f.world_from_camera } else { f.world_from_camera },
        files: f.files,
    }));
    let own_clip = |c: Clip| Clip {
        clip: format!("{}/{}", recording.name, c.clip),
        start_frame: c.start_frame + first_frame,
        end_frame: c.end_frame + first_frame,
        ..c
    };
    all.clips.extend(recording.clips.into_iter().map(own_clip));
    all.left_out.clips.extend(recording.left_out.clips.into_iter().map(|(c, why)| (own_clip(c), why)));
    let notes = recording.left_out.notes.into_iter().map(|note| format!("{}: {note}", recording.name));
    all.left_out.notes.extend(notes);
    let joint = |p: [f32; 3]| {
        if moves {
            <[f64; 3]>::from((scene_from_own * Point::from(p.map(f64::from))).coords).map(|c| c as f32)
        } else {
            p
        }
    };
    all.hands.extend(recording.hands.into_iter().map(|h| HandSample {
        frame: h.frame + first_frame,
        tips: h.tips.map(there),
        joints: h.joints.map(|joints| joints.map(joint)),
        ..h
    }));
    let known = recording.depth_factors.by_frame.into_iter().map(|(frame, factor)| (frame + first_frame, factor));
    all.depth_factors.by_frame.extend(known);
    all.videos.joined.push(Video {
        name: recording.name,
        first_frame,
        frames: count,
        camera: recording.camera,
        scene_from_own,
        placement,
        classes: classes(&recording.labels, &all.labels),
        points,
        source: recording.source,
    });
}

/// Where a video's points lie among all of them: videos of one world often have one and the same reconstruction, which is kept
/// once.
fn points_in(all: &mut Vec<Point>, videos: &[Video], own: Vec<Point>) -> Range<usize> {
    let known = videos.iter().map(|v| &v.points).find(|range| all.get((*range).clone()) == Some(own.as_slice()));
    match known {
        Some(range) => range.clone(),
        None => {
            let start = all.len();
            all.extend(own);
            start..all.len()
        }
    }
}

impl Recording {
    /// The video that a frame belongs to; `None` where the recording is one video.
    #[must_use]
    pub fn video_of(&self, frame: usize) -> Option<&Video> {
        let after = self.videos.joined.partition_point(|v| v.first_frame <= frame);
        self.videos.joined.get(after.checked_sub(1)?)
    }

    /// The frames of the video that a frame belongs to: what was filmed in one go.
    #[must_use]
    pub fn video_frames(&self, frame: usize) -> Range<usize> {
        self.video_of(frame).map_or(0..self.frames.len(), |v| v.first_frame..v.first_frame + v.frames)
    }

    /// The camera of a frame.
    #[must_use]
    pub fn camera_of(&self, frame: usize) -> &Camera {
        self.video_of(frame).map_or(&self.camera, |v| &v.camera)
    }

    /// Who has a frame's pictures.
    #[must_use]
    pub fn source_of(&self, frame: usize) -> &Source {
        self.video_of(frame).map_or(&self.source, |v| &v.source)
    }

    /// Points of the static reconstruction that a frame's video came with, world; empty where there is none.
    #[must_use]
    pub fn reconstruction_of(&self, frame: usize) -> &[Point] {
        match self.video_of(frame) {
            None => &self.reconstruction,
            Some(video) => self.reconstruction.get(video.points.clone()).unwrap_or_default(),
        }
    }

    /// The recording's mask class of each class that a frame's mask file has; empty where they are the same.
    #[must_use]
    pub fn classes_of(&self, frame: usize) -> &[u8] {
        self.video_of(frame).map_or(&[], |v| &v.classes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Vector, rotation};
    use crate::recording::Side;

    fn recording(name: &str, width: usize, labels: &[(u8, &str)]) -> Recording {
        let frame = |i: u32| Frame {
            timestamp_secs: 5.0 + f64::from(i),
            world_from_camera: Pose::identity(),
            files: Default::default(),
        };
        let [narration, verb, noun] = [(); 3].map(|()| String::new());
        let at = Point::new(1.0, 0.0, 0.0);
        Recording {
            name: name.to_owned(),
            dir: std::path::PathBuf::from(name),
            frames: (0..4).map(frame).collect(),
            clips: vec![Clip { clip: "a".to_owned(), start_frame: 1, end_frame: 2, narration, verb, noun }],
            hands: vec![HandSample {
                frame: 2,
                side: Side::Right,
                contact: None,
                tips: [at; 3],
                joints: Some([[1.0, 0.0, 0.0]; 21]),
            }],
            labels: labels.iter().map(|(class, name)| (*class, (*name).to_owned())).collect(),
            reconstruction: vec![at],
            ..Recording::empty(Camera { width, height: 3, fx: 3.0, fy: 3.0, cx: 1.5, cy: 1.0 })
        }
    }

    fn placed(recording: Recording, scene_from_own: Pose) -> Placed {
        Placed { recording, scene_from_own, placement: Placement::Told }
    }

    #[test]
    fn a_joined_recording_has_one_clock_one_world_and_the_cameras_of_all() {
        let turn =
            Pose::from_parts(Vector::new(0.0, 0.0, 2.0).into(), rotation(&Vector::z(), std::f64::consts::FRAC_PI_2));
        let [a, b, c] = ["monday", "tuesday", "friday"].map(|name| recording(name, 4 + name.len(), &[]));
        let parts = vec![placed(a.clone(), Pose::identity()), placed(b, turn), placed(c, Pose::identity())];
        let all = joined(parts, Vec::new(), 60.0).unwrap();
        assert_eq!(all.name, "monday_and_2_more");
        let times: Vec<f64> = all.frames.iter().map(|f| f.timestamp_secs).collect();
        assert_eq!(times[..5], [5.0, 6.0, 7.0, 8.0, 68.0]);
        assert!(times.windows(2).all(|w| w[1] > w[0]));
        let widths: Vec<usize> = (0..12).map(|f| all.camera_of(f).width).collect();
        assert_eq!(widths, [10, 10, 10, 10, 11, 11, 11, 11, 10, 10, 10, 10]);
        assert_eq!([all.video_frames(3), all.video_frames(4)], [0..4, 4..8]);
        let clips: Vec<(&str, usize)> = all.clips.iter().map(|c| (c.clip.as_str(), c.start_frame)).collect();
        assert_eq!(clips, [("monday/a", 1), ("tuesday/a", 5), ("friday/a", 9)]);
        assert_eq!(all.videos.of_clip("tuesday/a").map(|(v, own)| (v.first_frame, own)), Some((4, "a")));
        // Of the first video nothing is touched; what is in the same place is kept once.
        assert_eq!((&all.frames[..4], all.hands[0]), (&a.frames[..], a.hands[0]));
        let turned = Point::new(0.0, 1.0, 2.0);
        assert!((all.hands[1].tips[0] - turned).norm() < 1e-12 && all.hands[1].frame == 6);
        assert!((all.reconstruction_of(5)[0] - turned).norm() < 1e-12);
        assert_eq!((all.reconstruction.len(), all.reconstruction_of(9)), (2, &a.reconstruction[..]));
    }

    #[test]
    fn two_recordings_of_one_name_are_told_and_so_is_none() {
        let twice = ["a", "a"].map(|name| placed(recording(name, 4, &[]), Pose::identity())).to_vec();
        assert!(joined(twice, Vec::new(), 60.0).unwrap_err().to_string().contains("rename"));
        assert!(joined(Vec::new(), Vec::new(), 60.0).is_err());
    }

    #[test]
    fn classes_are_matched_by_their_names() {
        let one = recording("one", 4, &[(1, "drawer"), (2, "oven"), (255, "hand")]);
        let other = recording("other", 4, &[(1, "oven"), (2, "fridge"), (255, "hand")]);
        let all = joined([one, other].map(|r| placed(r, Pose::identity())).to_vec(), Vec::new(), 60.0).unwrap();
        let names: Vec<(u8, &str)> = all.labels.iter().map(|(c, n)| (*c, n.as_str())).collect();
        assert_eq!(names, [(1, "drawer"), (2, "oven"), (3, "fridge"), (255, "hand")]);
        // A class without a name that is another one's number is nothing in particular.
        assert_eq!([0, 1, 2, 3].map(|c| all.classes_of(0)[c]), [0, 1, 2, 0]);
        let table = all.classes_of(4);
        assert_eq!([0, 1, 2, 3, 4, 255].map(|c| table[c]), [0, 2, 3, 0, 4, 255]);
    }
}
