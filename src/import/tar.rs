//! Entries of a tar archive, where they stand in it. Nothing is unpacked.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::blob::Blob;
use crate::error::{Error, Result};

/// Bytes of a header, and the step of all sizes.
const BLOCK: u64 = 512;

/// Names and bytes of all files in an archive, in its order. Names are never used as paths on disk. An archive that ends early
/// gives the entries before its end.
///
/// # Errors
/// Where the file cannot be read or is no tar archive.
pub fn entries(archive: &Path) -> Result<Vec<(String, Blob)>> {
    let file = File::open(archive).map_err(|e| Error::io(archive, &e))?;
    let total = file.metadata().map_err(|e| Error::io(archive, &e))?.len();
    let mut reader = BufReader::new(file);
    let mut out = Vec::new();
    let mut at = 0u64;
    while at.saturating_add(BLOCK) <= total {
        let mut header = [0u8; BLOCK as usize];
        reader.seek(SeekFrom::Start(at)).map_err(|e| Error::io(archive, &e))?;
        reader.read_exact(&mut header).map_err(|e| Error::io(archive, &e))?;
        // Two empty blocks end an archive.
        if header.iter().all(|b| *b == 0) {
            break;
        }
        let fault =
            || Error::format(archive, format!("byte {at}"), "is no header of a tar archive; was it copied as a whole?");
        if sum(&header) != octal(header.get(148..156).unwrap_or_default()) {
            return Err(fault());
        }
        let length = octal(header.get(124..136).unwrap_or_default()).ok_or_else(fault)?;
        let offset = at + BLOCK;
        let is_file = matches!(header.get(156), Some(b'0' | 0));
        if is_file && offset.saturating_add(length) <= total {
            let name = text(header.get(..100).unwrap_or_default());
            out.push((name, Blob::Range { file: archive.to_owned(), offset, length }));
        }
        at = offset.saturating_add(length.div_ceil(BLOCK).saturating_mul(BLOCK));
    }
    Ok(out)
}

/// The checksum of a header: the sum of its bytes, its own field taken as spaces.
fn sum(header: &[u8]) -> Option<u64> {
    let byte = |(i, b): (usize, &u8)| if (148..156).contains(&i) { 32 } else { u64::from(*b) };
    Some(header.iter().enumerate().map(byte).sum())
}

/// Text up to the first zero byte.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(bytes.get(..end).unwrap_or_default()).trim().to_owned()
}

fn octal(bytes: &[u8]) -> Option<u64> {
    u64::from_str_radix(&text(bytes), 8).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, bytes: &[u8]) -> Vec<u8> {
        let mut header = [0u8; 512];
        header[..name.len()].copy_from_slice(name.as_bytes());
        header[124..135].copy_from_slice(format!("{:011o}", bytes.len()).as_bytes());
        header[156] = b'0';
        let sum: u64 = header.iter().map(|b| u64::from(*b)).sum::<u64>() + 8 * 32;
        header[148..154].copy_from_slice(format!("{sum:06o}").as_bytes());
        header[155] = b' ';
        let padding = vec![0; bytes.len().next_multiple_of(512) - bytes.len()];
        [header.to_vec(), bytes.to_vec(), padding].concat()
    }

    #[test]
    fn entries_are_read_where_they_stand() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("PV.tar");
        let whole = [entry("1.bytes", b"abc"), entry("2.bytes", &[7; 600]), vec![0; 1024]].concat();
        std::fs::write(&path, &whole).unwrap();
        let found = entries(&path).unwrap();
        let names: Vec<&str> = found.iter().map(|(n, _)| n.as_str()).collect();
        assert_eq!(names, ["1.bytes", "2.bytes"]);
        assert_eq!((found[0].1.read().unwrap(), found[1].1.read().unwrap().len()), (b"abc".to_vec(), 600));
        // Cut within the second file.
        std::fs::write(&path, &whole[..1600]).unwrap();
        assert_eq!(entries(&path).unwrap().len(), 1);
        std::fs::write(&path, [9u8; 600]).unwrap();
        assert!(entries(&path).unwrap_err().to_string().contains("PV.tar: byte 0"));
    }
}
