//! Kernels of transfer functions.

use super::Work;
use crate::scene::{DENSE, RANGE, TENTS};
use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use tetreel::transfer::{
    Blend, Context, Ensemble, Function, Lengths, MappedRange, Member, OpacityKind, TransferFunction, build_node_table,
};

/// Builds the tables of two transfer functions.
pub fn node_table(_: &Path) -> Result<Work, Box<dyn Error>> {
    let functions = [TransferFunction::parse(DENSE)?, TransferFunction::parse(TENTS)?];
    let range = MappedRange::new(RANGE.0, RANGE.1, false)?;
    Ok(Box::new(move || {
        for tf in functions.iter().cycle().take(20) {
            black_box(build_node_table(black_box(tf), &range, OpacityKind::Alpha, &Lengths::of_unit_distance(0.02))?);
        }
        Ok(())
    }))
}

/// Blends the curve of three members.
pub fn ensemble(_: &Path) -> Result<Work, Box<dyn Error>> {
    let member = |tf: &str, blend| -> Result<Member, Box<dyn Error>> {
        Ok(Member { blend, ..Member::new(tf, Function::TransferFunction(TransferFunction::parse(tf)?)) })
    };
    let members = vec![
        member("viridis@0:0,0.2:0,0.5:0.1,1:0.4", Blend::Add)?,
        member("inferno@0:0,0.3:0.05,0.6:0,1:0.2", Blend::Add)?,
        member(TENTS, Blend::Add)?,
    ];
    let ensemble = Ensemble { name: "three".to_owned(), colors: Default::default(), members };
    Ok(Box::new(move || {
        for _ in 0..20 {
            let context = Context::new(RANGE, RANGE, OpacityKind::Alpha, Lengths::of_unit_distance(0.02));
            black_box(black_box(&ensemble).curve(&context)?);
        }
        Ok(())
    }))
}
