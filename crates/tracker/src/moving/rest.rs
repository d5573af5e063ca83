//! Markers that come to rest: a track is continued at its ends by the response without the still ground.
//!
//! Owns: [`extend`]. Must not: continue onto what was there before.

use std::collections::{HashMap, HashSet};

use super::model::Model;
use super::picture::Film;
use super::response::response;
use super::spot::{Spot, spots};
use super::track::{Track, extent};
use super::tracklet::{Tracklet, median};
use crate::error::Result;

/// Pictures in a row in which nothing may be found before a continuation ends.
const MISSES: usize = 3;
/// Pictures in which the place is looked at to see whether it was ever empty.
const EMPTY_PICTURES: usize = 25;

/// Spots about a place without the ground, px of the full octave.
fn around(film: &dyn Film, picture: usize, model: &Model, at: [f64; 2], radius_px: f64) -> Result<Vec<Spot>> {
    let step = 1usize << model.octave;
    let margin = (8 * step) as f64 + 2.0 * radius_px;
    let range = |c: f64| {
        let from = (c - margin).max(0.0) as usize;
        from - from % step..(c + margin).max(0.0) as usize + 1
    };
    let (x, y) = (range(at[0]), range(at[1]));
    let (x0, y0) = (x.start, y.start);
    let part = film.read_part(picture, x, y)?;
    if part.width < 6 * step || part.height < 6 * step {
        return Ok(Vec::new());
    }
    let r = response(&part, model.octave);
    let mut along = r.along(model.direction);
    along.iter_mut().for_each(|v| *v *= model.sign);
    let mut found = spots(&along, &along, None, (r.width, r.height), model.octave, (1.0, 20));
    for s in &mut found {
        s.x += x0 as f64;
        s.y += y0 as f64;
    }
    Ok(found)
}

/// Places by picture.
pub type Places = HashMap<usize, Vec<[f64; 2]>>;

/// Continues a track at both ends of each piece, but not onto places that are `taken` by other tracks.
pub fn extend(film: &dyn Film, track: &mut Track, model: &Model, taken: &Places) -> Result<()> {
    let radius = model.radius_px();
    let mut occupied: HashSet<usize> = track.spots().map(|(k, _)| k).collect();
    let mut strengths = Vec::new();
    for t in &track.pieces {
        for quarter in 1..4 {
            let i = (t.spots.len() * quarter / 4).min(t.spots.len() - 1);
            let s = &t.spots[i];
            let found = around(film, t.first + i, model, [s.x, s.y], radius)?;
            strengths.push(found.iter().map(|s| s.peak).fold(0.0, f64::max));
        }
    }
    let peak = median(&mut strengths);
    let mut added = Vec::new();
    for k in 0..track.pieces.len() {
        for forwards in [true, false] {
            let mut new = continued(film, &track.pieces[k], forwards, model, peak, (&occupied, taken))?;
            if new.len() < 2 || !was_empty_once(film, &new, model, peak)? {
                continue;
            }
            occupied.extend(new.iter().map(|(k, _)| *k));
            new.sort_by_key(|(k, _)| *k);
            added.extend(Tracklet::runs(&new));
        }
    }
    if !added.is_empty() {
        track.pieces.extend(added);
        track.pieces.sort_by_key(|t| t.first);
    }
    Ok(())
}

fn continued(
    film: &dyn Film,
    piece: &Tracklet,
    forwards: bool,
    model: &Model,
    peak: f64,
    (occupied, taken): (&HashSet<usize>, &Places),
) -> Result<Vec<(usize, Spot)>> {
    let radius = model.radius_px();
    let reach = 0.15 * radius + 0.3;
    let n = piece.spots.len();
    let mut past: Vec<[f64; 2]> = if forwards {
        piece.spots[n.saturating_sub(3)..].iter().map(|s| [s.x, s.y]).collect()
    } else {
        piece.spots[..n.min(3)].iter().rev().map(|s| [s.x, s.y]).collect()
    };
    let mut at = if forwards { piece.last() } else { piece.first };
    let (mut area, mut missed) = (None::<f64>, 0);
    let mut new = Vec::new();
    loop {
        film.heed()?;
        let next = if forwards { Some(at + 1).filter(|&k| k < film.count()) } else { at.checked_sub(1) };
        let Some(k) = next.filter(|k| !occupied.contains(k)) else { break };
        at = k;
        let last = past[past.len() - 1];
        let expected = match past.as_slice() {
            [.., a, b] => [2.0 * b[0] - a[0], 2.0 * b[1] - a[1]],
            _ => last,
        };
        let found = around(film, k, model, expected, radius)?;
        let off = |s: &Spot, p: [f64; 2]| (s.x - p[0]).hypot(s.y - p[1]);
        let error = |s: &Spot| off(s, expected).min(off(s, last));
        let looks = |s: &Spot| {
            (s.peak / peak).ln().abs() < 0.5 && area.is_none_or(|a: f64| (s.area / a).ln().abs() < 0.6)
        };
        let free = |s: &Spot| taken.get(&k).is_none_or(|all| all.iter().all(|&p| off(s, p) > radius));
        let mut good = found.iter().filter(|s| looks(s) && error(s) < 4.0 * reach + 0.5 && free(s));
        let near = found.iter().filter(|s| error(s) < 10.0 * reach + 0.5 && s.peak > 0.5 * peak).count();
        match (good.next(), good.next()) {
            (Some(s), None) if near == 1 => {
                past.push([s.x, s.y]);
                area = Some(area.map_or(s.area, |a| 0.9 * a + 0.1 * s.area));
                new.push((k, *s));
                missed = 0;
            }
            _ => {
                missed += 1;
                if missed > MISSES {
                    break;
                }
                past.push(last);
            }
        }
    }
    Ok(new)
}

/// Whether the place at which a continuation lies still was empty in some other picture.
fn was_empty_once(film: &dyn Film, new: &[(usize, Spot)], model: &Model, peak: f64) -> Result<bool> {
    let radius = model.radius_px();
    if extent(new.iter().map(|(_, s)| s)) >= 2.0 * radius {
        return Ok(true);
    }
    let Some((_, end)) = new.last() else { return Ok(false) };
    let n = film.count();
    let count = EMPTY_PICTURES.min(n);
    for k in (0..count).map(|k| k * (n - 1) / (count - 1).max(1)) {
        let found = around(film, k, model, [end.x, end.y], radius)?;
        let mut here = found.iter().filter(|s| (s.x - end.x).hypot(s.y - end.y) < 0.7 * radius + 1.0);
        if here.all(|s| s.peak < 0.5 * peak) {
            return Ok(true);
        }
    }
    Ok(false)
}
