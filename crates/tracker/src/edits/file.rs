//! Reads the file of decisions and checks it against a recording and its rig.
//!
//! ```toml
//! schema = 1
//!
//! [film]
//! name = "drop.mp4"
//! sha256 = "5f2c..."
//!
//! [[edit]]
//! what = "place"
//! node = "n2"
//! frame = 120
//! at_px = [312.4, 201.9]
//! sigma_px = 0.8
//! by = "ann"
//! when = 2026-12-01T15:20:00Z
//! ```
//!
//! Owns: [`Edits`]. Must not: change rows.

use std::path::Path;

use serde::Deserialize;
use sha2::{Digest, Sha256};

use super::decision::Decision;
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::kind::{self, Kind};
use crate::message::{Message, Setting};
use crate::name::text;
use crate::rig::Rig;
use crate::table::SourceFacts;

/// Version of the form; a file with a higher one is refused.
pub const EDITS_SCHEMA: u32 = 1;

/// The film that decisions are about.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EditedFilm {
    /// Name of its file without the folder, for people.
    pub name: String,
    /// [`SourceFacts::sha256_ends`], by which it is known; `None` where the recording has none.
    pub sha256: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    schema: u32,
    film: EditedFilm,
    #[serde(rename = "edit", default)]
    edits: Vec<toml::Spanned<Decision>>,
}

/// Decisions of people about one film, in their order.
#[derive(Debug, Clone, PartialEq)]
pub struct Edits {
    /// Name of the file, for messages.
    pub name: String,
    /// The film.
    pub film: EditedFilm,
    /// The decisions; later ones are made on what earlier ones left.
    pub decisions: Vec<Decision>,
    /// Line of each.
    lines: Vec<u64>,
    /// SHA-256 of the text, hexadecimal.
    pub sha256: String,
}

impl Edits {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the file and the line.
    pub fn read(path: &Path) -> Result<Self> {
        kind::expect(path, &[Kind::Edits], Error::Argument)?;
        let content = std::fs::read_to_string(path).map_err(|e| {
            Error::Argument(
                Fault::new(text(path), format!("the file of edits cannot be read ({e})"))
                    .caused_by(&e)
                    .advice("Leave out " + Setting::Edits + ", or give a file that is there"),
            )
        })?;
        Self::parse(&content, &text(path))
    }

    /// Reads and checks the text of a file; `name` is for messages.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the line.
    pub fn parse(content: &str, name: &str) -> Result<Self> {
        let line_of = |byte: usize| content[..byte.min(content.len())].matches('\n').count() as u64 + 1;
        let wrong = |line: u64, problem: String| {
            Error::Argument(
                Fault::new(name, problem)
                    .at(Place::Line(line))
                    .advice("The form is that of docs/reference/edits.md"),
            )
        };
        let read: Content = toml::from_str(content)
            .map_err(|e| wrong(e.span().map_or(1, |s| line_of(s.start)), e.message().to_owned()))?;
        if read.schema == 0 || read.schema > EDITS_SCHEMA {
            let problem =
                format!("schema {} is not known, this program reads up to {EDITS_SCHEMA}", read.schema);
            return Err(wrong(1, problem));
        }
        let mut lines = Vec::with_capacity(read.edits.len());
        let mut decisions = Vec::with_capacity(read.edits.len());
        for edit in read.edits {
            let line = line_of(edit.span().start);
            let decision = edit.into_inner();
            decision.check().map_err(|(key, problem)| wrong(line, format!("{key}: {problem}")))?;
            lines.push(line);
            decisions.push(decision);
        }
        let sha256 = Sha256::digest(content.as_bytes()).iter().map(|b| format!("{b:02x}")).collect();
        Ok(Self { name: name.to_owned(), film: read.film, decisions, lines, sha256 })
    }

    /// Refuses decisions about another film.
    ///
    /// # Errors
    /// [`Error::Argument`] naming both.
    pub fn belongs(&self, facts: &SourceFacts) -> Result<()> {
        if self.film.sha256.is_none() || self.film.sha256 == facts.sha256_ends {
            return Ok(());
        }
        let problem = format!(
            "its decisions are about {}, and {} is another film or was changed since (their SHA-256 differ)",
            self.film.name, facts.name
        );
        Err(Error::Argument(
            Fault::new(&self.name, problem)
                .at(Place::Key("film.sha256".into()))
                .advice("Give the edits of this film, or leave out " + Setting::Edits),
        ))
    }

    /// Refuses names that the rig does not have and places outside the picture.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the line.
    pub(super) fn fits(&self, rig: &Rig) -> Result<()> {
        for (k, decision) in self.decisions.iter().enumerate() {
            for name in [Some(&decision.node), decision.with.as_ref()].into_iter().flatten() {
                if !rig.nodes.iter().any(|n| n.name == *name) {
                    let names: Vec<&str> = rig.nodes.iter().map(|n| n.name.as_str()).collect();
                    return Err(self.wrong(
                        k,
                        format!("{name} is no node; its nodes are {}", names.join(", ")),
                        "Give the " + Setting::Rig + " with which the decisions were made",
                    ));
                }
            }
            if let Some(at) = decision.at_px
                && !rig.in_image(at)
            {
                let [w, h] = rig.image_px;
                let problem = format!("at_px: ({}, {}) is not in the picture of {w} x {h} px", at[0], at[1]);
                return Err(self.wrong(
                    k,
                    problem,
                    "Give column and row, counted from the upper left corner",
                ));
            }
        }
        Ok(())
    }

    /// The error of the `k`-th decision.
    pub(super) fn wrong(&self, k: usize, problem: String, advice: impl Into<Message>) -> Error {
        let line = self.lines.get(k).copied().unwrap_or(1);
        Error::Argument(
            Fault::new(&self.name, problem).of_kind(FaultKind::Invalid).at(Place::Line(line)).advice(advice),
        )
    }
}
