//! Printed text that is the same but for the last digit of its numbers, in which machines differ: their libraries compute `exp`
//! or `pow` to the last bit or not.

/// A piece of a line.
#[derive(Debug, PartialEq)]
enum Piece<'a> {
    /// Words and signs; blanks between them do not count, for columns are as wide as their numbers.
    Text(Vec<&'a str>),
    /// A number with a point or an exponent, and what its last digit is worth.
    Number(f64, f64),
}

/// The first lines that differ: words and whole numbers (years, counts) in anything, other numbers by more than one in the last
/// printed digit.
pub fn first_difference<'a>(shown: &'a str, printed: &'a str) -> Option<(&'a str, &'a str)> {
    let (mut shown, mut printed) = (shown.lines(), printed.lines());
    loop {
        match (shown.next(), printed.next()) {
            (None, None) => return None,
            (Some(a), Some(b)) if same(a, b) => {}
            (a, b) => return Some((a.unwrap_or("(no line)"), b.unwrap_or("(no line)"))),
        }
    }
}

fn same(a: &str, b: &str) -> bool {
    let (a, b) = (pieces(a), pieces(b));
    a.len() == b.len()
        && a.iter().zip(&b).all(|pair| match pair {
            // A little more than one digit, for decimal fractions are not exact.
            (Piece::Number(a, one), Piece::Number(b, other)) => (a - b).abs() <= 1.001 * one.max(*other),
            (a, b) => a == b,
        })
}

fn pieces(line: &str) -> Vec<Piece<'_>> {
    let mut pieces = Vec::new();
    let (mut start, mut at) = (0, 0);
    while at < line.len() {
        let length = number_length(line, at);
        let number = &line[at..at + length];
        if number.contains(['.', 'e']) {
            pieces.push(Piece::Text(line[start..at].split_whitespace().collect()));
            pieces.push(Piece::Number(number.parse().unwrap(), last_digit(number)));
            start = at + length;
        }
        at += if length > 0 { length } else { line[at..].chars().next().map_or(1, char::len_utf8) };
    }
    pieces.push(Piece::Text(line[start..].split_whitespace().collect()));
    pieces
}

/// Length of the number that begins at a byte, with its sign; 0 if none does.
fn number_length(line: &str, at: usize) -> usize {
    let digits = |from: usize| line[from..].bytes().take_while(u8::is_ascii_digit).count();
    let before = line[..at].chars().next_back();
    if before.is_some_and(|letter| letter.is_alphanumeric() || "_.".contains(letter)) {
        return 0;
    }
    let mut end = at + usize::from(line[at..].starts_with(['+', '-']));
    let whole = digits(end);
    end += whole;
    if whole == 0 {
        return 0;
    }
    if line[end..].starts_with('.') && digits(end + 1) > 0 {
        end += 1 + digits(end + 1);
    }
    if line[end..].starts_with('e') {
        let sign = usize::from(line[end + 1..].starts_with(['+', '-']));
        let power = digits(end + 1 + sign);
        end += if power > 0 { 1 + sign + power } else { 0 };
    }
    end - at
}

/// What the last digit of a number's mantissa is worth.
fn last_digit(number: &str) -> f64 {
    let (mantissa, power) = number.split_once('e').unwrap_or((number, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    10_f64.powi(power.parse::<i32>().unwrap() - decimals as i32)
}

#[test]
fn the_last_digit_may_differ_and_nothing_else() {
    for (a, b) in [
        ("chi2 137.6", "chi2 137.7"),
        ("x  -9.99 ms", "x -10.00 ms"),
        ("1.20e-4 (4.1 %)", "1.21e-4 (4.0 %)"),
        ("2002-03-14 at 0.5 yr", "2002-03-14 at 0.5 yr"),
        ("-0.00 e-", "0.00 e-"),
    ] {
        assert_eq!(first_difference(a, b), None);
    }
    for (a, b) in [
        ("chi2 137.6", "chi2 137.8"),
        ("1.20e-4", "1.22e-4"),
        ("1.20e-4", "1.20e-5"),
        ("12 rows", "13 rows"),
        ("2002-03-14", "2002-03-15"),
        ("delta_e1 0.5", "delta_e2 0.5"),
        ("0.5 ms", "0.5 s"),
        ("0.5", "0.5 0.5"),
        ("a\nb", "a"),
        ("1.5-2.5", "1.5-2.7"),
    ] {
        assert!(first_difference(a, b).is_some(), "{a} and {b}");
    }
}
