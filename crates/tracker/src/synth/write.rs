//! Writes a film into a file, or into many.
//!
//! | name ends in | what is written |
//! |---|---|
//! | `.mp4` `.mov` `.mkv` `.avi` | video; H.264, but FFV1 in `.mkv` and uncompressed in `.avi` if not said otherwise |
//! | `.mraw` `.cih` | a Photron pair: 8, packed 10, packed 12 or 16 bit |
//! | `.png` `.tif` `.tiff` `.bmp` with `%05d` or the like in the name | one image per frame |
//! | `.tif` `.tiff` | one file with a page per frame |
//! | `.y4m` | uncompressed, for pipes; the name `-` writes it to standard output |

use std::path::Path;

use rayon::prelude::*;

use super::film::Film;
use super::sink::{Sink, check_folder, files};
use super::truth_table::TruthWriter;
use super::write_options::WriteOptions;
use crate::error::{Error, Result};
use crate::output;

/// Pixels made between two looks at whether to stop: a tenth of a second or two.
const BATCH_PX: u64 = 16 << 20;

/// Writes all frames of a film, and its truth if asked for. Each file takes its name when it is whole. `progress` is
/// told the number of frames done, and stops the work by giving an error.
///
/// # Errors
/// [`Error::Film`] if the name's ending is not known, a file is there already or is one that is read, the format cannot
/// hold the film, or writing fails; what `progress` gives.
pub fn write(
    film: &Film,
    path: &Path,
    options: &WriteOptions,
    progress: &mut dyn FnMut(u64) -> Result<()>,
) -> Result<()> {
    options.check(path)?;
    check_folder(film, path)?;
    let mut outputs = files(film, path);
    outputs.extend(options.truth.clone());
    output::check(&outputs, &options.reads, options.replace).map_err(Error::Film)?;
    let mut truth =
        options.truth.as_deref().map(|p| TruthWriter::create(p, film, options.cells)).transpose()?;
    let mut sink = Sink::create(film, path, options)?;
    let workers = threads::count() as u64;
    let [w, h] = film.scene().image_px.map(u64::from);
    let batch = (BATCH_PX / (w * h).max(1)).clamp(workers, 4 * workers);
    let mut first = 0;
    while first < film.frames() {
        let end = film.frames().min(first + batch);
        let with_truth = truth.is_some();
        let one = |i| {
            let mut samples = Vec::new();
            film.render(i, &mut samples);
            (samples, with_truth.then(|| film.truth(i)))
        };
        let made: Vec<_> = threads::install(|| (first..end).into_par_iter().map(one).collect());
        for ((samples, true_frame), done) in made.iter().zip(first + 1..) {
            sink.write(film, samples)?;
            if let (Some(table), Some(t)) = (&mut truth, true_frame) {
                table.write(t)?;
            }
            if let Err(stopped) = progress(done) {
                sink.abandon();
                return Err(stopped);
            }
        }
        first = end;
    }
    sink.finish()?;
    truth.map_or(Ok(()), TruthWriter::finish)
}
