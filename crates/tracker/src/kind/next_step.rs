//! The next step with a file of each kind: a command of the programs and a call of Python.
//!
//! Owns: `Kind::next`, `Kind::towards`, `part_of`. Must not: say what is wrong with a file.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::kinds::Kind;
use crate::message::{Message, Step};
use crate::name::{python_word, shell_word, text};
use crate::packed::{first_part, unpacking};

impl Kind {
    /// The step that makes a file of a wanted kind of this one, where that is not its next step anyway.
    pub(super) fn towards(self, wanted: &[Self], path: &Path) -> Option<Message> {
        let name = text(path);
        let (file, name) = (shell_word(&name), python_word(&name));
        let step = |command: String, call: String| {
            Some("Next: " + Message::from(Step { command: command.into(), call: call.into() }))
        };
        match self {
            Self::Film | Self::Pictures | Self::NodeTable | Self::Angles
                if wanted.contains(&Self::RunFolder) =>
            {
                let options = format!("pydpend.analyse.Options(inputs=({name},))");
                step(
                    format!("pydpend analyse {file} -o run/"),
                    format!("pydpend.analyse.analyse({options}, 'run')"),
                )
            }
            Self::Film | Self::Pictures if wanted.contains(&Self::Angles) => {
                let stem = shell_word(text(path.with_extension("")).trim_end_matches('/'));
                let (nodes, angles) = (joined(&stem, ".parquet"), joined(&stem, "-angles.parquet"));
                let then = Step {
                    command: format!("pydpend angles {nodes} -o {angles}").into(),
                    call: "dp.angles(nodes)".into(),
                };
                Some(self.next(path) + ", then " + Message::from(then) + ", and give what that makes")
            }
            // No film leads to a calibration.
            Self::Film | Self::Pictures | Self::NodeTable | Self::Truth | Self::Angles
                if wanted.contains(&Self::Tables) =>
            {
                let holds = step(
                    "pydpend calibrate HOLDS -o encoder.json".to_owned(),
                    "dp.calibrate(dp.read_holds(paths))".to_owned(),
                );
                holds.map(|next| next + ", with recordings of the encoder held still at known angles")
            }
            Self::Encoder if wanted.contains(&Self::Calibration) => step(
                format!("pydpend calibrate {file} -o encoder.json"),
                format!("dp.calibrate(dp.read_holds([{name}]))"),
            ),
            _ => None,
        }
    }

    /// The next step with the file.
    pub(super) fn next(self, path: &Path) -> Message {
        let name = text(path);
        let (file, name) = (shell_word(&name), python_word(&name));
        let stem = shell_word(text(path.with_extension("")).trim_end_matches('/'));
        let type_this = |command: String, call: String| {
            "Next: " + Message::from(Step { command: command.into(), call: call.into() })
        };
        match self {
            Self::Film | Self::Pictures => type_this(
                format!("pydpend track {file} -o {}", joined(&stem, ".parquet")),
                format!("dp.track({name})"),
            ),
            Self::NodeTable => type_this(
                format!("pydpend angles {file} -o {}", joined(&stem, "-angles.parquet")),
                format!("dp.angles(dp.read_nodes({name}))"),
            ),
            Self::Truth => {
                type_this(format!("pydpend score NODES {file}"), format!("dp.score(nodes, {name})"))
            }
            Self::Angles => type_this(
                format!("pydpend fit {file} -o {}", joined(&stem, "-damping/")),
                format!("dp.fit_damping(dp.read_angles({name}), model)"),
            ),
            Self::Encoder => type_this(
                format!("pydpend compare ANGLES {file} --calibration HOLDS -o compared/"),
                format!("dp.compare(angles, dp.encoder_angles(dp.read_encoder({name}), calibration))"),
            ),
            Self::Tables => type_this(
                format!("pydpend calibrate {file} -o encoder.json"),
                format!("dp.calibrate(dp.read_holds([{name}]))"),
            ),
            Self::Calibration => type_this(
                format!("pydpend compare ANGLES ENCODER --calibration {file} -o compared/"),
                format!("dp.read_calibration({name})"),
            ),
            Self::Rig => type_this(
                format!("pydpend track FILM --rig {file} -o nodes.parquet"),
                format!("dp.track(film, {name})"),
            ),
            Self::Edits => "Next: " + with_edits(&file, &name),
            Self::Scene => {
                type_this(format!("pydpend film {file} -o film.mp4"), format!("dp.film({name}, 'film.mp4')"))
            }
            Self::Model => type_this(
                format!("pydpend fit ANGLES --model {file} -o damping/"),
                format!("dp.read_model({name})"),
            ),
            Self::Config => type_this(
                format!("pydpend analyse --config {file} -o run/"),
                format!("pydpend.analyse.read_config({name})"),
            ),
            Self::RunFolder => {
                let angles = part_of(path, Self::Angles).map_or_else(|| path.to_owned(), |(_, file)| file);
                let inside = python_word(&text(angles));
                Message::from(format!("Its page is {}. ", text(path.join("report.html"))))
                    + type_this(
                        format!("pydpend plot energy {file} -o energy.pdf"),
                        format!("dp.read_angles({inside})"),
                    )
            }
            Self::Fit => type_this(
                format!("pydpend predict ANGLES --fit {file} -o predicted/"),
                format!("pydpend.fit_folder.load_fit({name})"),
            ),
            Self::Page => "Open it in a browser".into(),
            Self::Spreadsheet => "Save it as CSV with a header line".into(),
            Self::NumpyArchive => {
                let array = numpy_array(path).unwrap_or_else(|| "NAME".to_owned());
                let array = python_word(&array);
                let out = python_word(&text(path.with_extension("npy")));
                format!(
                    "Write its arrays as columns of a CSV with a header line, or one array as .npy in Python: \
                     numpy.save({out}, numpy.load({name})[{array}])"
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

/// Tracking with a file of edits.
fn with_edits(file: &str, name: &str) -> Message {
    let command = format!("pydpend track FILM --edits {file} -o nodes.parquet");
    Step { command: command.into(), call: format!("dp.track(film, edits={name})").into() }.into()
}

/// A stem with an ending, quoted once.
fn joined(stem: &str, ending: &str) -> String {
    stem.strip_suffix('\'').map_or_else(|| format!("{stem}{ending}"), |open| format!("{open}{ending}'"))
}

/// The noun and path of a run folder's file of a kind: that of the first recording.
pub(super) fn part_of(folder: &Path, wanted: Kind) -> Option<(&'static str, PathBuf)> {
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

/// Bytes of a NumPy archive in which the name of its first array stands.
const BEGINNING: u64 = 1 << 16;

/// The first array in a NumPy archive, by its name; `None` where it cannot be read.
fn numpy_array(path: &Path) -> Option<String> {
    let mut bytes = Vec::new();
    File::open(path).ok()?.take(BEGINNING).read_to_end(&mut bytes).ok()?;
    let name = std::str::from_utf8(first_part(&bytes)).ok()?;
    Some(name.strip_suffix(".npy")?.to_owned())
}
