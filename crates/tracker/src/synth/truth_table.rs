//! Writes and reads the truth of a film as a table, Parquet or CSV by the ending.
//!
//! One row per frame and marker, ordered by frame, then marker:
//!
//! | column | meaning |
//! |---|---|
//! | `frame`, `time_s` | index and time, the middle of the exposure |
//! | `node`, `body` | names |
//! | `x_px`, `y_px` | centre; given also where it cannot be seen |
//! | `visible` | part of the marker's area that is seen, 0 to 1 |
//! | `phi1_rad`, `phi2_rad`, ... | angles of the links in the scene's order, the same in all rows of a frame |
//!
//! Parquet files carry the scene as TOML under the key `scene`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, AsArray, DictionaryArray, Float64Array, Int64Array, RecordBatch, StringArray};
use arrow::datatypes::{DataType, Field, Float64Type, Int32Type, Int64Type, Schema};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;

use super::film::Film;
use super::truth::FrameTruth;
use crate::csv_text::{Cells, read_cell, split};
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::kind::{self, Kind};
use crate::message::FILM_TRUTH;
use crate::name::text;
use crate::output::NewFile;

/// Frames per record batch.
const BATCH_FRAMES: usize = 2000;

/// A truth table being written.
pub struct TruthWriter {
    name: String,
    nodes: Vec<(String, String)>,
    links: usize,
    to: To,
    new: NewFile,
}

enum To {
    Csv(BufWriter<File>),
    Parquet { writer: Box<ArrowWriter<File>>, schema: Arc<Schema>, held: Vec<FrameTruth> },
}

fn failed(name: &str, e: impl std::fmt::Display) -> Error {
    Error::Film(Fault::new(name, format!("the truth cannot be written ({e})")))
}

impl TruthWriter {
    /// Begins the table of a film; `cells` is how a CSV writes names.
    ///
    /// # Errors
    /// [`Error::Film`] for an ending that is neither `.csv` nor `.parquet`, or a file that cannot be made.
    pub fn create(path: &Path, film: &Film, cells: Cells) -> Result<Self> {
        let name = text(path);
        let scene = film.scene();
        let links = scene.links.len();
        let angle = |k: usize| format!("phi{}_rad", k + 1);
        let ending = path.extension().and_then(|e| e.to_str());
        if !matches!(ending, Some("csv" | "parquet")) {
            return Err(Error::Film(
                Fault::new(&name, "the truth is written to .parquet or .csv")
                    .of_kind(FaultKind::Unsupported)
                    .advice("Give the file one of these endings"),
            ));
        }
        let new = NewFile::create(path).map_err(|e| failed(&name, e))?;
        let file = new.file().try_clone().map_err(|e| failed(&name, e))?;
        let mut nodes: Vec<_> = scene.markers.iter().map(|m| (m.name.clone(), m.link.clone())).collect();
        let to = match ending {
            Some("csv") => {
                for name in nodes.iter_mut().flat_map(|n| [&mut n.0, &mut n.1]) {
                    *name = cells.field(name).map_err(|problem| {
                        Error::Film(Fault::new("scene", problem).advice("Rename it, or write Parquet"))
                    })?;
                }
                let mut out = BufWriter::new(file);
                let angles: String = (0..links).map(|k| format!(",{}", angle(k))).collect();
                writeln!(out, "frame,time_s,node,body,x_px,y_px,visible{angles}")
                    .map_err(|e| failed(&name, e))?;
                To::Csv(out)
            }
            _ => {
                let word = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
                let mut fields = vec![
                    Field::new("frame", DataType::Int64, false),
                    Field::new("time_s", DataType::Float64, false),
                    Field::new("node", word.clone(), false),
                    Field::new("body", word, false),
                    Field::new("x_px", DataType::Float64, false),
                    Field::new("y_px", DataType::Float64, false),
                    Field::new("visible", DataType::Float64, false),
                ];
                fields.extend((0..links).map(|k| Field::new(angle(k), DataType::Float64, false)));
                let schema = Arc::new(Schema::new(fields));
                let properties = WriterProperties::builder()
                    .set_compression(Compression::ZSTD(ZstdLevel::default()))
                    .set_key_value_metadata(Some(vec![KeyValue::new("scene".into(), scene.to_toml()?)]))
                    .build();
                let writer = ArrowWriter::try_new(file, schema.clone(), Some(properties))
                    .map_err(|e| failed(&name, e))?;
                To::Parquet { writer: Box::new(writer), schema, held: Vec::new() }
            }
        };
        Ok(Self { name, nodes, links, to, new })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// [`Error::Film`] if writing fails.
    pub fn write(&mut self, truth: &FrameTruth) -> Result<()> {
        match &mut self.to {
            To::Csv(out) => {
                let angles: String = truth.phi_rad.iter().map(|p| format!(",{p}")).collect();
                for ((node, body), t) in self.nodes.iter().zip(&truth.nodes) {
                    writeln!(
                        out,
                        "{},{},{node},{body},{},{},{}{angles}",
                        truth.frame, truth.time_s, t.x_px, t.y_px, t.visible
                    )
                    .map_err(|e| failed(&self.name, e))?;
                }
                Ok(())
            }
            To::Parquet { held, .. } => {
                held.push(truth.clone());
                if held.len() < BATCH_FRAMES { Ok(()) } else { self.flush() }
            }
        }
    }

    fn flush(&mut self) -> Result<()> {
        let To::Parquet { writer, schema, held } = &mut self.to else { return Ok(()) };
        if held.is_empty() {
            return Ok(());
        }
        let n = self.nodes.len();
        let names = |pick: fn(&(String, String)) -> &str| -> ArrayRef {
            let mut words: Vec<&str> = Vec::new();
            let keys: Vec<i32> = self
                .nodes
                .iter()
                .map(|node| {
                    let word = pick(node);
                    let k = words.iter().position(|w| *w == word).unwrap_or(words.len());
                    if k == words.len() {
                        words.push(word);
                    }
                    k as i32
                })
                .collect();
            let keys =
                arrow::array::Int32Array::from_iter_values(keys.iter().copied().cycle().take(n * held.len()));
            Arc::new(DictionaryArray::<Int32Type>::new(keys, Arc::new(StringArray::from(words))))
        };
        let per_node = |value: fn(&super::truth::NodeTruth) -> f64| -> ArrayRef {
            Arc::new(Float64Array::from_iter_values(held.iter().flat_map(|f| f.nodes.iter().map(value))))
        };
        let per_frame = |value: &dyn Fn(&FrameTruth) -> f64| -> ArrayRef {
            Arc::new(Float64Array::from_iter_values(
                held.iter().flat_map(|f| std::iter::repeat_n(value(f), n)),
            ))
        };
        let mut columns: Vec<ArrayRef> = vec![
            Arc::new(Int64Array::from_iter_values(
                held.iter().flat_map(|f| std::iter::repeat_n(f.frame as i64, n)),
            )),
            per_frame(&|f| f.time_s),
            names(|n| &n.0),
            names(|n| &n.1),
            per_node(|t| t.x_px),
            per_node(|t| t.y_px),
            per_node(|t| t.visible),
        ];
        columns.extend((0..self.links).map(|k| per_frame(&move |f: &FrameTruth| f.phi_rad[k])));
        let batch = RecordBatch::try_new(schema.clone(), columns).map_err(|e| failed(&self.name, e))?;
        writer.write(&batch).map_err(|e| failed(&self.name, e))?;
        held.clear();
        Ok(())
    }

    /// Ends the table.
    ///
    /// # Errors
    /// [`Error::Film`] if writing fails.
    pub fn finish(mut self) -> Result<()> {
        self.flush()?;
        match self.to {
            To::Csv(mut out) => out.flush().map_err(|e| failed(&self.name, e))?,
            To::Parquet { writer, .. } => writer.close().map(|_| ()).map_err(|e| failed(&self.name, e))?,
        }
        self.new.publish(true).map_err(|e| failed(&self.name, e))
    }
}

/// A truth table in memory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truth {
    /// Markers: name and body, in the table's order.
    pub nodes: Vec<(String, String)>,
    /// Frames in order; `mean_x_px` and `mean_y_px` repeat `x_px` and `y_px`, the table does not have them.
    pub frames: Vec<FrameTruth>,
}

impl Truth {
    /// The truth of a whole film, without a file.
    pub fn of(film: &Film) -> Self {
        use rayon::prelude::*;
        Self {
            nodes: film.scene().markers.iter().map(|m| (m.name.clone(), m.link.clone())).collect(),
            frames: threads::install(|| (0..film.frames()).into_par_iter().map(|i| film.truth(i)).collect()),
        }
    }

    /// Reads a truth table.
    ///
    /// # Errors
    /// [`Error::Film`] naming the file and the column or row at fault.
    pub fn read(path: &Path) -> Result<Self> {
        kind::expect(path, &[Kind::Truth], Error::Film)?;
        let name = path.display().to_string();
        let mut rows = match path.extension().and_then(|e| e.to_str()) {
            Some("csv") => read_csv(path, &name)?,
            Some("parquet") => read_parquet(path, &name)?,
            _ => {
                return Err(Error::Film(
                    Fault::new(&name, "the truth is read from .parquet or .csv")
                        .of_kind(FaultKind::Unsupported)
                        .advice("Give the table that " + FILM_TRUTH + " wrote"),
                ));
            }
        };
        rows.build(&name)
    }
}

/// Columns of a truth table.
#[derive(Default)]
struct Columns {
    frame: Vec<i64>,
    node: Vec<String>,
    body: Vec<String>,
    /// `time_s`, `x_px`, `y_px`, `visible`, then angles.
    numbers: Vec<Vec<f64>>,
}

const NUMBERS: [&str; 4] = ["time_s", "x_px", "y_px", "visible"];

impl Columns {
    fn build(&mut self, name: &str) -> Result<Truth> {
        let bad = |row: usize, problem: &str| {
            Error::Film(
                Fault::new(name, problem.to_string())
                    .at(Place::Row(row as u64))
                    .advice("The rows go by frame, then by node, all nodes in each frame"),
            )
        };
        let rows = self.frame.len();
        if rows == 0 {
            return Err(bad(0, "there are no rows"));
        }
        let n = self.frame.iter().take_while(|f| **f == self.frame[0]).count();
        let nodes: Vec<_> = (0..n).map(|i| (self.node[i].clone(), self.body[i].clone())).collect();
        if !rows.is_multiple_of(n) {
            return Err(bad(rows - 1, "the last frame is not complete"));
        }
        let mut frames = Vec::with_capacity(rows / n);
        for first in (0..rows).step_by(n) {
            let frame = self.frame[first];
            for (i, (node, _)) in nodes.iter().enumerate() {
                if self.frame[first + i] != frame || self.node[first + i] != *node {
                    return Err(bad(first + i, "a node is missing or out of order"));
                }
            }
            let index = u64::try_from(frame).map_err(|_| bad(first, "a frame before the first"))?;
            frames.push(FrameTruth {
                frame: index,
                time_s: self.numbers[0][first],
                nodes: (first..first + n)
                    .map(|r| super::truth::NodeTruth {
                        x_px: self.numbers[1][r],
                        y_px: self.numbers[2][r],
                        mean_x_px: self.numbers[1][r],
                        mean_y_px: self.numbers[2][r],
                        visible: self.numbers[3][r],
                    })
                    .collect(),
                phi_rad: self.numbers[4..].iter().map(|c| c[first]).collect(),
            });
        }
        Ok(Truth { nodes, frames })
    }
}

fn missing(name: &str, column: &str) -> Error {
    Error::Film(
        Fault::new(name, format!("there is no column {column}"))
            .at(Place::Key(column.into()))
            .advice("Give the table that " + FILM_TRUTH + " wrote"),
    )
}

/// Names of the wanted number columns: the fixed ones, then the angles that are there.
fn number_columns(header: &[String]) -> Vec<String> {
    let mut wanted: Vec<String> = NUMBERS.map(String::from).to_vec();
    wanted.extend((1..).map(|k| format!("phi{k}_rad")).take_while(|c| header.contains(c)));
    wanted
}

fn read_csv(path: &Path, name: &str) -> Result<Columns> {
    let text = std::fs::read_to_string(path)
        .map_err(|e| Error::Film(Fault::new(name, format!("the truth cannot be read ({e})"))))?;
    let mut lines = text.lines();
    let header: Vec<String> =
        lines.next().unwrap_or_default().split(',').map(|h| h.trim().to_string()).collect();
    let find = |c: &str| header.iter().position(|h| h == c).ok_or_else(|| missing(name, c));
    let (frame, node, body) = (find("frame")?, find("node")?, find("body")?);
    let wanted = number_columns(&header).iter().map(|c| find(c)).collect::<Result<Vec<_>>>()?;
    let mut columns = Columns { numbers: vec![Vec::new(); wanted.len()], ..Columns::default() };
    let (mut unquoted, mut ends) = (String::new(), Vec::new());
    for (i, line) in lines.enumerate().filter(|(_, l)| !l.trim().is_empty()) {
        let bad = |what: &str| Error::Film(Fault::new(name, what.to_string()).at(Place::Line(i as u64 + 2)));
        split(line, &mut unquoted, &mut ends).map_err(|problem| bad(&problem))?;
        if ends.len() != header.len() {
            return Err(bad(&format!("{} fields under {} headings", ends.len(), header.len())));
        }
        let field = |k: usize| match ends.get(k) {
            Some(&end) => Ok(&unquoted[if k == 0 { 0 } else { ends[k - 1] }..end]),
            None => Err(bad("fields are missing")),
        };
        columns.frame.push(field(frame)?.trim().parse().map_err(|_| bad("frame is not a whole number"))?);
        columns.node.push(read_cell(field(node)?).to_string());
        columns.body.push(read_cell(field(body)?).to_string());
        for (column, &k) in columns.numbers.iter_mut().zip(&wanted) {
            let number =
                field(k)?.trim().parse().map_err(|_| bad(&format!("{} is not a number", header[k])))?;
            column.push(number);
        }
    }
    Ok(columns)
}

fn read_parquet(path: &Path, name: &str) -> Result<Columns> {
    let unreadable =
        |e: &dyn std::fmt::Display| Error::Film(Fault::new(name, format!("the truth cannot be read ({e})")));
    let file = File::open(path).map_err(|e| unreadable(&e))?;
    let reader = ParquetRecordBatchReaderBuilder::try_new_with_options(
        file,
        ArrowReaderOptions::new().with_skip_arrow_metadata(true),
    )
    .and_then(ParquetRecordBatchReaderBuilder::build)
    .map_err(|e| unreadable(&e))?;
    let mut columns = Columns::default();
    for batch in reader {
        let batch = batch.map_err(|e| unreadable(&e))?;
        let header: Vec<String> = batch.schema().fields().iter().map(|f| f.name().clone()).collect();
        let cast = |c: &str, to: &DataType| {
            let array = batch.column_by_name(c).ok_or_else(|| missing(name, c))?;
            arrow::compute::cast(array, to).map_err(|e| unreadable(&e))
        };
        columns.frame.extend(cast("frame", &DataType::Int64)?.as_primitive::<Int64Type>().values());
        let words = |c: &str| -> Result<Vec<String>> {
            let array = cast(c, &DataType::Utf8)?;
            Ok(array.as_string::<i32>().iter().map(|w| w.unwrap_or_default().to_string()).collect())
        };
        columns.node.extend(words("node")?);
        columns.body.extend(words("body")?);
        let wanted = number_columns(&header);
        columns.numbers.resize(wanted.len(), Vec::new());
        for (column, c) in columns.numbers.iter_mut().zip(&wanted) {
            let array = cast(c, &DataType::Float64)?;
            column.extend(array.as_primitive::<Float64Type>().iter().map(|v| v.unwrap_or(f64::NAN)));
        }
    }
    if columns.numbers.is_empty() {
        columns.numbers = vec![Vec::new(); NUMBERS.len()];
    }
    Ok(columns)
}
