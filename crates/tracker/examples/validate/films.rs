//! A film to what is detected in it, what is true of it and what the tracker makes of it.

use std::sync::Arc;

use anyhow::Result;
use tracker::detect::{DetectSettings, Detector, Levels};
use tracker::discover::discover;
use tracker::frame::FrameSource;
use tracker::observation::Status;
use tracker::rig::Rig;
use tracker::score::{LIMIT_PX, Score, Tracked, score};
use tracker::stop::Stop;
use tracker::store::{DetectionStore, FrameStamp};
use tracker::synth::SyntheticSource;
use tracker::synth::{Film, Scene, Truth};
use tracker::track::track_recording;

/// Frames whose detections are learned from, as in `pipeline`.
const SAMPLES: usize = 12;

/// A film that was filmed and detected.
pub struct Filmed {
    pub film: Film,
    pub truth: Truth,
    pub store: DetectionStore,
}

impl Filmed {
    /// A scene.
    pub fn of(scene: &Scene) -> Result<Self> {
        let film = Arc::new(Film::new(scene)?);
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

    /// The tracker's score without a rig.
    pub fn follow(&self) -> Result<Followed> {
        let rig = discover(&self.store, self.film.scene().image_px, &Stop::default())?.rig;
        let mut tracked =
            Tracked { nodes: rig.nodes.iter().map(|n| n.name.clone()).collect(), ..Tracked::default() };
        let mut status = Vec::new();
        track_recording(&self.store, &rig, &Stop::default(), &mut |stamp, row| {
            tracked.frames.push(stamp.index);
            for o in row {
                tracked.xy_px.push([o.x_px, o.y_px]);
                tracked.sigma_px.push(o.sigma_px);
                status.push(o.status);
            }
            Ok(())
        })?;
        let score = score(&tracked, &self.truth, LIMIT_PX)?;
        let rig_right = self.same_rig(&rig, &score);
        Ok(Followed { tracked, status, score, rig_right })
    }

    /// Whether the rig has every marker and no other, each in a body with those of its link and no other.
    fn same_rig(&self, rig: &Rig, score: &Score) -> bool {
        let scene = self.film.scene();
        let link = |name: &str| scene.markers.iter().find(|m| m.name == name).map(|m| m.link.as_str());
        let pairs: Vec<_> = rig
            .nodes
            .iter()
            .zip(&score.matches)
            .map(|(n, m)| (n.body.as_str(), m.truth.as_deref().and_then(link)))
            .collect();
        score.unmatched.is_empty()
            && pairs.iter().all(|p| p.1.is_some())
            && pairs.iter().all(|p| pairs.iter().all(|q| (p.0 == q.0) == (p.1 == q.1)))
            && rig.bodies.len() == scene.links.len()
    }
}

/// The tracker's score on a film.
pub struct Followed {
    pub tracked: Tracked,
    /// By frame, then node.
    pub status: Vec<Status>,
    pub score: Score,
    pub rig_right: bool,
}
