//! Tells what a file or folder is by what is in it: for a user who gave it to the wrong command.
//!
//! Knows the names of the columns and keys in every file of both programs, and nothing of what they mean. Owns:
//! [`Kind`], [`kind_of`], [`misplaced`], [`expect`]. Must not: read more than a beginning (or a Parquet file's end), or refuse what
//! it does not know.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use ::parquet::file::reader::{FileReader, SerializedFileReader};

use crate::error::{Error, Fault, FaultKind, Result};
use crate::message::{Message, Step};
use crate::name::shell_word;
use crate::packed::{first_part, is_packed, unpacking};

/// Kinds of files and folders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A film of any container.
    Film,
    /// A folder of numbered pictures.
    Pictures,
    /// A node table.
    NodeTable,
    /// A film's truth.
    Truth,
    /// An angles table, or the folder in which the paper's authors published theirs.
    Angles,
    /// A recording of the encoder.
    Encoder,
    /// A folder of tables, as encoder holds are kept.
    Tables,
    /// A calibration of the encoder.
    Calibration,
    /// A rig file.
    Rig,
    /// A scene to film.
    Scene,
    /// A pendulum's parts or constants.
    Model,
    /// Options of an analysis.
    Config,
    /// What an analysis wrote.
    RunFolder,
    /// What a damping fit wrote.
    Fit,
    /// A page for a browser.
    Page,
    /// A spreadsheet or a file of another program's own form.
    Spreadsheet,
    /// Arrays in NumPy's archive, of which pydpend reads none.
    NumpyArchive,
    /// A packed file or archive.
    Compressed,
    /// Nothing that is known here.
    Unknown,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 19] = [
        Self::Film,
        Self::Pictures,
        Self::NodeTable,
        Self::Truth,
        Self::Angles,
        Self::Encoder,
        Self::Tables,
        Self::Calibration,
        Self::Rig,
        Self::Scene,
        Self::Model,
        Self::Config,
        Self::RunFolder,
        Self::Fit,
        Self::Page,
        Self::Spreadsheet,
        Self::NumpyArchive,
        Self::Compressed,
        Self::Unknown,
    ];

    /// Name of the kind in Python.
    pub fn name(self) -> &'static str {
        match self {
            Self::Film => "film",
            Self::Pictures => "pictures",
            Self::NodeTable => "nodes",
            Self::Truth => "truth",
            Self::Angles => "angles",
            Self::Encoder => "encoder",
            Self::Tables => "tables",
            Self::Calibration => "calibration",
            Self::Rig => "rig",
            Self::Scene => "scene",
            Self::Model => "model",
            Self::Config => "config",
            Self::RunFolder => "run",
            Self::Fit => "fit",
            Self::Page => "page",
            Self::Spreadsheet => "spreadsheet",
            Self::NumpyArchive => "npz",
            Self::Compressed => "compressed",
            Self::Unknown => "unknown",
        }
    }

    /// Noun of the kind, with its article.
    pub fn noun(self) -> &'static str {
        match self {
            Self::Film => "a film",
            Self::Pictures => "a folder of pictures",
            Self::NodeTable => "a node table",
            Self::Truth => "the truth of a film that was made",
            Self::Angles => "an angles table",
            Self::Encoder => "an encoder recording",
            Self::Tables => "a folder of tables",
            Self::Calibration => "an encoder calibration",
            Self::Rig => "a rig file",
            Self::Scene => "a scene to film",
            Self::Model => "a pendulum's model file",
            Self::Config => "a file of options for pydpend analyse",
            Self::RunFolder => "a run folder of pydpend analyse",
            Self::Fit => "a damping fit",
            Self::Page => "a page for a browser",
            Self::Spreadsheet => "a spreadsheet or another program's file",
            Self::NumpyArchive => "a NumPy archive (.npz)",
            Self::Compressed => "a packed file",
            Self::Unknown => "of no known kind",
        }
    }

    /// What makes one of what is wanted of it in one step, where that is not what is done with it anyway.
    fn towards(self, wanted: &[Self], path: &Path) -> Option<Message> {
        let name = path.display().to_string();
        let file = shell_word(&name);
        let step = |command: String, call: String| {
            Some("Next: " + Message::from(Step { command: command.into(), call: call.into() }))
        };
        match self {
            Self::Film | Self::Pictures | Self::NodeTable | Self::Angles
                if wanted.contains(&Self::RunFolder) =>
            {
                let options = format!("pydpend.analyse.Options(inputs=({name:?},))");
                step(
                    format!("pydpend analyse {file} -o run/"),
                    format!("pydpend.analyse.analyse({options}, 'run')"),
                )
            }
            Self::Film | Self::Pictures if wanted.contains(&Self::Angles) => {
                let stem = shell_word(path.with_extension("").display().to_string().trim_end_matches('/'));
                let (nodes, angles) = (joined(&stem, ".parquet"), joined(&stem, "-angles.parquet"));
                let then = Step {
                    command: format!("pydpend angles {nodes} -o {angles}").into(),
                    call: "dp.angles(nodes)".into(),
                };
                Some(self.next(path) + ", then " + Message::from(then) + ", and give what that makes")
            }
            Self::Encoder if wanted.contains(&Self::Calibration) => step(
                format!("pydpend calibrate {file} -o encoder.json"),
                format!("dp.calibrate(dp.read_holds([{name:?}]))"),
            ),
            _ => None,
        }
    }

    /// What is done with it next.
    fn next(self, path: &Path) -> Message {
        let name = path.display().to_string();
        let file = shell_word(&name);
        let stem = shell_word(path.with_extension("").display().to_string().trim_end_matches('/'));
        let type_this = |command: String, call: String| {
            "Next: " + Message::from(Step { command: command.into(), call: call.into() })
        };
        match self {
            Self::Film | Self::Pictures => type_this(
                format!("tracker track {file} -o {}", joined(&stem, ".parquet")),
                format!("dp.track({name:?})"),
            ),
            Self::NodeTable => type_this(
                format!("pydpend angles {file} -o {}", joined(&stem, "-angles.parquet")),
                format!("dp.angles(dp.read_nodes({name:?}))"),
            ),
            Self::Truth => {
                type_this(format!("tracker score NODES {file}"), format!("dp.score(nodes, {name:?})"))
            }
            Self::Angles => type_this(
                format!("pydpend fit {file} -o {}", joined(&stem, "-damping/")),
                format!("dp.fit_damping(dp.read_angles({name:?}), model)"),
            ),
            Self::Encoder => type_this(
                format!("pydpend compare ANGLES {file} --calibration HOLDS -o compared/"),
                format!("dp.compare(angles, dp.encoder_angles(dp.read_encoder({name:?}), calibration))"),
            ),
            Self::Tables => type_this(
                format!("pydpend calibrate {file} -o encoder.json"),
                format!("dp.calibrate(dp.read_holds([{name:?}]))"),
            ),
            Self::Calibration => type_this(
                format!("pydpend compare ANGLES ENCODER --calibration {file} -o compared/"),
                format!("dp.read_calibration({name:?})"),
            ),
            Self::Rig => type_this(
                format!("tracker track FILM --rig {file} -o nodes.parquet"),
                format!("dp.track(film, {name:?})"),
            ),
            Self::Scene => type_this(
                format!("tracker film {file} -o film.mp4"),
                format!("dp.film({name:?}, 'film.mp4')"),
            ),
            Self::Model => type_this(
                format!("pydpend fit ANGLES --model {file} -o damping/"),
                format!("dp.read_model({name:?})"),
            ),
            Self::Config => type_this(
                format!("pydpend analyse --config {file} -o run/"),
                format!("pydpend.analyse.read_config({name:?})"),
            ),
            Self::RunFolder => {
                let angles = part_of(path, Self::Angles).map_or_else(|| path.to_owned(), |(_, file)| file);
                let inside = angles.display().to_string();
                Message::from(format!("Its page is {}. ", path.join("report.html").display()))
                    + type_this(
                        format!("pydpend plot energy {file} -o energy.pdf"),
                        format!("dp.read_angles({inside:?})"),
                    )
            }
            Self::Fit => type_this(
                format!("pydpend predict ANGLES --fit {file} -o predicted/"),
                format!("pydpend.fit_folder.load_fit({name:?})"),
            ),
            Self::Page => "Open it in a browser".into(),
            Self::Spreadsheet => "Save it as CSV with a header line".into(),
            Self::NumpyArchive => {
                let array = numpy_array(path).unwrap_or_else(|| "NAME".to_owned());
                let out = path.with_extension("npy").display().to_string();
                format!(
                    "Write its arrays as columns of a CSV with a header line, or one array as .npy in Python: \
                     numpy.save({out:?}, numpy.load({name:?})[{array:?}])"
                )
                .into()
            }
            Self::Compressed => unpacking(path)
                .map_or_else(|| "Unpack it".to_owned(), |command| format!("Unpack it with `{command}`"))
                .into(),
            Self::Unknown => Message::default(),
        }
    }
}

/// A stem with an ending, quoted once.
fn joined(stem: &str, ending: &str) -> String {
    stem.strip_suffix('\'').map_or_else(|| format!("{stem}{ending}"), |open| format!("{open}{ending}'"))
}

/// What is in a run folder of a kind, and its name there: of the first recording.
fn part_of(folder: &Path, wanted: Kind) -> Option<(&'static str, PathBuf)> {
    let (what, name) = match wanted {
        Kind::Angles => ("angles table", "angles.parquet"),
        Kind::NodeTable => ("node table", "nodes.parquet"),
        Kind::Calibration => ("encoder calibration", "encoder.json"),
        Kind::Fit => ("damping fit", "fit.json"),
        _ => return None,
    };
    let inside = std::fs::read_dir(folder).ok()?.flatten().map(|e| e.path().join(name));
    let mut found: Vec<PathBuf> = inside.filter(|p| p.is_file()).collect();
    found.sort();
    found.into_iter().next().map(|file| (what, file))
}

/// What is wrong with a file that is none of what is wanted; `None` if it is, or if nobody can tell.
pub fn misplaced(path: &Path, wanted: &[Kind]) -> Option<Fault> {
    let kind = kind_of(path);
    if kind == Kind::Unknown || wanted.contains(&kind) {
        return None;
    }
    // Pictures are as good as a film, and need no mention.
    let nouns: Vec<&str> = wanted.iter().filter(|k| **k != Kind::Pictures).map(|k| k.noun()).collect();
    let (last, before) = nouns.split_last()?;
    let expected =
        if before.is_empty() { (*last).to_owned() } else { format!("{} or {last}", before.join(", ")) };
    let fault = Fault::new(path.display(), format!("it is {}, not {expected}", kind.noun()))
        .of_kind(FaultKind::Unsupported);
    let inside = if kind == Kind::RunFolder { wanted.iter().find_map(|w| part_of(path, *w)) } else { None };
    Some(match inside {
        Some((what, file)) => fault.advice(format!("Give its {what}, {}", file.display())),
        None => fault.advice(kind.towards(wanted, path).unwrap_or_else(|| kind.next(path))),
    })
}

/// Refuses what is none of what is wanted, as the error of the part that reads it.
///
/// # Errors
/// The error that `part` makes of it.
pub fn expect(path: &Path, wanted: &[Kind], part: fn(Fault) -> Error) -> Result<()> {
    misplaced(path, wanted).map_or(Ok(()), |fault| Err(part(fault)))
}

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

/// The first array in a NumPy archive, by its name; `None` where it cannot be read.
fn numpy_array(path: &Path) -> Option<String> {
    let mut bytes = Vec::new();
    File::open(path).ok()?.take(BEGINNING).read_to_end(&mut bytes).ok()?;
    let name = std::str::from_utf8(first_part(&bytes)).ok()?;
    Some(name.strip_suffix(".npy")?.to_owned())
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
    if has("slope_v_per_rad") {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_known_by_what_is_in_it_and_not_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let zip = |name: &str| {
            let mut bytes = [&b"PK\x03\x04"[..], &[0; 22], &[name.len() as u8, 0, 0, 0]].concat();
            bytes.extend(name.as_bytes());
            bytes
        };
        let cases: [(&str, &[u8], Kind); 20] = [
            ("a.csv", b"\0\0\0\x18ftypisom", Kind::Film),
            ("b.mp4", b"time_s,phi1_rad\n0,1\n", Kind::Angles),
            ("c.csv", b"# made by hand\ntime_s;phi1_deg;phi2_deg\n", Kind::Angles),
            ("d.csv", b"frame,time_s,node,body,x_px,y_px,sigma_px,area_px,status\n", Kind::NodeTable),
            ("e.csv", b"frame,time_s,node,body,x_px,y_px,visible\n", Kind::Truth),
            ("f.txt", b"\xef\xbb\xbftime_s,voltage_v\n", Kind::Encoder),
            ("g.bin", b"TDSm....", Kind::Encoder),
            ("h.toml", b"schema = 1\n[[node]]\nname = 'n0'\n", Kind::Rig),
            ("i.toml", b"[[part]]\nname = 'bar'\n", Kind::Model),
            ("j.toml", b"frames = 4\n[camera]\ndepth_bits = 8\n", Kind::Scene),
            ("j.toml", b"[[marker]]\nradius_px = 3\n", Kind::Scene),
            ("j.toml", b"inputs = []\nmarker = ['3,4@5']\n", Kind::Config),
            ("k.json", b"{\"schema\": 1, \"slope_v_per_rad\": 0.1}", Kind::Calibration),
            ("l.xlsx", &zip("[Content_Types].xml"), Kind::Spreadsheet),
            ("l.npz", &zip("phi.npy"), Kind::NumpyArchive),
            ("l.zip", &zip("arrays/phi.npy"), Kind::NumpyArchive),
            ("l.mp4", &zip("drop.mp4"), Kind::Compressed),
            ("o.mp4", b"\x1f\x8b\x08....", Kind::Compressed),
            ("m.txt", b"Dear all,\nthe pendulum is broken.\n", Kind::Unknown),
            ("n.html", b"<!DOCTYPE html>\n", Kind::Page),
        ];
        for (name, bytes, kind) in cases {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(kind_of(&path), kind, "{name}");
        }
        assert_eq!(kind_of(&folder.path().join("none")), Kind::Unknown);
    }

    #[test]
    fn what_is_misplaced_is_named_with_the_next_command() {
        let folder = tempfile::tempdir().unwrap();
        let film = folder.path().join("my drop.mp4");
        std::fs::write(&film, b"\0\0\0\x18ftypisom").unwrap();
        let said = misplaced(&film, &[Kind::Angles]).unwrap().to_string();
        assert!(said.contains("it is a film, not an angles table. Next: `tracker track '"), "{said}");
        assert!(said.contains("my drop.mp4' -o '") && said.contains("my drop.parquet'`"), "{said}");
        assert!(misplaced(&film, &[Kind::Film]).is_none());
        let archive = folder.path().join("run.npz");
        let part = [&b"PK\x03\x04"[..], &[0; 22], &[7, 0, 0, 0], b"phi.npy"].concat();
        std::fs::write(&archive, part).unwrap();
        let said = misplaced(&archive, &[Kind::Angles]).unwrap().to_string();
        assert!(
            said.contains("it is a NumPy archive (.npz), not an angles table. Write its arrays as"),
            "{said}"
        );
        assert!(said.contains("run.npy\", numpy.load(") && said.ends_with("run.npz\")[\"phi\"])"), "{said}");
        for kind in Kind::ALL {
            assert!(kind == Kind::Unknown || !kind.next(&film).is_empty(), "{kind:?}");
        }
    }
}
