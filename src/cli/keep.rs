//! `--keep`: every intermediate result, to look at.

use std::collections::BTreeSet;
use std::fmt::Write;

use anyhow::Context;
use image::{Rgb, RgbImage};

use super::output::Output;
use super::words::Exchange;
use crate::json;
use crate::math::Point;
use crate::pipeline::{ClipResult, Scene};
use crate::recording::{Camera, Recording};
use crate::twin::Twin;

/// Writes every clip's steps; what could not be written of one, with the reason, costs the others nothing.
pub fn write(
    recording: &Recording,
    scene: &Scene,
    twin: &Twin,
    exchanges: &[Exchange],
    output: &Output,
) -> Vec<String> {
    let names: Vec<&str> = scene.clips.iter().map(|c| c.clip.clip.as_str()).collect();
    let mut lost = Vec::new();
    for (clip, folder) in scene.clips.iter().zip(folders(&names)) {
        let folder = format!("steps/{folder}");
        if let Err(error) = write_clip(recording, scene, clip, twin, exchanges, output, &folder) {
            lost.push(format!("steps of clip {}: {error:#}", clip.clip.clip));
        }
    }
    lost
}

/// A folder for each clip: a clip's name may be anything and as long as it likes, a folder's may not, and two clips have two
/// folders also where a file system takes capitals for small letters.
fn folders(names: &[&str]) -> Vec<String> {
    // File systems take 255 bytes; four a letter, a number behind it.
    const MOST: usize = 60;
    let mut taken = BTreeSet::new();
    let mut all = Vec::with_capacity(names.len());
    for name in names {
        let plain: String = name
            .chars()
            .take(MOST)
            .map(|c| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '_' })
            .collect();
        let plain = if plain.trim_matches('.').is_empty() { "clip".to_owned() } else { plain };
        let mut folder = plain.clone();
        let mut number = 1;
        while !taken.insert(folder.to_lowercase()) {
            number += 1;
            folder = format!("{plain}_{number}");
        }
        all.push(folder);
    }
    all
}

fn write_clip(
    recording: &Recording,
    scene: &Scene,
    clip: &ClipResult,
    twin: &Twin,
    exchanges: &[Exchange],
    output: &Output,
    folder: &str,
) -> anyhow::Result<()> {
    output.write(&format!("{folder}/clip.json"), json::text(clip)?)?;
    if let Some(trajectory) = &clip.trajectory {
        let mut text = String::from("frame,time_secs,observed_x,observed_y,observed_z,x,y,z,accepted\n");
        for s in &trajectory.samples {
            let (o, p) = (s.observed, s.smoothed);
            let accepted = u8::from(s.accepted);
            writeln!(text, "{},{},{},{},{},{},{},{},{accepted}", s.frame, s.time_secs, o.x, o.y, o.z, p.x, p.y, p.z)?;
        }
        output.write(&format!("{folder}/trajectory.csv"), text)?;
    }
    if let Some(region) = &clip.region {
        let centers = region.centers();
        let mut text = format!(
            "ply\nformat ascii 1.0\ncomment confident voxels\nelement vertex {}\nproperty float x\nproperty float y\n\
             property float z\nend_header\n",
            centers.len()
        );
        for c in centers {
            writeln!(text, "{} {} {}", c.x as f32, c.y as f32, c.z as f32)?;
        }
        output.write(&format!("{folder}/region.ply"), text)?;
    }
    if !clip.lines.is_empty() {
        let mut text = String::from("# 3D lines\n");
        for (i, line) in clip.lines.iter().enumerate() {
            for p in line.segment.ends() {
                writeln!(text, "v {} {} {}", p.x, p.y, p.z)?;
            }
            writeln!(text, "l {} {}", 2 * i + 1, 2 * i + 2)?;
        }
        output.write(&format!("{folder}/lines.obj"), text)?;
    }
    for exchange in exchanges.iter().filter(|e| e.clip() == clip.clip.clip) {
        let name = format!("{folder}/vlm/{}", exchange.name());
        let answer = exchange.answer.as_deref().unwrap_or("(none)");
        output.write(&format!("{name}.txt"), format!("{}\n--- answer ---\n{answer}\n", exchange.question.text))?;
        if let Some(picture) = exchange.question.pictures.first() {
            output.write(&format!("{name}.jpg"), &picture.bytes)?;
        }
    }
    marked_image(recording, scene, clip, twin, output, folder)
}

const LINE: Rgb<u8> = Rgb([70, 140, 255]);
const PART: Rgb<u8> = Rgb([60, 210, 90]);
const AXIS: Rgb<u8> = Rgb([255, 205, 0]);
const HAND: Rgb<u8> = Rgb([255, 70, 60]);

/// What was found, drawn into the local frame nearest to the interaction: lines blue, part green, axis yellow, hand red.
fn marked_image(
    recording: &Recording,
    scene: &Scene,
    clip: &ClipResult,
    twin: &Twin,
    output: &Output,
    folder: &str,
) -> anyhow::Result<()> {
    let Some(&frame) = clip.region.as_ref().and_then(|r| r.local_frames.first()) else { return Ok(()) };
    let (Some(seen), Some(grid)) = (recording.frames.get(frame), recording.rgb(frame)?) else { return Ok(()) };
    let mut image = RgbImage::from_fn(grid.width as u32, grid.height as u32, |x, y| {
        Rgb(grid.get(x as usize, y as usize).unwrap_or_default())
    });
    let camera_from_world = seen.world_from_camera.inverse();
    let camera = recording.camera_of(frame);
    let mut draw = |a: &Point, b: &Point, color: Rgb<u8>, half: i64| {
        stroke(&mut image, camera, &(camera_from_world * a), &(camera_from_world * b), color, half);
    };
    for line in &clip.lines {
        let [a, b] = line.segment.ends();
        draw(&a, &b, LINE, 0);
    }
    let joint = scene.joint_of(&clip.clip.clip);
    if let Some(part) = joint.and_then(|j| twin.furniture.iter().map(|f| &f.part).find(|p| p.id == j.id)) {
        for solid in part.solids.iter().take(1) {
            let c = solid.shape.corners();
            for (i, j) in
                [(0, 1), (1, 3), (3, 2), (2, 0), (4, 5), (5, 7), (7, 6), (6, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
            {
                draw(&c[i], &c[j], PART, 1);
            }
        }
        let phi = part.joint.articulation;
        let reach = match phi.kind {
            crate::articulation::JointKind::Revolute => part.bounds.half.max(),
            crate::articulation::JointKind::Prismatic => 0.5 * part.joint.upper,
        };
        let from = if phi.kind == crate::articulation::JointKind::Prismatic {
            part.handle
        } else {
            phi.origin - phi.axis * reach
        };
        draw(&from, &(from + phi.axis * (2.0 * reach)), AXIS, 2);
    }
    if let Some(trajectory) = &clip.trajectory {
        for pair in trajectory.samples.windows(2) {
            draw(&pair[0].smoothed, &pair[1].smoothed, HAND, 1);
        }
    }
    let path = output.path(&format!("{folder}/marked.png"))?;
    image.save(&path).with_context(|| path.display().to_string())
}

/// A line between two points of the camera frame, clipped at the image plane.
fn stroke(image: &mut RgbImage, camera: &Camera, a: &Point, b: &Point, color: Rgb<u8>, half: i64) {
    const NEAR_M: f64 = 0.05;
    if a.z < NEAR_M && b.z < NEAR_M {
        return;
    }
    let clip = |p: &Point, q: &Point| if p.z < NEAR_M { p + (q - p) * ((NEAR_M - p.z) / (q.z - p.z)) } else { *p };
    let (a, b) = (clip(a, b), clip(b, a));
    let (Some((u0, v0)), Some((u1, v1))) = (camera.project(&a), camera.project(&b)) else { return };
    let steps = (u1 - u0).abs().max((v1 - v0).abs()).ceil().clamp(1.0, 8000.0) as usize;
    for i in 0..=steps {
        let t = i as f64 / steps as f64;
        let (u, v) = (u0 + (u1 - u0) * t, v0 + (v1 - v0) * t);
        for dv in -half..=half {
            for du in -half..=half {
                let (x, y) = (u.round() + du as f64, v.round() + dv as f64);
                if x >= 0.0 && y >= 0.0 && x < f64::from(image.width()) && y < f64::from(image.height()) {
                    image.put_pixel(x as u32, y as u32, color);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::folders;

    #[test]
    fn every_clip_has_a_folder_of_its_own() {
        let long = "x".repeat(300);
        let names = ["a/b", "a_b", "A_B", "..", "", &long, &long, "\u{1f6aa}", "öffnen"];
        let made = folders(&names);
        assert_eq!(made[..5], ["a_b", "a_b_2", "A_B_3", "clip", "clip_2"]);
        assert!(made[5].len() < 255 && made[5] != made[6] && made[8] == "öffnen", "{made:?}");
    }
}
