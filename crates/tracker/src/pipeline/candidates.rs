//! Candidates among what moves, for a picture with numbers and for words: where it is unclear which are meant, and where more
//! moves than is followed.
//!
//! Owns: [`Candidates`], [`Candidate`]. Must not: draw, or decide.

use crate::message::{Message, Setting};
use crate::moving::{Marker, Model, Spot, WorkFilm};

/// The candidates of a recording, in its pixels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Candidates {
    /// The frame in which most of them are seen.
    pub frame: u64,
    /// All of them, by number.
    pub all: Vec<Candidate>,
}

/// Something that may be a marker.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Its number in the picture, from 1 on.
    pub number: usize,
    /// Where it is in `frame`, px.
    pub x_px: f64,
    /// Where it is in `frame`, px.
    pub y_px: f64,
    /// A frame in which it is seen: the picture's, if it is seen there.
    pub frame: u64,
    /// Its radius, px.
    pub radius_px: f64,
    /// All its places in order, px; none where no path holds.
    pub path_px: Vec<[f64; 2]>,
    /// Whether it is followed.
    pub followed: bool,
    /// How it looks, where it is seen, and why it is not followed.
    pub words: String,
}

impl Candidate {
    /// Its place as the setting takes it: `312,201@57`.
    pub fn place(&self) -> String {
        format!("{:.0},{:.0}@{}", self.x_px, self.y_px, self.frame)
    }

    /// A line for people.
    pub fn line(&self) -> String {
        format!("{}, at {}: {}", self.number, self.place(), self.words)
    }

    /// The settings with which a user says that this candidate is meant.
    pub fn advice(&self) -> Message {
        let place = Setting::Marker.set_to(self.place());
        if self.path_px.is_empty() {
            place
        } else {
            place + " or " + Setting::Also.set_to(self.number.to_string())
        }
    }
}

/// A marker's look in words; `scale` is pixels of the recording along one of the work picture.
pub(super) fn look(model: &Model, radius_px: f64, scale: f64) -> String {
    let sign = match (model.direction == crate::moving::Direction::LUMA, model.sign > 0.0) {
        (true, true) => "bright",
        (true, false) => "dark",
        (false, _) => "coloured",
    };
    format!("{sign}, {:.0} px across", 2.0 * radius_px * scale)
}

/// The look of a marker, or that it is followed by its picture, in words.
pub(super) fn words(marker: &Marker, scale: f64) -> String {
    match &marker.model {
        Some(model) => look(model, marker.radius_px, scale),
        None => format!("by its picture, {:.0} px across", 2.0 * marker.radius_px * scale),
    }
}

impl Candidates {
    /// Of markers in their order; `why` says of each, by its place in the order, why it is not followed; `None` where it is.
    pub(super) fn of_markers(
        film: &WorkFilm,
        markers: &[Marker],
        why: impl Fn(usize) -> Option<String>,
    ) -> Self {
        let mut seen = vec![0usize; film.pictures()];
        markers.iter().flat_map(|m| m.track.spots()).for_each(|(k, _)| seen[k] += 1);
        let most = seen.iter().copied().max().unwrap_or(0);
        let picture = seen.iter().position(|n| *n == most).unwrap_or(0);
        let scale = film.shrink() as f64;
        let all = markers
            .iter()
            .enumerate()
            .filter_map(|(i, m)| {
                let (k, spot) = m.track.spots().min_by_key(|(k, _)| k.abs_diff(picture))?;
                let first = m.track.spots().next().map_or(k, |(k, _)| k);
                let last = m.track.spots().last().map_or(k, |(k, _)| k);
                Some(Candidate {
                    number: i + 1,
                    x_px: film.recorded_px(spot.x),
                    y_px: film.recorded_px(spot.y),
                    frame: film.frame_of(k),
                    radius_px: m.radius_px * scale,
                    path_px: m.track.spots().map(|(_, s)| [s.x, s.y].map(|v| film.recorded_px(v))).collect(),
                    followed: why(i).is_none(),
                    words: format!(
                        "{}, seen in {} of {} frames, {} to {}; {}",
                        words(m, scale),
                        m.track.count,
                        film.pictures(),
                        film.frame_of(first),
                        film.frame_of(last),
                        why(i).unwrap_or_else(|| "followed".into())
                    ),
                })
            })
            .collect();
        Self { frame: film.frame_of(picture), all }
    }

    /// Of what stands out in a picture and through which no path holds.
    pub(super) fn of_spots(film: &WorkFilm, picture: usize, spots: &[(Model, Spot)]) -> Self {
        let scale = film.shrink() as f64;
        let frame = film.frame_of(picture);
        let all = spots.iter().enumerate().map(|(i, (model, s))| Candidate {
            number: i + 1,
            x_px: film.recorded_px(s.x),
            y_px: film.recorded_px(s.y),
            frame,
            radius_px: model.radius_px() * scale,
            path_px: Vec::new(),
            followed: false,
            words: format!(
                "{}, {:.0} times the noise; it cannot be followed from frame to frame without doubt",
                look(model, model.radius_px(), scale),
                s.snr
            ),
        });
        Self { frame, all: all.collect() }
    }
}
