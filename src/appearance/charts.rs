//! Pieces of surface laid flat: triangles that hang together and look the same way, projected onto a plane, packed onto pages.

use super::local::Local;
use super::pages;
use super::regions::{self, fits, nearest};
use super::surface_mesh::SurfaceMesh;

/// Texels around a chart that repeat its rim, for filters that look beyond it.
pub(super) const RIM: u32 = 2;
/// Widest and highest page, texels: every graphics card takes it.
pub(super) const PAGE: u32 = 4096;
/// Rounds in which a triangle takes the direction of its neighbours.
const ROUNDS: usize = 4;
/// No direction.
const NONE: u8 = u8::MAX;

/// Triangles on a plane.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chart {
    /// Index of the twin's part that it moves with.
    pub(super) owner: Option<usize>,
    /// Index of the part whose colour stands for its own: it was assumed, and no frame is asked.
    pub(super) assumed: Option<usize>,
    /// Whether what stands around the closed part hides it, or may be taken for it.
    pub(super) shut_in: bool,
    /// Local, with every part closed.
    pub(super) positions: Vec<Local>,
    /// Unit.
    pub(super) normals: Vec<Local>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Right, down and out of the chart: orthonormal, `right x down = -out`.
    pub(super) axes: [Local; 3],
    /// Edge of the texels below which no frame shows more of it, metres; 0 = none is known.
    pub(super) finest: f32,
    /// Of the first texel along right and down, metres.
    pub(super) low: [f32; 2],
    /// Edge of a texel, metres; 0 before [`pack`].
    pub(super) texel: f32,
    /// Texels, its rim with it.
    pub(super) size: [u32; 2],
    /// Page and first texel there.
    pub(super) page: usize,
    pub(super) at: [u32; 2],
}

impl Chart {
    /// A chart of triangles that look in about one direction.
    pub(super) fn new(positions: Vec<Local>, normals: Vec<Local>, triangles: Vec<[u32; 3]>, out: &Local) -> Self {
        Self {
            owner: None,
            assumed: None,
            shut_in: false,
            positions,
            normals,
            triangles,
            axes: axes_of(out),
            finest: 0.0,
            low: [0.0; 2],
            texel: 0.0,
            size: [0; 2],
            page: 0,
            at: [0; 2],
        }
    }

    /// Where a point is on the chart, texels from its first one's corner.
    pub(super) fn coordinates(&self, p: &Local) -> [f32; 2] {
        [0, 1].map(|k| (p.dot(&self.axes[k]) - self.low[k]) / self.texel)
    }

    /// Square metres of its triangles.
    pub(super) fn area(&self) -> f32 {
        let corners = |t: &[u32; 3]| t.map(|v| self.positions[v as usize]);
        self.triangles
            .iter()
            .map(|t| {
                let [a, b, c] = corners(t);
                0.5 * (b - a).cross(&(c - a)).norm()
            })
            .sum()
    }

    /// `[low, high]` along right and down, metres.
    fn bounds(&self) -> [[f32; 2]; 2] {
        [0, 1].map(|k| {
            let along = self.positions.iter().map(|p| p.dot(&self.axes[k]));
            along.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], c| [low.min(c), high.max(c)])
        })
    }
}

/// Right, down and out for a direction: upright pictures where the surface is upright.
fn axes_of(out: &Local) -> [Local; 3] {
    let up = if out.z.abs() < 0.9 { Local::z() } else { Local::y() };
    let right = up.cross(out).normalize();
    // right x up = out, so right x down = -out.
    [right, -out.cross(&right), *out]
}

/// The charts of a mesh, for directions along the room's axes and between them. None is smaller than `least_m2` that borders on
/// another.
pub(super) fn of_mesh(mesh: &SurfaceMesh, room: &[Local; 3], least_m2: f64) -> Vec<Chart> {
    let directions = directions(room);
    let beside = beside(mesh);
    let labels = labels(mesh, &beside, &directions);
    let normals = normals(mesh);
    let mut number = vec![u32::MAX; mesh.positions.len()];
    let chart = |region: regions::ChartRegion| {
        let own = || region.triangles.iter().map(|&t| mesh.triangles[t as usize]);
        let mut vertices: Vec<u32> = own().flatten().collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices.iter().enumerate().for_each(|(i, v)| number[*v as usize] = i as u32);
        Chart::new(
            vertices.iter().map(|&v| mesh.positions[v as usize]).collect(),
            vertices.iter().map(|&v| normals[v as usize]).collect(),
            own().map(|t| t.map(|v| number[v as usize])).collect(),
            &directions[region.direction],
        )
    };
    regions::regions(mesh, &beside, &labels, &directions, least_m2).into_iter().map(chart).collect()
}

/// The room's six directions, then the twelve between two of them.
fn directions(room: &[Local; 3]) -> Vec<Local> {
    let six: Vec<Local> = room.iter().flat_map(|a| [*a, -a]).collect();
    let between = |i: usize| {
        let six = &six;
        (i + 1..6).filter(move |k| k / 2 != i / 2).map(move |k| (six[i] + six[k]).normalize())
    };
    let twelve: Vec<Local> = (0..6).flat_map(between).collect();
    six.iter().chain(&twelve).copied().collect()
}

/// The triangles beside each triangle across its edges; `u32::MAX` where there is none.
fn beside(mesh: &SurfaceMesh) -> Vec<[u32; 3]> {
    // Each edge by its ends, the lower first, with the triangle and the edge's number there.
    let mut edges: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (i, t) in mesh.triangles.iter().enumerate() {
        for k in 0..3u8 {
            let (a, b) = (t[usize::from(k)], t[(usize::from(k) + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], i as u32, k));
        }
    }
    edges.sort_unstable();
    let mut out = vec![[u32::MAX; 3]; mesh.triangles.len()];
    for pair in edges.windows(2) {
        let [(ends, a, i), (other, b, k)] = [pair[0], pair[1]];
        if ends == other {
            out[a as usize][usize::from(i)] = b;
            out[b as usize][usize::from(k)] = a;
        }
    }
    out
}

/// The direction of each triangle: its own nearest, then that of most of its neighbours where it may be.
fn labels(mesh: &SurfaceMesh, beside: &[[u32; 3]], directions: &[Local]) -> Vec<u8> {
    let normals: Vec<Local> = mesh.triangles.iter().map(|t| mesh.across(t)).collect();
    // Noise turns single triangles: each is judged with those around it.
    let smooth: Vec<Local> = normals
        .iter()
        .zip(beside)
        .map(|(n, beside)| beside.iter().filter_map(|o| normals.get(*o as usize)).fold(n * 2.0, |sum, n| sum + n))
        .collect();
    let mut labels: Vec<u8> = normals
        .iter()
        .zip(&smooth)
        .map(|(own, smooth)| {
            let label = nearest(smooth, directions);
            let label = if fits(own, label, directions) { label } else { nearest(own, directions) };
            label as u8
        })
        .collect();
    for _ in 0..ROUNDS {
        let before = labels.clone();
        for (i, (label, beside)) in labels.iter_mut().zip(beside).enumerate() {
            let [a, b, c] = beside.map(|o| before.get(o as usize).copied().unwrap_or(NONE));
            let most = if a == b || a == c { a } else { b };
            let two = usize::from(a == most) + usize::from(b == most) + usize::from(c == most) >= 2;
            if two && most != *label && fits(&normals[i], usize::from(most), directions) {
                *label = most;
            }
        }
    }
    labels
}

/// A unit normal a vertex, weighted by areas.
pub(super) fn normals(mesh: &SurfaceMesh) -> Vec<Local> {
    let mut out = vec![Local::zeros(); mesh.positions.len()];
    for t in &mesh.triangles {
        let across = mesh.across(t);
        t.iter().for_each(|v| out[*v as usize] += across);
    }
    out.iter().map(|n| n.try_normalize(1e-20).unwrap_or_else(Local::z)).collect()
}

/// Chooses the texels' size and a place on a page for each chart. Texels are as large as asked for, or as what a chart's frames show
/// of it; all grow together until they fit. Returns the pages' sizes.
pub(super) fn pack(charts: &mut [Chart], texel_m: f64, most_texels: usize) -> Vec<[u32; 2]> {
    let bounds: Vec<[[f32; 2]; 2]> = charts.iter().map(Chart::bounds).collect();
    let finest = texel_m as f32;
    let mut coarser = 1.0f32;
    for _ in 0..20 {
        for (chart, bounds) in charts.iter_mut().zip(&bounds) {
            let [[left, right], [top, bottom]] = *bounds;
            let longest = (right - left).max(bottom - top);
            // A chart fits onto a page, with its rims and a texel of rounding.
            let fitting = longest / (PAGE - 2 * RIM - 2) as f32;
            let wanted = coarser * finest.max(chart.finest).max(fitting);
            // What nobody saw has one colour.
            chart.texel = if chart.assumed.is_some() { wanted.max(longest) } else { wanted };
            chart.low = [left, top].map(|c| c - RIM as f32 * chart.texel);
            chart.size = [right - left, bottom - top].map(|c| ((c / chart.texel).ceil() as u32).max(1) + 2 * RIM);
        }
        let all = texels(charts);
        if all <= most_texels as u64 {
            break;
        }
        coarser *= (all as f32 / most_texels.max(1) as f32).sqrt().clamp(1.02, 2.0);
    }
    // About square, a little wider as not all of it is filled.
    let widest = charts.iter().map(|c| c.size[0]).max().unwrap_or(1);
    let width = ((1.05 * texels(charts) as f64).sqrt() as u32).clamp(widest, PAGE.max(widest));
    let mut order: Vec<usize> = (0..charts.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(charts[i].size[1]), std::cmp::Reverse(charts[i].size[0]), i));
    let sizes: Vec<[u32; 2]> = order.iter().map(|&i| charts[i].size).collect();
    let (places, pages) = pages::place(&sizes, width, PAGE);
    for (&i, (page, at)) in order.iter().zip(places) {
        charts[i].page = page;
        charts[i].at = at;
    }
    pages
}

/// Texels of all charts, their rims with them.
fn texels(charts: &[Chart]) -> u64 {
    charts.iter().map(|c| u64::from(c.size[0]) * u64::from(c.size[1])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bent sheet: flat, then upright.
    fn corner() -> SurfaceMesh {
        let positions: Vec<Local> = (0..33)
            .map(|i| {
                let (along, across) = (0.1 * (i / 3) as f32, 0.2 * (i % 3) as f32);
                if along <= 0.5 { Local::new(along, across, 0.0) } else { Local::new(0.5, across, along - 0.5) }
            })
            .collect();
        let quad = |i: u32| {
            let a = i / 2 * 3 + i % 2;
            [[a, a + 3, a + 4], [a, a + 4, a + 1]]
        };
        SurfaceMesh { positions, triangles: (0..20).flat_map(quad).collect() }
    }

    #[test]
    fn a_corner_becomes_two_charts_that_share_no_texel() {
        let room = [Local::x(), Local::y(), Local::z()];
        let mut charts = of_mesh(&corner(), &room, 0.0025);
        assert_eq!(charts.len(), 2);
        assert_eq!(charts.iter().map(|c| c.triangles.len()).sum::<usize>(), 40);
        let pages = pack(&mut charts, 0.01, 1 << 20);
        assert_eq!(pages.len(), 1);
        let [a, b] = [0, 1].map(|i: usize| (charts[i].at, charts[i].size));
        assert!((0..2).any(|k| a.0[k] + a.1[k] <= b.0[k] || b.0[k] + b.1[k] <= a.0[k]), "{a:?} {b:?}");
        for chart in &charts {
            let [right, down, out] = chart.axes;
            assert!((right.cross(&down) + out).norm() < 1e-6);
            for p in &chart.positions {
                let at = chart.coordinates(p);
                assert!((0..2).all(|k| at[k] >= 1.9 && at[k] <= chart.size[k] as f32 - 1.9), "{at:?}");
            }
        }
    }

    #[test]
    fn texels_grow_until_all_fit() {
        let room = [Local::x(), Local::y(), Local::z()];
        let mut charts = of_mesh(&corner(), &room, 0.0025);
        pack(&mut charts, 0.0005, 5000);
        let all: u32 = charts.iter().map(|c| c.size[0] * c.size[1]).sum();
        assert!(all <= 5000 && all > 2500, "{all}");
        assert!(charts[0].texel > 0.005);
    }

    #[test]
    fn texels_are_no_finer_than_what_frames_show() {
        let room = [Local::x(), Local::y(), Local::z()];
        let mut charts = of_mesh(&corner(), &room, 0.0025);
        charts[0].finest = 0.02;
        pack(&mut charts, 0.004, 1 << 20);
        assert!((charts[0].texel - 0.02).abs() < 1e-6, "{}", charts[0].texel);
        assert!((charts[1].texel - 0.004).abs() < 1e-6, "{}", charts[1].texel);
    }
}
