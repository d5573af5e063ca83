//! Reads a node table from Parquet, row groups side by side.
//!
//! Owns: what each column must hold. Columns may come in any order, others beside them, and names may be plain
//! strings: a table that pandas, polars or DuckDB has written again is read too, as long as its metadata are kept.

use std::fs::File;
use std::io::{BufReader, Read};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::sync::Arc;

use ::parquet::arrow::ProjectionMask;
use ::parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder,
};
use ::parquet::errors::{ParquetError, Result as ParquetResult};
use ::parquet::file::reader::{ChunkReader, Length};
use arrow::array::{Array, ArrayRef, AsArray, RecordBatch, StringArray};
use arrow::compute::cast;
use arrow::datatypes::{DataType, FieldRef, Float32Type, Float64Type, Int32Type, Int64Type, Schema};
use bytes::Bytes;
use rayon::prelude::*;

use super::parquet::KEY_PREFIX;
use super::shared::read_fault;
use super::sum::{RowSum, SUM_KEY};
use super::{COLUMNS, NodeTable, Rows, STATUS_WORDS, TableMeta, row_fault};
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::message::TRACK;

pub(super) fn read_meta(path: &Path) -> Result<TableMeta> {
    Ok(open(path)?.2)
}

/// A file read at offsets, so that many can read it at once.
#[derive(Clone)]
struct Shared {
    file: Arc<File>,
    length: u64,
}

impl Length for Shared {
    fn len(&self) -> u64 {
        self.length
    }
}

impl ChunkReader for Shared {
    type T = BufReader<From>;

    fn get_read(&self, start: u64) -> ParquetResult<Self::T> {
        Ok(BufReader::new(From { file: Arc::clone(&self.file), at: start }))
    }

    fn get_bytes(&self, start: u64, length: usize) -> ParquetResult<Bytes> {
        if start.checked_add(length as u64).is_none_or(|end| end > self.length) {
            return Err(ParquetError::EOF(format!("{length} bytes from byte {start} of {}", self.length)));
        }
        let mut bytes = vec![0; length];
        self.file.read_exact_at(&mut bytes, start)?;
        Ok(bytes.into())
    }
}

/// A file read from an offset on.
struct From {
    file: Arc<File>,
    at: u64,
}

impl Read for From {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let read = self.file.read_at(out, self.at)?;
        self.at += read as u64;
        Ok(read)
    }
}

/// The metadata with types by the Parquet columns alone, words as dictionaries. The types that an Arrow writer adds to the file
/// are left aside: damaged ones panic in arrow-ipc 59.
fn load(file: &Shared) -> ParquetResult<ArrowReaderMetadata> {
    let plain = ArrowReaderMetadata::load(file, ArrowReaderOptions::new().with_skip_arrow_metadata(true))?;
    let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    let fields: Vec<FieldRef> = plain
        .schema()
        .fields()
        .iter()
        .map(|field| match field.data_type() {
            DataType::Utf8 => Arc::new(field.as_ref().clone().with_data_type(coded.clone())),
            _ => Arc::clone(field),
        })
        .collect();
    let options = ArrowReaderOptions::new().with_schema(Arc::new(Schema::new(fields)));
    ArrowReaderMetadata::try_new(Arc::clone(plain.metadata()), options)
}

fn open(path: &Path) -> Result<(Shared, ArrowReaderMetadata, TableMeta)> {
    let file = File::open(path).map_err(|e| read_fault(path, &e))?;
    let length = file.metadata().map_err(|e| read_fault(path, &e))?.len();
    let file = Shared { file: Arc::new(file), length };
    let metadata = load(&file).map_err(|e| {
        Error::Table(
            Fault::new(path.display(), format!("it is not a whole Parquet file ({e})"))
                .of_kind(FaultKind::Damaged)
                .advice("It may be cut off: copy it again, or run " + TRACK + " again"),
        )
    })?;
    let name = path.display().to_string();
    let pairs = metadata.metadata().file_metadata().key_value_metadata();
    let find = |key: &str| {
        let full = format!("{KEY_PREFIX}{key}");
        pairs?.iter().find(|kv| kv.key == full)?.value.clone()
    };
    let meta = TableMeta::from_entries(find, &name)?;
    let there: Vec<&str> = metadata.schema().fields().iter().map(|f| f.name().as_str()).collect();
    for column in COLUMNS {
        let count = there.iter().filter(|name| **name == column).count();
        if count > 1 {
            return Err(Error::Table(
                Fault::new(&name, format!("the column {column} is there {count} times"))
                    .advice("Rename all but one"),
            ));
        }
        if count == 0 {
            return Err(Error::Table(
                Fault::new(&name, format!("there is no column {column}, only {}", there.join(", ")))
                    .advice("Give a node table written by " + TRACK),
            ));
        }
    }
    Ok((file, metadata, meta))
}

/// Refuses a file whose rows are not the bytes that were written. A program that writes a table of ours again keeps the sum, but
/// not the name of the writer.
fn check_sum(path: &Path, file: &Shared, metadata: &ArrowReaderMetadata) -> Result<()> {
    let about = metadata.metadata().file_metadata();
    if !about.created_by().is_some_and(|writer| writer.starts_with(TableMeta::PROGRAM)) {
        return Ok(());
    }
    let entry = about.key_value_metadata().and_then(|all| all.iter().find(|kv| kv.key == SUM_KEY));
    // Tables of earlier versions have no sum.
    let Some(text) = entry.and_then(|kv| kv.value.as_deref()) else { return Ok(()) };
    let bytes = From { file: Arc::clone(&file.file), at: 0 };
    let holds = RowSum::from_text(text).map(|sum| sum.holds(bytes)).transpose();
    if holds.map_err(|e| read_fault(path, &e))? == Some(true) {
        return Ok(());
    }
    Err(Error::Table(
        Fault::new(path.display(), "its rows are not those that were written (their checksum differs)")
            .of_kind(FaultKind::Damaged)
            .advice("It is damaged: copy it again, or run " + TRACK + " again"),
    ))
}

pub(super) fn read(path: &Path) -> Result<NodeTable> {
    let (file, metadata, meta) = open(path)?;
    check_sum(path, &file, &metadata)?;
    let name = path.display().to_string();
    let groups = metadata.metadata().row_groups();
    let mut first_rows = Vec::with_capacity(groups.len());
    let mut total = 0usize;
    for (g, group) in groups.iter().enumerate() {
        first_rows.push(total);
        let rows = group.num_rows();
        // What is set aside below is as much as the file says, so it must say the same everywhere.
        let agreed = group.columns().iter().all(|c| c.num_values() == rows);
        total = usize::try_from(rows)
            .ok()
            .filter(|_| agreed)
            .and_then(|rows| total.checked_add(rows))
            .ok_or_else(|| {
                Error::Table(
                    Fault::new(&name, format!("row group {g} says {rows} rows, its columns say otherwise"))
                        .of_kind(FaultKind::Damaged)
                        .advice("It is damaged: copy it again, or run " + TRACK + " again"),
                )
            })?;
    }
    let nodes = meta.rig.nodes.len();
    if !total.is_multiple_of(nodes) {
        return Err(Error::Table(
            Fault::new(
                &name,
                format!("it has {total} rows, which is not a whole number of frames of {nodes} nodes"),
            )
            .advice("Each frame needs one row per node, in the order of the rig"),
        ));
    }
    let columns = ProjectionMask::columns(metadata.parquet_schema(), COLUMNS);
    // Each group fills its own part of the table, so the parts can be filled side by side.
    let mut table = Rows {
        frame: vec![0; total / nodes],
        time_s: vec![0.0; total / nodes],
        xy_px: vec![0.0; 2 * total],
        sigma_px: vec![0.0; total],
        area_px: vec![0.0; total],
        status: vec![0; total],
    };
    let parts = split(&mut table, &first_rows, nodes);
    let begun = parts.into_par_iter().enumerate().map(|(g, mut part)| -> Result<Option<Stamp>> {
        let rows = groups[g].num_rows().max(1) as usize;
        let damaged = |e: String| {
            Error::Table(
                Fault::new(&name, format!("row group {g} cannot be read ({e})"))
                    .of_kind(FaultKind::Damaged)
                    .at(Place::Row(first_rows[g] as u64))
                    .advice("It is damaged: copy it again, or run " + TRACK + " again"),
            )
        };
        let reader = ParquetRecordBatchReaderBuilder::new_with_metadata(file.clone(), metadata.clone())
            .with_row_groups(vec![g])
            .with_projection(columns.clone())
            .with_batch_size(rows)
            .build()
            .map_err(|e| damaged(e.to_string()))?;
        let (mut begun, mut newest) = (None, None);
        let mut done = 0;
        for batch in reader {
            let batch = batch.map_err(|e| damaged(e.to_string()))?;
            let mut here = part
                .split_off_front(batch.num_rows(), nodes)
                .ok_or_else(|| damaged("too many rows".into()))?;
            here.fill(&batch, &meta, &name)?;
            here.fill_stamps(&batch, &mut begun, &mut newest, &meta, &name)?;
            done += batch.num_rows();
        }
        if part.status.is_empty() { Ok(begun) } else { Err(damaged(format!("it has {done} of {rows} rows"))) }
    });
    let begun: Vec<Result<Option<Stamp>>> = threads::install(|| begun.collect());
    for begun in begun {
        // A frame that begins in one group and ends in another.
        if let Some(here) = begun? {
            let t = here.row / nodes;
            let first = Stamp { row: t * nodes, frame: table.frame[t], time_s: table.time_s[t] };
            here.same_frame(&first, nodes, &name)?;
        }
    }
    Ok(NodeTable { meta, rows: table })
}

/// The frame and time of a row.
#[derive(Debug, Clone, Copy)]
struct Stamp {
    row: usize,
    frame: i64,
    time_s: f64,
}

impl Stamp {
    /// Fails unless it is of the frame that began with `first`.
    fn same_frame(&self, first: &Stamp, nodes: usize, name: &str) -> Result<()> {
        if self.frame == first.frame && self.time_s == first.time_s {
            return Ok(());
        }
        let problem = format!(
            "frame {} at {} s begins before all {nodes} nodes of frame {}",
            self.frame, self.time_s, first.frame
        );
        Err(row_fault(name, self.row, problem))
    }
}

/// A run of rows of a table, and the frames that begin in it.
struct Part<'a> {
    first_row: usize,
    frame: &'a mut [i64],
    time_s: &'a mut [f64],
    xy_px: &'a mut [f64],
    sigma_px: &'a mut [f32],
    area_px: &'a mut [f32],
    status: &'a mut [u8],
}

/// A part for each row group.
fn split<'a>(table: &'a mut Rows, first_rows: &[usize], nodes: usize) -> Vec<Part<'a>> {
    let total = table.status.len();
    let mut rest = Part {
        first_row: 0,
        frame: &mut table.frame,
        time_s: &mut table.time_s,
        xy_px: &mut table.xy_px,
        sigma_px: &mut table.sigma_px,
        area_px: &mut table.area_px,
        status: &mut table.status,
    };
    let ends = first_rows.iter().skip(1).copied().chain([total]);
    first_rows.iter().zip(ends).filter_map(|(&start, end)| rest.split_off_front(end - start, nodes)).collect()
}

/// Place of `time_s` among the columns.
const TIME: usize = 1;

/// A column of a batch as `to`, without nulls where none may be.
fn column(batch: &RecordBatch, at: usize, to: &DataType, first_row: usize, name: &str) -> Result<ArrayRef> {
    let fault = |problem: String| Error::Table(Fault::new(name, problem).at(Place::Key(COLUMNS[at].into())));
    let Some(array) = batch.column_by_name(COLUMNS[at]) else {
        return Err(fault("the column is missing".into()));
    };
    if array.data_type().is_temporal() {
        let fault = Fault::new(name, format!("the column holds {}, not numbers", array.data_type()))
            .at(Place::Key(COLUMNS[at].into()))
            .advice("Write times in s from the recording's start");
        return Err(Error::Table(fault));
    }
    // A duration comes as whole ticks of an unknown unit, because the types that say so are left aside.
    if at == TIME && array.data_type().is_integer() {
        let fault = Fault::new(name, "the column holds whole numbers, not seconds")
            .at(Place::Key(COLUMNS[at].into()))
            .advice("Write times in s as floating-point numbers from the recording's start");
        return Err(Error::Table(fault));
    }
    let array = if array.data_type() == to {
        Arc::clone(array)
    } else {
        cast(array, to).map_err(|e| fault(format!("{} cannot be read as {to} ({e})", array.data_type())))?
    };
    let may_be_null = (4..8).contains(&at);
    if !may_be_null && array.null_count() > 0 {
        let row = first_row + (0..array.len()).find(|&i| array.is_null(i)).unwrap_or(0);
        return Err(row_fault(name, row, format!("column {} is empty", COLUMNS[at])));
    }
    Ok(array)
}

impl<'a> Part<'a> {
    fn split_off_front(&mut self, rows: usize, nodes: usize) -> Option<Part<'a>> {
        let end = self.first_row.checked_add(rows)?;
        let frames = end.div_ceil(nodes) - self.first_row.div_ceil(nodes);
        let front = Part {
            first_row: self.first_row,
            frame: self.frame.split_off_mut(..frames)?,
            time_s: self.time_s.split_off_mut(..frames)?,
            xy_px: self.xy_px.split_off_mut(..2 * rows)?,
            sigma_px: self.sigma_px.split_off_mut(..rows)?,
            area_px: self.area_px.split_off_mut(..rows)?,
            status: self.status.split_off_mut(..rows)?,
        };
        self.first_row = end;
        Some(front)
    }

    /// Frame and time of each frame that begins here; all its rows must have the same. `newest` is the frame that the
    /// rows before these end with, and `begun` a row of a frame that began before the row group.
    fn fill_stamps(
        &mut self,
        batch: &RecordBatch,
        begun: &mut Option<Stamp>,
        newest: &mut Option<Stamp>,
        meta: &TableMeta,
        name: &str,
    ) -> Result<()> {
        let (first_row, nodes) = (self.first_row, meta.rig.nodes.len());
        let frames = column(batch, 0, &DataType::Int64, first_row, name)?;
        let frames = frames.as_primitive::<Int64Type>().values();
        let times = column(batch, 1, &DataType::Float64, first_row, name)?;
        let times = times.as_primitive::<Float64Type>().values();
        let stamp = |i: usize| Stamp { row: first_row + i, frame: frames[i], time_s: times[i] };
        let rest = (first_row.div_ceil(nodes) * nodes - first_row).min(batch.num_rows());
        if rest > 0 {
            let first = *newest.get_or_insert_with(|| *begun.insert(stamp(0)));
            (0..rest).try_for_each(|i| stamp(i).same_frame(&first, nodes, name))?;
        }
        for (t, start) in (rest..batch.num_rows()).step_by(nodes).enumerate() {
            let first = stamp(start);
            (self.frame[t], self.time_s[t]) = (first.frame, first.time_s);
            for i in start..(start + nodes).min(batch.num_rows()) {
                stamp(i).same_frame(&first, nodes, name)?;
            }
            *newest = Some(first);
        }
        Ok(())
    }

    fn fill(&mut self, batch: &RecordBatch, meta: &TableMeta, name: &str) -> Result<()> {
        let first_row = self.first_row;
        let column = |at: usize, to: DataType| column(batch, at, &to, first_row, name);
        for (at, offset) in [(4, 0), (5, 1)] {
            let array = column(at, DataType::Float64)?;
            let values = array.as_primitive::<Float64Type>();
            no_nan(values.values(), &array, at, first_row, name)?;
            for (to, value) in self.xy_px[offset..].iter_mut().step_by(2).zip(values.values()) {
                *to = *value;
            }
            if let Some(nulls) = array.nulls().filter(|n| n.null_count() > 0) {
                for (to, seen) in self.xy_px[offset..].iter_mut().step_by(2).zip(nulls) {
                    if !seen {
                        *to = f64::NAN;
                    }
                }
            }
        }
        for (at, to) in [(6, &mut *self.sigma_px), (7, &mut *self.area_px)] {
            let array = column(at, DataType::Float32)?;
            let values = array.as_primitive::<Float32Type>();
            no_nan(values.values(), &array, at, first_row, name)?;
            to.copy_from_slice(values.values());
            if let Some(nulls) = array.nulls().filter(|n| n.null_count() > 0) {
                for (to, seen) in to.iter_mut().zip(nulls) {
                    if !seen {
                        *to = f32::NAN;
                    }
                }
            }
        }
        let coded = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
        let nodes = &meta.rig.nodes;
        for (at, expected) in [
            (2, nodes.iter().map(|n| n.name.as_str()).collect::<Vec<_>>()),
            (3, nodes.iter().map(|n| n.body.as_str()).collect()),
        ] {
            let array = column(at, coded.clone())?;
            let (keys, words) = dictionary(&array, at, name)?;
            // For each node the key that was last found to stand for it, so that words are hardly ever compared.
            let mut known = vec![-1; nodes.len()];
            let mut n = first_row % nodes.len();
            for (i, &key) in keys.iter().enumerate() {
                if known[n] != key {
                    let (word, want) = (words.value(key as usize), expected[n]);
                    if word != want {
                        let problem = format!(
                            "{} is {word:?}, expected {want:?}: each frame needs one row per node, in the order of the rig",
                            COLUMNS[at]
                        );
                        return Err(row_fault(name, first_row + i, problem));
                    }
                    known[n] = key;
                }
                n += 1;
                if n == nodes.len() {
                    n = 0;
                }
            }
        }
        let array = column(8, coded)?;
        let (keys, words) = dictionary(&array, 8, name)?;
        let numbers: Vec<Option<u8>> = words
            .iter()
            .map(|w| STATUS_WORDS.iter().position(|known| Some(*known) == w).map(|n| n as u8))
            .collect();
        for (i, (to, &key)) in self.status.iter_mut().zip(keys).enumerate() {
            *to = numbers[key as usize].ok_or_else(|| {
                let problem = format!("status {:?} is none of {STATUS_WORDS:?}", words.value(key as usize));
                row_fault(name, first_row + i, problem)
            })?;
        }
        Ok(())
    }
}

/// Refuses NaN: a place that is not seen is null, and a NaN is somebody's mistake.
fn no_nan<T: Copy + Into<f64>>(
    values: &[T],
    array: &ArrayRef,
    at: usize,
    first_row: usize,
    name: &str,
) -> Result<()> {
    // Under a null the value may be anything.
    match values.iter().enumerate().position(|(i, &v)| v.into().is_nan() && array.is_valid(i)) {
        None => Ok(()),
        Some(i) => {
            let problem = format!("column {} is NaN; what is not seen is null", COLUMNS[at]);
            Err(row_fault(name, first_row + i, problem))
        }
    }
}

/// Keys and words of a column of names.
fn dictionary<'a>(array: &'a ArrayRef, at: usize, name: &str) -> Result<(&'a [i32], &'a StringArray)> {
    let dictionary = array.as_dictionary::<Int32Type>();
    match dictionary.values().as_string_opt::<i32>() {
        Some(words) => Ok((dictionary.keys().values(), words)),
        None => {
            Err(Error::Table(Fault::new(name, "the column holds no text").at(Place::Key(COLUMNS[at].into()))))
        }
    }
}
