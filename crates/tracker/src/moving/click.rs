//! Follows what a user pointed at: of all ways of looking the one in which the track through that place holds best.
//!
//! Owns: [`Click`], [`follow_clicks`], [`Missed`], [`Unheld`]. Must not: follow anything else.

use rayon::prelude::*;

use super::marker::{Marker, compact};
use super::model::Model;
use super::patch::{Lost, Still, follow_picture};
use super::picture::Film;
use super::response::{response, responses};
use super::search::{Against, Search};
use super::spot::Spot;
use super::track::{Track, join, join_lone};
use super::tracklet::{End, Tracklet, link};
use crate::error::Result;

/// Limit of a spot at the place that was pointed at, in units of the noise: what was pointed at need not stand out from all else.
const PLACE_LIMIT: f32 = 3.0;
/// Signal to noise of a spot in another picture over that of the clicked one, from which on it may be the same thing.
const FILM_PART: f64 = 0.3;
/// Spots of a picture that are looked at, and how many of the look that was pointed at.
const MOST_SPOTS: usize = 150;
const MOST_ALIKE: usize = 30;
/// Distance from the click at which a spot counts 1/e, half radii of the octave's markers and pixels.
const REACH_CELLS: f64 = 2.2;
const REACH_PX: f64 = 1.0;
/// A person points at a marker's centre to so many of its radii, and to so many pixels.
const OFF_RADII: f64 = 0.7;
const OFF_PX: f64 = 2.0;
/// Ways of looking that are tried, in all and of one octave, and the least part of the best one's answer at the place.
const CHOICES: usize = 6;
const CHOICES_OF_OCTAVE: usize = 2;
const CHOICE_PART: f64 = 0.1;
/// Least signal to noise of a spot, weighted by its distance from the click.
const LEAST_SCORE: f64 = 1.0;
/// A spot of a track within this distance of the clicked spot is that spot, px.
const SAME_PX: f64 = 0.5;
/// Weight of a thing that is not compact at all, beside 1 of a compact one.
const LEAST_COMPACT: f64 = 0.2;
/// The look that was pointed at: factors 2.5 in peak and 3 in area, as logarithms.
const LOOK: [f64; 2] = [0.92, 1.1];
/// A streak has the same product of peak and length as the marker at rest, to a factor 2, as a logarithm.
const STREAK: f64 = 0.7;
/// Weight of a thing that does not move beside one that does: people point at what moves.
const STILL: f64 = 0.1;
/// A spot has a middle of its own, a picture the place that was pointed at: a picture must be found so many times as often.
const PREFER_SPOT: f64 = 1.5;
/// A track of fewer pictures holds nothing.
const LEAST_SPOTS: usize = 5;
/// Smoothness from which on a track holds.
const LEAST_SMOOTHNESS: f64 = 0.1;

/// A place in a picture, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Click {
    /// Index of the picture.
    pub picture: usize,
    /// Column, px.
    pub x: f64,
    /// Row, px.
    pub y: f64,
}

/// The reason for which nothing is followed from a place that was pointed at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Missed {
    /// Nothing stands out there.
    Nothing,
    /// The spot that stands out there, in this octave and colour direction, is seen in so few pictures in a row.
    Ends(Model, usize, End),
    /// The spot that stands out there is so much larger that its middle is not the place pointed at.
    Beside(Model),
    /// The spot is seen in so many pictures, but jumps or changes its look.
    Restless(Model, usize),
}

/// The reasons for which a place that was pointed at is followed neither as a spot nor by its picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unheld {
    /// Why not as a spot.
    pub spot: Missed,
    /// Why not by its picture.
    pub picture: Lost,
}

/// A way of looking at what was pointed at.
struct Choice {
    model: Model,
    against: Against,
    /// The spot that was pointed at.
    spot: Spot,
    limit: f32,
    score: f64,
}

impl Choice {
    /// Whether a spot may be what was pointed at, as its look goes.
    fn fits(&self, s: &Spot) -> bool {
        let ratio = |f: fn(&Spot) -> f64| (f(s) / f(&self.spot)).ln();
        let peak = ratio(|s| s.peak);
        let streak = ratio(|s| s.peak * s.length).abs() < STREAK;
        (peak.abs() < LOOK[0] || streak) && ratio(|s| s.area).abs() < LOOK[1]
    }
}

/// The worth of a marker, with the marker; or the reason for which it does not hold.
type Judged = Result<(f64, Marker), Missed>;

/// Ways of looking in which something stands out at a place, the best first.
fn choices(search: &Search, click: &Click) -> Result<Vec<Choice>> {
    let picture = search.film.read(click.picture)?;
    let all = responses(&picture, search.count);
    let models = search.models();
    let both: Vec<(Model, Against)> =
        models.iter().flat_map(|m| [Against::Ground, Against::Around].map(|a| (*m, a))).collect();
    let mut found: Vec<Choice> = both
        .into_par_iter()
        .filter_map(|(model, against)| {
            let spots =
                search.spots(&picture, &all[model.octave], &model, against, (PLACE_LIMIT, usize::MAX));
            let reach = REACH_CELLS * model.radius_px() / 2.0 + REACH_PX;
            let score = |s: &Spot| s.snr * (-(off(s, click) / reach).powi(2)).exp();
            let spot = spots.into_iter().max_by(|a, b| score(a).total_cmp(&score(b)))?;
            let limit = (FILM_PART * spot.snr).max(f64::from(PLACE_LIMIT)) as f32;
            let score = score(&spot);
            (score > LEAST_SCORE).then_some(Choice { model, against, spot, limit, score })
        })
        .collect();
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    let best = found.first().map_or(0.0, |c| c.score);
    let mut chosen: Vec<Choice> = Vec::new();
    for c in found {
        let same = |o: &&Choice| o.model.octave == c.model.octave && o.against == c.against;
        if c.score >= CHOICE_PART * best && chosen.iter().filter(same).count() < CHOICES_OF_OCTAVE {
            chosen.push(c);
        }
    }
    chosen.truncate(CHOICES);
    Ok(chosen)
}

fn off(s: &Spot, click: &Click) -> f64 {
    (s.x - click.x).hypot(s.y - click.y)
}

/// For each place the marker that is followed from there, or why none is; one of those `known` to move, if it holds better. Places of the markers are those of the filter alone;
/// [`super::finish`] refines them.
///
/// # Errors
/// Those of the film; [`crate::error::Error::Interrupted`] once the work is to stop.
pub fn follow_clicks(
    search: &Search,
    clicks: &[Click],
    known: &[Marker],
) -> Result<Vec<Result<Marker, Unheld>>> {
    let film = search.film;
    let tried: Vec<(usize, Choice)> = clicks
        .iter()
        .enumerate()
        .map(|(i, click)| Ok(choices(search, click)?.into_iter().map(move |c| (i, c))))
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .flatten()
        .collect();
    // By picture, then choice.
    let found: Vec<Vec<Vec<Spot>>> = (0..film.count())
        .into_par_iter()
        .map(|i| {
            film.heed()?;
            let picture = film.read(i)?;
            let spots = |(_, c): &(usize, Choice)| {
                let response = response(&picture, c.model.octave);
                let most = (c.limit, MOST_SPOTS);
                let mut spots = search.spots(&picture, &response, &c.model, c.against, most);
                spots.retain(|s| c.fits(s));
                spots.truncate(MOST_ALIKE);
                spots
            };
            Ok(tried.iter().map(spots).collect())
        })
        .collect::<Result<_>>()?;
    let judged: Vec<(usize, Judged)> = tried
        .par_iter()
        .enumerate()
        .map(|(k, (i, choice))| {
            let pictures: Vec<Vec<Spot>> = found.iter().map(|p| p[k].clone()).collect();
            Ok((*i, judge(search, &clicks[*i], choice, &pictures)?))
        })
        .collect::<Result<_>>()?;
    let mut judged = judged;
    for (i, click) in clicks.iter().enumerate() {
        for marker in known {
            if let Some((_, spot)) = marker.track.spots().find(|(k, _)| *k == click.picture) {
                let Some(model) = marker.model else { continue };
                let worth = worth(search, click, spot, &marker.track, model)?;
                if off(spot, click) < marker.radius_px + OFF_PX {
                    judged.push((i, Ok((worth.0, marker.clone()))));
                }
            }
        }
    }
    let best = |i: usize| {
        let mine = || judged.iter().filter(move |(j, _)| *j == i).map(|(_, r)| r);
        let best = mine().flatten().max_by(|a, b| a.0.total_cmp(&b.0));
        match (best, mine().find_map(|r| r.as_ref().err())) {
            (Some((_, marker)), _) => Ok(marker.clone()),
            (None, missed) => Err(missed.copied().unwrap_or(Missed::Nothing)),
        }
    };
    let spots: Vec<Result<Marker, Missed>> = (0..clicks.len()).map(best).collect();
    let held =
        |(spot, click): (&Result<Marker, Missed>, &Click)| spot.as_ref().map_or(0.0, |m| held(m, click));
    let held: Vec<f64> = spots.iter().zip(clicks).map(held).collect();
    if held.iter().all(|h| *h >= film.count() as f64) {
        return Ok(spots.into_iter().flatten().map(Ok).collect());
    }
    let still = Still::learn(film)?;
    let chosen = |((spot, click), held): ((Result<Marker, Missed>, &Click), f64)| {
        if held >= film.count() as f64 {
            return Ok(spot.map_err(|spot| Unheld { spot, picture: Lost::Soon(0) }));
        }
        Ok(match (by_picture(film, &still, click)?, spot) {
            (Ok(marker), _) if marker.track.count as f64 > held => Ok(marker),
            (_, Ok(marker)) | (Ok(marker), _) => Ok(marker),
            (Err(picture), Err(spot)) => Err(Unheld { spot, picture }),
        })
    };
    spots.into_par_iter().zip(clicks).zip(held).map(chosen).collect()
}

/// In how many pictures a thing must be found by its picture to be held better than it is as this spot: fewer the farther the spot's
/// middle is from what was pointed at.
fn held(marker: &Marker, click: &Click) -> f64 {
    let at_click = marker.track.spots().find(|(k, _)| *k == click.picture);
    let near = at_click.map_or(1.0, |(_, spot)| nearness(off(spot, click), marker.radius_px));
    PREFER_SPOT * marker.track.count as f64 * near
}

/// From 0 to 1: how likely a place so far, px, from the middle of a marker is pointed at for it.
fn nearness(off_px: f64, radius_px: f64) -> f64 {
    (-(off_px / (OFF_RADII * radius_px + OFF_PX)).powi(2)).exp()
}

/// The marker at the place that was pointed at, followed by its picture.
fn by_picture(film: &dyn Film, still: &Still, click: &Click) -> Result<Result<Marker, Lost>> {
    Ok(follow_picture(film, still, click.picture, [click.x, click.y])?.map(|(spots, radius_px)| Marker {
        track: Track::of(Tracklet::runs(&spots), radius_px),
        model: None,
        radius_px,
    }))
}

/// The track through a place in one way of looking, with what it is worth; else why it does not hold.
fn judge(search: &Search, click: &Click, choice: &Choice, pictures: &[Vec<Spot>]) -> Result<Judged> {
    let model = choice.model;
    let radius = model.radius_px();
    let is_clicked = |s: &Spot| (s.x - choice.spot.x).hypot(s.y - choice.spot.y) < SAME_PX;
    let tracklets = link(pictures, radius, search.width, 0);
    let at_click = |t: &&Tracklet| {
        let nth = click.picture.checked_sub(t.first);
        nth.and_then(|n| t.spots.get(n)).is_some_and(is_clicked)
    };
    let (alone, end) = tracklets.iter().find(at_click).map_or((0, End::Lost), |t| (t.spots.len(), t.end));
    let chains = join_lone(join(tracklets, radius), radius);
    let Some(chain) = chains.into_iter().find(|c| c.iter().any(|t| at_click(&t))) else {
        return Ok(Err(Missed::Ends(model, alone, end)));
    };
    let track = Track::of(chain, radius);
    if track.count < LEAST_SPOTS {
        return Ok(Err(Missed::Ends(model, track.count, end)));
    }
    if track.smoothness < LEAST_SMOOTHNESS {
        return Ok(Err(Missed::Restless(model, track.count)));
    }
    let (worth, radius_px) = worth(search, click, &choice.spot, &track, model)?;
    if off(&choice.spot, click) > radius_px + OFF_PX {
        return Ok(Err(Missed::Beside(model)));
    }
    Ok(Ok((worth, Marker { track, model: Some(model), radius_px })))
}

/// Weight of a track through a place as the thing pointed at, and its radius, px: how much of it is seen, how smoothly and far
/// it moves, how compact it is and how near to the place.
fn worth(search: &Search, click: &Click, spot: &Spot, track: &Track, model: Model) -> Result<(f64, f64)> {
    let (radius_px, compact) = compact(search.film, track, &model)?;
    let near = nearness(off(spot, click), radius_px);
    let moves = STILL + (1.0 - STILL) * track.quality;
    Ok((track.count as f64 * moves * (LEAST_COMPACT + (1.0 - LEAST_COMPACT) * compact) * near, radius_px))
}
