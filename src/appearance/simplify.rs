//! Fewer triangles by edge collapse under quadric errors (Garland and Heckbert 1997).
//!
//! Collapses come in passes, without a queue: of all edges the cheapest quarter may go, each unless something near it has changed in
//! this pass, so that neighbourhoods are looked up in lists that are built once a pass. Large meshes are first worked on in cubes of
//! a metre, each alone, with what cubes share held fast.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::surface_mesh::SurfaceMesh;

/// Edge of the cubes, metres: some ten thousands of triangles each.
const CUBE_M: f32 = 1.0;
/// The cubes leave this many times the budget: the rims that they share are worked on afterwards.
const ROUGH: f64 = 2.5;
/// Of the edges of a pass this share may go; twice as many after a pass that was stuck, as the cheapest may all have to stay.
const SHARE: f64 = 0.25;
/// A pass that takes fewer of a hundred triangles than this is stuck; one that may take any edge ends the work.
const LEAST_PERCENT: usize = 1;
/// Passes at the most: each takes about an eighth.
const PASSES: usize = 80;
/// Planes that hold an open edge where it is, against those of the surface.
const EDGE_WEIGHT: f64 = 10.0;
/// Pull of a vertex to where it is, as a share of its own planes: on a flat surface the best place is not unique.
const STAY: f64 = 1e-3;

/// The error of a place against weighted planes: `p' A p - 2 b' p + c`.
#[derive(Debug, Clone, Copy)]
struct Quadric {
    /// Upper triangle of A by rows.
    a: [f64; 6],
    b: [f64; 3],
    c: f64,
}

impl Quadric {
    const ZERO: Self = Self { a: [0.0; 6], b: [0.0; 3], c: 0.0 };

    /// Of the plane `n . p = d` (unit normal).
    fn plane(n: &Vector3<f64>, d: f64, weight: f64) -> Self {
        let (w, [x, y, z]) = (weight, [n.x, n.y, n.z]);
        Self {
            a: [x * x, x * y, x * z, y * y, y * z, z * z].map(|v| w * v),
            b: [x, y, z].map(|v| w * d * v),
            c: w * d * d,
        }
    }

    /// Of the distance from a point.
    fn point(p: &Vector3<f64>, weight: f64) -> Self {
        let w = weight;
        Self { a: [w, 0.0, 0.0, w, 0.0, w], b: [p.x, p.y, p.z].map(|v| w * v), c: w * p.norm_squared() }
    }

    fn add(&mut self, other: &Self) {
        self.a.iter_mut().zip(other.a).for_each(|(x, y)| *x += y);
        self.b.iter_mut().zip(other.b).for_each(|(x, y)| *x += y);
        self.c += other.c;
    }

    fn error(&self, p: &Vector3<f64>) -> f64 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let (x, y, z) = (p.x, p.y, p.z);
        let square = x * (xx * x + 2.0 * (xy * y + xz * z)) + y * (yy * y + 2.0 * yz * z) + zz * z * z;
        (square - 2.0 * (self.b[0] * x + self.b[1] * y + self.b[2] * z) + self.c).max(0.0)
    }

    /// Where the error is least.
    fn best(&self) -> Option<Vector3<f64>> {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let matrix = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let best = matrix.try_inverse()? * Vector3::from(self.b);
        best.iter().all(|c| c.is_finite()).then_some(best)
    }
}

/// At most so many triangles, or as few as can be had without a fold or a tear. Open edges stay where they are.
pub(super) fn simplify(mesh: SurfaceMesh, budget: usize) -> SurfaceMesh {
    if mesh.triangles.len() <= budget {
        return mesh;
    }
    let rough = (budget as f64 * ROUGH) as usize;
    let mut mesh = cut_knots(mesh);
    if mesh.triangles.len() > 2 * rough {
        mesh = in_cubes(&mesh, rough);
    }
    let fast = vec![false; mesh.positions.len()];
    reduced(mesh, &fast, budget)
}

/// Gives each sheet that meets others in a vertex a vertex of its own. Noisy surfaces touch themselves in thousands of places, and a
/// vertex where sheets meet could not move.
fn cut_knots(mut mesh: SurfaceMesh) -> SurfaceMesh {
    let whole = mesh.triangles.clone();
    let rings = Rings::of(&whole, mesh.positions.len());
    for v in 0..mesh.positions.len() as u32 {
        let ring = rings.around(v);
        let fans = fans(&whole, ring, v);
        for fan in 1..fans.iter().max().map_or(0, |last| last + 1) {
            let copy = mesh.positions.len() as u32;
            mesh.positions.push(mesh.positions[v as usize]);
            for (i, _) in ring.iter().zip(&fans).filter(|(_, own)| **own == fan) {
                mesh.triangles[*i as usize].iter_mut().filter(|w| **w == v).for_each(|w| *w = copy);
            }
        }
    }
    mesh
}

/// For each triangle around a vertex the number of its fan: triangles are of one where an edge that no third one has joins them.
fn fans(triangles: &[[u32; 3]], ring: &[u32], vertex: u32) -> Vec<usize> {
    let ends: Vec<[u32; 2]> = ring
        .iter()
        .map(|i| [before(&triangles[*i as usize], vertex), after(&triangles[*i as usize], vertex)])
        .collect();
    let once = |side: usize, w: u32| ends.iter().filter(|e| e[side] == w).count() == 1;
    let joined = |x: usize, y: usize| {
        let across = |from: [u32; 2], to: [u32; 2]| from[1] == to[0] && once(1, from[1]) && once(0, from[1]);
        across(ends[x], ends[y]) || across(ends[y], ends[x])
    };
    let mut fan = vec![usize::MAX; ring.len()];
    let mut count = 0;
    for start in 0..ring.len() {
        if fan[start] != usize::MAX {
            continue;
        }
        let mut open = vec![start];
        fan[start] = count;
        while let Some(x) = open.pop() {
            for (y, of) in fan.iter_mut().enumerate() {
                if *of == usize::MAX && joined(x, y) {
                    *of = count;
                    open.push(y);
                }
            }
        }
        count += 1;
    }
    fan
}

/// Works on each cube alone.
fn in_cubes(mesh: &SurfaceMesh, budget: usize) -> SurfaceMesh {
    let mut cubes: BTreeMap<[i32; 3], Vec<u32>> = BTreeMap::new();
    for (i, t) in mesh.triangles.iter().enumerate() {
        let p = mesh.positions[t[0] as usize] / CUBE_M;
        cubes.entry([p.x, p.y, p.z].map(|c| c.floor() as i32)).or_default().push(i as u32);
    }
    // A vertex of several cubes stays.
    let mut owner = vec![u32::MAX; mesh.positions.len()];
    let mut shared = vec![false; mesh.positions.len()];
    for (number, list) in cubes.values().enumerate() {
        for v in list.iter().flat_map(|&i| mesh.triangles[i as usize]) {
            let own = &mut owner[v as usize];
            shared[v as usize] |= *own != u32::MAX && *own != number as u32;
            *own = number as u32;
        }
    }
    let share = budget as f64 / mesh.triangles.len() as f64;
    let lists: Vec<&Vec<u32>> = cubes.values().collect();
    let parts: Vec<(SurfaceMesh, Vec<Option<u32>>)> = lists
        .par_iter()
        .map(|list| {
            let mut vertices: Vec<u32> = list.iter().flat_map(|&i| mesh.triangles[i as usize]).collect();
            vertices.sort_unstable();
            vertices.dedup();
            let local = |v: u32| vertices.partition_point(|x| *x < v) as u32;
            let part = SurfaceMesh {
                positions: vertices.iter().map(|&v| mesh.positions[v as usize]).collect(),
                triangles: list.iter().map(|&i| mesh.triangles[i as usize].map(local)).collect(),
            };
            let fast: Vec<bool> = vertices.iter().map(|&v| shared[v as usize]).collect();
            let most = (list.len() as f64 * share) as usize;
            let mut reduced = passes(part, &fast, most);
            let names: Vec<Option<u32>> = vertices.iter().zip(&fast).map(|(&v, fast)| fast.then_some(v)).collect();
            reduced.triangles.shrink_to_fit();
            (reduced, names)
        })
        .collect();
    // What cubes share gets one number.
    let mut out = SurfaceMesh::default();
    let mut number: BTreeMap<u32, u32> = BTreeMap::new();
    for (part, names) in parts {
        let numbers: Vec<u32> = part
            .positions
            .iter()
            .zip(&names)
            .map(|(p, name)| {
                let fresh = out.positions.len() as u32;
                let own = name.map_or(fresh, |name| *number.entry(name).or_insert(fresh));
                if own == fresh {
                    out.positions.push(*p);
                }
                own
            })
            .collect();
        out.triangles.extend(part.triangles.iter().map(|t| t.map(|v| numbers[v as usize])));
    }
    out.compacted()
}

fn reduced(mesh: SurfaceMesh, fast: &[bool], budget: usize) -> SurfaceMesh {
    passes(mesh, fast, budget).compacted()
}

/// Passes until the budget is met; vertices keep their numbers, and those that are `fast` their places.
fn passes(mesh: SurfaceMesh, fast: &[bool], budget: usize) -> SurfaceMesh {
    let Some(middle) = mesh.positions.first().copied() else { return mesh };
    // Near the middle of the numbers squares lose less.
    let mut work = Work {
        positions: mesh.positions.iter().map(|p| (p - middle).map(f64::from)).collect(),
        quadrics: Vec::new(),
        triangles: mesh.triangles,
    };
    work.quadrics = work.planes();
    let mut share = SHARE;
    for _ in 0..PASSES {
        let before = work.triangles.len();
        if before <= budget {
            break;
        }
        work.pass(fast, budget, share);
        let stuck = (before - work.triangles.len()) * 100 < before * LEAST_PERCENT;
        if stuck && share >= 1.0 {
            break;
        }
        share = if stuck { (2.0 * share).min(1.0) } else { SHARE };
    }
    SurfaceMesh {
        positions: work.positions.iter().map(|p: &Vector3<f64>| p.map(|c| c as f32) + middle).collect(),
        triangles: work.triangles,
    }
}

struct Work {
    positions: Vec<Vector3<f64>>,
    quadrics: Vec<Quadric>,
    triangles: Vec<[u32; 3]>,
}

/// The triangles around each vertex.
struct Rings {
    start: Vec<u32>,
    triangles: Vec<u32>,
}

impl Rings {
    fn of(triangles: &[[u32; 3]], vertices: usize) -> Self {
        let mut start = vec![0u32; vertices + 1];
        triangles.iter().flatten().for_each(|v| start[*v as usize + 1] += 1);
        let mut sum = 0;
        for s in &mut start {
            sum += *s;
            *s = sum;
        }
        let mut next = start.clone();
        let mut list = vec![0u32; 3 * triangles.len()];
        for (i, t) in triangles.iter().enumerate() {
            for v in t {
                let at = &mut next[*v as usize];
                list[*at as usize] = i as u32;
                *at += 1;
            }
        }
        Self { start, triangles: list }
    }

    fn around(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.triangles[self.start[v] as usize..self.start[v + 1] as usize]
    }
}

/// The vertex after `vertex` in a triangle.
fn after(triangle: &[u32; 3], vertex: u32) -> u32 {
    let [a, b, c] = *triangle;
    if vertex == a {
        b
    } else if vertex == b {
        c
    } else {
        a
    }
}

/// The vertex before it.
fn before(triangle: &[u32; 3], vertex: u32) -> u32 {
    let [a, b, c] = *triangle;
    if vertex == a {
        c
    } else if vertex == b {
        a
    } else {
        b
    }
}

/// How a vertex lies in the surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Rim {
    /// Surface all around.
    Inner,
    /// On an open edge.
    Open,
    /// Where sheets meet: it stays.
    Knot,
}

impl Work {
    /// The planes of the triangles and of the open edges, by vertex.
    fn planes(&self) -> Vec<Quadric> {
        let rings = Rings::of(&self.triangles, self.positions.len());
        let mut out = vec![Quadric::ZERO; self.positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| self.positions[v as usize]);
            let across = (b - a).cross(&(c - a));
            let length = across.norm();
            if length < 1e-14 {
                continue;
            }
            let normal = across / length;
            let plane = Quadric::plane(&normal, normal.dot(&a), length);
            t.iter().for_each(|v| out[*v as usize].add(&plane));
            for (from, to) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                if rings.around(from).iter().any(|i| before(&self.triangles[*i as usize], from) == to) {
                    continue;
                }
                let way = self.positions[to as usize] - self.positions[from as usize];
                let side = way.cross(&normal);
                let length = side.norm().max(1e-12);
                let side = side / length;
                let at = side.dot(&self.positions[from as usize]);
                let plane = Quadric::plane(&side, at, EDGE_WEIGHT * length * length);
                [from, to].iter().for_each(|v| out[*v as usize].add(&plane));
            }
        }
        for (q, p) in out.iter_mut().zip(&self.positions) {
            let weight = STAY * (q.a[0] + q.a[3] + q.a[5]);
            q.add(&Quadric::point(p, weight));
        }
        out
    }

    fn rim(&self, rings: &Rings, vertex: u32) -> Rim {
        let ring = rings.around(vertex);
        let (mut open, mut knot) = (0, false);
        for &i in ring {
            let next = after(&self.triangles[i as usize], vertex);
            let matching = ring.iter().filter(|k| before(&self.triangles[**k as usize], vertex) == next).count();
            let same = ring.iter().filter(|k| after(&self.triangles[**k as usize], vertex) == next).count();
            open += usize::from(matching == 0);
            knot |= matching > 1 || same > 1;
        }
        // Two fans that touch in a point have two ways out.
        if knot || open > 1 {
            Rim::Knot
        } else if open == 1 {
            Rim::Open
        } else {
            Rim::Inner
        }
    }

    /// Where an edge would go, and the error there; `None` where it has to stay.
    fn goal(&self, [a, b]: [u32; 2], rims: &[Rim], fast: &[bool]) -> Option<(Vector3<f64>, f64)> {
        let held = |v: u32| fast.get(v as usize).copied().unwrap_or(false) || rims[v as usize] == Rim::Knot;
        let (pa, pb) = (self.positions[a as usize], self.positions[b as usize]);
        let mut sum = self.quadrics[a as usize];
        sum.add(&self.quadrics[b as usize]);
        let rim = |v: u32| rims[v as usize] == Rim::Open;
        let place = match (held(a) || (rim(a) && !rim(b)), held(b) || (rim(b) && !rim(a))) {
            (true, true) => return None,
            (true, false) => pa,
            (false, true) => pb,
            (false, false) => {
                let middle = (pa + pb) * 0.5;
                // Further away than the edge is long is a system that is next to singular.
                sum.best().filter(|p| (p - middle).norm() < (pa - pb).norm()).unwrap_or(middle)
            }
        };
        // Of two edges as good the shorter goes first, which keeps triangles even.
        Some((place, sum.error(&place) + 1e-9 * (pa - pb).norm_squared()))
    }

    fn pass(&mut self, fast: &[bool], budget: usize, share: f64) {
        let rings = Rings::of(&self.triangles, self.positions.len());
        let rims: Vec<Rim> = (0..self.positions.len() as u32).into_par_iter().map(|v| self.rim(&rings, v)).collect();
        // Each edge once: an inner one is met in both senses.
        let mut edges: Vec<([u32; 2], f32)> = self
            .triangles
            .par_iter()
            .flat_map_iter(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]])
            .filter(|[a, b]| a < b || !rings.around(*a).iter().any(|i| before(&self.triangles[*i as usize], *a) == *b))
            .filter_map(|edge| Some((edge, self.goal(edge, &rims, fast)?.1 as f32)))
            .collect();
        if edges.is_empty() {
            return;
        }
        let mut errors: Vec<f32> = edges.iter().map(|(_, e)| *e).collect();
        let rank = ((errors.len() as f64 * share) as usize).min(errors.len() - 1);
        let limit = *errors.select_nth_unstable_by(rank, f32::total_cmp).1;
        // A triangle that is as it was has its corners where they were.
        let mut touched = vec![false; self.triangles.len()];
        let mut left = self.triangles.len();
        // The cheapest first: where all may go, the budget ends the pass before the dear ones.
        edges.retain(|(_, error)| *error <= limit);
        edges.par_sort_unstable_by(|(a, x), (b, y)| x.total_cmp(y).then(a.cmp(b)));
        for (edge, _) in &edges {
            if left <= budget {
                break;
            }
            let Some((place, _)) = self.goal(*edge, &rims, fast) else { continue };
            // A vertex that is held fast keeps its number, by which cubes find each other again.
            let [a, b] = *edge;
            let pair = if fast.get(b as usize).copied().unwrap_or(false) { [b, a] } else { [a, b] };
            left -= self.collapse(pair, &place, &rings, &rims, &mut touched);
        }
        self.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    }

    /// Moves both ends of an edge to one place, where the first stays, if nothing near it has changed in this pass and nothing tears or folds. The number
    /// of triangles that are gone.
    fn collapse(
        &mut self,
        [a, b]: [u32; 2],
        place: &Vector3<f64>,
        rings: &Rings,
        rims: &[Rim],
        touched: &mut [bool],
    ) -> usize {
        let near = move || [a, b].into_iter().flat_map(move |v| rings.around(v).iter().map(|i| *i as usize));
        if near().any(|i| touched[i]) {
            return 0;
        }
        let gone = near().filter(|&i| self.triangles[i].contains(&a) && self.triangles[i].contains(&b)).count() / 2;
        // Two ends on open edges with surface between them: the surface would tear.
        if gone == 0 || gone > 2 || (gone == 2 && rims[a as usize] != Rim::Inner && rims[b as usize] != Rim::Inner) {
            return 0;
        }
        // Vertices next to both ends are those of the triangles that go, else two sheets would be glued together.
        let ring = |v: u32| -> Vec<u32> {
            let mut ring: Vec<u32> =
                rings.around(v).iter().flat_map(|i| self.triangles[*i as usize]).filter(|w| *w != v).collect();
            ring.sort_unstable();
            ring.dedup();
            ring
        };
        let (of_a, of_b) = (ring(a), ring(b));
        if of_a.iter().filter(|v| of_b.binary_search(v).is_ok()).count() != gone {
            return 0;
        }
        if near().any(|i| self.folds(i, [a, b], place)) {
            return 0;
        }
        for i in near().collect::<Vec<usize>>() {
            touched[i] = true;
            self.triangles[i].iter_mut().filter(|v| **v == b).for_each(|v| *v = a);
        }
        self.positions[a as usize] = *place;
        let other = self.quadrics[b as usize];
        self.quadrics[a as usize].add(&other);
        gone
    }

    /// Whether a triangle that stays would turn over or become a needle when the ends of an edge move.
    fn folds(&self, triangle: usize, edge: [u32; 2], place: &Vector3<f64>) -> bool {
        /// Cosine of the most that it may turn.
        const TURN: f64 = 0.3;
        /// Least of twice the area against the longest side squared.
        const NEEDLE: f64 = 0.02;
        let t = self.triangles[triangle];
        if edge.iter().all(|v| t.contains(v)) {
            return false;
        }
        let old = t.map(|v| self.positions[v as usize]);
        let new = t.map(|v| if edge.contains(&v) { *place } else { self.positions[v as usize] });
        let across = |[a, b, c]: [Vector3<f64>; 3]| (b - a).cross(&(c - a));
        let sides = |[a, b, c]: [Vector3<f64>; 3]| {
            (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared())
        };
        let (before, now) = (across(old), across(new));
        let slender = |across: &Vector3<f64>, corners| across.norm() / f64::max(sides(corners), 1e-18);
        let thin = slender(&now, new);
        // A needle may stay one: it has to go somehow.
        now.dot(&before) < TURN * now.norm() * before.norm() || thin < NEEDLE.min(slender(&before, old))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::appearance::local::Local;
    use crate::appearance::surface_mesh::tests::sheet;

    /// A square of 1.5 m in the plane z = 0.3 x in steps of a centimetre.
    fn plane() -> SurfaceMesh {
        sheet(150, |x, _| 0.3 * x)
    }

    /// Whether only the square's own four sides are open.
    fn is_whole(mesh: &SurfaceMesh) -> bool {
        let mut edges = std::collections::BTreeMap::<[u32; 2], i32>::new();
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        // Cubes meet at a metre, half a metre from the sides.
        let at_side = |v: u32| {
            let p = &mesh.positions[v as usize];
            [p.x, p.y].iter().any(|c| c.abs() < 0.02 || (c - 1.5).abs() < 0.02)
        };
        edges.iter().filter(|(_, sum)| **sum != 0).all(|([a, b], _)| at_side(*a) && at_side(*b))
    }

    fn area(mesh: &SurfaceMesh) -> f32 {
        mesh.triangles.iter().map(|t| 0.5 * mesh.across(t).norm()).sum()
    }

    #[test]
    fn a_plane_stays_plane_keeps_its_edges_and_meets_the_budget() {
        let whole = plane();
        for budget in [200, 3000] {
            let few = simplify(whole.clone(), budget);
            assert!(few.triangles.len() <= budget, "{}", few.triangles.len());
            assert!(few.triangles.len() * 10 >= budget * 8, "{}", few.triangles.len());
            assert!(few.positions.iter().all(|p| (p.z - 0.3 * p.x).abs() < 1e-4));
            assert!((area(&few) / area(&whole) - 1.0).abs() < 2e-3, "{} of {}", area(&few), area(&whole));
            assert!(few.triangles.iter().all(|t| few.across(t).z > 0.0));
            assert!(is_whole(&few), "torn between cubes");
        }
        assert_eq!(simplify(whole.clone(), 45_000), whole);
    }

    #[test]
    fn sheets_that_touch_in_a_vertex_are_parted_and_others_are_not() {
        let point = |x: f32, y: f32| Local::new(x, y, 0.0);
        // Two triangles at one corner, and two that share an edge.
        let positions = vec![point(0.0, 0.0), point(1.0, 0.0), point(1.0, 1.0), point(-1.0, 0.0), point(-1.0, -1.0)];
        let touching = SurfaceMesh { positions: positions.clone(), triangles: vec![[0, 1, 2], [0, 3, 4]] };
        let cut = cut_knots(touching);
        assert_eq!((cut.positions.len(), cut.triangles), (6, vec![[0, 1, 2], [5, 3, 4]]));
        let joined = SurfaceMesh { positions, triangles: vec![[0, 1, 2], [0, 2, 3]] };
        assert_eq!(cut_knots(joined.clone()), joined);
        assert_eq!(cut_knots(plane()), plane());
    }

    #[test]
    fn one_thread_and_four_give_the_same_triangles() {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| simplify(plane(), 500))
        };
        assert_eq!(run(1), run(4));
    }
}
