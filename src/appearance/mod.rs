//! What the twin looks like: the room fused from depth, cut where parts move, and textured from the best views (ours).
//!
//! Depth is decoded once and kept at no more than VGA resolution; colour images are decoded once, a few at a time. Frames in
//! which everything stands closed and nobody works come first; frames in which a part stands open show what is behind it. Points
//! that lie on a part, wherever it is in a frame, are the part's and not the room's, so that an open door has its inside behind it
//! and not its own front. Everything is computed relative to the first camera, in `f32`.
//!
//! The surface loses what noise made of it (`clean`) and small holes (`holes`), then vertices (`coarse`, `simplify`), and is laid flat in few charts
//! (`regions`) whose texels are as fine as the frames that show them (`density`).

mod blend;
mod boxes;
mod charts;
mod clean;
mod coarse;
mod density;
mod frame_choice;
mod frame_sights;
mod fuse;
mod holes;
mod local;
mod pages;
mod part_charts;
mod regions;
mod sight_camera;
mod simplify;
mod surface_mesh;
mod texels;
mod texture;

use crate::config;
use crate::error::Result;
use crate::look::{Look, Texture, TexturedMesh};
use crate::math::Point;
use crate::pipeline::Scene;
use crate::recording::{Recording, Surfaces};
use crate::twin::Twin;
use charts::Chart;

/// Why a recording gives no look, or one without colours; `None` where nothing is missing.
#[must_use]
pub fn lacking(recording: &Recording) -> Option<&'static str> {
    let any = |has: fn(&Recording, usize) -> bool| (0..recording.frames.len()).any(|f| has(recording, f));
    if recording.surfaces() < Surfaces::Depth {
        return Some("no frame has depth: the twin keeps its plain boxes");
    }
    (!any(|r, f| r.frames.get(f).is_some_and(|f| f.files.rgb.is_some())))
        .then_some("no frame has a colour image: the twin's surfaces are grey")
}

/// The looks of a twin, from the recording that it was made of and what was inferred from it. Empty where no frame has depth,
/// grey where none has an image ([`lacking`] says so). The rules of hands tell when parts moved.
///
/// # Errors
/// Images that cannot be decoded.
pub fn look(
    recording: &Recording,
    scene: &Scene,
    twin: &Twin,
    hands: &config::Hands,
    config: &config::Appearance,
) -> Result<Look> {
    // Through the holes of a sparse reconstruction shows what is behind it.
    if recording.surfaces() < Surfaces::Depth {
        return Ok(Look::default());
    }
    let timelines = scene.timelines(recording, hands);
    let chosen = frame_choice::choose(recording, scene, &timelines, config);
    let Some(origin) = chosen.first().and_then(|f| recording.frames.get(*f)).map(crate::recording::Frame::center)
    else {
        return Ok(Look::default());
    };
    let setting = frame_sights::Setting { recording, scene, twin, timelines: &timelines, origin, config };
    let sights = frame_sights::load(&setting, &chosen)?;
    if sights.is_empty() {
        return Ok(Look::default());
    }
    let volume = fuse::fuse(&sights, config);
    // Shards first: they have rims all around.
    let surface = surface_mesh::without_shards(surface_mesh::surface(&volume), config.shard_m2);
    let surface = clean::without_frays(surface, &volume, config);
    let surface = clean::without_fronts(surface, twin, &origin, config);
    let surface = holes::closed(surface, &volume, twin, &origin, config);
    let voxel = volume.voxel;
    drop(volume);
    let surface = coarse::reduced(surface, voxel, config);
    // Simplification takes sheets apart that only touch.
    let surface = clean::without_shards(surface, twin, &origin, config);
    let up = recording.up();
    let axes = scene.manhattan.as_ref().map_or_else(
        || {
            let first = crate::math::any_orthogonal(&up);
            [first, up.cross(&first), up]
        },
        |m| m.axes,
    );
    let mut all = charts::of_mesh(&surface, &axes.map(|a| a.map(|c| c as f32)), config.chart_m2);
    drop(surface);
    all.extend(part_charts::charts(twin, &origin, &sights));
    let (textures, seen) = texture::paint(&setting, &sights, &mut all)?;
    Ok(gathered(&all, textures, &seen, twin, &origin))
}

/// The charts as meshes: one for each owner and page.
fn gathered(charts: &[Chart], textures: Vec<Texture>, seen: &[[usize; 2]], twin: &Twin, origin: &Point) -> Look {
    let mut look = Look { textures, ..Look::default() };
    let owners = std::iter::once(None).chain((0..twin.furniture.len()).map(Some));
    for owner in owners {
        let mut meshes = Vec::new();
        for page in 0..look.textures.len() {
            let own: Vec<usize> = charts
                .iter()
                .enumerate()
                .filter(|(_, c)| c.owner == owner && c.page == page && !c.triangles.is_empty())
                .map(|(i, _)| i)
                .collect();
            if !own.is_empty() {
                meshes.push(joined(charts, &own, seen, &look.textures[page], page, origin));
            }
        }
        match owner.and_then(|i| twin.furniture.get(i)) {
            None => look.room = meshes,
            Some(_) if meshes.is_empty() => {}
            Some(piece) => {
                look.parts.insert(piece.part.id.clone(), meshes);
            }
        }
    }
    look
}

/// Charts on one page as one mesh.
fn joined(
    charts: &[Chart],
    own: &[usize],
    seen: &[[usize; 2]],
    texture: &Texture,
    page: usize,
    origin: &Point,
) -> TexturedMesh {
    let mut mesh = TexturedMesh {
        positions: Vec::new(),
        normals: Vec::new(),
        uv: Vec::new(),
        triangles: Vec::new(),
        texture: page,
        seen: 0.0,
    };
    // Square metres that were seen, and all of them.
    let mut areas = [0.0f64; 2];
    for &i in own {
        let chart = &charts[i];
        let base = mesh.positions.len() as u32;
        mesh.positions.extend(chart.positions.iter().map(|p| origin + p.map(f64::from)));
        mesh.normals.extend(chart.normals.iter().map(|n| n.map(f64::from).normalize()));
        let size = [texture.width as f32, texture.height as f32];
        mesh.uv.extend(chart.positions.iter().map(|p| {
            let at = chart.coordinates(p);
            [0, 1].map(|k| ((chart.at[k] as f32 + at[k]) / size[k]).clamp(0.0, 1.0))
        }));
        mesh.triangles.extend(chart.triangles.iter().map(|t| t.map(|v| v + base)));
        let [told, covered] = seen.get(i).copied().unwrap_or_default();
        let area = f64::from(chart.area());
        areas[0] += area * told as f64 / (covered as f64).max(1.0);
        areas[1] += area;
    }
    mesh.seen = if areas[1] > 0.0 { (areas[0] / areas[1]).min(1.0) } else { 0.0 };
    mesh
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::math::{Pose, Vector};
    use crate::recording::{Camera, DepthFactors, Frame, FrameFiles};
    use crate::synth::kitchen::ColoredBox;
    use crate::synth::render;
    use crate::twin::OrientedBox;

    const CAMERA: Camera = Camera { width: 240, height: 180, fx: 180.0, fy: 180.0, cx: 119.5, cy: 89.5 };

    fn block(center: [f64; 3], half: [f64; 3], color: [u8; 3]) -> ColoredBox {
        let shape = OrientedBox {
            center: Point::from(center),
            half: Vector::from(half),
            rotation: nalgebra::Matrix3::identity(),
        };
        ColoredBox { shape, color, class: 1 }
    }

    fn looking(eye: [f64; 3], at: [f64; 3]) -> Pose {
        let (eye, at) = (Point::from(eye), Point::from(at));
        let forward = (at - eye).normalize();
        let up = if forward.z.abs() > 0.9 { Vector::y() } else { Vector::z() };
        let right = forward.cross(&up).normalize();
        let axes = nalgebra::Matrix3::from_columns(&[right, forward.cross(&right), forward]);
        let turn = nalgebra::UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(axes));
        Pose::from_parts(eye.coords.into(), turn)
    }

    /// A recording of blocks from some places; the exposure of each frame multiplies its colours.
    fn recorded(dir: &Path, blocks: &[ColoredBox], views: &[(Pose, f64)], with_images: bool) -> Recording {
        let mut frames = Vec::new();
        for (i, (pose, exposure)) in views.iter().enumerate() {
            let mut picture = render::cast(blocks, pose, &CAMERA);
            for pixel in &mut picture.rgb {
                *pixel = pixel.map(|c| (f64::from(c) * exposure).round() as u8);
            }
            let mut files = FrameFiles::default();
            for (name, bytes) in render::encode(&picture, &CAMERA, i, false).unwrap() {
                let path: PathBuf = dir.join(name);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(&path, bytes).unwrap();
                let kind = path.parent().and_then(Path::file_name).and_then(|n| n.to_str()).unwrap().to_owned();
                match kind.as_str() {
                    "frames" if with_images => files.rgb = Some(path),
                    "depth" => files.depth = Some(path),
                    _ => {}
                }
            }
            frames.push(Frame { timestamp_secs: 0.1 * i as f64, world_from_camera: *pose, files });
        }
        Recording { name: "r".to_owned(), dir: dir.to_owned(), frames, ..Recording::empty(CAMERA) }
    }

    fn nothing_moves() -> (Scene, Twin) {
        let scene = Scene {
            recording: "r".to_owned(),
            manhattan: None,
            depth_factors: DepthFactors::default(),
            videos: Default::default(),
            clips: Vec::new(),
            joints: Vec::new(),
            surroundings: None,
        };
        let twin = Twin {
            name: "r".to_owned(),
            density_kg_per_m3: 700.0,
            drives: crate::config::Drives::default(),
            furniture: Vec::new(),
            room: Vec::new(),
            left_out: Vec::new(),
        };
        (scene, twin)
    }

    /// A floor and a box on all sides of which cameras stand.
    fn box_in_the_air() -> (Vec<ColoredBox>, Vec<(Pose, f64)>) {
        let blocks = vec![block([0.0, 0.0, 1.0], [0.3, 0.25, 0.2], [180, 90, 60])];
        let mut views = Vec::new();
        for height in [-0.2, 1.0, 2.2] {
            for i in 0..8 {
                let angle = f64::from(i) * std::f64::consts::FRAC_PI_4 + 0.2;
                views.push((looking([1.3 * angle.cos(), 1.3 * angle.sin(), height], [0.0, 0.0, 1.0]), 1.0));
            }
        }
        (blocks, views)
    }

    fn off_surface(p: &Point, shape: &OrientedBox) -> f64 {
        let d = (p - shape.center).abs() - shape.half;
        let outside = d.map(|c| c.max(0.0)).norm();
        if outside > 0.0 { outside } else { -d.max() }
    }

    #[test]
    fn a_box_seen_from_all_sides_is_where_it_is_and_closed() {
        let dir = tempfile::tempdir().unwrap();
        let (blocks, views) = box_in_the_air();
        let recording = recorded(dir.path(), &blocks, &views, false);
        let (scene, twin) = nothing_moves();
        let config = config::Appearance::default();
        let origin = Point::origin();
        let setting = frame_sights::Setting {
            recording: &recording,
            scene: &scene,
            twin: &twin,
            timelines: &[],
            origin,
            config: &config,
        };
        let sights = frame_sights::load(&setting, &(0..views.len()).collect::<Vec<usize>>()).unwrap();
        assert_eq!(sights.len(), 24);
        let surface =
            surface_mesh::without_shards(surface_mesh::surface(&fuse::fuse(&sights, &config)), config.shard_m2);
        let mut off: Vec<f64> =
            surface.positions.iter().map(|p| off_surface(&Point::from(p.map(f64::from)), &blocks[0].shape)).collect();
        off.sort_by(f64::total_cmp);
        assert!(off.len() > 5000, "{}", off.len());
        assert!(off[off.len() / 2] < 0.5 * config.voxel_m, "{}", off[off.len() / 2]);
        // Corners are rounded: a voxel's diagonal, and the noise of half a voxel.
        assert!(off[off.len() * 99 / 100] < 2.0 * config.voxel_m, "{}", off[off.len() * 99 / 100]);
        let mut edges = std::collections::BTreeMap::<[u32; 2], i32>::new();
        for t in &surface.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        let open = edges.values().filter(|sum| **sum != 0).count();
        // Where a face is seen at a grazing angle alone its rim frays.
        assert!(open * 30 < edges.len(), "{open} of {}", edges.len());
        // A tight budget of memory makes voxels larger, not the box.
        let small = config::Appearance { fuse_mb: 1.0, ..config };
        let coarse = fuse::fuse(&sights, &small);
        assert!(coarse.voxel > 0.012 && coarse.blocks.len() <= 300, "{} {}", coarse.voxel, coarse.blocks.len());
    }

    /// A wall of squares of 20 cm, dark and bright, and a step before it.
    fn checkered() -> Vec<ColoredBox> {
        let mut blocks = vec![block([0.0, -0.3, -0.1], [0.3, 0.3, 0.1], [120, 140, 100])];
        for x in -5..5 {
            for z in 0..8 {
                let level = if (x + z) % 2 == 0 { 90 } else { 180 };
                let center = [0.2 * f64::from(x) + 0.1, 0.1, 0.2 * f64::from(z) + 0.1];
                blocks.push(block(center, [0.1, 0.1, 0.1], [level; 3]));
            }
        }
        blocks
    }

    fn before_the_wall() -> Vec<(Pose, f64)> {
        let exposures = [1.0, 0.7];
        (0..10)
            .map(|i| {
                let x = -0.6 + 0.13 * f64::from(i);
                (looking([x, -1.5, 0.9], [0.5 * x, 0.0, 0.8]), exposures[i as usize % 2])
            })
            .collect()
    }

    /// The colour of a mesh where the ray along +y at (x, z) meets it.
    fn colour_at(look: &Look, x: f64, z: f64) -> Option<f64> {
        for mesh in &look.room {
            for t in &mesh.triangles {
                let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
                let cross = |p: (f64, f64), q: (f64, f64)| p.0 * q.1 - p.1 * q.0;
                let to = |p: Point, q: Point| (q.x - p.x, q.z - p.z);
                let at = |p: Point| (x - p.x, z - p.z);
                let twice = cross(to(a, b), to(a, c));
                let shares =
                    [cross(to(b, c), at(b)) / twice, cross(to(c, a), at(c)) / twice, cross(to(a, b), at(a)) / twice];
                if twice.abs() < 1e-9 || shares.iter().any(|s| !(0.0..=1.0).contains(s)) || a.y.abs() > 0.05 {
                    continue;
                }
                let texture = &look.textures[mesh.texture];
                let uv: [f64; 2] =
                    std::array::from_fn(|k| (0..3).map(|i| shares[i] * f64::from(mesh.uv[t[i] as usize][k])).sum());
                let column = (uv[0] * f64::from(texture.width)) as usize;
                let row = (uv[1] * f64::from(texture.height)) as usize;
                return Some(f64::from(texture.rgb[3 * (row * texture.width as usize + column)]));
            }
        }
        None
    }

    #[test]
    fn a_checkered_wall_seen_under_two_exposures_has_two_levels() {
        let dir = tempfile::tempdir().unwrap();
        let (blocks, views) = (checkered(), before_the_wall());
        let recording = recorded(dir.path(), &blocks, &views, true);
        let (scene, twin) = nothing_moves();
        let look = look(&recording, &scene, &twin, &config::Hands::default(), &config::Appearance::default()).unwrap();
        let mut levels: [Vec<f64>; 2] = Default::default();
        for x in -4..4 {
            for z in 1..7 {
                let at = |c: i32| 0.2 * f64::from(c) + 0.1;
                if let Some(level) = colour_at(&look, at(x), at(z)) {
                    levels[(x + z).rem_euclid(2) as usize].push(level);
                }
            }
        }
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        for own in &levels {
            assert!(own.len() > 15, "{}", own.len());
            assert!(own.iter().all(|l| (l - mean(own)).abs() < 4.0), "{own:?}");
        }
        // Twice as bright, whatever the exposure; the mean exposure is that of neither frame.
        let ratio = mean(&levels[1]) / mean(&levels[0]);
        assert!((ratio - 2.0).abs() < 0.08, "{ratio}");
        let seen = look.room.iter().map(|m| m.seen).fold(0.0, f64::max);
        assert!(seen > 0.9 && seen <= 1.0, "{seen}");
    }

    #[test]
    fn one_thread_and_four_make_the_same_look() {
        let dir = tempfile::tempdir().unwrap();
        let recording = recorded(dir.path(), &checkered(), &before_the_wall(), true);
        let (scene, twin) = nothing_moves();
        let config = config::Appearance { triangles: 2000, ..Default::default() };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| look(&recording, &scene, &twin, &config::Hands::default(), &config).unwrap())
        };
        let one = run(1);
        assert_eq!(one, run(4));
        let triangles: usize = one.room.iter().map(|m| m.triangles.len()).sum();
        assert!((1000..=2000).contains(&triangles), "{triangles}");
        for mesh in &one.room {
            let vertices = mesh.positions.len();
            assert!(vertices == mesh.normals.len() && vertices == mesh.uv.len());
            assert!(mesh.normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-5));
            assert!(mesh.triangles.iter().flatten().all(|v| (*v as usize) < vertices));
        }
    }

    #[test]
    fn without_images_all_is_grey_and_without_depth_there_is_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let mut recording = recorded(dir.path(), &checkered(), &before_the_wall(), false);
        let (scene, twin) = nothing_moves();
        let config = config::Appearance::default();
        let grey = look(&recording, &scene, &twin, &config::Hands::default(), &config).unwrap();
        assert!(lacking(&recording).is_some_and(|why| why.contains("grey")));
        assert_eq!((grey.textures.len(), grey.room.len(), grey.room[0].seen), (1, 1, 0.0));
        assert!(grey.textures[0].rgb.iter().all(|c| *c == grey.textures[0].rgb[0]));
        recording.frames.iter_mut().for_each(|f| f.files.depth = None);
        assert!(lacking(&recording).is_some_and(|why| why.contains("depth")));
        assert_eq!(look(&recording, &scene, &twin, &config::Hands::default(), &config).unwrap(), Look::default());
    }
}
