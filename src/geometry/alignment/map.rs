//! What a recording shows of its place: surfaces with normals, and the views that saw them.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::icp::Index;
use crate::config::{self, Config};
use crate::geometry::depth_scale;
use crate::localization::{views, voxels};
use crate::math::{Point, Pose, Vector, centroid, sampling, stats, unit};
use crate::recording::sketch::Sketch;
use crate::recording::videos::Fit;
use crate::recording::{AtWork, Camera, Grid, Recording};

/// A piece of surface: world, metres; the normal faces who saw it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Surfel {
    pub(super) at: Point,
    pub(super) normal: Vector,
    /// Brightness, 0 to 255, where there is an image.
    grey: Option<f64>,
}

impl Surfel {
    pub(super) fn moved(&self, pose: &Pose) -> Self {
        Self { at: pose * self.at, normal: pose * self.normal, ..*self }
    }
}

/// A view, thinned.
#[derive(Debug, Clone)]
struct View {
    sketch: Sketch,
    /// Its pixels are the sketch's samples.
    camera: Camera,
    world_from_camera: Pose,
    /// What the sketch's depth is multiplied by.
    factor: f64,
    /// Brightness around each sample, where there is an image.
    grey: Option<Grid<u8>>,
}

/// What is known of a place.
#[derive(Debug, Clone, Default)]
pub struct Map {
    views: Vec<View>,
    surfels: Vec<Surfel>,
}

/// What a recording shows of its place, from up to `alignment.frames` frames in which nobody works, spread over where the camera
/// was. Images that cannot be read are left out; whoever needs them says so.
#[must_use]
pub fn map_of(recording: &Recording, config: &Config) -> Map {
    let at_work = AtWork::of(recording);
    let mut frames = views::survey(recording, &at_work, config.alignment.frames);
    if frames.is_empty() {
        let all: Vec<usize> = (0..recording.frames.len()).filter(|&f| recording.has_depth(f)).collect();
        frames = all.iter().copied().step_by(sampling::stride(all.len(), config.alignment.frames)).collect();
    }
    let looks: Vec<Option<(Sketch, Option<Grid<u8>>)>> = frames.par_iter().map(|&f| look_of(recording, f)).collect();
    let (mut sketches, mut greys) = (BTreeMap::new(), BTreeMap::new());
    for (sketch, grey) in looks.into_iter().flatten() {
        greys.insert(sketch.frame, grey);
        sketches.insert(sketch.frame, sketch);
    }
    let factors =
        config.geometry.depth_scale.then(|| depth_scale::solve(recording, &sketches, &config.geometry.scales));
    let views: Vec<View> = sketches
        .into_iter()
        .map(|(frame, sketch)| {
            let has_file = recording.frames.get(frame).is_some_and(|f| f.files.depth.is_some());
            View {
                camera: sketch.camera(recording.camera_of(frame)),
                world_from_camera: recording.frames.get(frame).map_or_else(Pose::identity, |f| f.world_from_camera),
                // A reconstruction is metric already.
                factor: factors.as_ref().filter(|_| has_file).map_or(1.0, |factors| factors.of(frame)),
                grey: greys.remove(&frame).flatten(),
                sketch,
            }
        })
        .collect();
    let seen: Vec<Surfel> = views.par_iter().flat_map_iter(|view| view.surfels(&config.alignment.judging)).collect();
    let surfels = thinned(&seen, config.alignment.voxel_m);
    Map { views, surfels }
}

fn look_of(recording: &Recording, frame: usize) -> Option<(Sketch, Option<Grid<u8>>)> {
    let depth = recording.depth_as_read(frame).ok()??;
    let mask = recording.mask(frame).ok()?;
    let sketch = Sketch::of(frame, &depth, mask.as_ref());
    let image = recording.grey(frame).ok().flatten();
    let grey = image.map(|image| brightness(&sketch, &image));
    Some((sketch, grey))
}

/// Mean brightness of an image around each sample of a sketch.
fn brightness(sketch: &Sketch, image: &Grid<u8>) -> Grid<u8> {
    let (width, height) = (sketch.depth_mm.width, sketch.depth_mm.height);
    let reach = (sketch.step / 2).max(1);
    let around = |at: usize, size: usize| at.saturating_sub(reach)..(at + reach + 1).min(size);
    let mean = |x: usize, y: usize| {
        let (u, v) = (x * sketch.step + sketch.step / 2, y * sketch.step + sketch.step / 2);
        let (mut sum, mut count) = (0u32, 0u32);
        for row in around(v, image.height) {
            for pixel in around(u, image.width).filter_map(|column| image.get(column, row)) {
                (sum, count) = (sum + u32::from(pixel), count + 1);
            }
        }
        (sum / count.max(1)) as u8
    };
    Grid { width, height, data: (0..width * height).map(|i| mean(i % width, i / width)).collect() }
}

/// What was seen in a voxel: sums and counts.
struct Cell {
    at: Vector,
    normal: Vector,
    count: f64,
    grey: f64,
    grey_count: f64,
}

impl Cell {
    fn empty() -> Self {
        Self { at: Vector::zeros(), normal: Vector::zeros(), count: 0.0, grey: 0.0, grey_count: 0.0 }
    }
}

/// One piece of surface for each voxel and each of the six directions that it may face: the mean of what was seen there.
fn thinned(surfels: &[Surfel], voxel_m: f64) -> Vec<Surfel> {
    let mut cells: BTreeMap<([i32; 3], usize), Cell> = BTreeMap::new();
    for s in surfels {
        let axis = s.normal.iamax();
        let facing = 2 * axis + usize::from(s.normal[axis] < 0.0);
        let cell = cells.entry((voxels::index(&s.at, voxel_m), facing)).or_insert_with(Cell::empty);
        cell.at += s.at.coords;
        cell.normal += s.normal;
        cell.count += 1.0;
        if let Some(grey) = s.grey {
            cell.grey += grey;
            cell.grey_count += 1.0;
        }
    }
    cells
        .into_values()
        .filter_map(|c| {
            let grey = (c.grey_count > 0.0).then(|| c.grey / c.grey_count);
            Some(Surfel { at: Point::from(c.at / c.count), normal: unit(&c.normal)?, grey })
        })
        .collect()
}

impl View {
    /// Pieces of surface that it shows.
    fn surfels(&self, rules: &config::AlignmentJudging) -> Vec<Surfel> {
        let (width, height) = (self.sketch.depth_mm.width, self.sketch.depth_mm.height);
        // As for the scale of depth: wide enough to average pixel noise, narrow enough for a drawer's front.
        let reach = (width / rules.normal_reach).max(2);
        let stride = (((width * height) as f64 / rules.samples as f64).sqrt().round() as usize).max(1);
        let full = self.full_camera();
        let mut all = Vec::new();
        for y in (stride / 2..height).step_by(stride) {
            for x in (stride / 2..width).step_by(stride) {
                let Some(p) = self.sketch.point(&full, x, y) else { continue };
                let Some(normal) = self.sketch.normal(&full, x, y, reach) else { continue };
                let local = Point::from(p.coords * self.factor);
                let [near_m, far_m] = rules.range_m;
                if (near_m..far_m).contains(&local.z)
                    && -normal.dot(&p.coords) > rules.least_slant_cos * p.coords.norm()
                {
                    let (at, normal) = (self.world_from_camera * local, self.world_from_camera * normal);
                    let grey = self.grey.as_ref().and_then(|grey| grey.get(x, y)).map(f64::from);
                    all.push(Surfel { at, normal, grey });
                }
            }
        }
        all
    }

    /// The camera whose pixels the sketch samples.
    fn full_camera(&self) -> Camera {
        let (step, first) = (self.sketch.step as f64, (self.sketch.step / 2) as f64);
        let c = &self.camera;
        Camera {
            width: c.width * self.sketch.step,
            height: c.height * self.sketch.step,
            fx: c.fx * step,
            fy: c.fy * step,
            cx: c.cx * step + first,
            cy: c.cy * step + first,
        }
    }

    /// What it sees where a piece of surface (camera's frame) is; `None` where it does not look at its front.
    fn glance(&self, at: &Point, normal: &Vector, rules: &config::AlignmentJudging) -> Option<Glance> {
        let [near_m, far_m] = rules.range_m;
        let slant = -normal.dot(&at.coords) / at.coords.norm();
        if !(near_m..far_m).contains(&at.z) || slant < rules.least_slant_cos {
            return None;
        }
        let (u, v) = self.camera.project(at)?;
        let (x, y) = self.sketch.nearest(u, v)?;
        let z = f64::from(self.sketch.depth_m(y * self.sketch.depth_mm.width + x)) * self.factor;
        // The nearest sample is up to half a sample beside it, which counts the more the more the surface is slanted.
        let beside = 0.5 * at.z / (self.camera.fx * slant);
        let grey = self.grey.as_ref().and_then(|grey| grey.get(x, y)).map(f64::from);
        // The place is one recording's and the view another one's: the noise that a recording measures of its own depth is not theirs.
        (z > 0.0).then_some(Glance {
            gap_m: z - at.z,
            limit_m: rules.depth_floor_m + rules.depth_per_m * at.z + beside,
            grey,
        })
    }
}

/// What a view sees where a piece of surface is.
struct Glance {
    /// How far behind it something is seen, metres along the camera's axis.
    gap_m: f64,
    /// How far that may be off.
    limit_m: f64,
    grey: Option<f64>,
}

/// Sums over pairs of brightnesses of one view.
#[derive(Debug, Clone, Copy, Default)]
struct Greys {
    count: f64,
    sums: [f64; 2],
    /// Of `x^2`, `xy`, `y^2`.
    products: [f64; 3],
}

impl Greys {
    fn add(&mut self, x: f64, y: f64) {
        self.count += 1.0;
        self.sums = [self.sums[0] + x, self.sums[1] + y];
        let [xx, xy, yy] = self.products;
        self.products = [xx + x * x, xy + x * y, yy + y * y];
    }

    /// The products about the view's own means: each view has an exposure of its own.
    fn centred(&self) -> [f64; 3] {
        let ([x, y], n) = (self.sums, self.count.max(1.0));
        let [xx, xy, yy] = self.products;
        [xx - x * x / n, xy - x * y / n, yy - y * y / n]
    }
}

/// How the surfaces of two maps meet under an alignment.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Meeting {
    /// Pieces of surface that were asked for.
    asked: f64,
    /// Of them, those that the other side looks at and sees; a share of a piece where its views differ.
    seen: f64,
    /// Those that it sees through.
    through: f64,
    /// Pairs of brightnesses of what both see, and their variations `x^2`, `xy`, `y^2`.
    pairs: f64,
    greys: [f64; 3],
    residual_m: f64,
}

impl Meeting {
    /// Share of what the other side looks at that it sees.
    pub(super) fn agreement(&self) -> f64 {
        let told = self.seen + self.through;
        if told > 0.0 { self.seen / told } else { 0.0 }
    }

    /// Share of all that the other side looks at.
    pub(super) fn overlap(&self) -> f64 {
        if self.asked > 0.0 { (self.seen + self.through) / self.asked } else { 0.0 }
    }

    /// How the brightness of what both see goes together: its correlation; `None` where too little of it has images, or all of
    /// it is equally bright.
    pub(super) fn likeness(&self, rules: &config::AlignmentJudging) -> Option<f64> {
        let [xx, xy, yy] = self.greys;
        (self.pairs >= rules.least_pairs && xx > 0.0 && yy > 0.0).then(|| xy / (xx * yy).sqrt())
    }

    /// What is seen, less three times what is seen through, as a share of all: surfaces meet by chance, empty places do not hold
    /// any. Of what both look at, unlike brightness takes up to twice. At most 1.
    pub(super) fn score(&self, rules: &config::AlignmentJudging) -> f64 {
        if self.asked <= 0.0 {
            return 0.0;
        }
        let unlike = self.likeness(rules).map_or(0.0, |likeness| rules.unlike * (1.0 - likeness));
        (self.seen - rules.against * self.through) / self.asked - self.overlap() * unlike
    }

    pub(super) fn fit(&self, lead: Option<f64>, rules: &config::AlignmentJudging) -> Fit {
        Fit {
            agreement: self.agreement(),
            overlap: self.overlap(),
            likeness: self.likeness(rules),
            residual_m: self.residual_m,
            lead,
        }
    }
}

impl Map {
    pub(super) fn surfels(&self) -> &[Surfel] {
        &self.surfels
    }

    pub(super) fn is_small(&self, rules: &config::AlignmentJudging) -> bool {
        self.surfels.len() < rules.least_surfels
    }

    /// Middle of all surfaces.
    pub(super) fn middle(&self) -> Point {
        let all: Vec<Point> = self.surfels.iter().map(|s| s.at).collect();
        centroid(&all).unwrap_or_else(Point::origin)
    }

    /// How the surfaces of another map, moved by `pose` into this one's world, and its own meet. `nearest`: of its own surfaces.
    pub(super) fn meeting(
        &self,
        other: &Self,
        pose: &Pose,
        nearest: &Index,
        rules: &config::AlignmentJudging,
    ) -> Meeting {
        let [ours, theirs] = [self.seen_by(other, &pose.inverse(), rules), other.seen_by(self, pose, rules)];
        let distances = nearest.distances(other.surfels(), pose);
        Meeting {
            asked: ours.asked + theirs.asked,
            seen: ours.seen + theirs.seen,
            through: ours.through + theirs.through,
            pairs: ours.pairs + theirs.pairs,
            greys: [0, 1, 2].map(|k| ours.greys[k] + theirs.greys[k]),
            residual_m: stats::median(&distances).unwrap_or(0.0),
        }
    }

    /// How its surfaces, moved by `pose`, are seen by the views of another map.
    fn seen_by(&self, other: &Self, pose: &Pose, rules: &config::AlignmentJudging) -> Meeting {
        let step = sampling::stride(self.surfels.len(), rules.judged);
        let views: Vec<(Pose, &View)> =
            other.views.iter().map(|view| (view.world_from_camera.inverse() * pose, view)).collect();
        let mut all = Meeting::default();
        let mut greys = vec![Greys::default(); views.len()];
        for surfel in self.surfels.iter().step_by(step) {
            let (mut seen, mut through) = (0.0, 0.0);
            for ((camera_from_own, view), greys) in views.iter().zip(&mut greys) {
                let local = surfel.moved(camera_from_own);
                // What stands before it hides it, which tells nothing.
                let Some(glance) = view.glance(&local.at, &local.normal, rules) else { continue };
                if glance.gap_m > glance.limit_m {
                    through += 1.0;
                } else if glance.gap_m >= -glance.limit_m {
                    seen += 1.0;
                    if let (Some(x), Some(y)) = (surfel.grey, glance.grey) {
                        greys.add(x, y);
                    }
                }
            }
            all.asked += 1.0;
            if seen + through > 0.0 {
                all.seen += seen / (seen + through);
                all.through += through / (seen + through);
            }
        }
        for view in greys.iter().filter(|greys| greys.count >= rules.least_in_view) {
            let own = view.centred();
            all.pairs += view.count;
            all.greys = [0, 1, 2].map(|k| all.greys[k] + own[k]);
        }
        all
    }

    /// Takes another map in, moved by `pose` into this one's world; of all views `most_views` are kept, spread over where cameras
    /// were.
    pub fn take_in(&mut self, other: &Self, pose: &Pose, config: &config::Alignment) {
        let moved =
            other.views.iter().map(|view| View { world_from_camera: pose * view.world_from_camera, ..view.clone() });
        let all: Vec<View> = self.views.drain(..).chain(moved).collect();
        self.views = spread(all, config.most_views);
        let surfels: Vec<Surfel> =
            self.surfels.iter().copied().chain(other.surfels.iter().map(|s| s.moved(pose))).collect();
        self.surfels = thinned(&surfels, config.voxel_m);
    }

    #[cfg(test)]
    pub(super) fn views(&self) -> usize {
        self.views.len()
    }

    /// A map of given views, for tests: depth without errors.
    #[cfg(test)]
    pub(super) fn of_views(views: Vec<(Sketch, Camera, Pose)>, voxel_m: f64) -> Self {
        let views: Vec<View> = views
            .into_iter()
            .map(|(sketch, full, world_from_camera)| View {
                camera: sketch.camera(&full),
                world_from_camera,
                factor: 1.0,
                grey: None,
                sketch,
            })
            .collect();
        let seen: Vec<Surfel> =
            views.iter().flat_map(|view| view.surfels(&config::AlignmentJudging::default())).collect();
        let surfels = thinned(&seen, voxel_m);
        Self { views, surfels }
    }
}

/// At most so many views, by farthest-point sampling over where the cameras are and where they look, from the first on; in their
/// order.
fn spread(views: Vec<View>, most: usize) -> Vec<View> {
    let places: Vec<[Vector; 2]> = views
        .iter()
        .map(|v| [v.world_from_camera.translation.vector, v.world_from_camera.rotation * Vector::z()])
        .collect();
    let apart = |a: usize, b: usize| {
        let ([at, ahead], [from, looking]) = (places[b], places[a]);
        (at - from).norm() + (ahead - looking).norm()
    };
    let kept = sampling::farthest(views.len(), 0, most, apart);
    views.into_iter().enumerate().filter(|(i, _)| kept.binary_search(i).is_ok()).map(|(_, view)| view).collect()
}
