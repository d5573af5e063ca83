//! Holds the summary of a run: [`RunSummary`].

use crate::message::Message;
use crate::table::{NodeSummary, NodeTable, TableMeta};

/// Key of the table's settings under which is said what was followed in place of markers.
pub(super) const MOVING: &str = "moving";

/// Key of the table's settings under which is said which rows people decided.
pub(super) const EDITS: &str = "edits";

/// Summary of a run.
#[derive(Debug, Clone)]
pub struct RunSummary {
    /// The table's metadata.
    pub meta: TableMeta,
    /// Frames in the table.
    pub frames: u64,
    /// Frames taken over from an earlier run.
    pub resumed: u64,
    /// Whether a run that was stopped can go on, with what it left beside the table.
    pub resumable: bool,
    /// Whether what moves was followed, because no markers stand out.
    pub moving: bool,
    /// Names of nodes of which it is doubtful whether they are what is meant, or where their centres are; notes say which.
    pub doubtful: Vec<String>,
    /// Places that were pointed at and from which nothing is followed; notes say why.
    pub not_followed: Vec<String>,
    /// Names of nodes whose names stay open in many frames; notes say the likeliest cause.
    pub open: Vec<String>,
    /// Each node's counts of rows by status.
    pub nodes: Vec<NodeSummary>,
    /// Warnings to the user, a sentence each.
    pub warnings: Vec<Message>,
    /// The table, if it was asked for.
    pub table: Option<NodeTable>,
}

impl RunSummary {
    /// Names of nodes that were never seen or stayed lost: gone at the end for longer than they ever were before.
    pub fn lost(&self) -> Vec<&str> {
        self.nodes.iter().filter(|n| n.stayed_lost()).map(|n| n.node.as_str()).collect()
    }
}
