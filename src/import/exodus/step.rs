//! A step of a file. Its mesh is that of all steps.

use super::super::cells::GridReader;
use super::super::numbers::{Numbers, Values};
use super::super::pieces::{BlockName, Piece};
use super::super::series::StepReader;
use super::super::tuples::Tuples;
use super::blocks::Block;
use super::database::{Database, Source, element_name, node_name};
use super::faces::FaceBlocks;
use super::whole::Whole;
use crate::error::{FileError, FileResult};
use crate::field::{Association, FieldInfo};
use glam::DVec3;
use std::hash::{DefaultHasher, Hash};
use std::path::Path;
use std::sync::Arc;

/// The variable with the number of each node.
const NODE_MAP: &str = "node_num_map";

/// Location of a step: its files, and its number in them.
pub(super) struct Origin {
    pub(super) whole: Arc<Whole>,
    pub(super) step: usize,
}

/// A step of all parts.
pub(super) struct ExodusStep {
    whole: Arc<Whole>,
    /// The parts that have nodes or elements.
    pieces: Vec<Part>,
}

/// A part of the mesh: a file.
pub(super) struct Part {
    whole: Arc<Whole>,
    /// Its place among the files.
    index: usize,
    step: usize,
}

impl StepReader for ExodusStep {
    type Origin = Origin;
    type Piece = Part;

    fn open(origin: &Origin) -> FileResult<Self> {
        let Origin { whole, step } = origin;
        let is_filled = |index: &usize| whole.parts[*index].points > 0 || whole.parts[*index].cells() > 0;
        let filled = (0..whole.parts.len()).filter(is_filled);
        let pieces = filled.map(|index| Part { whole: whole.clone(), index, step: *step }).collect();
        Ok(Self { whole: whole.clone(), pieces })
    }

    fn path(&self) -> &Path {
        self.whole.parts.first().map_or(Path::new(""), |part| part.netcdf.path())
    }

    fn bytes(&self) -> usize {
        0
    }

    fn pieces(&self) -> &[Part] {
        &self.pieces
    }
}

impl Piece for Part {
    type Array = Numbers;

    fn path(&self) -> &Path {
        self.database().netcdf.path()
    }

    fn counts(&self) -> (usize, usize) {
        (self.database().points, self.database().cells())
    }

    fn add_to(&self, grid: &mut GridReader) -> FileResult<()> {
        let Database { netcdf, points, blocks, .. } = self.database();
        let (points, cells) = (*points, self.database().cells());
        grid.check_room(self.path(), "", points, cells)?;
        let first_point = grid.mesh.points.len();
        self.add_points(grid)?;
        let (mut faces, mut first) = (FaceBlocks::default(), 0);
        for block in blocks {
            block.add_to(netcdf, grid, &mut faces, first, (points, first_point))?;
            first += block.cells;
        }
        grid.cells += cells;
        Ok(())
    }

    /// The mesh is the same at all steps of a file.
    fn hash_mesh(&self, state: &mut DefaultHasher) -> FileResult<()> {
        self.path().hash(state);
        Ok(())
    }

    /// The map of the numbers of nodes, which are those of the whole mesh.
    fn point_numbers(&self) -> FileResult<Option<Vec<u64>>> {
        let Database { netcdf, points, .. } = self.database();
        if netcdf.shape(NODE_MAP).is_none() {
            return Ok((*points == 0).then(Vec::new));
        }
        // Whether numbers are equal is all that matters.
        let numbers = netcdf.read(NODE_MAP, &[], &[*points as u64])?;
        Ok(Some(numbers.into_iter().map(f64::to_bits).collect()))
    }

    fn arrays(&self) -> Vec<FieldInfo> {
        self.database().arrays.iter().map(|array| array.field.clone()).collect()
    }

    fn blocks(&self) -> Vec<(BlockName, usize)> {
        let of = |block: &Block| (BlockName { name: block.name.clone(), number: block.user_number() }, block.cells);
        self.database().blocks.iter().map(of).collect()
    }

    fn left_out(&self) -> Vec<String> {
        self.database().left_out.clone()
    }

    fn unit(&self, array: usize) -> Option<String> {
        self.database().unit(self.database().arrays.get(array)?)
    }

    fn decode(&self, array: usize) -> FileResult<Numbers> {
        let no_array = || FileError::invalid(self.path(), "", "has no such array");
        let array = self.database().arrays.get(array).ok_or_else(no_array)?;
        match &array.source {
            Source::Nothing => Ok(self.nothing(&array.field)),
            Source::Blocks => {
                let of_block = |block: &Block| std::iter::repeat_n(block.id, block.cells);
                let mut out = Tuples::new(1, self.database().cells(), false);
                out.put(0, 0, self.database().blocks.iter().flat_map(of_block));
                Ok(out.numbers)
            }
            Source::Nodes(numbers) => {
                let names: Vec<String> = numbers.iter().map(|&number| node_name(number)).collect();
                self.nodes(names.iter().map(|name| (name.as_str(), None)))
            }
            Source::NodesTogether(places) => {
                self.nodes(places.iter().map(|&place| ("vals_nod_var", Some(place as u64))))
            }
            Source::Elements(variables) => self.elements(variables),
        }
    }

    fn values<'a>(&'a self, array: &'a Numbers) -> Values<'a> {
        array.values()
    }
}

impl Part {
    fn database(&self) -> &Database {
        &self.whole.parts[self.index]
    }

    /// An array of NaN.
    fn nothing(&self, field: &FieldInfo) -> Numbers {
        let tuples =
            if field.association == Association::Point { self.database().points } else { self.database().cells() };
        let mut out = Tuples::new(field.components, tuples, true);
        (0..field.components).for_each(|component| out.put(component, 0, std::iter::repeat_n(f64::NAN, tuples)));
        out.numbers
    }

    fn add_points(&self, grid: &mut GridReader) -> FileResult<()> {
        let Database { netcdf, points, axes, .. } = self.database();
        if *points == 0 {
            return Ok(());
        }
        let all = &mut grid.mesh.points;
        let first = all.len();
        let shape = [*points as u64];
        for (axis, name) in ["coordx", "coordy", "coordz"].into_iter().take(*axes).enumerate() {
            let is_together = netcdf.shape("coord").is_some();
            let numbers = if is_together {
                netcdf.read("coord", &[axis as u64], &shape)?
            } else {
                netcdf.read(name, &[], &shape)?
            };
            all.resize(first + numbers.len(), DVec3::ZERO);
            all[first..].iter_mut().zip(numbers).for_each(|(point, number)| point[axis] = number);
        }
        Ok(())
    }

    /// The values of nodes: for each component a variable, and the index along its second axis if it has one.
    fn nodes<'a>(&self, components: impl Iterator<Item = (&'a str, Option<u64>)> + Clone) -> FileResult<Numbers> {
        let Database { netcdf, points, .. } = self.database();
        let width = components.clone().count();
        let is_f32 = components.clone().all(|(name, _)| netcdf.is_f32(name));
        let mut out = None;
        for (component, (name, place)) in components.enumerate() {
            let at = [Some(self.step as u64), place].into_iter().flatten().collect::<Vec<u64>>();
            let numbers = netcdf.read(name, &at, &[*points as u64])?;
            // Room is made for what was read, not for what is claimed.
            let out = out.get_or_insert_with(|| Tuples::new(width, numbers.len(), is_f32));
            out.put(component, 0, numbers);
        }
        Ok(out.unwrap_or_else(|| Tuples::new(1, 0, is_f32)).numbers)
    }

    /// The values of elements; NaN in blocks without them.
    fn elements(&self, variables: &[usize]) -> FileResult<Numbers> {
        let Database { netcdf, blocks, .. } = self.database();
        let has = |variable: usize, block: &&Block| self.database().has(variable, block);
        let all = variables.iter().flat_map(|&variable| {
            blocks.iter().filter(move |block| has(variable, block)).map(move |block| element_name(variable, block))
        });
        let is_f32 = all.into_iter().all(|name| netcdf.is_f32(&name));
        let mut out = Tuples::new(variables.len(), self.database().cells(), is_f32);
        for (component, &variable) in variables.iter().enumerate() {
            let mut first = 0;
            for block in blocks {
                if has(variable, &block) {
                    let name = element_name(variable, block);
                    out.put(component, first, netcdf.read(&name, &[self.step as u64], &[block.cells as u64])?);
                } else {
                    out.put(component, first, std::iter::repeat_n(f64::NAN, block.cells));
                }
                first += block.cells;
            }
        }
        Ok(out.numbers)
    }
}
