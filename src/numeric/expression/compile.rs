//! Text of an expression → its program, in one pass by operator precedence (Pratt 1973).

use super::function::{FUNCTIONS, Function, called_here};
use super::token::{Token, TokenKind, next_token};
use super::{Binary, Expression, ExpressionError, NESTED, Step};
use crate::error::nearest;

/// The type of an expression.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Type {
    Number,
    Truth,
}

/// Precedence of `^`, the only right-associative operator.
const POWER: u8 = 7;

/// A binary operator, and its precedence.
fn binary(symbol: &str) -> Option<(Operator, u8)> {
    use Binary::*;
    Some(match symbol {
        "||" => (Operator::Logical { decided_by: true }, 1),
        "&&" => (Operator::Logical { decided_by: false }, 2),
        "==" => (Operator::Equality(Equal), 3),
        "!=" => (Operator::Equality(NotEqual), 3),
        "<" => (Operator::Comparison(Less), 4),
        "<=" => (Operator::Comparison(LessOrEqual), 4),
        ">" => (Operator::Comparison(Greater), 4),
        ">=" => (Operator::Comparison(GreaterOrEqual), 4),
        "+" => (Operator::Arithmetic(Add), 5),
        "-" => (Operator::Arithmetic(Subtract), 5),
        "*" => (Operator::Arithmetic(Multiply), 6),
        "/" => (Operator::Arithmetic(Divide), 6),
        "%" => (Operator::Arithmetic(Remainder), 6),
        "^" | "**" => (Operator::Arithmetic(Power), POWER),
        _ => return None,
    })
}

enum Operator {
    /// Numbers to a number.
    Arithmetic(Binary),
    /// Numbers to true or false.
    Comparison(Binary),
    /// Two numbers, or two comparisons, to true or false.
    Equality(Binary),
    /// Comparisons to true or false; the second is not evaluated if the first decides.
    Logical { decided_by: bool },
}

impl Expression {
    /// Compiles an expression.
    ///
    /// # Errors
    /// If it is not an expression.
    pub fn parse(text: &str) -> Result<Expression, ExpressionError> {
        let expression =
            Expression { text: text.to_string(), slots: vec![], program: vec![], places: vec![], height: 0 };
        let mut compiler = Compiler { text, token: next_token(text, 0), nested: 0, height: 0, expression };
        let whole = compiler.value(0).and_then(|kind| compiler.end(kind));
        whole.map_err(|Fault { at, problem, help }| ExpressionError {
            text: text.to_string(),
            place: at.map(|at| letters(text, at)),
            problem,
            help,
        })?;
        Ok(compiler.expression)
    }
}

/// An error, and its byte offset.
struct Fault {
    at: Option<usize>,
    problem: String,
    help: Option<String>,
}

fn fault<T>(at: usize, problem: impl Into<String>) -> Result<T, Fault> {
    Err(Fault { at: Some(at), problem: problem.into(), help: None })
}

fn fault_with_help<T>(at: usize, problem: impl Into<String>, help: impl Into<String>) -> Result<T, Fault> {
    Err(Fault { at: Some(at), problem: problem.into(), help: Some(help.into()) })
}

fn letters(text: &str, at: usize) -> usize {
    text[..at].chars().count()
}

struct Compiler<'a> {
    text: &'a str,
    /// The next token.
    token: Token<'a>,
    /// Current nesting of operations.
    nested: usize,
    /// Current height of the stack.
    height: usize,
    expression: Expression,
}

impl<'a> Compiler<'a> {
    fn advance(&mut self) -> Token<'a> {
        let next = next_token(self.text, self.token.at + self.token.text.len());
        std::mem::replace(&mut self.token, next)
    }

    /// Consumes a token, if it is the next one.
    fn takes(&mut self, text: &str) -> bool {
        let there = self.token.text == text;
        if there {
            self.advance();
        }
        there
    }

    /// Adds a step, at a byte offset, that changes the stack's height. Returns its index.
    fn add(&mut self, step: Step, at: usize, change: isize) -> usize {
        self.height = self.height.saturating_add_signed(change);
        self.expression.height = self.expression.height.max(self.height);
        self.expression.program.push(step);
        self.expression.places.push(letters(self.text, at));
        self.expression.program.len() - 1
    }

    /// Sets the target of a jump to the current position.
    fn land(&mut self, jump: usize) {
        let here = self.expression.program.len();
        match &mut self.expression.program[jump] {
            Step::Jump(to) | Step::JumpUnless(to) | Step::JumpIf(_, to) => *to = here,
            _ => unreachable!("only jumps land"),
        }
    }

    fn nest<T>(&mut self, inner: impl FnOnce(&mut Self) -> Result<T, Fault>) -> Result<T, Fault> {
        self.nested += 1;
        if self.nested > NESTED {
            return fault(self.token.at, format!("more than {NESTED} operations are inside one another"));
        }
        let value = inner(self);
        self.nested -= 1;
        value
    }

    /// A value with all operators of at least this precedence.
    fn value(&mut self, least: u8) -> Result<Type, Fault> {
        self.nest(|this| {
            let mut left = this.signed()?;
            while let Some((operator, tightness)) = binary(this.token.text)
                && tightness >= least
            {
                left = this.operation(left, operator, tightness)?;
            }
            Ok(left)
        })
    }

    /// An operator and its right operand.
    fn operation(&mut self, left: Type, operator: Operator, tightness: u8) -> Result<Type, Fault> {
        let sign = self.advance();
        let least = if tightness == POWER { POWER } else { tightness + 1 };
        let both = |this: &mut Self, wanted: Type| {
            expect(left, wanted, &sign)?;
            expect(this.value(least)?, wanted, &sign)
        };
        match operator {
            Operator::Logical { decided_by } => {
                expect(left, Type::Truth, &sign)?;
                let jump = self.add(Step::JumpIf(decided_by, 0), sign.at, -1);
                both(self, Type::Truth)?;
                self.land(jump);
            }
            Operator::Arithmetic(binary) | Operator::Comparison(binary) => {
                both(self, Type::Number)?;
                self.add(Step::Binary(binary), sign.at, -1);
            }
            Operator::Equality(binary) => {
                both(self, left)?;
                self.add(Step::Binary(binary), sign.at, -1);
            }
        }
        Ok(if matches!(operator, Operator::Arithmetic(_)) { Type::Number } else { Type::Truth })
    }

    /// A value with its signs.
    fn signed(&mut self) -> Result<Type, Fault> {
        let (wanted, step) = match self.token.text {
            "-" => (Type::Number, Some(Step::Negate)),
            "+" => (Type::Number, None),
            "!" => (Type::Truth, Some(Step::Not)),
            _ => return self.operand(),
        };
        let sign = self.advance();
        let value = self.nest(Self::signed)?;
        expect(value, wanted, &sign)?;
        // -x^2 is meant as -(x^2), but programs differ.
        if sign.text == "-" && ["^", "**"].contains(&self.token.text) {
            let help = "write -(x ^ 2) or (-x) ^ 2";
            return fault_with_help(sign.at, "a sign in front of a power can mean two things", help);
        }
        if let Some(step) = step {
            self.add(step, sign.at, 0);
        }
        Ok(value)
    }

    fn operand(&mut self) -> Result<Type, Fault> {
        let token = self.advance();
        match token.kind {
            TokenKind::Number(number) => self.number(number, &token),
            TokenKind::Name => match token.text {
                "if" => self.branch(&token),
                "true" => self.number(1.0, &token).map(|_| Type::Truth),
                "false" => self.number(0.0, &token).map(|_| Type::Truth),
                "PI" => self.number(std::f64::consts::PI, &token),
                "else" => unexpected(&token),
                _ if self.token.text == "(" => self.call(&token),
                _ => self.variable(&token),
            },
            TokenKind::Symbol if token.text == "(" => {
                let value = self.value(0)?;
                self.close(&token)?;
                Ok(value)
            }
            TokenKind::Symbol => unexpected(&token),
            TokenKind::End => fault(token.at, "something is missing at the end"),
        }
    }

    fn number(&mut self, number: f64, token: &Token) -> Result<Type, Fault> {
        self.add(Step::Number(number), token.at, 1);
        Ok(Type::Number)
    }

    fn variable(&mut self, token: &Token) -> Result<Type, Fault> {
        let slot = self.expression.slot(token.text).unwrap_or_else(|| {
            self.expression.slots.push((token.text.to_string(), letters(self.text, token.at)));
            self.expression.slots.len() - 1
        });
        self.add(Step::Slot(slot), token.at, 1);
        Ok(Type::Number)
    }

    fn call(&mut self, name: &Token) -> Result<Type, Fault> {
        let Some(function) = Function::find(name.text) else {
            let known = || FUNCTIONS.iter().map(|function| function.name);
            let help = match (called_here(name.text), nearest(name.text, known())) {
                (Some(ours), _) => ours.to_string(),
                (None, Some(near)) => format!("did you mean `{near}`?"),
                (None, None) => format!("there are: {}", known().collect::<Vec<_>>().join(", ")),
            };
            return fault_with_help(name.at, format!("no function is called `{}`", name.text), help);
        };
        let open = self.advance();
        let mut given = 0;
        while self.token.text != ")" {
            let kind = self.value(0)?;
            expect(kind, Type::Number, name)?;
            given += 1;
            if !self.takes(",") {
                break;
            }
        }
        self.close(&open)?;
        let wanted = function.arguments();
        if given != wanted {
            let numbers = if wanted == 1 { "1 number" } else { "2 numbers" };
            return fault(name.at, format!("`{}` takes {numbers}, not {given}", name.text));
        }
        self.add(Step::Call(function), name.at, 1 - wanted as isize);
        Ok(Type::Number)
    }

    /// `if a { b } else { c }`, whose `if` has been consumed.
    fn branch(&mut self, word: &Token) -> Result<Type, Fault> {
        expect(self.value(0)?, Type::Truth, word)?;
        let otherwise = self.add(Step::JumpUnless(0), word.at, -1);
        let value = self.block()?;
        let end = self.add(Step::Jump(0), word.at, -1);
        self.land(otherwise);
        if !self.takes("else") {
            return fault(self.token.at, "an `if` needs an `else { ... }`");
        }
        let other = if self.token.text == "if" {
            let word = self.advance();
            self.nest(|this| this.branch(&word))?
        } else {
            self.block()?
        };
        self.land(end);
        if value == other { Ok(value) } else { fault(word.at, "an `if` gives a number in both cases, or in none") }
    }

    fn block(&mut self) -> Result<Type, Fault> {
        let open = self.advance();
        match open.kind {
            _ if open.text == "{" => {}
            TokenKind::Symbol => return unexpected(&open),
            _ => return fault(open.at, "a `{` is missing here"),
        }
        let value = self.value(0)?;
        self.close(&open)?;
        Ok(value)
    }

    /// The closing parenthesis or brace of a value.
    fn close(&mut self, open: &Token) -> Result<(), Fault> {
        if self.takes(if open.text == "(" { ")" } else { "}" }) {
            return Ok(());
        }
        match self.token.kind {
            TokenKind::End => fault(open.at, format!("this `{}` is not closed", open.text)),
            _ => unexpected_after_value(&self.token),
        }
    }

    /// Checks that nothing follows the whole expression, and that it is a number.
    fn end(&mut self, whole: Type) -> Result<(), Fault> {
        match (self.token.kind, whole) {
            (TokenKind::End, Type::Number) => Ok(()),
            (TokenKind::End, Type::Truth) => {
                Err(Fault { at: None, problem: "the result is not a number".into(), help: None })
            }
            _ => unexpected_after_value(&self.token),
        }
    }
}

fn expect(value: Type, wanted: Type, of: &Token) -> Result<(), Fault> {
    match wanted {
        _ if value == wanted => Ok(()),
        Type::Number => fault(of.at, format!("`{}` takes numbers, not comparisons", of.text)),
        Type::Truth => fault(of.at, format!("`{}` takes comparisons, not numbers", of.text)),
    }
}

fn unexpected_after_value<T>(token: &Token) -> Result<T, Fault> {
    match token.kind {
        TokenKind::Number(_) | TokenKind::Name => {
            fault(token.at, format!("an operator is missing before `{}`", token.text))
        }
        _ if token.text == "(" => fault(token.at, "an operator is missing before `(`"),
        _ => unexpected(token),
    }
}

fn unexpected<T>(token: &Token) -> Result<T, Fault> {
    let help = match token.text {
        "//" | "/*" => "a division is one /, a product one *",
        "=" => "equality is ==",
        "&" => "and is &&",
        "|" => "or is ||",
        "×" | "·" => "a product is *",
        "–" | "−" => "a minus is -",
        "²" | "³" => "a power is ^",
        "." => "a number has digits on both sides of its point",
        _ => return fault(token.at, format!("unexpected `{}`", token.text)),
    };
    fault_with_help(token.at, format!("unexpected `{}`", token.text), help)
}
