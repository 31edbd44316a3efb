//! How a twin looks beside the recorded frames: drawn from the recorded cameras, unlit, as its look has its colours.
//!
//! A pixel counts where the frame has depth (or the recording has none at all) and shows no hand, arm or person. Of these
//! pixels coverage is the share at which there is a surface; PSNR and SSIM are taken over the covered ones.

use rayon::prelude::*;
use serde::Serialize;

use super::pixels::{self, ColorImage};
use super::shots::Shot;
use crate::config;
use crate::error::Result;
use crate::look::{Look, TexturedMesh};
use crate::math::stats;
use crate::raster::{self, Mesh, MeshPaint, NOTHING, Paint, RenderedView, Surface};
use crate::recording::{Grid, Recording, people};
use crate::twin::{OrientedBox, Solid, Twin};

/// Owner of what does not move; a twin's part `i` owns `i + 1`.
pub const STATIC: u16 = 0;
/// Boxes without a look.
const GREY: [u8; 3] = [160; 3];

/// The number under which a part owns pixels.
fn owner(part: usize) -> u16 {
    u16::try_from(part + 1).unwrap_or(NOTHING - 1)
}

/// A box as triangles, world.
#[must_use]
pub fn box_mesh(shape: &OrientedBox) -> Mesh {
    let mut triangles = Vec::with_capacity(12);
    for axis in 0..3u32 {
        // The corners' numbers have a bit an axis.
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        triangles.extend([[0, u | v, u], [0, v, u | v]]);
        triangles.extend([[0, u, u | v], [0, u | v, v]].map(|t| t.map(|c: u32| c | 1 << axis)));
    }
    Mesh { positions: shape.corners().to_vec(), triangles, paint: MeshPaint::Plain(GREY), two_sided: false }
}

/// All boxes of a twin, grey, with their owners.
#[must_use]
pub fn boxes(twin: &Twin) -> Vec<(u16, Mesh)> {
    let meshes = |owner: u16, solids: &[Solid]| -> Vec<(u16, Mesh)> {
        solids.iter().map(|solid| (owner, box_mesh(&solid.shape))).collect()
    };
    let mut all = meshes(STATIC, &twin.room);
    for (i, piece) in twin.furniture.iter().enumerate() {
        all.extend(meshes(STATIC, &piece.carcass));
        all.extend(meshes(owner(i), &piece.part.solids));
    }
    all
}

/// What a twin shows: the meshes of its look, and boxes where that has none, as its exports do.
#[must_use]
pub fn surfaces<'a>(twin: &Twin, look: Option<&'a Look>, boxes: &'a [(u16, Mesh)]) -> Vec<Surface<'a>> {
    let mut all = Vec::new();
    let mut dressed = std::collections::BTreeSet::new();
    if let Some(look) = look {
        let parts = twin.furniture.iter().enumerate();
        let of_parts = parts.filter_map(|(i, piece)| Some((owner(i), look.parts.get(&piece.part.id)?.as_slice())));
        for (owner, meshes) in std::iter::once((STATIC, look.room.as_slice())).chain(of_parts) {
            let own: Vec<Surface> = meshes.iter().filter_map(|mesh| textured(look, mesh, owner)).collect();
            if !own.is_empty() {
                dressed.insert(owner);
            }
            all.extend(own);
        }
    }
    all.extend(
        boxes.iter().filter(|(owner, _)| !dressed.contains(owner)).map(|(owner, mesh)| mesh.surface(*owner, false)),
    );
    all
}

fn textured<'a>(look: &'a Look, mesh: &'a TexturedMesh, owner: u16) -> Option<Surface<'a>> {
    let texture = look.textures.get(mesh.texture)?;
    let (width, height) = (texture.width as usize, texture.height as usize);
    (!mesh.triangles.is_empty()).then(|| Surface {
        positions: &mesh.positions,
        triangles: &mesh.triangles,
        paint: Paint::Picture { uv: &mesh.uv, width, height, rgb: &texture.rgb },
        world_from_surface: crate::math::Pose::identity(),
        owner,
        two_sided: false,
    })
}

/// The same surfaces with the parts at their openings, rad or m.
#[must_use]
pub fn posed<'a>(surfaces: &[Surface<'a>], twin: &Twin, openings: &[f64]) -> Vec<Surface<'a>> {
    let motions: Vec<_> =
        twin.furniture.iter().zip(openings).map(|(f, opening)| f.part.joint.articulation.motion(*opening)).collect();
    surfaces
        .iter()
        .map(|surface| {
            let part = usize::from(surface.owner).checked_sub(1);
            let motion = part.and_then(|i| motions.get(i)).copied();
            Surface { world_from_surface: motion.unwrap_or(surface.world_from_surface), ..*surface }
        })
        .collect()
}

/// Something that is compared with the frames.
#[derive(Debug, Clone)]
pub struct Contender<'a> {
    /// What it is called.
    pub name: String,
    /// What it shows, everything closed.
    pub surfaces: Vec<Surface<'a>>,
}

/// How alike a frame and a view are over some pixels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Likeness {
    /// Pixels that count, and those of them with a surface.
    pub pixels: [usize; 2],
    /// Peak signal-to-noise ratio, dB; `None`, as the next two, where too few pixels are covered.
    pub psnr_db: Option<f64>,
    /// The same with the exposure of each channel fitted.
    pub psnr_fitted_db: Option<f64>,
    /// Structural similarity of luma, -1 to 1.
    pub ssim: Option<f64>,
}

/// One frame beside all contenders.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameLikeness {
    /// Frame index.
    pub frame: usize,
    /// Parts that stand open, by their ids.
    pub open: Vec<String>,
    /// Each contender over the pixels that it covers.
    pub own: Vec<Likeness>,
    /// Each contender over the pixels that all cover; empty for a single one.
    pub common: Vec<Likeness>,
    /// Each contender where the open parts are, and where they are when closed; empty where none stands open.
    pub opened: Vec<Likeness>,
}

/// Compares the contenders with frames; the first shows the twin's parts. A frame without an image has no row.
///
/// # Errors
/// Images that cannot be decoded.
pub fn compare(
    recording: &Recording,
    twin: &Twin,
    contenders: &[Contender],
    shots: &[Shot],
    config: &config::Comparison,
) -> Result<Vec<FrameLikeness>> {
    let of = |shot: &Shot| -> Result<Option<FrameLikeness>> {
        let seen = look_at(recording, twin, contenders, shot, config)?;
        Ok(seen.map(|seen| row(twin, shot, &seen, config)))
    };
    let rows: Vec<Option<FrameLikeness>> = shots.par_iter().map(of).collect::<Result<_>>()?;
    Ok(rows.into_iter().flatten().collect())
}

/// A frame, which of its pixels count, and the contenders from its camera.
#[derive(Debug, Clone)]
pub struct ComparedFrame {
    /// The recorded frame.
    pub frame: ColorImage,
    /// Pixels that can be compared.
    pub counts: Grid<bool>,
    /// What each contender shows.
    pub views: Vec<RenderedView>,
    /// Pixels that count and show an open part, or the place of one that would be closed.
    pub opened: Grid<bool>,
}

/// Draws all contenders as a frame would show them; `None` where it has no image.
///
/// # Errors
/// Images that cannot be decoded.
pub fn look_at(
    recording: &Recording,
    twin: &Twin,
    contenders: &[Contender],
    shot: &Shot,
    config: &config::Comparison,
) -> Result<Option<ComparedFrame>> {
    let Some(from) = recording.frames.get(shot.frame) else { return Ok(None) };
    let Some(frame) = recording.rgb(shot.frame)? else { return Ok(None) };
    let counts = comparable(recording, shot.frame, config.hand_m)?;
    let (pose, camera) = (&from.world_from_camera, recording.camera_of(shot.frame));
    let views: Vec<RenderedView> = contenders
        .iter()
        .map(|c| raster::render_smooth(&posed(&c.surfaces, twin, &shot.openings), pose, camera, config.rays))
        .collect();
    let mut opened = Grid::filled(camera.width, camera.height, false);
    let owners: Vec<u16> = shot.opened().into_iter().map(owner).collect();
    if let (Some(first), Some(view)) = (contenders.first(), views.first())
        && !owners.is_empty()
    {
        let closed = raster::render(&first.surfaces, pose, camera);
        for (i, opened) in opened.data.iter_mut().enumerate() {
            let there = |view: &RenderedView| owners.contains(&view.owner.data[i]);
            *opened = counts.data[i] && (there(view) || there(&closed));
        }
    }
    Ok(Some(ComparedFrame { frame, counts, views, opened }))
}

/// Pixels of a frame that can be compared.
fn comparable(recording: &Recording, frame: usize, hand_m: f64) -> Result<Grid<bool>> {
    let mut counts = people::pixels(recording, frame, hand_m)?;
    counts.data.iter_mut().for_each(|person| *person = !*person);
    if let Some(depth) = recording.depth_as_read(frame)? {
        counts.data.iter_mut().zip(&depth.data).for_each(|(counts, z)| *counts &= *z > 0.0);
    }
    Ok(counts)
}

/// Pixels at which a view has a surface, among some.
fn covered(view: &RenderedView, among: &Grid<bool>) -> Grid<bool> {
    let data = among.data.iter().zip(&view.owner.data).map(|(among, owner)| *among && *owner != NOTHING).collect();
    Grid { width: among.width, height: among.height, data }
}

fn both(a: &Grid<bool>, b: &Grid<bool>) -> Grid<bool> {
    Grid { width: a.width, height: a.height, data: a.data.iter().zip(&b.data).map(|(a, b)| *a && *b).collect() }
}

fn count(grid: &Grid<bool>) -> usize {
    grid.data.iter().filter(|on| **on).count()
}

fn row(twin: &Twin, shot: &Shot, seen: &ComparedFrame, config: &config::Comparison) -> FrameLikeness {
    let least = config.least_share * seen.counts.data.len() as f64;
    let own: Vec<Grid<bool>> = seen.views.iter().map(|view| covered(view, &seen.counts)).collect();
    let likeness = |view: &RenderedView, among: &Grid<bool>, on: &Grid<bool>, map: &Grid<f32>| {
        let pixels = [count(among), count(on)];
        let enough = pixels[1] as f64 >= least.max(1.0);
        Likeness {
            pixels,
            psnr_db: pixels::psnr(&seen.frame, &view.rgb, on).filter(|_| enough),
            psnr_fitted_db: pixels::psnr_fitted(&seen.frame, &view.rgb, on).filter(|_| enough),
            ssim: pixels::mean_over(map, on).filter(|_| enough),
        }
    };
    let all = own.iter().skip(1).fold(own.first().cloned(), |all, own| all.map(|all| both(&all, own)));
    let open = shot.opened();
    let (mut whole, mut common, mut opened) = (Vec::new(), Vec::new(), Vec::new());
    for (view, on) in seen.views.iter().zip(&own) {
        let map = pixels::ssim_map(&seen.frame, &view.rgb, on);
        whole.push(likeness(view, &seen.counts, on, &map));
        if !open.is_empty() {
            opened.push(likeness(view, &seen.opened, &both(&seen.opened, on), &map));
        }
        if let Some(all) = all.as_ref().filter(|_| own.len() > 1) {
            let map = pixels::ssim_map(&seen.frame, &view.rgb, all);
            common.push(likeness(view, &seen.counts, all, &map));
        }
    }
    let names = open.iter().filter_map(|i| twin.furniture.get(*i)).map(|f| f.part.id.clone()).collect();
    FrameLikeness { frame: shot.frame, open: names, own: whole, common, opened }
}

/// What a number is taken over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// Frames in which everything is closed.
    Closed,
    /// Frames in which parts stand open.
    Open,
    /// In these, where the open parts are and where they are when closed.
    OpenedParts,
    /// Frames in which everything is closed, where all contenders have a surface.
    ClosedCommon,
    /// The same of frames in which parts stand open.
    OpenCommon,
}

impl Over {
    /// All, in the order of the tables.
    pub const ALL: [Self; 5] = [Self::Closed, Self::Open, Self::OpenedParts, Self::ClosedCommon, Self::OpenCommon];

    /// Words for people.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Closed => "all closed",
            Self::Open => "parts open",
            Self::OpenedParts => "the open parts",
            Self::ClosedCommon => "all closed, where all have a surface",
            Self::OpenCommon => "parts open, where all have a surface",
        }
    }

    fn of(self, row: &FrameLikeness) -> &[Likeness] {
        let wanted = matches!(self, Self::Closed | Self::ClosedCommon) == row.open.is_empty();
        match self {
            _ if !wanted => &[],
            Self::Closed | Self::Open => &row.own,
            Self::OpenedParts => &row.opened,
            Self::ClosedCommon | Self::OpenCommon => &row.common,
        }
    }
}

/// A contender over all frames of a kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContenderSummary {
    /// The contender.
    pub name: String,
    /// Which frames and pixels.
    pub over: Over,
    /// Frames.
    pub frames: usize,
    /// Share of all pixels that count at which there is a surface.
    pub coverage: f64,
    /// Mean over frames, dB.
    pub psnr_db: Option<f64>,
    /// Mean over frames with exposures fitted, dB.
    pub psnr_fitted_db: Option<f64>,
    /// Mean over frames.
    pub ssim: Option<f64>,
}

/// The contenders' means; kinds of frames that there are none of are left out.
#[must_use]
pub fn summaries(names: &[String], rows: &[FrameLikeness]) -> Vec<ContenderSummary> {
    let mut all = Vec::new();
    for over in Over::ALL {
        for (i, name) in names.iter().enumerate() {
            let of: Vec<&Likeness> = rows.iter().filter_map(|row| over.of(row).get(i)).collect();
            let pixels = |k: usize| of.iter().map(|l| l.pixels[k]).sum::<usize>();
            let mean = |value: fn(&Likeness) -> Option<f64>| {
                stats::mean(&of.iter().filter_map(|l| value(l)).collect::<Vec<f64>>())
            };
            if !of.is_empty() {
                all.push(ContenderSummary {
                    name: name.clone(),
                    over,
                    frames: of.len(),
                    coverage: pixels(1) as f64 / pixels(0).max(1) as f64,
                    psnr_db: mean(|l| l.psnr_db),
                    psnr_fitted_db: mean(|l| l.psnr_fitted_db),
                    ssim: mean(|l| l.ssim),
                });
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Point, Pose, Vector};
    use crate::recording::Camera;

    const CAMERA: Camera = Camera { width: 40, height: 30, fx: 30.0, fy: 30.0, cx: 19.5, cy: 14.5 };

    fn cube() -> OrientedBox {
        let turn = crate::math::rotation(&Vector::new(1.0, 2.0, 0.5), 0.7);
        OrientedBox {
            center: Point::new(0.2, -0.1, 3.0),
            half: Vector::new(0.5, 0.4, 0.3),
            rotation: *turn.to_rotation_matrix().matrix(),
        }
    }

    #[test]
    fn a_box_is_closed_and_faces_outwards() {
        let (shape, mesh) = (cube(), box_mesh(&cube()));
        assert_eq!(mesh.triangles.len(), 12);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
            let normal = (b - a).cross(&(c - a));
            assert!(normal.norm() > 0.1 && normal.dot(&(a - shape.center)) > 0.0, "{t:?}");
        }
        // Seen from one side only, it looks as from both.
        let [one, both] =
            [false, true].map(|two_sided| raster::render(&[mesh.surface(3, two_sided)], &Pose::identity(), &CAMERA));
        assert_eq!(one, both);
        assert!(one.owner.data.iter().filter(|o| **o == 3).count() > 50);
    }

    fn likeness(pixels: [usize; 2], psnr: f64) -> Likeness {
        Likeness { pixels, psnr_db: Some(psnr), psnr_fitted_db: None, ssim: Some(0.5) }
    }

    #[test]
    fn means_are_of_frames_and_coverage_of_pixels() {
        let row = |frame: usize, open: &[&str], own: Likeness| FrameLikeness {
            frame,
            open: open.iter().map(|s| (*s).to_owned()).collect(),
            opened: if open.is_empty() { Vec::new() } else { vec![likeness([10, 5], 12.0)] },
            own: vec![own],
            common: Vec::new(),
        };
        let rows = [
            row(1, &[], likeness([100, 50], 20.0)),
            row(2, &[], likeness([300, 300], 30.0)),
            row(3, &["a"], likeness([9, 9], 10.0)),
        ];
        let all = summaries(&["twin".to_owned()], &rows);
        let told: Vec<_> = all.iter().map(|s| (s.over, s.frames, s.coverage, s.psnr_db)).collect();
        assert_eq!(
            told,
            [
                (Over::Closed, 2, 0.875, Some(25.0)),
                (Over::Open, 1, 1.0, Some(10.0)),
                (Over::OpenedParts, 1, 0.5, Some(12.0)),
            ]
        );
        assert_eq!(all[0].psnr_fitted_db, None);
    }
}
