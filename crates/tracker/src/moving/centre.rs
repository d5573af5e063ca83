//! The centre of a marker: the middle of the region around a spot that stands out from what is behind it.
//!
//! Owns: [`Centres`], [`refine`]. Must not: link.

use std::f64::consts::PI;

use rayon::prelude::*;

use super::backdrop::Backdrop;
use super::model::Model;
use super::outline::{Circle, circle_of, circle_of_radius};
use super::own_colour::own_colour;
use super::picture::Film;
use super::response::Direction;
use super::spot::Spot;
use super::track::{Track, chosen};
use super::tracklet::median;
use super::window::{Region, Window};
use crate::error::Result;

/// Radius from which on a marker in colour is looked at along its own direction, px.
const OWN_COLOUR_FROM_PX: f64 = 6.0;
/// Places after which the radius is learned anew.
const RADIUS_AFTER: [usize; 3] = [5, 10, 15];
/// A region that is farther than this from where the marker's usually are is another region, in radii: two discs so far apart
/// have less than half of their area in common.
const OTHER_REGION_RADII: f64 = 0.8;
/// Area of a region over the usual one.
const AREA_RATIO: std::ops::Range<f64> = 0.45..2.2;
/// Area of a silhouette over that of the region along one colour direction: as large as the marker itself may be where the
/// direction sees only part of it, and not that of an arm or a hand that carries it.
const SILHOUETTE_RATIO: std::ops::Range<f64> = 0.7..3.0;
/// Part of the contrast by which the level is raised and lowered to see how far the centre depends on it.
const LEVEL_STEP: f64 = 0.2;
/// Part of that difference which is not known of the centre; the tests hold what it makes of the stated uncertainty.
const LEVEL_DOUBT: f64 = 0.12;
/// Part of the difference between the silhouette's centre and the region's which is not known of the centre.
const SILHOUETTE_DOUBT: f64 = 0.5;
/// Part of the difference between the centres along the marker's own colour direction and along the one it was found in which
/// is not known:
/// each is as good as the other, and the standard deviation of one of two values is their difference over sqrt(2).
const COLOUR_DOUBT: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Part of the difference between the outline's circle and the region which is not known of the centre.
const CIRCLE_DOUBT: f64 = 0.25;
/// Region and circle agree where their centres are nearer to each other than this, in radii: from there on it is said of a
/// centre that it is doubtful.
const DIFFER_RADII: f64 = 0.1;
/// Places before and after one whose circles tell its radius and about where it is.
const PLACES_AROUND: usize = 10;
/// A circle so many radii from where those around are is of another arc of the outline.
const OTHER_CIRCLE_RADII: f64 = 0.15;
/// Uncertainty of a centre by the filter's response alone, radii.
const COARSE_DOUBT_RADII: f64 = 0.3;
/// Uncertainty of a place that is none, radii: it is left out.
const NO_PLACE_RADII: f64 = 1.0;
/// Where this part of a track's places have a region, those at an end of a piece that have none are left out, so many at most: the
/// marker is half covered there, or it is something beside it that is seen.
const USUALLY_FOUND: f64 = 0.75;
const MOST_TRIMMED: usize = 3;

/// The refined centres of a track.
#[derive(Debug, Clone, Copy, Default)]
pub struct Centres {
    /// Radius of the marker, px.
    pub radius_px: f64,
    /// Part of the places at which a compact region was found.
    pub found: f64,
}

/// A centre that was found, px of the octave.
#[derive(Debug, Clone)]
struct Found {
    region: Region,
    /// How far it is from the spot.
    moved: f64,
    /// Uncertainty that comes from the way the centre was found.
    doubt: f64,
    /// Its outline, px from its centre, and the circle that most of it lies on, where there is one.
    outline: Vec<[f64; 2]>,
    circle: Option<Circle>,
}

/// The close look at the markers of one track.
struct Look<'a> {
    film: &'a dyn Film,
    model: Model,
    /// The marker's own colour direction.
    own: Option<Direction>,
    backdrop: Option<&'a Backdrop>,
    /// Half the length of a streak, px of the octave.
    half_length: f64,
}

impl Look<'_> {
    /// The centre of a marker of `radius` near a spot, both in px of the octave.
    fn centre(&self, picture: usize, at: [f64; 2], radius: f64) -> Result<Option<Found>> {
        self.film.heed()?;
        let reach = 2.3 * radius.max(self.half_length) + 3.0;
        let mut w = Window::cut(self.film, picture, self.model.fine_octave(), at, reach)?;
        let (x0, y0) = (w.x0 as f64, w.y0 as f64);
        let mut place = [at[0] - x0, at[1] - y0];
        w.look(self.model.direction, self.model.sign, self.backdrop, place, radius);
        let mut region = None;
        for _ in 0..2 {
            let Some(r) = w.region(place, radius, 0.0) else { break };
            (place, region) = ([r.x, r.y], Some(r));
        }
        let by_filter = region;
        if let Some(own) = self.own {
            w.look(own, 1.0, self.backdrop, place, radius);
            for _ in 0..3 {
                w.confine(place, radius);
                let Some(r) = w.region(place, radius, 0.0) else { break };
                (place, region) = ([r.x, r.y], Some(r));
            }
        }
        let Some(region) = region else { return Ok(None) };
        // Where what is behind its edge is uneven, a higher level has another centre than a lower one.
        let [low, high] =
            [-LEVEL_STEP, LEVEL_STEP].map(|step| w.region(place, radius, step).unwrap_or(region));
        let silhouette = match (self.backdrop, self.own) {
            (Some(backdrop), Some(_)) => w.silhouette(backdrop, place, radius),
            _ => None,
        };
        let silhouette = silhouette.filter(|(s, _)| SILHOUETTE_RATIO.contains(&(s.area / region.area)));
        let mut doubt = LEVEL_DOUBT * (high.x - low.x).hypot(high.y - low.y);
        let filter = by_filter.unwrap_or(region);
        doubt = doubt.hypot(COLOUR_DOUBT * (filter.x - region.x).hypot(filter.y - region.y));
        if let Some((s, _)) = &silhouette {
            // Which of the two is the marker is not known: strings belong to the silhouette, a net to the marker.
            doubt = doubt.hypot(SILHOUETTE_DOUBT * (s.x - region.x).hypot(s.y - region.y));
        }
        // A marker's own colour may leave out a part of it that its silhouette shows.
        let about = |outline: Vec<[f64; 2]>| -> Vec<[f64; 2]> {
            outline.iter().map(|p| [p[0] - region.x, p[1] - region.y]).collect()
        };
        let whole = silhouette.map(|(s, outline)| (about(outline), s.area));
        let whole = whole.and_then(|(o, area)| circle_of(&o, (area / PI).sqrt()).map(|c| (o, Some(c))));
        let (outline, circle) = match (self.own, whole) {
            (None, _) => (Vec::new(), None),
            (Some(_), Some(whole)) => whole,
            (Some(_), None) => {
                let own = about(w.outline(place, radius));
                let circle = circle_of(&own, (region.area / PI).sqrt());
                (own, circle)
            }
        };
        let region = Region { x: region.x + x0, y: region.y + y0, ..region };
        let moved = (region.x - at[0]).hypot(region.y - at[1]);
        Ok(Some(Found { region, moved, doubt, outline, circle }))
    }
}

/// Refines places of a track, at most `most` of them, evenly chosen; places without a compact region stay. The radius is
/// learned from the first ones unless it is given.
pub fn refine(
    film: &dyn Film,
    track: &mut Track,
    model: &Model,
    most: usize,
    radius_px: Option<f64>,
    backdrop: Option<&Backdrop>,
) -> Result<Centres> {
    let scale = (1usize << model.fine_octave()) as f64;
    let places = chosen(track, most);
    let spot = |&(p, i): &(usize, usize)| &track.pieces[p].spots[i];
    let value = |f: fn(&Spot) -> f64| median(&mut places.iter().map(|p| f(spot(p))).collect::<Vec<_>>());
    let first = radius_px.map_or_else(|| (value(|s| s.area) / PI).sqrt() / scale, |r| r / scale).max(1.2);
    let own =
        if first * scale >= OWN_COLOUR_FROM_PX { own_colour(film, track, first * scale)? } else { None };
    let half_length = value(|s| s.length) / scale / 2.0;
    let look = Look { film, model: *model, own, backdrop, half_length };
    let on_octave = |s: &Spot| [(s.x + 0.5) / scale - 0.5, (s.y + 0.5) / scale - 0.5];
    let found = |place: &(usize, usize), radius: f64| {
        look.centre(track.pieces[place.0].first + place.1, on_octave(spot(place)), radius)
    };
    let (results, radius) = match radius_px {
        Some(_) => (places.par_iter().map(|p| found(p, first)).collect::<Result<Vec<_>>>()?, first),
        None => learning_radius(&places, first, found)?,
    };
    let usual = median(&mut results.iter().flatten().map(|f| f.region.area).collect::<Vec<_>>());
    let to_circles = to_circles(&results, radius);
    // What the region is off the filter's answer by, px of the octave.
    let shifts: Vec<Option<([f64; 2], f64)>> = places
        .iter()
        .zip(results.iter().zip(&to_circles))
        .map(|(place, (found, to_circle))| {
            let Found { region, moved, doubt, .. } = found.as_ref()?;
            let at = on_octave(spot(place));
            let fits = *moved < radius + 0.5 && AREA_RATIO.contains(&(region.area / usual));
            let &[x, y] = to_circle;
            let doubt = doubt.hypot(CIRCLE_DOUBT * x.hypot(y));
            fits.then_some(([region.x + x - at[0], region.y + y - at[1]], doubt))
        })
        .collect();
    let middle = [0, 1].map(|k| median(&mut shifts.iter().flatten().map(|(s, _)| s[k]).collect::<Vec<_>>()));
    let off = |s: &[f64; 2]| (s[0] - middle[0]).hypot(s[1] - middle[1]);
    let is_cut = |found: &Option<Found>| found.as_ref().is_some_and(|f| f.region.is_cut);
    // What always reaches the border is no marker that leaves the picture.
    let leaves = 2 * results.iter().filter(|f| is_cut(f)).count() < results.len();
    let mut coarse: Vec<Place> = Vec::new();
    let mut good = 0;
    for ((&(p, i), shift), found) in places.iter().zip(&shifts).zip(&results) {
        let usual = shift.filter(|(s, _)| off(s) < OTHER_REGION_RADII * radius);
        let s = &mut track.pieces[p].spots[i];
        let [dx, dy] = usual.map_or(middle, |(shift, _)| shift);
        (s.x, s.y) = (s.x + dx * scale, s.y + dy * scale);
        let doubt = match usual {
            // A region half way to another one may be part of it.
            Some((shift, doubt)) if off(&shift) > OTHER_REGION_RADII / 2.0 * radius => {
                off(&shift).hypot(doubt)
            }
            Some((_, doubt)) => doubt,
            None => COARSE_DOUBT_RADII * radius,
        };
        let doubt = if leaves && is_cut(found) { NO_PLACE_RADII * radius } else { doubt };
        if usual.is_none() {
            coarse.push((p, i));
        }
        s.doubt_px = doubt * scale;
        good += usize::from(usual.is_some());
    }
    let found = good as f64 / places.len().max(1) as f64;
    if found >= USUALLY_FOUND {
        trim(track, &coarse, NO_PLACE_RADII * radius * scale);
    }
    Ok(Centres { radius_px: radius * scale, found })
}

/// Gives the coarse places at the ends of a track's pieces an uncertainty of so many px.
fn trim(track: &mut Track, coarse: &[Place], doubt_px: f64) {
    for (p, piece) in track.pieces.iter_mut().enumerate() {
        let is_coarse = |i: &usize| coarse.contains(&(p, *i));
        let n = piece.spots.len();
        let first: Vec<usize> = (0..n).take(MOST_TRIMMED).take_while(is_coarse).collect();
        let last: Vec<usize> = (0..n).rev().take(MOST_TRIMMED).take_while(is_coarse).collect();
        first.into_iter().chain(last).for_each(|i| piece.spots[i].doubt_px = doubt_px);
    }
}

/// From each region to the middle of its outline's circle, px of the octave; 0 where they agree or most have none. Where they do not
/// agree, the marker is a disc of which something covers a part: a net, a stripe, a highlight, fingers. Its radius is the usual one
/// of the pictures around, and a picture that shows no circle, or another one, has their usual offset.
fn to_circles(results: &[Option<Found>], radius: f64) -> Vec<[f64; 2]> {
    let circles: Vec<Option<Circle>> = results.iter().map(|f| f.as_ref().and_then(|f| f.circle)).collect();
    let all: Vec<Circle> = circles.iter().flatten().copied().collect();
    let mut apart: Vec<f64> = all.iter().map(|c| c.middle[0].hypot(c.middle[1])).collect();
    let most = 2 * all.len() > results.iter().flatten().count();
    if !most || median(&mut apart) <= DIFFER_RADII * radius {
        return vec![[0.0; 2]; results.len()];
    }
    let usual = middle_of(&all.iter().map(|c| c.middle).collect::<Vec<_>>());
    let around = |i: usize| i.saturating_sub(PLACES_AROUND)..(i + PLACES_AROUND + 1).min(results.len());
    let found: Vec<Option<[f64; 2]>> = (0..results.len())
        .map(|i| {
            let mut radii: Vec<f64> = circles[around(i)].iter().flatten().map(|c| c.radius).collect();
            let known = median(&mut radii);
            results[i].as_ref().and_then(|f| circle_of_radius(&f.outline, known)).map(|c| c.middle)
        })
        .collect();
    (0..results.len())
        .map(|i| {
            let near: Vec<[f64; 2]> = found[around(i)].iter().flatten().copied().collect();
            let there = if near.is_empty() { usual } else { middle_of(&near) };
            let is_other =
                |o: &[f64; 2]| (o[0] - there[0]).hypot(o[1] - there[1]) > OTHER_CIRCLE_RADII * radius;
            found[i].filter(|o| !is_other(o)).unwrap_or(there)
        })
        .collect()
}

fn middle_of(places: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|k| median(&mut places.iter().map(|p| p[k]).collect::<Vec<_>>()))
}

type Place = (usize, usize);

/// Centres one after the other, with a radius that is learned on the way.
fn learning_radius(
    places: &[Place],
    first: f64,
    found: impl Fn(&Place, f64) -> Result<Option<Found>>,
) -> Result<(Vec<Option<Found>>, f64)> {
    let (mut radius, mut results, mut areas) = (first, Vec::with_capacity(places.len()), Vec::new());
    for (k, place) in places.iter().enumerate() {
        let result = found(place, radius)?;
        areas.extend(result.as_ref().map(|f| f.region.area));
        results.push(result);
        if RADIUS_AFTER.contains(&k) && areas.len() * 2 > k {
            let mut last = areas[areas.len().saturating_sub(5)..].to_vec();
            let r = (median(&mut last) / PI).sqrt();
            radius = r.min((1.6 * radius).min(1.8 * first)).max((0.6 * radius).max(0.5 * first));
        }
    }
    Ok((results, radius))
}
