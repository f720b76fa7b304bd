//! What a file holds: blocks of elements, times, and the arrays that its variables make up.

use super::super::units::{self, unit_of};
use super::blocks::Block;
use super::netcdf::NetCdf;
use super::vectors::{Components, joined};
use crate::error::{FileError, FileResult};
use crate::field::{Association, Blocks, FieldInfo};
use std::collections::HashSet;
use std::path::Path;

/// The values of an array.
pub(super) enum Source {
    /// None: another part of the mesh has values.
    Nothing,
    /// The number of the block of each element.
    Blocks,
    /// The variable `vals_nod_varN` of each component, by N.
    Nodes(Vec<usize>),
    /// The place of each component along the second axis of the variable `vals_nod_var`, as old files have it.
    NodesTogether(Vec<usize>),
    /// The variables `vals_elem_varNebM` of each component, by N.
    Elements(Vec<usize>),
}

/// An array of a step.
pub(super) struct Array {
    pub(super) field: FieldInfo,
    pub(super) source: Source,
}

/// A file whose lists were read, but no numbers.
pub(super) struct Database {
    pub(super) netcdf: NetCdf,
    pub(super) points: usize,
    /// Number of coordinates of a point.
    pub(super) axes: usize,
    pub(super) blocks: Vec<Block>,
    /// Times in the order of the file; none if it has no steps.
    pub(super) times: Vec<f64>,
    pub(super) arrays: Vec<Array>,
    /// Variables of elements by number of the variable and of the block.
    elements: HashSet<(usize, usize)>,
    /// Arrays that are not read, each with the reason why.
    pub(super) left_out: Vec<String>,
}

impl Database {
    /// Opens a file, one of `files` that are open at a time. If there are several, it may be without nodes and elements.
    ///
    /// # Errors
    /// If it is no Exodus file, is damaged, or has elements that are not read.
    pub(super) fn open(path: &Path, files: usize) -> FileResult<Self> {
        let netcdf = NetCdf::open(path, files)?;
        let has = |dimension: &str| netcdf.dimension(dimension).is_some();
        // Dimensions of size 0 are not written.
        if !(has("num_nodes") && has("num_el_blk") || files > 1 && has("num_dim")) {
            return Err(FileError::invalid(
                path,
                "",
                "is no Exodus file with a mesh: it has no nodes or no element blocks",
            )
            .remedy("name the file with the mesh"));
        }
        let points = netcdf.count("num_nodes")?;
        let axes = netcdf.dimension("num_dim").unwrap_or(3);
        let axes = usize::try_from(axes)
            .ok()
            .filter(|axes| (1..=3).contains(axes))
            .ok_or_else(|| FileError::invalid(path, "dimension 'num_dim'", format!("is {axes}, not 1, 2 or 3")))?;
        let blocks = Block::all(&netcdf)?;
        let times = times(&netcdf)?;
        let elements = netcdf.names().filter_map(element_variable).collect();
        let mut database =
            Self { netcdf, points, axes, blocks, times, arrays: Vec::new(), elements, left_out: Vec::new() };
        if !database.times.is_empty() {
            database.add_node_arrays()?;
            database.add_element_arrays()?;
        }
        let field = FieldInfo { name: Blocks::FIELD.to_owned(), components: 1, association: Association::Cell };
        database.arrays.push(Array { field, source: Source::Blocks });
        Ok(database)
    }

    /// Number of elements.
    pub(super) fn cells(&self) -> usize {
        self.blocks.iter().map(|block| block.cells).sum()
    }

    /// Whether a block has a variable of elements.
    pub(super) fn has(&self, variable: usize, block: &Block) -> bool {
        self.elements.contains(&(variable, block.number))
    }

    /// The unit of an array, if the variables of all its components have the same.
    pub(super) fn unit(&self, array: &Array) -> Option<String> {
        let of_variable = |name: &str| {
            let text = |attribute: &str| self.netcdf.text(name, attribute);
            units::ATTRIBUTES.into_iter().filter_map(text).find_map(|text| unit_of(&text))
        };
        // Blocks may lack a variable.
        let of_elements = |&variable: &usize| {
            let mut having = self.blocks.iter().filter(|block| self.has(variable, block));
            having.find_map(|block| of_variable(&element_name(variable, block)))
        };
        let mut units: Vec<Option<String>> = match &array.source {
            Source::Blocks | Source::Nothing => Vec::new(),
            Source::Nodes(numbers) => numbers.iter().map(|number| of_variable(&node_name(*number))).collect(),
            Source::NodesTogether(_) => vec![of_variable("vals_nod_var")],
            Source::Elements(variables) => variables.iter().map(of_elements).collect(),
        };
        units.dedup();
        if let [unit] = &mut units[..] { unit.take() } else { None }
    }

    fn add_node_arrays(&mut self) -> FileResult<()> {
        let names = self.netcdf.strings("name_nod_var")?;
        let together = self.netcdf.shape("vals_nod_var").map(|shape| shape.get(1).copied().unwrap_or(0));
        for Components { name, members } in joined(&names) {
            let numbers: Vec<usize> = members.iter().map(|member| member + 1).collect();
            let source = match together {
                Some(count) if members.iter().all(|&member| (member as u64) < count) => Source::NodesTogether(members),
                None if numbers.iter().all(|&n| self.netcdf.shape(&node_name(n)).is_some()) => Source::Nodes(numbers),
                _ => {
                    self.left_out.push(format!("'{name}' (has no values)"));
                    continue;
                }
            };
            self.push(name, numbers_of(&source), Association::Point, source);
        }
        Ok(())
    }

    fn add_element_arrays(&mut self) -> FileResult<()> {
        let names = self.netcdf.strings("name_elem_var")?;
        self.check_table(names.len())?;
        let met: HashSet<usize> = self.elements.iter().map(|(variable, _)| *variable).collect();
        for Components { name, members } in joined(&names) {
            let numbers: Vec<usize> = members.iter().map(|member| member + 1).collect();
            if numbers.iter().any(|number| met.contains(number)) {
                self.push(name, numbers.len(), Association::Cell, Source::Elements(numbers));
            } else {
                self.left_out.push(format!("'{name}' (has no values)"));
            }
        }
        Ok(())
    }

    fn push(&mut self, name: String, components: usize, association: Association, source: Source) {
        self.arrays.push(Array { field: FieldInfo { name, components, association }, source });
    }

    /// Checks that the variables are there that the truth table says blocks have.
    fn check_table(&self, variables: usize) -> FileResult<()> {
        let name = "elem_var_tab";
        let Some(shape) = self.netcdf.shape(name) else { return Ok(()) };
        let [_, width] = shape[..] else { return Err(self.netcdf.invalid(name, format!("has the shape {shape:?}"))) };
        if width != variables as u64 {
            return Err(self.netcdf.invalid(name, format!("is of {width} variables, but {variables} have names")));
        }
        let table = self.netcdf.read(name, &[], &shape)?;
        for block in &self.blocks {
            let row = table.chunks_exact(variables.max(1)).nth(block.number - 1).unwrap_or_default();
            let missing = row.iter().zip(1..).find(|&(&flag, variable)| flag != 0.0 && !self.has(variable, block));
            if let Some((_, variable)) = missing {
                let problem = format!("is missing, though block {} has it by '{name}'", block.number);
                return Err(self.netcdf.invalid(&element_name(variable, block), problem));
            }
        }
        Ok(())
    }

    /// The blocks without values of an array.
    pub(super) fn without<'a>(&'a self, array: &'a Array) -> impl Iterator<Item = &'a Block> {
        self.blocks.iter().filter(move |block| match &array.source {
            Source::Elements(variables) => !variables.iter().all(|&variable| self.has(variable, block)),
            Source::Nothing => true,
            Source::Blocks | Source::Nodes(_) | Source::NodesTogether(_) => false,
        })
    }
}

fn numbers_of(source: &Source) -> usize {
    match source {
        Source::Nothing | Source::Blocks => 1,
        Source::Nodes(numbers) | Source::NodesTogether(numbers) | Source::Elements(numbers) => numbers.len(),
    }
}

/// The name of the variable of a component at nodes.
pub(super) fn node_name(number: usize) -> String {
    format!("vals_nod_var{number}")
}

/// The name of the variable of a block's elements.
pub(super) fn element_name(variable: usize, block: &Block) -> String {
    format!("vals_elem_var{variable}eb{}", block.number)
}

/// The numbers in such a name.
fn element_variable(name: &str) -> Option<(usize, usize)> {
    let (variable, block) = name.strip_prefix("vals_elem_var")?.split_once("eb")?;
    Some((variable.parse().ok()?, block.parse().ok()?))
}

/// The times of the steps.
fn times(netcdf: &NetCdf) -> FileResult<Vec<f64>> {
    let name = "time_whole";
    let Some(shape) = netcdf.shape(name) else { return Ok(Vec::new()) };
    let [steps] = shape[..] else { return Err(netcdf.invalid(name, format!("has the shape {shape:?}"))) };
    let times = netcdf.read(name, &[], &[steps])?;
    match times.iter().position(|time| !time.is_finite()) {
        Some(step) => Err(netcdf.invalid(name, format!("the time {} of step {step} is not finite", times[step]))),
        // Adding zero turns -0 into +0.
        None => Ok(times.into_iter().map(|time| time + 0.0).collect()),
    }
}
