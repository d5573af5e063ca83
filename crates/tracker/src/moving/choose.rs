//! Chooses what to look for by what it explains: every way of looking competes, and within each every look.
//!
//! Owns: [`survey`], [`Survey`], [`strongest`]. Must not: say which marker is wanted where nothing decides: the confidence tells.

use rayon::prelude::*;

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
/// A companion is seen in at most this part of the pictures in which the other one is, and it in at least this part of its own
/// pictures; its offset changes by at most this part of its travel.
const COMPANION_PART: f64 = 0.5;
const COMPANION_SEEN: f64 = 0.8;
const COMPANION_OFFSET: f64 = 0.25;
/// Looks of one marker in two stretches: its contrast changes by a third with what is behind it, its area by a tenth (standard
/// deviations of the logarithms). They agree below two of them, and others' looks must be two farther away.
const LOOK_SCATTER: [f64; 2] = [0.3, 0.1];
const SAME_LOOK: f64 = 2.0;
const CLEAR_LOOK: f64 = 2.0;
/// Part of what looks like the only thing that moves which it must explain.
const SOLE_PART: f64 = 0.2;
/// Pieces that are kept at most, the longest.
const MOST_PIECES: usize = 40;
/// Pictures of which the one that shows most is taken, and places in it.
const STRONGEST_PICTURES: usize = 15;
const STRONGEST: usize = 9;
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
}

struct Candidate {
    model: Model,
    score: f64,
    /// Limit for the whole recording.
    limit: f32,
}

/// Tries every model on bursts; the best first.
fn candidates(search: &Search) -> Result<Vec<Candidate>> {
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
                        search.spots(&picture, &all[m.octave], m, Against::Ground, (FIRST_LIMIT, MOST_SPOTS))
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
            let radius = model.radius_px();
            let (mut moved, mut all, mut standing) = (0.0, 0, 0);
            let (mut snr, mut snr_good) = (Vec::new(), Vec::new());
            for (burst, &first) in found.iter().zip(&starts) {
                let pictures: Vec<Vec<Spot>> = burst.iter().map(|p| p[k].clone()).collect();
                all += pictures.iter().map(Vec::len).sum::<usize>();
                for t in link(&pictures, radius, search.width, first).iter().filter(|t| t.spots.len() >= 6) {
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
    let compact: Vec<f64> =
        group.par_iter().take(4).map(|t| Ok(compact(film, t, &model)?.1)).collect::<Result<_>>()?;
    let compact = compact.iter().sum::<f64>() / compact.len().max(1) as f64;
    Ok(Run { model, pictures, group, others, purity, compact, score: score * (0.2 + 0.8 * compact) })
}

/// The tracks of a recording, with those that are likeliest meant. Places are those of the filter alone; [`super::finish`]
/// refines them.
///
/// # Errors
/// Those of the film; [`crate::error::Error::Interrupted`] once the work is to stop.
pub fn survey(search: &Search) -> Result<Survey> {
    let film = search.film;
    let candidates = candidates(search)?;
    let Some(best) = candidates.first().map(|c| c.score) else { return Ok(Survey::default()) };
    let finalists: Vec<&Candidate> =
        candidates.iter().take(FINALISTS).filter(|c| c.score >= FINALIST_PART * best).collect();
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
                search.spots(&picture, response, &c.model, Against::Ground, (c.limit, MOST_SPOTS))
            };
            Ok(finalists.iter().map(spots).collect())
        })
        .collect::<Result<_>>()?;
    let mut runs: Vec<Run> = finalists
        .par_iter()
        .enumerate()
        .map(|(k, c)| run(film, c.model, found.iter().map(|p| p[k].clone()).collect(), search.width))
        .collect::<Result<_>>()?;
    runs.sort_by(|a, b| b.score.total_cmp(&a.score));
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
    for r in runs {
        for t in r.group.into_iter().chain(r.others).filter(|t| t.weight() >= OTHER_MODEL_PART * heaviest) {
            let within = SAME_RADII * r.model.radius_px().max(model.radius_px());
            let new = Marker { track: t, model: Some(r.model), radius_px: r.model.radius_px() };
            if !markers.iter().any(|o| o.is_same(&new, within)) {
                markers.push(marker(new.track, r.model)?);
            }
        }
    }
    markers[answers..].sort_by(|a, b| b.track.weight().total_cmp(&a.track.weight()));
    let is_sole = match markers.as_slice() {
        [only] if answers == 1 => only.goes_far() && purity * only.whole(film)? >= SOLE_PART,
        _ => false,
    };
    let pieces = pieces.into_iter().map(|track| Marker { track, model: Some(model), radius_px }).collect();
    Ok(Survey { markers, answers, pieces, confidence, is_sole })
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

/// Whether two tracks are in one place in some picture.
fn overlap(a: &Track, b: &Track, radius_px: f64) -> bool {
    let places: std::collections::HashMap<usize, &Spot> = a.spots().collect();
    b.spots().any(|(k, s)| places.get(&k).is_some_and(|o| (o.x - s.x).hypot(o.y - s.y) < radius_px))
}

/// Whether a track goes beside a longer one and nowhere else, as a shadow or a reflection does: it is offered and not named.
fn is_companion(t: &Track, of: &Track) -> bool {
    if (t.count as f64) > COMPANION_PART * of.count as f64 {
        return false;
    }
    let places: std::collections::HashMap<usize, &Spot> = of.spots().collect();
    let beside: Vec<(&Spot, Spot)> = t
        .spots()
        .filter_map(|(k, s)| places.get(&k).map(|o| (s, Spot { x: s.x - o.x, y: s.y - o.y, ..*s })))
        .collect();
    let offset = extent(beside.iter().map(|(_, d)| d));
    let travel = extent(beside.iter().map(|(s, _)| *s));
    beside.len() as f64 > COMPANION_SEEN * t.count as f64 && offset < COMPANION_OFFSET * travel
}

/// Joins tracks that are never seen together where the look of two agrees better than those of any other two of which one is seen
/// while one of them is.
fn join_by_look(tracks: &mut Vec<Track>, radius_px: f64) {
    loop {
        let apart = |a: &Track, b: &Track| {
            let [peak, area] = [0, 1].map(|k| (a.look[k] - b.look[k]) / LOOK_SCATTER[k]);
            peak.hypot(area)
        };
        let span = |t: &Track| (t.spots().next().map_or(0, |s| s.0), t.spots().last().map_or(0, |s| s.0));
        let spans: Vec<(usize, usize)> = tracks.iter().map(span).collect();
        // Two that are seen at one time are two markers, so that only one of them is the same as a third.
        let meet = |a: usize, b: usize| spans[a].0 <= spans[b].1 && spans[b].0 <= spans[a].1;
        let follows = |a: &Track, b: &Track| match (a.spots().last(), b.spots().next()) {
            (Some((end, p)), Some((begin, q))) => {
                let fastest = |t: &Track| t.pieces.iter().map(|p| p.longest_step_px()).fold(0.0, f64::max);
                let reach = fastest(a).max(fastest(b)) * begin.saturating_sub(end) as f64 + 3.0 * radius_px;
                begin > end && (p.x - q.x).hypot(p.y - q.y) <= reach
            }
            _ => false,
        };
        let n = tracks.len();
        let pairs: Vec<(f64, usize, usize)> = (0..n)
            .flat_map(|a| (0..n).map(move |b| (a, b)))
            .filter(|&(a, b)| a != b && follows(&tracks[a], &tracks[b]))
            .map(|(a, b)| (apart(&tracks[a], &tracks[b]), a, b))
            .collect();
        let gap = |a: usize, b: usize| spans[b].0 - spans[a].1;
        // One that is seen in between and may be the same decides first.
        let between = |a: usize, b: usize| {
            let ends = pairs.iter().filter(|p| p.1 == a && p.0 < SAME_LOOK).map(|p| p.2);
            ends.into_iter().any(|c| spans[c].1 < spans[b].0)
        };
        let clear = |&&(d, a, b): &&(f64, usize, usize)| {
            let rivals = pairs
                .iter()
                .filter(|p| (p.1 == a && p.2 != b && meet(p.2, b)) || (p.2 == b && p.1 != a && meet(p.1, a)));
            d < SAME_LOOK
                && !between(a, b)
                && rivals.map(|p| p.0).fold(f64::INFINITY, f64::min) > d + CLEAR_LOOK
        };
        let Some(&(_, a, b)) = pairs.iter().filter(clear).min_by_key(|p| gap(p.1, p.2)) else { return };
        let mut pieces = tracks[a].pieces.clone();
        pieces.extend(tracks[b].pieces.iter().cloned());
        tracks[a] = Track::of(pieces, radius_px);
        tracks.remove(b);
    }
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

#[cfg(test)]
mod tests {
    use super::super::tracklet::Tracklet;
    use super::*;

    /// A stretch of a marker of a peak and an area that goes to and fro.
    fn stretch(pictures: std::ops::Range<usize>, peak: f64, area: f64) -> Track {
        let spot = |k: usize| {
            let x = 100.0 + 40.0 * (0.2 * k as f64).sin();
            let (y, elongation, direction) = (80.0, 1.0, 0.0);
            let (length, snr, doubt_px) = (8.0, 30.0, 0.0);
            (k, Spot { x, y, peak, area, elongation, direction, length, snr, doubt_px })
        };
        Track::of(Tracklet::runs(&pictures.map(spot).collect::<Vec<_>>()), 8.0)
    }

    fn joined(mut tracks: Vec<Track>) -> Vec<usize> {
        join_by_look(&mut tracks, 8.0);
        let mut counts: Vec<usize> = tracks.iter().map(|t| t.count).collect();
        counts.sort_unstable();
        counts
    }

    #[test]
    fn stretches_are_joined_by_their_area_though_their_contrast_changes() {
        // The first and the last are the smaller one of two that are seen meanwhile.
        let small = |p: std::ops::Range<usize>, peak: f64| stretch(p, peak, 600.0);
        let three = vec![small(0..50, 42.0), small(60..200, 51.0), small(230..300, 38.0)];
        let other = stretch(70..190, 35.0, 900.0);
        assert_eq!(joined([three.clone(), vec![other]].concat()), [120, 260]);
        // Of two that are alike nothing tells which it is.
        let twin = small(70..190, 47.0);
        assert_eq!(joined([three, vec![twin]].concat()), [50, 70, 120, 140]);
    }
}
