//! Tile-compressed images, stored in a table.
//!
//! Tiles are decoded and encoded by the crate fitsio-pure; this module validates the declarations of a file before decoding, and
//! keeps the header cards that do not belong to the compression.
//!
//! Source: FITS standard 4.0, section 10.

use fitsio_pure::block::{BLOCK_SIZE, CARD_SIZE};
use fitsio_pure::compress::{CompressPixel, TileCompression, compress_image_hdu};
use fitsio_pure::header::{Card, format_card};
use fitsio_pure::image::ImageData;
use fitsio_pure::value::Value;

use super::{Hdu, HduKind};

/// Supported algorithms.
const KNOWN: [&str; 4] = ["RICE_1", "RICE_ONE", "GZIP_1", "GZIP_2"];

/// Maximum number of pixels: the range of a tile's counter.
const MOST_PIXELS: u64 = i32::MAX as u64;

/// Maximum number of pixels per byte of the file: that of a constant image compressed by gzip.
const MOST_PIXELS_PER_BYTE: u64 = 5000;

/// The kind of an HDU with `ZIMAGE = T`.
///
/// # Errors
/// If its keywords contradict the standard, or each other, in words.
pub(super) fn kind(hdu: &Hdu) -> Result<HduKind, String> {
    if !hdu.header.text("ZCMPTYPE")?.is_some_and(|algorithm| KNOWN.contains(&algorithm.as_str())) {
        return Ok(HduKind::Compressed);
    }
    let bitpix = hdu.integer("ZBITPIX")?;
    if ![8, 16, 32, 64, -32, -64].contains(&bitpix) {
        return Err(format!("ZBITPIX = {bitpix}: 8, 16, 32, 64, -32 or -64 is needed"));
    }
    let axes = hdu.natural("ZNAXIS", 999)?;
    let lengths = (1..=axes).map(|axis| hdu.natural(&format!("ZNAXIS{axis}"), MOST_PIXELS));
    let lengths = lengths.collect::<Result<Vec<u64>, String>>()?;
    let pixels = lengths.iter().try_fold(1_u64, |product, length| product.checked_mul(*length));
    let most = MOST_PIXELS.min(hdu.data_len.saturating_mul(MOST_PIXELS_PER_BYTE));
    if axes == 0 || pixels == Some(0) {
        return Ok(HduKind::Empty);
    }
    if pixels.is_none_or(|pixels| pixels > most) {
        return Err("its compressed axes make more pixels than its tiles can hold".into());
    }
    let [columns, rows] = lengths[..] else { return Ok(HduKind::OtherAxes(lengths.len())) };
    check(hdu)?;
    Ok(HduKind::Image { rows: rows as usize, columns: columns as usize, bitpix })
}

/// Checks the parameters used in decoding.
fn check(hdu: &Hdu) -> Result<(), String> {
    let given = |keyword: &str, least: u64, most: u64| match hdu.header.value(keyword)? {
        None => Ok(()),
        Some(_) => match hdu.natural(keyword, most)? {
            value if value < least => Err(format!("{keyword} = {value}: {least} to {most} is allowed")),
            _ => Ok(()),
        },
    };
    given("ZDITHER0", 1, 10_000)?;
    for axis in 1..=2 {
        given(&format!("ZTILE{axis}"), 1, MOST_PIXELS)?;
    }
    if hdu.header.text("ZCMPTYPE")?.is_some_and(|algorithm| algorithm.starts_with("RICE")) {
        // Pixels per Rice block, and bytes per pixel, in either order.
        given("ZVAL1", 1, 1 << 16)?;
        given("ZVAL2", 1, 1 << 16)?;
    }
    let (width, tiles) = (hdu.natural("NAXIS1", 1 << 20)?, hdu.natural("NAXIS2", MOST_PIXELS)?);
    let heap = width * tiles;
    if hdu.header.value("THEAP")?.is_some() && hdu.natural("THEAP", 1 << 60)? != heap {
        return Err("there is a gap between its table and its tiles (THEAP), which is not read".into());
    }
    Ok(())
}

/// Checks that every tile is where the table says, and that the table has as many as the image.
///
/// # Errors
/// The fault, in words.
pub(super) fn check_tiles(hdu: &Hdu, data: &[u8]) -> Result<(), String> {
    let (width, tiles) = (hdu.natural("NAXIS1", 1 << 20)? as usize, hdu.natural("NAXIS2", MOST_PIXELS)? as usize);
    let heap = width * tiles;
    let needed: u64 = (1..=2)
        .map(|axis| {
            let length = hdu.natural(&format!("ZNAXIS{axis}"), MOST_PIXELS)?;
            let whole = if axis == 1 { length } else { 1 };
            let tile = hdu.natural(&format!("ZTILE{axis}"), MOST_PIXELS).unwrap_or(whole);
            Ok(length.div_ceil(tile.max(1)))
        })
        .product::<Result<u64, String>>()?;
    if needed != tiles as u64 {
        return Err(format!("its table has {tiles} tiles, and the image {needed}"));
    }
    let mut offset = 0;
    for field in 1..=hdu.natural("TFIELDS", 999)? {
        let form = hdu.header.text(&format!("TFORM{field}"))?.unwrap_or_default();
        let digits = form.chars().take_while(char::is_ascii_digit).count();
        let repeat: usize = if digits == 0 { 1 } else { form[..digits].parse().map_err(|_| wrong(&form))? };
        let mut kind = form[digits..].chars();
        let (bytes, element) = match kind.next() {
            Some('P') => (8, kind.next()),
            Some('Q') => (16, kind.next()),
            Some('B' | 'L' | 'A') => (1, None),
            Some('I') => (2, None),
            Some('J' | 'E') => (4, None),
            Some('K' | 'D') => (8, None),
            _ => return Err(wrong(&form)),
        };
        if let Some(element) = element {
            let size = match element {
                'B' => 1,
                'I' => 2,
                'J' | 'E' => 4,
                'K' | 'D' => 8,
                _ => return Err(wrong(&form)),
            };
            for tile in 0..tiles {
                let at = tile * width + offset;
                let descriptor = data.get(at..at + bytes).ok_or("a column is wider than the table")?;
                let number = |bytes: &[u8]| bytes.iter().fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
                let (count, start) = (number(&descriptor[..bytes / 2]), number(&descriptor[bytes / 2..]));
                let end = count.checked_mul(size).and_then(|length| start.checked_add(length));
                if end.is_none_or(|end| end > (data.len() - heap) as u64) {
                    return Err(format!("tile {} of {tiles} ends beyond the HDU", tile + 1));
                }
            }
        }
        offset += repeat.checked_mul(bytes).filter(|width| *width < 1 << 20).ok_or_else(|| wrong(&form))?;
    }
    if offset != width { Err(format!("its columns take {offset} bytes of the table's {width}")) } else { Ok(()) }
}

fn wrong(form: &str) -> String {
    format!("TFORM = '{form}' is not a column of a compressed image")
}

/// Cards (without END) and data of the HDU with other pixels: with the same algorithm and tiles for integer pixels, and lossless
/// gzip for floats.
pub(super) fn encoded(hdu: &Hdu, pixels: &ImageData, axes: [usize; 2]) -> std::io::Result<(Vec<u8>, Vec<u8>)> {
    let tile = [1, 2].map(|axis| hdu.natural(&format!("ZTILE{axis}"), MOST_PIXELS).ok().map(|length| length as usize));
    let tile = [tile[0].unwrap_or(axes[0]), tile[1].unwrap_or(1)];
    let algorithm = hdu.text("ZCMPTYPE").unwrap_or_default();
    let by = |rice: TileCompression| match algorithm.as_str() {
        "GZIP_1" => TileCompression::gzip(),
        "GZIP_2" => TileCompression::gzip2(),
        _ => rice,
    };
    let integers = by(TileCompression::rice()).tile_dims(&tile);
    let floats = by(TileCompression::gzip2()).lossless().tile_dims(&tile);
    let compressed = match pixels {
        ImageData::U8(pixels) => compressed(pixels, axes, &integers),
        ImageData::I16(pixels) => compressed(pixels, axes, &integers),
        ImageData::I32(pixels) => compressed(pixels, axes, &integers),
        ImageData::F32(pixels) => compressed(pixels, axes, &floats),
        ImageData::F64(pixels) => compressed(pixels, axes, &floats),
        ImageData::I64(_) => Err(std::io::Error::other("integers of 64 bits cannot be compressed by tiles")),
    }?;
    let end = compressed.chunks_exact(CARD_SIZE).position(|card| card.starts_with(b"END     "));
    let end = end.expect("a header that was written has an END") * CARD_SIZE;
    let data = compressed[(end + CARD_SIZE).next_multiple_of(BLOCK_SIZE)..].to_vec();
    let own = || hdu.header.bytes.chunks_exact(CARD_SIZE).take_while(|card| !card.starts_with(b"END     "));
    let mut cards = Vec::new();
    for card in compressed[..end].chunks_exact(CARD_SIZE) {
        // funpack makes the first card of the image of these, and needs them where it does.
        if card.starts_with(b"ZBITPIX ") {
            own().filter(|card| is_first(card)).for_each(|card| cards.extend(card));
        }
        cards.extend(card);
    }
    own().filter(|card| !of_compression(card) && !is_first(card)).for_each(|card| cards.extend(card));
    let integers = !matches!(pixels, ImageData::F32(_) | ImageData::F64(_));
    if let (true, Some(Value::Integer(blank)), None) = (integers, hdu.value("ZBLANK"), hdu.value("BLANK")) {
        let card = Card::new("BLANK", Value::Integer(*blank)).map_err(std::io::Error::other)?;
        cards.extend(format_card(&card));
    }
    Ok((cards, data))
}

fn compressed<T: CompressPixel>(pixels: &[T], axes: [usize; 2], how: &TileCompression) -> std::io::Result<Vec<u8>> {
    compress_image_hdu(&axes, pixels, how, &[]).map_err(std::io::Error::other)
}

/// Whether a card says where the image was: in the primary HDU, or in an extension.
fn is_first(card: &[u8]) -> bool {
    card.starts_with(b"ZSIMPLE ") || card.starts_with(b"ZTENSION")
}

/// Whether a card describes the table or the compression, not the image. (ZHECKSUM and ZDATASUM are those of the original image;
/// ZSIMPLE, ZEXTEND and the like say where that was, and stay.)
fn of_compression(card: &[u8]) -> bool {
    is_of_compression(String::from_utf8_lossy(&card[..8]).trim_end())
}

/// The same of a keyword.
pub(super) fn is_of_compression(keyword: &str) -> bool {
    const FIXED: [&str; 19] = [
        "XTENSION", "BITPIX", "NAXIS", "PCOUNT", "GCOUNT", "TFIELDS", "THEAP", "ZIMAGE", "ZBITPIX", "ZNAXIS",
        "ZCMPTYPE", "ZQUANTIZ", "ZDITHER0", "ZBLANK", "ZSCALE", "ZZERO", "ZMASKCMP", "ZHECKSUM", "ZDATASUM",
    ];
    const NUMBERED: [&str; 8] = ["NAXIS", "TTYPE", "TFORM", "TUNIT", "ZNAXIS", "ZTILE", "ZNAME", "ZVAL"];
    let numbered = |begin: &&str| {
        keyword
            .strip_prefix(*begin)
            .is_some_and(|number| !number.is_empty() && number.bytes().all(|digit| digit.is_ascii_digit()))
    };
    FIXED.contains(&keyword) || NUMBERED.iter().any(numbered)
}
