//! Runs the steps of a run in their order.
//!
//! Owns: [`run`]. Must not: print, read a clock, or do any of the steps' work.

use super::moving::{self, Outcome};
use super::observer::{Observer, Stage};
use super::opening::open;
use super::reading::Run;
use super::request::{Request, already_done, check};
use super::settings::RunSettings;
use super::state;
use super::summary::RunSummary;
use super::unclear::Unclear;
use crate::error::{Error, Fault, FaultKind, Result};
use crate::frame::FrameSource;
use crate::message::Message;

/// Follows the markers of a recording and writes the table. Where none stand out, what moves is followed if it is clear what is
/// meant.
///
/// If the observer asks to stop, the table of what was done so far is written and says so; with an output the
/// state to go on from is kept beside it.
///
/// # Errors
/// The error of the part that failed; [`Error::Interrupted`] if the run was stopped before there was anything to
/// write; [`Error::Table`] if the output is there already.
pub fn run(settings: &RunSettings, observer: &mut dyn Observer) -> Result<RunSummary> {
    if settings.asked().names_what_moves() {
        return run_named(settings, observer);
    }
    let mut unclear = None;
    let markers = run_markers(settings, observer, &mut unclear);
    if !moving::is_wanted(&markers) || !moving::applies(settings) {
        return markers;
    }
    let unclear = match unclear {
        Some(unclear) => unclear,
        None => match moving::run(settings, markers.is_ok(), observer) {
            Ok(Outcome::Followed(summary)) => return Ok(*summary),
            Ok(Outcome::Unclear(unclear)) => unclear,
            Err(Error::Interrupted) => return Err(Error::Interrupted),
            Err(error @ Error::Argument(_)) if settings.edits.is_some() => return Err(error),
            Err(_) => return markers,
        },
    };
    match markers {
        Ok(mut summary) => {
            let why = Message::from(format!(
                "what stands out is seen in few frames or changes its size, and {}. ",
                unclear.why
            ));
            summary.warnings.push(why + unclear.advice);
            Ok(summary)
        }
        Err(error) => Err(error.and_also(&unclear.why, unclear.advice)),
    }
}

/// A run that was begun.
enum Begun {
    /// An earlier run of the same request is complete.
    Done(Box<RunSummary>),
    /// The open recording, and the request on it.
    Open(Box<dyn FrameSource>, Box<Request>),
}

/// Checks the settings, opens the recording and looks for a complete earlier run.
fn begin(settings: &RunSettings, observer: &mut dyn Observer) -> Result<Begun> {
    let files = check(settings)?;
    observer.stage(Stage::Open, None);
    let source = open(&settings.input, &settings.open, observer)?;
    let request = Request::new(settings, source.info(), files)?;
    Ok(match already_done(settings, &request)? {
        Some(done) => Begun::Done(Box::new(done)),
        None => Begun::Open(source, Box::new(request)),
    })
}

/// Follows what was named and only moves: it need not stand out.
fn run_named(settings: &RunSettings, observer: &mut dyn Observer) -> Result<RunSummary> {
    moving::check(settings)?;
    match begin(settings, observer)? {
        Begun::Done(summary) => return Ok(*summary),
        Begun::Open(source, _) => drop(source),
    }
    match moving::run(settings, false, observer)? {
        Outcome::Followed(summary) => {
            settings.output.as_ref().map_or(Ok(()), |output| state::remove(output))?;
            Ok(*summary)
        }
        Outcome::Unclear(unclear) => {
            let fault = Fault::new(&settings.input, unclear.why).of_kind(FaultKind::NothingFound);
            Err(Error::Detect(fault.advice(unclear.advice)))
        }
    }
}

/// Follows markers that stand out. Where what moves was looked at first, why it is `unclear` is told.
fn run_markers(
    settings: &RunSettings,
    observer: &mut dyn Observer,
    unclear: &mut Option<Unclear>,
) -> Result<RunSummary> {
    let (source, request) = match begin(settings, observer)? {
        Begun::Done(summary) => return Ok(*summary),
        Begun::Open(source, request) => (source, *request),
    };
    let (mut run, source) = Run::begin(settings, request, source, observer)?;
    if run.cluttered {
        match moving::run_first(settings, observer)? {
            Outcome::Followed(summary) => {
                settings.output.as_ref().map_or(Ok(()), |output| state::remove(output))?;
                return Ok(*summary);
            }
            Outcome::Unclear(why) => *unclear = Some(why),
        }
    }
    let fresh = run.resumed == 0;
    let outcome = run.detect(source, observer).and_then(|end| run.finish(end, observer, unclear));
    // Only a run that was stopped or ran out of disk can go on; any other would fail again.
    if let (Err(error), Some(output), true) = (&outcome, &settings.output, fresh)
        && !matches!(error, Error::Table(_) | Error::Interrupted)
    {
        let _ = state::remove(output);
    }
    outcome
}
