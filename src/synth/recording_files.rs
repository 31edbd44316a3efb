//! A recording's tables: cameras, clips, hands, labels, and the truth.

use serde_json::{Value, json};

use super::{Recorded, Tier, person};
use crate::articulation::{Action, JointKind};
use crate::error::Result;
use crate::math::Point;

impl Recorded {
    /// The tables: (file name, text).
    ///
    /// # Errors
    /// Where a value cannot be written as JSON, which would be a bug.
    pub fn tables(&self) -> Result<Vec<(String, String)>> {
        let text = |v: &Value| crate::json::text(v);
        let mut tables = vec![
            ("cameras.json".to_owned(), text(&self.cameras())?),
            ("clips.json".to_owned(), text(&self.clips())?),
            ("hands.json".to_owned(), text(&self.hands())?),
            ("labels.json".to_owned(), text(&self.labels())?),
            ("ground_truth.json".to_owned(), text(&self.truth())?),
        ];
        if !self.has_masks {
            tables.retain(|(name, _)| name != "labels.json");
        }
        Ok(tables)
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
        for (class, name) in self.kitchen.classes.iter().enumerate() {
            labels.insert((class + 1).to_string(), json!(name));
        }
        labels.insert("255".to_owned(), json!("hand"));
        Value::Object(labels)
    }

    /// A name that only recordings of one and the same kitchen share.
    fn kitchen_name(&self) -> String {
        let family = match self.options.tier {
            Tier::Clean | Tier::Realistic | Tier::Hard => "kitchen",
            Tier::Nonm => "turned",
            _ => "fitted",
        };
        format!("{family}_{}", self.options.seed)
    }

    /// The truth, in the form of the recording format. Never an input of the pipeline.
    pub(super) fn truth(&self) -> Value {
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
                json!({"id": p.id, "kind": p.kind, "noun": p.noun, "type": phi.kind, "axis": phi.axis, "range": [0.0, p.upper],
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
        let q = self.own_from_kitchen.rotation.quaternion();
        json!({"generator": "paws synth", "seed": self.options.seed, "tier": self.options.tier.name(), "up": self.up, "depth_scale": self.seen.depth_scale,
            "kitchen": self.kitchen_name(),
            "own_from_kitchen": {"position": self.own_from_kitchen.translation.vector.as_slice(),
                "rotation_wxyz": [q.w, q.i, q.j, q.k]},
            "joints": joints, "clips": clips})
    }
}
