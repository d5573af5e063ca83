//! Decides what the frames' times are, from the time stamps of a whole recording or of as much as was looked at.
//!
//! Owns: [`times`], [`survey`]. Must not: decode.

use crate::error::{Error, Fault, Place, Result};
use crate::frame::{FrameSource, SourceInfo};
use crate::message::Setting;
use crate::timing::{Clock, Steps, Timing, decide};

/// The times of frames with these stamps; `first` is the index of the first frame.
///
/// # Errors
/// [`Error::Source`] if two frames have one time stamp and the stamps are not those of an even grid.
pub fn times(info: &SourceInfo, steps: &Steps, first: u64) -> Result<(Timing, Clock)> {
    decide(steps, info.time_base, info.rate_origin, &info.claims, info.rate_hz).map_err(|still| {
        let problem = format!(
            "its time stamp, tick {}, is that of the frame before it, and the stamps are not those of an even rate",
            still.ticks
        );
        Error::Source(
            Fault::new(&info.name, problem)
                .at(Place::Frame(first + still.place))
                .advice("Give the rate with " + Setting::Fps + ", which replaces the time stamps"),
        )
    })
}

/// Time stamps of a recording without decoding it, and whether these are all; `None` where they are not to be had so.
///
/// # Errors
/// Where the recording cannot be read at all.
pub fn survey(source: &mut dyn FrameSource) -> Result<Option<(Steps, bool)>> {
    let Some((stamps, is_whole)) = source.stamps()? else { return Ok(None) };
    let mut steps = Steps::default();
    for ticks in stamps {
        steps.push(ticks);
    }
    Ok(Some((steps, is_whole)))
}
