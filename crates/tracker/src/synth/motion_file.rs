//! Reads a table of link angles, CSV or Parquet by the ending.

use std::fs::File;
use std::path::Path;

use arrow::array::{Array, AsArray};
use arrow::datatypes::{DataType, Float64Type};
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};

use super::motion::MotionTable;
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::kind::{self, Kind};

impl MotionTable {
    /// Reads `time_s`, `phi1_rad`, `phi2_rad`, ... and, for free bodies, `x1_px`, `y1_px`, ...; other columns are
    /// left alone.
    ///
    /// # Errors
    /// [`Error::Film`] naming the file and the column, line or row.
    pub fn read(path: &Path) -> Result<Self> {
        kind::expect(path, &[Kind::Angles], Error::Film)?;
        let name = path.display().to_string();
        let (header, columns) = match path.extension().and_then(|e| e.to_str()) {
            Some("csv") => read_csv(path, &name)?,
            Some("parquet") => read_parquet(path, &name)?,
            _ => {
                return Err(Error::Film(
                    Fault::new(&name, "a motion is read from .csv or .parquet")
                        .of_kind(FaultKind::Unsupported)
                        .advice("Give the table one of these endings"),
                ));
            }
        };
        Self::from_columns(name, &header, columns)
    }

    /// A checked table from columns by their names.
    fn from_columns(name: String, header: &[String], mut columns: Vec<Vec<f64>>) -> Result<Self> {
        let mut take =
            |column: &str| header.iter().position(|h| h == column).map(|i| std::mem::take(&mut columns[i]));
        let time_s = take("time_s").ok_or_else(|| missing(&name, "time_s"))?;
        let (mut phi_rad, mut place_px) = (Vec::new(), Vec::new());
        let highest = header
            .iter()
            .filter_map(|h| {
                h.strip_prefix("phi")
                    .and_then(|r| r.strip_suffix("_rad"))
                    .or_else(|| h.strip_prefix('x').and_then(|r| r.strip_suffix("_px")))
                    .and_then(|k| k.parse::<usize>().ok())
            })
            .filter(|&k| k <= 1000)
            .max()
            .unwrap_or(0);
        for k in 1..=highest {
            phi_rad.push(take(&format!("phi{k}_rad")).unwrap_or_default());
            let x = take(&format!("x{k}_px")).unwrap_or_default();
            let y = take(&format!("y{k}_px")).unwrap_or_default();
            if x.is_empty() != y.is_empty() {
                return Err(missing(&name, &format!("{}{k}_px", if x.is_empty() { "x" } else { "y" })));
            }
            place_px.push([x, y]);
        }
        if highest == 0 {
            return Err(missing(&name, "phi1_rad"));
        }
        let table = Self { name, time_s, phi_rad, place_px };
        table.check()?;
        Ok(table)
    }
}

fn missing(name: &str, column: &str) -> Error {
    Error::Film(
        Fault::new(name, format!("there is no column {column}"))
            .at(Place::Key(column.into()))
            .advice("A motion has time_s, phi1_rad, phi2_rad, ... (and x1_px, y1_px for a free body)"),
    )
}

fn unreadable(name: &str, why: impl std::fmt::Display) -> Error {
    Error::Film(Fault::new(name, format!("the motion cannot be read ({why})")))
}

fn read_csv(path: &Path, name: &str) -> Result<(Vec<String>, Vec<Vec<f64>>)> {
    let text = std::fs::read_to_string(path).map_err(|e| unreadable(name, e))?;
    let mut lines =
        text.lines().enumerate().filter(|(_, l)| !l.trim().is_empty() && !l.trim_start().starts_with('#'));
    let (_, first) = lines.next().ok_or_else(|| unreadable(name, "it is empty"))?;
    let header: Vec<String> =
        first.trim_start_matches('\u{feff}').split(',').map(|h| h.trim().to_string()).collect();
    let wanted: Vec<bool> = header
        .iter()
        .map(|h| h == "time_s" || h.ends_with("_px") || (h.starts_with("phi") && h.ends_with("_rad")))
        .collect();
    let mut columns = vec![Vec::new(); header.len()];
    for (number, line) in lines {
        let fields: Vec<&str> = line.split(',').collect();
        if fields.len() != header.len() {
            return Err(Error::Film(
                Fault::new(name, format!("{} fields under {} headings", fields.len(), header.len()))
                    .at(Place::Line(number as u64 + 1))
                    .advice("Give a comma between fields and a point in numbers"),
            ));
        }
        for ((field, column), (wanted, heading)) in
            fields.iter().zip(&mut columns).zip(wanted.iter().zip(&header))
        {
            if *wanted {
                column.push(field.trim().parse::<f64>().map_err(|_| {
                    Error::Film(
                        Fault::new(name, format!("{heading} is {field:?}, not a number"))
                            .at(Place::Line(number as u64 + 1))
                            .advice("A film needs the motion at every time; fill the gap first"),
                    )
                })?);
            }
        }
    }
    Ok((header, columns))
}

fn read_parquet(path: &Path, name: &str) -> Result<(Vec<String>, Vec<Vec<f64>>)> {
    let file = File::open(path).map_err(|e| unreadable(name, e))?;
    let reader = ParquetRecordBatchReaderBuilder::try_new_with_options(
        file,
        ArrowReaderOptions::new().with_skip_arrow_metadata(true),
    )
    .and_then(ParquetRecordBatchReaderBuilder::build)
    .map_err(|e| unreadable(name, e))?;
    let mut header = Vec::new();
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for batch in reader {
        let batch = batch.map_err(|e| unreadable(name, e))?;
        if header.is_empty() {
            header = batch.schema().fields().iter().map(|f| f.name().clone()).collect();
            columns = vec![Vec::new(); header.len()];
        }
        for (array, column) in batch.columns().iter().zip(&mut columns) {
            // Text and the like is of no use here; a wanted column of it is found empty and refused.
            if array.data_type().is_numeric() {
                let numbers =
                    arrow::compute::cast(array, &DataType::Float64).map_err(|e| unreadable(name, e))?;
                column.extend(numbers.as_primitive::<Float64Type>().iter().map(|v| v.unwrap_or(f64::NAN)));
            }
        }
    }
    Ok((header, columns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn csv(text: &str) -> Result<MotionTable> {
        let mut file = tempfile::Builder::new().suffix(".csv").tempfile().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        MotionTable::read(file.path())
    }

    #[test]
    fn columns_are_found_by_their_names() {
        let t = csv("frame,phi2_rad,time_s,phi1_rad,note\n0,2.5,0,1,a\n1,2.6,0.001,1.1,b\n").unwrap();
        assert_eq!(t.time_s, [0.0, 0.001]);
        assert_eq!(t.phi_rad, [vec![1.0, 1.1], vec![2.5, 2.6]]);
    }

    #[test]
    fn faults_name_line_and_column() {
        let message = |text| csv(text).unwrap_err().to_string();
        assert!(message("time_s,phi1_rad\n0,1\n0.1,n/a\n").contains("line 3: phi1_rad is \"n/a\""));
        assert!(message("time_s,phi1_rad\n0,1\n0.1\n").contains("line 3: 1 fields under 2 headings"));
        assert!(message("t,phi1_rad\n0,1\n").contains("there is no column time_s"));
        assert!(message("time_s\n0\n").contains("there is no column phi1_rad"));
        assert!(message("time_s,phi1_rad\n0,1\n0,2\n").contains("row 1"));
        assert!(message("time_s,phi1_rad\n0,1\n1,nan\n").contains("phi1_rad is NaN"));
    }
}
