//! Reads a node table from CSV and the `.json` beside it.
//!
//! Owns: the grammar of a line, what each column must hold. Columns may come in any order and others beside them.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind};
use std::path::{Path, PathBuf};

use super::shared::{json_beside, read_fault};
use super::{COLUMNS, NodeTable, Rows, STATUS_WORDS, TableMeta};
use crate::csv_text::{read_cell, split};
use crate::error::{Error, Fault, Place, Result};
use crate::message::{Message, TRACK};

pub(super) fn read_meta(path: &Path) -> Result<TableMeta> {
    let json = json_beside(path);
    let text = std::fs::read_to_string(&json).map_err(|e| {
        let problem = if e.kind() == ErrorKind::NotFound {
            format!("its metadata file {} is not there", json.display())
        } else {
            format!("its metadata file {} cannot be read ({e})", json.display())
        };
        // If the table itself is not there, that is what to say.
        match File::open(path) {
            Err(e) => read_fault(path, &e),
            Ok(_) => Error::Table(
                Fault::new(path.display(), problem)
                    .advice("Keep the .json that was written with the CSV beside it"),
            ),
        }
    })?;
    TableMeta::from_json(&text, &json.display().to_string())
}

pub(super) fn read(path: &Path) -> Result<NodeTable> {
    let meta = read_meta(path)?;
    let file = File::open(path).map_err(|e| read_fault(path, &e))?;
    let mut lines = Lines {
        path: path.to_owned(),
        reader: BufReader::with_capacity(1 << 18, file),
        number: 0,
        line: String::new(),
        is_ended: true,
    };
    if !lines.next()? {
        return Err(lines.fault("the file is empty", "Run " + TRACK + " again"));
    }
    let (width, columns) = columns_of(&lines)?;
    let mut rows = Rows::default();
    let nodes = meta.rig.nodes.len();
    let mut n = 0;
    let mut unquoted = String::new();
    let mut ends = Vec::new();
    let mut shortest = usize::MAX;
    while lines.next()? {
        split(&lines.line, &mut unquoted, &mut ends)
            .map_err(|problem| lines.fault(problem, "Write the table again"))?;
        // Spreadsheets leave separators at the end of a line.
        if ends.len() > width && !unquoted[ends[width - 1]..].trim().is_empty() {
            return Err(lines.fault(
                format!("the row has {} fields, the header has {width}", ends.len()),
                "If commas are its decimal marks too, write the table with decimal points",
            ));
        }
        let cell = |column: usize| -> Result<&str> {
            let at = columns[column];
            match ends.get(at) {
                Some(&end) => Ok(&unquoted[if at == 0 { 0 } else { ends[at - 1] }..end]),
                None => Err(lines.fault(
                    format!("the row has {} fields, column {} is missing", ends.len(), COLUMNS[column]),
                    "The table may be cut off here: copy it again, or run " + TRACK + " again",
                )),
            }
        };
        let frame: i64 = lines.number_in(cell(0)?, COLUMNS[0])?;
        let time_s: f64 = lines.number_in(cell(1)?, COLUMNS[1])?;
        if n == 0 {
            rows.frame.push(frame);
            rows.time_s.push(time_s);
        } else if rows.frame.last() != Some(&frame) || rows.time_s.last() != Some(&time_s) {
            return Err(lines.fault(
                format!("frame {frame} at {time_s} s begins before all {nodes} nodes of the frame before it"),
                "Each frame needs one row per node, in the order of the rig",
            ));
        }
        let node = &meta.rig.nodes[n];
        let (name, body) = (read_cell(cell(2)?), read_cell(cell(3)?));
        if name != node.name || body != node.body {
            return Err(lines.fault(
                format!("node {name:?} of body {body:?}, expected {:?} of {:?}", node.name, node.body),
                "Each frame needs one row per node, in the order of the rig",
            ));
        }
        let word = cell(8)?;
        let Some(status) = STATUS_WORDS.iter().position(|w| *w == word) else {
            return Err(lines.fault(format!("status {word:?} is none of {STATUS_WORDS:?}"), ""));
        };
        rows.status.push(status as u8);
        rows.xy_px.push(lines.optional(cell(4)?, COLUMNS[4])?);
        rows.xy_px.push(lines.optional(cell(5)?, COLUMNS[5])?);
        rows.sigma_px.push(lines.optional(cell(6)?, COLUMNS[6])? as f32);
        rows.area_px.push(lines.optional(cell(7)?, COLUMNS[7])? as f32);
        let last = cell(columns.iter().position(|at| *at == width - 1).unwrap_or(8))?.trim();
        shortest = lines.longer_than(last, shortest)?;
        n = (n + 1) % nodes;
    }
    if n != 0 {
        return Err(lines.fault(
            format!("the last frame has rows for {n} of {nodes} nodes"),
            "The table is cut off: copy it again, or run " + TRACK + " again",
        ));
    }
    Ok(NodeTable { meta, rows })
}

/// Whether a cell may be the beginning of a number, where those before it are no shorter than this.
fn is_cut(cell: &str, shortest: usize) -> bool {
    let is_open = cell.ends_with(['.', 'e', 'E', '-', '+']);
    let is_short = cell.parse::<f64>().is_ok() && cell.len() < shortest;
    shortest < usize::MAX && (is_open || is_short)
}

/// For each of [`COLUMNS`] its place in the file.
/// Also how many columns there are.
fn columns_of(lines: &Lines) -> Result<(usize, [usize; COLUMNS.len()])> {
    let line = lines.line.trim_start_matches('\u{feff}');
    if line.contains('\r') {
        return Err(lines.fault("its lines end in carriage returns alone", "Save it with line feeds"));
    }
    let mut header: Vec<&str> = line.split(',').map(|c| c.trim().trim_matches('"')).collect();
    while header.last().is_some_and(|name| name.is_empty()) {
        header.pop();
    }
    let mut columns = [0; COLUMNS.len()];
    for (place, name) in columns.iter_mut().zip(COLUMNS) {
        let count = header.iter().filter(|c| **c == name).count();
        if count > 1 {
            let problem = format!("the column {name} is there {count} times");
            return Err(lines.fault(problem, "Rename all but one"));
        }
        *place = header.iter().position(|c| *c == name).ok_or_else(|| {
            Error::Table(
                Fault::new(
                    lines.path.display(),
                    format!("there is no column {name}, only {}", shown(&header)),
                )
                .at(Place::Line(1))
                .advice("Give a node table written by " + TRACK),
            )
        })?;
    }
    Ok((header.len(), columns))
}

/// Names for a message, which is to stay a line that can be read.
fn shown(header: &[&str]) -> String {
    let all = header.join(", ");
    match all.char_indices().nth(200) {
        Some((end, _)) => format!("{}...", &all[..end]),
        None => all,
    }
}

struct Lines {
    path: PathBuf,
    reader: BufReader<File>,
    number: u64,
    line: String,
    /// The line has an end.
    is_ended: bool,
}

impl Lines {
    fn next(&mut self) -> Result<bool> {
        self.line.clear();
        let read = self.reader.read_line(&mut self.line);
        self.number += 1;
        match read {
            Ok(0) => return Ok(false),
            Ok(_) => {}
            Err(e) if e.kind() == ErrorKind::InvalidData => {
                return Err(self.fault("it is not text (UTF-8)", "Give a CSV file"));
            }
            Err(e) => return Err(read_fault(&self.path, &e)),
        }
        self.is_ended = self.line.ends_with(['\r', '\n']);
        let whole = self.line.trim_end_matches(['\r', '\n']).len();
        self.line.truncate(whole);
        Ok(true)
    }

    fn fault(&self, problem: impl Into<Message>, advice: impl Into<Message>) -> Error {
        Error::Table(Fault::new(self.path.display(), problem).at(Place::Line(self.number)).advice(advice))
    }

    /// The shortest of the last cells up to this one. Refuses the number with which a table ends whose last line has no end,
    /// if each of those above it is longer: it may be the beginning of one.
    fn longer_than(&self, last: &str, shortest: usize) -> Result<usize> {
        if self.is_ended || !is_cut(last, shortest) {
            return Ok(shortest.min(last.len()));
        }
        Err(self.fault(
            format!(
                "the file ends with {last:?} and no end of a line, and every number above it has more digits"
            ),
            "The table may be cut off here: copy it again, or end its last line if it is whole",
        ))
    }

    fn number_in<T: std::str::FromStr>(&self, text: &str, column: &str) -> Result<T> {
        text.trim().parse().map_err(|_| {
            self.fault(
                format!("column {column}: {text:?} is not a number"),
                "Correct the row or write the table again",
            )
        })
    }

    /// An empty field is what is not seen.
    fn optional(&self, text: &str, column: &str) -> Result<f64> {
        if text.trim().is_empty() {
            return Ok(f64::NAN);
        }
        let value: f64 = self.number_in(text, column)?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.fault(
                format!("column {column}: {text} is not a finite number"),
                "Leave the field empty where nothing is seen",
            ))
        }
    }
}
