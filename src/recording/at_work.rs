//! When somebody is at work, by the clips.

use super::{Clip, Recording};

/// How many narrated interactions go on in each frame. A clip of a single frame is a remark, not an interaction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AtWork {
    count: Vec<u32>,
}

impl AtWork {
    /// Of all clips of a recording.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        let frames = recording.frames.len();
        let mut starts = vec![0u32; frames + 1];
        let mut ends = vec![0u32; frames + 1];
        for clip in recording.clips.iter().filter(|c| lasts(c) && c.start_frame < frames) {
            starts[clip.start_frame] += 1;
            ends[(clip.end_frame + 1).min(frames)] += 1;
        }
        let mut open = 0;
        let count = starts
            .iter()
            .zip(&ends)
            .take(frames)
            .map(|(start, end)| {
                open = open + start - end;
                open
            })
            .collect();
        Self { count }
    }

    /// Whether any interaction goes on.
    #[must_use]
    pub fn any(&self, frame: usize) -> bool {
        self.count.get(frame).is_some_and(|n| *n > 0)
    }

    /// Whether an interaction other than this one goes on.
    #[must_use]
    pub fn other(&self, frame: usize, clip: &Clip) -> bool {
        let own = u32::from(lasts(clip) && (clip.start_frame..=clip.end_frame).contains(&frame));
        self.count.get(frame).is_some_and(|n| *n > own)
    }
}

fn lasts(clip: &Clip) -> bool {
    clip.end_frame > clip.start_frame
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::recording::{Camera, Frame};

    #[test]
    fn interactions_are_counted_frame_by_frame() {
        let clip = |name: &str, start_frame: usize, end_frame: usize| {
            let [narration, verb, noun] = [(); 3].map(|()| String::new());
            Clip { clip: name.to_owned(), start_frame, end_frame, narration, verb, noun }
        };
        let frame = |i: i32| Frame {
            timestamp_secs: f64::from(i),
            world_from_camera: Pose::identity(),
            files: Default::default(),
        };
        let recording = Recording {
            frames: (0..10).map(frame).collect(),
            clips: vec![clip("a", 2, 5), clip("b", 4, 7), clip("remark", 9, 9)],
            ..Recording::empty(Camera { width: 4, height: 3, fx: 3.0, fy: 3.0, cx: 1.5, cy: 1.0 })
        };
        let at_work = AtWork::of(&recording);
        let any: Vec<usize> = (0..12).filter(|&f| at_work.any(f)).collect();
        assert_eq!(any, [2, 3, 4, 5, 6, 7]);
        let other: Vec<usize> = (0..12).filter(|&f| at_work.other(f, &recording.clips[0])).collect();
        assert_eq!(other, [4, 5, 6, 7]);
    }
}
