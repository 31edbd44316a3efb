//! Readers of large files, one thread each. `cargo bench` makes its own; with `PAWS_BENCH_INPUT` set to a folder it takes the
//! files in it (`benches/import_side_by_side.py --inputs DIR` writes such files, for other programs as well).

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench that cannot run should say so at once")]

use std::fmt::Write as _;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use paws_twin::import::blob::Blob;
use paws_twin::import::capture::{Depth, DepthCoding};
use paws_twin::import::{ImportOptions, decode, formats};

/// The file or folder of a name: the one that is given, else what `make` writes.
fn source(made: &Path, name: &str, make: impl Fn(&Path)) -> PathBuf {
    let given = std::env::var_os("PAWS_BENCH_INPUT").map(|dir| PathBuf::from(dir).join(name)).filter(|p| p.exists());
    given.unwrap_or_else(|| {
        let path = made.join(name);
        make(&path);
        path
    })
}

/// A trajectory of 600,000 rows: ten minutes of a thousand poses a second.
fn trajectory(path: &Path) {
    let mut text = String::new();
    for i in 0..600_000 {
        let t = 1e-3 * f64::from(i);
        writeln!(text, "{:.6} {:.6} {:.6} 1.600000 0 0 {:.6} {:.6}", 1e5 + t, t.sin(), t.cos(), t.sin(), t.cos())
            .unwrap();
    }
    std::fs::write(path, text).unwrap();
}

/// A COLMAP model of 2,000 images with 2,000 observations each, and 100,000 points.
fn model(path: &Path) {
    std::fs::create_dir_all(path).unwrap();
    let mut cameras = 1u64.to_le_bytes().to_vec();
    cameras.extend(1u32.to_le_bytes());
    // PINHOLE.
    cameras.extend(1i32.to_le_bytes());
    cameras.extend([640u64, 480].iter().flat_map(|v| v.to_le_bytes()));
    cameras.extend([500.0f64, 500.0, 320.0, 240.0].iter().flat_map(|v| v.to_le_bytes()));
    std::fs::write(path.join("cameras.bin"), cameras).unwrap();
    let mut images = 2_000u64.to_le_bytes().to_vec();
    for id in 1..=2_000u32 {
        images.extend(id.to_le_bytes());
        let pose = [1.0, 0.0, 0.0, 0.0, 0.001 * f64::from(id), 0.0, 1.6];
        images.extend(pose.iter().flat_map(|v| v.to_le_bytes()));
        images.extend(1u32.to_le_bytes());
        images.extend(format!("frame_{id:06}.jpg\0").bytes());
        images.extend(2_000u64.to_le_bytes());
        for k in 0..2_000u32 {
            images.extend([f64::from(k % 640), f64::from(k % 480)].iter().flat_map(|v| v.to_le_bytes()));
            images.extend(u64::MAX.to_le_bytes());
        }
    }
    std::fs::write(path.join("images.bin"), images).unwrap();
    let mut points = 100_000u64.to_le_bytes().to_vec();
    for id in 1..=100_000u64 {
        points.extend(id.to_le_bytes());
        points.extend([1e-4 * id as f64, 1.0, 2.0].iter().flat_map(|v| v.to_le_bytes()));
        points.extend([9u8; 3]);
        points.extend(0.5f64.to_le_bytes());
        points.extend(0u64.to_le_bytes());
    }
    std::fs::write(path.join("points3D.bin"), points).unwrap();
}

/// A binary PLY of 2,000,000 points.
fn cloud(path: &Path) {
    let count = 2_000_000u32;
    let axes = "property float x\nproperty float y\nproperty float z";
    let mut bytes =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{axes}\nend_header\n").into_bytes();
    for i in 0..count {
        let x = 1e-3 * (i % 5_000) as f32;
        bytes.extend([x, 1.0, 0.5 * x].iter().flat_map(|v| v.to_le_bytes()));
    }
    std::fs::write(path, bytes).unwrap();
}

/// Depth of 1408 x 1408 pixels as numpy writes it.
fn depth(path: &Path) {
    let side = 1408usize;
    let mut dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({side}, {side}), }}");
    // The header's length is a multiple of 64, its last byte a line end.
    while !(10 + dict.len() + 1).is_multiple_of(64) {
        dict.push(' ');
    }
    dict.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((dict.len() as u16).to_le_bytes());
    bytes.extend(dict.bytes());
    bytes.extend((0..side * side).flat_map(|i| (1.0 + (i % side) as f32 * 1e-3).to_le_bytes()));
    std::fs::write(path, bytes).unwrap();
}

fn importers(c: &mut Criterion) {
    let made = tempfile::tempdir().unwrap();
    let options = ImportOptions::default();
    let sources = [
        ("import_tum", "tum", source(made.path(), "poses.txt", trajectory)),
        ("import_colmap", "colmap", source(made.path(), "model", model)),
        ("import_ply", "cloud", source(made.path(), "cloud.ply", cloud)),
    ];
    for (name, kind, path) in sources {
        let format = formats::named(kind).unwrap();
        c.bench_function(name, |b| b.iter(|| (format.read)(black_box(&path), &options).unwrap()));
    }
    let blob = Blob::File(source(made.path(), "depth.npy", depth));
    let how = Depth::of(DepthCoding::Npy { unit_m: 1.0 }, Vec::new());
    c.bench_function("import_npy", |b| b.iter(|| decode::depth(black_box(&blob), None, &how).unwrap()));
}

criterion_group! {
    name = readers;
    config = Criterion::default()
        .sample_size(10)
        .measurement_time(Duration::from_secs(3))
        .warm_up_time(Duration::from_millis(500));
    targets = importers
}
criterion_main!(readers);
