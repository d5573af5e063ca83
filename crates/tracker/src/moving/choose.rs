//! Chooses what to look for by what it explains: every way of looking competes, and within each every look.
//!
//! Owns: [`follow`], [`Followed`]. Must not: say which marker is wanted where nothing decides: the confidence tells.

use rayon::prelude::*;

use super::backdrop::Backdrop;
use super::centre::refine;
use super::ground::{self, Ground, spread};
use super::model::Model;
use super::picture::Film;
use super::response::{Direction, Response, octaves, response, responses};
use super::rest::extend;
use super::spot::{Spot, spots};
use super::track::{Track, extent, join, join_lone, quality, tracks};
use super::tracklet::{link, median};
use crate::error::Result;

/// A recording of fewer pictures has no tracklet that can be judged.
const LEAST_PICTURES: usize = 6;
/// Bursts of consecutive pictures in which every model is tried, and their length.
const BURSTS: usize = 5;
const BURST_PICTURES: usize = 20;
/// Spots of a picture and model, at most.
const MOST_SPOTS: usize = 30;
/// Limit of a spot in units of the noise while models are compared.
const FIRST_LIMIT: f32 = 6.0;
/// Models that are run over the whole recording, and the least part of the best one's score.
const FINALISTS: usize = 4;
const FINALIST_PART: f64 = 0.1;
/// A look: factors 2.5 in peak and 2.1 in area, as logarithms.
const LOOK: [f64; 2] = [0.9, 0.75];
/// Quality from which on a track may be an answer.
const LEAST_QUALITY: f64 = 0.2;
/// Part of the best track's weight from which on another of its look is an answer.
const ANSWER_PART: f64 = 0.12;

/// What was followed.
#[derive(Debug, Clone)]
pub struct Followed {
    /// How it was looked at.
    pub model: Model,
    /// The tracks that answer.
    pub tracks: Vec<Track>,
    /// Radius of the markers, px.
    pub radius_px: f64,
    /// Part of what looks like them that they explain, times how compact they are: 0 to 1.
    pub confidence: f64,
    /// Other markers that move.
    pub others: Vec<Track>,
}

struct Grounds {
    directions: Vec<Direction>,
    /// By octave, then direction.
    grounds: Vec<Vec<Ground>>,
}

impl Grounds {
    fn learn(film: &dyn Film, directions: Vec<Direction>, count: usize) -> Result<Self> {
        let n = film.count();
        let pictures = spread(n, ground::PICTURES.min(n));
        let samples: Vec<Vec<Response>> =
            pictures.par_iter().map(|&i| Ok(responses(&film.read(i)?, count))).collect::<Result<_>>()?;
        let grounds = (0..count)
            .map(|l| {
                let octave: Vec<Response> = samples.iter().map(|s| s[l].clone()).collect();
                directions.iter().map(|&d| Ground::learn(&octave, d, l)).collect()
            })
            .collect();
        Ok(Self { directions, grounds })
    }

    fn of(&self, m: &Model) -> &Ground {
        let d = self.directions.iter().position(|d| *d == m.direction).unwrap_or(0);
        &self.grounds[m.octave][d]
    }

    fn spots(&self, r: &Response, m: &Model, limit: f32) -> Vec<Spot> {
        let along = r.along(m.direction);
        let ground = self.of(m);
        let out = ground.standing_out(&along, m.sign);
        spots(&out, &along, Some(ground), (r.width, r.height), m.octave, (limit, MOST_SPOTS))
    }
}

struct Candidate {
    model: Model,
    score: f64,
    /// Limit for the whole recording.
    limit: f32,
}

/// Tries every model on bursts; the best first.
fn candidates(film: &dyn Film, grounds: &Grounds, count: usize, width: f64) -> Result<Vec<Candidate>> {
    let n = film.count();
    let length = BURST_PICTURES.min(n);
    let bursts = BURSTS.min((n / length).max(1));
    let starts = spread(n - length + 1, bursts);
    let models: Vec<Model> = grounds
        .directions
        .iter()
        .flat_map(|&direction| {
            (0..count).flat_map(move |octave| [1.0, -1.0].map(|sign| Model { direction, sign, octave }))
        })
        .collect();
    // By burst, picture, model.
    let found: Vec<Vec<Vec<Vec<Spot>>>> = starts
        .iter()
        .map(|&b| {
            (b..b + length)
                .into_par_iter()
                .map(|i| {
                    film.heed()?;
                    let all = responses(&film.read(i)?, count);
                    Ok(models.iter().map(|m| grounds.spots(&all[m.octave], m, FIRST_LIMIT)).collect())
                })
                .collect::<Result<_>>()
        })
        .collect::<Result<_>>()?;
    let mut out: Vec<Candidate> = models
        .par_iter()
        .enumerate()
        .filter_map(|(k, model)| {
            let radius = model.radius_px();
            let (mut moved, mut all, mut standing) = (0.0, 0, 0);
            let (mut snr, mut snr_good) = (Vec::new(), Vec::new());
            for (burst, &first) in found.iter().zip(&starts) {
                let pictures: Vec<Vec<Spot>> = burst.iter().map(|p| p[k].clone()).collect();
                all += pictures.iter().map(Vec::len).sum::<usize>();
                for t in link(&pictures, radius, width, first).iter().filter(|t| t.spots.len() >= 6) {
                    if extent(t.spots.iter()) < (0.3 * radius).max(2.0) {
                        standing += t.spots.len();
                        continue;
                    }
                    let q = quality(t, radius);
                    moved += q * t.spots.len() as f64;
                    let strength = median(&mut t.spots.iter().map(|s| s.snr).collect::<Vec<_>>());
                    snr.push(strength);
                    if q > 0.3 {
                        snr_good.push(strength);
                    }
                }
            }
            if moved < 5.0 {
                return None;
            }
            let per_picture = moved / (starts.len() * length) as f64;
            let purity = moved / (all - standing).max(1) as f64;
            let strength = median(&mut snr);
            snr_good.sort_unstable_by(f64::total_cmp);
            let quartile = snr_good.get(snr_good.len() / 4).copied().unwrap_or(20.0);
            let limit = (0.35 * quartile).max(5.0) as f32;
            Some(Candidate {
                model: *model,
                score: per_picture * purity * strength / (strength + 15.0),
                limit,
            })
        })
        .collect();
    out.sort_by(|a, b| b.score.total_cmp(&a.score));
    Ok(out)
}

struct Run {
    model: Model,
    pictures: Vec<Vec<Spot>>,
    /// Moving tracks of the winning look.
    group: Vec<Track>,
    /// Moving tracks of other looks.
    others: Vec<Track>,
    purity: f64,
    compact: f64,
    score: f64,
}

fn alike(a: &[f64; 2], b: &[f64; 2], limit: [f64; 2]) -> bool {
    (a[0] - b[0]).abs() < limit[0] && (a[1] - b[1]).abs() < limit[1]
}

fn linked(pictures: &[Vec<Spot>], radius: f64, width: f64) -> Vec<Track> {
    let chains = join_lone(join(link(pictures, radius, width, 0), radius), radius);
    tracks(chains, radius, pictures.len())
}

/// One model over the whole recording: every look competes by what it explains of all that looks like it.
fn run(film: &dyn Film, model: Model, pictures: Vec<Vec<Spot>>, width: f64) -> Result<Run> {
    let radius = model.radius_px();
    let n = pictures.len() as f64;
    let all = linked(&pictures, radius, width);
    let (moving, rest): (Vec<Track>, Vec<Track>) = all.into_iter().partition(|t| t.moving);
    let good: Vec<Track> = moving.into_iter().filter(|t| t.quality > LEAST_QUALITY).collect();
    let mut order: Vec<usize> = (0..good.len()).collect();
    order.sort_by(|&a, &b| good[b].weight().total_cmp(&good[a].weight()));
    let mut best: Option<(f64, f64, Vec<usize>)> = None;
    for &seed in order.iter().take(6) {
        let group: Vec<usize> =
            (0..good.len()).filter(|&k| alike(&good[seed].look, &good[k].look, LOOK)).collect();
        let look = [0, 1].map(|c| median(&mut group.iter().map(|&k| good[k].look[c]).collect::<Vec<_>>()));
        let like = pictures.iter().flatten().filter(|s| alike(&s.look(), &look, LOOK)).count();
        let standing: usize = rest.iter().filter(|t| alike(&t.look, &look, LOOK)).map(|t| t.count).sum();
        let weights: Vec<f64> = group.iter().map(|&k| good[k].weight()).collect();
        let explained: f64 = weights.iter().sum();
        let purity = explained / like.saturating_sub(standing).max(1) as f64;
        let long: f64 =
            group.iter().map(|&k| good[k].weight() * (good[k].count as f64 / n).sqrt()).sum::<f64>() / n;
        // A few long tracks are better than many scraps.
        let heaviest = weights.iter().copied().fold(0.0, f64::max);
        let dominance = weights.iter().map(|w| w * w).sum::<f64>() / (explained * heaviest).max(1e-9);
        let score = long * purity * dominance;
        if best.as_ref().is_none_or(|b| score > b.0) {
            best = Some((score, purity, group));
        }
    }
    let Some((score, purity, chosen)) = best else {
        return Ok(Run {
            model,
            pictures,
            group: Vec::new(),
            others: good,
            purity: 0.0,
            compact: 0.0,
            score: 0.0,
        });
    };
    let (mut group, mut others) = (Vec::new(), Vec::new());
    for (k, t) in good.into_iter().enumerate() {
        if chosen.contains(&k) { group.push(t) } else { others.push(t) }
    }
    group.sort_by(|a, b| b.weight().total_cmp(&a.weight()));
    let compact: Vec<f64> = group
        .par_iter()
        .take(4)
        .map(|t| {
            let c = refine(film, &mut t.clone(), &model, 24, None, None)?;
            Ok(c.found * (-(c.radius_px / radius).ln().powi(2) / 0.5).exp())
        })
        .collect::<Result<_>>()?;
    let compact = compact.iter().sum::<f64>() / compact.len().max(1) as f64;
    Ok(Run { model, pictures, group, others, purity, compact, score: score * (0.2 + 0.8 * compact) })
}

/// Whether two tracks are one marker: near each other where both are seen.
fn same_marker(a: &Track, b: &Track, within_px: f64) -> bool {
    let places: std::collections::HashMap<usize, (f64, f64)> =
        a.spots().map(|(k, s)| (k, (s.x, s.y))).collect();
    let mut apart: Vec<f64> =
        b.spots().filter_map(|(k, s)| places.get(&k).map(|p| (p.0 - s.x).hypot(p.1 - s.y))).collect();
    apart.len() as f64 > 0.3 * a.count.min(b.count) as f64 && median(&mut apart) < within_px
}

/// Follows what moves through a recording. `None` where nothing moves smoothly.
///
/// # Errors
/// Those of the film; [`crate::error::Error::Interrupted`] once the work is to stop.
pub fn follow(film: &dyn Film) -> Result<Option<Followed>> {
    if film.count() < LEAST_PICTURES {
        return Ok(None);
    }
    let first = film.read(0)?;
    let (width, count) = (first.width as f64, octaves(first.width, first.height));
    let directions = if first.chroma.is_some() { Direction::ALL.to_vec() } else { vec![Direction::LUMA] };
    let grounds = Grounds::learn(film, directions, count)?;
    let candidates = candidates(film, &grounds, count, width)?;
    let Some(best) = candidates.first().map(|c| c.score) else { return Ok(None) };
    let finalists: Vec<&Candidate> =
        candidates.iter().take(FINALISTS).filter(|c| c.score >= FINALIST_PART * best).collect();
    let found: Vec<Vec<Vec<Spot>>> = (0..film.count())
        .into_par_iter()
        .map(|i| {
            film.heed()?;
            let picture = film.read(i)?;
            let spots =
                |c: &&Candidate| grounds.spots(&response(&picture, c.model.octave), &c.model, c.limit);
            Ok(finalists.iter().map(spots).collect())
        })
        .collect::<Result<_>>()?;
    let mut runs: Vec<Run> = finalists
        .par_iter()
        .enumerate()
        .map(|(k, c)| run(film, c.model, found.iter().map(|p| p[k].clone()).collect(), width))
        .collect::<Result<_>>()?;
    runs.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut runs = runs.into_iter();
    let Some(winner) = runs.next() else { return Ok(None) };
    let (model, radius) = (winner.model, winner.model.radius_px());
    let heaviest = winner.group.iter().map(Track::weight).fold(0.0, f64::max);
    let mut keep: Vec<Track> =
        winner.group.into_iter().filter(|t| t.weight() > ANSWER_PART * heaviest).collect();
    let mut others: Vec<Track> = winner.others.into_iter().filter(|t| t.weight() > 0.3 * heaviest).collect();
    if keep.is_empty() {
        return Ok(None);
    }
    // Once more with nothing but spots of the look that was learned.
    let look = [0, 1].map(|c| median(&mut keep.iter().map(|t| t.look[c]).collect::<Vec<_>>()));
    let alone: Vec<Vec<Spot>> = winner
        .pictures
        .iter()
        .map(|p| p.iter().filter(|s| alike(&s.look(), &look, [0.9, 1.1])).copied().collect())
        .collect();
    let again: Vec<Track> = linked(&alone, radius, width)
        .into_iter()
        .filter(|t| t.moving && t.quality > LEAST_QUALITY && t.weight() > ANSWER_PART * heaviest)
        .collect();
    let (group, rest) = heaviest_group(again);
    let sum = |t: &[Track]| t.iter().map(Track::weight).sum::<f64>();
    if sum(&group) > sum(&keep) {
        keep = group;
        others.extend(rest);
    }
    for r in runs {
        for t in r.group.into_iter().chain(r.others) {
            let within = 1.2 * r.model.radius_px().max(radius);
            if t.weight() >= 0.5 * heaviest && !keep.iter().chain(&others).any(|o| same_marker(o, &t, within))
            {
                others.push(t);
            }
        }
    }
    let radii: Vec<f64> = keep
        .par_iter()
        .map(|t| Ok(refine(film, &mut t.clone(), &model, 24, None, None)?.radius_px))
        .collect::<Result<_>>()?;
    let radius_px = median(&mut radii.clone());
    let backdrop = Backdrop::learn(film, &model)?;
    let final_places =
        |t: &mut Track| refine(film, t, &model, usize::MAX, Some(radius_px), Some(&backdrop)).map(|_| ());
    // Twice: what comes to rest is looked for from places that the ground does not pull.
    keep.iter_mut().try_for_each(final_places)?;
    extend(film, &mut keep, &model)?;
    keep.iter_mut().try_for_each(final_places)?;
    keep.iter_mut().for_each(|t| t.settle(radius_px));
    Ok(Some(Followed { model, tracks: keep, radius_px, confidence: winner.purity * winner.compact, others }))
}

/// The look whose tracks have the greatest weight, and the rest.
fn heaviest_group(all: Vec<Track>) -> (Vec<Track>, Vec<Track>) {
    let weight = |seed: &Track| -> f64 {
        all.iter().filter(|t| alike(&t.look, &seed.look, LOOK)).map(Track::weight).sum()
    };
    let Some(seed) = all.iter().max_by(|a, b| weight(a).total_cmp(&weight(b))).map(|t| t.look) else {
        return (Vec::new(), Vec::new());
    };
    all.into_iter().partition(|t| alike(&t.look, &seed, LOOK))
}
