//! A recording that is held in memory, depth and images as arrays, becomes a MuJoCo model.
//!
//! `cargo run --release --example memory -- demo/kitchen scene.xml`
//!
//! A folder stands for the device or the program that such arrays come from: what is said of the units holds for any.

use paws_twin::recording::segments::Ends;
use paws_twin::{Config, Grid, Made, MemoryFrame, MemoryRecording, Recording, export};

/// All that is seen, in memory.
fn held(seen: &Recording) -> paws_twin::Result<MemoryRecording> {
    let mut held = MemoryRecording::new("kitchen", seen.camera);
    for (index, frame) in seen.frames.iter().enumerate() {
        // Metres along the optical axis, row by row; 0 where there is none.
        let depth: Option<Grid<f32>> = seen.depth(index)?;
        // The class of each pixel; 255 is a hand.
        let mask: Option<Grid<u8>> = seen.mask(index)?;
        let segments: Option<Vec<Ends>> = seen.segments(index)?;
        let (rgb, normals) = (seen.rgb(index)?, seen.normals(index)?);
        // Seconds, and the camera's pose: OpenCV axes to a world with +Z up.
        let at = MemoryFrame::new(frame.timestamp_secs, frame.world_from_camera);
        held.frames.push(MemoryFrame { depth, rgb, mask, normals, segments, ..at });
    }
    // Fingertips in the world, metres.
    held.hands = seen.hands.clone();
    // What people say, and when. Without clips interactions are found by the hands.
    held.clips = seen.clips.clone();
    held.labels = seen.labels.clone();
    Ok(held)
}

#[allow(clippy::print_stdout, reason = "an example prints")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (folder, out) = (std::env::args().nth(1), std::env::args().nth(2));
    let folder = folder.ok_or("give a recording's folder (`paws demo` makes one), and a file for the model")?;
    let recording = Recording::from_memory(held(&Recording::open(folder.as_ref())?)?)?;
    let made = Made::of(&recording, &Config::default())?;
    for check in &made.validation.joints {
        println!("{}: {}", check.id, check.verdict.word());
    }
    std::fs::write(out.as_deref().unwrap_or("scene.xml"), export::mjcf::write(&made.twin, None)?)?;
    Ok(())
}
