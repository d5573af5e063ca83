//! Writes and reads a table's file: its form by the ending, a temporary name until it is whole.
//!
//! Owns: [`Form`], [`TableWriter`], [`read_table`]. Must not: know how a form looks inside.

use std::path::{Path, PathBuf};

use super::check::{Before, first_fault};
use super::shared::{GROUP_ROWS, json_beside};
use super::{NodeTable, Rows, TableMeta, csv, csv_read, parquet, parquet_read, row_fault};
use crate::csv_text::Cells;
use crate::error::{Error, Fault, FaultKind, Result};
use crate::kind::{self, Kind};
use crate::name::text;
use crate::observation::Observation;
use crate::rig::Rig;

/// The form of a table's file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// One Parquet file.
    Parquet,
    /// A CSV file with a `.json` beside it.
    Csv,
}

impl Form {
    /// The form that the ending of `path` says.
    ///
    /// # Errors
    /// [`Error::Table`] for any other ending.
    pub fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match ending.as_deref() {
            Some("parquet" | "pq") => Ok(Form::Parquet),
            Some("csv") => Ok(Form::Csv),
            _ => Err(Error::Table(
                Fault::new(text(path), "unknown extension, expected .parquet or .csv")
                    .of_kind(FaultKind::Unsupported)
                    .advice("Name it .parquet or .csv"),
            )),
        }
    }
}

/// The files that a table at `path` is made of.
///
/// # Errors
/// As [`Form::of`].
pub fn table_files(path: &Path) -> Result<Vec<PathBuf>> {
    Ok(match Form::of(path)? {
        Form::Parquet => vec![path.to_owned()],
        Form::Csv => vec![path.to_owned(), json_beside(path)],
    })
}

#[derive(Debug)]
enum Writer {
    Parquet(Box<parquet::Writer>),
    Csv(csv::Writer),
}

/// Writes a table as its rows come. Until [`TableWriter::finish`] the target is not touched. Rows that
/// [`NodeTable::check`] would refuse are not written.
#[derive(Debug)]
pub struct TableWriter {
    name: String,
    rig: Rig,
    /// Rows written already, and the last of their frames.
    written: usize,
    before: Before,
    rows: Rows,
    group_frames: usize,
    writer: Writer,
}

impl TableWriter {
    /// Begins a table of `rig`'s nodes at `path`; `cells` is how a CSV writes their names.
    ///
    /// # Errors
    /// [`Error::Table`] if the ending is unknown or the folder cannot be written.
    pub fn create(path: &Path, rig: &Rig, cells: Cells) -> Result<Self> {
        let writer = match Form::of(path)? {
            Form::Parquet => Writer::Parquet(Box::new(parquet::Writer::create(path, rig)?)),
            Form::Csv => Writer::Csv(csv::Writer::create(path, rig, cells)?),
        };
        Ok(Self {
            name: text(path),
            rig: rig.clone(),
            written: 0,
            before: None,
            rows: Rows::default(),
            group_frames: (GROUP_ROWS / rig.nodes.len().max(1)).max(1),
            writer,
        })
    }

    /// Adds one frame; `observations` is in the order of the rig's nodes.
    ///
    /// # Errors
    /// [`Error::Table`] if a row is not valid, or the disk is full or cannot be written.
    pub fn push(&mut self, frame: u64, time_s: f64, observations: &[Observation]) -> Result<()> {
        self.rows.push(frame, time_s, observations);
        if self.rows.frames() == self.group_frames { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        if let (Some(&frame), Some(&time_s)) = (self.rows.frame.last(), self.rows.time_s.last()) {
            if let Some((row, problem)) = first_fault(&self.rows, &self.rig, self.before) {
                return Err(row_fault(&self.name, self.written + row, problem));
            }
            self.written += self.rows.status.len();
            self.before = Some((frame, time_s));
            match &mut self.writer {
                Writer::Parquet(w) => w.write(&self.rows)?,
                Writer::Csv(w) => w.write(&self.rows)?,
            }
            self.rows.clear();
        }
        Ok(())
    }

    /// Writes the rest and the metadata, and gives the file its name.
    ///
    /// # Errors
    /// [`Error::Table`] if a row is not valid, or the disk is full or cannot be written.
    pub fn finish(mut self, meta: &TableMeta) -> Result<()> {
        self.flush()?;
        match self.writer {
            Writer::Parquet(w) => w.finish(meta),
            Writer::Csv(w) => w.finish(meta),
        }
    }
}

impl NodeTable {
    /// Writes it to `path`, as Parquet or CSV by the ending, first under a temporary name; `cells` is how a CSV writes
    /// names.
    ///
    /// # Errors
    /// [`Error::Table`] if it is not valid or cannot be written.
    pub fn write(&self, path: &Path, cells: Cells) -> Result<()> {
        self.check(&text(path))?;
        let nodes = self.nodes();
        let mut writer = TableWriter::create(path, &self.meta.rig, cells)?;
        let mut seen = Vec::with_capacity(nodes);
        for t in 0..self.frames() {
            seen.clear();
            seen.extend((0..nodes).filter_map(|n| self.rows.observation(t, n, nodes)));
            writer.push(self.rows.frame[t] as u64, self.rows.time_s[t], &seen)?;
        }
        writer.finish(&self.meta)
    }
}

/// Reads and checks a table, Parquet or CSV by the ending.
///
/// # Errors
/// [`Error::Table`] naming the row, line or column at fault, [`Error::Rig`] if the rig in it is wrong.
pub fn read_table(path: &Path) -> Result<NodeTable> {
    kind::expect(path, &[Kind::NodeTable], Error::Table)?;
    let name = text(path);
    let table = match Form::of(path)? {
        Form::Parquet => parquet_read::read(path)?,
        Form::Csv => csv_read::read(path)?,
    };
    table.check(&name)?;
    Ok(table)
}

/// Reads only where a table comes from.
///
/// # Errors
/// As [`read_table`].
pub fn read_meta(path: &Path) -> Result<TableMeta> {
    match Form::of(path)? {
        Form::Parquet => parquet_read::read_meta(path),
        Form::Csv => csv_read::read_meta(path),
    }
}
