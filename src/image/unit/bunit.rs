//! BUNIT as pipelines write it: `ELECTRONS`, `electron`, `e-`, `DN/pix`, `electron s-1`, `10**3 adu`, ...
//!
//! ```text
//! unit = factor, then factors after `*`, `.`, blanks, or `/`      factor = number or name, with a power after it, or (unit)
//! ```
//!
//! A value of a frame is that of a pixel, so "per pixel" says nothing more. What is left must be a charge, and nothing else.
//!
//! Source: FITS standard 4.0, section 4.3, and names found in files.

/// What a unit measures, of those that matter here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Measures {
    /// So many electrons.
    Electrons(f64),
    /// So many counts of the converter.
    Counts(f64),
    /// Charge in a time.
    Rate,
    /// Nothing is written.
    Nothing,
    /// Something else, or not known.
    Other,
}

const ELECTRONS: [&str; 7] = ["electron", "electrons", "e-", "e", "el", "photoelectron", "photoelectrons"];
const COUNTS: [&str; 8] = ["count", "counts", "ct", "cts", "dn", "dns", "adu", "adus"];
const PIXELS: [&str; 4] = ["pixel", "pixels", "pix", "px"];
const TIMES: [&str; 14] =
    ["s", "sec", "secs", "second", "seconds", "ms", "min", "minute", "minutes", "h", "hr", "hour", "hours", "d"];

/// Powers of what a unit is a product of.
#[derive(Clone, Copy, Debug)]
struct Product {
    scale: f64,
    electrons: i32,
    counts: i32,
    pixels: i32,
    times: i32,
    others: bool,
}

const ONE: Product = Product { scale: 1.0, electrons: 0, counts: 0, pixels: 0, times: 0, others: false };

impl Measures {
    /// What a BUNIT says.
    pub fn of(bunit: &str) -> Measures {
        if bunit.trim().is_empty() {
            return Measures::Nothing;
        }
        let text: Vec<char> = bunit.trim().to_ascii_lowercase().replace("**", "^").chars().collect();
        let mut rest = Rest { text: &text, at: 0 };
        let Some(product) = rest.product().filter(|_| rest.at == text.len()) else { return Measures::Other };
        let Product { scale, electrons, counts, pixels, times, others } = product;
        let per_pixel = pixels == 0 || pixels == -1;
        match (electrons, counts, times) {
            _ if others || !per_pixel || !(scale.is_finite() && scale > 0.0) => Measures::Other,
            (1, 0, 0) => Measures::Electrons(scale),
            (0, 1, 0) => Measures::Counts(scale),
            (1, 0, -1) | (0, 1, -1) => Measures::Rate,
            _ => Measures::Other,
        }
    }
}

impl Product {
    fn of(name: &str) -> Product {
        match name {
            _ if ELECTRONS.contains(&name) => Product { electrons: 1, ..ONE },
            _ if COUNTS.contains(&name) => Product { counts: 1, ..ONE },
            _ if PIXELS.contains(&name) => Product { pixels: 1, ..ONE },
            _ if TIMES.contains(&name) => Product { times: 1, ..ONE },
            _ => Product { others: true, ..ONE },
        }
    }

    fn to_the(self, power: i32) -> Product {
        let times = |exponent: i32| exponent.saturating_mul(power);
        Product {
            scale: self.scale.powi(power),
            electrons: times(self.electrons),
            counts: times(self.counts),
            pixels: times(self.pixels),
            times: times(self.times),
            others: self.others,
        }
    }

    fn and(self, other: Product) -> Product {
        Product {
            scale: self.scale * other.scale,
            electrons: self.electrons.saturating_add(other.electrons),
            counts: self.counts.saturating_add(other.counts),
            pixels: self.pixels.saturating_add(other.pixels),
            times: self.times.saturating_add(other.times),
            others: self.others || other.others,
        }
    }
}

/// A text that is read from left to right.
struct Rest<'a> {
    text: &'a [char],
    at: usize,
}

impl Rest<'_> {
    /// Factors; None if something else stands there.
    fn product(&mut self) -> Option<Product> {
        let mut all = ONE;
        let mut sign = if self.skip('/') { -1 } else { 1 };
        loop {
            all = all.and(self.factor()?.to_the(sign));
            self.blanks();
            match self.peek() {
                None | Some(')') => return Some(all),
                _ if self.skip('/') || self.skip_word("per") => sign = -1,
                _ => {
                    let _ = self.skip('*') || self.skip('.');
                    sign = 1;
                }
            }
        }
    }

    fn factor(&mut self) -> Option<Product> {
        self.blanks();
        let of = match self.peek()? {
            '(' => {
                self.at += 1;
                let within = self.product()?;
                self.skip(')').then_some(within)?
            }
            digit if digit.is_ascii_digit() => Product { scale: self.number()?, ..ONE },
            letter if letter.is_ascii_alphabetic() => Product::of(&self.name()),
            _ => return None,
        };
        Some(of.to_the(self.power()?))
    }

    /// A name; `e-` is one, unless a power follows.
    fn name(&mut self) -> String {
        let is_part = |letter: &char| letter.is_ascii_alphabetic() || *letter == '_';
        let mut name: String = self.text[self.at..].iter().take_while(|letter| is_part(letter)).collect();
        self.at += name.len();
        if name == "e" && self.peek() == Some('-') && !self.is_digit(self.at + 1) {
            self.at += 1;
            name.push('-');
        }
        name
    }

    fn number(&mut self) -> Option<f64> {
        let from = self.at;
        let digits = |rest: &mut Self| {
            while rest.is_digit(rest.at) {
                rest.at += 1;
            }
        };
        digits(self);
        if self.peek() == Some('.') && self.is_digit(self.at + 1) {
            self.at += 1;
            digits(self);
        }
        let signed =
            |at: usize| self.is_digit(at) || (matches!(self.text.get(at), Some('+' | '-')) && self.is_digit(at + 1));
        if self.peek() == Some('e') && signed(self.at + 1) {
            self.at += 2;
            digits(self);
        }
        self.text[from..self.at].iter().collect::<String>().parse().ok()
    }

    /// A power, 1 if none is written; None if it is no whole number.
    fn power(&mut self) -> Option<i32> {
        let written = self.skip('^');
        let bracket = written && self.skip('(');
        let from = self.at;
        if matches!(self.peek(), Some('+' | '-')) {
            self.at += 1;
        }
        while self.is_digit(self.at) {
            self.at += 1;
        }
        let text: String = self.text[from..self.at].iter().collect();
        if text.is_empty() && !written {
            return Some(1);
        }
        let power = text.parse().ok().filter(|power: &i32| power.abs() <= 99)?;
        (!bracket || self.skip(')')).then_some(power)
    }

    fn peek(&self) -> Option<char> {
        self.text.get(self.at).copied()
    }

    fn is_digit(&self, at: usize) -> bool {
        self.text.get(at).is_some_and(char::is_ascii_digit)
    }

    fn blanks(&mut self) {
        while self.peek() == Some(' ') {
            self.at += 1;
        }
    }

    fn skip(&mut self, sign: char) -> bool {
        self.blanks();
        let there = self.peek() == Some(sign);
        self.at += usize::from(there);
        there
    }

    fn skip_word(&mut self, word: &str) -> bool {
        let end = self.at + word.len();
        let there = self.text.get(self.at..end).is_some_and(|text| text.iter().copied().eq(word.chars()))
            && self.text.get(end) == Some(&' ');
        if there {
            self.at = end;
        }
        there
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_as_files_write_them() {
        for unit in [
            "electron",
            "ELECTRONS",
            "e-",
            "e",
            "Electrons",
            "electron/pixel",
            "e-/pix",
            "electron pix-1",
            "e- per pixel",
        ] {
            assert_eq!(Measures::of(unit), Measures::Electrons(1.0), "{unit}");
        }
        for unit in ["DN", "ADU", "adu", "counts", "count/pixel", "DN/pix", "ct pix**-1", "adu.pixel^(-1)", "COUNTS"] {
            assert_eq!(Measures::of(unit), Measures::Counts(1.0), "{unit}");
        }
        for unit in [
            "electron/s",
            "ELECTRONS/S",
            "e-/s/pix",
            "DN s-1",
            "count.s**-1",
            "adu / (s pixel)",
            "e- s^-1",
            "counts/sec",
        ] {
            assert_eq!(Measures::of(unit), Measures::Rate, "{unit}");
        }
        for (unit, scale) in [
            ("10 electron", 10.0),
            ("10**3 e-", 1e3),
            ("1e4 electrons", 1e4),
            ("0.5*e-", 0.5),
            ("10^2.electron/pix", 100.0),
        ] {
            assert_eq!(Measures::of(unit), Measures::Electrons(scale), "{unit}");
        }
        assert_eq!(Measures::of("100 adu"), Measures::Counts(100.0));
        for unit in [
            "Jy",
            "electron**2",
            "electron/arcsec2",
            "electron/adu",
            "e-1",
            "sqrt(e-)",
            "electron pixel",
            "count/(",
            "s",
            "1",
            "DN DN",
            "/",
        ] {
            assert_eq!(Measures::of(unit), Measures::Other, "{unit}");
        }
        assert_eq!(Measures::of("  "), Measures::Nothing);
    }
}
