//! The grammar of definitions: `NAME = EXPRESSION`.
//!
//! ```text
//! operators, the tightest first:   a[0]   a^b (from the right)   -a   a*b a/b   a+b a-b
//! operands:                        1.5e3   name   "any name"   function(a, b)   (a)
//! ```

use super::CalculatorError;
use winnow::ascii::{digit1, multispace0};
use winnow::combinator::{Infix, Prefix, alt, cut_err, delimited, expression, opt, separated, terminated};
use winnow::error::{ContextError, ErrMode};
use winnow::prelude::*;
use winnow::stream::{LocatingSlice, Location, Stream};
use winnow::token::{one_of, take_while};

/// Most characters of a definition, and most open parentheses, so that no text exhausts the stack.
const LENGTH_MAX: usize = 1000;
const DEPTH_MAX: usize = 40;

/// A part of an expression.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Expression {
    pub(super) node: Node,
    /// Byte offsets of its first character, and behind its last one.
    pub(super) start: usize,
    pub(super) end: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Node {
    Number(f64),
    Name(String),
    Call(String, Vec<Expression>),
    Negated(Box<Expression>),
    Index(Box<Expression>, usize),
    Binary(Operator, Box<[Expression; 2]>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
}

impl Operator {
    pub(super) fn sign(self) -> char {
        match self {
            Self::Add => '+',
            Self::Subtract => '-',
            Self::Multiply => '*',
            Self::Divide => '/',
            Self::Power => '^',
        }
    }
}

type Input<'a> = LocatingSlice<&'a str>;
type Failure = ErrMode<ContextError>;
type Parsed<T> = Result<T, Failure>;

/// The name and the expression of a definition, whose offsets are those of the whole text.
///
/// # Errors
/// If the text is none, is too long or is nested too deeply.
pub(super) fn definition(text: &str) -> Result<(String, Expression), CalculatorError> {
    let error = |at: usize, problem: &str| CalculatorError::at(text, at, problem.to_owned());
    if text.len() > LENGTH_MAX {
        return Err(error(0, &format!("has more than {LENGTH_MAX} characters")));
    }
    let mut depth = 0usize;
    for (at, character) in text.char_indices() {
        match character {
            '(' | '[' => depth += 1,
            ')' | ']' => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth > DEPTH_MAX {
            return Err(error(at, "is nested too deeply"));
        }
    }
    let Some((name, _)) = text.split_once('=') else {
        return Err(error(0, "has no '='; write NAME = EXPRESSION"));
    };
    if name.trim().is_empty() {
        return Err(error(0, "names no field before the '='"));
    }
    let mut input = LocatingSlice::new(text);
    input.next_slice(name.len() + 1);
    match sum.parse(input) {
        Ok(expression) => Ok((name.trim().to_owned(), expression)),
        Err(failed) => {
            // The parser counts from where it began.
            let at = name.len() + 1 + failed.offset();
            let rest = text.get(at..).unwrap_or_default();
            let at = at + rest.len() - rest.trim_start().len();
            let problem = match rest.trim_start().chars().next() {
                None => "the expression ends where a number, a name or '(' is needed".to_owned(),
                Some(found) => format!("'{found}' cannot stand here"),
            };
            Err(error(at, &problem))
        }
    }
}

fn sum(input: &mut Input<'_>) -> Parsed<Expression> {
    multispace0.parse_next(input)?;
    expression(operand).prefix(prefix).infix(infix).parse_next(input)
}

fn prefix<'a>(input: &mut Input<'a>) -> Parsed<Prefix<Input<'a>, Expression, Failure>> {
    Ok(match terminated(one_of(['-', '+']), multispace0).parse_next(input)? {
        '-' => Prefix(9, |_, a| Ok(Expression { start: a.start, end: a.end, node: Node::Negated(Box::new(a)) })),
        _ => Prefix(9, |_, a| Ok(a)),
    })
}

fn infix<'a>(input: &mut Input<'a>) -> Parsed<Infix<Input<'a>, Expression, Failure>> {
    Ok(match terminated(alt(("**", "^", "*", "/", "+", "-")), multispace0).parse_next(input)? {
        "**" | "^" => Infix::Right(11, |_, a, b| Ok(binary(Operator::Power, a, b))),
        "*" => Infix::Left(7, |_, a, b| Ok(binary(Operator::Multiply, a, b))),
        "/" => Infix::Left(7, |_, a, b| Ok(binary(Operator::Divide, a, b))),
        "+" => Infix::Left(5, |_, a, b| Ok(binary(Operator::Add, a, b))),
        _ => Infix::Left(5, |_, a, b| Ok(binary(Operator::Subtract, a, b))),
    })
}

fn binary(operator: Operator, a: Expression, b: Expression) -> Expression {
    let (start, end) = (a.start, b.end);
    Expression { node: Node::Binary(operator, Box::new([a, b])), start, end }
}

/// A number, a name, a call or a sum in parentheses, and the components that are taken of it.
fn operand(input: &mut Input<'_>) -> Parsed<Expression> {
    multispace0.parse_next(input)?;
    let start = input.current_token_start();
    let node = alt((
        number.map(Node::Number),
        delimited('"', take_while(1.., |c| c != '"'), '"').map(|name: &str| Node::Name(name.to_owned())),
        name_or_call,
        delimited('(', cut_err(sum), cut_err(')')).map(|inner| inner.node),
    ))
    .parse_next(input)?;
    let end = input.previous_token_end();
    multispace0.parse_next(input)?;
    let mut operand = Expression { node, start, end };
    while let Some(index) =
        opt(delimited(('[', multispace0), digit1.parse_to(), (multispace0, ']'))).parse_next(input)?
    {
        let end = input.previous_token_end();
        multispace0.parse_next(input)?;
        operand = Expression { node: Node::Index(Box::new(operand), index), start, end };
    }
    Ok(operand)
}

/// A number without sign, which is an operator.
fn number(input: &mut Input<'_>) -> Parsed<f64> {
    let digits = || take_while(1.., |c: char| c.is_ascii_digit());
    let exponent = (one_of(['e', 'E']), opt(one_of(['+', '-'])), digits());
    let mantissa = alt(((digits(), opt(('.', opt(digits())))).void(), ('.', digits()).void()));
    (mantissa, opt(exponent)).take().parse_to().parse_next(input)
}

fn name_or_call(input: &mut Input<'_>) -> Parsed<Node> {
    let first = |c: char| c.is_alphabetic() || c == '_';
    let mut name = (take_while(1, first), take_while(0.., move |c: char| first(c) || c.is_numeric())).take();
    let name = name.parse_next(input)?.to_owned();
    let comma = (',', multispace0);
    let arguments = delimited((multispace0, '(', multispace0), separated(0.., sum, comma), cut_err(')'));
    let arguments: Option<Vec<Expression>> = opt(arguments).parse_next(input)?;
    Ok(arguments.map_or_else(|| Node::Name(name.clone()), |arguments| Node::Call(name.clone(), arguments)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expression with all parentheses.
    fn written(expression: &Expression) -> String {
        match &expression.node {
            Node::Number(number) => number.to_string(),
            Node::Name(name) => name.clone(),
            Node::Call(name, arguments) => {
                format!("{name}({})", arguments.iter().map(written).collect::<Vec<_>>().join(", "))
            }
            Node::Negated(a) => format!("(-{})", written(a)),
            Node::Index(a, i) => format!("{}[{i}]", written(a)),
            Node::Binary(operator, of) => format!("({} {} {})", written(&of[0]), operator.sign(), written(&of[1])),
        }
    }

    fn read(text: &str) -> String {
        match definition(text) {
            Ok((name, expression)) => format!("{name} = {}", written(&expression)),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn operators_bind_as_in_mathematics() {
        for (text, expected) in [
            ("ke = 0.5*rho*mag(u)^2", "ke = ((0.5 * rho) * (mag(u) ^ 2))"),
            ("a=-2^2", "a = (-(2 ^ 2))"),
            ("a=2^-2", "a = (2 ^ (-2))"),
            ("a=2^3^2", "a = (2 ^ (3 ^ 2))"),
            ("a=2**3", "a = (2 ^ 3)"),
            ("a=1-2-3", "a = ((1 - 2) - 3)"),
            ("a=1/2/3*4", "a = (((1 / 2) / 3) * 4)"),
            ("a = - b*c", "a = ((-b) * c)"),
            ("a=+b - -c", "a = (b - (-c))"),
            ("two words = ( a + b ) * c", "two words = ((a + b) * c)"),
            ("a = \"x y=z\"[2] + 1.5e-3", "a = (x y=z[2] + 0.0015)"),
            ("a = min ( b , max(c,d) ) + pi ", "a = (min(b, max(c, d)) + pi)"),
            ("a = .5 + 2. + 1E2", "a = ((0.5 + 2) + 100)"),
            ("a = grad(u)[3]^2", "a = (grad(u)[3] ^ 2)"),
            ("a = größe", "a = größe"),
        ] {
            assert_eq!(read(text), expected, "{text}");
        }
    }

    #[test]
    fn what_is_no_definition_is_named_by_column() {
        for (text, expected) in [
            ("ke", "no '='"),
            (" = a", "names no field"),
            ("a = ", "column 5"),
            ("a = b +", "column 8"),
            ("a = b + * c", "column 9"),
            ("a = (b", "column 7"),
            ("a = b c", "column 7"),
            ("a = b $ c", "'$'"),
            ("a = f(b,)", "column"),
            ("a = 2x", "column 6"),
            ("a = é $", "column 7"),
            ("a = b = c", "column 7"),
        ] {
            let error = read(text);
            assert!(error.contains(expected) && error.contains(text), "{text}: {error}");
        }
        let deep = format!("a = {}b{}", "(".repeat(200), ")".repeat(200));
        assert!(read(&deep).contains("too deeply"));
        assert!(read(&format!("a = {}", "-".repeat(5000))).contains("1000 characters"));
        assert!(
            read(&format!("a = {}b", "-".repeat(900))).starts_with("a = (-(-"),
            "prefixes do not exhaust the stack"
        );
    }
}
