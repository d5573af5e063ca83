//! Properties of tracking that hold for any sequence of detections, however senseless: nothing is named twice, nothing but a blob
//! of several markers is used twice, every frame has its row.

pub(crate) mod bed;
mod cameras;
mod mechanisms;
mod noise;
mod swing;
mod worst;

use proptest::collection::vec;
use proptest::prelude::*;

use super::{Tracker, track_recording};
use crate::detect::{Detection, Flags};
use crate::observation::Observation;
use crate::rig::Rig;
use crate::stop::Stop;
use crate::store::{DetectionStore, FrameStamp};
use crate::table::{NodeTable, Rows, tests::meta};
use swing::Swing;

/// Harm to a frame of a true film before the tracker sees it.
#[derive(Debug, Clone)]
enum Harm {
    None,
    /// Every such detection is left out.
    Lose(usize),
    /// Another frame's detections.
    Other(prop::sample::Index),
    /// Detections beside true ones, so near that they fit as well.
    Twins(Vec<(prop::sample::Index, f64, f64)>),
    /// Anything anywhere, with any uncertainty and flags.
    Glints(Vec<(f64, f64, f32, u8)>),
    /// Nothing but glints.
    Only(Vec<(f64, f64, f32, u8)>),
    /// A frame that could not be decoded.
    Lost,
}

fn glints() -> impl Strategy<Value = Vec<(f64, f64, f32, u8)>> {
    // Many near the pendulum, where they do harm.
    let place = prop_oneof![(0.0..1280.0, 0.0..1024.0), (600.0..680.0, 480.0..700.0)];
    vec((place, 1e-3..3f32, 0u8..16).prop_map(|((x, y), s, f)| (x, y, s, f)), 0..20)
}

fn harm() -> impl Strategy<Value = Harm> {
    prop_oneof![
        8 => Just(Harm::None),
        2 => (1usize..5).prop_map(Harm::Lose),
        1 => any::<prop::sample::Index>().prop_map(Harm::Other),
        2 => vec((any::<prop::sample::Index>(), -3.0..3.0, -3.0..3.0), 1..6).prop_map(Harm::Twins),
        2 => glints().prop_map(Harm::Glints),
        1 => glints().prop_map(Harm::Only),
        1 => Just(Harm::Lost),
    ]
}

fn any_detection(&(x_px, y_px, sigma_px, flags): &(f64, f64, f32, u8)) -> Detection {
    Detection { x_px, y_px, sigma_px, area_px: 0.0, peak: 90.0, elongation: 1.0, flags: Flags(flags) }
}

/// The frames as harmed. The area of a detection says which of its frame it is.
fn harmed(film: &DetectionStore, harms: &[Harm]) -> Vec<(FrameStamp, Vec<Detection>)> {
    let mut out = Vec::new();
    for (i, harm) in harms.iter().enumerate() {
        let mut stamp = film.stamp(i);
        let mut here = Vec::new();
        film.read(i, &mut here);
        match harm {
            Harm::None => {}
            Harm::Lose(every) => {
                let mut k = 0;
                here.retain(|_| {
                    k += 1;
                    k % every != 0
                });
            }
            Harm::Other(other) => film.read(other.index(film.len()), &mut here),
            Harm::Twins(twins) if !here.is_empty() => {
                for (which, dx, dy) in twins {
                    let d = here[which.index(here.len())];
                    here.push(Detection { x_px: d.x_px + dx, y_px: d.y_px + dy, ..d });
                }
            }
            Harm::Twins(_) => {}
            Harm::Glints(more) => here.extend(more.iter().map(any_detection)),
            Harm::Only(all) => here = all.iter().map(any_detection).collect(),
            Harm::Lost => {
                here.clear();
                stamp.decoded = false;
            }
        }
        here.sort_by(|a, b| a.y_px.total_cmp(&b.y_px).then(a.x_px.total_cmp(&b.x_px)));
        for (k, d) in here.iter_mut().enumerate() {
            d.area_px = 100.0 + k as f32;
        }
        out.push((stamp, here));
    }
    out
}

/// Every place given is a detection's of this frame, each used once.
fn used_once(row: &[Observation], here: &[Detection]) -> Result<(), TestCaseError> {
    let mut used = vec![false; here.len()];
    for o in row.iter().filter(|o| o.status.is_seen()) {
        let k = (o.area_px - 100.0) as usize;
        prop_assert!(k < here.len(), "there is no detection {k} of {}", here.len());
        // Markers that run together share their blob.
        prop_assert!(!used[k] || here[k].flags.has(Flags::MERGED), "detection {k} is used twice");
        used[k] = true;
        let (dx, dy) = (o.x_px - here[k].x_px, o.y_px - here[k].y_px);
        // A half hidden marker is given where its body says, and its uncertainty then holds the difference.
        prop_assert!(
            dx.hypot(dy) <= f64::from(o.sigma_px) * 1.001,
            "given {dx}, {dy} px beside its detection"
        );
    }
    Ok(())
}

/// The rows make a table that every reader accepts: frames and times grow, a place exactly where a node is seen,
/// no two nodes at one place.
fn is_table(rig: &Rig, rows: Rows, frames: usize) -> Result<(), TestCaseError> {
    prop_assert_eq!(rows.frames(), frames);
    prop_assert_eq!(rows.status.len(), frames * rig.nodes.len());
    let mut meta = meta(&[("n".into(), 0)], &["b".into()]);
    meta.rig = rig.clone();
    let said = NodeTable { meta, rows }.check("rows").map_err(|e| e.to_string());
    prop_assert_eq!(said, Ok(()));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_recording_of_any_detections_gives_a_sound_table(seed in 0u64..1000, harms in vec(harm(), 1..120)) {
        let film = Swing { frames: harms.len(), seed, ..Swing::default() }.film();
        let frames = harmed(&film.store, &harms);
        let mut store = DetectionStore::new();
        for (stamp, here) in &frames {
            store.push(*stamp, here).unwrap();
        }
        let (mut rows, mut used) = (Rows::default(), Vec::new());
        let summary = track_recording(&store, &film.rig, &Stop::default(), &mut |stamp, row| {
            used.push(used_once(row, &frames[stamp.index as usize].1));
            rows.push(stamp.index, stamp.ticks as f64 / 1000.0, row);
            Ok(())
        }).unwrap();
        used.into_iter().collect::<Result<(), _>>()?;
        prop_assert_eq!(summary.frames as usize, frames.len());
        is_table(&film.rig, rows, frames.len())?;
    }

    #[test]
    fn a_live_tracker_fed_anything_gives_sound_rows(
        seed in 0u64..1000, harms in vec(harm(), 1..120), skipped in vec(0u64..4, 120),
    ) {
        let film = Swing { frames: harms.len(), seed, ..Swing::default() }.film();
        let mut tracker = Tracker::new(&film.rig).unwrap();
        let (mut rows, mut index) = (Rows::default(), 0);
        for ((stamp, here), skipped) in harmed(&film.store, &harms).iter().zip(skipped) {
            index += 1 + skipped;
            let row = tracker.step(&FrameStamp { index, ..*stamp }, here).unwrap();
            used_once(&row, here)?;
            rows.push(index, index as f64 / 1000.0, &row);
        }
        is_table(&film.rig, rows, harms.len())?;
    }
}
