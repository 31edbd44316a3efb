//! Real videos, made by ffmpeg where it is installed: pictures by their times, the right way up, each file decoded once.

#![cfg(unix)]

use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

use image::{GrayImage, Luma};

use crate::common::skipped;
use crate::import::{FRAMES, import, json, still, write, write_stray};

const WIDTH: u32 = 96;
const HEIGHT: u32 = 64;
const PICTURES: u32 = 12;
/// Columns of the bar that tells a picture's number.
const BAR: u32 = WIDTH / PICTURES;

/// Runs ffmpeg; what it says where it fails.
fn ffmpeg(args: &[&str], dir: &Path) -> Result<(), String> {
    let out = Command::new("ffmpeg").args(["-nostdin", "-v", "error", "-y"]).args(args).current_dir(dir).output();
    let out = out.map_err(|e| e.to_string())?;
    if out.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&out.stderr).into_owned()) }
}

/// Whether ffmpeg and ffprobe are there; where they are not, the check is skipped.
fn is_installed() -> bool {
    let has = |name: &str| Command::new(name).arg("-version").output().is_ok_and(|o| o.status.success());
    let both = has("ffmpeg") && has("ffprobe");
    if !both {
        skipped("real videos are made and read where ffmpeg is installed");
    }
    both
}

/// ffmpeg and ffprobe that write down their calls.
fn counted(dir: &Path) -> String {
    for name in ["ffmpeg", "ffprobe"] {
        let path = dir.join("bin").join(name);
        write(&path, format!("#!/bin/sh\necho \"$@\" >> \"{}/calls_{name}\"\nexec {name} \"$@\"\n", dir.display()));
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }
    dir.join("bin/ffmpeg").to_str().unwrap().to_owned()
}

fn calls(dir: &Path, name: &str) -> usize {
    std::fs::read_to_string(dir.join(format!("calls_{name}"))).map_or(0, |text| text.lines().count())
}

/// A video codec that this ffmpeg writes, of these.
fn encoder(names: &[&'static str]) -> Option<&'static str> {
    let out = Command::new("ffmpeg").args(["-hide_banner", "-encoders"]).output().ok()?;
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    names.iter().copied().find(|n| text.split_whitespace().any(|word| word == *n))
}

/// Pictures with a white mark in the right upper corner and a bar that goes to the right, as PNG files.
fn write_pictures(dir: &Path) {
    std::fs::create_dir_all(dir.join("png")).unwrap();
    for i in 0..PICTURES {
        let picture = GrayImage::from_fn(WIDTH, HEIGHT, |x, y| {
            let is_mark = x >= WIDTH - 20 && y < 16;
            let is_bar = y >= 24 && x / BAR == i;
            Luma([if is_mark || is_bar { 235 } else { 20 }])
        });
        picture.save(dir.join(format!("png/{i:06}.png"))).unwrap();
    }
}

/// Encodes the pictures, ten a second, with more of ffmpeg's arguments. Every picture keeps its own time.
fn encode(dir: &Path, codec: &str, more: &[&str], file: &str) {
    let each = |option: &'static str| {
        let mut args = vec!["-framerate", "10", "-start_number", "0", "-i", "png/%06d.png"];
        args.extend(more);
        args.extend([option, "passthrough", "-c:v", codec, "-pix_fmt", "yuv420p", file]);
        ffmpeg(&args, dir)
    };
    // The option has another name before ffmpeg 5.1.
    each("-fps_mode").or_else(|_| each("-vsync")).unwrap();
}

/// The camera's poses, looking ahead along y with z up, one in a hundredth of a second.
fn write_poses(dir: &Path) {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let rows: String = (0..200)
        .map(|k| format!("{} {} 0 1.5 -{half} 0 0 {half}\n", 0.01 * f64::from(k), 0.01 * f64::from(k)))
        .collect();
    write(&dir.join("poses.txt"), rows);
}

fn open(dir: &Path, frame: usize) -> GrayImage {
    image::open(dir.join(format!("out/frames/{frame:06}.jpg"))).unwrap().into_luma8()
}

/// Mean brightness of a part of an image.
fn mean(image: &GrayImage, x: std::ops::Range<u32>, y: std::ops::Range<u32>) -> f64 {
    let all: Vec<f64> =
        y.flat_map(|y| x.clone().map(move |x| (x, y))).map(|(x, y)| f64::from(image.get_pixel(x, y).0[0])).collect();
    all.iter().sum::<f64>() / all.len() as f64
}

/// The number that a picture's bar tells.
fn number(image: &GrayImage) -> u32 {
    let of = |i: &u32| mean(image, i * BAR..(i + 1) * BAR, 28..HEIGHT);
    (0..PICTURES).max_by(|a, b| of(a).total_cmp(&of(b))).unwrap()
}

/// Imports a video with poses; times of the frames, and the numbers of their pictures.
fn imported(dir: &Path, file: &str, size: [u32; 2]) -> Vec<(f64, GrayImage)> {
    let [w, h] = size;
    let camera = format!("{w},{h},60,60,{},{}", 0.5 * f64::from(w - 1), 0.5 * f64::from(h - 1));
    import(&[file, "tum=poses.txt", "--camera", &camera, "--up", "z", "--fps", "0", "--ffmpeg", &counted(dir)], dir);
    let cameras = json(&dir.join("out/cameras.json"));
    let frames = cameras["frames"].as_array().unwrap();
    frames.iter().enumerate().map(|(i, f)| (f["timestamp"].as_f64().unwrap(), open(dir, i))).collect()
}

#[test]
fn pictures_of_uneven_times_keep_them_and_are_decoded_once() {
    if !is_installed() {
        return;
    }
    let codecs = [encoder(&["libx264", "mpeg4"]), encoder(&["libx265"])];
    if codecs[1].is_none() {
        skipped("a HEVC video is read where ffmpeg has libx265");
    }
    // The fifth to the eighth are left out, so that the rate changes.
    let kept: Vec<u32> = (0..4).chain(8..PICTURES).collect();
    for codec in codecs.into_iter().flatten() {
        let dir = tempfile::tempdir().unwrap();
        write_pictures(dir.path());
        write_poses(dir.path());
        encode(dir.path(), codec, &["-vf", "select=lt(n\\,4)+gte(n\\,8)"], "walk.mp4");
        let frames = imported(dir.path(), "walk.mp4", [WIDTH, HEIGHT]);
        let numbers: Vec<u32> = frames.iter().map(|(_, image)| number(image)).collect();
        assert_eq!(numbers, kept, "{codec}");
        for (i, (time, _)) in kept.iter().zip(&frames) {
            assert!((time - frames[0].0 - 0.1 * f64::from(*i)).abs() < 1e-3, "{codec} {i}: {time}");
        }
        assert_eq!(calls(dir.path(), "ffmpeg"), 1, "{codec}");
    }
}

/// Writes that a file is to be shown turned by a quarter; its pictures stay as they are.
fn turn(dir: &Path, from: &str, to: &str) {
    let by_option = ffmpeg(&["-display_rotation", "90", "-i", from, "-c", "copy", to], dir);
    // The option came with ffmpeg 6, which takes this one no more.
    by_option.or_else(|_| ffmpeg(&["-i", from, "-c", "copy", "-metadata:s:v:0", "rotate=90", to], dir)).unwrap();
}

/// Whether each corner is white: left upper, right upper, left lower, right lower.
fn corners(image: &GrayImage) -> [bool; 4] {
    let (w, h) = image.dimensions();
    [(0, 0), (w - 8, 0), (0, h - 8), (w - 8, h - 8)].map(|(x, y)| mean(image, x..x + 8, y..y + 8) > 120.0)
}

#[test]
fn a_video_stands_as_players_show_it() {
    if !is_installed() {
        return;
    }
    let Some(codec) = encoder(&["libx264", "mpeg4"]) else { return skipped("ffmpeg writes neither H.264 nor MPEG-4") };
    let dir = tempfile::tempdir().unwrap();
    write_pictures(dir.path());
    write_poses(dir.path());
    encode(dir.path(), codec, &[], "flat.mp4");
    turn(dir.path(), "flat.mp4", "walk.mp4");
    ffmpeg(&["-i", "walk.mp4", "-vf", "select=eq(n\\,5)", "-frames:v", "1", "shown.png"], dir.path()).unwrap();
    let shown = image::open(dir.path().join("shown.png")).unwrap().into_luma8();
    assert_eq!(shown.dimensions(), (HEIGHT, WIDTH));
    let frames = imported(dir.path(), "walk.mp4", [HEIGHT, WIDTH]);
    assert_eq!(frames.len(), PICTURES as usize);
    assert_eq!(frames[0].1.dimensions(), (HEIGHT, WIDTH));
    // Only the mark is in a corner of this picture.
    assert_eq!(corners(&frames[5].1), corners(&shown));
    assert_eq!(corners(&shown).iter().filter(|white| **white).count(), 1);
    assert_eq!(calls(dir.path(), "ffmpeg"), 1);
}

/// Poses and intrinsics of a phone are the sensor's: its video is not turned.
#[test]
fn a_phones_video_stays_as_the_sensor_has_it() {
    if !is_installed() {
        return;
    }
    let Some(codec) = encoder(&["libx264", "mpeg4"]) else { return skipped("ffmpeg writes neither H.264 nor MPEG-4") };
    let dir = tempfile::tempdir().unwrap();
    write_stray(&dir.path().join("scan"));
    let pattern = still("frames", 0).with_file_name("%06d.jpg");
    let count = FRAMES.to_string();
    let pattern = pattern.to_str().unwrap();
    let args = ["-framerate", "10", "-start_number", "0", "-i", pattern, "-frames:v", count.as_str(), "-c:v", codec];
    ffmpeg(&[&args[..], &["-pix_fmt", "yuv420p", "flat.mp4"]].concat(), dir.path()).unwrap();
    turn(dir.path(), "flat.mp4", "scan/rgb.mp4");
    import(&["scan", "--fps", "0", "--ffmpeg", &counted(dir.path())], dir.path());
    for i in [0, 7, FRAMES - 1] {
        let (mine, theirs) = (open(dir.path(), i), image::open(still("frames", i)).unwrap().into_luma8());
        assert_eq!(mine.dimensions(), theirs.dimensions());
        let off = |a: &GrayImage, b: &GrayImage| {
            let sum: f64 = a.pixels().zip(b.pixels()).map(|(p, q)| f64::from(p.0[0].abs_diff(q.0[0]))).sum();
            sum / f64::from(a.width() * a.height())
        };
        assert!(off(&mine, &theirs) < 12.0, "frame {i}: {}", off(&mine, &theirs));
    }
    assert_eq!(calls(dir.path(), "ffmpeg"), 1);
}
