//! Defines, writes and reads the node table: one row per frame and node, ordered by frame, then node. Schema version 1.
//!
//! | column | type | meaning |
//! |---|---|---|
//! | `frame` | int64 | index in the recording, from 0 |
//! | `time_s` | float64 | from the recording's time base |
//! | `node`, `body` | string (dictionary) | names of the rig |
//! | `x_px`, `y_px` | float64, null when not seen | centre; x right, y down |
//! | `sigma_px` | float32, null when not seen | standard uncertainty of each coordinate |
//! | `area_px` | float32, null when not seen or placed by a person | blob area |
//! | `status` | string (dictionary) | `seen`, `reacquired`, `missing`, `ambiguous`, `undecoded`, `manual` |
//!
//! Owns: [`NodeTable`], [`Rows`], what makes them valid, their files ([`read_table`], [`TableWriter`]).
//! Must not: track, or know where rows come from.

mod check;
mod csv;
mod csv_read;
mod file;
mod fingerprint;
mod meta;
mod parquet;
mod parquet_read;
mod rows;
mod shared;
mod sum;
mod tally;
#[cfg(test)]
pub(crate) mod tests;

pub use self::parquet::{batch, schema};
pub use file::{Form, TableWriter, read_meta, read_table, table_files};
pub use fingerprint::{Fingerprint, changed};
pub use meta::{RunEnding, SCHEMA_VERSION, SourceFacts, TableMeta};
use rows::row_fault;
pub use rows::{COLUMNS, NodeTable, Rows, STATUS_WORDS};
pub use tally::{NodeSummary, Tally};
