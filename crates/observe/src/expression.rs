//! Expressions over the numbers of other measures: `+ - * /` and parentheses.

use serde::Deserialize;

/// Longest expression, bytes.
const MAX_BYTES: usize = 1000;
/// How deep parentheses and signs may be in each other.
const MAX_DEPTH: usize = 32;

/// An expression.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub struct Expression(ExpressionNode);

#[derive(Debug, Clone, PartialEq)]
enum ExpressionNode {
    Number(f64),
    Name(String),
    Negative(Box<ExpressionNode>),
    Both(Box<ExpressionNode>, Operator, Box<ExpressionNode>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Operator {
    Plus,
    Minus,
    Times,
    Over,
}

/// A text that is not an expression.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExpressionError {
    /// It is too long.
    #[error("an expression has at most {MAX_BYTES} bytes")]
    TooLong,
    /// Parentheses are too deep in each other.
    #[error("parentheses and signs are more than {MAX_DEPTH} deep in each other")]
    TooDeep,
    /// Something else is there than has to be.
    #[error(
        "{0}: an expression is made of names of earlier measures, numbers, + - * / and parentheses, such as \
         \"served / (messages + 1)\"; names with other characters than letters, digits and _ are in backquotes"
    )]
    Unexpected(String),
}

impl TryFrom<String> for Expression {
    type Error = ExpressionError;

    fn try_from(text: String) -> Result<Self, ExpressionError> {
        if text.len() > MAX_BYTES {
            return Err(ExpressionError::TooLong);
        }
        let mut parser = Parser { rest: &text };
        let node = parser.sum(0)?;
        match parser.peek() {
            None => Ok(Self(node)),
            Some(_) => Err(parser.unexpected()),
        }
    }
}

impl Expression {
    /// The names in it, in their order.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        let mut names = Vec::new();
        self.0.add_names(&mut names);
        names
    }

    /// Its value.
    ///
    /// # Errors
    /// The first name without a number, as `number` explains it, or why a division is not possible.
    pub fn value(&self, number: &impl Fn(&str) -> Result<f64, String>) -> Result<f64, String> {
        self.0.value(number)
    }
}

impl ExpressionNode {
    fn add_names<'a>(&'a self, names: &mut Vec<&'a str>) {
        match self {
            Self::Number(_) => {}
            Self::Name(name) => names.push(name),
            Self::Negative(of) => of.add_names(names),
            Self::Both(one, _, other) => {
                one.add_names(names);
                other.add_names(names);
            }
        }
    }

    fn value(&self, number: &impl Fn(&str) -> Result<f64, String>) -> Result<f64, String> {
        let (one, operator, other) = match self {
            Self::Number(number) => return Ok(*number),
            Self::Name(name) => return number(name),
            Self::Negative(of) => return Ok(-of.value(number)?),
            Self::Both(one, operator, other) => {
                (one.value(number)?, operator, other.value(number)?)
            }
        };
        Ok(match operator {
            Operator::Plus => one + other,
            Operator::Minus => one - other,
            Operator::Times => one * other,
            Operator::Over if other == 0.0 => return Err("it would be divided by 0".to_owned()),
            Operator::Over => one / other,
        })
    }
}

/// A text that is read from left to right.
struct Parser<'a> {
    rest: &'a str,
}

impl Parser<'_> {
    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    /// Goes on after the next character, if it is one of these.
    fn take(&mut self, wanted: &[char]) -> Option<char> {
        let next = self.peek().filter(|next| wanted.contains(next))?;
        self.rest = &self.rest[next.len_utf8()..];
        Some(next)
    }

    fn unexpected(&mut self) -> ExpressionError {
        ExpressionError::Unexpected(match self.peek() {
            Some(_) => format!("`{}` is not expected here", self.rest),
            None => "something is missing at the end".to_owned(),
        })
    }

    fn sum(&mut self, depth: usize) -> Result<ExpressionNode, ExpressionError> {
        let mut node = self.product(depth)?;
        while let Some(sign) = self.take(&['+', '-']) {
            let operator = if sign == '+' {
                Operator::Plus
            } else {
                Operator::Minus
            };
            let other = self.product(depth)?;
            node = ExpressionNode::Both(Box::new(node), operator, Box::new(other));
        }
        Ok(node)
    }

    fn product(&mut self, depth: usize) -> Result<ExpressionNode, ExpressionError> {
        let mut node = self.factor(depth)?;
        while let Some(sign) = self.take(&['*', '/']) {
            let operator = if sign == '*' {
                Operator::Times
            } else {
                Operator::Over
            };
            let other = self.factor(depth)?;
            node = ExpressionNode::Both(Box::new(node), operator, Box::new(other));
        }
        Ok(node)
    }

    fn factor(&mut self, depth: usize) -> Result<ExpressionNode, ExpressionError> {
        if depth > MAX_DEPTH {
            return Err(ExpressionError::TooDeep);
        }
        if self.take(&['-']).is_some() {
            return Ok(ExpressionNode::Negative(Box::new(self.factor(depth + 1)?)));
        }
        if self.take(&['(']).is_some() {
            let node = self.sum(depth + 1)?;
            return match self.take(&[')']) {
                Some(_) => Ok(node),
                None => Err(self.unexpected()),
            };
        }
        if self.take(&['`']).is_some() {
            let Some((name, rest)) = self.rest.split_once('`') else {
                return Err(self.unexpected());
            };
            self.rest = rest;
            return Ok(ExpressionNode::Name(name.to_owned()));
        }

        let is_first = self.peek();
        let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
        let end = self.rest.find(|c| !is_part(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        let node = match is_first {
            Some(first) if first.is_ascii_digit() => match word.parse::<f64>() {
                Ok(number) if number.is_finite() => ExpressionNode::Number(number),
                _ => return Err(self.unexpected()),
            },
            Some(first) if first.is_alphabetic() || first == '_' => {
                if word.contains('.') {
                    return Err(self.unexpected());
                }
                ExpressionNode::Name(word.to_owned())
            }
            _ => return Err(self.unexpected()),
        };
        self.rest = rest;
        Ok(node)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn read(text: &str) -> Result<Expression, ExpressionError> {
        text.to_owned().try_into()
    }

    fn value(text: &str) -> Result<f64, String> {
        let number = |name: &str| match name {
            "a" => Ok(6.0),
            "b_2" => Ok(2.0),
            "first exchange" => Ok(0.5),
            "none" => Err("`none` is not at risk".to_owned()),
            _ => Ok(0.0),
        };
        read(text).unwrap().value(&number)
    }

    #[test]
    fn operators_bind_as_in_arithmetic() {
        for (text, expected) in [
            ("a", 6.0),
            ("1.5e2", 150.0),
            ("a - b_2 - 1", 3.0),
            ("a / b_2 / 3", 1.0),
            ("1 + a * b_2", 13.0),
            ("(1 + a) * b_2", 14.0),
            ("-a + --1", -5.0),
            ("`first exchange`*4", 2.0),
        ] {
            assert_eq!(value(text), Ok(expected), "{text}");
        }
        assert_eq!(
            value("a / (b_2 - 2)"),
            Err("it would be divided by 0".to_owned())
        );
        assert_eq!(
            value("zero / zero"),
            Err("it would be divided by 0".to_owned())
        );
        assert_eq!(value("a + none"), Err("`none` is not at risk".to_owned()));
        assert_eq!(read("a / (b + a)").unwrap().names(), ["a", "b", "a"]);
    }

    #[test]
    fn other_texts_are_refused_and_sizes_are_bounded() {
        for text in [
            "", "a b", "a +", "(a", "a)", "`a", "2x", "a.b", "a % b", "1e999",
        ] {
            assert!(
                matches!(read(text), Err(ExpressionError::Unexpected(_))),
                "{text}"
            );
        }
        let deep = |depth: usize| format!("{}a{}", "(".repeat(depth), ")".repeat(depth));
        assert!(read(&deep(MAX_DEPTH)).is_ok());
        assert_eq!(read(&deep(MAX_DEPTH + 1)), Err(ExpressionError::TooDeep));
        let long = |bytes: usize| "1+".repeat(bytes / 2 - 1) + "11";
        assert!(read(&long(MAX_BYTES)).is_ok());
        assert_eq!(read(&long(MAX_BYTES + 2)), Err(ExpressionError::TooLong));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "[-+*/()a-c0-9.` ]{0,60}") {
            if let Ok(expression) = read(&text) {
                let _number = expression.value(&|_| Ok(0.0));
            }
        }
    }
}
