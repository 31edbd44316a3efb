//! What was kept of a frame, as bytes that give back the very same: for who keeps it between runs.

use sha2::{Digest, Sha256};

use crate::geometry::segments::{LiftedSegment, Segment2};
use crate::math::line::{Line, Segment};
use crate::math::{Point, Vector};
use crate::recording::sketch::Sketch;
use crate::recording::{Grid, Recording};

/// Keeps between runs what frames show, as bytes. What it gives back has to be what was kept for a frame of the same files, pose,
/// camera and `[geometry]` of the configuration; anything else, and bytes that were damaged, cost a look at the frame.
pub trait LookStore: Sync {
    /// What was kept of a frame, with its lines or without.
    fn find(&self, recording: &Recording, frame: usize, with_lines: bool) -> Option<Vec<u8>>;

    /// Keeps what a frame shows.
    fn keep(&self, recording: &Recording, frame: usize, with_lines: bool, look: &[u8]);
}

/// Keeps nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Forgetful;

impl LookStore for Forgetful {
    fn find(&self, _recording: &Recording, _frame: usize, _with_lines: bool) -> Option<Vec<u8>> {
        None
    }

    fn keep(&self, _recording: &Recording, _frame: usize, _with_lines: bool, _look: &[u8]) {}
}

/// What the bytes begin with; another number where they mean something else.
const MAGIC: &[u8; 8] = b"paws lk1";
/// Format: bytes of the digest at their end.
const DIGEST: usize = 32;

/// A look as bytes: all numbers little-endian, sizes in 32 bits, a digest of all at the end.
pub(super) fn encoded(sketch: &Sketch, segments: &[LiftedSegment]) -> Vec<u8> {
    let mut out = MAGIC.to_vec();
    let size = |out: &mut Vec<u8>, n: usize| out.extend((n as u32).to_le_bytes());
    let numbers = |out: &mut Vec<u8>, all: &[f64]| all.iter().for_each(|x| out.extend(x.to_le_bytes()));
    let grid = &sketch.depth_mm;
    for n in [sketch.step, grid.width, grid.height, usize::from(sketch.class.is_some()), segments.len()] {
        size(&mut out, n);
    }
    grid.data.iter().for_each(|mm| out.extend(mm.to_le_bytes()));
    if let Some(class) = &sketch.class {
        out.extend(&class.data);
    }
    for s in segments {
        let (line, [a, b]) = (&s.segment.line, [s.image.a, s.image.b]);
        numbers(&mut out, &[a, b, s.segment.span].concat());
        for v in [&line.point.coords, &line.direction, &s.eye.coords, &s.plane] {
            numbers(&mut out, v.as_slice());
        }
        size(&mut out, s.samples.len());
        s.samples.iter().for_each(|p| numbers(&mut out, p.coords.as_slice()));
    }
    let digest = Sha256::digest(&out);
    out.extend_from_slice(&digest);
    out
}

/// The look of a frame from its bytes; `None` where they are not those of one.
pub(super) fn decoded(bytes: &[u8], frame: usize) -> Option<(Sketch, Vec<LiftedSegment>)> {
    let (body, digest) = bytes.split_at_checked(bytes.len().checked_sub(DIGEST)?)?;
    let expected = Sha256::digest(body);
    let expected: &[u8] = &expected;
    if expected != digest {
        return None;
    }
    let mut left = Left(body.strip_prefix(MAGIC)?);
    let [step, width, height, has_class, count] = left.sizes()?;
    let area = width.checked_mul(height)?;
    let depth = left.take(area.checked_mul(2)?)?.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
    let class = match has_class {
        0 => None,
        _ => Some(Grid { width, height, data: left.take(area)?.to_vec() }),
    };
    let mut segments = Vec::new();
    for _ in 0..count {
        segments.push(left.segment(frame)?);
    }
    let sketch = Sketch { frame, step, depth_mm: Grid { width, height, data: depth }, class };
    left.0.is_empty().then_some((sketch, segments))
}

/// Bytes that are still to be read.
struct Left<'a>(&'a [u8]);

impl<'a> Left<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(head)
    }

    fn sizes<const N: usize>(&mut self) -> Option<[usize; N]> {
        let mut all = [0; N];
        for n in &mut all {
            *n = u32::from_le_bytes(self.take(4)?.try_into().ok()?) as usize;
        }
        Some(all)
    }

    fn numbers<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut all = [0.0; N];
        for x in &mut all {
            *x = f64::from_le_bytes(self.take(8)?.try_into().ok()?);
        }
        Some(all)
    }

    fn segment(&mut self, frame: usize) -> Option<LiftedSegment> {
        let image = Segment2 { a: self.numbers()?, b: self.numbers()? };
        let span = self.numbers()?;
        let [point, direction, eye, plane]: [[f64; 3]; 4] =
            [self.numbers()?, self.numbers()?, self.numbers()?, self.numbers()?];
        let line = Line { point: Point::from(point), direction: Vector::from(direction) };
        let [count] = self.sizes()?;
        let mut samples = Vec::new();
        for _ in 0..count {
            samples.push(Point::from(self.numbers::<3>()?));
        }
        let (segment, eye, plane) = (Segment { line, span }, Point::from(eye), Vector::from(plane));
        Some(LiftedSegment { view: frame, image, segment, eye, plane, samples })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look() -> (Sketch, Vec<LiftedSegment>) {
        let depth = Grid { width: 3, height: 2, data: vec![0.0, 1.2345, 2.0, 65.0, 0.001, 3.0] };
        let mask = Grid { width: 3, height: 2, data: vec![0u8, 1, 2, 3, 4, 255] };
        let (at, along) = (Point::new(0.1, 1.0 / 3.0, -2.0), Vector::new(0.0, 0.6, 0.8));
        let segment = LiftedSegment {
            view: 7,
            image: Segment2 { a: [0.5, 0.25], b: [1.0 / 7.0, 2.0] },
            segment: Segment { line: Line { point: at, direction: along }, span: [-0.5, 0.7] },
            eye: at + along,
            plane: -along,
            samples: vec![at, at + along * 0.3],
        };
        (Sketch::of(7, &depth, Some(&mask)), vec![segment])
    }

    #[test]
    fn a_look_comes_back_as_it_was_at_any_frame() {
        let (sketch, segments) = look();
        assert_eq!(decoded(&encoded(&sketch, &segments), 7), Some((sketch.clone(), segments.clone())));
        let plain = Sketch { class: None, ..sketch };
        let (back, none) = decoded(&encoded(&plain, &[]), 9).unwrap();
        assert_eq!((back.frame, back.depth_mm, back.class, none.len()), (9, plain.depth_mm, None, 0));
    }

    #[test]
    fn damaged_bytes_are_no_look() {
        let (sketch, segments) = look();
        let whole = encoded(&sketch, &segments);
        for length in [0, 8, 31, 40, whole.len() - 1] {
            assert!(decoded(&whole[..length], 7).is_none());
        }
        for at in [0, 9, 40, whole.len() - 1] {
            let mut broken = whole.clone();
            broken[at] ^= 1;
            assert!(decoded(&broken, 7).is_none());
        }
        // Whole, but of a size that it does not have.
        let mut body = whole[..whole.len() - DIGEST].to_vec();
        body[12..20].fill(0xff);
        let digest = Sha256::digest(&body);
        body.extend_from_slice(&digest);
        assert!(decoded(&body, 7).is_none());
    }
}
