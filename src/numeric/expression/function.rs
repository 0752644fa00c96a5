//! Functions of one or two numbers.

/// A function for expressions.
#[derive(Debug)]
pub struct Function {
    pub name: &'static str,
    law: Law,
    /// Whether a value that is not finite is rejected at once. Others may be infinite on the way to a finite result.
    checked: bool,
}

#[derive(Debug)]
enum Law {
    One(fn(f64) -> f64),
    Two(fn(f64, f64) -> f64),
}

const fn one(name: &'static str, law: fn(f64) -> f64) -> Function {
    Function { name, law: Law::One(law), checked: false }
}

const fn checked(name: &'static str, law: fn(f64) -> f64) -> Function {
    Function { name, law: Law::One(law), checked: true }
}

const fn two(name: &'static str, law: fn(f64, f64) -> f64) -> Function {
    Function { name, law: Law::Two(law), checked: false }
}

/// All functions.
pub static FUNCTIONS: [Function; 20] = [
    checked("sqrt", f64::sqrt),
    checked("exp", f64::exp),
    checked("ln", f64::ln),
    checked("log10", f64::log10),
    one("sin", f64::sin),
    one("cos", f64::cos),
    one("tan", f64::tan),
    checked("asin", f64::asin),
    checked("acos", f64::acos),
    one("atan", f64::atan),
    one("sinh", f64::sinh),
    one("cosh", f64::cosh),
    one("tanh", f64::tanh),
    one("abs", f64::abs),
    one("floor", f64::floor),
    one("ceiling", f64::ceil),
    one("round", f64::round),
    two("min", |a, b| if a <= b { a } else { b }),
    two("max", |a, b| if a >= b { a } else { b }),
    two("hypot", f64::hypot),
];

/// What functions of other languages are called here.
const ELSEWHERE: [(&[&str], &str); 8] = [
    (&["log", "Log", "LOG"], "`ln` is the natural logarithm, `log10` that to base 10"),
    (&["log2", "lb", "ld"], "`ln(x) / ln(2)`"),
    (&["log1p"], "`ln(1 + x)`"),
    (&["expm1"], "`exp(x) - 1`"),
    (&["lg"], "`log10` is the logarithm to base 10, `ln` the natural one"),
    (&["pow", "power"], "`x^y` is a power"),
    (&["ceil"], "did you mean `ceiling`?"),
    (&["arcsin", "arccos", "arctan", "arctg"], "there are `asin`, `acos` and `atan`"),
];

/// What a function of another language is called here.
pub fn called_here(name: &str) -> Option<&'static str> {
    ELSEWHERE.iter().find(|(names, _)| names.contains(&name)).map(|(_, here)| *here)
}

impl Function {
    /// The function with this name.
    pub fn find(name: &str) -> Option<&'static Function> {
        FUNCTIONS.iter().find(|function| function.name == name)
    }

    /// Number of its arguments.
    pub fn arguments(&self) -> usize {
        match self.law {
            Law::One(_) => 1,
            Law::Two(_) => 2,
        }
    }

    /// Its value for the first of the given numbers.
    pub fn of(&self, arguments: &[f64]) -> f64 {
        match self.law {
            Law::One(law) => law(arguments[0]),
            Law::Two(law) => law(arguments[0], arguments[1]),
        }
    }

    /// The error for a value that is not finite, if such values are rejected at once.
    pub fn check(&self, argument: f64, value: f64) -> Result<(), String> {
        let beyond = if value == f64::INFINITY { "beyond all numbers" } else { "not a real number" };
        if self.checked { Err(format!("{}({argument}) is {beyond}", self.name)) } else { Ok(()) }
    }
}
