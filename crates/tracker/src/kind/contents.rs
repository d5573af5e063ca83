//! The kind of a file by its first bytes, its columns or its keys, of a folder by the names in it.
//!
//! Owns: [`kind_of`]. Must not: tell kinds by the ending of a name alone.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use ::parquet::file::reader::{FileReader, SerializedFileReader};

use super::kinds::Kind;
use crate::packed::{first_part, is_packed};

/// Bytes that are looked at.
const BEGINNING: u64 = 1 << 16;

/// The kind of a file or folder, by what is in it.
pub fn kind_of(path: &Path) -> Kind {
    if path.is_dir() {
        return kind_of_folder(path);
    }
    // Pipes and devices are read once, and not by us.
    if !path.is_file() {
        return Kind::Unknown;
    }
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|f| f.take(BEGINNING).read_to_end(&mut bytes));
    if read.is_err() || bytes.is_empty() {
        return Kind::Unknown;
    }
    if bytes.starts_with(b"PAR1") {
        return parquet_columns(path).map_or(Kind::Unknown, |names| kind_of_columns(&names));
    }
    kind_of_magic(&bytes).unwrap_or_else(|| kind_of_text(path, &bytes))
}

fn kind_of_folder(path: &Path) -> Kind {
    let has = |name: &str| path.join(name).is_file();
    if has("run.json") {
        return Kind::RunFolder;
    }
    if has("fit.json") {
        return Kind::Fit;
    }
    if has("DPmean_data_RB0.npy") {
        return Kind::Angles;
    }
    let endings: Vec<String> = std::fs::read_dir(path)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|e| e.path().extension().map(|x| x.to_string_lossy().to_lowercase()))
        .collect();
    let any = |known: &[&str]| endings.iter().any(|e| known.contains(&e.as_str()));
    if any(&["png", "tif", "tiff", "bmp", "jpg", "jpeg", "pgm"]) {
        return Kind::Pictures;
    }
    if any(&["csv", "tdms", "npy"]) { Kind::Tables } else { Kind::Unknown }
}

fn kind_of_magic(bytes: &[u8]) -> Option<Kind> {
    let at = |place: usize, magic: &[u8]| bytes.get(place..place + magic.len()) == Some(magic);
    let boxes: [&[u8]; 7] = [b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot"];
    let films: [&[u8]; 17] = [
        b"\x1a\x45\xdf\xa3",
        b"GIF8",
        b"YUV4MPEG2",
        b"FLV\x01",
        b"OggS",
        b"\x30\x26\xb2\x75",
        b"\x06\x0e\x2b\x34",
        b"\0\0\x01\xba",
        b"\x89PNG",
        b"\xff\xd8\xff",
        b"II*\0",
        b"MM\0*",
        b"II+\0",
        b"MM\0+",
        b"\xed\xfe\0\0N\0o\0r\0p\0i\0x\0",
        b"CI\x2c\0",
        b"#Camera Information Header",
    ];
    if boxes.iter().any(|b| at(4, b))
        || films.iter().any(|f| at(0, f))
        || (at(0, b"RIFF") && at(8, b"AVI"))
        || (bytes[0] == 0x47 && bytes.get(188) == Some(&0x47) && bytes.get(376) == Some(&0x47))
    {
        return Some(Kind::Film);
    }
    if at(0, b"TDSm") {
        return Some(Kind::Encoder);
    }
    if is_packed(bytes) {
        return Some(Kind::Compressed);
    }
    if first_part(bytes).ends_with(b".npy") {
        return Some(Kind::NumpyArchive);
    }
    // A zipped document, an old one, MATLAB's two forms.
    let documents: [&[u8]; 4] = [b"PK\x03\x04", b"\xd0\xcf\x11\xe0", b"MATLAB", b"\x89HDF"];
    documents.iter().any(|d| at(0, d)).then_some(Kind::Spreadsheet)
}

fn kind_of_text(path: &Path, bytes: &[u8]) -> Kind {
    let whole = (bytes.len() as u64) < BEGINNING;
    let valid = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        // Cut within a character, or the end of text; what follows a beginning that is text does not matter.
        Err(e) if !whole && bytes.len() - e.valid_up_to() < 4 => {
            std::str::from_utf8(&bytes[..e.valid_up_to()]).unwrap_or_default()
        }
        Err(_) => return Kind::Unknown,
    };
    let text = valid.trim_start_matches('\u{feff}').trim_start();
    if text.starts_with("<!DOCTYPE html") || text.starts_with("<!doctype html") || text.starts_with("<html") {
        return Kind::Page;
    }
    if text.starts_with('{') {
        return kind_of_json(text);
    }
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if ending == "toml" || text.starts_with('[') {
        return text.parse::<toml::Table>().map_or(Kind::Unknown, |table| kind_of_toml(&table));
    }
    // A header line is among the first, below comments and notes.
    let columns = |line: &str| -> Vec<String> {
        let line = line.trim_start_matches('#');
        line.split([',', ';', '\t']).map(|c| c.trim().trim_matches('"').to_owned()).collect()
    };
    text.lines()
        .take(40)
        .map(|line| kind_of_columns(&columns(line)))
        .find(|kind| *kind != Kind::Unknown)
        .unwrap_or(Kind::Unknown)
}

fn kind_of_json(text: &str) -> Kind {
    // The beginning of a long file is not whole JSON: the keys at its outermost level are looked for by name.
    let has = |key: &str| text.contains(&format!("\"{key}\":"));
    if has("slope_v_per_rad") && has("offset_v") && has("holds") {
        Kind::Calibration
    } else if has("coefficients") && has("method") {
        Kind::Fit
    } else if has("image_px") && has("node") {
        Kind::Rig
    } else {
        Kind::Unknown
    }
}

fn kind_of_toml(table: &toml::Table) -> Kind {
    let has = |key: &str| table.contains_key(key);
    // A file of options gives places of markers as texts.
    let has_tables = |key: &str| {
        table.get(key).and_then(toml::Value::as_array).is_some_and(|a| a.iter().any(toml::Value::is_table))
    };
    if has("node") {
        Kind::Rig
    } else if has("film") && has("schema") {
        Kind::Edits
    } else if has_tables("marker") || has("link") || has("camera") {
        Kind::Scene
    } else if has("part") || has("constants") {
        Kind::Model
    } else if has("inputs") || (has("model") && has("laws")) {
        Kind::Config
    } else {
        Kind::Unknown
    }
}

fn kind_of_columns(names: &[String]) -> Kind {
    let has = |wanted: &str| names.iter().any(|n| n == wanted);
    if has("node") && has("x_px") {
        return if has("visible") { Kind::Truth } else { Kind::NodeTable };
    }
    if has("phi1_rad") || has("phi1_deg") {
        return Kind::Angles;
    }
    if has("voltage_v") { Kind::Encoder } else { Kind::Unknown }
}

/// The columns of a Parquet file; `None` if it is not whole.
fn parquet_columns(path: &Path) -> Option<Vec<String>> {
    let file = File::open(path).ok()?;
    // Not by the types that an Arrow writer adds: damaged ones panic in arrow-ipc 59.
    let reader = SerializedFileReader::new(file).ok()?;
    let schema = reader.metadata().file_metadata().schema_descr();
    Some(schema.root_schema().get_fields().iter().map(|f| f.name().to_owned()).collect())
}
