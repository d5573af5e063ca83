//! A table's file: its form by the ending, a temporary name until it is whole.
//!
//! Owns: [`Form`], [`TableWriter`], [`read_table`]. Must not: know how a form looks inside.

use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::{NodeTable, Rows, TableMeta, csv, csv_read, parquet, parquet_read};
use crate::error::{Error, Fault, Result};
use crate::kind::{self, Kind};
use crate::message::{Setting, TRACK};
use crate::observation::Observation;
use crate::rig::Rig;

/// Rows of a Parquet row group, and of what is held in memory before it is written, about 5 MB.
pub(super) const GROUP_ROWS: usize = 1 << 17;

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
                Fault::new(path.display(), "the ending says neither Parquet nor CSV")
                    .advice("Name it .parquet or .csv"),
            )),
        }
    }
}

/// The file with a CSV's metadata: `drop.csv` has `drop.csv.json`.
pub(super) fn json_beside(path: &Path) -> PathBuf {
    with_suffix(path, ".json")
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}

/// A file under a temporary name beside its target, which it replaces when whole and otherwise is removed.
#[derive(Debug)]
pub(super) struct Pending {
    target: PathBuf,
    temporary: PathBuf,
    done: bool,
}

impl Pending {
    pub(super) fn create(target: &Path) -> Result<(Self, File)> {
        let temporary = with_suffix(target, ".writing");
        let file = File::create(&temporary).map_err(|e| write_fault(target, &e))?;
        Ok((Self { target: target.to_owned(), temporary, done: false }, file))
    }

    /// Makes sure that all is on disk and gives it its name.
    pub(super) fn publish(mut self, file: &File) -> Result<()> {
        let published = file.sync_all().and_then(|()| std::fs::rename(&self.temporary, &self.target));
        published.map_err(|e| write_fault(&self.target, &e))?;
        self.done = true;
        // The new name itself is on disk once the folder is; a file system that cannot do that has no more.
        let folder = self.target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if let Ok(folder) = File::open(folder) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        if !self.done {
            let _ = std::fs::remove_file(&self.temporary);
        }
    }
}

#[derive(Debug)]
enum Writer {
    Parquet(Box<parquet::Writer>),
    Csv(csv::Writer),
}

/// Writes a table as its rows come. Until [`TableWriter::finish`] the target is not touched.
#[derive(Debug)]
pub struct TableWriter {
    rows: Rows,
    group_frames: usize,
    writer: Writer,
}

impl TableWriter {
    /// Begins a table of `rig`'s nodes at `path`.
    ///
    /// # Errors
    /// [`Error::Table`] if the ending is unknown or the folder cannot be written.
    pub fn create(path: &Path, rig: &Rig) -> Result<Self> {
        let writer = match Form::of(path)? {
            Form::Parquet => Writer::Parquet(Box::new(parquet::Writer::create(path, rig)?)),
            Form::Csv => Writer::Csv(csv::Writer::create(path, rig)?),
        };
        Ok(Self { rows: Rows::default(), group_frames: (GROUP_ROWS / rig.nodes.len().max(1)).max(1), writer })
    }

    /// Adds one frame; `observations` is in the order of the rig's nodes.
    ///
    /// # Errors
    /// [`Error::Table`] if the disk is full or cannot be written.
    pub fn push(&mut self, frame: u64, time_s: f64, observations: &[Observation]) -> Result<()> {
        self.rows.push(frame, time_s, observations);
        if self.rows.frames() == self.group_frames { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        if self.rows.frames() > 0 {
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
    /// [`Error::Table`] if the disk is full or cannot be written.
    pub fn finish(mut self, meta: &TableMeta) -> Result<()> {
        self.flush()?;
        match self.writer {
            Writer::Parquet(w) => w.finish(meta),
            Writer::Csv(w) => w.finish(meta),
        }
    }
}

/// Reads and checks a table, Parquet or CSV by the ending.
///
/// # Errors
/// [`Error::Table`] naming the row, line or column at fault, [`Error::Rig`] if the rig in it is wrong.
pub fn read_table(path: &Path) -> Result<NodeTable> {
    kind::expect(path, &[Kind::NodeTable], Error::Table)?;
    let name = path.display().to_string();
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

pub(super) fn read_fault(path: &Path, e: &std::io::Error) -> Error {
    Error::Table(
        Fault::new(path.display(), format!("it cannot be read ({e})"))
            .advice("Give a table written by " + TRACK),
    )
}

pub(super) fn write_fault(path: &Path, e: &std::io::Error) -> Error {
    let advice = match e.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "Free some space and run again with " + Setting::Resume
        }
        _ => "Choose a folder that can be written".into(),
    };
    Error::Table(Fault::new(path.display(), format!("it cannot be written ({e})")).advice(advice))
}
