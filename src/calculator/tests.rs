//! Definitions and quantities over a source of one tetrahedron and a hexahedron.

use super::*;
use crate::mesh::{Cells, SolidShape};
use glam::DVec3;

/// Steps 0 and 1 at the times 0.5 and 2; the fields at point or cell i, in step s:
/// p = 101325 + i / 1024, u = (y, -x, s), stress (6) = (i, 0, 0, 0, 0, 0), rho (cells) = 1 + i, zero (cells) = i.
struct Source {
    times: TimeAxis,
    fields: Vec<FieldInfo>,
}

impl Source {
    fn boxed() -> Box<dyn SeriesSource> {
        let field = |name: &str, components, association| FieldInfo { name: name.to_owned(), components, association };
        let fields = vec![
            field("p", 1, Association::Point),
            field("u", 3, Association::Point),
            field("stress tensor", 6, Association::Point),
            field("rho", 1, Association::Cell),
            field("zero", 1, Association::Cell),
        ];
        Box::new(Self { times: TimeAxis { values: vec![0.5, 2.0] }, fields })
    }

    fn value(&self, name: &str, component: usize, i: usize, step: usize) -> f64 {
        let point = self.points().get(i).copied().unwrap_or_default();
        match name {
            "p" => 101_325.0 + i as f64 / 1024.0,
            "u" => [point.y, -point.x, step as f64][component],
            "stress tensor" => {
                if component == 0 {
                    i as f64
                } else {
                    0.0
                }
            }
            "rho" => 1.0 + i as f64,
            _ => i as f64,
        }
    }

    fn points(&self) -> Vec<DVec3> {
        let corner = |i: usize| DVec3::new(f64::from(i % 4 == 1 || i % 4 == 2), f64::from(i % 4 > 1), (i / 4) as f64);
        (0..8).map(corner).chain([DVec3::new(0.5, 0.5, 2.0)]).collect()
    }
}

impl SeriesSource for Source {
    fn describe(&self) -> String {
        "a.vtu".to_owned()
    }

    fn times(&self) -> &TimeAxis {
        &self.times
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        let mut cells = Cells::from(vec![[4, 5, 8, 7]]);
        cells.solids.push(SolidShape::Hexahedron, 0..8);
        Ok(RawMesh { points: self.points(), cells })
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        let mut wide = Vec::new();
        let Component::Index(component) = component else { return Ok(()) };
        self.read_f64(field, component, step, &mut wide)?;
        out.clear();
        out.extend(wide.iter().map(|v| *v as f32));
        Ok(())
    }

    fn read_f64(&self, field: &FieldInfo, component: usize, step: usize, out: &mut Vec<f64>) -> FileResult<()> {
        let count = if field.association == Association::Point { 9 } else { 2 };
        out.clear();
        out.extend((0..count).map(|i| self.value(&field.name, component, i, step)));
        Ok(())
    }
}

fn selectors(names: &[&str]) -> Vec<FieldSelector> {
    names.iter().map(|name| name.parse().unwrap()).collect()
}

fn with(definitions: &[&str], names: &[&str]) -> FileResult<Box<dyn SeriesSource>> {
    let definitions: Vec<Definition> = definitions.iter().map(|text| text.parse().expect(text)).collect();
    calculated(Source::boxed(), &definitions, &selectors(names))
}

/// The values of the last field's component at step 1.
fn values(source: &dyn SeriesSource, component: usize) -> Vec<f32> {
    let field = source.fields().last().unwrap().clone();
    let mut out = vec![7.0];
    source.read(&field, Component::Index(component), 1, &mut out).unwrap();
    out
}

/// The values of a definition at step 1.
fn defined(definition: &str) -> Vec<f32> {
    values(&*with(&[definition], &[]).unwrap(), 0)
}

#[test]
fn arithmetic_is_that_of_f64_for_points_and_cells() {
    assert_eq!(
        defined("dp = p - 101325")[..3],
        [0.0, 1.0 / 1024.0, 2.0 / 1024.0],
        "p alone is rounded to 1/128 in f32"
    );
    assert_eq!(defined("a = 2 * rho ^ 2 - time"), [0.0, 6.0]);
    assert_eq!(defined("a = min(rho, 1.5) + sqrt(4) * pi")[1], (1.5 + 2.0 * std::f64::consts::PI) as f32);
    assert_eq!(defined("k = 0.5 * mag(u)^2")[..3], [0.5, 1.0, 1.5]);
    assert_eq!(defined("a = dot(u, u) - u[0]^2 - u[1]^2"), [1.0; 9], "the third component is the step");
    assert_eq!(defined("a = mag(cross(u, vector(0, 0, 1)) / 2)")[2], 0.5 * 2f32.sqrt());
    assert_eq!(defined("a = \"stress tensor\"[0] + coords[2]")[8], 10.0);
    assert_eq!(defined("a = coords[2] * rho")[1], 1.0, "the middle of the hexahedron");
    assert_eq!(defined("a = 3"), [3.0; 9], "a constant is of points");
}

#[test]
fn derivatives_and_invariants_are_asked_for_by_name_or_as_functions() {
    let source = with(&[], &["u:vorticity", "u:vorticity:mag", "u", "stress tensor:mises", "u:q"]).unwrap();
    let names: Vec<_> = source.fields().iter().map(|f| (f.name.as_str(), f.components)).collect();
    assert_eq!(names[5..], [("u:vorticity", 3), ("stress tensor:mises", 1), ("u:q", 1)]);
    assert!(values(&*source, 0).iter().all(|q| (q - 1.0).abs() < 1e-6), "{:?}", values(&*source, 0));
    let vorticity = with(&[], &["u:vorticity"]).unwrap();
    let z = values(&*vorticity, 2);
    assert!(z.len() == 9 && z.iter().all(|z| (z + 2.0).abs() < 1e-6), "{z:?}");
    assert_eq!(values(&*with(&[], &["stress tensor:principal"]).unwrap(), 0)[5], 5.0);
    let by_function = defined("w = mag(curl(u)) + div(u)");
    assert!(by_function.iter().all(|w| (w - 2.0).abs() < 1e-6), "{by_function:?}");
    assert_eq!(with(&[], &["rho:gradient"]).unwrap().fields()[5].association, Association::Cell);
    assert_eq!(with(&[], &["u", "p:mag", "p:0", "nothing:mises"]).unwrap().fields().len(), 5, "none of these");
    assert_eq!((base_of_unit("s:mises"), base_of_unit("s:det"), base_of_unit("mises")), (Some("s"), None, None));
}

#[test]
fn a_definition_uses_those_before_it() {
    let source = with(&["a = p - 101325", "b = 1024 * a"], &["b"]).unwrap();
    assert_eq!(values(&*source, 0)[..4], [0.0, 1.0, 2.0, 3.0]);
    assert!(source.notes().iter().any(|note| note == "calculated b = 1024 * a"));
}

#[test]
fn what_does_not_fit_is_named_by_column() {
    for (definition, expected) in [
        ("a = q2 + 1", "column 5: there is no field 'q2'; the fields are: p, u, stress tensor, rho, zero"),
        ("a = p + rho", "column 9: has values of cells, and what stands before it of points"),
        ("a = u * u", "dot(a, b)"),
        ("a = p + u", "column 9: has 3 components"),
        ("a = 1 / 0", "column 9: division by zero"),
        ("a = f(p)", "column 5: there is no function 'f'"),
        ("a = sqrt(p, p)", "takes 1 argument, not 2"),
        ("a = mises(u)", "6 or 9 components, and this has 3"),
        ("a = curl(p)", "of 3 components, and this has 1"),
        ("a = u[3]", "no [3]"),
        ("p = u[0]", "there is a field 'p' already"),
        ("a = max(u, p)", "max is of 1 components"),
        ("a = vector(p, rho, p)", "cells"),
    ] {
        let error = with(&[definition], &[]).err().expect(definition).to_string();
        assert!(error.contains(expected) && error.contains("a.vtu") && error.contains(definition), "{error}");
    }
    assert!(with(&[], &["u:mises"]).err().unwrap().to_string().contains("6 or 9"));
}

#[test]
fn zeros_of_divisors_are_counted_once_a_step_by_column() {
    let source = with(&["a = rho / zero"], &[]).unwrap();
    for _ in 0..3 {
        assert_eq!(values(&*source, 0), [f32::INFINITY, 2.0]);
    }
    let notes = source.notes();
    assert!(notes.iter().any(|note| note.contains("column 9: division by zero of 1 values in 1 steps")), "{notes:?}");
}

#[test]
fn points_are_fixed_before_fields_are_calculated() {
    let twice: Definition = "twice = 2 * p".parse().expect("a definition");
    let mut source = calculated(Source::boxed(), &[twice], &[]).expect("a source");
    let error = source.fix_points().expect_err("too late").to_string();
    assert!(error.contains("before fields are calculated"), "{error}");
}
