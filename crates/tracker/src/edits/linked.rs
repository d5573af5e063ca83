//! Follows what a person named from the frame in which it was pointed at, through detections or through rows.
//!
//! Owns: [`follow`], [`Seen`]. Must not: jump over a frame in which it is not certain.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::Vector2;

use crate::camera::Plane;
use crate::detect::{Detection, Flags};
use crate::error::Result;
use crate::link::Linker;
use crate::observation::{Observation, PART_SIGMA_PX, Status};
use crate::store::{DetectionStore, FrameStamp};

/// The spots of each frame among which one is named.
#[derive(Debug, Clone, Copy)]
pub enum Seen<'a> {
    /// Detections of markers.
    Detections(&'a DetectionStore),
    /// Rows of what was followed without detections, before any decision, and the frames' stamps.
    Rows(&'a [FrameStamp], &'a [Vec<Observation>]),
}

impl Seen<'_> {
    /// The first frame that was read, and one past the last.
    pub fn frames(&self) -> Range<u64> {
        let stamps = match self {
            Seen::Detections(store) if store.is_empty() => None,
            Seen::Detections(store) => Some((store.stamp(0), store.stamp(store.len() - 1))),
            Seen::Rows(stamps, _) => stamps.first().copied().zip(stamps.last().copied()),
        };
        stamps.map_or(0..0, |(first, last)| first.index..last.index + 1)
    }

    /// Whether a frame was read and decoded.
    pub fn is_decoded(&self, frame: u64) -> bool {
        match self {
            Seen::Detections(store) => {
                let k = place_of(store, frame);
                k < store.len() && store.stamp(k).index == frame && store.stamp(k).decoded
            }
            Seen::Rows(stamps, _) => {
                stamps.binary_search_by_key(&frame, |s| s.index).is_ok_and(|k| stamps[k].decoded)
            }
        }
    }
}

/// The place in a store of the first frame of at least this index.
fn place_of(store: &DetectionStore, index: u64) -> usize {
    let (mut low, mut high) = (0, store.len());
    while low < high {
        let middle = usize::midpoint(low, high);
        if store.stamp(middle).index < index {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    low
}

/// Why nothing is named.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Nothing {
    /// The frame was not read.
    NoFrame,
    /// Nothing is detected there; the nearest is so far away, px, if there is one.
    NotThere(Option<f64>),
}

/// A place that was pointed at may be so far from the centre at least, px: a person points no better.
const LEAST_REACH_PX: f64 = 2.0;

/// The places by frame of what is at `at_px` (recorded) of `frame`, in the `frames` around as far as it can be followed.
pub fn follow(
    seen: Seen<'_>,
    frame: u64,
    at_px: [f64; 2],
    frames: &Range<u64>,
) -> Result<std::result::Result<BTreeMap<u64, Observation>, Nothing>> {
    match seen {
        Seen::Detections(store) => through_detections(store, frame, at_px, frames),
        Seen::Rows(stamps, rows) => Ok(through_rows(stamps, rows, frame, at_px, frames)),
    }
}

/// The nearest of some places, and whether it is near enough to be meant: within its own radius.
fn nearest(
    places: impl Iterator<Item = (f64, f64, f32)>,
    [x, y]: [f64; 2],
) -> std::result::Result<usize, Nothing> {
    let off = places.map(|(px, py, area)| ((px - x).hypot(py - y), area)).enumerate();
    let found = off.filter(|(_, (far, _))| far.is_finite()).min_by(|a, b| a.1.0.total_cmp(&b.1.0));
    match found {
        Some((k, (far, area))) => {
            let radius = (f64::from(area.max(0.0)) / std::f64::consts::PI).sqrt();
            if far <= radius.max(LEAST_REACH_PX) { Ok(k) } else { Err(Nothing::NotThere(Some(far))) }
        }
        None => Err(Nothing::NotThere(None)),
    }
}

fn through_detections(
    store: &DetectionStore,
    frame: u64,
    at_px: [f64; 2],
    frames: &Range<u64>,
) -> Result<std::result::Result<BTreeMap<u64, Observation>, Nothing>> {
    let plane = Plane { pixel_aspect: store.pixel_aspect(), camera: None };
    let here = place_of(store, frame);
    if here >= store.len() || store.stamp(here).index != frame {
        return Ok(Err(Nothing::NoFrame));
    }
    let mut detections: Vec<Detection> = Vec::new();
    store.read(here, &mut detections);
    let at: Vector2<f64> = plane.pixel_aspect.to_square(Vector2::from(at_px));
    let which = match nearest(detections.iter().map(|d| (d.x_px, d.y_px, d.area_px)), at.into()) {
        Ok(k) => detections[k],
        Err(nothing) => return Ok(Err(nothing)),
    };
    let mut linker = Linker::default();
    let (first, last) = (place_of(store, frames.start), place_of(store, frames.end));
    for i in first..last {
        store.read(i, &mut detections);
        linker.push(i, &detections);
    }
    let is_it = |p: Vector2<f64>, d: &Detection| p.x == d.x_px && p.y == d.y_px;
    let tracklet = linker.finish().into_iter().find(|t| t.at(here).is_some_and(|p| is_it(p.place, &which)));
    let mut out = BTreeMap::from([(frame, observation(&which, &plane))]);
    if let Some(tracklet) = tracklet {
        for (k, point) in tracklet.points.iter().enumerate().map(|(k, p)| (tracklet.first + k, p)) {
            store.read(k, &mut detections);
            if let Some(d) = detections.iter().find(|d| is_it(point.place, d)) {
                out.insert(store.stamp(k).index, observation(d, &plane));
            }
        }
    }
    store.check()?;
    Ok(Ok(out))
}

fn observation(d: &Detection, plane: &Plane) -> Observation {
    let doubt = d.flags.has(Flags::PARTIAL | Flags::MERGED | Flags::BORDER);
    let square = Observation {
        x_px: d.x_px,
        y_px: d.y_px,
        sigma_px: if doubt { d.sigma_px.hypot(PART_SIGMA_PX) } else { d.sigma_px },
        area_px: d.area_px,
        status: Status::Manual,
    };
    square.to_recorded(plane)
}

fn through_rows(
    stamps: &[FrameStamp],
    rows: &[Vec<Observation>],
    frame: u64,
    at_px: [f64; 2],
    frames: &Range<u64>,
) -> std::result::Result<BTreeMap<u64, Observation>, Nothing> {
    let here = stamps.binary_search_by_key(&frame, |s| s.index).map_err(|_| Nothing::NoFrame)?;
    let column = nearest(rows[here].iter().map(|o| (o.x_px, o.y_px, o.area_px)), at_px)?;
    let goes_on = |k: &usize| rows[*k][column].status.is_seen() && frames.contains(&stamps[*k].index);
    let back = (0..here).rev().take_while(goes_on);
    let on = (here..rows.len()).take_while(goes_on);
    let named = |k: usize| (stamps[k].index, Observation { status: Status::Manual, ..rows[k][column] });
    Ok(back.chain(on).map(named).collect())
}
