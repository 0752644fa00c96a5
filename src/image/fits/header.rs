//! The header of an HDU: its bytes as they are, and the values of its keywords.
//!
//! One rule holds for every keyword that decides values or their meaning: its card can be read, and no other card says otherwise.
//! Programs disagree on which of several cards counts, so a contradiction is refused, with the lines of its cards.
//!
//! Keywords are compared as cfitsio and astropy do: in capitals, and those of the HIERARCH convention (ESO, DESI, Rubin) by the words
//! between `HIERARCH` and `=`.

use fitsio_pure::block::CARD_SIZE;
use fitsio_pure::header::{Card, parse_header_blocks};
use fitsio_pure::value::{Value, parse_value};

use crate::error::shortened;

/// The word before keywords that are longer than eight characters.
const HIERARCH: &str = "HIERARCH";

/// EXTNAME that fpack gives to images without a name, and, in old versions, to those with one besides.
const COMPRESSED_IMAGE: &str = "COMPRESSED_IMAGE";

/// The cards of a header.
#[derive(Clone, Debug, Default)]
pub(super) struct Header {
    /// As in the file.
    pub bytes: Vec<u8>,
    /// In order, with the values of long texts and of the HIERARCH convention.
    pub cards: Vec<Card>,
    /// Keyword of each card.
    keywords: Vec<String>,
}

impl Header {
    /// # Errors
    /// If it is no header, in words.
    pub fn new(bytes: Vec<u8>) -> Result<Header, String> {
        // Characters beyond ASCII, forbidden by the standard, occur in comments. They are kept in the file.
        let plain: Vec<u8> = bytes.iter().map(|byte| if (b' '..=b'~').contains(byte) { *byte } else { b'?' }).collect();
        let mut cards = parse_header_blocks(&plain).map_err(|error| error.to_string())?;
        let keywords = cards.iter_mut().map(named).collect();
        Ok(Header { bytes, cards, keywords })
    }

    /// Keywords of the cards, in order.
    pub fn keywords(&self) -> impl Iterator<Item = &str> {
        self.keywords.iter().map(String::as_str)
    }

    /// The value of a keyword; None if no card has it.
    ///
    /// # Errors
    /// If a card of it has no value that can be read, or cards contradict each other: the cards with their lines, in words.
    pub fn value(&self, keyword: &str) -> Result<Option<&Value>, String> {
        let wanted = normal(keyword);
        self.only(&wanted, self.values(&wanted))
    }

    /// EXTNAME: the image's own, if fpack has written another one.
    ///
    /// # Errors
    /// As [`Header::value`].
    pub fn name(&self) -> Result<Option<String>, String> {
        let values = self.values("EXTNAME");
        let is_own =
            |value: &Option<&Value>| !matches!(value, Some(Value::String(name)) if name.trim() == COMPRESSED_IMAGE);
        let own: Vec<_> = values.iter().copied().filter(is_own).collect();
        match self.only("EXTNAME", if own.is_empty() { values } else { own })? {
            Some(Value::String(name)) => Ok(Some(name.trim().to_string()).filter(|name| !name.is_empty())),
            None | Some(Value::Undefined) => Ok(None),
            Some(_) => Err(self.not("EXTNAME", "a text in quotes")),
        }
    }

    /// A text; None if no card has the keyword, or no value.
    ///
    /// # Errors
    /// As [`Header::value`], or if it is not a text.
    pub fn text(&self, keyword: &str) -> Result<Option<String>, String> {
        match self.value(keyword)? {
            Some(Value::String(text)) => Ok(Some(text.trim().to_string())),
            None | Some(Value::Undefined) => Ok(None),
            Some(_) => Err(self.not(keyword, "a text in quotes")),
        }
    }

    /// A number.
    ///
    /// # Errors
    /// As [`Header::value`], or if it is not a number.
    pub fn number(&self, keyword: &str) -> Result<Option<f64>, String> {
        match self.value(keyword)? {
            None => Ok(None),
            Some(value) => number(value).map(Some).ok_or_else(|| self.not(keyword, "a number")),
        }
    }

    /// A whole number.
    ///
    /// # Errors
    /// As [`Header::value`], or if it is not a whole number.
    pub fn integer(&self, keyword: &str) -> Result<Option<i64>, String> {
        match self.value(keyword)? {
            None => Ok(None),
            Some(Value::Integer(value)) => Ok(Some(*value)),
            Some(_) => Err(self.not(keyword, "a whole number")),
        }
    }

    /// The values of a keyword's cards; None where there is none that can be read.
    fn values(&self, keyword: &str) -> Vec<Option<&Value>> {
        self.keywords
            .iter()
            .zip(&self.cards)
            .filter(|(known, _)| *known == keyword)
            .map(|(_, card)| card.value.as_ref())
            .collect()
    }

    /// The value on which all cards agree.
    fn only<'a>(&self, keyword: &str, values: Vec<Option<&'a Value>>) -> Result<Option<&'a Value>, String> {
        let Some(first) = values.first().copied() else { return Ok(None) };
        if values.contains(&None) {
            return Err(self.not(keyword, "a value as FITS writes it"));
        }
        let same = |value: &Option<&Value>| match (first.and_then(number), value.and_then(number)) {
            (Some(a), Some(b)) => a == b,
            _ => *value == first,
        };
        if values.iter().all(same) {
            Ok(first)
        } else {
            Err(format!("its header contradicts itself: {}", self.cited(keyword)))
        }
    }

    fn not(&self, keyword: &str, needed: &str) -> String {
        format!("{}: {needed} is needed", self.cited(&normal(keyword)))
    }

    /// The cards of a keyword with their lines.
    fn cited(&self, keyword: &str) -> String {
        let cited = self.bytes.chunks_exact(CARD_SIZE).enumerate().filter_map(|(line, card)| {
            let text = String::from_utf8_lossy(card);
            let name = text.split('=').next().unwrap_or_default();
            let is_it = normal(name) == keyword || normal(text.get(..8).unwrap_or_default()) == keyword;
            let said = text.split(" / ").next().unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ");
            is_it.then(|| format!("`{}` in line {}", shortened(&said), line + 1))
        });
        cited.collect::<Vec<_>>().join(", ")
    }
}

/// A number, whole or not.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(number) => Some(*number),
        Value::Integer(number) => Some(*number as f64),
        _ => None,
    }
}

/// A keyword in capitals with single blanks, without `HIERARCH`.
fn normal(keyword: &str) -> String {
    let words = keyword.to_ascii_uppercase();
    let words: Vec<&str> = words.split_whitespace().collect();
    match &words[..] {
        [HIERARCH, rest @ ..] if !rest.is_empty() => rest.join(" "),
        words => words.join(" "),
    }
}

/// The keyword of a card. One of the HIERARCH convention gets its value.
fn named(card: &mut Card) -> String {
    card.keyword.make_ascii_uppercase();
    let keyword = normal(card.keyword_str());
    if keyword != HIERARCH || card.value.is_some() {
        return keyword;
    }
    let text = card.comment.clone().unwrap_or_default();
    let Some((words, value)) = text.split_once('=') else { return keyword };
    card.value = parse_value(value.as_bytes()).map(|(value, _)| value);
    normal(words)
}
