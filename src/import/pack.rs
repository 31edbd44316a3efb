//! Bytes that are packed.

use std::io::{self, Read};

/// How bytes are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Packing {
    /// LZ4, in frames.
    Lz4,
    /// Zstandard, one frame.
    Zstd,
    /// LZFSE, Apple's.
    Lzfse,
}

impl Packing {
    /// Hands a reader of what is packed to `read`.
    ///
    /// # Errors
    /// Where the bytes are packed in another way, or `read` fails.
    pub fn unpack<T>(self, packed: &[u8], read: impl FnOnce(&mut dyn Read) -> io::Result<T>) -> io::Result<T> {
        match self {
            Self::Lz4 => {
                let mut reader = lz4_flex::frame::FrameDecoder::new(packed);
                read(&mut reader)
            }
            Self::Zstd => {
                let mut reader = ruzstd::decoding::StreamingDecoder::new(packed).map_err(io::Error::other)?;
                read(&mut reader)
            }
            Self::Lzfse => {
                let mut decoder = lzfse_rust::LzfseRingDecoder::default();
                let mut reader = decoder.reader_bytes(packed);
                read(&mut reader)
            }
        }
    }
}
