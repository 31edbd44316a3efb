//! The same input gives the same bytes, on any number of threads.

use std::collections::BTreeMap;
use std::process::Command;

use crate::common::{SMALL, tree};

fn twin(threads: &str) -> BTreeMap<String, Vec<u8>> {
    let dir = tempfile::tempdir().unwrap();
    let status = Command::new(env!("CARGO_BIN_EXE_paws"))
        .args(["twin", SMALL.path().to_str().unwrap(), "--out", "t", "--keep"])
        .env("RAYON_NUM_THREADS", threads)
        .current_dir(dir.path())
        .output()
        .unwrap();
    assert_ne!(status.status.code(), Some(2), "{}", String::from_utf8_lossy(&status.stderr));
    tree(&dir.path().join("t"))
}

#[test]
fn one_thread_and_three_write_the_same_files() {
    let (one, three) = (twin("1"), twin("3"));
    assert!(one.len() >= 12, "{:?}", one.keys());
    assert_eq!(one.keys().collect::<Vec<_>>(), three.keys().collect::<Vec<_>>());
    for (name, bytes) in &one {
        assert!(bytes == &three[name], "{name} differs");
    }
}
