//! Follows a thing by its picture, from the picture in which it was pointed at to both ends of the recording.
//!
//! Owns: [`follow_picture`], [`Lost`]. Must not: guess: where it is not certain the thing is lost.

use super::align::{Match, align};
use super::search::{Plane, search};
use super::still::{Cover, Still, plane};
use super::surface::Surface;
use super::template::{Pose, Template};
use crate::error::Result;
use crate::moving::picture::Film;
use crate::moving::spot::Spot;

/// Radius of a template, px: smaller ones have little to hold on to, and larger things turn and bend.
const LEAST_RADIUS_PX: usize = 6;
const MOST_RADIUS_PX: usize = 24;
/// A template reaches so many times the radius of a disc of the area that the thing covers.
const RADIUS_PART: f64 = 1.3;
/// Pixels of a thing's border show what is behind it, too: so many px of it.
const BORDER_PX: i64 = 2;
/// Pictures before and after from which a thing's extent is learned: at most, at least, and the least distance of the thing
/// in them, px.
const GROW_PICTURES: usize = 12;
const GROW_LEAST: usize = 4;
const GROW_PX: f64 = 2.5;
/// Likeness from which on a place is certain where the thing is expected, and where it was lost before.
const CERTAIN: f64 = 0.7;
const CERTAIN_AGAIN: f64 = 0.8;
/// Likeness of the places from which a template is learned anew.
const RENEW: std::ops::Range<f64> = 0.8..0.9;
/// Likeness from which on a picture shows the thing as the template has it.
const ALIKE: f64 = 0.9;
/// Difference of likeness up to which another place competes.
const RIVAL: f64 = 0.08;
/// A thing of which the noise leaves more open than this, px, is not held by its picture.
const MOST_SIGMA_PX: f64 = 0.25;
/// Greatest change of the logarithm of the size from picture to picture.
const MOST_GROWTH: f64 = 0.15;
/// Turns that are tried beside the expected one, rad: Gauss-Newton finds those between.
const TURNS: [f64; 5] = [0.0, 0.25, -0.25, 0.5, -0.5];
/// How far the thing may be from where it is expected, px: so many radii, more by this part for each picture in which it is not
/// seen, and never more than `MOST_GATE_PX`. Its first step is not known: it may be so many times as long.
const GATE_RADII: f64 = 0.6;
const FIRST_GATE: f64 = 3.0;
const GATE_GROWTH: f64 = 0.5;
const MOST_GATE_PX: f64 = 48.0;
/// Least part of the gate beside its radii, px, and how far the fit may end outside of it.
const GATE_PX: f64 = 2.0;
const GATE_MARGIN_PX: f64 = 1.0;
/// The surface about the expected place reaches so many radii and pixels beyond the gate: the template and its spline's border.
const REACH_PART: f64 = 1.2;
const REACH_PX: f64 = 6.0;
/// Two places are two from this many radii on.
const APART_RADII: f64 = 0.25;
/// Pictures in a row in which it is not seen before it is given up.
const MISSES: usize = 40;
/// Pictures in a row before the latest template is given up; the first one is sought for `MISSES`.
const LATEST_MISSES: usize = 2;
/// Pictures before the motion is known.
const YOUNG: usize = 3;
/// In fewer pictures nothing is followed.
const LEAST_PICTURES: usize = 5;

/// The reason for which nothing is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lost {
    /// The thing stands still all through the recording.
    Still,
    /// The thing has too little texture: noise leaves its place more uncertain than `MOST_SIGMA_PX`.
    Plain,
    /// The thing is seen with certainty in so many pictures only.
    Soon(usize),
}

/// The look of the thing in one picture.
struct Look {
    template: Template,
    /// The thing's pose there, in terms of the first picture.
    pose: Pose,
    /// Uncertainty of its place there, px.
    sigma_px: f64,
}

impl Look {
    /// A pose in terms of the first picture as one of this template.
    fn own(&self, pose: &Pose) -> Pose {
        Pose { angle: pose.angle - self.pose.angle, log_size: pose.log_size - self.pose.log_size, ..*pose }
    }

    /// A pose of this template as one in terms of the first picture.
    fn common(&self, pose: &Pose) -> Pose {
        Pose { angle: pose.angle + self.pose.angle, log_size: pose.log_size + self.pose.log_size, ..*pose }
    }
}

/// The places of a thing that was pointed at, with its radius, px.
pub type Places = (Vec<(usize, Spot)>, f64);

/// Follows what is at a place of a picture, px; streaming, both ways at once.
///
/// # Errors
/// Those of the film; [`crate::error::Error::Interrupted`] once the work is to stop.
pub fn follow_picture(
    film: &dyn Film,
    still: &Still,
    picture: usize,
    [x, y]: [f64; 2],
) -> Result<Result<Places, Lost>> {
    let first = plane(&film.read(picture)?);
    let start = Pose { x, y, angle: 0.0, log_size: 0.0 };
    let cover = still.cover(&first, [start.x, start.y], MOST_RADIUS_PX);
    if cover.count < Template::LEAST_POINTS {
        return Ok(Err(Lost::Still));
    }
    let Some(template) = held(&first, still, &start, &cover) else { return Ok(Err(Lost::Plain)) };
    // First what moves together with the place, then what that usually looks like.
    let (template, cover) = {
        let seen = near(film, still, &template, (picture, start))?;
        let turned = |p: &Pose| p.off(&start).max((p.angle * template.radius_px).abs());
        let away: Vec<(Pose, Plane)> =
            seen.into_iter().filter(|(m, _)| turned(&m.pose) > GROW_PX).map(|(m, p)| (m.pose, p)).collect();
        let grown = (away.len() >= GROW_LEAST).then(|| still.grown(&first, &cover, &away));
        match grown.and_then(|c| Some((held(&first, still, &start, &c)?, c))) {
            Some(grown) => grown,
            None => (template, cover),
        }
    };
    let alike: Vec<(Pose, Plane)> = near(film, still, &template, (picture, start))?
        .into_iter()
        .filter(|(m, _)| m.likeness > ALIKE)
        .map(|(m, p)| (m.pose, p))
        .collect();
    let usual = if alike.len() >= GROW_LEAST { usual(&first, &start, &alike) } else { None };
    let usual = usual.and_then(|p| held(&p, still, &start, &cover));
    // Its places are about the one that the noise of the first picture gave it.
    let sigma_px = if usual.is_some() { template.bound_px(still.noise) } else { 0.0 };
    let template = usual.unwrap_or(template);
    let area = template.points.len() as f64;
    let way = |forwards: bool| -> Result<Vec<(usize, Match)>> {
        let look = Look { template: template.clone(), pose: start, sigma_px };
        Follower::new(film, still, look, picture).run(forwards, usize::MAX)
    };
    let (before, after) = rayon::join(|| way(false), || way(true));
    let (mut before, after) = (before?, after?);
    before.reverse();
    let own = Match { pose: start, likeness: 1.0, sigma_px: template.bound_px(still.noise) };
    let all: Vec<(usize, Match)> = before.into_iter().chain([(picture, own)]).chain(after).collect();
    if all.len() < LEAST_PICTURES {
        return Ok(Err(Lost::Soon(all.len())));
    }
    let spots = all.iter().map(|(k, m)| (*k, spot(m, area, template.contrast / area.sqrt(), still.noise)));
    Ok(Ok((spots.collect(), (area / std::f64::consts::PI).sqrt())))
}

/// Certain places in pictures just after and before the one that was pointed at.
fn near(
    film: &dyn Film,
    still: &Still,
    template: &Template,
    (picture, start): (usize, Pose),
) -> Result<Vec<(Match, Plane)>> {
    let way = |forwards| {
        let look = Look { template: template.clone(), pose: start, sigma_px: 0.0 };
        Follower::new(film, still, look, picture).run(forwards, GROW_PICTURES)
    };
    let all = way(true)?.into_iter().chain(way(false)?);
    all.map(|(k, m)| Ok((m, plane(&film.read(k)?)))).collect()
}

/// Template of a thing that covers so much of a picture, if its texture holds it.
fn held(first: &Plane, still: &Still, start: &Pose, cover: &Cover) -> Option<Template> {
    let disc = (cover.count as f64 / std::f64::consts::PI).sqrt();
    let radius = ((RADIUS_PART * disc) as usize).clamp(LEAST_RADIUS_PX, MOST_RADIUS_PX);
    // What is plain but for its outline is held by that.
    let inner = cover.inner(BORDER_PX);
    [&inner, cover].into_iter().find_map(|cover| {
        let template = cut(first, start, radius, |x, y| cover.holds(x, y))?;
        (template.bound_px(still.noise) < MOST_SIGMA_PX).then_some(template)
    })
}

/// A picture with what is about the thing as it usually looks, by its places in others: the noise of one of them is not in it.
fn usual(first: &Plane, start: &Pose, alike: &[(Pose, Plane)]) -> Option<Plane> {
    let reach = (MOST_RADIUS_PX + 6) as f64;
    let surfaces: Vec<(Pose, Surface)> = alike
        .iter()
        .map(|(pose, p)| {
            let far = reach * 1.5 * pose.log_size.exp() + 4.0;
            Some((*pose, Surface::around(&p.values, p.size, [pose.x, pose.y], far)?))
        })
        .collect::<Option<_>>()?;
    let mut out = first.clone();
    let range =
        |c: f64, n: usize| ((c - reach).max(0.0) as usize)..((c + reach).max(0.0) as usize + 1).min(n);
    for y in range(start.y, first.size.1) {
        for x in range(start.x, first.size.0) {
            let point = [x as f64 - start.x, y as f64 - start.y];
            let v = &mut out.values[y * first.size.0 + x];
            let others = surfaces.iter().filter_map(|(pose, s)| s.value(pose.place(point)));
            let (sum, n) = others.fold((f64::from(*v), 1.0), |(s, n), o| (s + o, n + 1.0));
            *v = (sum / n) as f32;
        }
    }
    Some(out)
}

fn cut(plane: &Plane, pose: &Pose, radius: usize, covers: impl Fn(i64, i64) -> bool) -> Option<Template> {
    let surface = Surface::around(&plane.values, plane.size, [pose.x, pose.y], radius as f64 + 4.0)?;
    Template::cut(&surface, pose, radius, covers)
}

/// A match as a spot; `contrast` is the root mean square of the thing's own contrast, grey levels.
fn spot(m: &Match, area: f64, contrast: f64, noise: f64) -> Spot {
    let size = m.pose.log_size.exp();
    Spot {
        x: m.pose.x,
        y: m.pose.y,
        peak: contrast,
        area: area * size * size,
        elongation: 1.0,
        direction: 0.0,
        length: 2.0 * (area / std::f64::consts::PI).sqrt() * size,
        snr: contrast / noise,
        doubt_px: m.sigma_px,
    }
}

struct Follower<'a> {
    film: &'a dyn Film,
    still: &'a Still,
    first: Look,
    latest: Option<Look>,
    /// Certain places: picture and pose.
    past: Vec<(usize, Pose)>,
}

impl<'a> Follower<'a> {
    fn new(film: &'a dyn Film, still: &'a Still, first: Look, picture: usize) -> Self {
        let past = vec![(picture, first.pose)];
        Self { film, still, first, latest: None, past }
    }

    /// Its places in the pictures from the first on, forwards or backwards, at most so many.
    fn run(mut self, forwards: bool, most: usize) -> Result<Vec<(usize, Match)>> {
        let (mut found, mut missed) = (Vec::new(), 0);
        let mut at = self.past[0].0;
        while found.len() < most {
            self.film.heed()?;
            let next =
                if forwards { Some(at + 1).filter(|&k| k < self.film.count()) } else { at.checked_sub(1) };
            let Some(k) = next else { break };
            at = k;
            let plane = plane(&self.film.read(k)?);
            if let Some(m) = self.step(&plane, k, missed) {
                self.past.push((k, m.pose));
                found.push((k, m));
                missed = 0;
            } else {
                missed += 1;
                if missed > MISSES {
                    break;
                }
            }
        }
        Ok(found)
    }

    /// The thing's place in a picture, if it is certain.
    fn step(&mut self, plane: &Plane, picture: usize, missed: usize) -> Option<Match> {
        let expected = self.expected(picture);
        let gate = self.gate(missed);
        let by_first = self.find(&self.first, plane, &expected, gate, missed);
        if let Some(m) = by_first {
            if RENEW.contains(&m.likeness) {
                self.renew(plane, &m);
            }
            return Some(m);
        }
        // What it looked like last tells no more of where it is once it was away.
        let latest = self.latest.as_ref().filter(|_| missed <= LATEST_MISSES)?;
        let m = self.find(latest, plane, &expected, gate, missed)?;
        if RENEW.contains(&m.likeness) {
            self.renew(plane, &m);
        }
        Some(m)
    }

    fn gate(&self, missed: usize) -> f64 {
        let radius = self.first.template.radius_px;
        let steady = GATE_RADII * radius + GATE_PX;
        let first = if self.past.len() < 2 { FIRST_GATE } else { 1.0 };
        (steady * (first + GATE_GROWTH * missed as f64)).min(MOST_GATE_PX)
    }

    /// The pose that is expected in a picture: on a line through its last two places.
    fn expected(&self, picture: usize) -> Pose {
        let n = self.past.len();
        let (at, last) = self.past[n - 1];
        let line = |a: &Pose, b: &Pose, t: f64| Pose {
            x: b.x + (b.x - a.x) * t,
            y: b.y + (b.y - a.y) * t,
            angle: b.angle + (b.angle - a.angle) * t,
            log_size: b.log_size,
        };
        let Some(&(before, pose)) = n.checked_sub(2).map(|k| &self.past[k]) else { return last };
        let step = at.abs_diff(before).max(1) as f64;
        let ahead = picture.abs_diff(at) as f64;
        line(&pose, &last, ahead / step)
    }

    /// The certain place of a look, if there is one.
    fn find(&self, look: &Look, plane: &Plane, expected: &Pose, gate: f64, missed: usize) -> Option<Match> {
        let own = look.own(expected);
        let reach = look.template.radius_px * own.log_size.exp() * REACH_PART + gate + REACH_PX;
        let surface = Surface::around(&plane.values, plane.size, [own.x, own.y], reach)?;
        let certain = |m: &Match| {
            m.likeness >= if missed == 0 { CERTAIN } else { CERTAIN_AGAIN }
                && m.sigma_px <= MOST_SIGMA_PX
                && m.pose.off(&own) <= gate + GATE_MARGIN_PX
                && (m.pose.log_size - own.log_size).abs() <= MOST_GROWTH * (1 + missed) as f64
        };
        let near = (self.past.len() >= YOUNG && missed == 0)
            .then(|| align(&look.template, &surface, own))
            .flatten()
            .filter(|m| certain(m) && m.pose.off(&own) <= GATE_RADII * look.template.radius_px / 2.0);
        let best = match near {
            Some(m) => m,
            None => self.best(look, plane, &surface, &own, gate).filter(certain)?,
        };
        if self.still.stands(&look.template, &best.pose, best.likeness) {
            return None;
        }
        let sigma_px = best.sigma_px.hypot(look.sigma_px);
        Some(Match { pose: look.common(&best.pose), sigma_px, ..best })
    }

    /// The likest place in the gate, where no other is nearly as like.
    fn best(&self, look: &Look, plane: &Plane, surface: &Surface, own: &Pose, gate: f64) -> Option<Match> {
        let mut found: Vec<Match> = Vec::new();
        for turn in TURNS {
            let start = Pose { angle: own.angle + turn, ..*own };
            let starts = search(&look.template, plane, &start, gate);
            found.extend(starts.into_iter().filter_map(|s| align(&look.template, surface, s)));
            if turn == 0.0 && found.iter().any(|m| m.likeness > ALIKE) {
                break;
            }
        }
        let best = *found.iter().max_by(|a, b| a.likeness.total_cmp(&b.likeness))?;
        let apart = APART_RADII * look.template.radius_px;
        let rival = |m: &Match| m.pose.off(&best.pose) > apart && m.likeness > best.likeness - RIVAL;
        (!found.iter().any(rival)).then_some(best)
    }

    /// Learns what the thing looks like from a certain place.
    fn renew(&mut self, plane: &Plane, m: &Match) {
        let first = &self.first.template;
        let radius = (first.radius_px * m.pose.log_size.exp()).round() as usize;
        let covers = |x: i64, y: i64| first.covers(m.pose.point([x as f64, y as f64]));
        let own = Pose { angle: 0.0, log_size: 0.0, ..m.pose };
        if let Some(template) = cut(plane, &own, radius.min(2 * MOST_RADIUS_PX), covers) {
            self.latest = Some(Look { template, pose: m.pose, sigma_px: m.sigma_px });
        }
    }
}
