//! Bytes to pixels: images, and depth in all its codings.

use std::io::Cursor;

use image::{DynamicImage, ImageReader, RgbImage};

use super::believable::MAX_PIXELS;
use super::blob::Blob;
use super::capture::{ByteOrder, Depth, DepthCoding, PixelCoding};
use crate::error::{Error, Result};
use crate::json::POINTER;
use crate::recording::{Grid, images};

/// A decoder may claim any size; a 4K RGB image needs 25 MB.
const MAX_DECODED_BYTES: u64 = 512 << 20;
/// An image, its format told by its content.
///
/// # Errors
/// Where the bytes cannot be read or are no image.
pub fn picture(blob: &Blob) -> Result<DynamicImage> {
    let bytes = blob.read()?;
    let file_bytes = bytes.len() as u64;
    let is_pointer = bytes.starts_with(POINTER.0);
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| blob.fault(format!("cannot be read ({e})")))?;
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MAX_DECODED_BYTES);
    reader.limits(limits);
    let wrong = |e: image::ImageError| match is_pointer {
        true => blob.fault(POINTER.1),
        false => blob.fault(format!("is no image that can be decoded ({e}); JPEG and PNG can")),
    };
    let decoder = reader.into_decoder().map_err(wrong)?;
    images::believable(&decoder, file_bytes).map_err(|e| blob.fault(e))?;
    DynamicImage::from_decoder(decoder).map_err(wrong)
}

/// An image of pixels without a header.
///
/// # Errors
/// Where the bytes cannot be read or are fewer than the size needs.
pub fn pixels(blob: &Blob, width: usize, height: usize, coding: PixelCoding) -> Result<RgbImage> {
    let bytes = blob.read()?;
    let short = || blob.fault(format!("has {} bytes, too few for an image of {width} x {height} pixels", bytes.len()));
    let count = width.checked_mul(height).filter(|n| (1..=MAX_PIXELS).contains(n)).ok_or_else(short)?;
    let mut data = Vec::with_capacity(3 * count);
    for y in 0..height {
        for x in 0..width {
            let rgb = match coding {
                PixelCoding::Rgba { is_bottom_up } => {
                    let row = if is_bottom_up { height - 1 - y } else { y };
                    bytes.get(4 * (row * width + x)..).and_then(|b| Some([*b.first()?, *b.get(1)?, *b.get(2)?]))
                }
                PixelCoding::Bgra => {
                    bytes.get(4 * (y * width + x)..).and_then(|b| Some([*b.get(2)?, *b.get(1)?, *b.first()?]))
                }
                PixelCoding::Rgb => {
                    bytes.get(3 * (y * width + x)..).and_then(|b| Some([*b.first()?, *b.get(1)?, *b.get(2)?]))
                }
                PixelCoding::Bgr => {
                    bytes.get(3 * (y * width + x)..).and_then(|b| Some([*b.get(2)?, *b.get(1)?, *b.first()?]))
                }
                PixelCoding::Grey => bytes.get(y * width + x).map(|v| [*v; 3]),
                PixelCoding::Yuv420 { offsets, rows, steps } => {
                    let at = |plane: usize, x: usize, y: usize| {
                        let row = y.checked_mul(*rows.get(plane)?)?;
                        let step = x.checked_mul(*steps.get(plane)?)?;
                        bytes.get(offsets.get(plane)?.checked_add(row)?.checked_add(step)?).copied()
                    };
                    yuv(at(0, x, y), at(1, x / 2, y / 2), at(2, x / 2, y / 2))
                }
            };
            data.extend(rgb.ok_or_else(short)?);
        }
    }
    RgbImage::from_raw(width as u32, height as u32, data).ok_or_else(short)
}

/// A colour from brightness and its blue and red differences, full range (BT.601).
fn yuv(y: Option<u8>, u: Option<u8>, v: Option<u8>) -> Option<[u8; 3]> {
    let (y, u, v) = (f64::from(y?), f64::from(u?) - 128.0, f64::from(v?) - 128.0);
    let rgb = [y + 1.402 * v, y - 0.344_136 * u - 0.714_136 * v, y + 1.772 * u];
    Some(rgb.map(|c| c.round().clamp(0.0, 255.0) as u8))
}

/// Metres of a value of a depth buffer; not finite at the far plane of a room without end.
fn unprojected(value: f32, near_m: f64, far_m: f64) -> f32 {
    let value = f64::from(value);
    // 0 is written where nothing was measured as well.
    if value <= 0.0 {
        return 0.0;
    }
    let share_of_far = if far_m.is_finite() { near_m / far_m } else { 0.0 };
    (near_m / (1.0 - value * (1.0 - share_of_far))) as f32
}

/// Values of 8 bits of a grey image, or one byte a pixel of a raw array of a known size.
///
/// # Errors
/// Where the bytes are neither.
pub fn bytes_grid(blob: &Blob, width: usize, height: usize) -> Result<Grid<u8>> {
    let bytes = blob.read()?;
    if bytes.len() == width * height {
        return Ok(Grid { width, height, data: bytes });
    }
    grey(blob)
}

/// A grey image of 8 bits.
///
/// # Errors
/// Where the bytes are another kind of image.
pub fn grey(blob: &Blob) -> Result<Grid<u8>> {
    match picture(blob)? {
        DynamicImage::ImageLuma8(image) => {
            let (width, height) = (image.width() as usize, image.height() as usize);
            Ok(Grid { width, height, data: image.into_raw() })
        }
        other => Err(blob.fault(format!("must be an 8-bit grey image, this is {:?}", other.color()))),
    }
}

/// Depth as it is stored, metres where it is metric; 0 where there is no value or too little confidence.
///
/// # Errors
/// Where the bytes do not hold what the coding says.
pub fn depth(blob: &Blob, confidence: Option<&Blob>, how: &Depth) -> Result<Grid<f32>> {
    let mut grid = match how.coding {
        DepthCoding::Png16 { unit_m } => png(blob, unit_m)?,
        DepthCoding::Pgm16 { unit_m } => pgm(blob, unit_m)?,
        DepthCoding::Exr => super::depth_exr::read(blob)?,
        DepthCoding::Npy { unit_m } => npy(blob, unit_m)?,
        DepthCoding::RawF32 { width, height, order } => {
            raw(blob, width, height, |[a, b, c, d]: [u8; 4]| match order {
                ByteOrder::Little => f32::from_le_bytes([a, b, c, d]),
                ByteOrder::Big => f32::from_be_bytes([a, b, c, d]),
            })?
        }
        DepthCoding::BufferF32 { width, height, near_m, far_m } => {
            raw(blob, width, height, |bytes: [u8; 4]| unprojected(f32::from_le_bytes(bytes), near_m, far_m))?
        }
        DepthCoding::RawU16 { width, height, order, unit_m } => raw(blob, width, height, |[a, b]: [u8; 2]| {
            let count = match order {
                ByteOrder::Little => u16::from_le_bytes([a, b]),
                ByteOrder::Big => u16::from_be_bytes([a, b]),
            };
            (f64::from(count) * unit_m) as f32
        })?,
    };
    for z in &mut grid.data {
        if !z.is_finite() || *z < 0.0 {
            *z = 0.0;
        }
    }
    if let Some(confidence) = confidence
        && how.least_confidence > 0
    {
        let sure = bytes_grid(confidence, grid.width, grid.height)?;
        if (sure.width, sure.height) != (grid.width, grid.height) {
            return Err(confidence
                .fault(format!("is {} x {}, its depth is {} x {}", sure.width, sure.height, grid.width, grid.height)));
        }
        for (z, c) in grid.data.iter_mut().zip(&sure.data) {
            if *c < how.least_confidence {
                *z = 0.0;
            }
        }
    }
    Ok(grid)
}

fn png(blob: &Blob, unit_m: f64) -> Result<Grid<f32>> {
    let scaled = |count: u32| (f64::from(count) * unit_m) as f32;
    match picture(blob)? {
        DynamicImage::ImageLuma16(image) => Ok(Grid {
            width: image.width() as usize,
            height: image.height() as usize,
            data: image.into_raw().into_iter().map(|c| scaled(u32::from(c))).collect(),
        }),
        DynamicImage::ImageLuma8(image) => Ok(Grid {
            width: image.width() as usize,
            height: image.height() as usize,
            data: image.into_raw().into_iter().map(|c| scaled(u32::from(c))).collect(),
        }),
        other => Err(blob.fault(format!(
            "depth must be a grey image, this is {:?}; a coloured picture of depth holds no metres",
            other.color()
        ))),
    }
}

/// Rows of numbers of `N` bytes each.
fn raw<const N: usize>(blob: &Blob, width: usize, height: usize, value: impl Fn([u8; N]) -> f32) -> Result<Grid<f32>> {
    let bytes = blob.read()?;
    let pixels = width.checked_mul(height).filter(|n| (1..=MAX_PIXELS).contains(n));
    match pixels {
        Some(pixels) if bytes.len() == pixels * N => Ok(Grid {
            width,
            height,
            data: bytes.chunks_exact(N).filter_map(|c| c.try_into().ok()).map(value).collect(),
        }),
        _ => {
            Err(blob.fault(format!("has {} bytes; {width} x {height} pixels of {N} bytes were expected", bytes.len())))
        }
    }
}

/// A binary portable grey map (`P5`); comments may stand in its header.
fn pgm(blob: &Blob, unit_m: f64) -> Result<Grid<f32>> {
    let bytes = blob.read()?;
    let mut at = 0;
    let mut words = Vec::new();
    while words.len() < 4 {
        while bytes.get(at).is_some_and(u8::is_ascii_whitespace) {
            at += 1;
        }
        if bytes.get(at) == Some(&b'#') {
            while bytes.get(at).is_some_and(|b| *b != b'\n') {
                at += 1;
            }
            continue;
        }
        let start = at;
        while bytes.get(at).is_some_and(|b| !b.is_ascii_whitespace()) {
            at += 1;
        }
        let word = bytes.get(start..at).filter(|w| !w.is_empty());
        words.push(word.map(|w| String::from_utf8_lossy(w).into_owned()).unwrap_or_default());
    }
    let number = |i: usize| words.get(i).and_then(|w| w.parse::<usize>().ok());
    let (Some(width), Some(height), Some(most)) = (number(1), number(2), number(3)) else {
        return Err(blob.fault("is no PGM: expected \"P5 width height maximum\""));
    };
    let wide = usize::from(most > 255) + 1;
    let body = bytes.get(at + 1..).unwrap_or_default();
    let pixels = width.checked_mul(height).filter(|n| (1..=MAX_PIXELS).contains(n));
    if words.first().map(String::as_str) != Some("P5") || pixels.is_none_or(|n| body.len() < n * wide) {
        return Err(blob.fault(format!("is no whole binary PGM of {width} x {height} pixels of {wide} bytes")));
    }
    let data = body
        .chunks_exact(wide)
        .take(width * height)
        .map(|c| c.iter().fold(0u32, |sum, b| (sum << 8) | u32::from(*b)))
        .map(|count| (f64::from(count) * unit_m) as f32)
        .collect();
    Ok(Grid { width, height, data })
}

pub(super) fn npy(blob: &Blob, unit_m: f64) -> Result<Grid<f32>> {
    let bytes = blob.read()?;
    if let Some(why) = crate::recording::npy::refused(&bytes) {
        return Err(blob.fault(format!("is no numpy array ({why})")));
    }
    let array = npyz::NpyFile::new(bytes.as_slice()).map_err(|e| blob.fault(format!("is no numpy array ({e})")))?;
    let shape: Vec<u64> = array.shape().iter().copied().filter(|n| *n != 1).collect();
    let [height, width] = shape.as_slice() else {
        return Err(blob.fault(format!("has shape {:?}, expected (rows, columns)", array.shape())));
    };
    let (width, height) = (*width as usize, *height as usize);
    if width.checked_mul(height).is_none_or(|n| n > MAX_PIXELS) || array.order() != npyz::Order::C {
        return Err(blob.fault("is too large or in Fortran order; save numpy.ascontiguousarray(depth)"));
    }
    let unread = |e: std::io::Error| blob.fault(format!("cannot be read ({e}); save it as float32 or uint16"));
    let scaled = |v: f64| (v * unit_m) as f32;
    let data: Vec<f32> = match array.dtype().descr().trim_matches('\'') {
        "<f4" | ">f4" => array.into_vec::<f32>().map_err(unread)?.into_iter().map(|v| scaled(f64::from(v))).collect(),
        "<u2" | ">u2" => array.into_vec::<u16>().map_err(unread)?.into_iter().map(|v| scaled(f64::from(v))).collect(),
        "<f8" | ">f8" => array.into_vec::<f64>().map_err(unread)?.into_iter().map(scaled).collect(),
        other => return Err(blob.fault(format!("has numbers of type {other}; save it as float32 or uint16"))),
    };
    Ok(Grid { width, height, data })
}

/// A mistake of ours, should an encoder ever refuse.
pub(super) fn encoding(e: &image::ImageError) -> Error {
    Error::Export(format!("an image cannot be encoded: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn how(coding: DepthCoding) -> Depth {
        Depth { least_confidence: 2, ..Depth::of(coding, Vec::new()) }
    }

    fn inline(bytes: &[u8]) -> Blob {
        Blob::Inline(bytes.into())
    }

    #[test]
    fn raw_depth_has_its_order_and_no_bad_values() {
        let floats: Vec<u8> = [1.5f32, f32::NAN, -1.0, f32::INFINITY].iter().flat_map(|v| v.to_be_bytes()).collect();
        let coding = DepthCoding::RawF32 { width: 2, height: 2, order: ByteOrder::Big };
        assert_eq!(depth(&inline(&floats), None, &how(coding.clone())).unwrap().data, [1.5, 0.0, 0.0, 0.0]);
        let error = depth(&inline(&floats[..15]), None, &how(coding)).unwrap_err().to_string();
        assert!(error.contains("15 bytes"), "{error}");
        let coding = DepthCoding::RawU16 { width: 2, height: 1, order: ByteOrder::Little, unit_m: 0.001 };
        let sure = inline(&[2, 1]);
        assert_eq!(depth(&inline(&[0xE8, 3, 1, 0]), Some(&sure), &how(coding)).unwrap().data, [1.0, 0.0]);
    }

    /// A grey PNG that claims a size and holds next to nothing.
    fn hollow(width: u32, height: u32) -> Vec<u8> {
        let chunk = |kind: &[u8], data: &[u8]| -> Vec<u8> {
            let body = [kind, data].concat();
            let crc = !body.iter().fold(u32::MAX, |crc, byte| {
                (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xEDB8_8320 } else { c >> 1 })
            });
            let length = data.len() as u32;
            [length.to_be_bytes().as_slice(), body.as_slice(), crc.to_be_bytes().as_slice()].concat()
        };
        let size = [width.to_be_bytes(), height.to_be_bytes()].concat();
        let header = [size.as_slice(), [8u8, 0, 0, 0, 0].as_slice()].concat();
        [b"\x89PNG\r\n\x1a\n".to_vec(), chunk(b"IHDR", &header), chunk(b"IDAT", &[0; 8]), chunk(b"IEND", &[])].concat()
    }

    #[test]
    fn an_image_that_its_bytes_cannot_hold_is_refused_before_it_is_decoded() {
        for (size, word) in [(8000, "too many for its"), (20_000, "more than any camera"), (2, "no image that can")] {
            let error = grey(&inline(&hollow(size, size))).unwrap_err().to_string();
            assert!(error.contains(word), "{size}: {error}");
        }
    }

    #[test]
    fn numpy_headers_that_nest_or_claim_too_much_are_refused() {
        for (text, word) in [("(".repeat(500), "deeper"), ("{'shape': (4294967296,4294967296)}".to_owned(), "claims")] {
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((text.len() as u16).to_le_bytes());
            bytes.extend(text.as_bytes());
            let error = depth(&inline(&bytes), None, &how(DepthCoding::Npy { unit_m: 1.0 })).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }

    /// near / (1 - d) for a far plane without end; `-2 far near / (far - near) / (2 d - 1 - (far + near) / (far - near))` else.
    #[test]
    fn depth_buffers_become_metres() {
        let floats: Vec<u8> = [0.0f32, 0.9, 1.0, 0.95].iter().flat_map(|v| v.to_le_bytes()).collect();
        let coding = DepthCoding::BufferF32 { width: 4, height: 1, near_m: 0.1, far_m: f64::INFINITY };
        let out = depth(&inline(&floats), None, &how(coding)).unwrap().data;
        assert!(
            out[0] == 0.0 && (out[1] - 1.0).abs() < 1e-5 && out[2] == 0.0 && (out[3] - 2.0).abs() < 1e-5,
            "{out:?}"
        );
        let coding = DepthCoding::BufferF32 { width: 4, height: 1, near_m: 0.1, far_m: 10.0 };
        let out = depth(&inline(&floats), None, &how(coding)).unwrap().data;
        let (near, far) = (0.1, 10.0);
        let formula = -2.0 * far * near / (far - near) / (2.0 * 0.9 - 1.0 - (far + near) / (far - near));
        assert!((f64::from(out[1]) - formula).abs() < 1e-5 && (out[2] - 10.0).abs() < 1e-4, "{out:?}");
    }

    #[test]
    fn pixels_without_a_header_have_their_order() {
        let bytes = inline(&[1, 2, 3, 9, 4, 5, 6, 9]);
        let image = |coding| pixels(&bytes, 1, 2, coding).unwrap().into_raw();
        assert_eq!(image(PixelCoding::Rgba { is_bottom_up: true }), [4, 5, 6, 1, 2, 3]);
        assert_eq!(image(PixelCoding::Rgba { is_bottom_up: false }), [1, 2, 3, 4, 5, 6]);
        assert_eq!(image(PixelCoding::Bgra), [3, 2, 1, 6, 5, 4]);
        assert_eq!(image(PixelCoding::Rgb), [1, 2, 3, 9, 4, 5]);
        assert_eq!(image(PixelCoding::Bgr), [3, 2, 1, 5, 4, 9]);
        assert_eq!(image(PixelCoding::Grey), [1, 1, 1, 2, 2, 2]);
        let planes = PixelCoding::Yuv420 { offsets: [0, 4, 5], rows: [2, 1, 1], steps: [1, 1, 1] };
        let grey = pixels(&inline(&[10, 20, 30, 40, 128, 128]), 2, 2, planes).unwrap();
        assert_eq!(grey.into_raw(), [10, 10, 10, 20, 20, 20, 30, 30, 30, 40, 40, 40]);
        let error = pixels(&bytes, 2, 2, PixelCoding::Bgra).unwrap_err().to_string();
        assert!(error.contains("8 bytes") && error.contains("2 x 2"), "{error}");
    }

    #[test]
    fn grey_maps_have_comments_and_two_bytes() {
        let mut bytes = b"P5\n# hololens\n2 1\n65535\n".to_vec();
        bytes.extend([0x03, 0xE8, 0, 0]);
        let coding = DepthCoding::Pgm16 { unit_m: 0.001 };
        assert_eq!(depth(&inline(&bytes), None, &how(coding.clone())).unwrap().data, [1.0, 0.0]);
        for broken in [&bytes[..bytes.len() - 1], b"P5", b"", b"P2\n2 1\n255\n11"] {
            assert!(depth(&inline(broken), None, &how(coding.clone())).is_err());
        }
    }
}
