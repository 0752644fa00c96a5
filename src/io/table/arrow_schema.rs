//! What pyarrow keeps of columns beside a Parquet file: units in the metadata of a field, and those of durations.
//!
//! The key `ARROW:schema` holds a message of Arrow in Base64, whose schema is a FlatBuffer: tables with offsets to their members
//! ([Arrow columnar format](https://arrow.apache.org/docs/format/Columnar.html#serialization-and-interprocess-communication-ipc),
//! `Schema.fbs`). Only those members are read; anything unexpected is no unit.

/// The key under which a field's metadata has its unit.
const UNIT: &str = "unit";

/// The member of the union `Type` that is a duration, and its units.
const DURATION: u8 = 18;
const OF_DURATIONS: [&str; 4] = ["s", "ms", "us", "ns"];

/// Names of columns and their units.
pub(super) fn units(schema: &str) -> Vec<(String, String)> {
    let Some(bytes) = base64(schema) else { return Vec::new() };
    // A length, behind a mark that older versions lack.
    let begin = if bytes.starts_with(&[0xff; 4]) { 8 } else { 4 };
    let fields = || {
        let message = Member { bytes: &bytes, at: begin }.follow()?;
        message.member(2)?.follow()?.member(1)?.follow()?.members()
    };
    let unit = |field: Member| Some((field.member(0)?.follow()?.text()?, of_field(field)?));
    fields().unwrap_or_default().into_iter().filter_map(unit).collect()
}

/// The unit of a field.
fn of_field(field: Member) -> Option<String> {
    if field.member(2).and_then(|kind| kind.byte()) == Some(DURATION) {
        let of = |kind: Member| Some(kind.member(0).map_or(1, |unit| unit.byte().unwrap_or(1)));
        let unit = of(field.member(3)?.follow()?)?;
        return OF_DURATIONS.get(usize::from(unit)).map(|unit| (*unit).to_string());
    }
    let entries = field.member(6)?.follow()?.members()?;
    let text = |entry: &Member, index| entry.member(index)?.follow()?.text();
    let unit = entries.iter().find(|entry| text(entry, 0).as_deref() == Some(UNIT))?;
    text(unit, 1)
}

/// A place in a FlatBuffer.
#[derive(Clone, Copy)]
struct Member<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Member<'a> {
    fn number<const N: usize>(self, behind: usize) -> Option<[u8; N]> {
        let begin = self.at.checked_add(behind)?;
        self.bytes.get(begin..begin.checked_add(N)?)?.try_into().ok()
    }

    fn byte(self) -> Option<u8> {
        self.number::<1>(0).map(|[byte]| byte)
    }

    fn to(self, at: usize) -> Member<'a> {
        Member { at, ..self }
    }

    /// The place to which an offset here leads.
    fn follow(self) -> Option<Member<'a>> {
        let offset = u32::from_le_bytes(self.number(0)?) as usize;
        Some(self.to(self.at.checked_add(offset)?))
    }

    /// A member of the table here, by its number; None if it is not there.
    fn member(self, index: usize) -> Option<Member<'a>> {
        let back = i32::from_le_bytes(self.number(0)?);
        let list = self.to(usize::try_from(i64::try_from(self.at).ok()? - i64::from(back)).ok()?);
        let length = usize::from(u16::from_le_bytes(list.number(0)?));
        let place = 4 + 2 * index;
        if place + 2 > length {
            return None;
        }
        let offset = usize::from(u16::from_le_bytes(list.number(place)?));
        (offset > 0).then(|| self.to(self.at + offset))
    }

    /// The tables of the list here.
    fn members(self) -> Option<Vec<Member<'a>>> {
        let count = u32::from_le_bytes(self.number(0)?) as usize;
        if count > self.bytes.len() {
            return None;
        }
        (0..count).map(|index| self.to(self.at + 4 + 4 * index).follow()).collect()
    }

    fn text(self) -> Option<String> {
        let length = u32::from_le_bytes(self.number(0)?) as usize;
        let begin = self.at.checked_add(4)?;
        let bytes = self.bytes.get(begin..begin.checked_add(length)?)?;
        str::from_utf8(bytes).ok().map(str::to_string)
    }
}

/// The bytes of a text in Base64 (RFC 4648).
fn base64(text: &str) -> Option<Vec<u8>> {
    const LETTERS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut held, mut bits) = (0_u32, 0);
    for letter in text.trim_end_matches('=').bytes() {
        let value = LETTERS.iter().position(|known| *known == letter)? as u32;
        held = (held << 6 | value) & 0xffff;
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            bytes.push((held >> bits) as u8);
        }
    }
    Some(bytes)
}
