//! Chooses what to look for by what it explains: every way of looking competes, and within each every look.
//!
//! Owns: [`survey`], [`Survey`], [`strongest`]. Must not: say which marker is wanted where nothing decides: the confidence tells.

use rayon::prelude::*;

use super::beside::{goes_beside, is_companion, join_by_look, overlap};
use super::ground::spread;
use super::marker::{Marker, compact};
use super::model::Model;
use super::picture::Film;
use super::response::{Response, response, responses};
use super::search::{Against, Search};
use super::spot::Spot;
use super::track::{Track, extent, linked, quality};
use super::tracklet::{link, median};
use crate::error::Result;

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
/// Further models that are run over the whole recording because one of their looks explains much, whatever else they see, and the
/// looks that are tried.
const LOOK_FINALISTS: usize = 2;
const SEEDS: usize = 4;
/// A look: factors 2.5 in peak and 2.1 in area, as logarithms.
const LOOK: [f64; 2] = [0.9, 0.75];
/// Quality from which on a track may be an answer.
const LEAST_QUALITY: f64 = 0.2;
/// Part of the best track's weight from which on another of its look is an answer.
const ANSWER_PART: f64 = 0.12;
/// Part of the best track's weight from which on a track is offered beside the answers: of another look, and along another
/// colour direction or octave.
const OTHER_LOOK_PART: f64 = 0.3;
const OTHER_MODEL_PART: f64 = 0.5;
/// Markers of several colours are made alike: their radii agree to this factor, as a logarithm; each is whole in this part of its
/// places, and explains this part of what looks like it.
const MADE_ALIKE: f64 = 0.22;
const MADE_WHOLE: f64 = 0.7;
const MADE_PURE: f64 = 0.2;
/// Part of the longest answer's pictures in which a marker of another colour must be seen.
const MADE_PART: f64 = 0.8;
/// Part of what looks like the only thing that moves which it must explain.
const SOLE_PART: f64 = 0.2;
/// Pieces that are kept at most, the longest.
const MOST_PIECES: usize = 40;
/// Pictures of which the one that shows most is taken, and places in it.
const STRONGEST_PICTURES: usize = 15;
const STRONGEST: usize = 9;
/// Spots of a picture and model where what stands still is among them.
const MOST_WITH_STILL: usize = 80;
/// Two tracks this near to each other, in radii, are one marker.
const SAME_RADII: f64 = 1.2;

/// The tracks of a recording, and the one that is likeliest meant.
#[derive(Debug, Clone, Default)]
pub struct Survey {
    /// All that moves smoothly, the likeliest markers first.
    pub markers: Vec<Marker>,
    /// How many of them, from the first on, are of the likeliest look: they answer.
    pub answers: usize,
    /// Shorter tracks of the same look, which may be pieces of the answers.
    pub pieces: Vec<Marker>,
    /// Part of what looks like them that the answers explain, times how compact they are: 0 to 1.
    pub confidence: f64,
    /// Whether there is nothing but one thing that moves, whole, smoothly and far, though it is seldom of the size that it was
    /// looked for: beside it there are only scraps.
    pub is_sole: bool,
    /// The confidence by the ways of looking that explain most of all they see, of those that follow the same: less than `confidence`
    /// where the winner explains much of one look only.
    pub usual_confidence: f64,
}

struct Candidate {
    model: Model,
    /// Parts explained: of all its spots by all that moves along it, and of the best look's spots by that look.
    score: f64,
    look: f64,
    /// Limit for the whole recording.
    limit: f32,
}

/// Spots of a picture and model, at most.
fn most(against: Against) -> usize {
    match against {
        Against::Ground => MOST_SPOTS,
        Against::Around => MOST_WITH_STILL,
    }
}

/// Tries every model on bursts; the best first.
fn candidates(search: &Search, against: Against) -> Result<Vec<Candidate>> {
    let film = search.film;
    let n = film.count();
    let length = BURST_PICTURES.min(n);
    let bursts = BURSTS.min((n / length).max(1));
    let starts = spread(n - length + 1, bursts);
    let models = search.models();
    // By burst, picture, model.
    let found: Vec<Vec<Vec<Vec<Spot>>>> = starts
        .iter()
        .map(|&b| {
            (b..b + length)
                .into_par_iter()
                .map(|i| {
                    film.heed()?;
                    let picture = film.read(i)?;
                    let all = responses(&picture, search.count);
                    let spots = |m: &Model| {
                        search.spots(&picture, &all[m.octave], m, against, (FIRST_LIMIT, most(against)))
                    };
                    Ok(models.iter().map(spots).collect())
                })
                .collect::<Result<_>>()
        })
        .collect::<Result<_>>()?;
    let mut out: Vec<Candidate> = models
        .par_iter()
        .enumerate()
        .filter_map(|(k, model)| {
            let burst = |(pictures, &first): (&Vec<Vec<Vec<Spot>>>, &usize)| {
                (first, pictures.iter().map(|p| p[k].clone()).collect())
            };
            tried(*model, &found.iter().zip(&starts).map(burst).collect::<Vec<_>>(), search.width)
        })
        .collect();
    out.sort_by(|a, b| b.score.total_cmp(&a.score));
    Ok(out)
}

/// The spots of bursts that a model explains, each burst with the index of its first picture and the spots of each; `None` if hardly any.
fn tried(model: Model, bursts: &[(usize, Vec<Vec<Spot>>)], width: f64) -> Option<Candidate> {
    let radius = model.radius_px();
    let (mut moved, mut all, mut standing) = (Vec::new(), Vec::new(), Vec::new());
    let (mut snr, mut snr_good) = (Vec::new(), Vec::new());
    for (first, pictures) in bursts {
        all.extend(pictures.iter().flatten().map(Spot::look));
        for t in link(pictures, radius, width, *first).iter().filter(|t| t.spots.len() >= 6) {
            if extent(t.spots.iter()) < (0.3 * radius).max(2.0) {
                standing.push((t.spots.len() as f64, t.look()));
                continue;
            }
            let q = quality(t, radius);
            moved.push((q * t.spots.len() as f64, t.look()));
            let strength = median(&mut t.spots.iter().map(|s| s.snr).collect::<Vec<_>>());
            snr.push(strength);
            if q > 0.3 {
                snr_good.push(strength);
            }
        }
    }
    let sum = |tracks: &[(f64, [f64; 2])]| tracks.iter().map(|t| t.0).sum::<f64>();
    let total = sum(&moved);
    if total < 5.0 {
        return None;
    }
    let count = bursts.iter().map(|b| b.1.len()).sum::<usize>() as f64;
    let score =
        |moved: f64, all: usize, standing: f64| moved / count * moved / (all as f64 - standing).max(1.0);
    moved.sort_by(|a, b| b.0.total_cmp(&a.0));
    let of_look = |seed: &(f64, [f64; 2])| {
        let like = |look: &[f64; 2]| alike(&seed.1, look, LOOK);
        let part = |t: &[(f64, [f64; 2])]| t.iter().filter(|t| like(&t.1)).map(|t| t.0).sum::<f64>();
        score(part(&moved), all.iter().filter(|l| like(l)).count(), part(&standing))
    };
    let look = moved.iter().take(SEEDS).map(of_look).fold(0.0, f64::max);
    let strength = median(&mut snr);
    let strength = strength / (strength + 15.0);
    snr_good.sort_unstable_by(f64::total_cmp);
    let quartile = snr_good.get(snr_good.len() / 4).copied().unwrap_or(20.0);
    let limit = (0.35 * quartile).max(5.0) as f32;
    let score = score(total, all.len(), sum(&standing)) * strength;
    Some(Candidate { model, score, look: look * strength, limit })
}

struct Run {
    model: Model,
    /// Whether it is run for one of its looks: what else moves along it is not offered.
    by_look: bool,
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
            by_look: false,
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
    let compact: Vec<f64> =
        group.par_iter().take(4).map(|t| Ok(compact(film, t, &model)?.1)).collect::<Result<_>>()?;
    let compact = compact.iter().sum::<f64>() / compact.len().max(1) as f64;
    let score = score * (0.2 + 0.8 * compact);
    Ok(Run { model, by_look: false, pictures, group, others, purity, compact, score })
}

/// The tracks of a recording, with those that are likeliest meant. Places are those of the filter alone; [`super::finish`]
/// refines them.
///
/// # Errors
/// Those of the film; [`crate::error::Error::Interrupted`] once the work is to stop.
pub fn survey(search: &Search, against: Against) -> Result<Survey> {
    let film = search.film;
    let candidates = candidates(search, against)?;
    let Some(best) = candidates.first().map(|c| c.score) else { return Ok(Survey::default()) };
    let mut finalists: Vec<&Candidate> =
        candidates.iter().take(FINALISTS).filter(|c| c.score >= FINALIST_PART * best).collect();
    let mut by_look: Vec<&Candidate> = candidates.iter().skip(finalists.len()).collect();
    by_look.sort_by(|a, b| b.look.total_cmp(&a.look));
    let usual = finalists.len();
    finalists.extend(by_look.into_iter().take(LOOK_FINALISTS));
    let found: Vec<Vec<Vec<Spot>>> = (0..film.count())
        .into_par_iter()
        .map(|i| {
            film.heed()?;
            let picture = film.read(i)?;
            // Bright and dark things of one size, and of any colour, have one response.
            let mut known: Vec<Option<Response>> = vec![None; search.count];
            let spots = |c: &&Candidate| {
                let octave = c.model.octave;
                let response = known[octave].get_or_insert_with(|| response(&picture, octave));
                search.spots(&picture, response, &c.model, against, (c.limit, most(against)))
            };
            Ok(finalists.iter().map(spots).collect())
        })
        .collect::<Result<_>>()?;
    let mut runs: Vec<Run> = finalists
        .par_iter()
        .enumerate()
        .map(|(k, c)| {
            let pictures = found.iter().map(|p| p[k].clone()).collect();
            Ok(Run { by_look: k >= usual, ..run(film, c.model, pictures, search.width)? })
        })
        .collect::<Result<_>>()?;
    runs.sort_by(|a, b| b.score.total_cmp(&a.score));
    let usual_confidence = usual_confidence(&runs);
    let mut runs = runs.into_iter();
    let Some(winner) = runs.next() else { return Ok(Survey::default()) };
    let (model, purity, confidence) = (winner.model, winner.purity, winner.purity * winner.compact);
    let Answers { keep, others, pieces, heaviest } = answers(winner, search.width);
    let marker = |t: Track, model: Model| Marker::of(film, t, model);
    let mut markers: Vec<Marker> = keep.into_iter().map(|t| marker(t, model)).collect::<Result<_>>()?;
    let answers = markers.len();
    // Markers of one look have one radius.
    let radius_px = median(&mut markers.iter().map(|m| m.radius_px).collect::<Vec<_>>());
    markers.iter_mut().for_each(|m| m.radius_px = radius_px);
    // The one that is seen first is first.
    markers.sort_by_key(|m| m.track.spots().next().map(|(k, _)| k));
    for t in others {
        markers.push(marker(t, model)?);
    }
    let of = Known { model, radius_px, heaviest, answers };
    let alike = of_other_models(film, runs, &mut markers, &of)?;
    markers.splice(answers..answers, alike.clone());
    let answers = answers + alike.len();
    markers[answers..].sort_by(|a, b| b.track.weight().total_cmp(&a.track.weight()));
    let is_sole = match markers.as_slice() {
        [only] if answers == 1 => only.goes_far() && purity * only.whole(film)? >= SOLE_PART,
        _ => false,
    };
    let pieces = pieces.into_iter().map(|track| Marker { track, model: Some(model), radius_px }).collect();
    Ok(Survey { markers, answers, pieces, confidence, is_sole, usual_confidence })
}

/// The greatest confidence of the runs, the best first, that are not made for one look and whose heaviest track is the best run's.
fn usual_confidence(runs: &[Run]) -> f64 {
    let heaviest = |r: &Run| {
        let radius_px = r.model.radius_px();
        r.group.first().map(|t| Marker { track: t.clone(), model: Some(r.model), radius_px })
    };
    let Some(best) = runs.first().and_then(heaviest) else { return 0.0 };
    let same = |r: &&Run| {
        heaviest(r).is_some_and(|m| m.is_same(&best, SAME_RADII * m.radius_px.max(best.radius_px)))
    };
    runs.iter().filter(|r| !r.by_look).filter(same).map(|r| r.purity * r.compact).fold(0.0, f64::max)
}

/// Facts known of the answers when the other models' tracks are looked at.
struct Known {
    model: Model,
    radius_px: f64,
    heaviest: f64,
    answers: usize,
}

/// Adds what moves along other models, but not a second time, to the `markers`, of which the first are the answers. What comes back is made
/// as the answers are and has another colour: it belongs to them.
fn of_other_models(
    film: &dyn Film,
    runs: impl Iterator<Item = Run>,
    markers: &mut Vec<Marker>,
    known: &Known,
) -> Result<Vec<Marker>> {
    let longest = markers[..known.answers].iter().map(|m| m.track.count).max().unwrap_or(0);
    let mut alike: Vec<Marker> = Vec::new();
    for r in runs {
        let (count, is_pure) = (r.group.len(), r.purity * r.compact >= MADE_PURE);
        let tracks = r.group.into_iter().chain(r.others).enumerate();
        for (k, t) in tracks.filter(|(_, t)| t.weight() >= OTHER_MODEL_PART * known.heaviest) {
            let within = SAME_RADII * r.model.radius_px().max(known.model.radius_px());
            let new = Marker { track: t, model: Some(r.model), radius_px: r.model.radius_px() };
            if markers.iter().chain(&alike).any(|o| o.is_same(&new, within)) {
                continue;
            }
            let new = Marker::of(film, new.track, r.model)?;
            let is_as_long = new.track.count as f64 >= MADE_PART * longest as f64;
            let has_their_size = (new.radius_px / known.radius_px).ln().abs() < MADE_ALIKE;
            let goes_alone = !markers[..known.answers].iter().any(|a| goes_beside(&new.track, &a.track));
            let belongs = is_pure && k < count && is_as_long && has_their_size && goes_alone;
            if belongs && new.whole(film)? >= MADE_WHOLE {
                alike.push(new);
            } else if !r.by_look {
                markers.push(new);
            }
        }
    }
    Ok(alike)
}

/// Of a run the tracks that answer, others that move, shorter ones of the answers' look, and the weight of the heaviest of all.
struct Answers {
    keep: Vec<Track>,
    others: Vec<Track>,
    pieces: Vec<Track>,
    heaviest: f64,
}

fn answers(winner: Run, width: f64) -> Answers {
    let radius = winner.model.radius_px();
    let heaviest = winner.group.iter().map(Track::weight).fold(0.0, f64::max);
    let mut keep: Vec<Track> =
        winner.group.into_iter().filter(|t| t.weight() > ANSWER_PART * heaviest).collect();
    let mut others: Vec<Track> =
        winner.others.into_iter().filter(|t| t.weight() > OTHER_LOOK_PART * heaviest).collect();
    if keep.is_empty() {
        return Answers { keep, others, pieces: Vec::new(), heaviest };
    }
    // Once more with nothing but spots of the look that was learned.
    let look = [0, 1].map(|c| median(&mut keep.iter().map(|t| t.look[c]).collect::<Vec<_>>()));
    let alone: Vec<Vec<Spot>> = winner
        .pictures
        .iter()
        .map(|p| p.iter().filter(|s| alike(&s.look(), &look, [0.9, 1.1])).copied().collect())
        .collect();
    let smooth = linked(&alone, radius, width).into_iter().filter(|t| t.smoothness > LEAST_QUALITY);
    let (again, mut pieces): (Vec<Track>, Vec<Track>) =
        smooth.partition(|t| t.moving && t.quality > LEAST_QUALITY && t.weight() > ANSWER_PART * heaviest);
    let (group, rest) = heaviest_group(again);
    let sum = |t: &[Track]| t.iter().map(Track::weight).sum::<f64>();
    if sum(&group) > sum(&keep) {
        keep = group;
        others.extend(rest);
    }
    let (companions, mut keep): (Vec<Track>, Vec<Track>) = {
        let all = keep.clone();
        keep.into_iter().partition(|t| all.iter().any(|a| is_companion(t, a)))
    };
    others.extend(companions);
    join_by_look(&mut keep, radius);
    pieces.extend(others.iter().cloned());
    pieces.retain(|t| alike(&t.look, &look, LOOK) && !keep.iter().any(|k| overlap(k, t, radius)));
    pieces.sort_by_key(|t| std::cmp::Reverse(t.count));
    pieces.truncate(MOST_PIECES);
    Answers { keep, others, pieces, heaviest }
}

/// The strongest spots of the picture in which most stands out, strongest first: for recordings in which nothing moves smoothly.
///
/// # Errors
/// Those of the film; [`crate::error::Error::Interrupted`] once the work is to stop.
pub fn strongest(search: &Search) -> Result<(usize, Vec<(Model, Spot)>)> {
    let models = search.models();
    let n = search.film.count();
    let mut best: (f64, usize, Vec<(Model, Spot)>) = (0.0, 0, Vec::new());
    for i in spread(n, STRONGEST_PICTURES.min(n)) {
        search.film.heed()?;
        let picture = search.film.read(i)?;
        let all = responses(&picture, search.count);
        let mut found: Vec<(Model, Spot)> = models
            .par_iter()
            .flat_map_iter(|m| {
                let limit = (FIRST_LIMIT, MOST_SPOTS);
                let spots = search.spots(&picture, &all[m.octave], m, Against::Ground, limit);
                spots.into_iter().map(|s| (*m, s))
            })
            .collect();
        found.sort_by(|a, b| b.1.snr.total_cmp(&a.1.snr));
        let mut apart: Vec<(Model, Spot)> = Vec::new();
        for (m, s) in found {
            let near =
                |(n, o): &(Model, Spot)| (o.x - s.x).hypot(o.y - s.y) < m.radius_px().max(n.radius_px());
            if apart.len() < STRONGEST && !apart.iter().any(near) {
                apart.push((m, s));
            }
        }
        let sum = apart.iter().map(|(_, s)| s.snr).sum();
        if sum > best.0 {
            best = (sum, i, apart);
        }
    }
    Ok((best.1, best.2))
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
