//! Tracks the nodes of a whole recording: learns rig and motion first, then names every frame, in both directions of time.
//!
//! Owns: [`track_recording`], [`TrackSummary`]. Must not: keep more of the recording than what is undecided.

use std::collections::VecDeque;

use super::frame_tracker::FrameTracker;
use super::motion_priors::MotionPriors;
use super::occlusion_filter::OcclusionFilter;
use super::prior_estimator::PriorEstimator;
use super::rows::{Returns, observations, occlusions};
use super::seen::BodySeen;
use crate::camera::Plane;
use crate::detect::Detection;
use crate::error::{Error, Fault, Result};
use crate::observation::{Observation, Status};
use crate::rig::Rig;
use crate::rigid::body::Mechanism;
use crate::rigid::forecast::Motion;
use crate::rigid::index::DetectionIndex;
use crate::stop::Stop;
use crate::store::{DetectionStore, FrameStamp, PlaneView};

/// The outcome of tracking a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrackSummary {
    /// Frames written.
    pub frames: u64,
    /// For each node, in the rig's order, frames in which it was seen.
    pub seen: Vec<u64>,
    /// For each node, frames in which its name stayed open.
    pub ambiguous: Vec<u64>,
    /// For each node, whether it was seen in the last frame.
    pub seen_last: Vec<bool>,
    /// Frames in which more stood out than is tried for where a body may be ([`crate::rigid::search::MOST_SEEDS`]).
    pub bounded_frames: u64,
}

/// Receives one frame's stamp and its nodes, in the rig's order.
pub type Sink<'a> = dyn FnMut(&FrameStamp, &[Observation]) -> Result<()> + 'a;

/// Frames after which an open body is written as it stands.
const PATIENCE: usize = 20_000;
/// Frames in a row in which a body must be seen before its gap is filled from behind.
const SETTLED: usize = 3;

struct Pending {
    stamp: FrameStamp,
    seen: Vec<BodySeen>,
}

/// Names the markers of a whole recording and hands every frame to `sink` in the order of recording.
///
/// # Errors
/// Those of the sink, [`crate::error::Error::Rig`] for a rig that is not valid, and
/// [`crate::error::Error::Interrupted`] once `stop` was asked for.
pub fn track_recording(
    store: &DetectionStore,
    rig: &Rig,
    stop: &Stop,
    sink: &mut Sink<'_>,
) -> Result<TrackSummary> {
    rig.check("rig")?;
    if rig.pixel_aspect != store.pixel_aspect() {
        return Err(Error::Rig(
            Fault::new("rig", format!("it is for pixels of {}", rig.pixel_aspect))
                .advice(format!("Give the detections' own, {}", store.pixel_aspect())),
        ));
    }
    let plane = rig.plane();
    let store = &PlaneView::new(store, plane.camera);
    let mechanism = Mechanism::new(rig, 0.3);
    let priors = MotionPriors::unknown(&mechanism, 0.05);
    let n = mechanism.nodes;
    let mut out = Output {
        plane,
        occlusion_filter: OcclusionFilter::default(),
        returns: Returns::new(n),
        summary: TrackSummary {
            seen: vec![0; n],
            ambiguous: vec![0; n],
            seen_last: vec![false; n],
            ..Default::default()
        },
        scratch: Vec::new(),
    };
    if store.is_empty() {
        return Ok(out.summary);
    }
    let start = start_frame(store, rig);
    let (mechanism, priors) = learn(store, rig, start, mechanism, priors, stop)?;
    let tracker = started(rig, start, mechanism, priors);
    // Backwards from the reference picture, kept; then forwards from it, written as it is decided.
    let mut before = Pass::new(store, tracker.clone(), stop);
    for i in (0..start).rev() {
        before.step(i)?;
    }
    before.finish()?;
    while let Some(p) = before.pending.pop_back() {
        out.write(store, &before.tracker.bodies.mechanism, p, sink)?;
    }
    let mut after = Pass::new(store, tracker, stop);
    for i in start..store.len() {
        after.step(i)?;
        while after.decided() > 0 {
            if let Some(p) = after.pending.pop_front() {
                out.write(store, &after.tracker.bodies.mechanism, p, sink)?;
            }
            after.first += 1;
        }
    }
    after.finish()?;
    while let Some(p) = after.pending.pop_front() {
        out.write(store, &after.tracker.bodies.mechanism, p, sink)?;
    }
    out.hand_out(true, sink)?;
    out.summary.bounded_frames = before.tracker.bounded_frames + after.tracker.bounded_frames;
    Ok(out.summary)
}

/// Frames that the rig is refined on.
const LEARNING_FRAMES: usize = 4000;

/// Follows the markers from the reference picture on, only to learn.
fn learn(
    store: &PlaneView<'_>,
    rig: &Rig,
    start: usize,
    mut mechanism: Mechanism,
    mut priors: MotionPriors,
    stop: &Stop,
) -> Result<(Mechanism, MotionPriors)> {
    let mut scratch = Vec::new();
    let mut tracker = started(rig, start, mechanism.clone(), priors.clone());
    let mut estimator = PriorEstimator::new(&mechanism);
    // The last frames before the reference count too where few come after it.
    let first = start.min(store.len().saturating_sub(LEARNING_FRAMES));
    for i in (first..start).rev().chain(start..store.len().min(first + LEARNING_FRAMES)) {
        if i == start {
            tracker = started(rig, start, mechanism.clone(), priors.clone());
        }
        stop.heed()?;
        store.read(i, &mut scratch);
        let index = DetectionIndex::new(&scratch);
        let seen = tracker.step(i as f64, &index, None, stop)?;
        estimator.add(&tracker.bodies.mechanism, &seen, &index);
    }
    estimator.apply(&mut mechanism, &mut priors);
    Ok((mechanism, priors))
}

/// A tracker that stands in the reference picture.
fn started(rig: &Rig, start: usize, mechanism: Mechanism, priors: MotionPriors) -> FrameTracker {
    let mut tracker = FrameTracker::new(mechanism, priors);
    if rig.reference_frame.is_some() {
        for b in 0..tracker.bodies.mechanism.links.len() {
            tracker.bodies.motions[b] = Motion::at(start as f64, &tracker.bodies.mechanism.home_pose(b));
        }
    }
    tracker
}

/// Index in the store of the reference picture; 0 where there is none in it.
fn start_frame(store: &PlaneView<'_>, rig: &Rig) -> usize {
    let Some(reference) = rig.reference_frame else { return 0 };
    let first = store.stamp(0).index;
    reference.checked_sub(first).map_or(0, |i| if (i as usize) < store.len() { i as usize } else { 0 })
}

struct Output {
    plane: Plane,
    occlusion_filter: OcclusionFilter,
    returns: Returns,
    summary: TrackSummary,
    scratch: Vec<Detection>,
}

impl Output {
    fn write(
        &mut self,
        store: &PlaneView<'_>,
        mechanism: &Mechanism,
        p: Pending,
        sink: &mut Sink<'_>,
    ) -> Result<()> {
        let i = (p.stamp.index - store.stamp(0).index) as usize;
        store.read(i, &mut self.scratch);
        let row = observations(mechanism, &p.seen, &self.scratch);
        self.occlusion_filter.push(p.stamp, row, &occlusions(mechanism, &p.seen));
        self.hand_out(false, sink)
    }

    fn hand_out(&mut self, end: bool, sink: &mut Sink<'_>) -> Result<()> {
        while let Some((stamp, mut row)) = self.occlusion_filter.pop(end) {
            if !stamp.decoded {
                row.fill(Observation::UNDECODED);
            }
            row.iter_mut().for_each(|o| *o = o.to_recorded(&self.plane));
            self.returns.mark(&mut row);
            let s = &mut self.summary;
            s.frames += 1;
            for (k, o) in row.iter().enumerate() {
                let seen = o.x_px.is_finite();
                s.seen[k] += u64::from(seen);
                s.ambiguous[k] += u64::from(o.status == Status::Ambiguous);
                s.seen_last[k] = seen;
            }
            sink(&stamp, &row)?;
        }
        Ok(())
    }
}

/// One direction of time: steps, and fills gaps from behind once a body is settled again.
struct Pass<'a> {
    store: &'a PlaneView<'a>,
    stop: &'a Stop,
    tracker: FrameTracker,
    pending: VecDeque<Pending>,
    /// Steps already taken out of `pending`.
    first: usize,
    /// For each body the step at which its gap began.
    gap: Vec<Option<usize>>,
    /// For each body the steps in a row in which it was seen.
    run: Vec<usize>,
    scratch: Vec<Detection>,
}

impl<'a> Pass<'a> {
    fn new(store: &'a PlaneView<'a>, tracker: FrameTracker, stop: &'a Stop) -> Self {
        let n = tracker.bodies.mechanism.links.len();
        Self {
            store,
            stop,
            tracker,
            pending: VecDeque::new(),
            first: 0,
            gap: vec![None; n],
            run: vec![0; n],
            scratch: Vec::new(),
        }
    }

    fn step(&mut self, i: usize) -> Result<()> {
        self.stop.heed()?;
        self.store.read(i, &mut self.scratch);
        let index = DetectionIndex::new(&self.scratch);
        let seen = self.tracker.step(i as f64, &index, None, self.stop)?;
        let now = self.first + self.pending.len();
        for (b, s) in seen.iter().enumerate() {
            if s.fit.is_some() {
                self.run[b] += 1;
            } else {
                self.run[b] = 0;
                self.gap[b].get_or_insert(now);
            }
        }
        self.pending.push_back(Pending { stamp: self.store.stamp(i), seen });
        for b in 0..self.gap.len() {
            if self.gap[b].is_some() && self.run[b] == SETTLED {
                self.fill(b)?;
            }
        }
        Ok(())
    }

    /// Steps that no open gap holds back.
    fn decided(&self) -> usize {
        let end = self.first + self.pending.len();
        let open = self.gap.iter().flatten().copied().min().unwrap_or(end);
        open.saturating_sub(self.first).max(self.pending.len().saturating_sub(PATIENCE))
    }

    /// Follows body `b` from now back through its gap.
    fn fill(&mut self, b: usize) -> Result<()> {
        let Some(start) = self.gap[b].take() else { return Ok(()) };
        let from = start.max(self.first) - self.first;
        let end = self.pending.len() - SETTLED;
        let mut tracker = self.tracker.clone();
        tracker.bodies.motions[b].forget();
        let time = |p: &Pending, store: &PlaneView<'_>| (p.stamp.index - store.stamp(0).index) as f64;
        for p in self.pending.range(end..).rev() {
            if let Some(f) = &p.seen[b].fit {
                tracker.bodies.motions[b].add(time(p, self.store), f);
            }
        }
        for k in (from..end).rev() {
            self.stop.heed()?;
            let p = &mut self.pending[k];
            let i = time(p, self.store);
            self.store.read(i as usize, &mut self.scratch);
            if self.scratch.is_empty() || p.seen[b].fit.is_some() {
                if let Some(f) = &p.seen[b].fit {
                    tracker.bodies.motions[b].add(i, f);
                }
                continue;
            }
            let index = DetectionIndex::new(&self.scratch);
            let mut known = p.seen.clone();
            for (o, s) in known.iter_mut().enumerate() {
                // Other open bodies are not the question now.
                if o != b && s.fit.is_none() {
                    s.picks = vec![None; s.picks.len()];
                    s.occluded = vec![None; s.picks.len()];
                }
            }
            let seen = tracker.step_one(b, i, &index, &known);
            if seen.fit.is_some() {
                p.seen[b] = seen;
            }
        }
        // What the gap took is taken from the frames to come.
        self.tracker.bodies.work = tracker.bodies.work;
        Ok(())
    }

    /// Fills what gaps can be filled at the end of the recording.
    fn finish(&mut self) -> Result<()> {
        for b in 0..self.gap.len() {
            if self.gap[b].is_some() && self.run[b] > 0 && self.pending.len() > SETTLED {
                self.fill(b)?;
            }
        }
        self.gap.fill(None);
        Ok(())
    }
}
