//! Writes a node table as CSV, its metadata as `.json` beside it.
//!
//! Owns: the text of rows. Numbers are the shortest that read back to the same bits; what is not seen is empty.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::shared::{json_beside, write_fault};
use super::{COLUMNS, Rows, STATUS_WORDS, TableMeta};
use crate::csv_text::Cells;
use crate::error::{Error, Fault, Result};
use crate::output::NewFile;
use crate::rig::Rig;

#[derive(Debug)]
pub(super) struct Writer {
    path: PathBuf,
    new: NewFile,
    /// `,node,body,` of each node.
    names: Vec<String>,
    text: String,
}

impl Writer {
    pub(super) fn create(path: &Path, rig: &Rig, cells: Cells) -> Result<Self> {
        let field = |name: &str| {
            cells.field(name).map_err(|problem| {
                Error::Rig(Fault::new("rig", problem).advice("Rename it, or write Parquet"))
            })
        };
        let mut names = Vec::with_capacity(rig.nodes.len());
        for node in &rig.nodes {
            names.push(format!(",{},{},", field(&node.name)?, field(&node.body)?));
        }
        let new = NewFile::create(path).map_err(|e| write_fault(path, &e))?;
        let text = format!("{}\n", COLUMNS.join(","));
        Ok(Self { path: path.to_owned(), new, names, text })
    }

    pub(super) fn write(&mut self, rows: &Rows) -> Result<()> {
        let nodes = self.names.len();
        for t in 0..rows.frames() {
            // Debug is the shortest form that reads back to the same bits, with an exponent where that is shorter.
            let start = format!("{},{:?}", rows.frame[t], rows.time_s[t]);
            for (n, names) in self.names.iter().enumerate() {
                let k = t * nodes + n;
                self.text.push_str(&start);
                self.text.push_str(names);
                for value in &rows.xy_px[2 * k..2 * k + 2] {
                    if !value.is_nan() {
                        self.text.push_str(&format!("{value:?}"));
                    }
                    self.text.push(',');
                }
                for value in [rows.sigma_px[k], rows.area_px[k]] {
                    if !value.is_nan() {
                        self.text.push_str(&format!("{value:?}"));
                    }
                    self.text.push(',');
                }
                self.text
                    .push_str(STATUS_WORDS.get(usize::from(rows.status[k])).copied().unwrap_or_default());
                self.text.push('\n');
            }
        }
        self.new.file().write_all(self.text.as_bytes()).map_err(|e| write_fault(&self.path, &e))?;
        self.text.clear();
        Ok(())
    }

    pub(super) fn finish(self, meta: &TableMeta) -> Result<()> {
        self.new.file().write_all(self.text.as_bytes()).map_err(|e| write_fault(&self.path, &e))?;
        // The metadata first: where the CSV is, they are too.
        let json = json_beside(&self.path);
        let mut text = meta.to_json()?;
        text.push('\n');
        NewFile::create(&json)
            .and_then(|new| new.file().write_all(text.as_bytes()).and_then(|()| new.publish(true)))
            .map_err(|e| write_fault(&json, &e))?;
        self.new.publish(true).map_err(|e| write_fault(&self.path, &e))
    }
}
