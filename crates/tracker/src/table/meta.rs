//! Holds a node table's metadata: rig, recording, settings, ending. No clock, no host, no folder, so that the
//! same recording and settings give the same bytes.
//!
//! Owns: [`TableMeta`] and its text forms. Must not: open the recording's pixels.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::Fingerprint;
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::{RateOrigin, SourceInfo, TimeBase};
use crate::gaps::Damage;
use crate::message::TRACK;
use crate::name::{self, shown, text};
use crate::pixel_aspect::{AspectOrigin, PixelAspect};
use crate::pixel_damage::PixelDamage;
use crate::rig::Rig;
use crate::timing::Timing;

/// Version of the table's form. A file with a higher one is refused.
pub const SCHEMA_VERSION: u32 = 1;

/// Facts of the recording. `None` is unknown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SourceFacts {
    /// Name of the file without its folder, `-` for standard input.
    pub name: String,
    /// Container.
    pub container: String,
    /// Codec or packing.
    pub codec: String,
    /// Width in px.
    pub width: u32,
    /// Height in px.
    pub height: u32,
    /// Width to height of a pixel; not written where it is 1.
    #[serde(default, skip_serializing_if = "PixelAspect::is_square")]
    pub pixel_aspect: PixelAspect,
    /// Where that comes from; written where the user said it.
    #[serde(default, skip_serializing_if = "AspectOrigin::is_recording")]
    pub pixel_aspect_origin: AspectOrigin,
    /// Significant bits of a sample.
    pub depth_bits: u32,
    /// Whether damage to its pixels is noticed; tables of earlier versions do not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixel_damage: Option<PixelDamage>,
    /// Frames that the header declares.
    pub declared_frames: Option<u64>,
    /// Frames per second of recorded time; of a finished run what [`TableMeta::time`] says.
    pub rate_hz: Option<f64>,
    /// Where the rate comes from; `user` is an override by `--fps`.
    pub rate_origin: RateOrigin,
    /// Seconds per tick, numerator and denominator.
    pub time_base: [u64; 2],
    /// Form of the samples before they were converted to brightness, if they were.
    pub converted_from: Option<String>,
    /// Bytes of the file or files.
    pub size_bytes: Option<u64>,
    /// SHA-256 of the first MiB of the file.
    pub sha256_first_mib: Option<String>,
    /// SHA-256 of what tells the recording from others of its size, see [`crate::table::Fingerprint`].
    #[serde(default)]
    pub sha256_ends: Option<String>,
    /// The source's warnings.
    pub warnings: Vec<String>,
}

impl SourceFacts {
    /// Facts of a source that was opened, which is read from `files`. Reads their first and last MiB.
    ///
    /// # Errors
    /// [`Error::Source`] if one of them cannot be read.
    pub fn of(info: &SourceInfo, files: &[PathBuf]) -> Result<Self> {
        let path = name::path(&info.name);
        let base = shown(&path.file_name().map_or_else(|| info.name.clone(), text));
        Ok(Self {
            container: info.container.clone(),
            codec: info.codec.clone(),
            width: info.width,
            height: info.height,
            pixel_aspect: info.pixel_aspect,
            pixel_aspect_origin: info.pixel_aspect_origin,
            depth_bits: info.depth_bits,
            pixel_damage: Some(info.pixel_damage),
            declared_frames: info.declared_frames,
            rate_hz: info.rate_hz,
            rate_origin: info.rate_origin,
            time_base: [info.time_base.numerator, info.time_base.denominator],
            converted_from: info.converted_from.clone(),
            size_bytes: info.size_bytes,
            sha256_first_mib: first_mib(&path),
            sha256_ends: if files.is_empty() { None } else { Some(Fingerprint::of(files)?.sha256) },
            // Messages name the file as the user did; the table is the same from any folder.
            warnings: info.warnings.iter().map(|w| w.replace(&info.name, &base).to_string()).collect(),
            name: base,
        })
    }

    /// Seconds per tick.
    pub fn time_base(&self) -> TimeBase {
        TimeBase { numerator: self.time_base[0], denominator: self.time_base[1] }
    }
}

/// SHA-256 of the first MiB of a regular file in hexadecimal; `None` for anything else.
fn first_mib(path: &Path) -> Option<String> {
    if !path.metadata().ok()?.is_file() {
        return None;
    }
    let mut bytes = Vec::new();
    File::open(path).ok()?.take(1 << 20).read_to_end(&mut bytes).ok()?;
    Some(Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect())
}

/// Ending of the run that made the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum RunEnding {
    /// All frames asked for are there.
    Complete,
    /// The recording was read to its end, but frames in it are lost; see [`TableMeta::damage`].
    Damaged,
    /// The recording ended before what it declares. Frames before that may be lost too.
    Early {
        /// Frames that could be read.
        frames: u64,
        /// Byte offset of the damage, if known.
        byte: Option<u64>,
        /// The decoder's reason.
        reason: String,
    },
    /// The user stopped the run; the table holds what was done.
    Interrupted,
}

/// Origin of a table: rig, recording, settings, ending.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TableMeta {
    /// Version of the table's form.
    pub schema_version: u32,
    /// Program and version that wrote it.
    pub tool: String,
    /// Nodes, bodies, joints.
    pub rig: Rig,
    /// The recording.
    pub source: SourceFacts,
    /// Origin and uncertainty of its times; tables of earlier versions do not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<Timing>,
    /// Settings that were given and those learned from the recording, by name.
    pub settings: serde_json::Value,
    /// How the run ended.
    pub ending: RunEnding,
    /// Frames that cannot be decoded and frames that are not there.
    #[serde(default, skip_serializing_if = "Damage::is_none")]
    pub damage: Damage,
}

/// Keys of the Parquet metadata, `pydpend.` before each; a CSV's `.json` has the same without it.
/// `damage` is there only if there is some.
pub(super) const KEYS: [&str; 8] =
    ["schema_version", "tool", "rig", "source", "time", "settings", "ending", "damage"];

impl TableMeta {
    /// Name of the program in tables that are written.
    pub(super) const PROGRAM: &str = "tracker";

    /// The program and version that this is.
    pub fn this_tool() -> String {
        format!("{} {}", Self::PROGRAM, env!("CARGO_PKG_VERSION"))
    }

    /// As one JSON text, of one form for one content.
    ///
    /// # Errors
    /// [`Error::Table`] if a value has no JSON form.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string_pretty(self)
            .map_err(|e| Error::Table(Fault::new("table metadata", e.to_string())))
    }

    /// From one JSON text; `name` is for messages.
    ///
    /// # Errors
    /// [`Error::Table`] if the version is not known or a key is missing or wrong.
    pub fn from_json(text: &str, name: &str) -> Result<Self> {
        let value: serde_json::Value = serde_json::from_str(text).map_err(|e| {
            Error::Table(
                Fault::new(name, format!("it is not JSON ({e})"))
                    .at(Place::Line(e.line() as u64))
                    .advice("Run " + TRACK + " again"),
            )
        })?;
        Self::from_value(value, name)
    }

    /// From a JSON value; `name` is for messages.
    ///
    /// # Errors
    /// [`Error::Table`] if the version is not known or a key is missing or wrong.
    pub fn from_value(value: serde_json::Value, name: &str) -> Result<Self> {
        let version = value.get("schema_version").and_then(serde_json::Value::as_u64);
        match version {
            Some(v) if v == u64::from(SCHEMA_VERSION) => {}
            Some(v) => {
                return Err(Error::Table(
                    Fault::new(
                        name,
                        format!("its schema version is {v}, this program reads version {SCHEMA_VERSION}"),
                    )
                    .of_kind(FaultKind::Unsupported)
                    .advice("Use a newer tracker, or write the table again with this one"),
                ));
            }
            None => {
                return Err(Error::Table(
                    Fault::new(
                        name,
                        "there is no schema_version: it is no node table, or who wrote it again left its metadata out",
                    )
                    .advice(
                        "Give the table that " + TRACK + " wrote; with pyarrow, keep its schema.metadata",
                    ),
                ));
            }
        }
        let meta: Self = serde_json::from_value(value).map_err(|e| {
            Error::Table(
                Fault::new(name, format!("its metadata are not those of a node table ({e})"))
                    .advice("Run " + TRACK + " again"),
            )
        })?;
        meta.rig.check(name)?;
        Ok(meta)
    }

    /// Each key with its JSON text, in the order of [`KEYS`].
    pub(super) fn entries(&self) -> Result<Vec<(&'static str, String)>> {
        let fault = |e: serde_json::Error| Error::Table(Fault::new("table metadata", e.to_string()));
        let value = serde_json::to_value(self).map_err(fault)?;
        KEYS.iter()
            .filter_map(|&key| Some((key, value.get(key)?)))
            .map(|(key, value)| {
                let text = match value {
                    serde_json::Value::String(s) => s.clone(),
                    v => serde_json::to_string(v).map_err(fault)?,
                };
                Ok((key, text))
            })
            .collect()
    }

    /// The reverse of [`TableMeta::entries`].
    pub(super) fn from_entries(find: impl Fn(&str) -> Option<String>, name: &str) -> Result<Self> {
        let mut map = serde_json::Map::new();
        for key in KEYS {
            let Some(text) = find(key) else { continue };
            let value = if key == "tool" {
                serde_json::Value::String(text)
            } else {
                serde_json::from_str(&text).map_err(|e| {
                    Error::Table(
                        Fault::new(name, format!("its metadata are damaged ({e})"))
                            .of_kind(FaultKind::Damaged)
                            .at(Place::Key(format!("pydpend.{key}")))
                            .advice("Run " + TRACK + " again"),
                    )
                })?
            };
            map.insert(key.to_owned(), value);
        }
        Self::from_value(serde_json::Value::Object(map), name)
    }
}
