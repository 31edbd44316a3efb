//! Triangles as a pinhole camera sees them: unlit, with a z-buffer, perspective-correct. No window system, no graphics card:
//! the same input gives the same pixels everywhere.

use std::sync::Arc;

use crate::math::{Point, Pose, Vector};
use crate::recording::{Camera, Grid};

/// Nothing nearer to the camera is drawn, metres.
const NEAR_M: f64 = 0.02;
/// A pixel's middle this far outside of an edge, as a share of the triangle, is still on it: neighbours leave no crack.
const ON_EDGE: f64 = 1e-9;
/// Owner of a pixel at which there is no surface.
pub const NOTHING: u16 = u16::MAX;

/// Colours of a surface, sRGB.
#[derive(Debug, Clone, Copy)]
pub enum Paint<'a> {
    /// One for all of it.
    Plain([u8; 3]),
    /// One a vertex, linear in between.
    Vertices(&'a [[u8; 3]]),
    /// A picture of `width` pixels a row, three bytes a pixel, rows from the top, and a coordinate a vertex: (0, 0) is the
    /// picture's upper left corner, (1, 1) its lower right one.
    Picture {
        /// A coordinate a vertex.
        uv: &'a [[f32; 2]],
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// `3 * width * height` bytes.
        rgb: &'a [u8],
    },
}

/// Triangles to be drawn.
#[derive(Debug, Clone, Copy)]
pub struct Surface<'a> {
    /// Vertices, metres.
    pub positions: &'a [Point],
    /// Vertex numbers, counter-clockwise seen from outside; those that name no vertex are passed over.
    pub triangles: &'a [[u32; 3]],
    /// Colours.
    pub paint: Paint<'a>,
    /// Where it stands.
    pub world_from_surface: Pose,
    /// Number that its pixels bear; not [`NOTHING`].
    pub owner: u16,
    /// Whether it is seen from behind, too.
    pub two_sided: bool,
}

/// Triangles with their colours, world, metres.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Vertices.
    pub positions: Vec<Point>,
    /// Vertex numbers, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Colours.
    pub paint: MeshPaint,
    /// Whether its program draws it from the inside, too; what does not tell is.
    pub two_sided: bool,
}

/// Colours of a mesh; see [`Paint`].
#[derive(Debug, Clone, PartialEq)]
pub enum MeshPaint {
    /// One for all of it.
    Plain([u8; 3]),
    /// One a vertex.
    Vertices(Vec<[u8; 3]>),
    /// A coordinate a vertex, and the picture.
    Picture(Vec<[f32; 2]>, Arc<Bitmap>),
}

/// A picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bitmap {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `3 * width * height` bytes, sRGB, rows from the top.
    pub rgb: Vec<u8>,
}

impl Mesh {
    /// The mesh as a surface that stands where it is.
    #[must_use]
    pub fn surface(&self, owner: u16, two_sided: bool) -> Surface<'_> {
        let paint = match &self.paint {
            MeshPaint::Plain(color) => Paint::Plain(*color),
            MeshPaint::Vertices(colors) => Paint::Vertices(colors),
            MeshPaint::Picture(uv, map) => {
                Paint::Picture { uv, width: map.width, height: map.height, rgb: map.rgb.as_slice() }
            }
        };
        Surface {
            positions: &self.positions,
            triangles: &self.triangles,
            paint,
            world_from_surface: Pose::identity(),
            owner,
            two_sided,
        }
    }
}

/// What a camera sees.
#[derive(Debug, Clone, PartialEq)]
pub struct RenderedView {
    /// Colours; black where there is no surface.
    pub rgb: Grid<[u8; 3]>,
    /// Depth along the optical axis, metres; 0 = no surface.
    pub depth: Grid<f32>,
    /// Whose surface it is; [`NOTHING`] where there is none.
    pub owner: Grid<u16>,
}

/// The nearest triangle at each pixel.
struct DepthBuffer {
    camera: Camera,
    /// 1/depth; 0 = none.
    inverse: Vec<f32>,
    /// Numbers of surface and triangle.
    hit: Vec<[u32; 2]>,
}

/// Draws surfaces; integer pixels are pixel centres, of two surfaces at one depth the first stays.
#[must_use]
pub fn render(surfaces: &[Surface], world_from_camera: &Pose, camera: &Camera) -> RenderedView {
    let count = camera.width * camera.height;
    let mut buffer = DepthBuffer { camera: *camera, inverse: vec![0.0; count], hit: vec![[0; 2]; count] };
    let camera_from_world = world_from_camera.inverse();
    let mut vertices: Vec<Vec<Vector>> = Vec::with_capacity(surfaces.len());
    for (number, surface) in surfaces.iter().enumerate() {
        let camera_from_surface = camera_from_world * surface.world_from_surface;
        let local: Vec<Vector> = surface.positions.iter().map(|p| (camera_from_surface * p).coords).collect();
        for (i, triangle) in surface.triangles.iter().enumerate() {
            if let Some(corners) = corners(&local, triangle).filter(|c| shows(c, surface.two_sided)) {
                buffer.draw(&corners, [number as u32, i as u32]);
            }
        }
        vertices.push(local);
    }
    let mut view = RenderedView {
        rgb: Grid::filled(camera.width, camera.height, [0; 3]),
        depth: Grid::filled(camera.width, camera.height, 0.0),
        owner: Grid::filled(camera.width, camera.height, NOTHING),
    };
    for (i, (inverse, hit)) in buffer.inverse.iter().zip(&buffer.hit).enumerate() {
        let Some(surface) = surfaces.get(hit[0] as usize).filter(|_| *inverse > 0.0) else { continue };
        let Some(triangle) = surface.triangles.get(hit[1] as usize) else { continue };
        let Some(corners) = vertices.get(hit[0] as usize).and_then(|local| corners(local, triangle)) else { continue };
        let (x, y) = ((i % camera.width) as f64, (i / camera.width) as f64);
        let ray = Vector::new((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1.0);
        view.rgb.data[i] = color(&surface.paint, triangle, &weights(&corners, &ray));
        view.depth.data[i] = 1.0 / inverse;
        view.owner.data[i] = surface.owner;
    }
    view
}

/// The same with `samples` x `samples` rays a pixel, as a pixel of a camera sees an area: their mean colour where at least half
/// of them meet a surface; depth and owner of the first of them that does, from the middle on.
#[must_use]
pub fn render_smooth(surfaces: &[Surface], world_from_camera: &Pose, camera: &Camera, samples: usize) -> RenderedView {
    if samples <= 1 {
        return render(surfaces, world_from_camera, camera);
    }
    let n = samples as f64;
    let fine = Camera {
        width: camera.width * samples,
        height: camera.height * samples,
        fx: camera.fx * n,
        fy: camera.fy * n,
        cx: (camera.cx + 0.5) * n - 0.5,
        cy: (camera.cy + 0.5) * n - 0.5,
    };
    let seen = render(surfaces, world_from_camera, &fine);
    let mut view = RenderedView {
        rgb: Grid::filled(camera.width, camera.height, [0; 3]),
        depth: Grid::filled(camera.width, camera.height, 0.0),
        owner: Grid::filled(camera.width, camera.height, NOTHING),
    };
    let middle = (samples / 2) * samples + samples / 2;
    for i in 0..camera.width * camera.height {
        let first = (i / camera.width) * samples * fine.width + (i % camera.width) * samples;
        let at = |s: usize| first + (s / samples) * fine.width + s % samples;
        let hits: Vec<usize> = (0..samples * samples)
            .map(|s| at((s + middle) % (samples * samples)))
            .filter(|&k| seen.owner.data[k] != NOTHING)
            .collect();
        let Some(&nearest) = hits.first().filter(|_| 2 * hits.len() >= samples * samples) else { continue };
        let mut sum = [0u32; 3];
        for &k in &hits {
            sum.iter_mut().zip(seen.rgb.data[k]).for_each(|(s, c)| *s += u32::from(c));
        }
        let count = hits.len() as u32;
        view.rgb.data[i] = sum.map(|s| ((s + count / 2) / count) as u8);
        view.depth.data[i] = seen.depth.data[nearest];
        view.owner.data[i] = seen.owner.data[nearest];
    }
    view
}

fn corners(vertices: &[Vector], triangle: &[u32; 3]) -> Option<[Vector; 3]> {
    let [a, b, c] = triangle.map(|v| vertices.get(v as usize).copied());
    Some([a?, b?, c?])
}

/// Whether a triangle (camera frame) turns a side to the camera that is shown, and some of it lies before the camera.
fn shows([a, b, c]: &[Vector; 3], two_sided: bool) -> bool {
    let facing = -a.dot(&(b - a).cross(&(c - a)));
    facing.is_finite() && (facing > 0.0 || (two_sided && facing < 0.0)) && a.z.max(b.z).max(c.z) > NEAR_M
}

impl DepthBuffer {
    /// Draws a triangle, cut off where it comes too near.
    fn draw(&mut self, triangle: &[Vector; 3], hit: [u32; 2]) {
        if triangle.iter().all(|p| p.z >= NEAR_M) {
            return self.fill(triangle, hit);
        }
        let mut kept: Vec<Vector> = Vec::with_capacity(4);
        for (i, from) in triangle.iter().enumerate() {
            let to = &triangle[(i + 1) % 3];
            if from.z >= NEAR_M {
                kept.push(*from);
            }
            if (from.z >= NEAR_M) != (to.z >= NEAR_M) {
                kept.push(from + (to - from) * ((NEAR_M - from.z) / (to.z - from.z)));
            }
        }
        for pair in kept.windows(2).skip(1) {
            self.fill(&[kept[0], pair[0], pair[1]], hit);
        }
    }

    /// Fills the pixels whose middles lie in a triangle before the camera.
    fn fill(&mut self, triangle: &[Vector; 3], hit: [u32; 2]) {
        let Camera { width, height, fx, fy, cx, cy } = self.camera;
        // Column, row, and 1/depth, which is linear in the image.
        let [a, b, c] = triangle.map(|p| [fx * p.x / p.z + cx, fy * p.y / p.z + cy, 1.0 / p.z]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let range = |k: usize, size: usize| {
            let low = a[k].min(b[k]).min(c[k]).ceil().clamp(0.0, size as f64) as usize;
            let high = (a[k].max(b[k]).max(c[k]).floor() + 1.0).clamp(0.0, size as f64) as usize;
            low..high.max(low)
        };
        let share =
            |p: &[f64; 3], q: &[f64; 3], x: f64, y: f64| ((p[0] - x) * (q[1] - y) - (q[0] - x) * (p[1] - y)) / area;
        for row in range(1, height) {
            let y = row as f64;
            for column in range(0, width) {
                let x = column as f64;
                let [u, v, w] = [share(&b, &c, x, y), share(&c, &a, x, y), share(&a, &b, x, y)];
                if u < -ON_EDGE || v < -ON_EDGE || w < -ON_EDGE {
                    continue;
                }
                let inverse = (u * a[2] + v * b[2] + w * c[2]) as f32;
                let i = row * width + column;
                if inverse > self.inverse[i] {
                    self.inverse[i] = inverse;
                    self.hit[i] = hit;
                }
            }
        }
    }
}

/// Shares of a triangle's corners at the point where a ray from the eye meets its plane, moved into the triangle.
fn weights([a, b, c]: &[Vector; 3], ray: &Vector) -> [f64; 3] {
    let normal = (b - a).cross(&(c - a));
    let p = ray * (normal.dot(a) / normal.dot(ray));
    let share = |from: &Vector, to: &Vector| normal.dot(&(to - from).cross(&(p - from))).max(0.0);
    let shares = [share(b, c), share(c, a), share(a, b)];
    let sum: f64 = shares.iter().sum();
    if sum > 0.0 && sum.is_finite() { shares.map(|s| s / sum) } else { [1.0, 0.0, 0.0] }
}

fn color(paint: &Paint, triangle: &[u32; 3], shares: &[f64; 3]) -> [u8; 3] {
    match paint {
        Paint::Plain(color) => *color,
        Paint::Vertices(colors) => {
            let own = triangle.map(|v| colors.get(v as usize).copied().unwrap_or_default());
            std::array::from_fn(|k| {
                (0..3).map(|i| shares[i] * f64::from(own[i][k])).sum::<f64>().round().clamp(0.0, 255.0) as u8
            })
        }
        Paint::Picture { uv, width, height, rgb } => {
            let own = triangle.map(|v| uv.get(v as usize).copied().unwrap_or_default());
            let at = [0, 1].map(|k| (0..3).map(|i| shares[i] * f64::from(own[i][k])).sum::<f64>());
            sample(rgb, [*width, *height], at)
        }
    }
}

/// A picture's colour at a coordinate, linear between the middles of its pixels.
fn sample(rgb: &[u8], size: [usize; 2], at: [f64; 2]) -> [u8; 3] {
    if size.contains(&0) {
        return [0; 3];
    }
    let [x, y] = [0, 1].map(|k| (at[k] * size[k] as f64 - 0.5).clamp(0.0, size[k] as f64 - 1.0));
    let (left, top) = (x as usize, y as usize);
    let [dx, dy] = [x - left as f64, y - top as f64];
    let (right, bottom) = ((left + 1).min(size[0] - 1), (top + 1).min(size[1] - 1));
    let pixel =
        |column: usize, row: usize, k: usize| rgb.get(3 * (row * size[0] + column) + k).map_or(0.0, |c| f64::from(*c));
    std::array::from_fn(|k| {
        let upper = pixel(left, top, k) * (1.0 - dx) + pixel(right, top, k) * dx;
        let lower = pixel(left, bottom, k) * (1.0 - dx) + pixel(right, bottom, k) * dx;
        (upper * (1.0 - dy) + lower * dy).round().clamp(0.0, 255.0) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 8 x 6 pixels; at a depth of 1 m a pixel is 0.1 m wide.
    const CAMERA: Camera = Camera { width: 8, height: 6, fx: 10.0, fy: 10.0, cx: 3.5, cy: 2.5 };

    /// A rectangle across the optical axis, its front towards the camera: from the upper left corner clockwise as it is seen.
    fn rectangle(x: [f64; 2], y: [f64; 2], z: f64, paint: MeshPaint) -> Mesh {
        let positions = vec![
            Point::new(x[0], y[0], z),
            Point::new(x[1], y[0], z),
            Point::new(x[1], y[1], z),
            Point::new(x[0], y[1], z),
        ];
        // Image rows go down: clockwise in the image is counter-clockwise about the way back to the eye.
        Mesh { positions, triangles: vec![[0, 2, 1], [0, 3, 2]], paint, two_sided: false }
    }

    fn seen(meshes: &[Mesh]) -> RenderedView {
        let surfaces: Vec<Surface> = meshes.iter().enumerate().map(|(i, m)| m.surface(i as u16, false)).collect();
        render(&surfaces, &Pose::identity(), &CAMERA)
    }

    #[test]
    fn a_rectangle_covers_just_the_pixels_whose_middles_it_holds() {
        // Columns 2 to 4 and rows 1 to 3 at a depth of 2 m.
        let view = seen(&[rectangle([-0.4, 0.2], [-0.4, 0.2], 2.0, MeshPaint::Plain([9, 8, 7]))]);
        for y in 0..6 {
            for x in 0..8 {
                let inside = (2..=4).contains(&x) && (1..=3).contains(&y);
                let expected = if inside { ([9, 8, 7], 2.0, 0) } else { ([0; 3], 0.0, NOTHING) };
                let i = y * 8 + x;
                assert_eq!((view.rgb.data[i], view.depth.data[i], view.owner.data[i]), expected, "{x} {y}");
            }
        }
    }

    #[test]
    fn what_is_nearer_hides_what_is_behind_and_backs_are_not_seen() {
        let far = rectangle([-2.0, 2.0], [-2.0, 2.0], 3.0, MeshPaint::Plain([1; 3]));
        let near = rectangle([-0.4, 0.2], [-0.4, 0.2], 2.0, MeshPaint::Plain([2; 3]));
        for meshes in [[far.clone(), near.clone()], [near.clone(), far.clone()]] {
            let view = seen(&meshes);
            assert_eq!(view.rgb.data.iter().filter(|c| **c == [2; 3]).count(), 9);
            assert_eq!(view.rgb.data.iter().filter(|c| **c == [1; 3]).count(), 48 - 9);
        }
        let mut turned = near.clone();
        turned.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        assert!(seen(&[turned.clone()]).owner.data.iter().all(|o| *o == NOTHING));
        let both = render(&[turned.surface(5, true)], &Pose::identity(), &CAMERA);
        assert_eq!(both.owner.data.iter().filter(|o| **o == 5).count(), 9);
    }

    #[test]
    fn a_picture_lies_on_its_square_upright_and_unmirrored() {
        let rgb: Vec<u8> = (0..9u8).flat_map(|i| [10 * i, i, 0]).collect();
        let uv = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let map = Arc::new(Bitmap { width: 3, height: 3, rgb });
        // Its pixels are those of the image: columns 2 to 4, rows 1 to 3, the edges between pixels.
        let view = seen(&[rectangle([-0.4, 0.2], [-0.4, 0.2], 2.0, MeshPaint::Picture(uv, map))]);
        for y in 0..3 {
            for x in 0..3 {
                let i = (y * 3 + x) as u8;
                assert_eq!(view.rgb.get(x + 2, y + 1), Some([10 * i, i, 0]), "{x} {y}");
            }
        }
    }

    #[test]
    fn colours_on_a_slanted_floor_are_right_in_perspective() {
        // A floor 0.5 m below the eye from 1 m to 9 m: the colour is the distance.
        let corner = |x: f64, z: f64| Point::new(x, 0.5, z);
        let floor = Mesh {
            positions: vec![corner(-9.0, 1.0), corner(9.0, 1.0), corner(9.0, 9.0), corner(-9.0, 9.0)],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            paint: MeshPaint::Vertices(vec![[20, 0, 0], [20, 0, 0], [180, 0, 0], [180, 0, 0]]),
            two_sided: true,
        };
        let view = render(&[floor.surface(0, true)], &Pose::identity(), &CAMERA);
        // Row 5 is 2.5 pixels below the axis: the ray meets the floor at 0.5 / 0.25 = 2 m.
        assert_eq!(view.rgb.get(3, 5), Some([40, 0, 0]));
        assert!((view.depth.get(3, 5).unwrap() - 2.0).abs() < 1e-6);
        // A floor that begins behind the eye is cut off, not lost.
        let behind = Mesh { positions: floor.positions.iter().map(|p| p - Vector::z() * 5.0).collect(), ..floor };
        let view = render(&[behind.surface(0, true)], &Pose::identity(), &CAMERA);
        assert!((view.depth.get(3, 5).unwrap() - 2.0).abs() < 1e-6);
    }

    #[test]
    fn several_rays_a_pixel_average_what_they_meet() {
        // The edge runs through the middle of column 4: half of its rays meet the left side.
        let left = rectangle([-9.0, 0.1], [-9.0, 9.0], 2.0, MeshPaint::Plain([200; 3]));
        let right = rectangle([0.1, 9.0], [-9.0, 9.0], 2.0, MeshPaint::Plain([100; 3]));
        let surfaces = [left.surface(0, false), right.surface(1, false)];
        let view = render_smooth(&surfaces, &Pose::identity(), &CAMERA, 2);
        let row: Vec<u8> = (0..8).filter_map(|x| view.rgb.get(x, 2)).map(|c| c[0]).collect();
        assert_eq!(row, [200, 200, 200, 200, 150, 100, 100, 100]);
    }
}
