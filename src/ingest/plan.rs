//! Plan of an import: the source fields that are read, and the store fields that they become.

use super::options::FieldUnits;
use crate::calculator::base_of_unit;
use crate::field::{Association, Component, FieldInfo, FieldSelector};
use std::collections::BTreeSet;

/// A field of the store, as an output of a source field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Output {
    /// Name in the store.
    pub(super) name: String,
    /// Component of the tuple.
    pub(super) component: Component,
    /// Whether the values are computed at playback from the other outputs of the same field.
    pub(super) virtual_: bool,
    /// Unit of the values.
    pub(super) units: Option<String>,
}

/// A field of the source that is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PlannedField {
    /// The field.
    pub(super) info: FieldInfo,
    /// Components to read, ascending.
    pub(super) reads: Vec<usize>,
    /// Fields of the store that it becomes.
    pub(super) outputs: Vec<Output>,
    /// How its values are brought from cells to vertices; `None` if they stay where they are.
    pub(super) means: Option<Means>,
}

/// A mean of the cells of the source around a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Means {
    /// Each cell counts the same, as in stores of older versions.
    Unweighted,
    /// Cells count by their volume.
    ByVolume,
}

impl PlannedField {
    /// What has its values in the store.
    pub(super) fn values_of(&self) -> Association {
        if self.means.is_some() { Association::Point } else { self.info.association }
    }

    /// The field with its values brought to vertices, if cells have them.
    pub(super) fn into_points(self) -> Self {
        let means = (self.info.association == Association::Cell).then_some(Means::ByVolume);
        Self { means, ..self }
    }
}

/// Plans the import of `selectors` (all fields if empty). `units` go before those that the source says, `of_source`, a place for each field
/// or none at all. An error is a message for the user.
///
/// Fields of one name (a point field and a cell field, say) are told apart: the first keeps the name, a cell field
/// becomes `NAME (cell)`, and whatever is still ambiguous `NAME (2)`.
pub(super) fn plan(
    fields: &[FieldInfo],
    selectors: &[FieldSelector],
    units: &[FieldUnits],
    of_source: &[Option<String>],
) -> Result<Vec<PlannedField>, String> {
    if fields.is_empty() {
        return Err("there is no field".to_owned());
    }
    let names = distinct_names(fields);
    // For each field of the source the components asked for; `None` is the field as a whole.
    let mut wanted: Vec<Vec<Option<Component>>> = vec![Vec::new(); fields.len()];
    let mut order: Vec<usize> = Vec::new();
    let all: Vec<FieldSelector>;
    let selectors = if selectors.is_empty() {
        all = names.iter().map(|name| FieldSelector { name: name.clone(), component: None }).collect();
        &all
    } else {
        selectors
    };
    for selector in selectors {
        let (field, component) = resolve(&names, selector).ok_or_else(|| unknown(&names, &selector.to_string()))?;
        check(&fields[field], &names[field], component)?;
        wanted[field].push(component);
        if !order.contains(&field) {
            order.push(field);
        }
    }
    let mut unit_of: Vec<Option<&str>> = vec![None; fields.len()];
    for FieldUnits { field: name, units } in units {
        let field = names.iter().position(|n| n == name).ok_or_else(|| unknown(&names, name))?;
        if !order.contains(&field) && !order.iter().any(|&of| base_of_unit(&names[of]) == Some(name.as_str())) {
            return Err(format!("field '{name}' has a unit but is not imported"));
        }
        if let Some(before) = unit_of[field].replace(units) {
            return Err(format!("field '{name}' has two units, '{before}' and '{units}'"));
        }
    }
    for (unit, said) in unit_of.iter_mut().zip(of_source) {
        *unit = unit.or(said.as_deref());
    }
    // A quantity has its field's unit, unless it has one of its own.
    let base = |field: usize| base_of_unit(&names[field]).and_then(|base| names.iter().position(|n| n == base));
    let unit = |field: usize| unit_of[field].or_else(|| base(field).and_then(|base| unit_of[base]));
    let mut taken = BTreeSet::new();
    let planned = |&field: &usize| {
        let info = fields[field].clone();
        let mut outputs = outputs(&names[field], info.components, &wanted[field]);
        for output in &mut outputs {
            output.name = unlike(&mut taken, &output.name);
            output.units = unit(field).map(str::to_owned);
        }
        PlannedField { reads: reads(info.components, &outputs), info, outputs, means: None }
    };
    Ok(order.iter().map(planned).collect())
}

/// A unique name for each field.
fn distinct_names(fields: &[FieldInfo]) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let name_of = |field: &FieldInfo| {
        if taken.contains(&field.name) && field.association == Association::Cell {
            unlike(&mut taken, &format!("{} (cell)", field.name))
        } else {
            unlike(&mut taken, &field.name)
        }
    };
    fields.iter().map(name_of).collect()
}

/// `name`, or `name (2)`, `name (3)`, .. if that is taken.
fn unlike(taken: &mut BTreeSet<String>, name: &str) -> String {
    let mut candidate = name.to_owned();
    let mut copy = 1u32;
    while !taken.insert(candidate.clone()) {
        copy += 1;
        candidate = format!("{name} ({copy})");
    }
    candidate
}

/// The field and component that a selector names. A field whose name ends like a component (`stress:0`) is found by its full name, too.
fn resolve(names: &[String], selector: &FieldSelector) -> Option<(usize, Option<Component>)> {
    let position = |name: &str| names.iter().position(|n| n == name);
    let full = selector.to_string();
    position(&selector.name).map(|i| (i, selector.component)).or_else(|| position(&full).map(|i| (i, None)))
}

fn unknown(names: &[String], name: &str) -> String {
    format!("there is no field '{name}'; the fields are: {}", names.join(", "))
}

fn check(info: &FieldInfo, name: &str, component: Option<Component>) -> Result<(), String> {
    match component {
        _ if info.components == 0 => Err(format!("field '{name}' has no components")),
        Some(Component::Index(i)) if i >= info.components => {
            let last = info.components - 1;
            Err(format!("field '{name}' has no component {i}; its components are 0 to {last} and mag"))
        }
        _ => Ok(()),
    }
}

/// The fields of the store that the wanted components become, each once.
fn outputs(name: &str, components: usize, wanted: &[Option<Component>]) -> Vec<Output> {
    let of = |component: Component, virtual_: bool| {
        let name = FieldSelector { name: name.to_owned(), component: Some(component) }.to_string();
        Output { name, component, virtual_, units: None }
    };
    if components == 1 {
        // Component 0 of a scalar is the scalar itself; its magnitude is another field.
        let value = wanted.iter().any(|w| *w != Some(Component::Magnitude));
        let magnitude = wanted.contains(&Some(Component::Magnitude));
        let scalar = Output { name: name.to_owned(), ..of(Component::Index(0), false) };
        let outputs = [value.then_some(scalar), magnitude.then(|| of(Component::Magnitude, false))];
        return outputs.into_iter().flatten().collect();
    }
    if wanted.contains(&None) {
        let each = (0..components).map(|i| of(Component::Index(i), false));
        return each.chain([of(Component::Magnitude, true)]).collect();
    }
    let mut outputs: Vec<Output> = Vec::new();
    for output in wanted.iter().flatten().map(|&component| of(component, false)) {
        if !outputs.contains(&output) {
            outputs.push(output);
        }
    }
    outputs
}

/// The components that the outputs need. A magnitude needs all: that of values brought from cells to vertices is the norm of their means,
/// whether it is computed now or at playback.
fn reads(components: usize, outputs: &[Output]) -> Vec<usize> {
    let all = outputs.iter().any(|o| o.component == Component::Magnitude);
    (0..components).filter(|&i| all || outputs.iter().any(|o| o.component == Component::Index(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(name: &str, components: usize, association: Association) -> FieldInfo {
        FieldInfo { name: name.to_owned(), components, association }
    }

    /// Names, and `*` behind virtual ones.
    fn names(fields: &[FieldInfo], selectors: &[&str]) -> Result<Vec<String>, String> {
        let selectors: Vec<FieldSelector> = selectors.iter().map(|s| s.parse().unwrap()).collect();
        let star = |o: &Output| format!("{}{}", o.name, if o.virtual_ { "*" } else { "" });
        Ok(plan(fields, &selectors, &[], &[])?.iter().flat_map(|f| f.outputs.iter().map(star)).collect())
    }

    fn flow() -> Vec<FieldInfo> {
        vec![field("T", 1, Association::Point), field("U", 3, Association::Point), field("p", 1, Association::Cell)]
    }

    #[test]
    fn without_a_selection_everything_is_imported_and_magnitudes_are_virtual() {
        assert_eq!(names(&flow(), &[]).unwrap(), ["T", "U:0", "U:1", "U:2", "U:mag*", "p"]);
    }

    #[test]
    fn a_component_alone_is_stored_alone() {
        assert_eq!(names(&flow(), &["U:1"]).unwrap(), ["U:1"]);
        assert_eq!(names(&flow(), &["U:mag", "T"]).unwrap(), ["U:mag", "T"]);
        let selectors = ["U:2".parse().unwrap(), "U:0".parse().unwrap()];
        assert_eq!(plan(&flow(), &selectors, &[], &[]).unwrap()[0].reads, [0, 2]);
        assert_eq!(plan(&flow(), &["U:mag".parse().unwrap()], &[], &[]).unwrap()[0].reads, [0, 1, 2]);
    }

    #[test]
    fn what_is_selected_twice_is_stored_once() {
        assert_eq!(names(&flow(), &["T", "T:0", "T"]).unwrap(), ["T"]);
        assert_eq!(names(&flow(), &["U:mag", "U", "U:1"]).unwrap(), ["U:0", "U:1", "U:2", "U:mag*"]);
        assert_eq!(names(&flow(), &["U:1", "U:1"]).unwrap(), ["U:1"]);
        assert_eq!(names(&flow(), &["T", "T:mag"]).unwrap(), ["T", "T:mag"]);
    }

    #[test]
    fn fields_that_share_a_name_are_told_apart() {
        let fields = [
            field("T", 1, Association::Point),
            field("T", 1, Association::Cell),
            field("T", 1, Association::Point),
            field("U:0", 1, Association::Point),
            field("U", 2, Association::Point),
        ];
        let all = names(&fields, &[]).unwrap();
        assert_eq!(all, ["T", "T (cell)", "T (2)", "U:0", "U:0 (2)", "U:1", "U:mag*"]);
        let of_cells = plan(&fields, &["T (cell)".parse().unwrap()], &[], &[]).unwrap();
        assert_eq!(of_cells[0].info.association, Association::Cell);
    }

    #[test]
    fn a_name_that_ends_like_a_component_is_found() {
        let fields = [field("species:12", 1, Association::Point)];
        assert_eq!(names(&fields, &["species:12"]).unwrap(), ["species:12"]);
    }

    #[test]
    fn a_unit_is_that_of_all_that_a_field_becomes() {
        let planned = |selectors: &[FieldSelector], units: &[&str]| {
            let units: Vec<FieldUnits> = units.iter().map(|u| u.parse().unwrap()).collect();
            let planned = plan(&flow(), selectors, &units, &[])?;
            Ok::<_, String>(planned.into_iter().flat_map(|f| f.outputs).map(|o| o.units).collect::<Vec<_>>())
        };
        let (speed, pressure) = (Some("m/s".to_owned()), Some("Pa".to_owned()));
        let all = planned(&[], &["U=m/s", "p=Pa"]).unwrap();
        assert_eq!(all, [None, speed.clone(), speed.clone(), speed.clone(), speed.clone(), pressure]);
        assert_eq!(planned(&["U:mag".parse().unwrap()], &["U=m/s"]).unwrap(), [speed]);
        assert!(planned(&[], &["V=m"]).unwrap_err().ends_with("the fields are: T, U, p"));
        assert!(planned(&["T".parse().unwrap()], &["U=m/s"]).unwrap_err().contains("not imported"));
        assert!(planned(&[], &["T=K", "T=°C"]).unwrap_err().contains("two units, 'K' and '°C'"));
    }

    #[test]
    fn what_does_not_exist_is_an_error_that_says_what_does() {
        assert!(names(&flow(), &["Q"]).unwrap_err().ends_with("the fields are: T, U, p"));
        assert!(names(&flow(), &["U:3"]).unwrap_err().contains("0 to 2 and mag"));
        assert!(names(&[], &[]).unwrap_err().contains("no field"));
        assert!(names(&[field("e", 0, Association::Point)], &[]).unwrap_err().contains("no components"));
    }

    #[test]
    fn quantities_have_the_unit_of_their_field_unless_they_have_their_own() {
        let fields = [
            field("s", 6, Association::Point),
            field("s:mises", 1, Association::Point),
            field("s:trace", 1, Association::Point),
            field("s:det", 1, Association::Point),
        ];
        let units: Vec<FieldUnits> = ["s=MPa", "s:trace=bar"].iter().map(|text| text.parse().unwrap()).collect();
        let selectors: Vec<FieldSelector> =
            ["s:mises", "s:trace", "s:det"].iter().map(|s| s.parse().unwrap()).collect();
        let planned = plan(&fields, &selectors, &units, &[]).expect("s itself is not imported");
        let found: Vec<_> = planned.iter().flat_map(|field| &field.outputs).map(|o| o.units.as_deref()).collect();
        assert_eq!(found, [Some("MPa"), Some("bar"), None]);
        assert!(plan(&fields, &selectors[2..], &units[..1], &[]).is_err(), "no field has that unit");
    }

    #[test]
    fn units_of_the_source_count_where_the_user_says_none() {
        let mut fields = flow();
        fields.push(field("U:trace", 1, Association::Point));
        let of_source = ["K", "m/s", "Pa"].map(|unit| Some(unit.to_owned()));
        let of_source = [&of_source[..], &[None]].concat();
        let found = |units: &[&str]| {
            let units: Vec<FieldUnits> = units.iter().map(|u| u.parse().unwrap()).collect();
            let planned = plan(&fields, &[], &units, &of_source).unwrap();
            let outputs = planned.into_iter().flat_map(|field| field.outputs);
            outputs.map(|output| output.units.unwrap_or_default()).collect::<Vec<_>>()
        };
        assert_eq!(found(&[]), ["K", "m/s", "m/s", "m/s", "m/s", "Pa", "m/s"]);
        assert_eq!(found(&["U=mm/s", "p=bar"]), ["K", "mm/s", "mm/s", "mm/s", "mm/s", "bar", "mm/s"]);
        assert_eq!(found(&["U:trace=1/s"]).last().unwrap(), "1/s");
    }
}
