//! Python module `pydpend._native`: converts arguments, releases the GIL, maps errors. No algorithm.
//!
//! Each area has its file and is registered by one line in the module below; `python/pydpend` wraps it all.

mod arrays;
mod command;
mod dynamics;
mod errors;
mod film;
mod frames;
mod images;
mod laws;
mod live;
mod rig;
mod settings;
mod shooting;
mod simulation;
mod smoothing;
mod tables;
mod track;
mod watch;

use pyo3::prelude::*;

/// The compiled half of pydpend; private.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::command::{command, commands};
    #[pymodule_export]
    use super::film::{EncodeSettings, PyFilm, score_places};
    #[pymodule_export]
    use super::frames::FrameReader;
    #[pymodule_export]
    use super::live::{LiveTracker, detect};
    #[pymodule_export]
    use super::rig::{plane_places, plane_slopes, read_rig, recorded_places, rig_toml, write_rig};
    #[pymodule_export]
    use super::settings::{
        OutputSettings, OverlaySettings, PyDetectSettings, PyOpenOptions, PyWanted, setting_words,
    };
    #[pymodule_export]
    use super::simulation::{
        IntegratorSettings, SimulatedMotion, poincare_section, simulate_ensemble, simulate_motion,
        tangent_growth,
    };
    #[pymodule_export]
    use super::smoothing::{learn_noise, smooth_angles};
    #[pymodule_export]
    use super::tables::{
        arrow_reader, check_table, damage_words, edited_table, kind_of, misplaced, read_meta, read_table,
        write_table,
    };
    #[pymodule_export]
    use super::track::{
        check_outputs, fingerprint, frame_range, info, overlay_film, recording_files, setup, track,
    };

    #[pymodule_export]
    use super::dynamics::{follow_motion, unit_powers};
    #[pymodule_export]
    use super::laws::{PyLaw, PyRatio, laws, ratios};
    #[pymodule_export]
    use super::shooting::{ShootingFit, ShootingSettings, shooting_fit, shooting_segments, shooting_trace};

    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
    #[pymodule_export]
    const CAMERA_BY_EYE: [f64; tracker::camera::NUMBERS] = tracker::camera::BY_EYE;
}
