//! The tokens of an expression: numbers, names, and symbols.

/// A token and its position.
#[derive(Clone, Copy, Debug)]
pub struct Token<'a> {
    pub kind: TokenKind,
    pub text: &'a str,
    /// Byte offset.
    pub at: usize,
}

#[derive(Clone, Copy, Debug)]
pub enum TokenKind {
    Number(f64),
    Name,
    Symbol,
    End,
}

/// Symbols of two characters. No operator begins with `//` or `/*`, which are comments elsewhere.
const PAIRS: [&str; 9] = ["**", "<=", ">=", "==", "!=", "&&", "||", "//", "/*"];

/// The first token at or after a byte offset.
pub fn next_token(text: &str, from: usize) -> Token<'_> {
    let rest = text[from..].trim_start();
    let at = text.len() - rest.len();
    let token = |kind, length| Token { kind, text: &rest[..length], at };
    let Some(first) = rest.chars().next() else { return token(TokenKind::End, 0) };
    if first.is_ascii_digit() {
        let length = number_length(rest);
        let number = rest[..length].replace('_', "").parse().expect("digits, point and exponent are a number");
        token(TokenKind::Number(number), length)
    } else if first.is_ascii_alphabetic() || first == '_' {
        token(TokenKind::Name, run(rest, |letter| letter.is_ascii_alphanumeric() || letter == b'_'))
    } else if PAIRS.iter().any(|pair| rest.starts_with(pair)) {
        token(TokenKind::Symbol, 2)
    } else {
        token(TokenKind::Symbol, first.len_utf8())
    }
}

/// Length of a number with optional fraction and exponent, such as `1_000.5e-3`.
fn number_length(text: &str) -> usize {
    let digits = |from: usize| run(&text[from..], |letter| letter.is_ascii_digit() || letter == b'_');
    let starts = |from: usize| text[from..].starts_with(|letter: char| letter.is_ascii_digit());
    let mut length = digits(0);
    if text[length..].starts_with('.') && starts(length + 1) {
        length += 1 + digits(length + 1);
    }
    if text[length..].starts_with(['e', 'E']) {
        let sign = usize::from(text[length + 1..].starts_with(['+', '-']));
        if starts(length + 1 + sign) {
            length += 1 + sign + digits(length + 1 + sign);
        }
    }
    length
}

fn run(text: &str, holds: impl Fn(u8) -> bool) -> usize {
    text.bytes().position(|letter| !holds(letter)).unwrap_or(text.len())
}
