//! FITS files: headers kept card by card, image pixels decoded and encoded, all else copied.
//!
//! Cards, values and pixels are read and written by the crate fitsio-pure; this module keeps the original bytes of the headers, so
//! that whatever ctiplan does not change is written unchanged.
//!
//! Source: Pence et al. 2010, FITS standard 3.0 (A&A 524, A42), and version 4.0 for CHECKSUM and DATASUM.

mod header;
mod tiles;

use std::fmt;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::Path;

use fitsio_pure::block::{BLOCK_SIZE, CARD_SIZE};
use fitsio_pure::checksum::{checksum_blocks, encode_checksum};
use fitsio_pure::header::{Card, format_card, header_byte_len, serialize_header};
use fitsio_pure::image::{self, ImageData};
use fitsio_pure::value::Value;
use flate2::Compression;
use flate2::read::MultiGzDecoder;
use flate2::write::GzEncoder;
use ndarray::Array2;

use crate::error::InputError;
use header::Header;

/// A FITS file with its headers read.
pub struct Fits {
    file: File,
    name: String,
    /// Header and data units in the file's order.
    pub hdus: Vec<Hdu>,
    /// Length of the file, bytes.
    length: u64,
}

/// One header and data unit.
#[derive(Clone, Debug)]
pub struct Hdu {
    /// Index in the file; 0 is the primary HDU.
    pub index: usize,
    /// Its kind of data.
    pub kind: HduKind,
    header: Header,
    name: Option<String>,
    version: i64,
    start: u64,
    data_len: u64,
}

/// Kind of data in an HDU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HduKind {
    /// An image of two axes.
    Image {
        /// NAXIS2.
        rows: usize,
        /// NAXIS1.
        columns: usize,
        /// BITPIX.
        bitpix: i64,
    },
    /// An image of another number of axes.
    OtherAxes(usize),
    /// A header without data.
    Empty,
    /// A tile-compressed image with an unsupported algorithm: supported ones count as images.
    Compressed,
    /// A table, or anything else that is not an image.
    NoImage,
}

/// Pixels as stored, with their scaling.
pub struct Pixels {
    stored: ImageData,
    scale: f64,
    zero: f64,
    blank: Option<i64>,
    shape: (usize, usize),
}

impl Fits {
    /// Opens a file, plain or compressed with gzip, and reads its headers.
    ///
    /// # Errors
    /// If it does not exist, is not a FITS file, is truncated, or its headers are malformed.
    pub fn open(path: &Path) -> Result<Fits, InputError> {
        let name = path.display().to_string();
        let refusal = |problem: String| InputError::new(format!("cannot read `{name}`"), problem);
        let mut file = File::open(path).map_err(|error| refusal(error.to_string()))?;
        let mut begin = begin_of(&mut file).map_err(|error| refusal(error.to_string()))?;
        if begin.starts_with(&[0x1f, 0x8b]) {
            file = unpacked(&mut file).map_err(|error| {
                refusal(format!("its gzip compression cannot be undone: {error}")).with_help(TRUNCATED)
            })?;
            begin = begin_of(&mut file).map_err(|error| refusal(error.to_string()))?;
        }
        let length = file.metadata().map_err(|error| refusal(error.to_string()))?.len();
        if let Some((_, program, unpack)) = PACKED.iter().find(|(magic, ..)| begin.starts_with(magic)) {
            return Err(refusal(format!("it is compressed with {program}"))
                .with_help(format!("unpack it first, with `{unpack}`")));
        }
        if begin != b"SIMPLE" {
            return Err(refusal("this is not a FITS file: its first card is not SIMPLE".into()));
        }
        let mut fits = Fits { file, name, hdus: Vec::new(), length };
        let mut start = 0;
        while let Some(hdu) = fits.next(start)? {
            start = hdu.end();
            fits.hdus.push(hdu);
        }
        Ok(fits)
    }

    /// The HDU that starts here. None at the end, or if what follows is not an extension.
    fn next(&mut self, start: u64) -> Result<Option<Hdu>, InputError> {
        let index = self.hdus.len();
        let mut header = Vec::new();
        loop {
            let block = self.bytes(start + header.len() as u64, BLOCK_SIZE as u64)?;
            if header.is_empty() && index > 0 && !block.starts_with(b"XTENSION") {
                return Ok(None);
            }
            if block.len() < BLOCK_SIZE {
                return Err(self.broken(index, "the file ends before the header does").with_help(TRUNCATED));
            }
            let last = header_byte_len(&block).is_ok();
            header.extend(block);
            if last {
                break;
            }
            if header.len() > MOST_HEADER {
                return Err(self.broken(index, "its header has no END"));
            }
        }
        let hdu = Hdu::new(index, header, start).map_err(|problem| self.broken(index, &problem))?;
        let there = self.length - hdu.data_start();
        if hdu.data_len > there {
            let problem = format!("its data take {} bytes, of which {there} are there", hdu.data_len);
            return Err(self.broken(index, &problem).with_help(TRUNCATED));
        }
        Ok(Some(hdu))
    }

    /// Reads the pixels of a two-dimensional image.
    ///
    /// # Errors
    /// If the file cannot be read, or its scaling cannot be undone.
    pub fn pixels(&mut self, index: usize) -> Result<Pixels, InputError> {
        let hdu = self.hdus[index].clone();
        let HduKind::Image { rows, columns, .. } = hdu.kind else { panic!("HDU {index} holds an image") };
        let data = self.bytes(hdu.data_start(), hdu.data_len)?;
        if hdu.is_compressed() {
            tiles::check_tiles(&hdu, &data).map_err(|problem| self.broken(index, &problem))?;
        }
        hdu.check_values().map_err(|problem| self.broken(index, &problem).with_help(CORRECT))?;
        let decoded = fitsio_pure::hdu::Hdu::from_cards(hdu.header.cards.clone(), 0, 0)
            .and_then(|known| image::read_image_data(&data, &known));
        let stored = decoded.map_err(|error| self.broken(index, &error.to_string()))?;
        let number = |keyword: &str| {
            hdu.header.number(keyword).map_err(|problem| self.broken(index, &problem).with_help(CORRECT))
        };
        let (scale, zero) = (number("BSCALE")?.unwrap_or(1.0), number("BZERO")?.unwrap_or(0.0));
        if scale == 0.0 || !scale.is_finite() || !zero.is_finite() {
            return Err(self.broken(index, &format!("BSCALE = {scale}, BZERO = {zero} say nothing about the pixels")));
        }
        let integers = !matches!(stored, ImageData::F32(_) | ImageData::F64(_));
        let whole = |keyword: &str| {
            hdu.header.integer(keyword).map_err(|problem| self.broken(index, &problem).with_help(CORRECT))
        };
        let blank = if integers { whole("BLANK")?.or(whole("ZBLANK")?) } else { None };
        let there = match &stored {
            ImageData::U8(pixels) => pixels.len(),
            ImageData::I16(pixels) => pixels.len(),
            ImageData::I32(pixels) => pixels.len(),
            ImageData::I64(pixels) => pixels.len(),
            ImageData::F32(pixels) => pixels.len(),
            ImageData::F64(pixels) => pixels.len(),
        };
        if there != rows * columns {
            return Err(self.broken(index, &format!("it has {there} pixels instead of {columns} x {rows}")));
        }
        Ok(Pixels { stored, scale, zero, blank, shape: (rows, columns) })
    }

    /// Copies an HDU unchanged.
    ///
    /// # Errors
    /// If reading or writing fails.
    pub fn copy(&mut self, index: usize, out: &mut impl Write) -> std::io::Result<()> {
        let (start, end) = (self.hdus[index].start, self.hdus[index].end());
        self.copy_from(start, end.min(self.length) - start, out)
    }

    /// Copies what follows the last HDU, and returns the number of bytes.
    ///
    /// # Errors
    /// If reading or writing fails.
    pub fn copy_rest(&mut self, out: &mut impl Write) -> std::io::Result<u64> {
        let end = self.hdus.last().map_or(0, Hdu::end).min(self.length);
        self.copy_from(end, self.length - end, out)?;
        Ok(self.length - end)
    }

    fn copy_from(&mut self, start: u64, length: u64, out: &mut impl Write) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(start))?;
        std::io::copy(&mut (&mut self.file).take(length), out)?;
        Ok(())
    }

    /// At most `length` bytes, as many as there are.
    fn bytes(&mut self, start: u64, length: u64) -> Result<Vec<u8>, InputError> {
        let mut bytes = Vec::new();
        let read = self.file.seek(SeekFrom::Start(start));
        read.and_then(|_| (&mut self.file).take(length).read_to_end(&mut bytes))
            .map_err(|error| InputError::new(format!("cannot read `{}`", self.name), error.to_string()))?;
        Ok(bytes)
    }

    fn broken(&self, index: usize, problem: &str) -> InputError {
        InputError {
            place: Some(format!("HDU {index}")),
            ..InputError::new(format!("cannot read `{}`", self.name), problem)
        }
    }
}

/// The first bytes of a file.
fn begin_of(file: &mut File) -> std::io::Result<Vec<u8>> {
    let mut begin = Vec::new();
    file.rewind()?;
    file.take(6).read_to_end(&mut begin)?;
    Ok(begin)
}

/// First bytes of files compressed in ways that are not read, the program, and the command that undoes it.
const PACKED: [(&[u8], &str, &str); 6] = [
    (b"BZh", "bzip2", "bunzip2"),
    (&[0x1f, 0x9d], "compress", "uncompress"),
    (&[0x1f, 0xa0], "compress -H", "gzip -d"),
    (&[0xfd, b'7', b'z', b'X', b'Z'], "xz", "unxz"),
    (&[0x28, 0xb5, 0x2f, 0xfd], "zstd", "unzstd"),
    (b"PK", "zip", "unzip"),
];

/// Unpacks a file compressed with gzip into a temporary one.
fn unpacked(file: &mut File) -> std::io::Result<File> {
    file.rewind()?;
    let mut unpacked = tempfile::tempfile()?;
    let mut plain = MultiGzDecoder::new(BufReader::new(file)).take(MOST_UNPACKED + 1);
    if std::io::copy(&mut plain, &mut unpacked)? > MOST_UNPACKED {
        return Err(std::io::Error::other(format!("it holds more than {} GiB", MOST_UNPACKED >> 30)));
    }
    Ok(unpacked)
}

/// Compresses a file with gzip.
///
/// # Errors
/// If reading or writing fails.
pub fn pack(mut plain: File, out: &mut impl Write) -> std::io::Result<()> {
    plain.rewind()?;
    let mut packed = GzEncoder::new(out, Compression::default());
    std::io::copy(&mut plain, &mut packed)?;
    packed.finish()?.flush()
}

/// Maximum size of an unpacked gzip file, bytes.
const MOST_UNPACKED: u64 = 64 << 30;

/// Maximum length of a header, bytes: a thousand times longer than usual.
const MOST_HEADER: usize = 10_000 * BLOCK_SIZE;

const TRUNCATED: &str = "the file is truncated: copy it again";

const CORRECT: &str = "correct the header: one card of a keyword, with a value as FITS writes it";

impl Hdu {
    /// Without a header: an image of this shape (rows, columns), of integers or floats.
    pub fn without_header((rows, columns): (usize, usize), integers: bool) -> Hdu {
        let kind = HduKind::Image { rows, columns, bitpix: if integers { 32 } else { -64 } };
        Hdu { index: 0, kind, header: Header::default(), name: None, version: 1, start: 0, data_len: 0 }
    }

    /// The same with another EXTNAME.
    #[cfg(test)]
    pub(super) fn named(self, name: &str) -> Hdu {
        Hdu { name: Some(name.into()), ..self }
    }

    fn new(index: usize, header: Vec<u8>, start: u64) -> Result<Hdu, String> {
        let header = Header::new(header)?;
        let mut hdu = Hdu { index, kind: HduKind::Empty, header, name: None, version: 1, start, data_len: 0 };
        let bitpix = hdu.integer("BITPIX")?;
        if ![8, 16, 32, 64, -32, -64].contains(&bitpix) {
            return Err(format!("BITPIX = {bitpix}: 8, 16, 32, 64, -32 or -64 is needed"));
        }
        let axes = hdu.natural("NAXIS", 999)?;
        let lengths = (1..=axes).map(|axis| hdu.natural(&format!("NAXIS{axis}"), 1 << 40));
        let lengths = lengths.collect::<Result<Vec<u64>, String>>()?;
        let or_else = |keyword: &str, default| match hdu.header.value(keyword)? {
            None => Ok(default),
            Some(_) => hdu.natural(keyword, 1 << 40),
        };
        let (parameters, groups) = (or_else("PCOUNT", 0)?, or_else("GCOUNT", 1)?);
        let random_groups = lengths.first() == Some(&0) && hdu.header.value("GROUPS")? == Some(&Value::Logical(true));
        hdu.header.value("ZIMAGE")?;
        let counted = if random_groups { &lengths[1..] } else { &lengths[..] };
        let pixels = counted.iter().try_fold(1_u64, |product, length| product.checked_mul(*length));
        let bytes = pixels
            .filter(|_| axes > 0)
            .or((axes == 0).then_some(0))
            .and_then(|pixels| pixels.checked_add(parameters))
            .and_then(|values| values.checked_mul(groups))
            .and_then(|values| values.checked_mul(bitpix.unsigned_abs() / 8))
            // Offsets in the file are added to it.
            .filter(|bytes| *bytes < 1 << 60);
        hdu.data_len = bytes.ok_or("its axes make more pixels than a file can hold")?;
        let image = index == 0 || hdu.header.text("XTENSION")?.is_some_and(|kind| kind == "IMAGE");
        hdu.kind = match lengths[..] {
            _ if hdu.is_compressed() => tiles::kind(&hdu)?,
            _ if random_groups || !image => HduKind::NoImage,
            _ if hdu.data_len == 0 => HduKind::Empty,
            // Groups and parameters belong to other kinds of HDU.
            _ if (parameters, groups) != (0, 1) => HduKind::NoImage,
            [columns, rows] => HduKind::Image { rows: rows as usize, columns: columns as usize, bitpix },
            _ => HduKind::OtherAxes(lengths.len()),
        };
        let (name, version) = (hdu.header.name(), hdu.header.integer("EXTVER"));
        (hdu.name, hdu.version) = match hdu.kind {
            // Whatever names them, tables are copied.
            HduKind::Empty | HduKind::NoImage => (name.unwrap_or_default(), version.unwrap_or_default().unwrap_or(1)),
            _ => (name?, version?.unwrap_or(1)),
        };
        Ok(hdu)
    }

    /// Checks that the keywords from which pixels are decoded are unique.
    fn check_values(&self) -> Result<(), String> {
        let decides = |keyword: &&str| ["BSCALE", "BZERO"].contains(keyword) || tiles::is_of_compression(keyword);
        self.header.keywords().filter(decides).try_for_each(|keyword| self.header.value(keyword).map(|_| ()))
    }

    /// Whether it is an image of two axes, as far as is known.
    pub fn has_two_axes(&self) -> bool {
        matches!(self.kind, HduKind::Image { .. } | HduKind::Compressed)
    }

    /// Whether it is a tile-compressed image.
    pub fn is_compressed(&self) -> bool {
        self.value("ZIMAGE") == Some(&Value::Logical(true))
    }

    /// The value of a keyword that decides what is done; None if the header does not have it.
    ///
    /// # Errors
    /// If it cannot be read, or cards contradict each other.
    pub fn read(&self, keyword: &str) -> Result<Option<&Value>, InputError> {
        self.header.value(keyword).map_err(|problem| self.refused(problem))
    }

    /// A text that decides what is done; None if the header does not have it.
    ///
    /// # Errors
    /// As [`Hdu::read`], or if it is not a text.
    pub fn read_text(&self, keyword: &str) -> Result<Option<String>, InputError> {
        self.header.text(keyword).map_err(|problem| self.refused(problem))
    }

    /// A number that decides what is done; None if the header does not have it.
    ///
    /// # Errors
    /// As [`Hdu::read`], or if it is not a number.
    pub fn read_number(&self, keyword: &str) -> Result<Option<f64>, InputError> {
        self.header.number(keyword).map_err(|problem| self.refused(problem))
    }

    fn refused(&self, problem: String) -> InputError {
        InputError::new(self.to_string(), problem).with_help(CORRECT)
    }

    /// A value on record, which decides nothing; None also if it cannot be read.
    pub fn value(&self, keyword: &str) -> Option<&Value> {
        self.header.value(keyword).ok().flatten()
    }

    /// The same, if it is a text.
    pub fn text(&self, keyword: &str) -> Option<String> {
        self.header.text(keyword).ok().flatten()
    }

    /// Keywords of the header, in order.
    pub fn keywords(&self) -> impl Iterator<Item = &str> {
        self.header.keywords()
    }

    /// HISTORY lines.
    pub fn history(&self) -> impl Iterator<Item = &str> {
        let cards = self.header.cards.iter().filter(|card| card.keyword_str() == "HISTORY");
        cards.filter_map(|card| card.comment.as_deref()).map(str::trim)
    }

    /// EXTNAME, if there is one.
    pub fn name(&self) -> Option<String> {
        self.name.clone()
    }

    /// EXTVER; default 1.
    pub fn version(&self) -> i64 {
        self.version
    }

    fn integer(&self, keyword: &str) -> Result<i64, String> {
        self.header.integer(keyword)?.ok_or_else(|| format!("its header has no {keyword}"))
    }

    fn natural(&self, keyword: &str, most: u64) -> Result<u64, String> {
        let value = self.integer(keyword)?;
        let natural = u64::try_from(value).ok().filter(|value| *value <= most);
        natural.ok_or_else(|| format!("{keyword} = {value}: 0 to {most} is allowed"))
    }

    fn data_start(&self) -> u64 {
        self.start + self.header.bytes.len() as u64
    }

    fn end(&self) -> u64 {
        self.data_start() + self.data_len.next_multiple_of(BLOCK_SIZE as u64)
    }

    /// Writes the HDU with other pixels and with additional cards before END, which replace those of the same keyword unless they
    /// are HISTORY. Existing checksums are updated, and all other cards are unchanged.
    ///
    /// # Errors
    /// If writing fails.
    pub fn write(&self, pixels: &Pixels, more: &[Card], out: &mut impl Write) -> std::io::Result<()> {
        let (mut header, data) = if self.is_compressed() {
            tiles::encoded(self, &pixels.stored, [pixels.shape.1, pixels.shape.0])?
        } else {
            let end = self.header.bytes.chunks_exact(CARD_SIZE).position(|card| card.starts_with(b"END     "));
            let end = end.expect("a header that was read has an END");
            (self.header.bytes[..end * CARD_SIZE].to_vec(), image::serialize_image(&pixels.stored))
        };
        let replaced = |card: &[u8]| more.iter().any(|new| new.value.is_some() && card.starts_with(&new.keyword));
        header = header.chunks_exact(CARD_SIZE).filter(|card| !replaced(card)).flatten().copied().collect();
        header.extend(more.iter().flat_map(format_card));
        header.extend(fitsio_pure::header::format_end_card());
        header.resize(header.len().next_multiple_of(BLOCK_SIZE), b' ');
        let data_sum = checksum_blocks(&data);
        set_text(&mut header, b"DATASUM ", &data_sum.to_string());
        if set_text(&mut header, b"CHECKSUM", &"0".repeat(16)) {
            let sum = ones_complement_sum(checksum_blocks(&header), data_sum);
            let encoded = encode_checksum(sum, true);
            set_text(&mut header, b"CHECKSUM", std::str::from_utf8(&encoded).expect("letters and digits"));
        }
        out.write_all(&header)?;
        out.write_all(&data)
    }
}

/// A HISTORY card.
pub fn history(line: &str) -> Card {
    Card { keyword: *b"HISTORY ", value: None, comment: Some(line.into()) }
}

/// Appends an image extension of bytes, 1 where a pixel of a frame (an HDU of the file, by its index) is marked and 0 elsewhere.
///
/// # Errors
/// If writing fails.
pub fn write_mask(name: &str, of: usize, mask: &Array2<bool>, out: &mut (impl Write + Seek)) -> std::io::Result<()> {
    // A file may end before the last block of its last HDU is full.
    let written = out.stream_position()?;
    out.write_all(&vec![0; (written.next_multiple_of(BLOCK_SIZE as u64) - written) as usize])?;
    let (rows, columns) = mask.dim();
    let whole = |number: usize| Value::Integer(number as i64);
    let values = [
        ("XTENSION", Value::String("IMAGE".into())),
        ("BITPIX", Value::Integer(8)),
        ("NAXIS", Value::Integer(2)),
        ("NAXIS1", whole(columns)),
        ("NAXIS2", whole(rows)),
        ("PCOUNT", Value::Integer(0)),
        ("GCOUNT", Value::Integer(1)),
        ("EXTNAME", Value::String(name.into())),
        ("CTIHDU", whole(of)),
    ];
    let cards: Result<Vec<Card>, _> = values.into_iter().map(|(keyword, value)| Card::new(keyword, value)).collect();
    let header = cards.and_then(|cards| serialize_header(&cards)).map_err(std::io::Error::other)?;
    out.write_all(&header)?;
    out.write_all(&image::serialize_image(&ImageData::U8(mask.iter().map(|marked| u8::from(*marked)).collect())))
}

impl fmt::Display for Hdu {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "HDU {}", self.index)?;
        self.name().map_or(Ok(()), |name| write!(out, " ({name})"))
    }
}

/// Replaces the text of a card and keeps its comment. False if there is no such card.
fn set_text(header: &mut [u8], keyword: &[u8; 8], text: &str) -> bool {
    let Some(bytes) = header.chunks_exact_mut(CARD_SIZE).find(|card| card.starts_with(keyword)) else {
        return false;
    };
    let known: &[u8; CARD_SIZE] = (&*bytes).try_into().expect("a card");
    let comment = fitsio_pure::header::parse_card(known).ok().and_then(|card| card.comment);
    bytes.copy_from_slice(&format_card(&Card { keyword: *keyword, value: Some(Value::String(text.into())), comment }));
    true
}

fn ones_complement_sum(a: u32, b: u32) -> u32 {
    let sum = u64::from(a) + u64::from(b);
    (sum & 0xffff_ffff) as u32 + (sum >> 32) as u32
}

impl Pixels {
    /// Physical values, `[[row, column]]`, BSCALE and BZERO applied; NaN for pixels without a value.
    pub fn physical(&self) -> Array2<f64> {
        let mut values = image::apply_bscale_bzero(&self.stored, self.scale, self.zero);
        // blank_mask narrows BLANK to the type of the pixels; a value out of range there marks none.
        if let Some(blank) = self.blank.filter(|blank| self.holds(*blank)) {
            let blanks = image::blank_mask(&self.stored, Some(blank)).unwrap_or_default();
            for (value, _) in values.iter_mut().zip(blanks).filter(|(_, blank)| *blank) {
                *value = f64::NAN;
            }
        }
        Array2::from_shape_vec(self.shape, values).expect("as many pixels as the axes say")
    }

    /// Replaces physical values where given (`Some`), rounded and clipped to the range of integers. Returns the number of clipped
    /// values.
    pub fn set(&mut self, values: impl Iterator<Item = Option<f64>>) -> usize {
        let (scale, zero, blank) = (self.scale, self.zero, self.blank);
        let stored = |value: f64| (value - zero) / scale;
        let mut clipped_px = 0;
        macro_rules! integers {
            ($pixels:expr, $type:ty) => {
                for (pixel, value) in $pixels.iter_mut().zip(values) {
                    let Some(value) = value else { continue };
                    let wanted = stored(value).round();
                    let mut value = wanted as $type;
                    // A charge must not become a missing pixel.
                    if blank == Some(value as i64) {
                        value = if value == <$type>::MIN { value + 1 } else { value - 1 };
                    }
                    clipped_px += usize::from(wanted < <$type>::MIN as f64 || wanted > <$type>::MAX as f64);
                    *pixel = value;
                }
            };
        }
        macro_rules! floats {
            ($pixels:expr, $type:ty) => {
                for (pixel, value) in $pixels.iter_mut().zip(values) {
                    if let Some(value) = value {
                        *pixel = stored(value) as $type;
                    }
                }
            };
        }
        match &mut self.stored {
            ImageData::U8(pixels) => integers!(pixels, u8),
            ImageData::I16(pixels) => integers!(pixels, i16),
            ImageData::I32(pixels) => integers!(pixels, i32),
            ImageData::I64(pixels) => integers!(pixels, i64),
            ImageData::F32(pixels) => floats!(pixels, f32),
            ImageData::F64(pixels) => floats!(pixels, f64),
        }
        clipped_px
    }

    fn holds(&self, value: i64) -> bool {
        match self.stored {
            ImageData::U8(_) => u8::try_from(value).is_ok(),
            ImageData::I16(_) => i16::try_from(value).is_ok(),
            ImageData::I32(_) => i32::try_from(value).is_ok(),
            ImageData::I64(_) => true,
            ImageData::F32(_) | ImageData::F64(_) => false,
        }
    }
}
