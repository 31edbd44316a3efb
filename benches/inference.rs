//! What our inference of a clip costs by itself, one thread: of the eight clips of a rendered kitchen, whose lines, faces, outlines
//! and candidates are known.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench that cannot run should say so at once")]

mod kitchen;

use std::collections::BTreeMap;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use paws_twin::config::Config;
use paws_twin::geometry::{AxisCandidate, candidates, segments};
use paws_twin::hands;
use paws_twin::inference;
use paws_twin::part::likelihood::OpenDepth;
use paws_twin::part::{likelihood, views};
use paws_twin::pipeline;
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::reasoning::{Question, Reasoner};
use paws_twin::recording::sketch::Sketch;
use paws_twin::recording::{Recording, narration};
use paws_twin::synth::{SynthOptions, Tier};

/// From the hand and the names alone, and with the depth of the open states asked about every candidate.
fn posterior(c: &mut Criterion) {
    let (_dir, recording) = kitchen::recorded(&SynthOptions { seed: 1, tier: Tier::T2, width: 320, parts: 4 });
    let config = Config::default();
    let reasoner = Geometric::of(&config);
    let scene = pipeline::infer(&recording, &config, &segments::Lsd, &reasoner, &|_, _, _| {}).unwrap();
    let recording = Recording { depth_factors: scene.depth_factors, ..recording };
    let clips: Vec<&pipeline::ClipResult> = scene.clips.iter().filter(|c| c.joint.found().is_some()).collect();
    let mut sketches = BTreeMap::new();
    for clip in &clips {
        for open in views::open_frames(&recording, &clip.clip, clip.trajectory.as_ref().unwrap(), &config.part) {
            let depth = recording.depth_as_read(open.frame).unwrap().unwrap();
            let mask = recording.mask(open.frame).unwrap();
            sketches.insert(open.frame, Sketch::of(open.frame, &depth, mask.as_ref()));
        }
    }
    let infer = |clip: &pipeline::ClipResult, with_depth: bool| {
        let trajectory = clip.trajectory.as_ref().unwrap();
        let (path, face) = (trajectory.positions(), clip.face.as_ref().unwrap());
        let paths = [path.clone()];
        let candidates: Vec<AxisCandidate> =
            clip.candidates.iter().map(|c| candidates::settled(c, &paths, &config.reasoning)).collect();
        let grip = trajectory.closed_grip();
        let agreement = if with_depth {
            let open = views::open_views(&recording, &sketches, &clip.clip, trajectory, &config.part);
            let depth = OpenDepth::of(face, clip.part.as_ref(), &open, &config.part);
            let grip_std = hands::GripStd::of(trajectory, &config.hands.grips);
            likelihood::log_likelihoods(&depth, candidates.iter().map(|c| &c.joint), &grip, grip_std)
        } else {
            vec![0.0; candidates.len()]
        };
        let answer = reasoner.answer(&Question {
            reading: &narration::read(&clip.clip),
            words: None,
            path: &path,
            grip,
            candidates: &candidates,
            agreement: &agreement,
            part: None,
            face: Some(face),
            up: recording.up(),
        });
        inference::infer(trajectory, &candidates, &answer, Some(face), true, &config.reasoning, &config.inference)
    };
    assert_eq!(clips.len(), 8, "the time is read as that of eight clips");
    for (name, with_depth) in [("posterior_hand", false), ("posterior_depth", true)] {
        c.bench_function(name, |b| {
            b.iter(|| {
                for clip in &clips {
                    black_box(infer(black_box(clip), with_depth));
                }
            });
        });
    }
}

criterion_group! {
    name = inference_alone;
    config = Criterion::default().sample_size(10);
    targets = posterior
}
criterion_main!(inference_alone);
