//! How the inference of a clip grows with the recording: one kitchen, played again and again, as `examples/long_recording.py`
//! does on disk. Its eight clips become 16 and 32; what matters is that the time an element stays the same.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench that cannot run should say so at once")]

mod kitchen;

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use paws_twin::config::Config;
use paws_twin::geometry::segments;
use paws_twin::pipeline;
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::recording::Recording;
use paws_twin::synth::{SynthOptions, Tier};

/// Seconds between the end of a round and the next one.
const PAUSE_SECS: f64 = 0.5;

/// A recording that shows everything so many times, one after the other. Images are the same files.
fn repeated(recording: &Recording, rounds: usize) -> Recording {
    let count = recording.frames.len();
    let (first, last) = (&recording.frames[0], &recording.frames[count - 1]);
    let period = last.timestamp_secs - first.timestamp_secs + PAUSE_SECS;
    let mut out = Recording { frames: Vec::new(), clips: Vec::new(), hands: Vec::new(), ..recording.clone() };
    for round in 0..rounds {
        let (later, by) = (round as f64 * period, round * count);
        out.frames.extend(recording.frames.iter().cloned().map(|mut frame| {
            frame.timestamp_secs += later;
            frame
        }));
        out.clips.extend(recording.clips.iter().cloned().map(|mut clip| {
            clip.clip = format!("{}_{round}", clip.clip);
            clip.start_frame += by;
            clip.end_frame += by;
            clip
        }));
        out.hands.extend(recording.hands.iter().copied().map(|mut hand| {
            hand.frame += by;
            hand
        }));
    }
    out
}

fn growth(c: &mut Criterion) {
    let (_dir, short) = kitchen::recorded(&SynthOptions { seed: 1, tier: Tier::Hd, width: 160, parts: 4 });
    let config = Config::default();
    let reasoner = Geometric::of(&config);
    let mut group = c.benchmark_group("growth");
    for rounds in [1, 2, 4] {
        let recording = repeated(&short, rounds);
        let clips = recording.clips.len();
        group.throughput(Throughput::Elements(clips as u64));
        group.bench_with_input(BenchmarkId::new("infer", clips), &recording, |b, recording| {
            b.iter(|| {
                pipeline::infer(black_box(recording), &config, &segments::Lsd, &reasoner, &|_, _, _| {}).unwrap()
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = how_work_grows;
    config = Criterion::default()
        .sample_size(10)
        .measurement_time(Duration::from_secs(5))
        .warm_up_time(Duration::from_millis(200));
    targets = growth
}
criterion_main!(how_work_grows);
