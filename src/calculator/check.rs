//! What the names of an expression mean, and whether its parts fit together.

use super::CalculatorError;
use super::geometry::COMPONENTS_MAX;
use super::parse::{Expression, Node, Operator};
use super::tensor;
use crate::field::{Association, FieldInfo};

/// A part of an expression that can be evaluated.
#[derive(Debug)]
pub(super) struct Checked {
    pub(super) step: Step,
    pub(super) components: usize,
    /// What has the values; `None` if they are the same everywhere.
    pub(super) association: Option<Association>,
}

#[derive(Debug)]
pub(super) enum Step {
    Constant(f64),
    /// The time of the step.
    Time,
    /// The field of that index.
    Field(usize),
    Position,
    Component(usize, Box<Checked>),
    /// A function of each number.
    Each(fn(f64) -> f64, Box<Checked>),
    /// A function of each number with that of another.
    Pair(fn(f64, f64) -> f64, Box<[Checked; 2]>),
    /// A quotient; zeros in the divisor are counted, at this column.
    Quotient(usize, Box<[Checked; 2]>),
    /// A function of a tuple, which appends the components.
    Tuple(fn(&[f64], &mut Vec<f64>), Box<Checked>),
    /// A function of two tuples.
    Tuples(OfTuples, Box<[Checked; 2]>),
    Vector(Box<[Checked; 3]>),
    Gradient(Box<Checked>),
}

/// A name, and a function of a number, or of two.
type OfOne = (&'static str, fn(f64) -> f64);
type OfTwo = (&'static str, fn(f64, f64) -> f64);
/// A function of two tuples, which appends the components.
type OfTuples = fn([&[f64]; 2], &mut Vec<f64>);

/// Functions of a number.
const EACH: &[OfOne] = &[
    ("abs", f64::abs),
    ("acos", f64::acos),
    ("asin", f64::asin),
    ("atan", f64::atan),
    ("ceil", f64::ceil),
    ("cos", f64::cos),
    ("exp", f64::exp),
    ("floor", f64::floor),
    ("ln", f64::ln),
    ("log10", f64::log10),
    ("sin", f64::sin),
    ("sqrt", f64::sqrt),
    ("tan", f64::tan),
];

/// Functions of two numbers. Both minimum and maximum are NaN if a number is.
const PAIR: &[OfTwo] = &[
    ("atan2", f64::atan2),
    ("max", |a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }),
    ("min", |a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { a.min(b) }),
];

/// A function of a tuple: its names, the first of which is also that of a quantity (`FIELD:NAME`); the numbers of components that it
/// takes (none: any) and the number that it has; whether the tuple is the gradient of what is given; and the unit.
struct OfTuple {
    names: &'static [&'static str],
    takes: &'static [usize],
    components: usize,
    of_gradient: bool,
    keeps_unit: bool,
    function: fn(&[f64], &mut Vec<f64>),
}

#[rustfmt::skip]
const OF_TUPLE: &[OfTuple] = &[
    OfTuple { names: &["mises"], takes: &[6, 9], components: 1, of_gradient: false, keeps_unit: true,
        function: |t, out| out.push(tensor::mises(t)) },
    OfTuple { names: &["principal"], takes: &[6, 9], components: 3, of_gradient: false, keeps_unit: true,
        function: |t, out| out.extend(tensor::principal(t)) },
    OfTuple { names: &["trace"], takes: &[6, 9], components: 1, of_gradient: false, keeps_unit: true,
        function: |t, out| out.push(tensor::trace(t)) },
    OfTuple { names: &["det"], takes: &[6, 9], components: 1, of_gradient: false, keeps_unit: false,
        function: |t, out| out.push(tensor::determinant(t)) },
    OfTuple { names: &["divergence", "div"], takes: &[3], components: 1, of_gradient: true, keeps_unit: false,
        function: |t, out| out.push(tensor::trace(t)) },
    OfTuple { names: &["vorticity", "curl"], takes: &[3], components: 3, of_gradient: true, keeps_unit: false,
        function: |t, out| out.extend(tensor::curl(t)) },
    OfTuple { names: &["q"], takes: &[3], components: 1, of_gradient: true, keeps_unit: false,
        function: |t, out| out.push(tensor::q_criterion(t)) },
    OfTuple { names: &["mag", "norm"], takes: &[], components: 1, of_gradient: false, keeps_unit: true,
        function: |t, out| out.push(t.iter().map(|v| v * v).sum::<f64>().sqrt()) },
];

/// The quantities of a field that are asked for as `FIELD:NAME`, and whether each has the field's unit.
pub(super) fn quantities() -> impl Iterator<Item = (&'static str, bool)> {
    let named = OF_TUPLE.iter().filter(|function| function.names[0] != "mag");
    named.map(|function| (function.names[0], function.keeps_unit)).chain([("gradient", false)])
}

/// Checks an expression of `text` over these fields.
pub(super) struct Checker<'a> {
    pub(super) text: &'a str,
    pub(super) fields: &'a [FieldInfo],
    /// What positions are of.
    pub(super) positions: Association,
}

impl Checker<'_> {
    fn error(&self, expression: &Expression, problem: impl Into<String>) -> CalculatorError {
        CalculatorError::at(self.text, expression.start, problem.into())
    }

    /// The expression as steps.
    ///
    /// # Errors
    /// If there is no such field or function, or parts do not fit together; the error names the column.
    pub(super) fn check(&self, expression: &Expression) -> Result<Checked, CalculatorError> {
        let constant = |step| Ok(Checked { step, components: 1, association: None });
        match &expression.node {
            Node::Number(number) => constant(Step::Constant(*number)),
            Node::Name(name) => self.name(expression, name),
            Node::Negated(of) => self.check(of).map(|of| each(|v| -v, of)),
            Node::Index(of, index) => {
                let of = self.check(of)?;
                if *index >= of.components {
                    let (components, last) = (of.components, of.components - 1);
                    let problem = format!("has {components} components, the last of them [{last}], and no [{index}]");
                    return Err(self.error(expression, problem));
                }
                let association = of.association;
                Ok(Checked { step: Step::Component(*index, Box::new(of)), components: 1, association })
            }
            Node::Binary(operator, of) => self.binary(*operator, of),
            Node::Call(name, arguments) => self.call(expression, name, arguments),
        }
    }

    fn name(&self, expression: &Expression, name: &str) -> Result<Checked, CalculatorError> {
        if let Some(index) = self.fields.iter().position(|field| field.name == name) {
            let FieldInfo { components, association, .. } = self.fields[index];
            return Ok(Checked { step: Step::Field(index), components, association: Some(association) });
        }
        let (step, components, association) = match name {
            "pi" => (Step::Constant(std::f64::consts::PI), 1, None),
            "time" => (Step::Time, 1, None),
            "coords" => (Step::Position, 3, Some(self.positions)),
            _ => {
                let all: Vec<&str> = self.fields.iter().map(|field| field.name.as_str()).collect();
                let problem = format!("there is no field '{name}'; the fields are: {}", all.join(", "));
                return Err(self.error(expression, format!("{problem}, and coords, time and pi")));
            }
        };
        Ok(Checked { step, components, association })
    }

    /// What two parts have in common.
    fn common(&self, [a, b]: [&Checked; 2], of: &[Expression]) -> Result<Option<Association>, CalculatorError> {
        match (a.association, b.association) {
            (Some(x), Some(y)) if x != y => {
                let word = |of: Association| if of == Association::Point { "points" } else { "cells" };
                let problem = format!("has values of {}, and what stands before it of {}", word(y), word(x));
                Err(self.error(&of[1], format!("{problem}: they cannot be combined")))
            }
            (a, b) => Ok(a.or(b)),
        }
    }

    fn binary(&self, operator: Operator, of: &[Expression; 2]) -> Result<Checked, CalculatorError> {
        let [a, b] = [self.check(&of[0])?, self.check(&of[1])?];
        let association = self.common([&a, &b], of)?;
        let (left, right) = (a.components, b.components);
        let sign = operator.sign();
        let fits = match operator {
            Operator::Add | Operator::Subtract => left == right,
            Operator::Multiply => left == 1 || right == 1,
            Operator::Divide => right == 1,
            Operator::Power => left == 1 && right == 1,
        };
        if !fits {
            let hint = if operator == Operator::Multiply { "; there are dot(a, b) and cross(a, b)" } else { "" };
            let problem = format!("has {right} components, and what stands before the {sign} has {left}{hint}");
            return Err(self.error(&of[1], problem));
        }
        let components = left.max(right);
        let step = match operator {
            Operator::Divide => {
                if matches!(b.step, Step::Constant(0.0)) {
                    return Err(self.error(&of[1], "division by zero"));
                }
                let between = self.text.get(of[0].end..of[1].start).and_then(|text| text.find('/')).unwrap_or(0);
                let column = super::column(self.text, of[0].end + between);
                Step::Quotient(column, Box::new([a, b]))
            }
            Operator::Add => Step::Pair(|a, b| a + b, Box::new([a, b])),
            Operator::Subtract => Step::Pair(|a, b| a - b, Box::new([a, b])),
            Operator::Multiply => Step::Pair(|a, b| a * b, Box::new([a, b])),
            Operator::Power => Step::Pair(f64::powf, Box::new([a, b])),
        };
        Ok(Checked { step, components, association })
    }

    fn call(&self, at: &Expression, name: &str, of: &[Expression]) -> Result<Checked, CalculatorError> {
        let one = || match of {
            [one] => self.check(one),
            _ => Err(self.error(at, format!("{name} takes 1 argument, not {}", of.len()))),
        };
        let two = || match of {
            [a, b] => {
                let pair = [self.check(a)?, self.check(b)?];
                let association = self.common([&pair[0], &pair[1]], of)?;
                Ok((pair, association))
            }
            _ => Err(self.error(at, format!("{name} takes 2 arguments, not {}", of.len()))),
        };
        if let Some((_, function)) = EACH.iter().find(|(known, _)| *known == name) {
            return one().map(|of| each(*function, of));
        }
        if let Some((_, function)) = PAIR.iter().find(|(known, _)| *known == name) {
            let (pair, association) = two()?;
            self.needs(at, name, &pair[0], &[1])?;
            self.needs(at, name, &pair[1], &[1])?;
            return Ok(Checked { step: Step::Pair(*function, Box::new(pair)), components: 1, association });
        }
        if let Some(function) = OF_TUPLE.iter().find(|known| known.names.contains(&name)) {
            let of = one()?;
            self.needs(at, name, &of, function.takes)?;
            let of = if function.of_gradient { gradient(of) } else { of };
            let association = of.association;
            let step = Step::Tuple(function.function, Box::new(of));
            return Ok(Checked { step, components: function.components, association });
        }
        match name {
            "gradient" | "grad" => {
                let of = one()?;
                self.needs(at, name, &of, &[1, COMPONENTS_MAX])?;
                Ok(gradient(of))
            }
            "dot" | "cross" => {
                let (pair, association) = two()?;
                self.needs(at, name, &pair[0], &[3])?;
                self.needs(at, name, &pair[1], &[3])?;
                let (components, function): (_, OfTuples) = match name {
                    "dot" => (1, |[a, b], out| out.push(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])),
                    _ => (3, |[a, b], out| {
                        let part = |i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
                        out.extend([part(1, 2), part(2, 0), part(0, 1)]);
                    }),
                };
                Ok(Checked { step: Step::Tuples(function, Box::new(pair)), components, association })
            }
            "vector" => {
                let [a, b, c] = of else {
                    return Err(self.error(at, format!("vector takes 3 arguments, not {}", of.len())));
                };
                let parts = [self.check(a)?, self.check(b)?, self.check(c)?];
                let first = self.common([&parts[0], &parts[1]], &of[..2])?;
                let second = self.common([&parts[1], &parts[2]], &of[1..])?;
                self.common([&parts[0], &parts[2]], &[of[0].clone(), of[2].clone()])?;
                parts.iter().try_for_each(|part| self.needs(at, name, part, &[1]))?;
                Ok(Checked { step: Step::Vector(Box::new(parts)), components: 3, association: first.or(second) })
            }
            _ => Err(self.error(at, format!("there is no function '{name}'; there are: {}", functions().join(", ")))),
        }
    }

    /// Fails unless an argument has one of these numbers of components, or any if there are none.
    fn needs(&self, at: &Expression, name: &str, of: &Checked, counts: &[usize]) -> Result<(), CalculatorError> {
        if counts.is_empty() || counts.contains(&of.components) {
            return Ok(());
        }
        let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
        let problem = format!("{name} is of {} components, and this has {}", counts.join(" or "), of.components);
        Err(self.error(at, problem))
    }
}

fn each(function: fn(f64) -> f64, of: Checked) -> Checked {
    let (components, association) = (of.components, of.association);
    Checked { step: Step::Each(function, Box::new(of)), components, association }
}

fn gradient(of: Checked) -> Checked {
    let (components, association) = (3 * of.components, of.association);
    Checked { step: Step::Gradient(Box::new(of)), components, association }
}

/// The names of all functions.
fn functions() -> Vec<&'static str> {
    let each = EACH.iter().map(|(name, _)| *name);
    let pair = PAIR.iter().map(|(name, _)| *name);
    let of_tuple = OF_TUPLE.iter().flat_map(|function| function.names.iter().copied());
    let mut all: Vec<&str> =
        each.chain(pair).chain(of_tuple).chain(["gradient", "grad", "dot", "cross", "vector"]).collect();
    all.sort_unstable();
    all
}
