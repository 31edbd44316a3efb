//! From samples to pages: exposures balanced, samples that agree blended, what was not seen filled from what is beside it.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::charts::Chart;
use super::texels::{Texel, TexelSample, TexelTile, name};
use crate::look::Texture;

/// Darker and brighter values than these say nothing about an exposure, 8-bit levels.
const DARK: u8 = 16;
const BRIGHT: u8 = 240;
/// Texels that take part in the balance at the most: a thousandth of all would do.
const BALANCED: usize = 60_000;
/// Pairs that differ by more than this factor, as a logarithm, show two things and not two exposures.
const OTHER: f64 = 0.4;
/// Pull of each frame's gain to 1, as a share of what its pairs weigh: it only fixes what no pair tells.
const PULL: f64 = 2e-3;
/// Largest gain, and the inverse of the least.
const MOST_GAIN: f64 = 2.5;
/// Samples further from the best agreed one than this are of something else (8-bit levels, the largest of the channels).
const SAME: f32 = 28.0;
/// Colour of a recording that shows nothing of what was built.
const GREY: [f32; 3] = [150.0; 3];

/// What a frame's channels are multiplied by.
type Gain = [f32; 3];

/// Colours of the charts on their pages, and of each chart the texels that were seen and all that are covered.
pub(super) fn pages(
    charts: &[Chart],
    tiles: &[TexelTile],
    sizes: &[[u32; 2]],
    frames: usize,
) -> (Vec<Texture>, Vec<[usize; 2]>) {
    let gains = gains(tiles, frames);
    let ranges = ranges(charts, tiles);
    let blended: Vec<ChartPicture> = charts
        .par_iter()
        .zip(&ranges)
        .map(|(chart, range)| ChartPicture::of(chart, tiles.get(range.clone()).unwrap_or_default(), &gains))
        .collect();
    let counts: Vec<[usize; 2]> = blended.iter().map(|p| [p.seen, p.covered]).collect();
    let colours = Colours::of(charts, &blended);
    let painted: Vec<Vec<u8>> = charts
        .par_iter()
        .zip(blended)
        .map(|(chart, picture)| {
            let colour = colours.of_chart(chart);
            picture.filled(colour)
        })
        .collect();
    let mut textures: Vec<Texture> = sizes
        .iter()
        .enumerate()
        .map(|(i, &[width, height])| Texture {
            name: name(i),
            width,
            height,
            rgb: vec![0; 3 * width as usize * height as usize],
        })
        .collect();
    for (chart, rgb) in charts.iter().zip(painted) {
        let Some(page) = textures.get_mut(chart.page) else { continue };
        let row = 3 * chart.size[0] as usize;
        for (y, line) in rgb.chunks_exact(row).enumerate() {
            let start = 3 * ((chart.at[1] as usize + y) * page.width as usize + chart.at[0] as usize);
            page.rgb[start..start + row].copy_from_slice(line);
        }
    }
    (textures, counts)
}

/// The tiles of each chart: they lie in the charts' order.
fn ranges(charts: &[Chart], tiles: &[TexelTile]) -> Vec<Range<usize>> {
    let mut at = 0;
    (0..charts.len())
        .map(|chart| {
            let start = at;
            while tiles.get(at).is_some_and(|t| t.chart == chart) {
                at += 1;
            }
            start..at
        })
        .collect()
}

/// Each frame's gain a channel, by least squares over texels that several frames show: logarithms of what they show, made equal.
fn gains(tiles: &[TexelTile], frames: usize) -> Vec<Gain> {
    let all: usize = tiles.iter().map(|t| t.texels.len()).sum();
    let stride = (all / BALANCED).max(1);
    let chosen: Vec<&Texel> = tiles.iter().flat_map(|t| &t.texels).step_by(stride).collect();
    let logs: Vec<f64> = (0..256).map(|v| f64::from(v.max(1)).ln()).collect();
    let mut gains = vec![[1.0f32; 3]; frames];
    for channel in 0..3 {
        let mut found = vec![0.0f64; frames];
        // What shows two things is only told from two exposures when these are about known.
        for gate in [f64::INFINITY, 2.0 * OTHER, OTHER] {
            let Some(next) = balanced(&chosen, channel, &logs, &found, gate) else { break };
            found = next;
        }
        for (gain, log) in gains.iter_mut().zip(found) {
            gain[channel] = log.exp().clamp(1.0 / MOST_GAIN, MOST_GAIN) as f32;
        }
    }
    gains
}

/// One solution of the balance, of pairs that are nearer than `gate` under the gains so far.
fn balanced(texels: &[&Texel], channel: usize, logs: &[f64], gains: &[f64], gate: f64) -> Option<Vec<f64>> {
    let n = gains.len();
    let mut matrix = DMatrix::<f64>::zeros(n, n);
    let mut rhs = DVector::<f64>::zeros(n);
    let usable = |s: &TexelSample| s.score > 0 && !s.makeshift && (DARK..=BRIGHT).contains(&s.rgb[channel]);
    for texel in texels {
        for (i, a) in texel.samples.iter().enumerate() {
            for b in texel.samples.iter().skip(i + 1).filter(|b| usable(b) && usable(a)) {
                let (p, q) = (usize::from(a.sight), usize::from(b.sight));
                let apart = logs[usize::from(b.rgb[channel])] - logs[usize::from(a.rgb[channel])];
                if p == q || p >= n || q >= n || (gains[p] - gains[q] - apart).abs() > gate {
                    continue;
                }
                // log gain of a, less that of b, is what b shows more.
                matrix[(p, p)] += 1.0;
                matrix[(q, q)] += 1.0;
                matrix[(p, q)] -= 1.0;
                matrix[(q, p)] -= 1.0;
                rhs[p] += apart;
                rhs[q] -= apart;
            }
        }
    }
    for i in 0..n {
        matrix[(i, i)] += PULL * matrix[(i, i)] + 1e-3;
    }
    let solved = matrix.cholesky()?.solve(&rhs);
    solved.iter().all(|g| g.is_finite()).then(|| solved.iter().copied().collect())
}

/// Whether a frame shows the texel itself.
fn is_seen(samples: &[TexelSample]) -> bool {
    samples.iter().any(|s| s.score > 0 && !s.makeshift)
}

/// The colour of a texel: the samples that agree with the one that most of the weight agrees with.
fn blend(samples: &[TexelSample], gains: &[Gain]) -> Option<[f32; 3]> {
    let colour = |s: &TexelSample| -> [f32; 3] {
        let gain = gains.get(usize::from(s.sight)).copied().unwrap_or([1.0; 3]);
        std::array::from_fn(|k| f32::from(s.rgb[k]) * gain[k])
    };
    let is_seen = is_seen(samples);
    let told: Vec<([f32; 3], f32)> = samples
        .iter()
        .filter(|s| s.score > 0 && (!s.makeshift || !is_seen))
        // The score is the root of what a sample is worth.
        .map(|s| (colour(s), (f32::from(s.score) / 65_535.0).powi(2)))
        .collect();
    let apart = |a: &[f32; 3], b: &[f32; 3]| a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
    let cost = |at: &[f32; 3]| told.iter().map(|(c, w)| w * apart(at, c).min(2.0 * SAME)).sum::<f32>();
    let (best, _) = told.iter().map(|(c, _)| (c, cost(c))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut sum = [0.0f32; 4];
    for (c, w) in told.iter().filter(|(c, _)| apart(best, c) <= SAME) {
        for (s, c) in sum.iter_mut().zip(c) {
            *s += w * c;
        }
        sum[3] += w;
    }
    Some([0, 1, 2].map(|k| sum[k] / sum[3]))
}

/// A chart's colours; the fourth number is 1 where a colour is known, else 0.
struct ChartPicture {
    width: usize,
    texels: Vec<[f32; 4]>,
    seen: usize,
    coloured: usize,
    covered: usize,
}

impl ChartPicture {
    fn of(chart: &Chart, tiles: &[TexelTile], gains: &[Gain]) -> Self {
        let [width, height] = chart.size.map(|s| s as usize);
        let mut picture = Self { width, texels: vec![[0.0; 4]; width * height], seen: 0, coloured: 0, covered: 0 };
        for texel in tiles.iter().flat_map(|t| &t.texels) {
            picture.covered += 1;
            let Some([r, g, b]) = blend(&texel.samples, gains) else { continue };
            picture.seen += usize::from(is_seen(&texel.samples));
            picture.coloured += 1;
            if let Some(at) = picture.texels.get_mut(usize::from(texel.at[1]) * width + usize::from(texel.at[0])) {
                *at = [r, g, b, 1.0];
            }
        }
        // A chart that nothing covers is all assumed.
        picture.covered = picture.covered.max(1);
        picture
    }

    /// 8-bit colours with every gap filled: from a coarser and coarser picture of what is known, or with one colour.
    fn filled(mut self, plain: [f32; 3]) -> Vec<u8> {
        if self.coloured == 0 {
            self.texels.iter_mut().for_each(|t| *t = [plain[0], plain[1], plain[2], 1.0]);
        } else {
            fill(&mut self.texels, self.width);
        }
        self.texels.iter().flat_map(|t| [t[0], t[1], t[2]].map(|c| (c + 0.5) as u8)).collect()
    }
}

/// Fills what is not known from the mean of what is known in squares of twice the size, and so on.
fn fill(texels: &mut [[f32; 4]], width: usize) {
    let height = texels.len() / width.max(1);
    if texels.iter().all(|t| t[3] > 0.0) || texels.len() <= 1 {
        return;
    }
    let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
    let mut half = vec![[0.0f32; 4]; half_width * half_height];
    for (i, t) in texels.iter().enumerate().filter(|(_, t)| t[3] > 0.0) {
        let at = &mut half[i / width / 2 * half_width + i % width / 2];
        at.iter_mut().zip([t[0], t[1], t[2], 1.0]).for_each(|(sum, c)| *sum += c);
    }
    for t in half.iter_mut().filter(|t| t[3] > 0.0) {
        let count = t[3];
        t.iter_mut().for_each(|c| *c /= count);
    }
    fill(&mut half, half_width);
    for (i, t) in texels.iter_mut().enumerate().filter(|(_, t)| t[3] == 0.0) {
        *t = between(&half, [half_width, half_height], [i % width, i / width]);
    }
}

/// A pixel of a picture of half the size, mixed from the four nearest.
fn between(half: &[[f32; 4]], [width, height]: [usize; 2], at: [usize; 2]) -> [f32; 4] {
    let along = |c: usize, size: usize| {
        let middle = c / 2;
        let other = if c.is_multiple_of(2) { middle.saturating_sub(1) } else { (middle + 1).min(size - 1) };
        [middle, other]
    };
    let (xs, ys) = (along(at[0], width), along(at[1], height));
    let mut sum = [0.0f32; 4];
    for (y, wy) in ys.into_iter().zip([0.75, 0.25]) {
        for (x, wx) in xs.into_iter().zip([0.75, 0.25]) {
            sum.iter_mut().zip(half[y * width + x]).for_each(|(s, c)| *s += wx * wy * c);
        }
    }
    sum[3] = 1.0;
    sum
}

/// What stands for colours that nobody saw: the median of what was seen of a part, and of everything.
struct Colours {
    parts: Vec<Option<[f32; 3]>>,
    all: [f32; 3],
}

impl Colours {
    fn of(charts: &[Chart], pictures: &[ChartPicture]) -> Self {
        let parts = charts.iter().filter_map(|c| c.owner.max(c.assumed)).max().map_or(0, |most| most + 1);
        let of = |wanted: &dyn Fn(&Chart) -> bool| {
            let own = charts.iter().zip(pictures).filter(|&(c, _)| wanted(c)).map(|(_, p)| p);
            median(own)
        };
        Self {
            parts: (0..parts).map(|part| of(&|c: &Chart| c.owner == Some(part))).collect(),
            all: of(&|_: &Chart| true).unwrap_or(GREY),
        }
    }

    fn of_chart(&self, chart: &Chart) -> [f32; 3] {
        let part = chart.owner.or(chart.assumed);
        let colour = part.and_then(|p| self.parts.get(p).copied().flatten()).unwrap_or(self.all);
        // What nobody saw inside furniture has its front's colour in the shade.
        if chart.assumed.is_some() { colour.map(|c| 0.7 * c) } else { colour }
    }
}

/// The median of each channel over what is known of pictures; `None` where nothing is.
fn median<'a>(pictures: impl Iterator<Item = &'a ChartPicture>) -> Option<[f32; 3]> {
    let mut counts = vec![[0u64; 3]; 256];
    let mut all = 0u64;
    for t in pictures.flat_map(|p| &p.texels).filter(|t| t[3] > 0.0) {
        for (k, value) in t.iter().take(3).enumerate() {
            counts[value.round().clamp(0.0, 255.0) as usize][k] += 1;
        }
        all += 1;
    }
    let of = |k: usize| {
        let mut below = 0;
        let at = counts.iter().position(|c| {
            below += c[k];
            2 * below >= all
        });
        at.unwrap_or(0) as f32
    };
    (all > 0).then(|| [of(0), of(1), of(2)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(sight: u16, level: u8, score: u16) -> TexelSample {
        TexelSample { score, sight, rgb: [level; 3], makeshift: false }
    }

    #[test]
    fn the_odd_one_out_does_not_colour_a_texel() {
        let gains = vec![[1.0; 3]; 4];
        let samples = [sample(0, 100, 20_000), sample(1, 104, 20_000), sample(2, 250, 21_000), sample(3, 0, 0)];
        let [r, _, b] = blend(&samples, &gains).unwrap();
        assert!((101.9..102.1).contains(&r) && r == b, "{r}");
        assert_eq!(blend(&[TexelSample::default(); 4], &gains), None);
    }

    #[test]
    fn what_may_hide_a_texel_colours_it_where_nothing_else_does() {
        let gains = vec![[1.0; 3]; 4];
        let hidden = |level: u8| TexelSample { makeshift: true, ..sample(1, level, 60_000) };
        let both = [hidden(200), sample(0, 100, 10), TexelSample::default(), TexelSample::default()];
        let colour = |samples: &[TexelSample]| blend(samples, &gains).map(|rgb| rgb.map(f32::round));
        assert_eq!(colour(&both), Some([100.0; 3]));
        assert!(is_seen(&both) && both[1].rank() > both[0].rank() && both[0].rank() > both[2].rank());
        let alone = [hidden(200), hidden(200), TexelSample::default(), TexelSample::default()];
        assert_eq!(colour(&alone), Some([200.0; 3]));
        assert!(!is_seen(&alone));
    }

    #[test]
    fn gaps_are_filled_smoothly_and_what_is_known_stays() {
        let mut texels = vec![[0.0f32; 4]; 64];
        for y in 0..8 {
            texels[8 * y] = [100.0, 50.0, 0.0, 1.0];
            texels[8 * y + 7] = [200.0, 50.0, 0.0, 1.0];
        }
        fill(&mut texels, 8);
        assert_eq!((texels[0][0], texels[7][0]), (100.0, 200.0));
        assert!(texels.iter().all(|t| (100.0..=200.0).contains(&t[0]) && t[1] == 50.0 && t[3] == 1.0));
        assert!(texels[8 * 4 + 2][0] < texels[8 * 4 + 5][0]);
    }
}
