//! Writes a node table as Parquet: row groups as they fill, names coded by dictionary, key-value metadata.
//!
//! Owns: the Arrow form of rows ([`batch`]), the file's properties. Snappy and version 1 pages, because every
//! reader that people use has them, MATLAB's among them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::parquet::arrow::arrow_writer::ArrowWriterOptions;
use ::parquet::arrow::{ARROW_SCHEMA_META_KEY, ArrowWriter, encode_arrow_schema};
use ::parquet::basic::Compression;
use ::parquet::errors::ParquetError;
use ::parquet::file::metadata::{KeyValue, SortingColumn};
use ::parquet::file::properties::WriterProperties;
use ::parquet::schema::types::ColumnPath;
use arrow::array::{
    ArrayRef, DictionaryArray, Float32Array, Float64Array, Int8Array, Int16Array, Int64Array, StringArray,
};
use arrow::buffer::{NullBuffer, ScalarBuffer};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use arrow::record_batch::RecordBatch;

use super::shared::{GROUP_ROWS, write_fault};
use super::sum::{SUM_KEY, Summed};
use super::{COLUMNS, Rows, STATUS_WORDS, TableMeta};
use crate::error::{Error, Fault, Result};
use crate::output::NewFile;
use crate::rig::Rig;

/// Prefix of each key of the metadata.
pub(super) const KEY_PREFIX: &str = "pydpend.";

/// The Arrow form of the table. Sixteen bits for names: a rig of 100,000 markers does not exist.
pub fn schema() -> SchemaRef {
    let name = |key: DataType| DataType::Dictionary(Box::new(key), Box::new(DataType::Utf8));
    let [frame, time, node, body, x, y, sigma, area, status] = COLUMNS;
    Arc::new(Schema::new(vec![
        Field::new(frame, DataType::Int64, false),
        Field::new(time, DataType::Float64, false),
        Field::new(node, name(DataType::Int16), false),
        Field::new(body, name(DataType::Int16), false),
        Field::new(x, DataType::Float64, true),
        Field::new(y, DataType::Float64, true),
        Field::new(sigma, DataType::Float32, true),
        Field::new(area, DataType::Float32, true),
        Field::new(status, name(DataType::Int8), false),
    ]))
}

/// Rows in Arrow's form, one row per frame and node. Frames `range` of `rows`.
///
/// # Errors
/// [`Error::Table`] if the rows do not fit the rig.
pub fn batch(rows: &Rows, range: std::ops::Range<usize>, rig: &Rig) -> Result<RecordBatch> {
    let fault = |e: arrow::error::ArrowError| Error::Table(Fault::new("node table", e.to_string()));
    let nodes = rig.nodes.len();
    let cells = range.start * nodes..range.end * nodes;
    let repeat = |n: usize| std::iter::repeat_n(n, nodes);
    let frame: Int64Array = range.clone().flat_map(repeat).map(|t| rows.frame[t]).collect();
    let time: Float64Array = range.clone().flat_map(repeat).map(|t| rows.time_s[t]).collect();
    let bodies: Vec<&str> = rig.bodies.iter().map(|b| b.name.as_str()).collect();
    let body_of: Vec<i16> = rig.node_bodies().iter().map(|&b| b as i16).collect();
    let node_keys: Int16Array = range.clone().flat_map(|_| 0..nodes as i16).collect();
    let body_keys: Int16Array = range.clone().flat_map(|_| body_of.iter().copied()).collect();
    let names: StringArray = rig.nodes.iter().map(|n| Some(n.name.as_str())).collect();
    let node = DictionaryArray::try_new(node_keys, Arc::new(names)).map_err(fault)?;
    let body = DictionaryArray::try_new(body_keys, Arc::new(StringArray::from(bodies))).map_err(fault)?;
    let status_keys: Int8Array = rows.status[cells.clone()].iter().map(|&s| s as i8).collect();
    let status = DictionaryArray::try_new(status_keys, Arc::new(StringArray::from(STATUS_WORDS.to_vec())))
        .map_err(fault)?;
    let xy = &rows.xy_px[2 * cells.start..2 * cells.end];
    let wide = |values: Vec<f64>| {
        let seen: NullBuffer = values.iter().map(|v| !v.is_nan()).collect();
        Float64Array::new(ScalarBuffer::from(values), Some(seen))
    };
    let narrow = |values: &[f32]| {
        let seen: NullBuffer = values.iter().map(|v| !v.is_nan()).collect();
        Float32Array::new(ScalarBuffer::from(values.to_vec()), Some(seen))
    };
    let columns: Vec<ArrayRef> = vec![
        Arc::new(frame),
        Arc::new(time),
        Arc::new(node),
        Arc::new(body),
        Arc::new(wide(xy.iter().step_by(2).copied().collect())),
        Arc::new(wide(xy.iter().skip(1).step_by(2).copied().collect())),
        Arc::new(narrow(&rows.sigma_px[cells.clone()])),
        Arc::new(narrow(&rows.area_px[cells])),
        Arc::new(status),
    ];
    RecordBatch::try_new(schema(), columns).map_err(fault)
}

pub(super) struct Writer {
    path: PathBuf,
    rig: Rig,
    writer: ArrowWriter<Summed>,
    new: NewFile,
}

impl std::fmt::Debug for Writer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("parquet::Writer").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Writer {
    pub(super) fn create(path: &Path, rig: &Rig) -> Result<Self> {
        if rig.nodes.len() > i16::MAX as usize {
            return Err(Error::Rig(Fault::new(
                "rig",
                format!("{} nodes are too many for a table", rig.nodes.len()),
            )));
        }
        let sorting =
            [0, 2].map(|column_idx| SortingColumn { column_idx, descending: false, nulls_first: false });
        let mut properties = WriterProperties::builder()
            .set_created_by(TableMeta::this_tool())
            .set_compression(Compression::SNAPPY)
            .set_max_row_group_row_count(Some(GROUP_ROWS))
            .set_sorting_columns(Some(sorting.to_vec()));
        // Places hardly repeat: a dictionary of them would be built and thrown away.
        for column in &COLUMNS[4..7] {
            properties = properties.set_column_dictionary_enabled(ColumnPath::from(*column), false);
        }
        let new = NewFile::create(path).map_err(|e| write_fault(path, &e))?;
        let handle = new.file().try_clone().map_err(|e| write_fault(path, &e))?;
        // The Arrow schema is written at the end, when its metadata are known.
        let options =
            ArrowWriterOptions::new().with_properties(properties.build()).with_skip_arrow_metadata(true);
        let writer = ArrowWriter::try_new_with_options(Summed::new(handle), schema(), options)
            .map_err(|e| fault(path, e))?;
        Ok(Self { path: path.to_owned(), rig: rig.clone(), writer, new })
    }

    /// Writes `rows` as one row group.
    pub(super) fn write(&mut self, rows: &Rows) -> Result<()> {
        let batch = batch(rows, 0..rows.frames(), &self.rig)?;
        self.writer.write(&batch).and_then(|()| self.writer.flush()).map_err(|e| fault(&self.path, e))
    }

    pub(super) fn finish(mut self, meta: &TableMeta) -> Result<()> {
        // Every row group is written: what follows is the file's footer.
        self.writer.sync().map_err(|e| write_fault(&self.path, &e))?;
        let sum = self.writer.inner().sum().to_text();
        let entries = meta.entries()?.into_iter().map(|(key, text)| (format!("{KEY_PREFIX}{key}"), text));
        // In Arrow's schema too: pyarrow takes them from there, and so keeps them when it writes the table again.
        let arrow = schema().as_ref().clone().with_metadata(entries.clone().collect());
        let entries = entries.chain([
            (ARROW_SCHEMA_META_KEY.to_owned(), encode_arrow_schema(&arrow)),
            (SUM_KEY.to_owned(), sum),
        ]);
        for (key, text) in entries {
            self.writer.append_key_value_metadata(KeyValue::new(key, text));
        }
        self.writer.finish().map_err(|e| fault(&self.path, e))?;
        self.new.publish(true).map_err(|e| write_fault(&self.path, &e))
    }
}

fn fault(path: &Path, e: ParquetError) -> Error {
    if let ParquetError::External(inner) = &e
        && let Some(io) = inner.downcast_ref::<std::io::Error>()
    {
        return write_fault(path, io);
    }
    Error::Table(Fault::new(path.display(), format!("it cannot be written ({e})")))
}
