//! A formula that a user wrote, such as `value * (1 + a * t_yr)`, and its value.
//!
//! The evaluator is rhai's, cut down to arithmetic, comparisons, functions and `if a { b } else { c }`: no statements, no
//! loops. All numbers are real (`1/2` is 0.5), powers are written `^` or `**`, and what has no real value (the logarithm of
//! a negative number, a division by zero) is refused at its place instead of becoming NaN.

use std::fmt;
use std::sync::LazyLock;

use rhai::packages::{ArithmeticPackage, BasicMathPackage, LogicPackage, Package};
use rhai::{AST, Engine, EvalAltResult, ImmutableString, OptimizationLevel, ParseErrorType, Position, Scope, Token};

use crate::error::nearest;

/// An expression that can be evaluated again and again.
#[derive(Clone)]
pub struct Expression {
    text: String,
    tree: AST,
    variables: Vec<ImmutableString>,
}

/// What is wrong with an expression, and where in it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ExpressionError {
    /// The expression.
    pub text: String,
    /// Place in it: letters before what is wrong.
    pub place: Option<usize>,
    /// What is wrong.
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

/// Functions of one argument.
const FUNCTIONS: [&str; 17] = [
    "sqrt", "exp", "ln", "log10", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "abs", "floor",
    "ceiling", "round",
];

/// Functions of two arguments.
const FUNCTIONS_OF_TWO: [&str; 3] = ["min", "max", "hypot"];

type Fallible = Result<f64, Box<EvalAltResult>>;

static ENGINE: LazyLock<Engine> = LazyLock::new(|| {
    let mut engine = Engine::new_raw();
    engine.register_global_module(ArithmeticPackage::new().as_shared_module());
    engine.register_global_module(BasicMathPackage::new().as_shared_module());
    engine.register_global_module(LogicPackage::new().as_shared_module());
    // What is registered below must be called, and nothing computed ahead of it.
    engine.set_fast_operators(false);
    engine.set_optimization_level(OptimizationLevel::None);
    engine.set_max_expr_depths(100);
    #[allow(deprecated)] // not deprecated: rhai marks what may change with its next version so
    engine.on_parse_token(|token, _, _| match token {
        Token::IntegerConstant(number) => {
            Token::FloatConstant(Box::new(((number as f64).into(), number.to_string().into())))
        }
        Token::XOr => Token::PowerOf,
        other => other,
    });
    fn real(value: f64, said: impl FnOnce() -> String) -> Fallible {
        if value.is_finite() { Ok(value) } else { Err(said().into()) }
    }
    engine.register_fn("/", |a: f64, b: f64| real(a / b, || format!("{a} / {b} is no number")));
    engine.register_fn("**", |a: f64, b: f64| real(a.powf(b), || format!("{a} ^ {b} is no real number")));
    engine.register_fn("ln", |x: f64| real(x.ln(), || format!("ln({x}) is no real number")));
    engine.register_fn("log10", |x: f64| real(x.log10(), || format!("log10({x}) is no real number")));
    engine.register_fn("sqrt", |x: f64| real(x.sqrt(), || format!("sqrt({x}) is no real number")));
    engine.register_fn("asin", |x: f64| real(x.asin(), || format!("asin({x}) is no real number")));
    engine.register_fn("acos", |x: f64| real(x.acos(), || format!("acos({x}) is no real number")));
    engine.register_fn("exp", |x: f64| real(x.exp(), || format!("exp({x}) is beyond all numbers")));
    engine.register_fn("hypot", |x: f64, y: f64| x.hypot(y));
    engine
});

impl Expression {
    /// Reads an expression.
    ///
    /// # Errors
    /// Where it is none.
    pub fn parse(text: &str) -> Result<Expression, ExpressionError> {
        let fault = |place: Option<usize>, problem: String, help: Option<&str>| ExpressionError {
            text: text.to_string(),
            place,
            problem,
            help: help.map(str::to_string),
        };
        if let Some(place) = negated_power(text) {
            let help = "write -(x ^ 2) or (-x) ^ 2";
            return Err(fault(Some(place), "a sign in front of a power can mean two things".into(), Some(help)));
        }
        if let Some(place) = ["//", "/*"].iter().filter_map(|mark| text.find(mark)).min() {
            let help = "a division is one /, a product one *";
            let place = text[..place].chars().count();
            return Err(fault(
                Some(place),
                "what follows would be a comment, and a formula has none".into(),
                Some(help),
            ));
        }
        let tree = ENGINE.compile_expression(text).map_err(|error| {
            let help = match error.err_type() {
                ParseErrorType::UnexpectedEOF => Some("something is missing at the end"),
                _ => None,
            };
            fault(place_of(error.position()), error.err_type().to_string().to_lowercase(), help)
        })?;
        let mut variables = Vec::new();
        for (word, place, called) in words(text) {
            if called {
                if !FUNCTIONS.contains(&word) && !FUNCTIONS_OF_TWO.contains(&word) {
                    let known = || FUNCTIONS.into_iter().chain(FUNCTIONS_OF_TWO);
                    let help = nearest(word, known()).map_or_else(
                        || format!("there are: {}", known().collect::<Vec<_>>().join(", ")),
                        |near| format!("did you mean `{near}`?"),
                    );
                    return Err(fault(Some(place), format!("no function is called `{word}`"), Some(&help)));
                }
            } else if !["if", "else", "true", "false", "PI"].contains(&word)
                && !variables.iter().any(|known| known == word)
            {
                variables.push(word.into());
            }
        }
        Ok(Expression { text: text.to_string(), tree, variables })
    }

    /// Names in it that must be given values.
    pub fn variables(&self) -> impl Iterator<Item = &str> {
        self.variables.iter().map(ImmutableString::as_str)
    }

    /// Its value, where `known` tells those of its variables.
    ///
    /// # Errors
    /// Where a variable is not known, or there is no real value.
    pub fn value(&self, known: impl Fn(&str) -> Option<f64>) -> Result<f64, ExpressionError> {
        let fault = |place, problem| ExpressionError { text: self.text.clone(), place, problem, help: None };
        let mut scope = Scope::new();
        scope.push_constant("PI", std::f64::consts::PI);
        for name in &self.variables {
            let value = known(name).ok_or_else(|| {
                let place = words(&self.text).find(|(word, ..)| word == name).map(|(_, place, _)| place);
                fault(place, format!("there is no value for `{name}` here"))
            })?;
            scope.push_constant(name.as_str(), value);
        }
        let value = ENGINE.eval_ast_with_scope::<f64>(&mut scope, &self.tree).map_err(|error| {
            let problem = match &*error {
                EvalAltResult::ErrorRuntime(message, _) => message.to_string(),
                EvalAltResult::ErrorMismatchOutputType(..) => "the result is not a number".into(),
                other => {
                    let mut other = other.to_string();
                    other.truncate(other.find(" (line").unwrap_or(other.len()));
                    other
                }
            };
            fault(place_of(error.position()), problem)
        })?;
        if value.is_finite() { Ok(value) } else { Err(fault(None, format!("the result is {value}"))) }
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

fn place_of(position: Position) -> Option<usize> {
    position.position().map(|column| column - 1)
}

/// Names in a text: each with its place (in letters) and whether an opening parenthesis follows.
fn words(text: &str) -> impl Iterator<Item = (&str, usize, bool)> {
    let is_part = |letter: char| letter.is_alphanumeric() || letter == '_';
    let mut rest = 0;
    std::iter::from_fn(move || {
        loop {
            let start = rest + text[rest..].find(is_part)?;
            let length = text[start..].find(|letter| !is_part(letter)).unwrap_or(text.len() - start);
            rest = start + length;
            let word = &text[start..rest];
            if word.starts_with(|letter: char| letter.is_ascii_digit()) {
                continue;
            }
            // The exponent of 1.e5.
            if text[..start].ends_with('.') && word.starts_with(['e', 'E']) {
                continue;
            }
            let called = text[rest..].trim_start().starts_with('(');
            return Some((word, text[..start].chars().count(), called));
        }
    })
}

/// Place of a sign that stands directly before a power, as in `-x ^ 2`: people mean −(x²), programs differ.
fn negated_power(text: &str) -> Option<usize> {
    let letters: Vec<char> = text.chars().collect();
    let next = |mut at: usize| {
        while at < letters.len() && letters[at].is_whitespace() {
            at += 1;
        }
        at
    };
    for (place, _) in letters.iter().enumerate().filter(|(_, letter)| **letter == '-') {
        let before = letters[..place].iter().rev().find(|letter| !letter.is_whitespace());
        if before.is_some_and(|letter| letter.is_alphanumeric() || ")_.".contains(*letter)) {
            continue;
        }
        let mut at = next(place + 1);
        while at < letters.len() && (letters[at].is_alphanumeric() || "_.".contains(letters[at])) {
            at += 1;
        }
        if letters.get(next(at)) == Some(&'(') {
            let mut depth = 0;
            at = next(at);
            while at < letters.len() {
                depth += i32::from(letters[at] == '(') - i32::from(letters[at] == ')');
                at += 1;
                if depth == 0 {
                    break;
                }
            }
        }
        at = next(at);
        if letters.get(at) == Some(&'^') || letters[at.min(letters.len())..].starts_with(&['*', '*']) {
            return Some(place);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> f64 {
        Expression::parse(text).unwrap().value(|name| (name == "x").then_some(0.5)).unwrap()
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

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        for (text, place, problem) in [
            ("2 + ", 4, "script is incomplete"),
            ("2 x", 2, "unexpected 'x'"),
            ("-x^2", 0, "a sign in front of a power can mean two things"),
            ("2 * erf(x)", 4, "no function is called `erf`"),
            ("let y = 3", 0, "unexpected 'let'"),
            ("2 // x", 2, "what follows would be a comment, and a formula has none"),
            ("2 /* x", 2, "what follows would be a comment, and a formula has none"),
        ] {
            let error = Expression::parse(text).unwrap_err();
            assert_eq!((error.place, error.problem.as_str()), (Some(place), problem), "{text}");
        }
        for (text, place, problem) in [
            ("1 + ln(x - 1)", Some(4), "ln(-0.5) is no real number"),
            ("1 / (x - x)", Some(2), "0.5 / 0 is no number"),
            ("2 * y", Some(4), "there is no value for `y` here"),
            ("x > 2", None, "the result is not a number"),
        ] {
            let error = Expression::parse(text).unwrap().value(|name| (name == "x").then_some(0.5)).unwrap_err();
            if text != "1 / (x - x)" {
                assert_eq!((error.place, error.problem.as_str()), (place, problem), "{text}");
            } else {
                assert!(error.place == place && error.problem.ends_with("is no number"), "{error}");
            }
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
                let _ = expression.value(|_| Some(1.0));
            }
        }
    }
}
