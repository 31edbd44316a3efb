//! A line detector's own output: DeepLSD's npz, or LIMAP's text files.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use super::npy;
use super::read::bounded_line;
use crate::error::{Error, Result};

/// End points of a segment, (u, v) pixels each.
pub type Ends = [[f64; 2]; 2];

/// More segments than pixels in a row of a large image are no detector's output.
const MAX_SEGMENTS: usize = 100_000;

/// Reads one frame's segments by the file's ending: `npz` (DeepLSD, array `lines` of shape (N, 2, 2) with the row before the
/// column, as its exporter writes it) or `txt` (LIMAP: the number, then `x1 y1 x2 y2` a line; more columns are passed over).
pub fn read(path: &Path) -> Result<Vec<Ends>> {
    let segments = match path.extension().and_then(|e| e.to_str()) {
        Some("npz") => npz(path)?,
        _ => text(path)?,
    };
    if segments.iter().flatten().flatten().any(|c| !c.is_finite()) {
        return Err(Error::format(path, "segments", "a coordinate is not finite; leave that segment out"));
    }
    Ok(segments)
}

fn npz(path: &Path) -> Result<Vec<Ends>> {
    let wrong = |message: String| Error::format(path, "lines", message);
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let mut archive = zip::ZipArchive::new(BufReader::new(file))
        .map_err(|e| Error::format(path, "archive", format!("is no npz ({e}); save it with numpy.savez")))?;
    let entry = archive.by_name("lines.npy").map_err(|e| {
        wrong(format!("the array \"lines\" cannot be read ({e}); DeepLSD's export_features.py writes it"))
    })?;
    // A header may claim any size: no more is read than the largest believable array.
    let limit = (MAX_SEGMENTS * 4 * 8 + 4096) as u64;
    let mut bytes = Vec::new();
    entry.take(limit).read_to_end(&mut bytes).map_err(|e| wrong(format!("cannot be read ({e})")))?;
    if let Some(why) = npy::refused(&bytes) {
        return Err(wrong(format!("is no numpy array ({why})")));
    }
    let array = npyz::NpyFile::new(bytes.as_slice()).map_err(|e| wrong(format!("is no numpy array ({e})")))?;
    let shape = array.shape().to_vec();
    if shape.first() == Some(&0) {
        return Ok(Vec::new());
    }
    if shape.len() != 3 || shape[1..] != [2, 2] || shape[0] > MAX_SEGMENTS as u64 {
        return Err(wrong(format!("has shape {shape:?}, expected (N, 2, 2) with N up to {MAX_SEGMENTS}")));
    }
    if array.order() != npyz::Order::C {
        return Err(wrong("is in Fortran order; save numpy.ascontiguousarray(lines)".to_owned()));
    }
    let unread = |e: std::io::Error| wrong(format!("cannot be read ({e}); save it as float32 or float64"));
    let values: Vec<f64> = match array.dtype().descr().as_str() {
        "'<f4'" => array.into_vec::<f32>().map_err(unread)?.into_iter().map(f64::from).collect(),
        _ => array.into_vec::<f64>().map_err(unread)?,
    };
    // Row before column: y x.
    Ok(values.chunks_exact(4).map(|v| [[v[1], v[0]], [v[3], v[2]]]).collect())
}

fn text(path: &Path) -> Result<Vec<Ends>> {
    let mut reader = BufReader::new(File::open(path).map_err(|e| Error::io(path, &e))?);
    let mut out = Vec::new();
    let mut announced = None;
    let mut number = 0;
    while let Some(line) = {
        number += 1;
        bounded_line(&mut reader, path, number)?
    } {
        let place = || format!("line {number}");
        let values = line
            .split_whitespace()
            .map(str::parse::<f64>)
            .collect::<std::result::Result<Vec<f64>, _>>()
            .map_err(|e| Error::format(path, place(), format!("\"{}\": {e}", line.trim())))?;
        match (values.as_slice(), announced) {
            ([], _) => {}
            ([count], None) => announced = Some(*count as usize),
            ([a, b, c, d, ..], _) => out.push([[*a, *b], [*c, *d]]),
            _ => return Err(Error::format(path, place(), "expected x1 y1 x2 y2")),
        }
        if out.len() > MAX_SEGMENTS {
            return Err(Error::format(path, place(), format!("more than {MAX_SEGMENTS} segments")));
        }
    }
    match announced {
        Some(count) if count != out.len() => Err(Error::format(
            path,
            "line 1",
            format!("announces {count} segments, the file has {}; export this frame again", out.len()),
        )),
        _ => Ok(out),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn written(name: &str, bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        (dir, path)
    }

    /// An npz as numpy.savez writes it: a stored zip entry with an npy inside.
    fn npz_of(name: &str, descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
        while (10 + header.len() + 1) % 64 != 0 {
            header.push(' ');
        }
        header.push('\n');
        let mut npy = b"\x93NUMPY\x01\x00".to_vec();
        npy.extend((header.len() as u16).to_le_bytes());
        npy.extend(header.as_bytes());
        npy.extend(data);
        let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        zip.start_file(name, options).unwrap();
        zip.write_all(&npy).unwrap();
        zip.finish().unwrap().into_inner()
    }

    #[test]
    fn deeplsd_has_rows_before_columns() {
        let data: Vec<u8> = [10f32, 20.0, 30.0, 40.5].iter().flat_map(|v| v.to_le_bytes()).collect();
        let (_dir, path) = written("000000.npz", &npz_of("lines.npy", "<f4", "(1, 2, 2)", &data));
        assert_eq!(read(&path).unwrap(), [[[20.0, 10.0], [40.5, 30.0]]]);
    }

    #[test]
    fn limap_has_a_count_and_maybe_a_score() {
        let (_dir, path) = written("segments_0.txt", b"2\n1 2 3 4\n5.5 6 7 8 0.9\n");
        assert_eq!(read(&path).unwrap(), [[[1.0, 2.0], [3.0, 4.0]], [[5.5, 6.0], [7.0, 8.0]]]);
    }

    #[test]
    fn broken_files_are_named_with_the_place() {
        for (name, bytes, word) in [
            ("a.npz", b"no zip".to_vec(), "npz"),
            ("a.npz", npz_of("other.npy", "<f4", "(0, 2, 2)", &[]), "lines"),
            ("a.npz", npz_of("lines.npy", "<f4", "(3, 4)", &[0; 48]), "shape"),
            ("a.npz", npz_of("lines.npy", "<f8", "(99, 2, 2)", &[0; 8]), "cannot be read"),
            ("a.npz", npz_of("lines.npy", "<f8", "(99999999999, 2, 2)", &[0; 8]), "shape"),
            ("a.npz", npz_of("lines.npy", "<f8", "(4294967296, 4294967296, 2)", &[0; 8]), "more numbers"),
            ("a.npz", npz_of("lines.npy", "<f8", &"(".repeat(9000), &[0; 8]), "nests deeper"),
            ("a.txt", b"3\n1 2 3 4\n".to_vec(), "announces 3"),
            ("a.txt", b"1\n1 2 nan 4\n".to_vec(), "finite"),
            ("a.txt", b"1\n1 2 x 4\n".to_vec(), "line 2"),
        ] {
            let (_dir, path) = written(name, &bytes);
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains(word) && error.contains(name), "{word}: {error}");
        }
    }
}
