//! How alike two pictures are: peak signal-to-noise ratio and structural similarity, over the pixels that can be compared.

use crate::recording::Grid;

/// Two pictures that agree to the last bit have this ratio, dB: an infinite one fits no table.
const HIGHEST_DB: f64 = 99.0;
/// Of structural similarity (Wang et al. 2004): side and standard deviation of its Gaussian window, pixels.
const WINDOW: usize = 11;
const SIGMA_PX: f64 = 1.5;
/// And what keeps its quotients finite: (0.01 * 255)^2, (0.03 * 255)^2.
const C1: f64 = 6.5025;
const C2: f64 = 58.5225;
/// A window needs this share of its weight on pixels that count: in the corner of a picture it has two fifths.
const LEAST_WEIGHT: f64 = 0.25;

/// A colour picture, sRGB.
pub type ColorImage = Grid<[u8; 3]>;

/// Peak signal-to-noise ratio in dB over all three channels of the pixels that count, at most 99; `None` without any.
#[must_use]
pub fn psnr(a: &ColorImage, b: &ColorImage, counts: &Grid<bool>) -> Option<f64> {
    psnr_of(a, b, counts, [1.0; 3])
}

/// The same after each channel of `b` was multiplied by the factor that fits `a` best: cameras change exposure and white
/// balance from frame to frame, a model has one.
#[must_use]
pub fn psnr_fitted(a: &ColorImage, b: &ColorImage, counts: &Grid<bool>) -> Option<f64> {
    let mut sums = [[0.0f64; 2]; 3];
    for (a, b) in pairs(a, b, counts) {
        for (k, [ab, bb]) in sums.iter_mut().enumerate() {
            *ab += f64::from(a[k]) * f64::from(b[k]);
            *bb += f64::from(b[k]).powi(2);
        }
    }
    psnr_of(a, b, counts, sums.map(|[ab, bb]| if bb > 0.0 { ab / bb } else { 1.0 }))
}

fn psnr_of(a: &ColorImage, b: &ColorImage, counts: &Grid<bool>, factors: [f64; 3]) -> Option<f64> {
    let (mut sum, mut count) = (0.0f64, 0usize);
    for (a, b) in pairs(a, b, counts) {
        for k in 0..3 {
            sum += (f64::from(a[k]) - (f64::from(b[k]) * factors[k]).min(255.0)).powi(2);
        }
        count += 3;
    }
    let mean = sum / count.max(1) as f64;
    (count > 0)
        .then(|| if mean > 0.0 { (10.0 * (255.0f64.powi(2) / mean).log10()).min(HIGHEST_DB) } else { HIGHEST_DB })
}

fn pairs<'a>(
    a: &'a ColorImage,
    b: &'a ColorImage,
    counts: &'a Grid<bool>,
) -> impl Iterator<Item = (&'a [u8; 3], &'a [u8; 3])> {
    a.data.iter().zip(&b.data).zip(&counts.data).filter(|(_, counts)| **counts).map(|(pair, _)| pair)
}

/// Structural similarity of luma (BT.601) at each pixel that counts: Gaussian windows of 11 x 11 pixels with a standard deviation
/// of 1.5, means, variances and covariance over those of their pixels that count. Not a number where a pixel does not, or
/// less than a quarter of it.
#[must_use]
pub fn ssim_map(a: &ColorImage, b: &ColorImage, counts: &Grid<bool>) -> Grid<f32> {
    let weight: Vec<f64> = counts.data.iter().map(|c| f64::from(u8::from(*c))).collect();
    let luma = |image: &ColorImage| -> Vec<f64> {
        let of = |[r, g, b]: &[u8; 3]| 0.299 * f64::from(*r) + 0.587 * f64::from(*g) + 0.114 * f64::from(*b);
        image.data.iter().zip(&weight).map(|(p, w)| w * of(p)).collect()
    };
    let (x, y) = (luma(a), luma(b));
    let product = |p: &[f64], q: &[f64]| -> Vec<f64> { p.iter().zip(q).map(|(p, q)| p * q).collect() };
    let smooth = |values: &[f64]| blurred(values, a.width, a.height);
    let w = smooth(&weight);
    let [mx, my] = [smooth(&x), smooth(&y)];
    let [xx, yy, xy] = [smooth(&product(&x, &x)), smooth(&product(&y, &y)), smooth(&product(&x, &y))];
    let at = |i: usize| {
        if !counts.data[i] || w[i] < LEAST_WEIGHT {
            return f32::NAN;
        }
        let (mx, my) = (mx[i] / w[i], my[i] / w[i]);
        let vx = (xx[i] / w[i] - mx * mx).max(0.0);
        let vy = (yy[i] / w[i] - my * my).max(0.0);
        let both = xy[i] / w[i] - mx * my;
        let alike = (2.0 * mx * my + C1) * (2.0 * both + C2) / ((mx * mx + my * my + C1) * (vx + vy + C2));
        alike as f32
    };
    Grid { width: a.width, height: a.height, data: (0..a.width * a.height).map(at).collect() }
}

/// Mean of a map over the pixels that count; `None` where it has a number at none of them.
#[must_use]
pub fn mean_over(map: &Grid<f32>, counts: &Grid<bool>) -> Option<f64> {
    let (mut sum, mut count) = (0.0f64, 0usize);
    for (value, _) in map.data.iter().zip(&counts.data).filter(|(value, counts)| **counts && !value.is_nan()) {
        sum += f64::from(*value);
        count += 1;
    }
    (count > 0).then(|| sum / count as f64)
}

/// A picture under the Gaussian window, whose weights make 1; beyond the rim all is 0.
fn blurred(values: &[f64], width: usize, height: usize) -> Vec<f64> {
    let reach = WINDOW / 2;
    let raw: [f64; WINDOW] = std::array::from_fn(|i| (-0.5 * ((i as f64 - reach as f64) / SIGMA_PX).powi(2)).exp());
    let total: f64 = raw.iter().sum();
    let weights = raw.map(|w| w / total);
    let along = |from: &[f64], is_row: bool| -> Vec<f64> {
        let (size, stride) = if is_row { (width, 1) } else { (height, width) };
        (0..width * height)
            .map(|i| {
                let at = if is_row { i % width } else { i / width };
                let (first, last) = (reach.saturating_sub(at), WINDOW.min(size + reach - at));
                // The window's element `k` lies `k - reach` places on.
                (first..last).map(|k| weights[k] * from[i + k * stride - reach * stride]).sum()
            })
            .collect()
    };
    along(&along(values, true), false)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(of: impl Fn(usize, usize) -> [u8; 3]) -> ColorImage {
        Grid { width: 24, height: 20, data: (0..480).map(|i| of(i % 24, i / 24)).collect() }
    }

    fn all(on: bool) -> Grid<bool> {
        Grid::filled(24, 20, on)
    }

    #[test]
    fn the_ratio_is_that_of_hand_computed_errors() {
        let a = image(|_, _| [100; 3]);
        // Off by 10 in all channels: 20 log10(255 / 10).
        let b = image(|_, _| [110; 3]);
        assert!((psnr(&a, &b, &all(true)).unwrap() - 28.1308).abs() < 1e-4);
        // Off by 12 in one channel of three: the mean square is 48.
        let c = image(|_, _| [112, 100, 100]);
        assert!((psnr(&a, &c, &all(true)).unwrap() - 31.3184).abs() < 1e-4);
        assert_eq!(psnr(&a, &a, &all(true)), Some(99.0));
        assert_eq!(psnr(&a, &b, &all(false)), None);
    }

    #[test]
    fn a_factor_takes_exposure_out_and_nothing_else() {
        let a = image(|x, y| [(4 * x) as u8, (5 * y) as u8, 80]);
        let b = image(|x, y| [(8 * x) as u8, (10 * y) as u8, 160]);
        assert!(psnr(&a, &b, &all(true)).unwrap() < 20.0);
        assert_eq!(psnr_fitted(&a, &b, &all(true)), Some(99.0));
        let mirrored = image(|x, y| [(4 * (23 - x)) as u8, (5 * y) as u8, 80]);
        assert!(psnr_fitted(&a, &mirrored, &all(true)).unwrap() < 20.0);
    }

    #[test]
    fn similarity_of_flat_pictures_is_that_of_their_means() {
        let (a, b) = (image(|_, _| [100; 3]), image(|_, _| [150; 3]));
        let map = ssim_map(&a, &b, &all(true));
        // (2 * 100 * 150 + C1) / (100^2 + 150^2 + C1), at the rim as within.
        let expected = (30_000.0 + 6.5025) / (32_500.0 + 6.5025);
        for at in [0, 250, 479] {
            assert!((f64::from(map.data[at]) - expected).abs() < 1e-5, "{}", map.data[at]);
        }
        assert!((mean_over(&map, &all(true)).unwrap() - expected).abs() < 1e-5);
        assert_eq!(mean_over(&map, &all(false)), None);
    }

    #[test]
    fn similarity_of_stripes_is_that_of_their_moments() {
        // Stripes of a column and their opposite: means m, variances v and covariance -v under the window.
        let stripes = |odd: u8, even: u8| image(move |x, _| [if x % 2 == 1 { odd } else { even }; 3]);
        let (a, b) = (stripes(140, 60), stripes(60, 140));
        let map = ssim_map(&a, &b, &all(true));
        let weight = |d: i32| (-0.5 * (f64::from(d) / 1.5).powi(2)).exp();
        let share: f64 = (-5..=5).filter(|d| d % 2 == 0).map(weight).sum::<f64>() / (-5..=5).map(weight).sum::<f64>();
        // At an even column: `share` of the weight on even ones.
        let mean = |even: f64, odd: f64| share * even + (1.0 - share) * odd;
        let (mx, my) = (mean(60.0, 140.0), mean(140.0, 60.0));
        let v = share * (1.0 - share) * 80.0 * 80.0;
        let expected =
            (2.0 * mx * my + 6.5025) * (-2.0 * v + 58.5225) / ((mx * mx + my * my + 6.5025) * (2.0 * v + 58.5225));
        let found = map.get(10, 10).unwrap();
        assert!((f64::from(found) - expected).abs() < 1e-4, "{found} {expected}");
    }

    #[test]
    fn what_does_not_count_changes_nothing() {
        let a = image(|x, y| [(7 * x + y) as u8; 3]);
        let b = image(|x, y| [(7 * x + y + 3) as u8; 3]);
        let spoiled = image(|x, y| if x < 8 { [255, 0, 255] } else { b.data[y * 24 + x] });
        let counts = Grid { width: 24, height: 20, data: (0..480).map(|i| i % 24 >= 8).collect() };
        assert_eq!(psnr(&a, &b, &counts), psnr(&a, &spoiled, &counts));
        let [one, two] = [&b, &spoiled].map(|other| mean_over(&ssim_map(&a, other, &counts), &counts));
        assert_eq!(one, two);
        assert!(ssim_map(&a, &b, &counts).get(3, 3).unwrap().is_nan());
    }
}
