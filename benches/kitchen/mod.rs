//! A rendered kitchen on disk, for benches that read images.

use paws_twin::recording::Recording;
use paws_twin::synth::{Recorded, SynthOptions};
use tempfile::TempDir;

/// The recording and its folder, which goes when it is dropped.
pub fn recorded(options: &SynthOptions) -> (TempDir, Recording) {
    let dir = tempfile::tempdir().unwrap();
    let recorded = Recorded::new(options).unwrap();
    let images = (0..recorded.frames()).flat_map(|frame| recorded.images(frame).unwrap());
    let tables = recorded.tables().unwrap().into_iter().map(|(name, text)| (name, text.into_bytes()));
    for (name, bytes) in tables.chain(images) {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    let recording = Recording::open(dir.path()).unwrap();
    (dir, recording)
}
