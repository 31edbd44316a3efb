//! A synthetic recording as a program holds it: no files.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::render::{self, Rendering};
use super::{Recorded, noise, person};
use crate::error::Result;
use crate::math::Point;
use crate::recording::tables::TIP_JOINTS;
use crate::recording::{Clip, Grid, HAND_CLASS, HandSample, MemoryFrame, MemoryRecording, Recording, Side};

impl Recorded {
    /// The recording in memory. It has what the folder has, and like it nothing of the answer; its pictures are as they were
    /// before they were encoded.
    ///
    /// # Errors
    /// None, short of a bug.
    pub fn recording(&self) -> Result<Recording> {
        let mut held = MemoryRecording::new(format!("kitchen_{}", self.options.seed), self.camera);
        held.frames = (0..self.frames()).into_par_iter().map(|frame| self.frame_in_memory(frame)).collect();
        held.clips = self.clips_in_memory();
        held.hands = self.seen.hands.iter().map(hand_in_memory).collect();
        if self.has_masks {
            held.labels = self.labels_in_memory();
        }
        Recording::from_memory(held)
    }

    /// What the camera sees in a frame, as estimators make it out.
    pub(super) fn picture(&self, frame: usize) -> Rendering {
        let truth = &self.take.frames[frame];
        let masks = self.seen.masks[frame];
        let boxes = self.kitchen.posed(&truth.openings, &truth.hand, masks.swallowed);
        // The lamp hangs in the kitchen, whatever world the recording has.
        let lamp = self.own_from_kitchen * render::lamp();
        let mut picture = render::cast_coated(&lamp, &boxes, &self.coats, &truth.world_from_camera, &self.camera);
        if masks.scale != 1.0 {
            let part = &self.kitchen.parts[masks.part];
            let center = part.articulation.motion(truth.openings[masks.part]) * part.bounds.center;
            if let Some(about) = self.camera.project(&(truth.world_from_camera.inverse() * center)) {
                picture.classes = noise::scaled(&picture.classes, &self.camera, about, masks.scale);
            }
        }
        noise::degrade(&mut picture, &self.seen, frame, &self.camera, truth.is_still);
        picture
    }

    fn frame_in_memory(&self, frame: usize) -> MemoryFrame {
        let Rendering { rgb, depth, normals, classes } = self.picture(frame);
        let truth = &self.take.frames[frame];
        MemoryFrame {
            depth: Some(self.grid(depth)),
            rgb: Some(self.grid(rgb)),
            mask: self.has_masks.then(|| self.grid(classes)),
            normals: truth.is_still.then(|| self.grid(normals)),
            ..MemoryFrame::new(truth.time_secs, self.seen.poses[frame])
        }
    }

    fn grid<T>(&self, data: Vec<T>) -> Grid<T> {
        Grid { width: self.camera.width, height: self.camera.height, data }
    }

    fn clips_in_memory(&self) -> Vec<Clip> {
        let clip = |(i, clip): (usize, &person::TakeClip)| Clip {
            clip: format!("clip_{i:03}"),
            start_frame: clip.span[0],
            end_frame: clip.span[1],
            narration: clip.narration.clone(),
            verb: clip.verb.clone(),
            noun: clip.noun.clone(),
        };
        self.take.clips.iter().enumerate().map(clip).collect()
    }

    fn labels_in_memory(&self) -> BTreeMap<u8, String> {
        let names = (1..HAND_CLASS).zip(self.kitchen.classes.iter().map(|name| (*name).to_owned()));
        names.chain([(HAND_CLASS, "hand".to_owned())]).collect()
    }
}

fn hand_in_memory(hand: &noise::SeenHand) -> HandSample {
    let joints: [Point; 21] = person::hand_joints(&hand.grasp, &hand.wrist);
    HandSample {
        frame: hand.frame,
        side: Side::Right,
        contact: Some(hand.contact),
        tips: TIP_JOINTS.map(|i| joints[i]),
        joints: Some(joints.map(|p| <[f64; 3]>::from(p.coords).map(|c| c as f32))),
    }
}
