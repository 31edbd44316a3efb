//! How large anything may claim to be before memory of that size is asked for.

/// Above this no single image or array of a recording is believed: a 4K float depth image has 33 MB.
pub const MAX_BLOB_BYTES: u64 = 256 << 20;

/// Numbers that one byte of a file can stand for: deflate makes at most 1032 bytes of one, run lengths of wavelets more.
pub(super) const MOST_OF_A_BYTE: usize = 32 << 10;
/// More pixels than any camera here has.
pub(super) const MAX_PIXELS: usize = 64 << 20;
