//! Fields computed from those of a source when it is imported: arithmetic, invariants of tensors, derivatives of vectors.
//!
//! A definition is `NAME = EXPRESSION` ([`Definition`]); a quantity is asked for as `FIELD:QUANTITY`, which is the definition
//! `FIELD:QUANTITY = QUANTITY(FIELD)`:
//!
//! | quantity | of | what it is |
//! |---|---|---|
//! | `mises`, `principal`, `trace`, `det` | 6 or 9 components | invariants ([`tensor`]); principal values greatest first |
//! | `divergence`, `vorticity`, `q` | 3 components | of the gradient; `q` is the Q-criterion |
//! | `gradient` | 1 or 3 components | derivatives along x, y, z, component by component |
//!
//! Gradients are means over the cells around a point, weighted by volume ([`geometry`]), as values of cells that are brought to points are.
//! Everything is computed in f64 from the file's numbers, and rounded once, to f32.

mod check;
mod geometry;
mod parse;
mod tensor;
mod values;

use crate::error::{FileError, FileResult};
use crate::field::{Association, Blocks, Component, FieldInfo, FieldSelector, SeriesSource, TimeAxis};
use crate::mesh::RawMesh;
use check::{Checked, Checker, Step};
use geometry::Geometry;
use parse::{Expression, Node};
use std::collections::{BTreeMap, BTreeSet};
use std::str::FromStr;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use values::Values;

/// What is wrong with a definition, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{text}', column {column}: {problem}")]
pub struct CalculatorError {
    /// The definition.
    pub text: String,
    /// Number of the character, from 1.
    pub column: usize,
    /// What is wrong there.
    pub problem: String,
}

impl CalculatorError {
    fn at(text: &str, byte: usize, problem: String) -> Self {
        Self { text: text.to_owned(), column: column(text, byte), problem }
    }
}

/// Number of the character at this byte, from 1.
fn column(text: &str, byte: usize) -> usize {
    text.char_indices().take_while(|(at, _)| *at < byte).count() + 1
}

/// A field as the user defines it: `NAME = EXPRESSION`.
#[derive(Clone, Debug, PartialEq)]
pub struct Definition {
    text: String,
    name: String,
    expression: Expression,
}

impl FromStr for Definition {
    type Err = CalculatorError;

    /// Reads the grammar; names of fields and functions are looked up with a source at hand.
    fn from_str(text: &str) -> Result<Self, CalculatorError> {
        let (name, expression) = parse::definition(text)?;
        Ok(Self { text: text.to_owned(), name, expression })
    }
}

impl Definition {
    /// The quantity of a field that a name asks for, if it is `FIELD:QUANTITY` of one of these fields.
    fn of_quantity(name: &str, fields: &[FieldInfo]) -> Option<Self> {
        let (field, quantity) = name.rsplit_once(':')?;
        let (known, _) = check::quantities().find(|(known, _)| *known == quantity)?;
        fields.iter().find(|of| of.name == field)?;
        let text = format!("{name} = {known}(\"{field}\")");
        let at = |node| Expression { node, start: 0, end: 0 };
        let expression = at(Node::Call(known.to_owned(), vec![at(Node::Name(field.to_owned()))]));
        Some(Self { text, name: name.to_owned(), expression })
    }
}

/// Adds fields to a source: those that are defined, in turn, each of which may use those before it, then the quantities that are among
/// `names`. The source itself comes back if there is nothing to add.
///
/// # Errors
/// If a definition has a name that a field has, names what there is not, or has parts that do not fit together; of unsupported kind.
pub fn calculated(
    source: Box<dyn SeriesSource>,
    definitions: &[Definition],
    names: &[FieldSelector],
) -> FileResult<Box<dyn SeriesSource>> {
    let mut fields = source.fields().to_vec();
    let mut formulas = Vec::new();
    let mut add = |definition: &Definition, fields: &mut Vec<FieldInfo>| -> Result<(), CalculatorError> {
        let Definition { text, name, expression } = definition;
        if fields.iter().any(|field| field.name == *name) {
            return Err(CalculatorError::at(text, 0, format!("there is a field '{name}' already")));
        }
        let positions = first_field(expression, fields).unwrap_or(Association::Point);
        let checked = Checker { text, fields, positions }.check(expression)?;
        let association = checked.association.unwrap_or(positions);
        fields.push(FieldInfo { name: name.clone(), components: checked.components, association });
        formulas.push(Formula { text: text.clone(), checked });
        Ok(())
    };
    let invalid = |error: CalculatorError| {
        FileError::unsupported(source.describe(), format!("'{}', column {}", error.text, error.column), error.problem)
    };
    definitions.iter().try_for_each(|definition| add(definition, &mut fields)).map_err(invalid)?;
    let mut asked = BTreeSet::new();
    for name in names.iter().map(|selector| &selector.name).filter(|name| asked.insert((*name).clone())) {
        let exists = fields.iter().any(|field| field.name == *name);
        if let Some(quantity) = Definition::of_quantity(name, &fields).filter(|_| !exists) {
            add(&quantity, &mut fields).map_err(invalid)?;
        }
    }
    if formulas.is_empty() {
        return Ok(source);
    }
    let (geometry, last, zeros) = Default::default();
    Ok(Box::new(Calculated { source, fields, formulas, geometry, last, zeros }))
}

/// The field whose unit the values of this name have, if it is `FIELD:QUANTITY` of a quantity that keeps the unit.
pub fn base_of_unit(name: &str) -> Option<&str> {
    let (field, quantity) = name.rsplit_once(':')?;
    check::quantities().any(|(known, keeps)| keeps && known == quantity).then_some(field)
}

/// What has the values of the first field that an expression names.
fn first_field(expression: &Expression, fields: &[FieldInfo]) -> Option<Association> {
    let of_all = |parts: &[Expression]| parts.iter().find_map(|part| first_field(part, fields));
    match &expression.node {
        Node::Number(_) => None,
        Node::Name(name) => fields.iter().find(|field| field.name == *name).map(|field| field.association),
        Node::Negated(of) | Node::Index(of, _) => first_field(of, fields),
        Node::Call(_, of) => of_all(of),
        Node::Binary(_, of) => of_all(&**of),
    }
}

/// A definition whose names are resolved.
struct Formula {
    text: String,
    checked: Checked,
}

/// A formula's values at a step.
type LastValues = Option<(usize, usize, Arc<Values>)>;
/// Zeros of a divisor by formula, column and step.
type Zeros = BTreeMap<(usize, usize, usize), usize>;

/// A source with further fields.
struct Calculated {
    source: Box<dyn SeriesSource>,
    /// Those of the source, then one for each formula.
    fields: Vec<FieldInfo>,
    formulas: Vec<Formula>,
    geometry: OnceLock<FileResult<Arc<Geometry>>>,
    /// The values that were read last: a vector is read component by component.
    last: Mutex<LastValues>,
    zeros: Mutex<Zeros>,
}

impl Calculated {
    fn geometry(&self) -> FileResult<&Geometry> {
        let made = self.geometry.get_or_init(|| Ok(Arc::new(Geometry::of(self.source.mesh()?))));
        made.as_ref().map(AsRef::as_ref).map_err(Clone::clone)
    }

    /// The number of the formula of a field, if it is none of the source's.
    fn formula(&self, field: usize) -> Option<usize> {
        field.checked_sub(self.fields.len() - self.formulas.len())
    }

    /// All components of a formula at a step.
    fn values(&self, formula: usize, step: usize) -> FileResult<Arc<Values>> {
        {
            let last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((of, at, values)) = last.as_ref()
                && (*of, *at) == (formula, step)
            {
                return Ok(values.clone());
            }
        }
        let values = Arc::new(self.evaluate(&self.formulas[formula].checked, formula, step)?);
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Some((formula, step, values.clone()));
        Ok(values)
    }

    fn evaluate(&self, of: &Checked, formula: usize, step: usize) -> FileResult<Values> {
        let value = |of: &Checked| self.evaluate(of, formula, step);
        let two = |of: &[Checked; 2]| Ok([value(&of[0])?, value(&of[1])?]);
        let association = of.association.unwrap_or(Association::Point);
        Ok(match &of.step {
            Step::Constant(value) => Values::constant(*value),
            Step::Time => Values::constant(self.source.times().values.get(step).copied().unwrap_or(f64::NAN)),
            Step::Field(index) => self.field(*index, step)?,
            Step::Position => self.geometry()?.positions(association),
            Step::Component(index, of) => value(of)?.map_tuples(1, |tuple, out| out.push(tuple[*index])),
            Step::Each(function, of) => value(of)?.map(function),
            Step::Pair(function, of) => {
                let [a, b] = two(of)?;
                a.pair(&b, function)
            }
            Step::Quotient(column, of) => {
                let [a, b] = two(of)?;
                let zeros = b.data.iter().filter(|divisor| **divisor == 0.0).count();
                let all = if b.is_constant { a.data.len() / a.components } else { 1 };
                if zeros > 0 {
                    let mut counts = self.zeros.lock().unwrap_or_else(PoisonError::into_inner);
                    counts.insert((formula, *column, step), zeros * all);
                }
                a.pair(&b, |a, b| a / b)
            }
            Step::Tuple(function, inner) => value(inner)?.map_tuples(of.components, function),
            Step::Tuples(function, inner) => {
                let [a, b] = two(inner)?;
                Values::join([&a, &b], of.components, function)
            }
            Step::Vector(of) => {
                let [a, b, c] = [value(&of[0])?, value(&of[1])?, value(&of[2])?];
                Values::join([&a, &b, &c], 3, |parts, out| out.extend(parts.map(|part| part[0])))
            }
            Step::Gradient(of) => {
                let values = value(of)?;
                let geometry = self.geometry()?;
                if !geometry.has_volume() {
                    let problem =
                        "gradients need cells with a volume, and there is none: a cloud of points has no cells";
                    return Err(FileError::unsupported(self.source.describe(), "", problem).remedy("leave them out"));
                }
                geometry.gradient(&values, association)
            }
        })
    }

    /// All components of a field at a step.
    fn field(&self, index: usize, step: usize) -> FileResult<Values> {
        if let Some(formula) = self.formula(index) {
            let values = self.evaluate(&self.formulas[formula].checked, formula, step)?;
            return Ok(values);
        }
        let info = &self.fields[index];
        let (mut of_component, mut data) = (Vec::new(), Vec::new());
        for component in 0..info.components {
            self.source.read_f64(info, component, step, &mut of_component)?;
            data.resize(of_component.len() * info.components, 0.0);
            let slots = data.chunks_exact_mut(info.components);
            slots.zip(&of_component).for_each(|(tuple, value)| tuple[component] = *value);
        }
        Ok(Values::of(info.components, data))
    }
}

impl SeriesSource for Calculated {
    fn describe(&self) -> String {
        self.source.describe()
    }

    fn times(&self) -> &TimeAxis {
        self.source.times()
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn blocks(&self) -> FileResult<Option<Blocks>> {
        self.source.blocks()
    }

    fn unit(&self, field: &FieldInfo) -> Option<String> {
        self.source.unit(field)
    }

    fn fix_points(&mut self) -> FileResult<()> {
        let problem = "points are fixed before fields are calculated, as these may use their displacement";
        Err(FileError::invalid(self.describe(), "", problem))
    }

    fn cell_number(&self, cell: u32) -> u32 {
        self.source.cell_number(cell)
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        self.source.mesh()
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        let index = self.fields.iter().position(|known| known == field);
        let Some(formula) = index.and_then(|index| self.formula(index)) else {
            return self.source.read(field, component, step, out);
        };
        let values = self.values(formula, step)?;
        let of_tuple = |tuple: &[f64]| match component {
            Component::Index(index) => tuple.get(index).copied().unwrap_or(f64::NAN),
            Component::Magnitude => tuple.iter().map(|v| v * v).sum::<f64>().sqrt(),
        };
        out.clear();
        if values.is_constant {
            out.resize(self.geometry()?.len(field.association), of_tuple(&values.data) as f32);
        } else {
            out.extend(values.data.chunks_exact(values.components).map(|tuple| of_tuple(tuple) as f32));
        }
        Ok(())
    }

    fn check(&self, step: usize) -> FileResult<()> {
        self.source.check(step)
    }

    fn counted(&self, last: usize) -> serde_json::Value {
        let zeros = self.zeros.lock().unwrap_or_else(PoisonError::into_inner);
        let zeros = zeros.iter().filter(|((.., step), _)| *step <= last).collect::<Vec<_>>();
        serde_json::json!([self.source.counted(last), zeros])
    }

    fn count_on(&self, counted: &serde_json::Value) {
        self.source.count_on(&counted[0]);
        let zeros: Vec<((usize, usize, usize), usize)> = serde_json::from_value(counted[1].clone()).unwrap_or_default();
        // The formulas of another source have other numbers.
        let zeros = zeros.into_iter().filter(|((formula, ..), _)| *formula < self.formulas.len());
        self.zeros.lock().unwrap_or_else(PoisonError::into_inner).extend(zeros);
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = self.source.notes();
        notes.extend(self.formulas.iter().map(|formula| format!("calculated {}", formula.text)));
        let mut by_place: BTreeMap<(usize, usize), (usize, usize)> = BTreeMap::new();
        for ((formula, column, _), zeros) in self.zeros.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            let (values, steps) = by_place.entry((*formula, *column)).or_default();
            *values += zeros;
            *steps += 1;
        }
        notes.extend(by_place.into_iter().map(|((formula, column), (values, steps))| {
            let text = &self.formulas[formula].text;
            format!("'{text}', column {column}: division by zero of {values} values in {steps} steps, which are holes")
        }));
        notes
    }
}

#[cfg(test)]
mod tests;
