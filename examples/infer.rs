//! The library in a few lines: a recording in, joints out.
//!
//! `cargo run --release --example infer -- demo/kitchen`

use paws_twin::config::Config;
use paws_twin::geometry::segments::Lsd;
use paws_twin::pipeline;
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::recording::Recording;

#[allow(clippy::print_stdout, reason = "an example prints")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("give a recording's folder (`paws demo` makes one)")?;
    let config = Config::default();
    let recording = Recording::open(folder.as_ref())?;
    let reasoner = Geometric { reasoning: config.reasoning.clone(), inference: config.inference.clone() };
    let scene = pipeline::infer(&recording, &config, &Lsd, &reasoner, &|_, _, _| {})?;
    for joint in &scene.joints {
        println!(
            "{}: {:?} about {:.3?} through {:.3?}, seen in {}",
            joint.id,
            joint.joint.kind,
            joint.joint.axis.as_slice(),
            joint.joint.origin.coords.as_slice(),
            joint.clips.join(", ")
        );
    }
    for clip in &scene.clips {
        if let Some(reason) = clip.joint.reason().filter(|_| scene.joint_of(&clip.clip.clip).is_none()) {
            println!("{}: no answer, {reason}", clip.clip.clip);
        }
    }
    Ok(())
}
