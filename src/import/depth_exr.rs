//! Depth in OpenEXR images: which channel it is, and where in the image.
//!
//! Networks write one channel `Y` or `Z`, renderers many (`ViewLayer.Depth.Z` among colours), some tools the same values as red,
//! green and blue. Numbers are floats of 16 or 32 bits; the data may be a window of the image.

use std::io::Cursor;

use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Layer, MetaData, ReadChannels, ReadLayers};

use super::believable::{MAX_PIXELS, MOST_OF_A_BYTE};
use super::blob::Blob;
use crate::error::{Error, Result};
use crate::recording::Grid;

/// A layer of an image.
type FlatLayer = Layer<AnyChannels<FlatSamples>>;

/// The numbers of the channel that is depth, of the whole image; 0 where the file has no data.
pub(super) fn read(blob: &Blob) -> Result<Grid<f32>> {
    let bytes = blob.read()?;
    // The header's word is checked before anything of its size is made.
    let meta = MetaData::read_from_buffered(Cursor::new(&bytes), false).map_err(|e| broken(blob, &e))?;
    let pixels = meta
        .headers
        .iter()
        .map(|h| h.layer_size.0.saturating_mul(h.layer_size.1).saturating_mul(h.channels.list.len()))
        .fold(0, usize::saturating_add);
    if meta.headers.iter().any(|h| h.deep) {
        return Err(blob.fault("holds several samples a pixel (deep data); write it flat"));
    }
    believable(blob, pixels, bytes.len())?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(&bytes))
        .map_err(|e| broken(blob, &e))?;
    let (layer, channel) = chosen(blob, &image.layer_data)?;
    let data: Vec<f32> = match &channel.sample_data {
        FlatSamples::U32(_) => {
            let message =
                format!("has whole numbers in channel {}, of no known unit; write metres as floats", channel.name);
            return Err(blob.fault(message));
        }
        floats => floats.values_as_f32().collect(),
    };
    let size = [layer.size.0, layer.size.1];
    if data.is_empty() || size[0].checked_mul(size[1]) != Some(data.len()) {
        return Err(blob.fault(format!("has a channel {} of another size than the image", channel.name)));
    }
    let window = &image.attributes.display_window;
    let full = [window.size.0, window.size.1];
    let (at, from) = (layer.attributes.layer_position, window.position);
    let offset = [i64::from(at.0) - i64::from(from.0), i64::from(at.1) - i64::from(from.1)];
    if !meets(size, offset, full) || (size == full && offset == [0; 2]) {
        return Ok(Grid { width: size[0], height: size[1], data });
    }
    believable(blob, full[0].saturating_mul(full[1]), bytes.len())?;
    Ok(placed(&data, size, offset, full))
}

fn broken(blob: &Blob, error: &exr::error::Error) -> Error {
    let way_out = match error {
        exr::error::Error::NotSupported(_) => "; write it flat, with ZIP compression",
        _ => "",
    };
    blob.fault(format!("is no OpenEXR image that can be read ({error}){way_out}"))
}

/// Refuses more numbers than an image has, or than the bytes can hold.
fn believable(blob: &Blob, pixels: usize, bytes: usize) -> Result<()> {
    if pixels > MAX_PIXELS {
        return Err(blob.fault(format!("claims {pixels} numbers; depth has one channel")));
    }
    if pixels > bytes.saturating_mul(MOST_OF_A_BYTE) {
        return Err(blob.fault(format!("claims {pixels} numbers, too many for its {bytes} bytes; is it cut off?")));
    }
    Ok(())
}

/// How plainly a name says depth, 0 the most; `None` where it does not.
fn rank(layer: &str, channel: &str) -> Option<usize> {
    let says = |name: &str| name.split('.').any(|part| part.eq_ignore_ascii_case("depth"));
    if says(channel) || says(layer) {
        return Some(0);
    }
    ["Z", "Y", "V", "R"].iter().position(|name| channel.eq_ignore_ascii_case(name)).map(|at| at + 1)
}

/// The channel that is depth: the one whose name says so, else the only one.
fn chosen<'a>(blob: &Blob, layers: &'a [FlatLayer]) -> Result<(&'a FlatLayer, &'a AnyChannel<FlatSamples>)> {
    let all: Vec<(&FlatLayer, &AnyChannel<FlatSamples>)> =
        layers.iter().flat_map(|l| l.channel_data.list.iter().map(move |c| (l, c))).collect();
    let name = |layer: &FlatLayer| layer.attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
    let named =
        all.iter().filter_map(|&(l, c)| Some((rank(&name(l), &c.name.to_string())?, l, c))).min_by_key(|found| found.0);
    match (named, all.as_slice()) {
        (Some((_, layer, channel)), _) if is_coloured(layer, channel) => Err(blob.fault(format!(
            "is a colour picture: channel {} differs from the others; depth has one channel",
            channel.name
        ))),
        (Some((_, layer, channel)), _) => Ok((layer, channel)),
        (None, [(layer, channel)]) => Ok((*layer, *channel)),
        (None, []) => Err(blob.fault("has no channel")),
        (None, many) => {
            let names: Vec<String> = many.iter().take(6).map(|(_, c)| c.name.to_string()).collect();
            let message = format!("has the channels {}, none of which is called Z, Y or depth", names.join(", "));
            Err(blob.fault(message))
        }
    }
}

/// Whether a channel is the red one of a picture with other greens.
fn is_coloured(layer: &FlatLayer, channel: &AnyChannel<FlatSamples>) -> bool {
    let is = |c: &AnyChannel<FlatSamples>, name: &str| c.name.to_string().eq_ignore_ascii_case(name);
    let green = layer.channel_data.list.iter().find(|c| is(c, "G"));
    let bits = |c: &AnyChannel<FlatSamples>| -> Vec<u32> { c.sample_data.values_as_f32().map(f32::to_bits).collect() };
    is(channel, "R") && green.is_some_and(|green| bits(green) != bits(channel))
}

/// Whether a window of data at an offset has pixels of the image.
fn meets(size: [usize; 2], offset: [i64; 2], full: [usize; 2]) -> bool {
    size.iter().zip(offset).zip(full).all(|((size, offset), full)| {
        let end = i64::try_from(*size).unwrap_or(i64::MAX).saturating_add(offset);
        end > 0 && offset < i64::try_from(full).unwrap_or(i64::MAX)
    })
}

/// A window of data in the whole image. The window has pixels.
fn placed(data: &[f32], size: [usize; 2], offset: [i64; 2], full: [usize; 2]) -> Grid<f32> {
    let mut out = Grid::filled(full[0], full[1], 0.0f32);
    let at = |index: usize, offset: i64, full: usize| {
        let moved = i64::try_from(index).ok()?.checked_add(offset)?;
        usize::try_from(moved).ok().filter(|i| *i < full)
    };
    for (row, values) in data.chunks(size[0].max(1)).enumerate() {
        let Some(y) = at(row, offset[1], full[1]) else { continue };
        for (column, value) in values.iter().enumerate() {
            let slot = at(column, offset[0], full[0]).and_then(|x| out.data.get_mut(y * full[0] + x));
            if let Some(slot) = slot {
                *slot = *value;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use exr::prelude::{
        Blocks, Compression, Encoding, Image, ImageAttributes, IntegerBounds, LayerAttributes, LineOrder, SmallVec,
        Vec2, WritableImage, f16,
    };

    use super::*;

    const WIDTH: usize = 37;
    const HEIGHT: usize = 21;

    /// Metres of a slanted floor.
    fn metres(i: usize) -> f32 {
        1.0 + 0.01 * (i % WIDTH) as f32 + 0.03 * (i / WIDTH) as f32
    }

    fn floats() -> FlatSamples {
        FlatSamples::F32((0..WIDTH * HEIGHT).map(metres).collect())
    }

    fn halves() -> FlatSamples {
        FlatSamples::F16((0..WIDTH * HEIGHT).map(|i| f16::from_f32(metres(i))).collect())
    }

    fn other() -> FlatSamples {
        FlatSamples::F32(vec![0.25; WIDTH * HEIGHT])
    }

    /// A file of one layer of some channels.
    fn file(channels: Vec<(&str, FlatSamples)>, encoding: Encoding) -> Blob {
        let list: SmallVec<[AnyChannel<FlatSamples>; 4]> =
            channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
        let channels = AnyChannels::sort(list);
        let layer = Layer::new((WIDTH, HEIGHT), LayerAttributes::default(), encoding, channels);
        let image = Image::from_layer(layer);
        let mut bytes = Vec::new();
        image.write().to_buffered(Cursor::new(&mut bytes)).unwrap();
        Blob::Inline(bytes.into())
    }

    fn furthest(grid: &Grid<f32>) -> f32 {
        assert_eq!((grid.width, grid.height), (WIDTH, HEIGHT));
        grid.data.iter().enumerate().map(|(i, z)| (z / metres(i) - 1.0).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn every_compression_number_and_block_that_can_be_written_is_read() {
        use Compression::{B44, B44A, PIZ, PXR24, RLE, Uncompressed, ZIP1, ZIP16};
        for compression in [Uncompressed, RLE, ZIP1, ZIP16, PIZ, PXR24, B44, B44A] {
            for (blocks, line_order) in
                [(Blocks::ScanLines, LineOrder::Increasing), (Blocks::Tiles(Vec2(16, 8)), LineOrder::Unspecified)]
            {
                for (samples, step) in [(floats(), 0.0), (halves(), 6e-4f32)] {
                    // PXR24 keeps 24 bits of 32; B44 a block of halves to a few bits.
                    let lost = match (compression, &samples) {
                        (PXR24, FlatSamples::F32(_)) => 1e-4,
                        (B44 | B44A, FlatSamples::F16(_)) => 0.03,
                        _ => 0.0,
                    };
                    let blob = file(vec![("Y", samples)], Encoding { compression, blocks, line_order });
                    let off = furthest(&read(&blob).unwrap());
                    assert!(off <= step + lost, "{compression:?} {blocks:?}: {off}");
                }
            }
        }
    }

    #[test]
    fn depth_is_told_from_other_channels_by_its_name() {
        let right: [&[&str]; 8] = [
            // The first name is depth's.
            &["Y"],
            &["Z"],
            &["R"],
            &["anything"],
            &["Z", "A", "B", "G", "R"],
            &["ViewLayer.Depth.Z", "ViewLayer.Combined.R", "ViewLayer.Normal.Z", "Y"],
            &["depth", "confidence"],
            &["Y", "A"],
        ];
        for names in right {
            let channels =
                names.iter().enumerate().map(|(i, n)| (*n, if i == 0 { floats() } else { other() })).collect();
            let grid = read(&file(channels, Encoding::SMALL_LOSSLESS)).unwrap();
            assert_eq!(furthest(&grid), 0.0, "{names:?}");
        }
        // Grey written as colours, with an alpha that is before them in the file.
        let grey = vec![("A", other()), ("B", floats()), ("G", floats()), ("R", floats())];
        assert_eq!(furthest(&read(&file(grey, Encoding::SMALL_LOSSLESS)).unwrap()), 0.0);
    }

    #[test]
    fn what_is_no_depth_is_refused_with_its_channels() {
        let whole = FlatSamples::U32(vec![1500; WIDTH * HEIGHT]);
        let wrong: [(Vec<(&str, FlatSamples)>, &str); 3] = [
            (vec![("R", floats()), ("G", other()), ("B", other())], "a colour picture"),
            (vec![("u", floats()), ("w", other())], "the channels u, w, none of which"),
            (vec![("Z", whole)], "whole numbers in channel Z"),
        ];
        for (channels, words) in wrong {
            let error = read(&file(channels, Encoding::SMALL_LOSSLESS)).unwrap_err().to_string();
            assert!(error.contains(words), "{words}: {error}");
        }
    }

    #[test]
    fn a_window_of_data_lies_where_it_says_in_the_image() {
        let window = |position: (i32, i32)| {
            let mut list = SmallVec::new();
            list.push(AnyChannel::new("Y", FlatSamples::F32(vec![2.0; 6])));
            let attributes = LayerAttributes::default().with_position(Vec2(position.0, position.1));
            let layer = Layer::new((3usize, 2usize), attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(list));
            let full = ImageAttributes::new(IntegerBounds::new((0i32, 0i32), (5usize, 4usize)));
            let image = Image::new(full, layer);
            let mut bytes = Vec::new();
            image.write().to_buffered(Cursor::new(&mut bytes)).unwrap();
            read(&Blob::Inline(bytes.into())).unwrap()
        };
        let inside = window((1, 2));
        assert_eq!((inside.width, inside.height), (5, 4));
        let filled: Vec<usize> = (0..20).filter(|i| inside.data[*i] > 0.0).collect();
        assert_eq!(filled, [11, 12, 13, 16, 17, 18]);
        // Half of it is outside.
        let cut = window((4, -1));
        assert_eq!((0..20).filter(|i| cut.data[*i] > 0.0).collect::<Vec<_>>(), [4]);
    }
}
