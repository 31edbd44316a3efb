//! The library in a few lines: a recording in, joints with their verdicts out.
//!
//! `cargo run --release --example infer -- demo/kitchen`

use paws_twin::{Config, Made, Recording};

#[allow(clippy::print_stdout, reason = "an example prints")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("give a recording's folder (`paws demo` makes one)")?;
    let made = Made::of(&Recording::open(folder.as_ref())?, &Config::default())?;
    for joint in &made.scene.joints {
        println!(
            "{}: {:?} about {:.3?} through {:.3?}, seen in {}",
            joint.id,
            joint.joint.kind,
            joint.joint.axis.as_slice(),
            joint.joint.origin.coords.as_slice(),
            joint.clips.join(", ")
        );
    }
    for check in &made.validation.joints {
        println!("{}: {}: {}", check.id, check.verdict.word(), check.reason);
    }
    for clip in &made.scene.clips {
        if let Some(reason) = clip.joint.reason().filter(|_| made.scene.joint_of(&clip.clip.clip).is_none()) {
            println!("{}: no answer, {reason}", clip.clip.clip);
        }
    }
    Ok(())
}
