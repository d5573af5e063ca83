//! The words and the picture for a recording in which it is not clear which markers are meant.
//!
//! Owns: [`tell`], [`picture_beside`]. Must not: find anything.

use std::path::{Path, PathBuf};

use crate::name::text;
use crate::pipeline::RunSettings;
use crate::{output, setup, source};

use super::watch::Watch;
use super::words::CommandLine;

/// The file of the picture that is drawn in the table's stead.
pub fn picture_beside(output: &Path) -> PathBuf {
    output.with_extension("png")
}

/// Writes the picture of what was found, and a line for each number in it. What keeps the picture from being written is said:
/// the reason why it is drawn is the error that follows.
pub fn tell(settings: &RunSettings, picture: &Path, replace: bool, watch: &mut Watch, front: &CommandLine) {
    let Some(found) = watch.candidates.take().filter(|c| !c.all.is_empty()) else { return };
    let written = source::files(&settings.input)
        .and_then(|files| {
            output::check(&[picture.to_owned()], &files, replace).map_err(crate::error::Error::Film)
        })
        .and_then(|()| setup::picture_of(settings, &found, watch))
        .and_then(|drawn| drawn.save(picture));
    watch.finish();
    match written {
        Ok(()) => {
            front.tell(format!("{}: the picture of what was found in frame {}", text(picture), found.frame))
        }
        Err(error) => front.tell(format!("the picture of what was found is not written: {error}")),
    }
    for candidate in &found.all {
        front.tell(candidate.line());
    }
}
