//! The pictures that a model sees: frames, and frames with numbered lines on them ("set of marks", §3.3, §A.6).

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::error::{Error, Result};
use crate::math::segment_distance;
use crate::recording::Grid;
use crate::vlm::EncodedPicture;

/// A colour image.
pub type Image = Grid<[u8; 3]>;

/// A line to draw, pixels (u, v); integer coordinates are pixel centres. Its number is its place in the list, from 1.
pub type Mark = [[f64; 2]; 2];

/// Format: colour of lines.
const YELLOW: [u8; 3] = [255, 214, 0];
/// Format: colour of numbers.
const WHITE: [u8; 3] = [255; 3];
/// Format: colour around lines and numbers, so that they stand out from white furniture too.
const DARK: [u8; 3] = [20, 20, 20];

/// Format: digits of 5 x 7 cells, a row a byte.
const DIGITS: [[u8; 7]; 10] = [
    [0b01110, 0b10001, 0b10011, 0b10101, 0b11001, 0b10001, 0b01110],
    [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
    [0b01110, 0b10001, 0b00001, 0b00010, 0b00100, 0b01000, 0b11111],
    [0b11111, 0b00010, 0b00100, 0b00010, 0b00001, 0b10001, 0b01110],
    [0b00010, 0b00110, 0b01010, 0b10010, 0b11111, 0b00010, 0b00010],
    [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
    [0b00110, 0b01000, 0b10000, 0b11110, 0b10001, 0b10001, 0b01110],
    [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b01000, 0b01000],
    [0b01110, 0b10001, 0b10001, 0b01110, 0b10001, 0b10001, 0b01110],
    [0b01110, 0b10001, 0b10001, 0b01111, 0b00001, 0b00010, 0b01100],
];

/// Sizes in proportion to the image.
#[derive(Debug, Clone, Copy)]
struct Style {
    /// Half the width of a line.
    half: f64,
    /// Width of its dark rim.
    rim: f64,
    /// Side of a cell of a digit.
    cell: i64,
}

impl Style {
    fn of(image: &Image) -> Self {
        let short = image.width.min(image.height) as f64;
        Self {
            half: (short / 220.0).max(1.2),
            rim: (short / 400.0).max(0.8),
            cell: (short / 120.0).round().max(2.0) as i64,
        }
    }

    /// Width and height of a number with its rim.
    fn label(&self, number: usize) -> [i64; 2] {
        let digits = number.to_string().len() as i64;
        // A free column between digits, and a rim of one cell.
        [(6 * digits + 1) * self.cell, 9 * self.cell]
    }
}

/// Where a number stands: left, top, width, height.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Area {
    x: i64,
    y: i64,
    w: i64,
    h: i64,
}

impl Area {
    /// About a middle, moved into the image.
    fn about(middle: [f64; 2], size: [i64; 2], image: &Image) -> Self {
        let place = |k: usize, room: usize| {
            let start = (middle[k] - 0.5 * size[k] as f64).round() as i64;
            start.clamp(0, (room as i64 - size[k]).max(0))
        };
        Self { x: place(0, image.width), y: place(1, image.height), w: size[0], h: size[1] }
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.x < other.x + other.w
            && other.x < self.x + self.w
            && self.y < other.y + other.h
            && other.y < self.y + self.h
    }

    fn holds(&self, [u, v]: [f64; 2]) -> bool {
        let (u, v) = (u - self.x as f64, v - self.y as f64);
        u >= 0.0 && v >= 0.0 && u <= self.w as f64 && v <= self.h as f64
    }
}

/// The image with the lines and their numbers on it.
#[must_use]
pub fn draw(image: &Image, marks: &[Mark]) -> Image {
    let mut out = image.clone();
    let style = Style::of(image);
    for mark in marks {
        stroke(&mut out, mark, style.half + style.rim, DARK);
    }
    for mark in marks {
        stroke(&mut out, mark, style.half, YELLOW);
    }
    for (i, area) in places(image, marks, &style).iter().enumerate() {
        write_number(&mut out, i + 1, area, &style);
    }
    out
}

/// The image with its longer side at most `longest` pixels: each pixel the mean of those that it stands for.
#[must_use]
pub fn shrunk(image: &Image, longest: usize) -> Image {
    let long = image.width.max(image.height);
    if long <= longest {
        return image.clone();
    }
    let side = |s: usize| (s * longest / long).max(1);
    let (width, height) = (side(image.width), side(image.height));
    let range = |i: usize, from: usize, to: usize| {
        let start = i * from / to;
        start..((i + 1) * from / to).max(start + 1)
    };
    let mut data = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let (mut sum, mut count) = ([0u32; 3], 0u32);
            for v in range(y, image.height, height) {
                for u in range(x, image.width, width) {
                    let pixel = image.data[v * image.width + u];
                    sum = [0, 1, 2].map(|c| sum[c] + u32::from(pixel[c]));
                    count += 1;
                }
            }
            data.push(sum.map(|s| ((s + count / 2) / count) as u8));
        }
    }
    Grid { width, height, data }
}

/// The image as a JPEG: the same bytes for the same pixels.
///
/// # Errors
/// Where it cannot be encoded, which would be a bug.
pub fn jpeg(image: &Image) -> Result<EncodedPicture> {
    /// Format: of JPEG, of 100.
    const QUALITY: u8 = 90;
    let size = [image.width as u32, image.height as u32];
    let raw: Vec<u8> = image.data.iter().flatten().copied().collect();
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .write_image(&raw, size[0], size[1], ExtendedColorType::Rgb8)
        .map_err(|e| Error::Export(format!("a picture for the language model: {e}")))?;
    Ok(EncodedPicture { bytes, mime: "image/jpeg", size })
}

/// Colours the pixels within `half` of a line.
fn stroke(image: &mut Image, mark: &Mark, half: f64, color: [u8; 3]) {
    let [a, b] = *mark;
    let range = |k: usize, size: usize| {
        let low = (a[k].min(b[k]) - half).floor().clamp(0.0, size as f64) as usize;
        let high = (a[k].max(b[k]) + half).ceil().clamp(-1.0, size as f64 - 1.0) + 1.0;
        low..high as usize
    };
    for y in range(1, image.height) {
        for x in range(0, image.width) {
            if segment_distance([x as f64, y as f64], a, b) <= half {
                image.data[y * image.width + x] = color;
            }
        }
    }
}

/// A place beside each line for its number: inside the image, on no other number, on as few lines as can be.
fn places(image: &Image, marks: &[Mark], style: &Style) -> Vec<Area> {
    /// Format: places along a line that are tried for its number, near the middle first.
    const ALONG: [f64; 7] = [0.5, 0.35, 0.65, 0.2, 0.8, 0.05, 0.95];
    let mut placed: Vec<Area> = Vec::new();
    for (i, [a, b]) in marks.iter().enumerate() {
        let size = style.label(i + 1);
        let d = [b[0] - a[0], b[1] - a[1]];
        let length = d[0].hypot(d[1]);
        let normal = if length > 1e-9 { [-d[1] / length, d[0] / length] } else { [0.0, 1.0] };
        let extent = 0.5 * (normal[0].abs() * size[0] as f64 + normal[1].abs() * size[1] as f64);
        let off = extent + style.half + style.rim + 1.0;
        let beside: Vec<Area> = ALONG
            .iter()
            .flat_map(|t| {
                [off, -off].map(|o| {
                    let middle = [0, 1].map(|k| a[k] + t * d[k] + o * normal[k]);
                    Area::about(middle, size, image)
                })
            })
            .collect();
        let free = |area: &&Area| !placed.iter().any(|other| area.overlaps(other));
        let area = beside.iter().filter(free).min_by_key(|area| lines_through(area, marks)).copied();
        let middle = [0, 1].map(|k| a[k] + 0.5 * d[k]);
        let area = area.or_else(|| nearest_free(image, middle, size, &placed));
        // An image too small for its numbers: better there twice than not at all.
        placed.push(area.unwrap_or_else(|| Area::about(middle, size, image)));
    }
    placed
}

fn lines_through(area: &Area, marks: &[Mark]) -> usize {
    let through =
        |[a, b]: &&Mark| (0..=64).any(|i| area.holds([0, 1].map(|k| a[k] + f64::from(i) / 64.0 * (b[k] - a[k]))));
    marks.iter().filter(through).count()
}

/// The free place nearest to a point.
fn nearest_free(image: &Image, to: [f64; 2], size: [i64; 2], placed: &[Area]) -> Option<Area> {
    let steps = |room: usize, size: i64| (0..=(room as i64 - size).max(0)).step_by((size as usize / 2).max(1));
    steps(image.height, size[1])
        .flat_map(|y| steps(image.width, size[0]).map(move |x| Area { x, y, w: size[0], h: size[1] }))
        .filter(|area| !placed.iter().any(|other| area.overlaps(other)))
        .min_by(|a, b| {
            let distance = |area: &Area| {
                (area.x as f64 + 0.5 * size[0] as f64 - to[0]).hypot(area.y as f64 + 0.5 * size[1] as f64 - to[1])
            };
            distance(a).total_cmp(&distance(b))
        })
}

/// Writes a number into its area: white on a dark rim.
fn write_number(image: &mut Image, number: usize, area: &Area, style: &Style) {
    let cell = style.cell;
    for (rim, color) in [(cell, DARK), (0, WHITE)] {
        for (i, digit) in number.to_string().bytes().enumerate() {
            let rows = DIGITS[usize::from(digit - b'0') % DIGITS.len()];
            for (row, bits) in rows.iter().enumerate() {
                for column in (0..5).filter(|column| (bits >> (4 - column)) & 1 == 1) {
                    let x = area.x + (6 * i as i64 + column + 1) * cell;
                    let y = area.y + (row as i64 + 1) * cell;
                    fill(image, [x - rim, y - rim], cell + 2 * rim, color);
                }
            }
        }
    }
}

/// Fills a square as far as it lies on the image.
fn fill(image: &mut Image, [x, y]: [i64; 2], side: i64, color: [u8; 3]) {
    let range =
        |start: i64, size: usize| start.clamp(0, size as i64) as usize..(start + side).clamp(0, size as i64) as usize;
    for v in range(y, image.height) {
        for u in range(x, image.width) {
            image.data[v * image.width + u] = color;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white(width: usize, height: usize) -> Image {
        Grid::filled(width, height, [250, 250, 250])
    }

    /// Lines as they come: close together, across each other, at the border, of no length.
    fn bundles(width: f64, height: f64) -> Vec<Vec<Mark>> {
        let upright = |x: f64| [[x, 0.1 * height], [x, 0.9 * height]];
        let level = |y: f64| [[0.1 * width, y], [0.9 * width, y]];
        vec![
            vec![upright(0.5 * width), upright(0.51 * width), upright(0.52 * width), upright(0.53 * width)],
            vec![upright(0.0), upright(width - 1.0), level(0.0), level(height - 1.0)],
            vec![
                [[0.0, 0.0], [width, height]],
                [[width, 0.0], [0.0, height]],
                level(0.5 * height),
                upright(0.5 * width),
            ],
            vec![[[3.0, 3.0], [3.0, 3.0]]; 4],
            (0..12).map(|i| level(f64::from(i) * height / 13.0)).collect(),
        ]
    }

    #[test]
    fn numbers_stay_on_the_image_and_off_each_other() {
        for (width, height) in [(160, 120), (640, 480), (768, 1024)] {
            let image = white(width, height);
            for marks in bundles(width as f64, height as f64) {
                let style = Style::of(&image);
                let areas = places(&image, &marks, &style);
                assert_eq!(areas.len(), marks.len());
                for (i, a) in areas.iter().enumerate() {
                    assert!(a.x >= 0 && a.y >= 0 && a.x + a.w <= width as i64 && a.y + a.h <= height as i64, "{a:?}");
                    assert!(areas[..i].iter().all(|b| !a.overlaps(b)), "{width} x {height}: {areas:?}");
                }
            }
        }
    }

    #[test]
    fn a_number_stands_beside_its_line() {
        let image = white(640, 480);
        let marks = [[[100.0, 50.0], [100.0, 400.0]], [[500.0, 50.0], [500.0, 400.0]]];
        let areas = places(&image, &marks, &Style::of(&image));
        for (area, mark) in areas.iter().zip(&marks) {
            let middle = area.x as f64 + 0.5 * area.w as f64;
            assert!((middle - mark[0][0]).abs() < 40.0 && lines_through(area, &marks) == 0, "{area:?}");
        }
    }

    #[test]
    fn lines_are_yellow_numbers_white_and_both_have_a_dark_rim() {
        let image = white(640, 480);
        let drawn = draw(&image, &[[[320.0, 100.0], [320.0, 380.0]]]);
        assert_eq!(drawn.get(320, 120), Some(YELLOW));
        assert_eq!((drawn.get(317, 120), drawn.get(323, 120)), (Some(DARK), Some(DARK)));
        assert_eq!(drawn.get(300, 120), Some([250, 250, 250]));
        let count = |color: [u8; 3]| drawn.data.iter().filter(|p| **p == color).count();
        // A "1" has ten lit cells of 4 x 4 pixels.
        assert_eq!(count(WHITE), 10 * 16);
        assert!(count(DARK) > count(WHITE) && count(YELLOW) > 280 * 4);
        // Outside of the image nothing happens.
        let drawn = draw(&image, &[[[-900.0, -900.0], [-800.0, -900.0]], [[1e4, 1e4], [1e5, 1e4]]]);
        assert_eq!((drawn.width, drawn.height), (image.width, image.height));
    }

    #[test]
    fn shrinking_keeps_the_shape_and_the_mean() {
        let mut image = white(640, 480);
        image.data[0] = [10, 10, 10];
        let small = shrunk(&image, 320);
        assert_eq!((small.width, small.height), (320, 240));
        assert_eq!(small.data[0], [190, 190, 190]);
        assert_eq!(shrunk(&image, 640), image);
        let thin = shrunk(&white(3000, 2), 1000);
        assert_eq!((thin.width, thin.height), (1000, 1));
    }

    #[test]
    fn the_same_pixels_are_the_same_bytes() {
        let image = draw(&white(64, 48), &[[[10.0, 5.0], [50.0, 40.0]]]);
        let picture = jpeg(&image).unwrap();
        assert_eq!(picture, jpeg(&image).unwrap());
        assert_eq!(picture.size, [64, 48]);
        assert!(picture.bytes.starts_with(&[0xff, 0xd8]));
    }
}
