//! Tells a person of the frames' times.

use super::facts::{Doubt, Timing, TimingKind};
use crate::frame::RateOrigin;
use crate::message::{Message, Setting};

/// Least rounding that is worth a word, as a share of the time between frames.
const COARSE: f64 = 1e-3;
/// Least variation of the rate that is worth a word, as a share of the rate.
const UNEVEN: f64 = 1e-3;
/// The rate of slow motion that a doubt is explained by, frames per second.
const SLOW_MOTION_HZ: f64 = 240.0;

/// A number with so many significant digits and no zeros at its end.
fn digits(value: f64, count: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let places = count - 1 - value.abs().log10().floor() as i32;
    let scale = 10f64.powi(places.min(300));
    format!("{}", (value * scale).round() / scale)
}

/// A length of time with its unit.
fn length(seconds: f64) -> String {
    let (scale, unit) = match seconds {
        s if s >= 1.0 => (1.0, "s"),
        s if s >= 1e-3 => (1e3, "ms"),
        s if s >= 1e-6 => (1e6, "us"),
        _ => (1e9, "ns"),
    };
    format!("{} {unit}", digits(seconds * scale, 3))
}

/// `value` and what it counts.
fn counted(value: u64, one: &str, many: &str) -> String {
    format!("{value} {}", if value == 1 { one } else { many })
}

fn range([slowest, fastest]: [f64; 2]) -> String {
    let (a, b) = (digits(slowest, 3), digits(fastest, 3));
    if a == b {
        format!("{} to {} per s", digits(slowest, 6), digits(fastest, 6))
    } else {
        format!("{a} to {b} per s")
    }
}

/// The rate, with its uncertainty.
fn per_second(timing: &Timing) -> String {
    match (timing.rate_hz, timing.rate_sigma_hz) {
        (None, _) => "an unknown rate".to_owned(),
        (Some(hz), None) => format!("{} frames per s", digits(hz, 6)),
        (Some(hz), Some(sigma)) => {
            let count = (hz / sigma).log10().floor() as i32 + 2;
            format!("{} +- {} frames per s", digits(hz, count.clamp(2, 12)), digits(sigma, 1))
        }
    }
}

/// The rate with where it comes from, for a person.
pub fn rate_words(timing: &Timing) -> Message {
    let origin: Message = match timing.rate_origin {
        RateOrigin::User => "as given with " + Setting::Fps,
        RateOrigin::TimeStamps => "from the frames' time stamps".into(),
        RateOrigin::CameraHeader => "from the camera's header".into(),
        RateOrigin::CaptureTag => "by the camera's own tag".into(),
        RateOrigin::Container => {
            let by = if timing.rate_from_stamps { "by the time stamps" } else { "as the container says" };
            let player = ", which may be a player's speed and not the camera's";
            format!("{by}{}", if timing.doubt.is_some() { player } else { "" }).into()
        }
        RateOrigin::Unknown => return "unknown".into(),
    };
    let rate = match (timing.rate_hz, timing.range_hz) {
        (None, _) => return origin,
        (Some(hz), Some(ends)) if ends[1] - ends[0] > UNEVEN * ends[1] => {
            format!("variable, {} ({} on average)", range(ends), digits(hz, 4))
        }
        (Some(hz), _) if timing.rate_sigma_hz.is_none() => format!("{} frames per second", digits(hz, 9)),
        _ => per_second(timing),
    };
    Message::from(rate) + ", " + origin
}

/// The kind and rate of the times, in words.
pub fn times_words(timing: &Timing) -> String {
    match timing.kind {
        TimingKind::Given => "frame numbers over the rate that was given".to_owned(),
        TimingKind::Even => match timing.rate_origin {
            RateOrigin::CameraHeader => "frame numbers over the camera's rate".to_owned(),
            RateOrigin::Unknown => "frame numbers".to_owned(),
            _ if timing.gaps > 0 => {
                format!("the time stamps, which are even but for {}", counted(timing.gaps, "gap", "gaps"))
            }
            _ => "the time stamps, which are even".to_owned(),
        },
        TimingKind::Variable => stamps(timing),
        TimingKind::Grid => format!(
            "an even grid of {}, within one tick ({}) of {} time stamps",
            per_second(timing),
            length(timing.tick_s),
            if timing.stray == 0 { "all" } else { "nearly all" }
        ),
    }
}

fn stamps(timing: &Timing) -> String {
    format!(
        "the time stamps, each with a standard uncertainty of {} (a tick of {} over sqrt(12))",
        length(timing.sigma_s),
        length(timing.tick_s)
    )
}

/// Sentences on the grid.
fn grid(timing: &Timing) -> Vec<String> {
    let mut said = vec![format!(
        "the time stamps, rounded to {}, lie within one tick of an even grid of {}, and the times are that grid's",
        length(timing.tick_s),
        per_second(timing)
    )];
    said.extend(lacking(timing));
    if timing.stray > 0 {
        said.push(format!(
            "{} at the ends {} not on the grid and {} as {} {}",
            counted(timing.stray, "time stamp", "time stamps"),
            if timing.stray == 1 { "is" } else { "are" },
            if timing.stray == 1 { "stays" } else { "stay" },
            if timing.stray == 1 { "it" } else { "they" },
            if timing.stray == 1 { "is" } else { "are" },
        ));
    }
    said
}

fn lacking(timing: &Timing) -> Option<String> {
    (timing.gaps > 0).then(|| {
        format!(
            "the even grid of {} has {}, where {} between the others; the times keep their places",
            per_second(timing),
            counted(timing.gaps, "gap", "gaps"),
            counted(timing.lacking, "frame lacks", "frames lack"),
        )
    })
}

/// The notes on the times, a sentence each.
pub fn notes(timing: &Timing) -> Vec<Message> {
    let mut notes: Vec<Message> = Vec::new();
    match timing.kind {
        TimingKind::Grid => {
            let step_s = timing.rate_hz.map_or(f64::INFINITY, |hz| 1.0 / hz);
            if timing.tick_s > COARSE * step_s || timing.stray > 0 {
                notes.extend(grid(timing).into_iter().map(Message::from));
            } else {
                notes.extend(lacking(timing).map(Message::from));
            }
        }
        TimingKind::Variable => {
            if let Some(ends) = timing.range_hz.filter(|[a, b]| b - a > UNEVEN * b) {
                let said = format!("variable frame rate, {}: the times are {}", range(ends), stamps(timing));
                notes.push(said.into());
            }
        }
        TimingKind::Even => notes.extend(lacking(timing).map(Message::from)),
        TimingKind::Given => {}
    }
    if let Some(capture) = &timing.capture {
        let (tag, hz) = (&capture.tag, digits(capture.rate_hz, 6));
        if let Some(plays) = timing.plays_at_hz {
            let plays = digits(plays, 4);
            let said = format!("{hz} frames per s by the camera's own tag {tag}; the file plays at {plays}");
            notes.push(said.into());
        } else if !capture.used {
            let stamps = timing.rate_hz.map_or("nothing".to_owned(), |hz| digits(hz, 4));
            let said = format!(
                "the tag {tag} says {hz} frames per s, the time stamps {stamps}: the tag is not used"
            );
            notes.push(said.into());
        }
    }
    notes.extend(doubt(timing));
    notes
}

/// The note on a rate that may be wrong.
fn doubt(timing: &Timing) -> Option<Message> {
    let (Doubt::Player, Some(hz)) = (timing.doubt?, timing.rate_hz) else {
        return Some(
            "nothing gives its frame rate, so times count frames. Give the camera's with " + Setting::Fps,
        );
    };
    let camera = timing.camera.as_ref().map_or(String::new(), |c| format!(" (camera: {c})"));
    let said = format!(
        "its {} frames per s may be a player's rate and not the camera's{camera}: if it was filmed at {} frames per s, \
         every rate is {} times too small. Give the camera's rate, if it was another, with ",
        digits(hz, 4),
        digits(SLOW_MOTION_HZ, 4),
        digits(SLOW_MOTION_HZ / hz, 3),
    );
    Some(Message::from(said) + Setting::Fps)
}
