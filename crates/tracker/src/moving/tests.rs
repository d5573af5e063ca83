//! Markers that move before a still ground of texture, drawn with their truth.

use std::f64::consts::TAU;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use super::*;
use crate::error::{Error, Result};

/// A disc: centre, radius and grey level.
type Disc = (f64, f64, f64, f64);

/// Discs before a ground of texture, with noise.
struct Drawn {
    pictures: Vec<Picture>,
    stopped: bool,
}

const SIZE: (usize, usize) = (320, 240);

/// A ground of grains of many sizes: neighbours alike, contrast about that of the markers.
fn texture(seed: u64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut ground = vec![110.0; SIZE.0 * SIZE.1];
    for _ in 0..400 {
        let (x, y) = (random(&mut rng, SIZE.0 as f64), random(&mut rng, SIZE.1 as f64));
        let (r, level) = (1.0 + random(&mut rng, 12.0), random(&mut rng, 80.0) - 40.0);
        draw(&mut ground, (x, y, r), |v, part| v + level * part);
    }
    ground.iter_mut().for_each(|v| *v = v.clamp(40.0, 180.0));
    ground
}

/// Changes the pixels of a disc: each by the part of it that the disc covers, to a few hundredths.
fn draw(values: &mut [f64], (x, y, r): (f64, f64, f64), change: impl Fn(f64, f64) -> f64) {
    let range =
        |c: f64, n: usize| ((c - r - 1.0).max(0.0) as usize, ((c + r + 2.0).max(0.0) as usize).min(n));
    let ((x0, x1), (y0, y1)) = (range(x, SIZE.0), range(y, SIZE.1));
    for j in y0..y1 {
        for i in x0..x1 {
            let part = (r + 0.5 - (i as f64 - x).hypot(j as f64 - y)).clamp(0.0, 1.0);
            let v = &mut values[j * SIZE.0 + i];
            *v = change(*v, part);
        }
    }
}

impl Drawn {
    fn new(seed: u64, noise: f64, count: usize, discs: impl Fn(usize) -> Vec<Disc>) -> Self {
        let ground = texture(seed);
        let noise = Normal::new(0.0, noise).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
        let pictures = (0..count)
            .map(|k| {
                let mut values = ground.clone();
                for (x, y, r, level) in discs(k) {
                    draw(&mut values, (x, y, r), |v, part| v + (level - v) * part);
                }
                let luma = values
                    .iter()
                    .map(|v| (v + noise.sample(&mut rng)).round().clamp(0.0, 255.0) as u8)
                    .collect();
                Picture { width: SIZE.0, height: SIZE.1, luma, chroma: None }
            })
            .collect();
        Self { pictures, stopped: false }
    }
}

fn random(rng: &mut ChaCha8Rng, below: f64) -> f64 {
    f64::from(rng.next_u32()) / f64::from(u32::MAX) * below
}

impl Film for Drawn {
    fn count(&self) -> usize {
        self.pictures.len()
    }

    fn read(&self, index: usize) -> Result<Picture> {
        Ok(self.pictures[index].clone())
    }

    fn heed(&self) -> Result<()> {
        if self.stopped { Err(Error::Interrupted) } else { Ok(()) }
    }
}

/// Markers followed without a click, whatever the confidence.
struct Followed {
    model: Model,
    tracks: Vec<Track>,
    confidence: f64,
}

fn follow(film: &Drawn) -> Result<Option<Followed>> {
    let limits = Limits::default();
    let Some(search) = Search::learn(film, &limits)? else { return Ok(None) };
    let mut found = survey(&search, Against::Ground)?;
    found.markers.truncate(found.answers);
    finish(film, &mut found.markers)?;
    Ok(found.markers.first().map(|m| Followed {
        model: m.model.unwrap(),
        tracks: found.markers.iter().map(|m| m.track.clone()).collect(),
        confidence: found.confidence,
    }))
}

/// Root mean square error and that error over the stated uncertainty, both axes.
fn errors(track: &Track, truth: impl Fn(usize) -> (f64, f64)) -> (f64, f64) {
    let (mut squares, mut weighted, mut n) = (0.0, 0.0, 0.0);
    for (k, s) in track.spots() {
        let (x, y) = truth(k);
        let sigma = track.sigma_px(s);
        for d in [s.x - x, s.y - y] {
            squares += d * d;
            weighted += (d / sigma).powi(2);
            n += 1.0;
        }
    }
    ((squares / n).sqrt(), (weighted / n).sqrt())
}

fn round(k: usize) -> (f64, f64) {
    let a = TAU * k as f64 / 90.0;
    (160.0 + 70.0 * a.cos(), 120.0 + 70.0 * a.sin())
}

#[test]
fn a_thing_before_texture_is_followed_bright_or_dark_and_its_uncertainty_is_true() {
    for (seed, level) in
        [(1, 235.0), (2, 10.0), (3, 235.0), (21, 235.0), (22, 10.0), (23, 200.0), (24, 235.0), (25, 20.0)]
    {
        let film = Drawn::new(seed, 2.0, 180, move |k| {
            let (x, y) = round(k);
            vec![(x, y, 6.0, level)]
        });
        let f = follow(&film).unwrap().expect("something moves");
        assert!(f.confidence >= 0.2, "seed {seed}: {}", f.confidence);
        assert_eq!(f.tracks.len(), 1, "seed {seed}");
        let seen = f.tracks[0].spots().count();
        assert!(seen >= 175, "seed {seed}: {seen} of 180");
        let (rms, over) = errors(&f.tracks[0], round);
        // Noise of 2 over a contrast of 100 along an edge of 38 px leaves 0.01 px; a half is added for what the levels learn.
        assert!(rms < 0.02, "seed {seed}: {rms} px");
        assert!((0.5..1.2).contains(&over), "seed {seed}: {over} of the stated uncertainty");
    }
}

#[test]
fn dots_on_a_card_that_turns_are_followed_and_not_the_card() {
    // Darker than their card, not darker than the ground.
    let film = Drawn::new(4, 2.0, 180, |k| {
        let a = TAU * k as f64 / 120.0;
        let (x, y) = (160.0 + 60.0 * a.cos(), 120.0 + 60.0 * a.sin());
        vec![(160.0, 120.0, 95.0, 230.0), (x, y, 4.0, 90.0), (320.0 - x, 240.0 - y, 4.0, 90.0)]
    });
    let f = follow(&film).unwrap().expect("something moves");
    assert_eq!(f.tracks.len(), 2);
    assert!(f.model.sign < 0.0, "the dots are dark");
    assert!(f.confidence >= 0.2, "{}", f.confidence);
    for t in &f.tracks {
        assert!(t.spots().count() >= 170);
        // Each stays on its own dot: about the centre the two are opposite each other.
        let turns: Vec<f64> =
            t.spots().map(|(k, s)| (s.y - 120.0).atan2(s.x - 160.0) - TAU * k as f64 / 120.0).collect();
        let same = turns.iter().filter(|a| (*a - turns[0]).cos() > 0.9).count();
        assert_eq!(same, turns.len());
    }
}

#[test]
fn two_that_meet_are_never_exchanged() {
    // One passes the other at a distance of less than their size: which is which afterwards nothing tells but the motion.
    for seed in 5..9 {
        let place = |k: usize, which: f64| {
            let t = k as f64 / 120.0 - 0.5;
            (160.0 + which * 240.0 * t, 120.0 + which * 4.0 + 40.0 * t * t)
        };
        let film = Drawn::new(seed, 2.0, 120, move |k| {
            [1.0, -1.0].map(|w| place(k, w)).map(|(x, y)| (x, y, 5.0, 240.0)).to_vec()
        });
        let Some(f) = follow(&film).unwrap() else { continue };
        for t in &f.tracks {
            let on: Vec<f64> = t
                .spots()
                .filter_map(|(k, s)| {
                    let d = [1.0, -1.0].map(|w| (s.x - place(k, w).0).hypot(s.y - place(k, w).1));
                    // Where the two are one blob neither is wrong.
                    (d[0].max(d[1]) > 14.0).then(|| if d[0] < d[1] { 1.0 } else { -1.0 })
                })
                .collect();
            assert!(on.windows(2).all(|p| p[0] == p[1]), "seed {seed}: exchanged");
        }
    }
}

#[test]
fn a_thing_that_comes_to_rest_is_followed_where_its_place_was_empty_before() {
    let stop = (230.0, 150.0);
    let place = move |k: usize| {
        let t = (k as f64 / 60.0).min(1.0);
        (40.0 + (stop.0 - 40.0) * (2.0 * t - t * t), 60.0 + (stop.1 - 60.0) * (2.0 * t - t * t))
    };
    let film = Drawn::new(10, 2.0, 200, move |k| {
        let (x, y) = place(k);
        vec![(x, y, 6.0, 240.0)]
    });
    let f = follow(&film).unwrap().expect("something moves");
    let last = f.tracks.iter().flat_map(|t| t.spots()).map(|(k, _)| k).max();
    assert!(last >= Some(195), "followed to {last:?} of 199");
    for t in &f.tracks {
        let (rms, _) = errors(t, place);
        assert!(rms < 0.5, "{rms} px");
    }
}

#[test]
fn nothing_is_named_where_nothing_moves_or_all_is_noise() {
    let still = Drawn::new(11, 2.0, 60, |_| vec![(100.0, 100.0, 6.0, 240.0)]);
    assert!(follow(&still).unwrap().is_none_or(|f| f.confidence < 0.2));
    let noise = Drawn::new(12, 30.0, 60, |_| Vec::new());
    assert!(follow(&noise).unwrap().is_none_or(|f| f.confidence < 0.2));
}

#[test]
fn a_wish_to_stop_ends_the_work() {
    let film = Drawn { stopped: true, ..Drawn::new(13, 2.0, 60, |k| vec![(k as f64, 100.0, 6.0, 240.0)]) };
    assert!(matches!(follow(&film), Err(Error::Interrupted)));
}

/// Markers followed from places that are pointed at.
fn pointed(film: &Drawn, limits: &Limits, clicks: &[Click]) -> Vec<Result<Marker, Unheld>> {
    let search = Search::learn(film, limits).unwrap().unwrap();
    let mut followed =
        follow_clicks(&search, clicks, &survey(&search, Against::Ground).unwrap().markers).unwrap();
    let mut markers: Vec<Marker> = followed.iter().flatten().cloned().collect();
    finish(film, &mut markers).unwrap();
    let mut finished = markers.into_iter();
    followed.iter_mut().flatten().for_each(|m| *m = finished.next().unwrap());
    followed
}

/// Where something is in a picture.
type Path = fn(usize) -> (f64, f64);

/// Two small discs of other sizes and signs, and a large one that is likelier meant.
fn three(seed: u64) -> (Drawn, [Path; 2]) {
    fn small(k: usize) -> (f64, f64) {
        let a = TAU * k as f64 / 70.0;
        (60.0 + 35.0 * a.cos(), 170.0 + 35.0 * a.sin())
    }
    fn dark(k: usize) -> (f64, f64) {
        (40.0 + 1.5 * k as f64, 30.0 + 15.0 * (k as f64 / 20.0).sin())
    }
    let film = Drawn::new(seed, 2.0, 150, |k| {
        let (a, b, c) = (small(k), dark(k), round(k));
        vec![(c.0 + 60.0, c.1, 12.0, 240.0), (a.0, a.1, 4.0, 230.0), (b.0, b.1, 6.0, 15.0)]
    });
    (film, [small, dark])
}

#[test]
fn what_is_pointed_at_is_followed_whatever_else_moves() {
    for seed in 30..33 {
        let (film, truth) = three(seed);
        for picture in [10, 75, 140] {
            let click =
                |t: fn(usize) -> (f64, f64)| Click { picture, x: t(picture).0 + 1.5, y: t(picture).1 - 1.0 };
            let followed = pointed(&film, &Limits::default(), &truth.map(click));
            for (marker, truth) in followed.iter().zip(truth) {
                let track = &marker.as_ref().unwrap().track;
                assert!(track.count >= 140, "seed {seed}, picture {picture}: {} of 150", track.count);
                let (rms, _) = errors(track, truth);
                assert!(rms < 0.1, "seed {seed}, picture {picture}: {rms} px");
            }
        }
    }
}

#[test]
fn a_place_where_nothing_is_and_one_that_only_flickers_are_refused() {
    let (film, _) = three(34);
    let empty = Click { picture: 75, x: 300.0, y: 235.0 };
    let followed = pointed(&film, &Limits::default(), &[empty]);
    // The ground's own grains stand still: if one is taken for it, it does not move.
    assert!(followed.iter().all(|f| f.as_ref().map_or(true, |m| !m.track.moving)), "{followed:?}");
    let once =
        Drawn::new(35, 2.0, 60, |k| if k == 30 { vec![(100.0, 100.0, 6.0, 250.0)] } else { Vec::new() });
    let followed = pointed(&once, &Limits::default(), &[Click { picture: 30, x: 100.0, y: 100.0 }]);
    assert!(matches!(followed[0], Err(Unheld { spot: Missed::Ends(..), .. })), "{followed:?}");
}

#[test]
fn region_sign_and_level_say_which_of_several_is_meant() {
    use crate::rig::Region;

    let (film, [small, dark]) = three(36);
    let only = |limits: Limits, truth: fn(usize) -> (f64, f64)| {
        let search = Search::learn(&film, &limits).unwrap().unwrap();
        let found = survey(&search, Against::Ground).unwrap();
        let first = &found.markers[0].track;
        let near = first.spots().filter(|(k, s)| (s.x - truth(*k).0).hypot(s.y - truth(*k).1) < 2.0).count();
        assert!(near > 100, "{limits:?}: {near} of {}", first.count);
    };
    only(Limits { sign: Some(-1.0), ..Limits::default() }, dark);
    only(Limits { sign: Some(-1.0), level: Some(35.0), ..Limits::default() }, dark);
    only(Limits { region: Some(Region::Rectangle([0.0, 120.0, 110.0, 239.0])), ..Limits::default() }, small);
}
