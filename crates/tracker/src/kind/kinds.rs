//! The kinds of files and folders, with their names.
//!
//! Owns: [`Kind`]. Must not: look at a file.

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
    /// Decisions of people about a film's markers.
    Edits,
    /// A scene to film.
    Scene,
    /// A pendulum's parts or constants.
    Model,
    /// Options of an analysis.
    Config,
    /// A folder that an analysis wrote.
    RunFolder,
    /// A folder that a damping fit wrote.
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
    pub const ALL: [Self; 20] = [
        Self::Film,
        Self::Pictures,
        Self::NodeTable,
        Self::Truth,
        Self::Angles,
        Self::Encoder,
        Self::Tables,
        Self::Calibration,
        Self::Rig,
        Self::Edits,
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
            Self::Edits => "edits",
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
            Self::Edits => "a file of edits",
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
}
