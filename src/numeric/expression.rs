//! A user-defined formula, such as `value * (1 + a * t_yr)`, compiled once and evaluated often.
//!
//! In ascending precedence: `||`, `&&`, `== !=`, `< <= > >=`, `+ -`, `* / %`, `^` (or `**`, right-associative), and the signs `- +
//! !`; also functions, `PI`, `true`, `false` and `if a { b } else { c }`. All numbers are real (`1/2` is 0.5). An expression
//! without a real value (the logarithm of a negative number, a division by zero) is an error with its position, instead of NaN.

mod compile;
mod function;
mod token;

use std::fmt;

use function::Function;

/// An expression, compiled to a program for a stack machine. Its names are numbered: their values are given in slots.
#[derive(Clone)]
pub struct Expression {
    text: String,
    /// Slots: names that need values, each with its first position.
    slots: Vec<(String, usize)>,
    program: Vec<Step>,
    /// Position of each step in the text.
    places: Vec<usize>,
    /// Maximum height of the stack.
    height: usize,
}

/// A step of a program. Comparisons leave 1 (true) or 0 (false).
#[derive(Clone, Copy, Debug)]
enum Step {
    Number(f64),
    Slot(usize),
    Negate,
    Not,
    Binary(Binary),
    Call(&'static Function),
    /// Continues elsewhere.
    Jump(usize),
    /// Takes a comparison from the stack, and continues elsewhere if it is false.
    JumpUnless(usize),
    /// Continues elsewhere if the comparison on the stack has this value, which stays; drops it otherwise.
    JumpIf(bool, usize),
}

/// Operations on the two numbers on top of the stack.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Binary {
    Add,
    Subtract,
    Multiply,
    Divide,
    Remainder,
    Power,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    NotEqual,
}

/// An error in an expression, and its position.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ExpressionError {
    /// The expression.
    pub text: String,
    /// Its position: number of characters before it.
    pub place: Option<usize>,
    /// The error.
    pub problem: String,
    /// What to try.
    pub help: Option<String>,
}

impl fmt::Display for ExpressionError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.place {
            Some(place) => write!(out, "{} at letter {} of `{}`", self.problem, place + 1, self.text),
            None => write!(out, "{} in `{}`", self.problem, self.text),
        }
    }
}

/// Maximum nesting of operations.
const NESTED: usize = 100;

impl Expression {
    /// Its names that need values, in the order of their slots.
    pub fn variables(&self) -> impl Iterator<Item = &str> {
        self.slots.iter().map(|(name, _)| name.as_str())
    }

    /// The slot of a name, if it occurs.
    pub fn slot(&self, name: &str) -> Option<usize> {
        self.variables().position(|known| known == name)
    }

    /// Its value for given values of its variables, in the order of their slots.
    ///
    /// # Errors
    /// If there is no real value.
    ///
    /// # Panics
    /// If there are fewer values than variables.
    pub fn value(&self, slots: &[f64]) -> Result<f64, ExpressionError> {
        // A short stack takes less time to clear.
        let run = if self.height <= 16 { Expression::run::<16> } else { Expression::run::<{ NESTED + 2 }> };
        let value = run(self, slots)?;
        if value.is_finite() { Ok(value) } else { Err(self.fault(None, format!("the result is {value}"))) }
    }

    /// The error of a variable that has no value.
    pub fn without_value(&self, slot: usize) -> ExpressionError {
        let (name, place) = &self.slots[slot];
        self.fault(Some(*place), format!("there is no value for `{name}` here"))
    }

    fn fault(&self, place: Option<usize>, problem: String) -> ExpressionError {
        ExpressionError { text: self.text.clone(), place, problem, help: None }
    }

    fn run<const HEIGHT: usize>(&self, slots: &[f64]) -> Result<f64, ExpressionError> {
        let mut stack = [0.0; HEIGHT];
        // The height of the stack, and the next step.
        let (mut height, mut next) = (0, 0);
        while let Some(step) = self.program.get(next) {
            next += 1;
            match *step {
                Step::Number(number) => {
                    stack[height] = number;
                    height += 1;
                }
                Step::Slot(slot) => {
                    stack[height] = slots[slot];
                    height += 1;
                }
                Step::Negate => stack[height - 1] = -stack[height - 1],
                Step::Not => stack[height - 1] = 1.0 - stack[height - 1],
                Step::Binary(binary) => {
                    height -= 1;
                    let (a, b) = (stack[height - 1], stack[height]);
                    let value = binary.of(a, b);
                    if !value.is_finite() {
                        binary.check(a, b).map_err(|problem| self.fault(Some(self.places[next - 1]), problem))?;
                    }
                    stack[height - 1] = value;
                }
                Step::Call(function) => {
                    height -= function.arguments() - 1;
                    let value = function.of(&stack[height - 1..]);
                    if !value.is_finite() {
                        let problem = function.check(stack[height - 1], value);
                        problem.map_err(|problem| self.fault(Some(self.places[next - 1]), problem))?;
                    }
                    stack[height - 1] = value;
                }
                Step::Jump(to) => next = to,
                Step::JumpUnless(to) => {
                    height -= 1;
                    next = if stack[height] == 0.0 { to } else { next };
                }
                Step::JumpIf(this, to) => {
                    if (stack[height - 1] != 0.0) == this {
                        next = to;
                    } else {
                        height -= 1;
                    }
                }
            }
        }
        Ok(stack[0])
    }
}

impl Binary {
    fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Binary::Add => a + b,
            Binary::Subtract => a - b,
            Binary::Multiply => a * b,
            Binary::Divide => a / b,
            Binary::Remainder => a % b,
            Binary::Power => a.powf(b),
            Binary::Less => f64::from(a < b),
            Binary::LessOrEqual => f64::from(a <= b),
            Binary::Greater => f64::from(a > b),
            Binary::GreaterOrEqual => f64::from(a >= b),
            Binary::Equal => f64::from(a == b),
            Binary::NotEqual => f64::from(a != b),
        }
    }

    /// Rejects divisions and powers without a numeric value; sums may become infinite on the way.
    fn check(self, a: f64, b: f64) -> Result<(), String> {
        match self {
            Binary::Divide => Err(format!("{a} / {b} is not a number")),
            Binary::Power => Err(format!("{a} ^ {b} is not a real number")),
            _ => Ok(()),
        }
    }
}

impl fmt::Debug for Expression {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.text.fmt(out)
    }
}

impl PartialEq for Expression {
    fn eq(&self, other: &Expression) -> bool {
        self.text == other.text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> f64 {
        Expression::parse(text).unwrap().value(&[0.5]).unwrap()
    }

    #[test]
    fn arithmetic_is_that_of_paper() {
        for (text, expected) in [
            ("1/2", 0.5),
            ("2 * x^2", 0.5),
            ("2 ** 3 ^ 2", 512.0),
            ("1 - x^2", 0.75),
            ("(-x)^2", 0.25),
            ("-(x^2)", -0.25),
            ("1e-3 * x", 5e-4),
            ("1.5E3*x", 750.0),
            ("exp(-x) * sqrt(4)", 2.0 * (-0.5_f64).exp()),
            ("min(x, 3) + max(1, 2)", 2.5),
            ("if x > 0.2 && x < 1 { 3 } else { 4 }", 3.0),
            ("cos(PI)", -1.0),
            ("x^-1", 2.0),
            ("8 / 2 / 2", 2.0),
        ] {
            assert!((value(text) - expected).abs() < 1e-12, "{text} = {}, not {expected}", value(text));
        }
    }

    /// Precedence, associativity, functions and conditions must never change.
    #[test]
    fn values_are_those_of_the_golden_table() {
        for row in csv::Reader::from_path("tests/golden/formulas.csv").unwrap().deserialize() {
            let (golden, text): (f64, String) = row.unwrap();
            let expression = Expression::parse(&text).unwrap_or_else(|error| panic!("{error}"));
            let slot = |name: &str| match name {
                "x" => 0.5,
                "y" => -3.25,
                "t_yr" => 4.0,
                "value" => 1e-3,
                name => panic!("{name} in {text}"),
            };
            let value = expression.value(&expression.variables().map(slot).collect::<Vec<_>>()).unwrap();
            assert!((value - golden).abs() <= 1e-12 * golden.abs(), "{text} = {value}, not {golden}");
        }
    }

    #[test]
    fn the_depth_is_limited_and_the_length_is_not() {
        for (open, close) in [("(", ")"), ("-(", ")"), ("max(1, ", ")"), ("1 ^ ", ""), ("1 + 2 * (x - ", ")")] {
            let nested = |depth: usize| format!("{}1{}", open.repeat(depth), close.repeat(depth));
            assert!(Expression::parse(&nested(20)).unwrap().value(&[0.5]).is_ok(), "{open}");
            let error = Expression::parse(&nested(5000)).unwrap_err();
            assert_eq!(error.problem, "more than 100 operations are inside one another", "{open}");
            // The deepest nesting accepted fits the stack.
            let deepest = (1..=100).rev().find_map(|depth| Expression::parse(&nested(depth)).ok()).unwrap();
            assert!(deepest.value(&[0.5]).is_ok(), "{open}");
        }
        assert_eq!(Expression::parse(&format!("1{}", " + 1".repeat(9999))).unwrap().value(&[]).unwrap(), 1e4);
    }

    #[test]
    fn what_decides_is_all_that_is_looked_at() {
        assert_eq!(value("if x > 1 && ln(-1) > 0 { ln(-1) } else { x }"), 0.5);
        assert_eq!(value("if x < 1 || ln(-1) > 0 { x } else { ln(-1) }"), 0.5);
        assert_eq!(value("if 1e-20 > 0 { 1 } else { 2 }"), 1.0);
    }

    #[test]
    fn an_error_names_its_place() {
        for (text, place, problem) in [
            ("2 + ", 4, "something is missing at the end"),
            ("2 x", 2, "an operator is missing before `x`"),
            ("2 * (1 + x", 4, "this `(` is not closed"),
            ("if x > 0 { 1 }", 14, "an `if` needs an `else { ... }`"),
            ("if x { 1 } else { 2 }", 0, "`if` takes comparisons, not numbers"),
            ("1 + (x > 0)", 2, "`+` takes numbers, not comparisons"),
            ("max(x)", 0, "`max` takes 2 numbers, not 1"),
            ("-x^2", 0, "a sign in front of a power can mean two things"),
            ("2 * erf(x)", 4, "no function is called `erf`"),
            ("let y = 3", 4, "an operator is missing before `y`"),
            ("2 // x", 2, "unexpected `//`"),
            ("2 /* x", 2, "unexpected `/*`"),
        ] {
            let error = Expression::parse(text).unwrap_err();
            assert_eq!((error.place, error.problem.as_str()), (Some(place), problem), "{text}");
        }
        for (text, place, problem) in [
            ("1 + ln(x - 1)", Some(4), "ln(-0.5) is not a real number"),
            ("1 / (x - x)", Some(2), "1 / 0 is not a number"),
            ("1e308 * x * 1e10", None, "the result is inf"),
        ] {
            let error = Expression::parse(text).unwrap().value(&[0.5]).unwrap_err();
            assert_eq!((error.place, error.problem.as_str()), (place, problem), "{text}");
        }
        let error = Expression::parse("2 * y").unwrap().without_value(0);
        assert_eq!(error.to_string(), "there is no value for `y` here at letter 5 of `2 * y`");
        let error = Expression::parse("x > 2").unwrap_err();
        assert_eq!(error.to_string(), "the result is not a number in `x > 2`");
    }

    #[test]
    fn names_of_other_languages_lead_to_functions_that_exist() {
        for (name, here) in
            [("log", "`ln`"), ("log", "`log10`"), ("log2", "ln(x)"), ("ceil", "`ceiling`"), ("pow", "x^y")]
        {
            let error = Expression::parse(&format!("1 + {name}(x)")).unwrap_err();
            assert!(error.help.unwrap().contains(here), "{name}");
        }
    }

    #[test]
    fn no_text_makes_it_panic() {
        for text in [
            "",
            " ",
            "(",
            ")",
            "-",
            "^",
            "-(",
            "é",
            "1e",
            "x(",
            "((((x))))",
            "\"",
            "\\",
            "-x ^",
            "if",
            "}{",
            "π",
            "0x",
            "'a",
        ] {
            if let Ok(expression) = Expression::parse(text) {
                let _ = expression.value(&vec![1.0; expression.variables().count()]);
            }
        }
    }
}
