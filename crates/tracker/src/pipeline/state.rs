//! Writes and reads the state that a run leaves beside its output until the table is whole, so that a killed run can go on.
//!
//! Owns: the name of that file, the header in it, what must agree for a run to go on. The detections in it are
//! what a finished table is made of, whether one run made them or several: so the table's bytes are the same.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::ahead::End;
use super::settings::RunSettings;
use crate::detect::{Centroid, DetectSettings, Levels};
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::{Ending, RateOrigin};
use crate::gaps::{Gaps, Reason};
use crate::message::{Message, Setting};
use crate::name::text;
use crate::output::LONGEST_NAME;
use crate::store::{Finished, Spool};
use crate::table::{Fingerprint, SourceFacts, TableMeta};

/// The file in which the state of a run for `output` is kept.
pub fn partial_path(output: &Path) -> PathBuf {
    let mut name = output.file_name().unwrap_or_default().to_owned();
    name.push(".partial");
    if name.len() > LONGEST_NAME {
        // No name so long is possible: the hash of the output's stands for it.
        let hash = Sha256::digest(output.file_name().unwrap_or_default().as_encoded_bytes());
        let hash: String = hash.iter().take(16).map(|b| format!("{b:02x}")).collect();
        name = format!("{hash}.partial").into();
    }
    output.with_file_name(name)
}

/// Key of the times at which the recording's files were written, in the identity of a run.
const TIMES: &str = "recording's times";

/// Identity of a run, which must be the same for it to go on: recording, detection, range of frames, program.
pub struct State {
    identity: Value,
    /// When the recording's files were changed, see [`Fingerprint::changes`]; `None` where it has none.
    pub changes: Option<String>,
}

/// State that an earlier run left.
pub struct Earlier {
    pub spool: Spool,
    pub levels: Levels,
    /// How reading ended, if the recording was read through.
    pub end: Option<End>,
}

#[derive(Serialize, Deserialize)]
struct Header {
    identity: Value,
    levels: Levels,
}

/// The settings of an earlier run in today's words: centres by discs had another name.
fn in_words_of_today(before: &Value) -> Value {
    let mut before = before.clone();
    if let Some(word) = before.pointer_mut("/detection settings/centroid")
        && let Ok(centroid) = serde_json::from_value::<Centroid>(word.clone())
    {
        *word = json!(centroid);
    }
    before
}

/// The facts that tell one recording from another. Its rate, known for certain only when it was read through, follows from that.
fn identity(facts: &SourceFacts) -> SourceFacts {
    SourceFacts { pixel_damage: None, rate_hz: None, rate_origin: RateOrigin::Unknown, ..facts.clone() }
}

impl State {
    pub fn new(
        settings: &RunSettings,
        facts: &SourceFacts,
        detect: &DetectSettings,
        files: &[PathBuf],
    ) -> Result<Self> {
        let print = if files.is_empty() { None } else { Some(Fingerprint::of(files)?) };
        let identity = json!({
            "program": TableMeta::this_tool(),
            "recording": identity(facts),
            // A finished table does not know these: a copy of the recording has the same table.
            TIMES: print.as_ref().map(|p| json!({"newest, s since 1970,": p.newest_s, "all": p.changes})),
            "detection settings": detect,
            "decoder": settings.open.decoder,
            "fps": settings.open.fps,
            "frames": settings.frames_json(),
            "interlaced": settings.interlaced_json(),
            "wanted": settings.wanted_json(),
        });
        Ok(Self { identity, changes: print.map(|p| p.changes) })
    }

    /// Whether a finished table is what a run would make now.
    pub fn made(&self, meta: &TableMeta, output: &Path) -> Result<()> {
        let before = json!({
            "program": meta.tool,
            "recording": identity(&meta.source),
            TIMES: self.identity[TIMES],
            "detection settings": meta.settings["detect"],
            "decoder": meta.settings["decoder"],
            "fps": meta.settings["fps"],
            "frames": meta.settings["frames"],
            "interlaced": meta.settings["interlaced"],
            "wanted": meta.settings["wanted"],
        });
        self.same(&before, output, "its run is complete and had another")
    }

    /// Whether nothing differs from what was; `what` begins the message.
    fn same(&self, before: &Value, path: &Path, what: &str) -> Result<()> {
        let before = in_words_of_today(before);
        let Some(object) = self.identity.as_object() else { return Ok(()) };
        match object.iter().find(|&(key, value)| before.get(key) != Some(value)) {
            None => Ok(()),
            Some((key, value)) => {
                let problem = Message::from(format!("{what} ")) + named(key);
                let advice = "Run with what it had, or begin anew with " + Setting::Force;
                let fault = match self.changed_file(key, before.get(key), value) {
                    Some(how) => Fault::new(text(path), problem + how),
                    None => {
                        Fault::new(text(path), problem).at(Place::Key(difference(before.get(key), value)))
                    }
                };
                Err(Error::Table(fault.advice(advice)))
            }
        }
    }

    /// The file that is another than it was, where that is the difference of a key's values.
    fn changed_file(&self, key: &str, before: Option<&Value>, now: &Value) -> Option<String> {
        let name = self.identity["recording"]["name"].as_str().unwrap_or("the recording");
        if key == TIMES {
            return Some(format!(
                ": {name}, or another file of the recording, was written or replaced since then"
            ));
        }
        let before = before?;
        let differs = |key: &str| before[key] != now[key];
        let facts = now.as_object().filter(|_| key == "recording")?;
        let is_contents = |key: &str| key.starts_with("sha256");
        if facts.keys().any(|k| !is_contents(k) && differs(k)) {
            return None;
        }
        let part = if differs("sha256_first_mib") { "the first" } else { "the first or last" };
        Some(format!(
            ": {name} has the same size as then, but {part} MiB of it, or of a file that belongs to it, is another"
        ))
    }

    /// Begins a new state; an older one is gone.
    pub fn create(&self, output: &Path, levels: &Levels) -> Result<Spool> {
        let header = Header { identity: self.identity.clone(), levels: levels.clone() };
        let head =
            serde_json::to_string(&header).map_err(|e| Error::Table(Fault::new("state", e.to_string())))?;
        Spool::create(&partial_path(output), &head)
    }

    /// Opens what an earlier run left, if one did.
    pub fn resume(&self, output: &Path) -> Result<Option<Earlier>> {
        let path = partial_path(output);
        if !Spool::is_at(&path)? {
            return Ok(None);
        }
        let (spool, head) = Spool::resume(&path)?;
        let header: Header = serde_json::from_str(&head).map_err(|e| {
            Error::Table(
                Fault::new(text(&path), format!("its header is of another program ({e})"))
                    .of_kind(FaultKind::Damaged)
                    .advice(anew()),
            )
        })?;
        self.same(&header.identity, &path, "the earlier run had another")?;
        let end = spool.finished().map(|f| read_end(&f.ending, &path)).transpose()?;
        Ok(Some(Earlier { spool, levels: header.levels, end }))
    }
}

/// The advice where an earlier run is of no use.
pub fn anew() -> Message {
    "Begin anew with " + Setting::Force
}

/// A key of what a state remembers; most are settings.
fn named(key: &str) -> Message {
    Setting::ALL.into_iter().find(|s| s.name() == key).map_or_else(|| key.into(), Message::from)
}

/// The difference of two values, in few words.
fn difference(before: Option<&Value>, now: &Value) -> String {
    match (before.and_then(Value::as_object), now.as_object()) {
        (Some(before), Some(now)) => {
            // Sums of contents tell nobody anything where something else differs too.
            let mut differ: Vec<&String> = now.keys().filter(|&k| before.get(k) != now.get(k)).collect();
            differ.sort_by_key(|k| k.starts_with("sha256"));
            let key = differ.first().map_or_else(String::new, |k| (*k).clone());
            let show = |v: Option<&Value>| v.map_or_else(|| "nothing".into(), ToString::to_string);
            format!("{key} was {}, is {}", show(before.get(&key)), show(now.get(&key)))
        }
        _ => format!("was {}, is {now}", before.map_or_else(|| "nothing".into(), ToString::to_string)),
    }
}

#[derive(Serialize, Deserialize)]
struct EndingText {
    early: Option<(u64, Option<u64>, String)>,
    #[serde(default)]
    gaps: Gaps,
    #[serde(default)]
    reasons: Vec<Reason>,
}

/// The end of reading, as the state file has it.
pub fn finished(end: &End) -> Result<Finished> {
    let early = match &end.ending {
        Ending::Complete => None,
        Ending::Early { frames, byte, reason } => Some((*frames, *byte, reason.clone())),
    };
    let (gaps, reasons) = (end.gaps.clone(), end.reasons.clone());
    let ending = serde_json::to_string(&EndingText { early, gaps, reasons })
        .map_err(|e| Error::Table(Fault::new("state", e.to_string())))?;
    Ok(Finished { ending })
}

fn read_end(words: &str, path: &Path) -> Result<End> {
    let words: EndingText = serde_json::from_str(words).map_err(|e| {
        Error::Table(
            Fault::new(text(path), format!("its last record is of another program ({e})"))
                .of_kind(FaultKind::Damaged)
                .advice(anew()),
        )
    })?;
    let ending = match words.early {
        None => Ending::Complete,
        Some((frames, byte, reason)) => Ending::Early { frames, byte, reason },
    };
    Ok(End { ending, gaps: words.gaps, reasons: words.reasons })
}

/// Removes the state of a run, if there is one.
pub fn remove(output: &Path) -> Result<()> {
    let path = partial_path(output);
    if !Spool::is_at(&path)? {
        return Ok(());
    }
    std::fs::remove_file(&path).map_err(|e| {
        Error::Table(
            Fault::new(text(&path), format!("no run needs this any more, and it cannot be removed ({e})"))
                .caused_by(&e)
                .advice("Remove it yourself"),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_of_other_contents_is_named_and_its_hash_is_not() {
        let of = |hash: &str, width: u32| json!({"recording": {"name": "drop.mp4", "sha256_first_mib": hash, "sha256_ends": hash, "width": width}});
        let state = State { identity: of("ab12", 640), changes: None };
        let said = |before: Value| {
            state
                .same(&before, Path::new("o.partial"), "the earlier run had another")
                .unwrap_err()
                .to_string()
        };
        let words = said(of("cd34", 640));
        assert!(words.contains("drop.mp4 has the same size as then") && !words.contains("12"), "{words}");
        assert!(said(of("cd34", 320)).contains("width was 320, is 640"));
        let state =
            State { identity: json!({TIMES: {"newest": 1}, "recording": {"name": "a.mraw"}}), changes: None };
        let words = state
            .same(
                &json!({TIMES: {"newest": 2}, "recording": {"name": "a.mraw"}}),
                Path::new("o"),
                "it had another",
            )
            .unwrap_err()
            .to_string();
        assert!(
            words.contains("a.mraw, or another file of the recording, was written or replaced since"),
            "{words}"
        );
    }

    #[test]
    fn a_run_of_before_is_known_by_its_older_word_for_the_centre() {
        let asked = |word: &str| json!({"detection settings": {"centroid": word}, "fps": 500.0});
        let today = |word: &str| in_words_of_today(&asked(word));
        assert_eq!(today("weighted"), asked("disc"));
        for word in ["disc", "contour", "intensity_weighted", "no word of ours"] {
            assert_eq!(today(word), asked(word));
        }
        assert_eq!(in_words_of_today(&json!({"fps": 1.0})), json!({"fps": 1.0}));
    }
}
