//! The keyframes of a glTF animation: how a node turns or shifts, and how far.

use nalgebra::{Quaternion, UnitQuaternion};
use serde_json::Value;

use super::gltf_file::{GltfFile, Unavailable, index, list};
use super::xml;
use crate::math::{Vector, rounded};

/// What a validator forgives of rounding in the length of a quaternion.
pub(super) const UNIT_ERROR: f64 = 1e-2;

/// Keyframes of one channel.
pub(super) struct Keyframes {
    /// Seconds, rising.
    pub(super) times: Vec<f64>,
    pub(super) values: KeyframeValues,
}

pub(super) enum KeyframeValues {
    Turns(Vec<UnitQuaternion<f64>>),
    Shifts(Vec<Vector>),
}

/// A node's value at a key or between two.
pub(super) enum KeyframeValue {
    Turn(UnitQuaternion<f64>),
    Shift(Vector),
}

/// Keyframes of a channel that turns or shifts.
pub(super) fn keys(file: &GltfFile, animation: &Value, channel: &Value, path: &str) -> Result<Keyframes, Unavailable> {
    let broken = |text: &str| Unavailable::Broken(text.to_owned());
    let sampler = index(channel, "sampler").and_then(|s| list(animation, "samplers").get(s));
    let sampler = sampler.ok_or_else(|| broken("it has no sampler"))?;
    let width = match path {
        "rotation" => 4,
        "translation" => 3,
        "scale" | "weights" => return Err(Unavailable::NotRead("it neither turns nor shifts".to_owned())),
        other => {
            return Err(Unavailable::Broken(format!("it animates \"{}\", which nodes do not have", xml::brief(other))));
        }
    };
    let accessor =
        |key: &str| index(sampler, key).ok_or_else(|| Unavailable::Broken(format!("its sampler has no {key}")));
    let times: Vec<f64> = file.rows(accessor("input")?, 1)?.concat();
    let rows = file.rows(accessor("output")?, width)?;
    // A spline's keyframe is a slope, the value, a slope.
    let a_key = match sampler["interpolation"].as_str() {
        None | Some("LINEAR" | "STEP") => 1,
        Some("CUBICSPLINE") => 3,
        Some(other) => return Err(Unavailable::Broken(format!("\"{}\" is no interpolation", xml::brief(other)))),
    };
    if times.is_empty() || times.len().checked_mul(a_key) != Some(rows.len()) {
        let (have, keys) = (rows.len(), times.len());
        return Err(Unavailable::Broken(format!(
            "it has {have} values for {keys} keyframes, {a_key} for each are wanted"
        )));
    }
    if !times.windows(2).all(|w| w[0] < w[1]) {
        return Err(broken("its times do not rise"));
    }
    let rows = rows.iter().skip(a_key / 2).step_by(a_key);
    let values = if width == 4 {
        let turn = |v: &Vec<f64>| match v[..] {
            [x, y, z, w] => UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6),
            _ => None,
        };
        let turns: Option<Vec<_>> = rows.clone().map(turn).collect();
        let turns = turns.ok_or_else(|| broken("a rotation is 0"))?;
        let mut lengths = rows.map(|v| v.iter().map(|x| x * x).sum::<f64>().sqrt());
        if let Some(length) = lengths.find(|length| (length - 1.0).abs() > UNIT_ERROR) {
            let long = rounded(length, 3);
            return Err(Unavailable::Broken(format!(
                "a rotation has length {long}; quaternions of length 1 are wanted"
            )));
        }
        KeyframeValues::Turns(turns)
    } else {
        KeyframeValues::Shifts(rows.map(|v| Vector::from_column_slice(v)).collect())
    };
    Ok(Keyframes { times, values })
}

impl Keyframes {
    /// The key that is farthest from the first, and how far that is, rad or m.
    pub(super) fn farthest(&self) -> (usize, f64) {
        let mut best = (0, 0.0f64);
        match &self.values {
            KeyframeValues::Shifts(shifts) => {
                for (i, s) in shifts.iter().enumerate() {
                    let far = (s - shifts[0]).norm();
                    if far > best.1 {
                        best = (i, far);
                    }
                }
            }
            KeyframeValues::Turns(turns) => {
                // Added up step by step: whole turns count.
                let (mut angle, mut about) = (0.0f64, Vector::zeros());
                for (i, pair) in turns.windows(2).enumerate() {
                    let step = (pair[1] * pair[0].inverse()).scaled_axis();
                    if about == Vector::zeros() {
                        about = step;
                    }
                    angle += if step.dot(&about) < 0.0 { -step.norm() } else { step.norm() };
                    if angle > best.1 {
                        best = (i + 1, angle);
                    }
                }
            }
        }
        best
    }

    /// The value at a time, linear between keys.
    pub(super) fn at(&self, time: f64) -> KeyframeValue {
        let last = self.times.len() - 1;
        // One keyframe holds still.
        if last == 0 {
            return match &self.values {
                KeyframeValues::Shifts(s) => KeyframeValue::Shift(s[0]),
                KeyframeValues::Turns(t) => KeyframeValue::Turn(t[0]),
            };
        }
        let i = self.times.partition_point(|t| *t <= time).clamp(1, last);
        let share = ((time - self.times[i - 1]) / (self.times[i] - self.times[i - 1])).clamp(0.0, 1.0);
        match &self.values {
            KeyframeValues::Shifts(s) => KeyframeValue::Shift(s[i - 1].lerp(&s[i], share)),
            // Half a turn has no shortest way; the first key is as good as any.
            KeyframeValues::Turns(t) => KeyframeValue::Turn(t[i - 1].try_slerp(&t[i], share, 1e-9).unwrap_or(t[i - 1])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation;

    #[test]
    fn more_than_half_a_turn_is_counted_as_such() {
        let turns: Vec<_> = [0.0, 1.2, 2.4, 3.6, 2.4, 1.2, 0.0].map(|a| rotation(&Vector::y(), a)).to_vec();
        let times = (0..7).map(f64::from).collect();
        let channel = Keyframes { times, values: KeyframeValues::Turns(turns) };
        let (open, reaches) = channel.farthest();
        assert_eq!(open, 3);
        assert!((reaches - 3.6).abs() < 1e-9);
        let KeyframeValue::Turn(half) = channel.at(1.5) else { panic!("a turn") };
        assert!((half.angle() - 1.8).abs() < 1e-9);
    }
}
