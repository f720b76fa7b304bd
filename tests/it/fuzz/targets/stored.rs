//! Stores, and the chunks and blocks in them.

use super::archive::{files, unpack};
use super::{Folder, Outcome};
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use tetreel::codec::vq::{VqDecoder, VqParameters};
use tetreel::codec::{Decoder, Element, ReadRange, chunk_key, parse_chunk_key, read_chunk, read_rows, seal, to_bytes};
use tetreel::error::{FileError, FileResult};
use tetreel::export::StoredSeries;
use tetreel::field::{Association, Component, SeriesSource};
use tetreel::functions::value_at;
use tetreel::store::{Store, StoredTravel};

/// The folder of a store, all of whose parts are read.
pub fn store(bytes: &[u8]) -> Outcome {
    let folder = Folder::new();
    unpack(bytes, folder.path());
    folder.judge(read_store(&folder))
}

fn read_store(folder: &Folder) -> FileResult<()> {
    let store = Store::open(folder.path())?;
    store.info()?;
    let mesh = store.mesh()?;
    match &mesh.radii {
        None => assert_eq!(mesh.topology.check(), Ok(())),
        // A cloud has no faces.
        Some(radii) => {
            assert_eq!(radii.len(), mesh.positions.local.len());
            assert!(radii.iter().all(|&radius| radius > 0.0 && radius <= 1.0));
            assert!((0..radii.len() as u32).all(|point| mesh.filling_of(point) > 0.0));
        }
    }
    if let Some(functions) = store.functions()? {
        let kernels = functions.kernels(&mesh)?;
        assert_eq!(kernels.len(), mesh.positions.local.len());
        // Values that any place inside the cells has, or none.
        let found = value_at(&kernels, &vec![0.5; kernels.len()], DVec3::splat(0.1));
        assert!(found.is_none_or(|value| value == 0.5));
    }
    let points = store.source_points()?;
    assert!(points.is_none_or(|points| points.len() == mesh.positions.local.len()));
    assert!(store.times().values.is_sorted_by(|a, b| a < b));
    read_as_source(&store)?;
    for field in store.fields() {
        // The name that is stored is one that the user can give.
        let Ok(selector) = field.name.parse();
        let reader = store.field(&selector)?;
        let mut out = vec![0.0; reader.value_count()];
        // The ends of the first blocks, and of the series.
        let last = reader.step_count() - 1;
        for step in [0, 1, 63, 64, last] {
            if step <= last {
                reader.decode_step(step, &mut out)?;
            }
        }
        assert!(reader.decode_step(last + 1, &mut out).is_err());
        if let Some(statistics) = reader.statistics()? {
            statistics.coefficient_of_variation(field.range, Default::default());
        }
        let importance = reader.variation();
        assert!(importance.is_none_or(|values| values.len() == out.len() && values.iter().all(|&v| v >= 0.0)));
        for interval in reader.intervals(6).unwrap_or_default() {
            assert!(interval.first <= interval.sampled && interval.sampled < interval.end);
        }
    }
    read_travel(&store)
}

/// The ways of each vector of three components.
fn read_travel(store: &Store) -> FileResult<()> {
    let has = |name: &str| store.fields().iter().any(|field| field.name == name);
    for name in store.fields().iter().filter_map(|field| field.name.strip_suffix(":0")) {
        let components = [0, 1, 2].map(|axis| format!("{name}:{axis}"));
        if !components.iter().all(|name| has(name)) {
            continue;
        }
        let reader = |name: &String| store.field(&name.parse().unwrap_or_else(|never| match never {}));
        let [x, y, z] = [reader(&components[0])?, reader(&components[1])?, reader(&components[2])?];
        let Some(travel) = StoredTravel::of([&x, &y, &z], store.times()) else { continue };
        assert!(travel.rows() <= (x.step_count() - 1) / StoredTravel::STEPS && travel.row(travel.rows()).is_none());
        for ways in (0..travel.rows()).filter_map(|row| travel.row(row)) {
            assert!(ways.len() == x.value_count() && ways.iter().all(|&way| way >= 0.0));
        }
    }
    Ok(())
}

/// The cells and the first step of each field as the source had them.
fn read_as_source(store: &Store) -> FileResult<()> {
    let source = StoredSeries::new(store, &[])?;
    let mesh = source.mesh()?;
    let mut out = Vec::new();
    for field in source.fields() {
        source.read(field, Component::Index(0), 0, &mut out)?;
        let values = match field.association {
            Association::Point => mesh.points.len(),
            Association::Cell => mesh.cells.len(),
        };
        assert_eq!(out.len(), values, "{field:?}");
    }
    Ok(())
}

/// Chunks by name, in memory.
#[derive(Default)]
struct Objects(BTreeMap<String, Vec<u8>>);

/// What errors call these objects.
const OBJECTS: &str = "fuzzed";

impl ReadRange for Objects {
    fn size(&self, key: &str) -> FileResult<u64> {
        let missing = || FileError::invalid(self.path(key), "", "is missing");
        self.0.get(key).map(|bytes| bytes.len() as u64).ok_or_else(missing)
    }

    fn exists(&self, key: &str) -> FileResult<bool> {
        Ok(self.0.contains_key(key))
    }

    fn read(&self, key: &str, offset: u64, parts: &mut [&mut [u8]]) -> FileResult<()> {
        let ends = || FileError::invalid(self.path(key), "", "ends too early");
        let mut rest =
            usize::try_from(offset).ok().and_then(|offset| self.0.get(key)?.get(offset..)).ok_or_else(ends)?;
        for part in parts {
            let (head, tail) = rest.split_at_checked(part.len()).ok_or_else(ends)?;
            part.copy_from_slice(head);
            rest = tail;
        }
        Ok(())
    }

    fn path(&self, key: &str) -> PathBuf {
        PathBuf::from(OBJECTS).join(key)
    }
}

fn judge<T>(result: FileResult<T>) -> Outcome {
    result.map(|_| ()).map_err(|error| {
        let message = error.to_string();
        assert!(message.contains(OBJECTS), "names no object: {message}");
        message
    })
}

/// Most vertices and steps that an input may ask for: the caller of a decoder, who has compared them with sizes of files, brings
/// the memory.
const VERTICES_MAX: u64 = 4096;
const STEPS_MAX: u64 = 4096;

/// Blocks of codec `vq` in a group `f`: `f/shape.json` has `steps`, `vertices` and `parameters`.
pub fn vq(bytes: &[u8]) -> Outcome {
    let objects = Objects(files(bytes).into_iter().collect());
    let shape: Option<serde_json::Value> =
        objects.0.get("f/shape.json").and_then(|json| serde_json::from_slice(json).ok());
    let shape = shape.ok_or("no shape")?;
    let number = |name: &str, max| shape[name].as_u64().filter(|&n| n <= max).ok_or(format!("no {name}"));
    let (steps, vertices) = (number("steps", STEPS_MAX)? as usize, number("vertices", VERTICES_MAX)? as usize);
    let parameters = VqParameters::read(&shape["parameters"])?;
    parameters.arrays(steps as u64, vertices as u64);
    let source = Arc::new(objects);
    parameters.unsettled_chunks(&*source, "f", steps as u64);
    let decoder = VqDecoder::new(source, "f", parameters, steps, vertices);
    let mut out = vec![0.0; vertices];
    let mut first = Ok(());
    for step in [0, 7, 8, 63, 64, steps.saturating_sub(1), steps] {
        let decoded = judge(decoder.decode_step(step, &mut out));
        assert!(decoded.is_err() || step < steps);
        if step < steps {
            first = first.and(decoded);
            let block = decoder.resident_block(step);
            assert_eq!(block.is_ok(), judge(decoder.decode_step(step, &mut out)).is_ok());
        }
    }
    first
}

/// One chunk, behind a byte that says of what elements. It is read if it is whole, and only then.
pub fn chunk(bytes: &[u8]) -> Outcome {
    let (&kind, bytes) = bytes.split_first().ok_or("no chunk")?;
    let _ = std::str::from_utf8(bytes).map(|text| {
        if let Some((array, row)) = parse_chunk_key(text) {
            assert_eq!(parse_chunk_key(&chunk_key(array, row, 2)), Some((array, row)));
        }
    });
    match kind % 7 {
        0 => read_as::<f32>(bytes),
        1 => read_as::<f64>(bytes),
        2 => read_as::<i8>(bytes),
        3 => read_as::<u8>(bytes),
        4 => read_as::<u16>(bytes),
        5 => read_as::<u32>(bytes),
        _ => read_as::<u64>(bytes),
    }
}

fn read_as<T: Element>(bytes: &[u8]) -> Outcome {
    let objects = Objects([("c".to_owned(), bytes.to_vec())].into());
    let payload = bytes.len().saturating_sub(seal(&[]).len());
    let count = payload / size_of::<T>();
    let is_whole = bytes.len() > payload
        && payload.is_multiple_of(size_of::<T>())
        && seal(&bytes[..payload])[..] == bytes[payload..];
    let mut out = vec![T::zeroed(); count];
    let read = read_chunk(&objects, "c", &mut out);
    assert_eq!(read.is_ok(), is_whole, "{read:?}");
    if is_whole {
        assert_eq!(&*to_bytes(&out), &bytes[..payload], "what is read is what is there");
    }
    // Of an empty array there is no chunk, and none is looked for.
    let rows = read_rows::<T, 1>(&objects, "c", count as u64);
    assert_eq!(rows.is_ok(), is_whole || count == 0);
    for wrong in [count as u64 + 1, u64::MAX / 8, u64::MAX] {
        assert!(read_rows::<T, 4>(&objects, "c", wrong).is_err(), "a chunk of {wrong} rows in {} bytes", bytes.len());
    }
    judge(read)
}
