//! The steps that see most data, one thread each. `cargo bench` makes its own inputs; with `PAWS_BENCH_INPUT` set to a folder
//! of .npy files it takes those (`benches/side_by_side.py` writes them, so that other programs run on the same bytes).

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench that cannot run should say so at once")]

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use paws_twin::articulation::{Action, Articulation, JointKind};
use paws_twin::config::{self, Config};
use paws_twin::geometry::segments::Lsd;
use paws_twin::geometry::{AxisCandidate, AxisSource, detector, manhattan, segments};
use paws_twin::hands::{self, Trajectory};
use paws_twin::inference;
use paws_twin::localization::{Region, views, voxels};
use paws_twin::look::{Look, Texture, TexturedMesh};
use paws_twin::math::{Point, Pose, Vector, kalman};
use paws_twin::reasoning::heuristic::Geometric;
use paws_twin::recording::sketch::Sketch;
use paws_twin::recording::{Camera, Frame, FrameFiles, Grid, Recording};
use paws_twin::synth::{Recorded, SynthOptions, Tier};
use paws_twin::twin::Twin;
use paws_twin::{appearance, export, fitting, pipeline};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// One array of a stage's inputs, flat, with its shape; `None` where no folder is given.
fn input<T: npyz::Deserialize>(stage: &str, name: &str) -> Option<(Vec<u64>, Vec<T>)> {
    let path = PathBuf::from(std::env::var_os("PAWS_BENCH_INPUT")?).join(stage).join(format!("{name}.npy"));
    if !path.is_file() {
        return None;
    }
    let array = npyz::NpyFile::new(std::io::BufReader::new(std::fs::File::open(path).unwrap())).unwrap();
    Some((array.shape().to_vec(), array.into_vec().unwrap()))
}

fn points(flat: &[f64]) -> Vec<Point> {
    flat.chunks_exact(3).map(|c| Point::new(c[0], c[1], c[2])).collect()
}

fn stage(c: &mut Criterion, name: &str, mut run: impl FnMut()) {
    c.bench_function(name, |b| b.iter(&mut run));
}

/// Distinct views of 5 cm voxels over a cloud.
fn voxel_views(c: &mut Criterion) {
    for (stage_name, count) in [("voxel_views", 1_000_000), ("voxel_views_10m", 10_000_000)] {
        let seen: Vec<(u32, Point)> = match (input::<f32>(stage_name, "points"), input::<u16>(stage_name, "view")) {
            (Some((_, p)), Some((_, v))) => {
                let all = points(&p.into_iter().map(f64::from).collect::<Vec<_>>());
                v.into_iter().map(u32::from).zip(all).collect()
            }
            // Walls of a room of 4 x 4 x 2.5 m.
            _ => {
                let mut rng = Pcg64Mcg::seed_from_u64(1);
                (0..count)
                    .map(|i| {
                        let (a, b) = (rng.random_range(0.0..4.0), rng.random_range(0.0..2.5));
                        let p = if i % 2 == 0 { Point::new(a, 0.0, b) } else { Point::new(0.0, a, b) };
                        ((i * 50 / count) as u32, p)
                    })
                    .collect()
            }
        };
        stage(c, stage_name, || {
            black_box(voxels::count_views(black_box(&seen), 0.05));
        });
    }
}

/// Frames that see a front, then 50 of them spread over the camera's places.
fn view_select(c: &mut Criterion) {
    for (stage_name, count) in [("view_select", 6_000), ("view_select_100k", 100_000)] {
        let poses: Vec<Pose> = match input::<f64>(stage_name, "poses") {
            Some((_, p)) => p
                .chunks_exact(16)
                .map(|m| {
                    let r = nalgebra::Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
                    let turn = nalgebra::UnitQuaternion::from_matrix(&r);
                    Pose::from_parts(Vector::new(m[3], m[7], m[11]).into(), turn)
                })
                .collect(),
            None => {
                let mut rng = Pcg64Mcg::seed_from_u64(2);
                (0..count)
                    .map(|_| {
                        let eye = Vector::new(rng.random_range(0.0..4.0), rng.random_range(-2.5..-0.5), 1.6);
                        let turn = nalgebra::UnitQuaternion::from_euler_angles(-1.9, 0.0, rng.random_range(-3.0..3.0));
                        Pose::from_parts(eye.into(), turn)
                    })
                    .collect()
            }
        };
        let centers = input::<f64>(stage_name, "voxels").map_or_else(
            || {
                (0..400)
                    .map(|i| Point::new(1.4 + 0.05 * f64::from(i % 20), 0.6, 0.1 + 0.05 * f64::from(i / 20)))
                    .collect()
            },
            |(_, v)| points(&v),
        );
        let region = Region {
            voxel_m: 0.05,
            voxels: centers.iter().map(|p| voxels::index(p, 0.05)).collect(),
            min_views: 4,
            class: None,
            local_frames: Vec::new(),
            other_frames: Vec::new(),
            viewpoint: Point::origin(),
            grip: Point::origin(),
        };
        let files = FrameFiles { rgb: Some(PathBuf::from("x")), ..Default::default() };
        let frames = poses
            .into_iter()
            .enumerate()
            .map(|(i, world_from_camera)| Frame { timestamp_secs: i as f64, world_from_camera, files: files.clone() })
            .collect();
        let recording = Recording {
            frames,
            ..Recording::empty(Camera { width: 1408, height: 1408, fx: 610.0, fy: 610.0, cx: 703.5, cy: 703.5 })
        };
        let idle: Vec<usize> = (0..recording.frames.len()).collect();
        let config = config::Localization { min_visible_share: 0.5, ..Default::default() };
        stage(c, stage_name, || {
            black_box(views::reselect(black_box(&recording), &idle, &region, None, &config));
        });
    }
}

/// Segments of images.
fn lsd(c: &mut Criterion) {
    for (stage_name, [width, height], count) in [("lsd", [1408, 1408], 2), ("lsd_456", [456, 256], 10)] {
        let images: Vec<Grid<u8>> = match input::<u8>(stage_name, "gray") {
            Some((shape, data)) => {
                let (height, width) = (shape[1] as usize, shape[2] as usize);
                data.chunks_exact(width * height).map(|d| Grid { width, height, data: d.to_vec() }).collect()
            }
            // Boards of many sizes with a camera's grain.
            None => {
                let mut rng = Pcg64Mcg::seed_from_u64(3);
                (0..count)
                    .map(|_| {
                        let mut image = Grid::filled(width, height, 120u8);
                        for _ in 0..60 {
                            let (x, y) = (rng.random_range(0..width - 40), rng.random_range(0..height - 40));
                            let (w, h) = (rng.random_range(20..width / 3), rng.random_range(20..height / 3));
                            let value = rng.random_range(30..220u8);
                            for row in y..(y + h).min(height) {
                                image.data[row * width + x..row * width + (x + w).min(width)].fill(value);
                            }
                        }
                        image.data.iter_mut().for_each(|v| *v = v.saturating_add(rng.random_range(0..6)));
                        image
                    })
                    .collect()
            }
        };
        let rules = config::EdgeDetector::default();
        stage(c, stage_name, || {
            for image in &images {
                black_box(detector::detect(black_box(image), 10.0, &rules));
            }
        });
    }
}

/// 10,000 hand trajectories of 10 to 100 samples.
fn kalman_rts(c: &mut Criterion) {
    let clips: Vec<(Vec<f64>, Vec<Point>)> =
        match (input::<f64>("kalman_rts", "t"), input::<f64>("kalman_rts", "z"), input::<i64>("kalman_rts", "off")) {
            (Some((_, t)), Some((_, z)), Some((_, off))) => {
                let z = points(&z);
                off.windows(2)
                    .map(|w| (w[0] as usize)..(w[1] as usize))
                    .map(|r| (t[r.clone()].to_vec(), z[r].to_vec()))
                    .collect()
            }
            _ => {
                let mut rng = Pcg64Mcg::seed_from_u64(4);
                (0..10_000)
                    .map(|i| {
                        let n = 10 + i % 91;
                        let times = (0..n).map(|k| f64::from(k) / 30.0).collect();
                        let mut grain = || rng.random_range(-0.03..0.03);
                        let path = (0..n).map(|k| Point::new(0.01 * f64::from(k) + grain(), grain(), 1.0 + grain()));
                        (times, path.collect())
                    })
                    .collect()
            }
        };
    let filter = hands::filter(&Config::default().hands);
    stage(c, "kalman_rts", || {
        for (times, path) in &clips {
            black_box(kalman::smooth(times, path, &filter));
        }
    });
}

/// The room's frame from a million normals.
fn normals_manhattan(c: &mut Criterion) {
    let normals: Vec<Vector> =
        match (input::<f32>("normals_manhattan", "normal"), input::<f64>("normals_manhattan", "poses")) {
            (Some((shape, n)), Some((_, poses))) => {
                let per_view = (shape[1] * shape[2]) as usize;
                let step = (n.len() / 3).div_ceil(1_000_000);
                n.chunks_exact(3)
                    .enumerate()
                    .step_by(step)
                    .map(|(i, v)| {
                        let m = &poses[16 * (i / per_view)..];
                        let r = nalgebra::Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
                        r * Vector::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
                    })
                    .collect()
            }
            _ => {
                let mut rng = Pcg64Mcg::seed_from_u64(5);
                (0..1_000_000)
                    .map(|i| {
                        let axis = [Vector::x(), Vector::y(), Vector::z()][i % 3];
                        (axis + Vector::from_fn(|_, _| rng.random_range(-0.3..0.3))).normalize()
                    })
                    .collect()
            }
        };
    stage(c, "normals_manhattan", || {
        black_box(manhattan::of_normals(black_box(&normals), &Vector::z(), &config::RoomFrame::default()));
    });
}

/// LO-RANSAC lines through the points of tracks, two fifths of them wrong.
fn lines3d_ransac(c: &mut Criterion) {
    let tracks: Vec<Vec<Point>> =
        match (input::<f64>("lines3d_ransac", "points"), input::<i64>("lines3d_ransac", "off")) {
            (Some((_, p)), Some((_, off))) => {
                let all = points(&p);
                off.windows(2).map(|w| all[w[0] as usize..w[1] as usize].to_vec()).collect()
            }
            _ => {
                let mut rng = Pcg64Mcg::seed_from_u64(6);
                (0..30)
                    .map(|_| {
                        (0..920)
                            .map(|i| {
                                let mut grain = |s: f64| rng.random_range(-s..s);
                                let off = if i % 5 < 2 { 0.5 } else { 0.01 };
                                Point::new(grain(off), grain(off), 0.001 * f64::from(i))
                            })
                            .collect()
                    })
                    .collect()
            }
        };
    // The peers draw up to 200 times.
    let config = config::Geometry { line_draws: 200, ..Default::default() };
    stage(c, "lines3d_ransac", || {
        for (i, track) in tracks.iter().enumerate() {
            black_box(segments::fit_segment(black_box(track), &config, i as u64));
        }
    });
}

/// The paper's rule over clips of 10 to 100 samples with 200 lines each: the line of least variance of the radius for a hinge,
/// the nearest of the room's directions for a slide.
fn score_axes(c: &mut Criterion) {
    let sources = config::AxisSources::default();
    let hinge_at = |axis: Vector, origin: Point| {
        AxisCandidate::new(Articulation { kind: JointKind::Revolute, axis, origin }, AxisSource::Line, &sources)
    };
    let (paths, lines, kinds): (Vec<Vec<Point>>, Vec<Vec<AxisCandidate>>, Vec<i64>) = match (
        input::<f64>("score_axes", "z"),
        input::<i64>("score_axes", "off"),
        input::<f64>("score_axes", "q"),
        input::<f64>("score_axes", "u"),
        input::<i64>("score_axes", "kind"),
    ) {
        (Some((_, z)), Some((_, off)), Some((shape, q)), Some((_, u)), Some((_, kind))) => {
            let z = points(&z);
            let paths = off.windows(2).map(|w| z[w[0] as usize..w[1] as usize].to_vec()).collect();
            let all: Vec<AxisCandidate> =
                points(&q).into_iter().zip(points(&u)).map(|(q, u)| hinge_at(u.coords, q)).collect();
            (paths, all.chunks_exact(shape[1] as usize).map(<[_]>::to_vec).collect(), kind)
        }
        _ => {
            let mut rng = Pcg64Mcg::seed_from_u64(7);
            let clips = 1_000usize;
            let paths = (0..clips)
                .map(|i| {
                    (0..10 + i % 91)
                        .map(|k| {
                            let a = 0.02 * k as f64;
                            let mut grain = || rng.random_range(-0.01..0.01);
                            Point::new(0.5 * a.cos() + grain(), 0.5 * a.sin() + grain(), grain())
                        })
                        .collect()
                })
                .collect();
            let mut line = |_| {
                let mut grain = || rng.random_range(-0.4..0.4);
                hinge_at(Vector::z(), Point::new(grain(), grain(), grain()))
            };
            let lines = (0..clips).map(|_| (0..200).map(&mut line).collect()).collect();
            (paths, lines, (0..clips as i64).map(|i| i64::from(i % 5 < 2)).collect())
        }
    };
    let clips: Vec<(Trajectory, Vec<AxisCandidate>, JointKind)> = paths
        .iter()
        .zip(lines)
        .zip(&kinds)
        .map(|((path, mut candidates), kind)| {
            let sample = |(frame, p): (usize, &Point)| hands::Sample {
                frame,
                time_secs: frame as f64 / 30.0,
                observed: *p,
                smoothed: *p,
                accepted: true,
            };
            let samples = path.iter().enumerate().map(sample).collect();
            let trajectory = Trajectory { side: None, samples, action: Action::Open, ends_seen: [true; 2] };
            candidates.extend([Vector::x(), Vector::y(), Vector::z()].map(|axis| {
                let joint = Articulation { kind: JointKind::Prismatic, axis, origin: Point::origin() };
                AxisCandidate::new(joint, AxisSource::Manhattan, &sources)
            }));
            (trajectory, candidates, if *kind == 0 { JointKind::Revolute } else { JointKind::Prismatic })
        })
        .collect();
    let config = config::Inference::default();
    stage(c, "score_axes", || {
        for (trajectory, candidates, kind) in &clips {
            black_box(inference::paper::infer(black_box(trajectory), candidates, Some(*kind), None, &config, 0));
        }
    });
}

/// Fusing, meshing, simplifying and texturing of a rendered kitchen, its frames' decoding with it; on all threads.
fn look(c: &mut Criterion) {
    let dir = tempfile::tempdir().unwrap();
    let recorded = Recorded::new(&SynthOptions { seed: 3, tier: Tier::Realistic, width: 320, parts: 2 }).unwrap();
    let mut files: Vec<(String, Vec<u8>)> =
        recorded.tables().unwrap().into_iter().map(|(name, text)| (name, text.into_bytes())).collect();
    files.extend((0..recorded.frames()).flat_map(|frame| recorded.images(frame).unwrap()));
    for (name, bytes) in files {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    let config = Config::default();
    let recording = Recording::open(dir.path()).unwrap();
    let reasoner = Geometric::of(&config);
    let scene = pipeline::infer(&recording, &config, &Lsd, &reasoner, &|_, _, _| {}).unwrap();
    let twin = fitting::fit(&scene, &recording.up(), &config.fitting, &config.priors);
    stage(c, "look", || {
        black_box(appearance::look(black_box(&recording), &scene, &twin, &config.hands, &config.appearance).unwrap());
    });
}

/// The formats of a look of 80,000 triangles and 4 million texels.
fn encode(c: &mut Criterion) {
    let mut rng = Pcg64Mcg::seed_from_u64(8);
    let side = 200u32;
    let across = side + 1;
    let at = |i: u32| [f64::from(i % across), f64::from(i / across)].map(|c| 0.03 * c);
    let mesh = TexturedMesh {
        positions: (0..across * across)
            .map(|i| Point::new(at(i)[0], at(i)[1], rng.random_range(-0.01..0.01)))
            .collect(),
        normals: (0..across * across).map(|_| Vector::z()).collect(),
        uv: (0..across * across).map(|i| at(i).map(|c| (c / 6.0) as f32)).collect(),
        triangles: (0..side * side)
            .map(|i| i / side * across + i % side)
            .flat_map(|a| [[a, a + 1, a + across + 1], [a, a + across + 1, a + across]])
            .collect(),
        texture: 0,
        seen: 1.0,
    };
    let size = 2048u32;
    // A slope with a camera's grain.
    let rgb = (0..3 * size * size).map(|i| (i / (24 * size)) as u8 / 2 + rng.random_range(60..70)).collect();
    let texture = Texture { name: "look_0".to_owned(), width: size, height: size, rgb };
    let look = Look { textures: vec![texture], room: vec![mesh], ..Look::default() };
    let twin = Twin {
        name: "room".to_owned(),
        density_kg_per_m3: 700.0,
        drives: paws_twin::config::Drives::default(),
        furniture: Vec::new(),
        room: Vec::new(),
        left_out: Vec::new(),
    };
    stage(c, "encode_files", || {
        black_box(export::dress::files(&twin, black_box(&look)).unwrap());
    });
    stage(c, "encode_glb", || {
        black_box(export::gltf::write(&twin, Some(black_box(&look)), &[]).unwrap());
    });
    stage(c, "encode_usdz", || {
        black_box(export::usd::write_package(&twin, Some(black_box(&look))).unwrap());
    });
}

/// The cells of a room of 6 x 6 x 2.5 m from 150 views of 20,000 samples, seen and seen through.
fn room_cells(c: &mut Criterion) {
    let camera = Camera { width: 160, height: 120, fx: 105.0, fy: 105.0, cx: 79.5, cy: 59.5 };
    let mut rng = Pcg64Mcg::seed_from_u64(8);
    let (mut frames, mut sketches) = (Vec::new(), Vec::new());
    for i in 0..150u32 {
        let eye = Vector::new(rng.random_range(1.0..5.0), rng.random_range(1.0..5.0), 1.6);
        let turn = nalgebra::UnitQuaternion::from_euler_angles(-1.9, 0.0, rng.random_range(-3.0..3.0));
        let mut depth = Grid::filled(camera.width, camera.height, 0.0f32);
        for (at, z) in depth.data.iter_mut().enumerate() {
            let (u, v) = ((at % camera.width) as f64, (at / camera.width) as f64);
            let ray = turn * camera.unproject(u, v, 1.0).coords;
            let wall = |k: usize, high: f64| (if ray[k] > 0.0 { high - eye[k] } else { -eye[k] }) / ray[k];
            *z = wall(0, 6.0).min(wall(1, 6.0)).min(wall(2, 2.5)) as f32;
        }
        let files = FrameFiles { depth: Some(PathBuf::from("x")), ..Default::default() };
        let world_from_camera = Pose::from_parts(eye.into(), turn);
        frames.push(Frame { timestamp_secs: f64::from(i), world_from_camera, files });
        sketches.push(Sketch::of(i as usize, &depth, None));
    }
    let recording = Recording { frames, ..Recording::empty(camera) };
    let views: Vec<&Sketch> = sketches.iter().collect();
    let axes = [Vector::x(), Vector::y(), Vector::z()];
    let rules = &config::GatheredRoom::default();
    let how = pipeline::Gathering { axes, edge_m: 0.05, stride: 2, views: 3, free_views: 2, rules };
    stage(c, "room_cells", || {
        black_box(pipeline::gather(&recording, black_box(&views), &how));
    });
}

criterion_group! {
    name = stages;
    config = Criterion::default().sample_size(10).measurement_time(Duration::from_secs(3)).warm_up_time(Duration::from_millis(500));
    targets = voxel_views, view_select, lsd, kalman_rts, normals_manhattan, lines3d_ransac, score_axes, look, encode, room_cells
}
criterion_main!(stages);
