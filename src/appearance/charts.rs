//! Pieces of surface laid flat: triangles that hang together and look the same way, projected onto a plane, packed onto pages.

use super::Local;
use super::mesh::Mesh;

/// Texels around a chart that repeat its rim, for filters that look beyond it.
pub(super) const RIM: u32 = 2;
/// Widest and highest page, texels: every graphics card takes it.
pub(super) const PAGE: u32 = 4096;
/// Rounds in which a triangle takes the direction of its neighbours.
const ROUNDS: usize = 4;
/// A triangle seen at less than this (cosine) from its chart's direction would be smeared.
const LEAST_COSINE: f32 = 0.3;
/// No direction.
const NONE: u8 = u8::MAX;

/// Triangles on a plane.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chart {
    /// Index of the twin's part that it moves with.
    pub(super) owner: Option<usize>,
    /// Index of the part whose colour stands for its own: it was assumed, and no frame is asked.
    pub(super) assumed: Option<usize>,
    /// Local, with every part closed.
    pub(super) positions: Vec<Local>,
    /// Unit.
    pub(super) normals: Vec<Local>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Right, down and out of the chart: orthonormal, `right x down = -out`.
    pub(super) axes: [Local; 3],
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
            positions,
            normals,
            triangles,
            axes: axes_of(out),
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

/// The charts of a mesh, for directions along the room's axes and between them.
pub(super) fn of_mesh(mesh: &Mesh, room: &[Local; 3]) -> Vec<Chart> {
    let directions = directions(room);
    let beside = beside(mesh);
    let labels = labels(mesh, &beside, &directions);
    let normals = normals(mesh);
    let mut charts = Vec::new();
    let mut taken = vec![false; mesh.triangles.len()];
    let mut number = vec![u32::MAX; mesh.positions.len()];
    for start in 0..mesh.triangles.len() {
        if taken[start] || labels[start] == NONE {
            continue;
        }
        taken[start] = true;
        let mut piece = vec![start];
        let mut next = 0;
        while let Some(&t) = piece.get(next) {
            next += 1;
            for other in beside[t].iter().map(|o| *o as usize) {
                if other < taken.len() && !taken[other] && labels[other] == labels[start] {
                    taken[other] = true;
                    piece.push(other);
                }
            }
        }
        let mut vertices: Vec<u32> = piece.iter().flat_map(|&t| mesh.triangles[t]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        vertices.iter().enumerate().for_each(|(i, v)| number[*v as usize] = i as u32);
        charts.push(Chart::new(
            vertices.iter().map(|&v| mesh.positions[v as usize]).collect(),
            vertices.iter().map(|&v| normals[v as usize]).collect(),
            piece.iter().map(|&t| mesh.triangles[t].map(|v| number[v as usize])).collect(),
            &directions[usize::from(labels[start])],
        ));
    }
    charts
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
fn beside(mesh: &Mesh) -> Vec<[u32; 3]> {
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
fn labels(mesh: &Mesh, beside: &[[u32; 3]], directions: &[Local]) -> Vec<u8> {
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
            let best = |n: &Local| {
                let along = directions.iter().map(|d| d.dot(n));
                along.enumerate().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0))).map_or(NONE, |b| b.0 as u8)
            };
            let label = best(smooth);
            if fits(own, label, directions) { label } else { best(own) }
        })
        .collect();
    for _ in 0..ROUNDS {
        let before = labels.clone();
        for (i, (label, beside)) in labels.iter_mut().zip(beside).enumerate() {
            let [a, b, c] = beside.map(|o| before.get(o as usize).copied().unwrap_or(NONE));
            let most = if a == b || a == c { a } else { b };
            let two = usize::from(a == most) + usize::from(b == most) + usize::from(c == most) >= 2;
            if two && most != *label && fits(&normals[i], most, directions) {
                *label = most;
            }
        }
    }
    labels
}

/// Whether a triangle may lie on a chart of a direction.
fn fits(across: &Local, label: u8, directions: &[Local]) -> bool {
    directions.get(usize::from(label)).is_some_and(|d| d.dot(across) > LEAST_COSINE * across.norm())
}

/// A unit normal a vertex, weighted by areas.
fn normals(mesh: &Mesh) -> Vec<Local> {
    let mut out = vec![Local::zeros(); mesh.positions.len()];
    for t in &mesh.triangles {
        let across = mesh.across(t);
        t.iter().for_each(|v| out[*v as usize] += across);
    }
    out.iter().map(|n| n.try_normalize(1e-20).unwrap_or_else(Local::z)).collect()
}

/// Chooses the texels' size and a place on a page for each chart, in rows of falling height. Returns the pages' sizes.
pub(super) fn pack(charts: &mut [Chart], texel_m: f64, most_texels: usize) -> Vec<[u32; 2]> {
    let bounds: Vec<[[f32; 2]; 2]> = charts.iter().map(Chart::bounds).collect();
    let longest = bounds.iter().flatten().map(|[low, high]| high - low).fold(0.0, f32::max);
    // A chart fits onto a page, with its rims and a texel of rounding.
    let mut texel = (texel_m as f32).max(longest / (PAGE - 2 * RIM - 2) as f32);
    for _ in 0..20 {
        for (chart, bounds) in charts.iter_mut().zip(&bounds) {
            let [[left, right], [top, bottom]] = *bounds;
            // What nobody saw has one colour.
            chart.texel = if chart.assumed.is_some() { texel.max((right - left).max(bottom - top)) } else { texel };
            chart.low = [left, top].map(|c| c - RIM as f32 * chart.texel);
            chart.size = [right - left, bottom - top].map(|c| ((c / chart.texel).ceil() as u32).max(1) + 2 * RIM);
        }
        let all: u64 = charts.iter().map(|c| u64::from(c.size[0]) * u64::from(c.size[1])).sum();
        if all <= most_texels as u64 {
            break;
        }
        texel *= (all as f32 / most_texels.max(1) as f32).sqrt().clamp(1.02, 2.0);
    }
    rows(charts)
}

fn rows(charts: &mut [Chart]) -> Vec<[u32; 2]> {
    let all: u64 = charts.iter().map(|c| u64::from(c.size[0]) * u64::from(c.size[1])).sum();
    let widest = charts.iter().map(|c| c.size[0]).max().unwrap_or(1);
    // About square, a little wider as rows are not full.
    let width = ((1.05 * all as f64).sqrt() as u32).clamp(widest, PAGE.max(widest));
    let mut order: Vec<usize> = (0..charts.len()).collect();
    order.sort_by_key(|&i| (std::cmp::Reverse(charts[i].size[1]), std::cmp::Reverse(charts[i].size[0]), i));
    let mut pages: Vec<[u32; 2]> = Vec::new();
    // Where the next chart goes, and the height of its row.
    let (mut x, mut y, mut height) = (0, 0, 0);
    for i in order {
        let [w, h] = charts[i].size;
        if x + w > width {
            (x, y, height) = (0, y + height, 0);
        }
        if pages.is_empty() || y + h > PAGE {
            pages.push([0, 0]);
            (x, y, height) = (0, 0, 0);
        }
        charts[i].page = pages.len() - 1;
        charts[i].at = [x, y];
        x += w;
        height = height.max(h);
        if let Some(page) = pages.last_mut() {
            *page = [page[0].max(x), page[1].max(y + h)];
        }
    }
    pages
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bent sheet: flat, then upright.
    fn corner() -> Mesh {
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
        Mesh { positions, triangles: (0..20).flat_map(quad).collect() }
    }

    #[test]
    fn a_corner_becomes_two_charts_that_share_no_texel() {
        let room = [Local::x(), Local::y(), Local::z()];
        let mut charts = of_mesh(&corner(), &room);
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
        let mut charts = of_mesh(&corner(), &room);
        pack(&mut charts, 0.0005, 5000);
        let all: u32 = charts.iter().map(|c| c.size[0] * c.size[1]).sum();
        assert!(all <= 5000 && all > 2500, "{all}");
        assert!(charts[0].texel > 0.005);
    }
}
