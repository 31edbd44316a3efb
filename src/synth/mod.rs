//! Recordings of synthetic kitchens with a known answer, in the layout of real ones.
//!
//! A kitchen of boxes ([`kitchen`]), a person who opens and closes its parts ([`person`]), a ray caster ([`render`]), and
//! the errors of estimated hands, poses and depth ([`noise`]). The same options give the same bytes.

pub mod kitchen;
pub mod noise;
pub mod person;
pub mod render;

use clap::ValueEnum;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};

use crate::articulation::{Action, JointKind};
use crate::error::{Error, Result};
use crate::math::{Point, Vector};
use crate::recording::Camera;

/// How noisy a recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Tier {
    /// Exact depth, poses and masks; hands to 3 mm
    Clean,
    /// Errors of estimated hands, poses, depth and contact as they are on real recordings
    Realistic,
    /// Twice as large ones, short motions, shifted narrations of which a third say only "open it"
    Hard,
}

/// What to record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Which kitchen and which person.
    pub seed: u64,
    /// How noisy.
    pub tier: Tier,
    /// Image width, pixels; the height is three quarters of it.
    pub width: usize,
    /// Parts that are opened and closed.
    pub parts: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { seed: 0, tier: Tier::Realistic, width: 320, parts: 4 }
    }
}

/// A recording that has been played but not yet rendered.
#[derive(Debug)]
pub struct Recorded {
    options: Options,
    kitchen: kitchen::Kitchen,
    take: person::Take,
    seen: noise::Seen,
    camera: Camera,
}

impl Recorded {
    /// Builds the kitchen and plays the person.
    ///
    /// # Errors
    /// Where the options ask for more parts than a kitchen has.
    pub fn new(options: &Options) -> Result<Self> {
        let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
        let kitchen = kitchen::build(&mut rng);
        if options.parts > kitchen.parts.len() {
            return Err(Error::Config(format!(
                "synth: {} parts were asked for, this kitchen has {}",
                options.parts,
                kitchen.parts.len()
            )));
        }
        let take = person::play(&kitchen, options.parts, options.tier == Tier::Hard, &mut rng);
        let seen = noise::observe(&take, options.tier, &mut rng);
        let (width, height) = (options.width, options.width * 3 / 4);
        let focal = 0.6 * width as f64;
        let camera = Camera {
            width,
            height,
            fx: focal,
            fy: focal,
            cx: 0.5 * (width as f64 - 1.0),
            cy: 0.5 * (height as f64 - 1.0),
        };
        Ok(Self { options: *options, kitchen, take, seen, camera })
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.take.frames.len()
    }

    /// The tables: (file name, text).
    ///
    /// # Errors
    /// Where a value cannot be written as JSON, which would be a bug.
    pub fn tables(&self) -> Result<Vec<(String, String)>> {
        let text = |v: &Value| crate::json::text(v);
        Ok(vec![
            ("cameras.json".to_owned(), text(&self.cameras())?),
            ("clips.json".to_owned(), text(&self.clips())?),
            ("hands.json".to_owned(), text(&self.hands())?),
            ("labels.json".to_owned(), text(&self.labels())?),
            ("ground_truth.json".to_owned(), text(&self.truth())?),
        ])
    }

    /// The images of one frame: (file name, bytes).
    ///
    /// # Errors
    /// Where an image cannot be encoded, which would be a bug.
    pub fn images(&self, frame: usize) -> Result<Vec<(String, Vec<u8>)>> {
        let truth = &self.take.frames[frame];
        let boxes = self.kitchen.posed(&truth.openings, &truth.hand);
        let mut picture = render::cast(&boxes, &truth.world_from_camera, &self.camera);
        noise::degrade(&mut picture, &self.seen, frame);
        render::encode(&picture, &self.camera, frame, self.take.frames[frame].is_still)
    }

    fn cameras(&self) -> Value {
        let frames: Vec<Value> = self
            .take
            .frames
            .iter()
            .zip(&self.seen.poses)
            .enumerate()
            .map(|(i, (f, pose))| {
                let q = pose.rotation.quaternion();
                json!({"frame": i, "file": format!("frames/{i:06}.jpg"), "timestamp": f.time_secs,
                    "position": pose.translation.vector.as_slice(), "rotation_wxyz": [q.w, q.i, q.j, q.k]})
            })
            .collect();
        let c = self.camera;
        json!({"convention": "OpenCV camera; world_from_camera; world +Z up; metres; seconds; quaternion w x y z",
            "width": c.width, "height": c.height, "fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy,
            "distortion": "none", "frames": frames})
    }

    fn clips(&self) -> Value {
        let clips: Vec<Value> = self
            .take
            .clips
            .iter()
            .enumerate()
            .map(|(i, c)| {
                json!({"clip": format!("clip_{i:03}"), "start_frame": c.span[0], "end_frame": c.span[1],
                    "narration": c.narration, "verb": c.verb, "noun": c.noun})
            })
            .collect();
        json!({"clips": clips})
    }

    fn hands(&self) -> Value {
        let frames: Vec<Value> = self
            .seen
            .hands
            .iter()
            .map(|h| {
                let joints: Vec<[f64; 3]> = person::hand_joints(&h.grasp, &h.wrist).map(|p| p.coords.into()).to_vec();
                json!({"frame": h.frame, "hands": [
                    {"side": "right", "score": 0.9, "contact": h.contact, "joints_world": joints}]})
            })
            .collect();
        json!({"frame": "world (same as cameras.json), metres", "frames": frames})
    }

    fn labels(&self) -> Value {
        let mut labels = serde_json::Map::new();
        for (class, name) in kitchen::CLASSES.iter().enumerate() {
            labels.insert((class + 1).to_string(), json!(name));
        }
        labels.insert("255".to_owned(), json!("hand"));
        Value::Object(labels)
    }

    /// The truth, in the form of the recording format. Never an input of the pipeline.
    fn truth(&self) -> Value {
        let joints: Vec<Value> = self
            .kitchen
            .parts
            .iter()
            .map(|p| {
                let phi = p.articulation;
                let on_axis = |q: &Point| match phi.kind {
                    JointKind::Revolute => phi.line().project(q),
                    JointKind::Prismatic => *q,
                };
                json!({"id": p.id, "noun": p.noun, "type": phi.kind, "axis": phi.axis, "range": [0.0, p.upper],
                    "origin": on_axis(&p.bounds.center), "origin_handle": on_axis(&p.handle),
                    "handle_closed": p.handle, "part_box": p.bounds, "base_box": p.base,
                    "used": self.take.clips.iter().any(|c| c.part == Some(p.id.clone()))})
            })
            .collect();
        let clips: Vec<Value> = self
            .take
            .clips
            .iter()
            .enumerate()
            .filter_map(|(i, c)| {
                let part = c.part.as_ref()?;
                let index = self.kitchen.parts.iter().position(|p| p.id == *part)?;
                let x: Vec<f64> =
                    (c.true_span[0]..=c.true_span[1]).map(|f| self.take.frames[f].openings[index]).collect();
                let action = if c.action == Some(Action::Close) { "close" } else { "open" };
                Some(json!({"clip": format!("clip_{i:03}"), "joint": part, "action": action,
                    "true_start_frame": c.true_span[0], "x_start": x.first(), "x_end": x.last(), "x": x}))
            })
            .collect();
        json!({"generator": "paws synth", "seed": self.options.seed, "up": Vector::z(), "depth_scale": self.seen.depth_scale,
            "joints": joints, "clips": clips})
    }
}
