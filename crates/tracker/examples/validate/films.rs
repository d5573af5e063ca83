//! A film to what is detected in it and what is true of it.

use std::sync::Arc;

use anyhow::Result;
use tracker::detect::{DetectSettings, Detector, Levels};
use tracker::film::{Film, Truth, preset};
use tracker::frame::FrameSource;
use tracker::source::synthetic::SyntheticSource;
use tracker::store::{DetectionStore, FrameStamp};

/// Frames whose detections are learned from, as in `pipeline`.
const SAMPLES: usize = 12;

/// A film that was filmed and detected.
pub struct Filmed {
    pub film: Film,
    pub truth: Truth,
    pub store: DetectionStore,
}

impl Filmed {
    /// A scene by name and seed.
    pub fn of(scene: &str, seed: u64) -> Result<Self> {
        let film = Arc::new(Film::new(&preset(scene, seed)?)?);
        let mut source = SyntheticSource::of(Arc::clone(&film));
        let settings = DetectSettings::default();
        let levels = Arc::new(Levels::learn(&source.sample(SAMPLES)?, &settings)?);
        let mut detector = Detector::new(levels, &settings)?;
        let mut store = DetectionStore::new();
        let mut detections = Vec::new();
        while let Some(frame) = source.next_frame()? {
            detector.detect(&frame, &mut detections)?;
            store.push(FrameStamp { index: frame.index, ticks: frame.ticks, decoded: true }, &detections)?;
        }
        let truth = Truth::of(&film);
        drop(source);
        Ok(Self { film: Arc::unwrap_or_clone(film), truth, store })
    }

    /// The first frame in which every marker is fully visible.
    pub fn whole(&self, full: f64) -> Option<usize> {
        self.truth.frames.iter().position(|f| f.nodes.iter().all(|n| n.visible >= full))
    }
}
