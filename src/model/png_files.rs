//! Whether a PNG is one and whole, as far as its chunks tell: nothing is unpacked, so that pictures of any size cost nothing.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// How every PNG begins.
const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
/// Length, name and checksum of a chunk, bytes.
const AROUND: u64 = 12;
/// Chunks that are looked at; no picture has as many.
const MAX_CHUNKS: usize = 1_000_000;
/// The type of colour that needs a palette.
const PALETTE: u8 = 3;

/// Why a file is no whole PNG, in words behind its name; `None` where it is one.
pub(super) fn broken_png(path: &Path) -> Option<&'static str> {
    let Ok(size) = std::fs::metadata(path).map(|m| m.len()) else { return Some("cannot be read") };
    let Ok(file) = File::open(path) else { return Some("cannot be read") };
    chunks(&mut BufReader::new(file), size).err()
}

/// Goes through the chunks of a PNG of `size` bytes.
fn chunks(file: &mut (impl Read + Seek), size: u64) -> Result<(), &'static str> {
    const NONE: &str = "is no PNG, whatever its name says";
    const CUT: &str = "is a PNG that is cut off";
    let mut signature = [0; 8];
    if size == 0 {
        return Err("is empty");
    }
    file.read_exact(&mut signature).map_err(|_| NONE)?;
    if signature != SIGNATURE {
        return Err(NONE);
    }
    let (mut at, mut needs_palette, mut has_palette, mut has_data) = (8u64, false, false, false);
    for number in 0..MAX_CHUNKS {
        let mut head = [0; 8];
        file.read_exact(&mut head).map_err(|_| CUT)?;
        let [a, b, c, d, name @ ..] = head;
        let length = u64::from(u32::from_be_bytes([a, b, c, d]));
        at += AROUND + length;
        if at > size {
            return Err(CUT);
        }
        let mut read = 0;
        match (&name, number) {
            (b"IHDR", 0) if length == 13 => {
                let mut header = [0; 13];
                file.read_exact(&mut header).map_err(|_| CUT)?;
                read = length;
                if header[..4] == [0; 4] || header[4..8] == [0; 4] {
                    return Err("is a PNG without pixels");
                }
                needs_palette = header[9] == PALETTE;
            }
            (_, 0) => return Err("is a PNG without its header"),
            (b"PLTE", _) => has_palette = true,
            (b"IDAT", _) => has_data = true,
            (b"IEND", _) => {
                return match (has_data, needs_palette && !has_palette) {
                    (false, _) => Err("is a PNG without pixels"),
                    (true, true) => Err("is a PNG without its palette"),
                    (true, false) => Ok(()),
                };
            }
            _ => {}
        }
        // To the next chunk, over what was not read and the checksum.
        let rest = i64::try_from(length - read + 4).map_err(|_| CUT)?;
        file.seek(SeekFrom::Current(rest)).map_err(|_| CUT)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    /// A PNG of one pixel.
    fn pixel() -> Vec<u8> {
        let mut bytes = Vec::new();
        let picture = image::RgbImage::from_pixel(1, 1, image::Rgb([1, 2, 3]));
        picture.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
        bytes
    }

    fn said(bytes: &[u8]) -> Option<&'static str> {
        chunks(&mut Cursor::new(bytes), bytes.len() as u64).err()
    }

    #[test]
    fn a_whole_picture_is_told_from_a_part_of_one() {
        let good = pixel();
        assert_eq!(said(&good), None);
        assert_eq!(said(&[&good[..], b"more"].concat()), None);
        for length in 1..good.len() {
            assert!(said(&good[..length]).is_some(), "{length} of {} bytes", good.len());
        }
        let mut indexed = good.clone();
        indexed[25] = PALETTE;
        let mut flat = good.clone();
        flat[16..20].fill(0);
        let cases: [(&[u8], &str); 6] = [
            (b"", "is empty"),
            (b"not a png", "is no PNG"),
            (b"\xff\xd8\xff\xe0", "is no PNG"),
            (&good[..good.len() - 5], "cut off"),
            (&indexed, "without its palette"),
            (&flat, "without pixels"),
        ];
        for (bytes, word) in cases {
            assert!(said(bytes).is_some_and(|said| said.contains(word)), "{word}: {:?}", said(bytes));
        }
    }
}
