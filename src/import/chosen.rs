//! Some blocks of a source instead of all.

use crate::error::{FileError, FileResult};
use crate::field::{Association, Blocks, Component, FieldInfo, SeriesSource, TimeAxis};
use crate::mesh::{RawMesh, gather};

/// The cells of a source that are of some of its blocks, named by their names or numbers. All of its points stay in the mesh; those that no
/// cell uses are dropped when it is built.
///
/// # Errors
/// If the source has no blocks, or none of such a name, or the blocks have no cells with a volume.
pub fn choose_blocks(source: Box<dyn SeriesSource>, names: &[String]) -> FileResult<Box<dyn SeriesSource>> {
    if names.is_empty() {
        return Ok(source);
    }
    let invalid = |problem: String| FileError::unsupported(source.describe(), "blocks", problem);
    let blocks = source.blocks()?.ok_or_else(|| invalid("has no blocks".to_owned()).remedy("leave --block out"))?;
    let mut numbers = Vec::new();
    for name in names {
        let unknown = || {
            let problem = format!("there is no block '{name}'");
            invalid(problem).remedy(format!("choose from: {}", blocks.list()))
        };
        numbers.push(blocks.number_of(name).ok_or_else(unknown)?);
    }
    let kept: Vec<u32> =
        (0..).zip(&blocks.of_cell).filter(|(_, number)| numbers.contains(number)).map(|(cell, _)| cell).collect();
    if kept.is_empty() {
        return Err(invalid(format!("no cell with a volume is of {}", names.join(", "))));
    }
    let note = format!("{} of {} cells are of the blocks {}", kept.len(), blocks.of_cell.len(), names.join(", "));
    Ok(Box::new(Chosen { source, kept, note }))
}

struct Chosen {
    source: Box<dyn SeriesSource>,
    /// The cells that are kept, ascending.
    kept: Vec<u32>,
    note: String,
}

impl Chosen {
    fn select<T: Copy>(&self, field: &FieldInfo, values: &mut Vec<T>) {
        if field.association == Association::Cell {
            gather(values, &self.kept);
        }
    }
}

impl SeriesSource for Chosen {
    fn describe(&self) -> String {
        self.source.describe()
    }

    fn times(&self) -> &TimeAxis {
        self.source.times()
    }

    fn fields(&self) -> &[FieldInfo] {
        self.source.fields()
    }

    fn unit(&self, field: &FieldInfo) -> Option<String> {
        self.source.unit(field)
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        let RawMesh { points, cells } = self.source.mesh()?;
        Ok(RawMesh { points, cells: cells.gathered(&self.kept) })
    }

    fn cell_number(&self, cell: u32) -> u32 {
        self.kept.get(cell as usize).map_or(cell, |&cell| self.source.cell_number(cell))
    }

    fn read(&self, field: &FieldInfo, component: Component, step: usize, out: &mut Vec<f32>) -> FileResult<()> {
        self.source.read(field, component, step, out)?;
        self.select(field, out);
        Ok(())
    }

    fn read_f64(&self, field: &FieldInfo, component: usize, step: usize, out: &mut Vec<f64>) -> FileResult<()> {
        self.source.read_f64(field, component, step, out)?;
        self.select(field, out);
        Ok(())
    }

    fn check(&self, step: usize) -> FileResult<()> {
        self.source.check(step)
    }

    fn counted(&self, last: usize) -> serde_json::Value {
        self.source.counted(last)
    }

    fn count_on(&self, counted: &serde_json::Value) {
        self.source.count_on(counted);
    }

    fn blocks(&self) -> FileResult<Option<Blocks>> {
        Ok(self.source.blocks()?.map(|blocks| blocks.of_cells(&self.kept)))
    }

    fn fix_points(&mut self) -> FileResult<()> {
        self.source.fix_points()
    }

    fn notes(&self) -> Vec<String> {
        [self.source.notes(), vec![self.note.clone()]].concat()
    }
}
