//! A detector of straight segments: regions of like gradient, grown from the steepest pixels (the idea of LSD, von Gioi et
//! al., IPOL 2012), on an image that is smoothed as much as its noise asks for.

use super::segment2::Segment2;
use crate::config;
use crate::recording::Grid;

/// Definition (LSD): directions within this of each other belong together (LSD's 22.5 degrees), as a cosine.
const COS_TOLERANCE: f32 = 0.923_88;
/// Definition: the same for the second attempt on a region that is not straight.
const COS_TIGHT: f32 = 0.980_79;
/// Arithmetic: probability that a direction agrees by chance: 22.5 of 180 degrees.
const CHANCE: f64 = 0.125;
/// Definition (LSD): a rectangle less filled than this is no segment.
const DENSITY: f64 = 0.7;
/// Format: fractional bits of the smoothed image.
const BITS: u32 = 5;

/// Standard deviation of an image's pixel noise, grey values: from second differences along every eighth row. Edges are
/// rare, so their median absolute value is the noise's.
#[must_use]
pub fn noise_std(image: &Grid<u8>) -> f64 {
    let mut histogram = [0usize; 512];
    let mut total = 0;
    for row in image.data.chunks_exact(image.width.max(1)).step_by(8) {
        for w in row.windows(3) {
            let d = 2 * i32::from(w[1]) - i32::from(w[0]) - i32::from(w[2]);
            histogram[d.unsigned_abs().min(511) as usize] += 1;
            total += 1;
        }
    }
    let (mut below, mut median) = (0, 0.0);
    for (value, count) in histogram.iter().enumerate() {
        if 2 * (below + count) >= total && *count > 0 {
            // Within the bin by interpolation: low noise is less than a grey value.
            median = value as f64 - 0.5 + (0.5 * total as f64 - below as f64) / *count as f64;
            break;
        }
        below += count;
    }
    // 2 b - a - c has sqrt(6) times the noise; the median absolute value of a normal variable is 0.6745 of its spread.
    (median.max(0.0) / 0.6745 / 6f64.sqrt()).min(40.0)
}

/// Smoothing for a noise level, pixels: the gradient's noise falls with its square, a thin line's gradient too but slower.
/// `least_gradient` in grey values a pixel.
fn smoothing(noise: f64, least_gradient: f64) -> f64 {
    // Standard deviation of the gradient of Gaussian-smoothed white noise: noise / (sqrt(8 pi) sigma^2). It is brought
    // to a third of the least gradient; at least to what hides the steps of a slanted edge, at most to what keeps
    // neighbouring edges apart.
    (noise / (8.0 * std::f64::consts::PI).sqrt() / (least_gradient / 3.0)).sqrt().clamp(1.0, 2.0)
}

/// Segments at least `min_length` pixels long; integer coordinates are pixel centres.
#[must_use]
pub fn detect(image: &Grid<u8>, min_length: f64, rules: &config::EdgeDetector) -> Vec<Segment2> {
    if image.width < 8 || image.height < 8 {
        return Vec::new();
    }
    let noise = noise_std(image);
    let sigma = smoothing(noise, rules.least_gradient);
    let field = Field::new(image, sigma, noise, rules);
    field.segments(min_length, sigma)
}

/// Gaussian kernel in integers that sum to 256, from the middle outwards.
fn kernel(sigma: f64) -> Vec<u16> {
    let radius = (2.5 * sigma).ceil() as usize;
    let raw: Vec<f64> = (0..=radius).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let sum = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
    let mut taps: Vec<u16> = raw.iter().map(|v| (v / sum * 256.0).round() as u16).collect();
    let rest: u16 = taps[1..].iter().sum();
    taps[0] = 256 - 2 * rest;
    taps
}

/// Smoothed image with [`BITS`] fractional bits.
fn smooth(image: &Grid<u8>, sigma: f64) -> Vec<u16> {
    let (w, h) = (image.width, image.height);
    let taps = kernel(sigma);
    let radius = taps.len() - 1;
    let mut across = vec![0u16; w * h];
    let mut padded = vec![0u16; w + 2 * radius];
    let mut sums = vec![0u32; w];
    for y in 0..h {
        let row = &image.data[y * w..(y + 1) * w];
        padded[..radius].fill(u16::from(row[0]));
        padded[radius + w..].fill(u16::from(row[w - 1]));
        for (p, v) in padded[radius..radius + w].iter_mut().zip(row) {
            *p = u16::from(*v);
        }
        // 255 * 256 fits sixteen bits: the whole row works in them.
        let out = &mut across[y * w..(y + 1) * w];
        for (o, v) in out.iter_mut().zip(&padded[radius..]) {
            *o = taps[0] * *v;
        }
        for (k, tap) in taps.iter().enumerate().skip(1) {
            let (left, right) = (&padded[radius - k..radius - k + w], &padded[radius + k..radius + k + w]);
            for ((o, l), r) in out.iter_mut().zip(left).zip(right) {
                *o += *tap * (*l + *r);
            }
        }
    }
    let mut out = vec![0u16; w * h];
    for y in 0..h {
        let line = |i: usize| &across[i * w..(i + 1) * w];
        for (s, v) in sums.iter_mut().zip(line(y)) {
            *s = u32::from(taps[0]) * u32::from(*v);
        }
        for (k, tap) in taps.iter().enumerate().skip(1) {
            let (above, below) = (line(y.saturating_sub(k)), line((y + k).min(h - 1)));
            for ((s, a), b) in sums.iter_mut().zip(above).zip(below) {
                *s += u32::from(*tap) * (u32::from(*a) + u32::from(*b));
            }
        }
        for (o, s) in out[y * w..(y + 1) * w].iter_mut().zip(&sums) {
            *o = (*s >> (16 - BITS)) as u16;
        }
    }
    out
}

/// Gradients of a smoothed image and the pixels that are steep enough to start or join a segment.
struct Field {
    width: usize,
    height: usize,
    /// Gradient, twice the grey value a pixel with [`BITS`] fractional bits; zero where it is too small.
    gx: Vec<i16>,
    gy: Vec<i16>,
    /// Steep pixels, steepest first.
    order: Vec<u32>,
    /// Share of its steepest gradient above which a pixel belongs to a region.
    foot: f32,
}

impl Field {
    fn new(image: &Grid<u8>, sigma: f64, noise: f64, rules: &config::EdgeDetector) -> Self {
        let (w, h) = (image.width, image.height);
        let smoothed = smooth(image, sigma);
        let gradient_noise = noise / (8.0 * std::f64::consts::PI).sqrt() / (sigma * sigma);
        let least = rules.least_gradient.max(rules.noise_stds * gradient_noise) * 2.0 * f64::from(1 << BITS);
        let least2 = (least * least) as i32;
        let foot = rules.foot_share as f32;
        let mut field = Self { width: w, height: h, gx: vec![0; w * h], gy: vec![0; w * h], order: Vec::new(), foot };
        let mut steep: Vec<(u32, i32)> = Vec::with_capacity(w * h / 8);
        let mut size2 = vec![0i32; w];
        for y in 1..h - 1 {
            let (above, row, below) =
                (&smoothed[(y - 1) * w..y * w], &smoothed[y * w..(y + 1) * w], &smoothed[(y + 1) * w..(y + 2) * w]);
            let gx = &mut field.gx[y * w..(y + 1) * w];
            let gy = &mut field.gy[y * w..(y + 1) * w];
            for ((g, r), l) in gx[1..w - 1].iter_mut().zip(&row[2..]).zip(&row[..w - 2]) {
                *g = (*r as i16).wrapping_sub(*l as i16);
            }
            for ((g, b), a) in gy[1..w - 1].iter_mut().zip(&below[1..w - 1]).zip(&above[1..w - 1]) {
                *g = (*b as i16).wrapping_sub(*a as i16);
            }
            for ((s, x), v) in size2.iter_mut().zip(gx.iter()).zip(gy.iter()) {
                *s = i32::from(*x) * i32::from(*x) + i32::from(*v) * i32::from(*v);
            }
            for (x, s) in size2.iter().enumerate() {
                if *s >= least2 {
                    steep.push(((y * w + x) as u32, *s));
                } else {
                    gx[x] = 0;
                    gy[x] = 0;
                }
            }
        }
        field.order = steepest_first(&steep);
        field
    }

    fn vector(&self, i: usize) -> [f32; 2] {
        [f32::from(self.gx[i]), f32::from(self.gy[i])]
    }

    fn segments(&self, min_length: f64, sigma: f64) -> Vec<Segment2> {
        let log_tests = 2.5 * (self.width as f64 * self.height as f64).ln();
        let mut used = vec![false; self.gx.len()];
        let mut region: Vec<u32> = Vec::new();
        let mut out = Vec::new();
        for &seed in &self.order {
            if used[seed as usize] {
                continue;
            }
            self.grow(seed, COS_TOLERANCE, &mut used, &mut region);
            // Half as many pixels as the length cannot fill its rectangle.
            if (region.len() as f64) < 0.7 * min_length {
                continue;
            }
            let Some(mut fitted) = self.rectangle(&region) else { continue };
            if fitted.density(&region) < DENSITY {
                for &i in &region {
                    used[i as usize] = false;
                }
                self.grow(seed, COS_TIGHT, &mut used, &mut region);
                let Some(tight) = self.straightened(seed, &mut region, &mut used, min_length) else { continue };
                fitted = tight;
            }
            if fitted.length() >= min_length && fitted.is_meaningful(region.len(), log_tests, sigma) {
                out.push(fitted.segment());
            }
        }
        out
    }

    /// Fills `region` with the connected pixels whose gradients agree with the region's mean one.
    fn grow(&self, seed: u32, cosine: f32, used: &mut [bool], region: &mut Vec<u32>) {
        region.clear();
        region.push(seed);
        used[seed as usize] = true;
        let [mut sx, mut sy] = self.vector(seed as usize);
        let limit = cosine * cosine;
        let floor = self.foot * self.foot * (sx * sx + sy * sy);
        let mut next = 0;
        while next < region.len() {
            let i = region[next] as usize;
            next += 1;
            // The rim holds no gradients, so all eight neighbours of a steep pixel exist.
            for base in [i - self.width, i, i + self.width] {
                for j in [base - 1, base, base + 1] {
                    if used[j] {
                        continue;
                    }
                    let [x, y] = self.vector(j);
                    let size = x * x + y * y;
                    let dot = x * sx + y * sy;
                    if dot > 0.0 && dot * dot >= limit * size * (sx * sx + sy * sy) {
                        used[j] = true;
                        if size >= floor {
                            region.push(j as u32);
                            sx += x;
                            sy += y;
                        }
                    }
                }
            }
        }
    }

    /// Cuts a region to the piece around its seed that fills a rectangle; frees what is cut off.
    fn straightened(&self, seed: u32, region: &mut Vec<u32>, used: &mut [bool], min_length: f64) -> Option<Rectangle> {
        let at = |i: u32| [(i as usize % self.width) as f64, (i as usize / self.width) as f64];
        let from = at(seed);
        loop {
            if (region.len() as f64) < 0.7 * min_length {
                return None;
            }
            let fitted = self.rectangle(region)?;
            if fitted.density(region) >= DENSITY {
                return Some(fitted);
            }
            let reach2 = |i: u32| (at(i)[0] - from[0]).powi(2) + (at(i)[1] - from[1]).powi(2);
            let far = region.iter().map(|&i| reach2(i)).fold(0.0, f64::max);
            // Three quarters of the radius, as LSD does.
            let limit = 0.5625 * far;
            region.retain(|&i| {
                let keep = reach2(i) <= limit;
                used[i as usize] = keep;
                keep
            });
        }
    }

    /// The rectangle about a region's gradient-weighted axis.
    fn rectangle(&self, region: &[u32]) -> Option<Rectangle> {
        let (mut weight, mut mx, mut my) = (0.0f64, 0.0f64, 0.0f64);
        let (mut xx, mut xy, mut yy) = (0.0f64, 0.0f64, 0.0f64);
        let first = region.first()?;
        let (ox, oy) = ((*first as usize % self.width) as f64, (*first as usize / self.width) as f64);
        let (mut gx, mut gy) = (0.0f64, 0.0f64);
        for &i in region {
            let [vx, vy] = self.vector(i as usize);
            let w = f64::from((vx * vx + vy * vy).sqrt());
            let (x, y) = ((i as usize % self.width) as f64 - ox, (i as usize / self.width) as f64 - oy);
            weight += w;
            mx += w * x;
            my += w * y;
            xx += w * x * x;
            xy += w * x * y;
            yy += w * y * y;
            gx += f64::from(vx);
            gy += f64::from(vy);
        }
        if weight <= 0.0 {
            return None;
        }
        let (cx, cy) = (mx / weight, my / weight);
        let (a, b, c) = (xx / weight - cx * cx, xy / weight - cx * cy, yy / weight - cy * cy);
        let angle = 0.5 * (2.0 * b).atan2(a - c);
        let mut along = [angle.cos(), angle.sin()];
        // The axis of a region a few pixels long may lie across its edge: the gradients know better.
        let norm = gx.hypot(gy);
        if norm > 0.0 && (along[0] * gx + along[1] * gy).abs() / norm > 0.5 {
            along = [-gy / norm, gx / norm];
        }
        let (mut low, mut high, mut left, mut right) = (f64::MAX, f64::MIN, f64::MAX, f64::MIN);
        for &i in region {
            let (x, y) = ((i as usize % self.width) as f64 - ox - cx, (i as usize / self.width) as f64 - oy - cy);
            let (l, w) = (x * along[0] + y * along[1], y * along[0] - x * along[1]);
            low = low.min(l);
            high = high.max(l);
            left = left.min(w);
            right = right.max(w);
        }
        Some(Rectangle { center: [ox + cx, oy + cy], along, span: [low, high], width: (right - left).max(1.0) })
    }
}

/// Pixels by falling gradient, by a counting sort into 1024 classes; within a class in image order.
fn steepest_first(steep: &[(u32, i32)]) -> Vec<u32> {
    /// Numerics.
    const CLASSES: usize = 1024;
    let top = steep.iter().map(|(_, s)| *s).max().unwrap_or(1).max(1) as f32;
    let scale = (CLASSES - 1) as f32 / top.sqrt();
    let class = |s: i32| CLASSES - 1 - ((s as f32).sqrt() * scale) as usize;
    let mut starts = [0u32; CLASSES + 1];
    for (_, s) in steep {
        starts[class(*s) + 1] += 1;
    }
    for i in 0..CLASSES {
        starts[i + 1] += starts[i];
    }
    let mut order = vec![0u32; steep.len()];
    for (i, s) in steep {
        let at = &mut starts[class(*s)];
        order[*at as usize] = *i;
        *at += 1;
    }
    order
}

/// A region's straight hull.
struct Rectangle {
    center: [f64; 2],
    along: [f64; 2],
    span: [f64; 2],
    width: f64,
}

impl Rectangle {
    fn length(&self) -> f64 {
        self.span[1] - self.span[0] + 1.0
    }

    fn density(&self, region: &[u32]) -> f64 {
        region.len() as f64 / (self.length() * self.width)
    }

    /// Whether so many agreeing pixels would not be found anywhere in an image of noise: the number of false alarms is
    /// below one. The binomial tail is bounded by Chernoff's inequality; smoothed neighbours are not independent.
    fn is_meaningful(&self, count: usize, log_tests: f64, sigma: f64) -> bool {
        let area = self.length() * self.width;
        let share = (count as f64 / area).clamp(CHANCE, 1.0 - 1e-9);
        let divergence = share * (share / CHANCE).ln() + (1.0 - share) * ((1.0 - share) / (1.0 - CHANCE)).ln();
        let independent = area / (sigma * sigma).max(1.0);
        log_tests - independent * divergence < 0.0
    }

    fn segment(&self) -> Segment2 {
        let at = |t: f64| [self.center[0] + self.along[0] * t, self.center[1] + self.along[1] * t];
        Segment2 { a: at(self.span[0]), b: at(self.span[1]) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    /// A dark half-plane with an edge through (50, 40) at an angle, anti-aliased, and noise on top.
    fn edge(angle: f64, noise: f64) -> Grid<u8> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(3);
        let normal = Normal::new(0.0, noise.max(1e-9)).unwrap();
        let mut image = Grid::filled(120, 100, 0u8);
        for y in 0..100 {
            for x in 0..120 {
                let d = (x as f64 - 50.0) * angle.sin() - (y as f64 - 40.0) * angle.cos();
                let value = 90.0 + 50.0 * (d + 0.5).clamp(0.0, 1.0) + normal.sample(&mut rng);
                image.data[y * 120 + x] = value.round().clamp(0.0, 255.0) as u8;
            }
        }
        image
    }

    #[test]
    fn an_edge_is_found_to_a_tenth_of_a_pixel_at_any_angle_and_to_a_third_in_noise() {
        for (noise, limit) in [(0.0, 0.1), (6.0, 0.33)] {
            for degrees in [3.0, 27.0, 45.0, 71.0, 90.0, 133.0] {
                let angle = f64::to_radians(degrees);
                let found = detect(&edge(angle, noise), 30.0, &config::EdgeDetector::default());
                let best = found.iter().max_by(|a, b| a.length().total_cmp(&b.length())).unwrap();
                let middle = [0, 1].map(|k| 0.5 * (best.a[k] + best.b[k]));
                // The edge is where the value is half-way: at d = 0 of the clamped ramp.
                let off = ((middle[0] - 50.0) * angle.sin() - (middle[1] - 40.0) * angle.cos()).abs();
                assert!(off < limit, "{degrees} deg, noise {noise}: {off}");
                let turn = ((best.b[1] - best.a[1]).atan2(best.b[0] - best.a[0]) - angle).sin().abs();
                assert!(turn < 0.02 && best.length() > 60.0, "{degrees}: {turn} {}", best.length());
            }
        }
    }

    #[test]
    fn noise_is_measured_and_holds_no_segments() {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(9);
        for std in [1.0, 4.0, 10.0] {
            let normal = Normal::new(120.0, std).unwrap();
            let data = (0..320 * 240).map(|_| f64::clamp(normal.sample(&mut rng), 0.0, 255.0).round() as u8).collect();
            let image = Grid { width: 320, height: 240, data };
            let measured = noise_std(&image);
            assert!((measured - std).abs() < 0.2 * std + 0.2, "{std}: {measured}");
            let found = detect(&image, 12.0, &config::EdgeDetector::default());
            assert!(found.len() <= 1, "{std}: {found:?}");
        }
    }

    #[test]
    fn a_tiny_or_empty_image_has_no_segments() {
        let rules = config::EdgeDetector::default();
        assert!(detect(&Grid::filled(3, 3, 9u8), 5.0, &rules).is_empty());
        assert!(detect(&Grid::filled(64, 64, 9u8), 5.0, &rules).is_empty());
    }
}
