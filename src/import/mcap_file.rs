//! MCAP files: messages of the topics that are wanted, in the order of the file. One chunk at a time is unpacked, and images
//! stay where they are.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use super::blob::{Blob, MAX_BLOB_BYTES, Packing};
use crate::error::{Error, Result};

/// The first bytes of a file.
pub const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";
/// What is read of an image: what stands before its pixels is a tenth of that.
const HEAD_BYTES: u64 = 4096;
/// The longest schema, channel or whole message that is read. Transforms and cameras have some kilobytes.
const MAX_RECORD_BYTES: u64 = 16 << 20;
/// Opcode and length.
const RECORD_BYTES: u64 = 9;
/// Channel, number and two times before a message's bytes.
const MESSAGE_BYTES: u64 = 22;

/// The longest name of a packing, bytes.
const LONGEST_PACKING: u32 = 64;

const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const DATA_END: u8 = 0x0F;

/// A channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Its topic.
    pub topic: String,
    /// Name of its messages' type.
    pub schema: String,
    /// How its messages are encoded: `cdr` for ROS 2.
    pub encoding: String,
}

/// What is wanted of a channel's messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Want {
    /// Nothing.
    Nothing,
    /// The first kilobytes.
    Head,
    /// All bytes.
    Whole,
}

/// A message.
pub struct McapMessage<'a> {
    /// Its channel.
    pub channel: &'a Channel,
    /// When it was recorded, nanoseconds.
    pub log_time_ns: u64,
    /// Its bytes, or the first of them.
    pub bytes: &'a [u8],
    home: &'a Home,
    start: u64,
    length: u64,
}

impl McapMessage<'_> {
    /// Where so many bytes of it are, from its byte `start` on; `None` where it ends before.
    #[must_use]
    pub fn piece(&self, start: usize, length: usize) -> Option<Blob> {
        let end = start.checked_add(length)? as u64;
        (end <= self.length).then(|| self.home.piece(self.start.saturating_add(start as u64), length as u64))
    }
}

/// Who takes the messages.
pub trait Visitor {
    /// What is wanted of a channel; asked once a channel.
    fn want(&mut self, channel: &Channel) -> Want;
    /// Takes a message of a channel of which something is wanted.
    fn take(&mut self, message: &McapMessage<'_>);
}

/// What the bytes that are walked through belong to.
enum Home {
    /// The file itself.
    File(PathBuf),
    /// A chunk that is not packed.
    Stored(PathBuf),
    /// A packed chunk.
    Packed(Blob, Packing),
}

impl Home {
    fn piece(&self, offset: u64, length: u64) -> Blob {
        match self {
            Self::File(file) | Self::Stored(file) => Blob::Range { file: file.clone(), offset, length },
            Self::Packed(outer, packing) => {
                Blob::Packed { outer: Box::new(outer.clone()), packing: *packing, start: offset, length: Some(length) }
            }
        }
    }
}

/// Hands the messages of a file to a visitor. What is told is what could not be read: a file that ends early, chunks that do
/// not unpack.
///
/// # Errors
/// Where the file cannot be read, is no MCAP, or is built wrongly.
pub fn scan(path: &Path, visitor: &mut dyn Visitor) -> Result<Vec<String>> {
    let file = File::open(path).map_err(|e| Error::io(path, &e))?;
    let end = file.metadata().map_err(|e| Error::io(path, &e))?.len();
    let mut stream = PositionedReader { reader: BufReader::new(file), at: 0 };
    let magic = stream.bytes(MAGIC.len() as u64).unwrap_or_default();
    if magic != MAGIC {
        return Err(Error::format(path, "first bytes", "this is no MCAP file; was it copied as a whole?"));
    }
    let mut scan = Scan { path, schemas: BTreeMap::new(), channels: BTreeMap::new(), visitor, faults: Vec::new() };
    if !scan.walk(&mut stream, end, &Home::File(path.to_owned()))? {
        scan.faults.push(
            "the file ends in the middle of a record: what stands before is read, `mcap recover` mends it".to_owned(),
        );
    }
    Ok(scan.faults)
}

/// A reader that knows where it is.
struct PositionedReader<R> {
    reader: R,
    at: u64,
}

impl<R: Read + Seek> PositionedReader<R> {
    fn bytes(&mut self, count: u64) -> std::io::Result<Vec<u8>> {
        let mut out = Vec::new();
        let read = Read::take(&mut self.reader, count).read_to_end(&mut out)? as u64;
        self.at = self.at.saturating_add(read);
        if read < count { Err(std::io::ErrorKind::UnexpectedEof.into()) } else { Ok(out) }
    }

    fn go(&mut self, to: u64) -> std::io::Result<()> {
        let step = i64::try_from(i128::from(to) - i128::from(self.at)).map_err(std::io::Error::other)?;
        self.reader.seek_relative(step)?;
        self.at = to;
        Ok(())
    }
}

struct Scan<'a> {
    path: &'a Path,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, (Channel, Want)>,
    visitor: &'a mut dyn Visitor,
    faults: Vec<String>,
}

impl Scan<'_> {
    fn broken(&self, at: u64, what: &str) -> Error {
        Error::format(
            self.path,
            format!("byte {at}"),
            format!("{what} is built wrongly; `mcap doctor FILE` tells more"),
        )
    }

    fn io(&self, e: &std::io::Error) -> Error {
        Error::io(self.path, e)
    }

    /// Walks through records up to `end`; whether the last one is whole.
    fn walk<R: Read + Seek>(&mut self, stream: &mut PositionedReader<R>, end: u64, home: &Home) -> Result<bool> {
        while stream.at < end {
            if end - stream.at < RECORD_BYTES {
                return Ok(false);
            }
            let head = stream.bytes(RECORD_BYTES).map_err(|e| self.io(&e))?;
            let mut fields = Fields(&head);
            let (Some([opcode]), Some(length)) = (fields.take::<1>(), fields.u64()) else { return Ok(false) };
            let body = stream.at;
            let Some(next) = body.checked_add(length).filter(|next| *next <= end) else { return Ok(false) };
            match opcode {
                FOOTER | DATA_END => return Ok(true),
                SCHEMA | CHANNEL if length <= MAX_RECORD_BYTES => {
                    let bytes = stream.bytes(length).map_err(|e| self.io(&e))?;
                    let known = if opcode == SCHEMA { self.schema(&bytes) } else { self.channel(&bytes) };
                    known.ok_or_else(|| self.broken(body, "a schema or a channel"))?;
                }
                MESSAGE => self.message(stream, next, home)?,
                CHUNK if matches!(home, Home::File(_)) => self.chunk(stream, next, home)?,
                _ => {}
            }
            stream.go(next).map_err(|e| self.io(&e))?;
        }
        Ok(true)
    }

    fn schema(&mut self, bytes: &[u8]) -> Option<()> {
        let mut fields = Fields(bytes);
        let (id, name) = (fields.u16()?, fields.text()?);
        self.schemas.insert(id, name);
        Some(())
    }

    fn channel(&mut self, bytes: &[u8]) -> Option<()> {
        let mut fields = Fields(bytes);
        let (id, schema, topic, encoding) = (fields.u16()?, fields.u16()?, fields.text()?, fields.text()?);
        // Chunks repeat the channels that they use.
        if let Entry::Vacant(place) = self.channels.entry(id) {
            let channel = Channel { topic, schema: self.schemas.get(&schema).cloned().unwrap_or_default(), encoding };
            let want = self.visitor.want(&channel);
            place.insert((channel, want));
        }
        Some(())
    }

    fn message<R: Read + Seek>(&mut self, stream: &mut PositionedReader<R>, next: u64, home: &Home) -> Result<()> {
        let body = stream.at;
        let Some(length) = (next - body).checked_sub(MESSAGE_BYTES) else {
            return Err(self.broken(body, "a message"));
        };
        let head = stream.bytes(MESSAGE_BYTES).map_err(|e| self.io(&e))?;
        let mut fields = Fields(&head);
        let (Some(id), Some(_), Some(log_time_ns)) = (fields.u16(), fields.u32(), fields.u64()) else {
            return Err(self.broken(body, "a message"));
        };
        let Some((channel, want)) = self.channels.get(&id) else { return Ok(()) };
        let count = match want {
            Want::Nothing => return Ok(()),
            Want::Head => length.min(HEAD_BYTES),
            Want::Whole => length.min(MAX_RECORD_BYTES),
        };
        let start = stream.at;
        let bytes = stream.bytes(count).map_err(|e| Error::io(self.path, &e))?;
        self.visitor.take(&McapMessage { channel, log_time_ns, bytes: &bytes, home, start, length });
        Ok(())
    }

    fn chunk<R: Read + Seek>(&mut self, stream: &mut PositionedReader<R>, next: u64, home: &Home) -> Result<()> {
        let body = stream.at;
        // Two times, the size of what is packed, its checksum, the length of the packing's name.
        let head = stream.bytes((next - body).min(32)).map_err(|e| self.io(&e))?;
        let mut fields = Fields(&head);
        let (Some(_), Some(_), Some(size), Some(_), Some(name)) =
            (fields.u64(), fields.u64(), fields.u64(), fields.u32(), fields.u32())
        else {
            return Err(self.broken(body, "a chunk"));
        };
        if name > LONGEST_PACKING {
            return Err(self.broken(body, "a chunk"));
        }
        let rest = (next - stream.at).min(u64::from(name) + 8);
        let rest = stream.bytes(rest).map_err(|e| self.io(&e))?;
        let mut fields = Fields(&rest);
        let (Some(name), Some(packed)) = (fields.bytes(name as usize), fields.u64()) else {
            return Err(self.broken(body, "a chunk"));
        };
        let start = stream.at;
        let Some(end) = start.checked_add(packed).filter(|end| *end <= next) else {
            return Err(self.broken(body, "a chunk"));
        };
        let packing = match name {
            b"" => return self.walk(stream, end, &Home::Stored(self.path.to_owned())).map(|_| ()),
            b"lz4" => Packing::Lz4,
            b"zstd" => Packing::Zstd,
            other => {
                let name = String::from_utf8_lossy(other);
                let message =
                    format!("a chunk is packed with {name}; write it with `mcap compress --compression zstd`");
                return Err(Error::format(self.path, format!("byte {body}"), message));
            }
        };
        if size > MAX_BLOB_BYTES {
            let message = format!("a chunk of {size} bytes; write it with `mcap compress --chunk-size 4194304`");
            return Err(Error::format(self.path, format!("byte {body}"), message));
        }
        let outer = home.piece(start, packed);
        let whole = Blob::Packed { outer: Box::new(outer.clone()), packing, start: 0, length: Some(size) };
        // One bad chunk costs only itself.
        let walked = whole.read().and_then(|bytes| {
            let mut inner = PositionedReader { reader: Cursor::new(bytes), at: 0 };
            self.walk(&mut inner, size, &Home::Packed(outer, packing))
        });
        match walked {
            Ok(true) => {}
            Ok(false) => self.faults.push(format!("the chunk at byte {body} ends in the middle of a record")),
            Err(error) => self.faults.push(error.to_string()),
        }
        Ok(())
    }
}

/// Fields of a record, from the front; `None` where it ends.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (front, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(front)
    }

    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    fn u16(&mut self) -> Option<u16> {
        self.take().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn text(&mut self) -> Option<String> {
        let count = self.u32()? as usize;
        Some(String::from_utf8_lossy(self.bytes(count)?).into_owned())
    }
}
