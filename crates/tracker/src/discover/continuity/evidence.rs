//! Looks at tracklets in frames that differ.
//!
//! Owns: [`Evidence`]. Must not: decide what belongs together.

use std::ops::Range;

use nalgebra::Vector2;

use crate::camera::Camera;
use crate::error::Result;
use crate::link::Tracklet;
use crate::stop::Stop;

/// A frame tells something new once a marker has moved so far since the last that did, px: what stands still keeps its
/// distances whether it is rigid or not.
const NEW_PX: f64 = 1.0;
/// Frames looked at, at most.
const FRAMES: usize = 1000;
/// Tracklets looked at, at most: those seen in most frames.
const TRACKLETS: usize = 160;
/// A marker that stays within this does not move, px.
const STILL_PX: f64 = 3.0;
/// Part of the usual area below which a marker is half hidden: its centre is off by a tenth of its radius.
const HALF_HIDDEN: f32 = 0.85;
/// Part of the usual area above which a marker runs together with something.
const SWOLLEN: f32 = 1.5;
/// Centres are not better than this, px: an edge pixel's level is rounded.
const LEAST_SIGMA_PX: f64 = 0.01;

/// Tracklets in frames that differ, in the plane.
#[derive(Debug)]
pub struct Evidence<'a> {
    /// Moving tracklets, those seen in most frames first.
    pub tracklets: Vec<&'a Tracklet>,
    /// Indices of the frames in the store.
    pub frames: Vec<usize>,
    /// For each tracklet the frames (places in `frames`) in which it is.
    pub spans: Vec<Range<usize>>,
    /// For each tracklet its centre in each frame of its span, px; `None` where it is not whole.
    places: Vec<Vec<Option<Vector2<f64>>>>,
    /// Standard uncertainty of each coordinate of a centre, px.
    pub sigma_px: f64,
    /// Whether each tracklet is known to be a marker: then an arc tells of a body, however short the recording.
    pub are_markers: bool,
}

impl<'a> Evidence<'a> {
    /// Looks at tracklets.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] once `stop` was asked for.
    pub fn new(tracklets: &'a [Tracklet], stop: &Stop) -> Result<Self> {
        let mut moving: Vec<&Tracklet> = tracklets.iter().filter(|t| t.extent_px() > STILL_PX).collect();
        let frames = frames(&moving, stop)?;
        let span =
            |t: &Tracklet| frames.partition_point(|&f| f < t.first)..frames.partition_point(|&f| f < t.end());
        moving.retain(|t| !span(t).is_empty());
        moving.sort_by_key(|t| (std::cmp::Reverse(span(t).len()), t.first));
        moving.truncate(TRACKLETS);
        let spans: Vec<Range<usize>> = moving.iter().map(|t| span(t)).collect();
        let places = moving
            .iter()
            .zip(&spans)
            .map(|(t, span)| {
                let usual = t.usual_area_px();
                let whole = |p: &&crate::link::Point| {
                    p.whole && p.area_px > HALF_HIDDEN * usual && p.area_px < SWOLLEN * usual
                };
                span.clone().map(|k| t.at(frames[k]).filter(whole).map(|p| p.place)).collect()
            })
            .collect();
        let sigma_px = noise(&moving);
        Ok(Self { tracklets: moving, frames, spans, places, sigma_px, are_markers: false })
    }

    /// The evidence in the plane of a camera.
    pub fn through(&self, camera: Option<&Camera>) -> Self {
        let seen = |p: &Option<Vector2<f64>>| p.map(|p| camera.map_or(p, |c| c.to_plane(p)));
        Self {
            tracklets: self.tracklets.clone(),
            frames: self.frames.clone(),
            spans: self.spans.clone(),
            places: self.places.iter().map(|t| t.iter().map(seen).collect()).collect(),
            sigma_px: self.sigma_px,
            are_markers: self.are_markers,
        }
    }

    /// The place of tracklet `t` in the `k`-th frame looked at, if it is whole there.
    pub fn place(&self, t: usize, k: usize) -> Option<Vector2<f64>> {
        self.places[t].get(k.checked_sub(self.spans[t].start)?).copied().flatten()
    }

    /// Frames in which both are.
    pub fn shared(&self, a: usize, b: usize) -> Range<usize> {
        let (a, b) = (&self.spans[a], &self.spans[b]);
        a.start.max(b.start)..a.end.min(b.end)
    }

    /// Whether both are in one frame of the recording, and so are two markers.
    pub fn coexist(&self, a: usize, b: usize) -> bool {
        let (a, b) = (self.tracklets[a], self.tracklets[b]);
        a.first < b.end() && b.first < a.end()
    }
}

/// Frames in which some marker is elsewhere than in the one before.
fn frames(moving: &[&Tracklet], stop: &Stop) -> Result<Vec<usize>> {
    let mut order: Vec<usize> = (0..moving.len()).collect();
    order.sort_by_key(|&t| moving[t].first);
    let mut out: Vec<usize> = Vec::new();
    let mut next = order.into_iter().peekable();
    // Tracklets that are there, and where they were in the last frame taken.
    let mut live: Vec<(usize, Option<Vector2<f64>>)> = Vec::new();
    let mut frame = moving.iter().map(|t| t.first).min().unwrap_or(0);
    let end = moving.iter().map(|t| t.end()).max().unwrap_or(0);
    while frame < end {
        stop.heed()?;
        live.retain(|(t, _)| moving[*t].end() > frame);
        while let Some(&t) = next.peek()
            && moving[t].first <= frame
        {
            live.push((t, None));
            next.next();
        }
        if live.is_empty() {
            frame = next.peek().map_or(end, |&t| moving[t].first);
            continue;
        }
        let here = |t: usize| moving[t].points[frame - moving[t].first].place;
        let known = live.iter().any(|l| l.1.is_some());
        if !known || live.iter().any(|&(t, p)| p.is_some_and(|p| (here(t) - p).norm() >= NEW_PX)) {
            out.push(frame);
            for (t, p) in &mut live {
                *p = Some(here(*t));
            }
        }
        frame += 1;
    }
    let n = out.len();
    if n > FRAMES {
        out = (0..FRAMES).map(|k| out[k * n / FRAMES]).collect();
    }
    Ok(out)
}

/// Standard uncertainty of a centre's coordinate from third differences, which let acceleration through: of independent errors their
/// variance is 20 times one's.
fn noise(moving: &[&Tracklet]) -> f64 {
    let mut third: Vec<f64> = moving
        .iter()
        .flat_map(|t| t.points.windows(4))
        .filter(|p| p.iter().all(|p| p.whole))
        .flat_map(|p| {
            let d = p[3].place - 3.0 * p[2].place + 3.0 * p[1].place - p[0].place;
            [d.x.abs(), d.y.abs()]
        })
        .collect();
    if third.is_empty() {
        return LEAST_SIGMA_PX;
    }
    let half = third.len() / 2;
    let median = *third.select_nth_unstable_by(half, f64::total_cmp).1;
    // Half of a normal distribution is within 0.6745 sigma.
    (median / 0.6745 / 20f64.sqrt()).max(LEAST_SIGMA_PX)
}
