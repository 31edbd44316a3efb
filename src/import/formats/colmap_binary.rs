//! COLMAP's binary files, little-endian, read from front to back.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use super::colmap_model::{Cameras, MODELS, RegisteredImage, Thinned, optics, pose};
use crate::error::{Error, Result};
use crate::math::Point;

/// The longest file name that is believed, bytes.
const MAX_NAME_BYTES: usize = 4096;

/// A binary file with its position in what is read.
struct Reader {
    reader: BufReader<File>,
    path: PathBuf,
    left: u64,
    place: String,
}

impl Reader {
    fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, &e))?;
        let left = file.metadata().map_err(|e| Error::io(path, &e))?.len();
        Ok(Self { reader: BufReader::new(file), path: path.to_owned(), left, place: "header".to_owned() })
    }

    fn fault(&self, message: impl Into<String>) -> Error {
        Error::format(&self.path, self.place.clone(), message)
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut out = [0; N];
        self.left = self.left.checked_sub(N as u64).ok_or_else(|| self.ends())?;
        self.reader.read_exact(&mut out).map_err(|_| self.ends())?;
        Ok(out)
    }

    fn ends(&self) -> Error {
        self.fault("the file ends before; was it copied as a whole?")
    }

    fn u32(&mut self) -> Result<u32> {
        Ok(u32::from_le_bytes(self.bytes()?))
    }

    fn u64(&mut self) -> Result<u64> {
        Ok(u64::from_le_bytes(self.bytes()?))
    }

    fn f64s<const N: usize>(&mut self) -> Result<[f64; N]> {
        let mut out = [0.0; N];
        for value in &mut out {
            *value = f64::from_le_bytes(self.bytes()?);
        }
        Ok(out)
    }

    /// Passes over `count` records of `size` bytes.
    fn skip(&mut self, count: u64, size: u64) -> Result<()> {
        let bytes = count.checked_mul(size).filter(|b| *b <= self.left).ok_or_else(|| self.ends())?;
        self.left -= bytes;
        let step = i64::try_from(bytes).map_err(|_| self.ends())?;
        self.reader.seek_relative(step).map_err(|e| Error::io(&self.path, &e))
    }

    /// Text up to a zero byte.
    fn name(&mut self) -> Result<String> {
        let mut out = Vec::new();
        loop {
            match self.bytes::<1>()? {
                [0] => break,
                [byte] if out.len() < MAX_NAME_BYTES => out.push(byte),
                _ => return Err(self.fault("a name is longer than 4096 bytes; is this COLMAP's images.bin?")),
            }
        }
        String::from_utf8(out).map_err(|_| self.fault("a name is not UTF-8"))
    }
}

/// `cameras.bin`.
pub(super) fn cameras(path: &Path) -> Result<Cameras> {
    let mut reader = Reader::open(path)?;
    let count = reader.u64()?;
    let mut out = Cameras::new();
    for i in 0..count {
        reader.place = format!("camera {} of {count}", i + 1);
        let id = u64::from(reader.u32()?);
        let model = reader.u32()?;
        let (width, height) = (reader.u64()?, reader.u64()?);
        let Some((name, parameters)) = MODELS.get(model as usize) else {
            return Err(reader.fault(format!("camera model number {model} is not known")));
        };
        let mut values = Vec::with_capacity(*parameters);
        for _ in 0..*parameters {
            let [value] = reader.f64s::<1>()?;
            values.push(value);
        }
        let (width, height) =
            (usize::try_from(width).unwrap_or(usize::MAX), usize::try_from(height).unwrap_or(usize::MAX));
        out.insert(id, optics(name, width, height, &values).map_err(|e| reader.fault(e))?);
    }
    Ok(out)
}

/// `images.bin`; the observations are passed over.
pub(super) fn images(path: &Path) -> Result<Vec<RegisteredImage>> {
    let mut reader = Reader::open(path)?;
    let count = reader.u64()?;
    let mut out = Vec::new();
    for i in 0..count {
        reader.place = format!("image {} of {count}", i + 1);
        reader.u32()?;
        let values = reader.f64s::<7>()?;
        let camera = u64::from(reader.u32()?);
        let name = reader.name()?;
        let observations = reader.u64()?;
        reader.skip(observations, 24)?;
        if values.iter().any(|v| !v.is_finite()) {
            return Err(reader.fault("the pose is not finite"));
        }
        out.push(RegisteredImage { pose: pose(values), camera, name });
    }
    Ok(out)
}

/// `points3D.bin`; the tracks are passed over.
pub(super) fn points(path: &Path, out: &mut Thinned) -> Result<()> {
    let mut reader = Reader::open(path)?;
    let count = reader.u64()?;
    for i in 0..count {
        if i % 4096 == 0 {
            reader.place = format!("point {} of {count}", i + 1);
        }
        reader.u64()?;
        let p = reader.f64s::<3>()?;
        reader.bytes::<3>()?;
        reader.f64s::<1>()?;
        let track = reader.u64()?;
        reader.skip(track, 8)?;
        out.push(Point::from(p));
    }
    Ok(())
}
