//! Tracks: tracklets joined over gaps, with their quality and look.
//!
//! Owns: [`Track`], [`join`], [`join_lone`], [`tracks`], [`chosen`]. Must not: choose which marker is wanted.

use super::spot::Spot;
use super::tracklet::{Tracklet, link, median};

/// Longest gap that is joined by prediction, pictures.
const LONGEST_GAP: usize = 40;
/// Points of an end that its parabola is fitted to.
const END_POINTS: usize = 8;
/// Largest difference of looks over a gap: peak, area (logarithms).
const JOIN_LOOK: [f64; 2] = [0.6, 0.7];
/// Largest deviation in the middle of a gap at which two ends are joined, in units of its scale, and up to which another pair
/// is a rival.
const JOIN_Z: f64 = 2.5;
const RIVAL_Z: f64 = 5.0;

/// Variance of a third difference of white noise over that of a place: 1 + 9 + 9 + 1.
const THIRD_DIFFERENCE_VARIANCE: f64 = 20.0;
/// Variance of a fourth difference of white noise over that of a place: 1 + 16 + 36 + 16 + 1. Of smooth
/// motion less is left than in a third difference.
const FOURTH_DIFFERENCE_VARIANCE: f64 = 70.0;
/// A place that lies aside by more than this, in radii and in units of the usual scatter, is another region's.
const JUMP_RADII: f64 = 0.25;
const JUMP_NOISE: f64 = 8.0;
/// A step aside and a step back are alike to this factor; where a motion turns one of them is missing.
const BACK_PART: f64 = 0.4;
/// Places to either side that tell where a place ought to be, and the part of them that is believed: more than half.
const PATH_PLACES: usize = 6;
const PATH_PART: f64 = 0.55;
/// A place of which so many radii are not known is none: it may as well be beside the marker.
const LOST_RADII: f64 = 0.5;
/// Median of the sum of two squares of normal numbers of one variance over its mean: ln 2.
const MEDIAN_OF_TWO_SQUARES: f64 = std::f64::consts::LN_2;
/// One marker through the recording.
#[derive(Debug, Clone)]
pub struct Track {
    /// Its pieces, in order.
    pub pieces: Vec<Tracklet>,
    /// Pictures in which it is seen.
    pub count: usize,
    /// From 0 to 1: how smoothly it moves, how constant its look is, how far it travels in its own sizes.
    pub quality: f64,
    /// From 0 to 1: how smoothly it moves and how constant its look is, whatever its travel.
    pub smoothness: f64,
    /// Extent of its path, px.
    pub extent_px: f64,
    /// Whether it moves.
    pub moving: bool,
    /// Medians of the logarithms of peak and area.
    pub look: [f64; 2],
    /// Scatter of its places about smooth motion, px; 0 before it is settled.
    pub noise_px: f64,
}

impl Track {
    /// Count times quality: what the track explains.
    pub fn weight(&self) -> f64 {
        self.count as f64 * self.quality
    }

    /// Index of each picture in which it is seen, with its spot.
    pub fn spots(&self) -> impl Iterator<Item = (usize, &Spot)> {
        self.pieces.iter().flat_map(|t| t.spots.iter().enumerate().map(|(i, s)| (t.first + i, s)))
    }

    /// Standard uncertainty of each coordinate of a spot of this track, px: the scatter of its places about smooth motion, and
    /// what the way of finding the centre leaves open.
    pub fn sigma_px(&self, spot: &Spot) -> f64 {
        self.noise_px.hypot(spot.doubt_px)
    }

    /// Learns the scatter of its places once they are final, and leaves out those that jump aside and back: in them another
    /// region was taken for the marker's.
    pub fn settle(&mut self, radius_px: f64) {
        self.noise_px = self.scatter_px();
        let limit = (JUMP_RADII * radius_px).max(JUMP_NOISE * self.noise_px);
        let kept = |t: &Tracklet| {
            let s = &t.spots;
            let jumps = |i: usize| i >= 2 && i + 2 < s.len() && jumps(&s[i - 2..=i + 2], limit);
            let aside = |i: usize| jumps(i) && off_path_px(s, i) > limit;
            let unknown = |i: usize| s[i].doubt_px > LOST_RADII * radius_px && s[i].doubt_px.is_finite();
            let kept: Vec<(usize, Spot)> =
                (0..s.len()).filter(|&i| !aside(i) && !unknown(i)).map(|i| (t.first + i, s[i])).collect();
            Tracklet::runs(&kept)
        };
        self.pieces = self.pieces.iter().flat_map(kept).collect();
        self.noise_px = self.scatter_px();
        self.count = self.pieces.iter().map(|t| t.spots.len()).sum();
    }

    /// Scatter of its places about smooth motion, px along each axis.
    fn scatter_px(&self) -> f64 {
        let mut squares: Vec<f64> = self.pieces.iter().flat_map(|t| fourth_differences(&t.spots)).collect();
        let both = median(&mut squares) / FOURTH_DIFFERENCE_VARIANCE / MEDIAN_OF_TWO_SQUARES;
        (both / 2.0).sqrt()
    }

    /// A track of pieces; `radius_px` is that of the markers sought.
    pub fn of(pieces: Vec<Tracklet>, radius_px: f64) -> Self {
        let count: usize = pieces.iter().map(|t| t.spots.len()).sum();
        let smooth: f64 = pieces.iter().map(|t| quality(t, radius_px) * t.spots.len() as f64).sum();
        let extent_px = extent(pieces.iter().flat_map(|t| &t.spots));
        // Travel in own sizes is the best single evidence that something is a marker.
        let smoothness = smooth / count.max(1) as f64;
        let quality = smoothness * extent_px / (extent_px + 6.0 * radius_px);
        let look = [0, 1].map(|k| median(&mut pieces.iter().map(|t| t.look()[k]).collect::<Vec<_>>()));
        Self {
            pieces,
            count,
            quality,
            smoothness,
            extent_px,
            moving: extent_px > (0.8 * radius_px).max(4.0),
            look,
            noise_px: 0.0,
        }
    }
}

/// Largest extent of places along an axis, px.
pub fn extent<'a>(spots: impl Iterator<Item = &'a Spot>) -> f64 {
    let [mut x0, mut x1, mut y0, mut y1] =
        [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for s in spots {
        (x0, x1, y0, y1) = (x0.min(s.x), x1.max(s.x), y0.min(s.y), y1.max(s.y));
    }
    (x1 - x0).max(y1 - y0).max(0.0)
}

fn deviation(values: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = values.collect();
    let n = all.len().max(1) as f64;
    let mean = all.iter().sum::<f64>() / n;
    (all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// From 0 to 1: how smoothly a tracklet moves and how constant its look is; 0 below five points.
pub fn quality(t: &Tracklet, radius_px: f64) -> f64 {
    let s = &t.spots;
    if s.len() < 5 {
        return 0.0;
    }
    let mut squares: Vec<f64> = third_differences(s).collect();
    let noise_px = (median(&mut squares) / THIRD_DIFFERENCE_VARIANCE / MEDIAN_OF_TWO_SQUARES).sqrt();
    let peaks = deviation(s.iter().map(|s| s.peak.ln()));
    let areas = deviation(s.iter().map(|s| s.area.ln()));
    let mut q = 1.0
        / (1.0 + (noise_px / (0.1 * radius_px + 0.15)).powi(2))
        / (1.0 + (peaks / 0.35).powi(2))
        / (1.0 + (areas / 0.5).powi(2));
    if median(&mut s.iter().map(|s| s.elongation).collect::<Vec<_>>()) > 3.0 && !lies_along_its_motion(s) {
        q *= 0.2;
    }
    q
}

/// Squares of third differences, x and y together: they let acceleration through.
fn third_differences(s: &[Spot]) -> impl Iterator<Item = f64> + '_ {
    let third = |f: fn(&Spot) -> f64, w: &[Spot]| f(&w[3]) - 3.0 * f(&w[2]) + 3.0 * f(&w[1]) - f(&w[0]);
    s.windows(4).map(move |w| third(|s| s.x, w).powi(2) + third(|s| s.y, w).powi(2))
}

/// Squares of fourth differences, x and y together.
fn fourth_differences(s: &[Spot]) -> impl Iterator<Item = f64> + '_ {
    let fourth = |f: fn(&Spot) -> f64, w: &[Spot]| {
        f(&w[4]) - 4.0 * f(&w[3]) + 6.0 * f(&w[2]) - 4.0 * f(&w[1]) + f(&w[0])
    };
    s.windows(5).map(move |w| fourth(|s| s.x, w).powi(2) + fourth(|s| s.y, w).powi(2))
}

/// Whether the middle one of five places lies aside by more than a limit, and not because the motion turns there: an impact
/// changes one second difference, a place aside three of them, whose sum is 0.
fn jumps(s: &[Spot], limit_px: f64) -> bool {
    let second = |i: usize| [s[i - 1].x - 2.0 * s[i].x + s[i + 1].x, s[i - 1].y - 2.0 * s[i].y + s[i + 1].y];
    let [a, b, c] = [second(1), second(2), second(3)];
    let size = b[0].hypot(b[1]);
    // Along the step back, in parts of it.
    let back = |v: [f64; 2]| -(v[0] * b[0] + v[1] * b[1]) / (size * size).max(1e-12);
    size / 2.0 > limit_px && back(a) > BACK_PART && back(c) > BACK_PART
}

/// The distance of a place from the path on which most of the places around it lie, px: where every other place lies aside, the
/// fewer are wrong.
fn off_path_px(s: &[Spot], i: usize) -> f64 {
    let window = i.saturating_sub(PATH_PLACES)..(i + PATH_PLACES + 1).min(s.len());
    let all: Vec<(f64, &Spot)> = window.map(|k| (k as f64 - i as f64, &s[k])).collect();
    let most = ((PATH_PART * all.len() as f64).ceil() as usize).max(4).min(all.len());
    let mut chosen: Vec<(f64, &Spot)> = all.clone();
    let mut path = [[0.0; 3]; 2];
    for _ in 0..5 {
        let fit =
            |f: fn(&Spot) -> f64| polynomial(&chosen.iter().map(|(t, s)| (*t, f(s))).collect::<Vec<_>>(), 2);
        path = [fit(|s| s.x), fit(|s| s.y)];
        let off = |(t, s): &(f64, &Spot)| {
            let at = |c: &[f64; 3]| c[0] + c[1] * t + c[2] * t * t;
            (s.x - at(&path[0])).hypot(s.y - at(&path[1]))
        };
        let mut nearest = all.clone();
        nearest.sort_by(|a, b| off(a).total_cmp(&off(b)));
        nearest.truncate(most);
        chosen = nearest;
    }
    (s[i].x - path[0][0]).hypot(s[i].y - path[1][0])
}

/// Whether a streak points where it goes.
fn lies_along_its_motion(s: &[Spot]) -> bool {
    let n = s.len();
    let mut sines: Vec<f64> = (0..n)
        .filter_map(|i| {
            let (a, b) = (&s[i.saturating_sub(1)], &s[(i + 1).min(n - 1)]);
            let span = ((i + 1).min(n - 1) - i.saturating_sub(1)).max(1) as f64;
            let (vx, vy) = ((b.x - a.x) / span, (b.y - a.y) / span);
            (vx.hypot(vy) > 1.0).then(|| (vy.atan2(vx) - s[i].direction).sin().abs())
        })
        .collect();
    sines.len() >= 3 && median(&mut sines) <= 0.4
}

/// Place, velocity and half the acceleration at one end of a tracklet, px and pictures.
fn end_motion(t: &Tracklet, at_start: bool) -> [[f64; 2]; 3] {
    let n = t.spots.len().min(END_POINTS);
    let points: Vec<(f64, &Spot)> = if at_start {
        (0..n).map(|i| (i as f64, &t.spots[i])).collect()
    } else {
        let from = t.spots.len() - n;
        (0..n).map(|i| (i as f64 - (n - 1) as f64, &t.spots[from + i])).collect()
    };
    let degree = if n >= 6 { 2 } else { usize::from(n >= 2) };
    let fit =
        |f: fn(&Spot) -> f64| polynomial(&points.iter().map(|(t, s)| (*t, f(s))).collect::<Vec<_>>(), degree);
    let (x, y) = (fit(|s| s.x), fit(|s| s.y));
    std::array::from_fn(|k| [x[k], y[k]])
}

/// Coefficients of the least-squares polynomial of degree 0, 1 or 2.
fn polynomial(points: &[(f64, f64)], degree: usize) -> [f64; 3] {
    let m = degree + 1;
    let mut a = [[0f64; 4]; 3];
    for &(t, v) in points {
        let p = [1.0, t, t * t];
        for i in 0..m {
            for j in 0..m {
                a[i][j] += p[i] * p[j];
            }
            a[i][3] += p[i] * v;
        }
    }
    // Gauss-Jordan; the matrix is positive definite for distinct times.
    for i in 0..m {
        let pivot = a[i][i];
        if pivot.abs() < 1e-12 {
            continue;
        }
        for v in &mut a[i] {
            *v /= pivot;
        }
        let row = a[i];
        for (j, other) in a.iter_mut().enumerate().take(m) {
            if j != i {
                let factor = other[i];
                for (v, r) in other.iter_mut().zip(row) {
                    *v -= factor * r;
                }
            }
        }
    }
    std::array::from_fn(|i| if i < m { a[i][3] } else { 0.0 })
}

/// Place and velocity `t` pictures from an end.
fn at(motion: &[[f64; 2]; 3], t: f64) -> ([f64; 2], [f64; 2]) {
    let place = [0, 1].map(|k| motion[0][k] + motion[1][k] * t + motion[2][k] * t * t);
    (place, [0, 1].map(|k| motion[1][k] + 2.0 * motion[2][k] * t))
}

/// Chains of tracklets, joined where both ends' motion and looks agree in the middle of the gap and nothing else competes.
pub fn join(tracklets: Vec<Tracklet>, radius_px: f64) -> Vec<Vec<Tracklet>> {
    let mut all: Vec<Tracklet> = tracklets.into_iter().filter(|t| t.spots.len() >= 3).collect();
    all.sort_by_key(|t| t.first);
    let looks: Vec<[f64; 2]> = all.iter().map(Tracklet::look).collect();
    let ends: Vec<[[f64; 2]; 3]> = all.iter().map(|t| end_motion(t, false)).collect();
    let starts: Vec<[[f64; 2]; 3]> = all.iter().map(|t| end_motion(t, true)).collect();
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, a) in all.iter().enumerate() {
        let from = all.partition_point(|t| t.first <= a.last());
        for (j, b) in all.iter().enumerate().skip(from) {
            if b.first > a.last() + LONGEST_GAP {
                break;
            }
            if (0..2).any(|k| (looks[i][k] - looks[j][k]).abs() > JOIN_LOOK[k]) {
                continue;
            }
            let h = (b.first - a.last()) as f64 / 2.0;
            let (ca, cb) = (ends[i], starts[j]);
            let (pa, pb) = (at(&ca, h), at(&cb, -h));
            let e = (pa.0[0] - pb.0[0]).hypot(pa.0[1] - pb.0[1]);
            let ev = (pa.1[0] - pb.1[0]).hypot(pa.1[1] - pb.1[1]);
            let [na, nb] = [a, b].map(|t| END_POINTS as f64 / t.spots.len().min(END_POINTS) as f64);
            let v = (ca[1][0].hypot(ca[1][1]) + cb[1][0].hypot(cb[1][1])) / 2.0;
            let scale = (0.3 * radius_px + 0.5) * (1.0 + 0.35 * h * na) * (1.0 + 0.1 * h * nb) + 0.12 * h * v;
            let z = (e / scale).hypot(0.5 * ev * h / scale);
            if z < RIVAL_Z {
                pairs.push((z, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut next: Vec<Option<usize>> = vec![None; all.len()];
    let mut taken = vec![false; all.len()];
    for &(z, i, j) in &pairs {
        if z > JOIN_Z || next[i].is_some() || taken[j] {
            continue;
        }
        let rival = pairs
            .iter()
            .filter(|&&(_, a, b)| (a == i && b != j && !taken[b]) || (b == j && a != i && next[a].is_none()))
            .map(|p| p.0)
            .fold(f64::INFINITY, f64::min);
        if rival >= (2.0 * z).max(z + 1.5) {
            next[i] = Some(j);
            taken[j] = true;
        }
    }
    let mut all: Vec<Option<Tracklet>> = all.into_iter().map(Some).collect();
    let mut chains = Vec::new();
    for start in (0..taken.len()).filter(|&k| !taken[k]) {
        let mut chain = Vec::new();
        let mut at = Some(start);
        while let Some(i) = at {
            chain.extend(all[i].take());
            at = next[i];
        }
        chains.push(chain);
    }
    chains
}

fn length(chain: &[Tracklet]) -> usize {
    chain.iter().map(|t| t.spots.len()).sum()
}

/// Joins chains that never coexist and look alike, where nothing else of that look is there meanwhile: one marker.
pub fn join_lone(chains: Vec<Vec<Tracklet>>, radius_px: f64) -> Vec<Vec<Tracklet>> {
    // What stays where it is shows nothing of where it came from: it takes no part, and neither does a scrap.
    let travels = |c: &Vec<Tracklet>| extent(c.iter().flat_map(|t| &t.spots)) > (0.8 * radius_px).max(4.0);
    let (mut long, short): (Vec<_>, Vec<_>) = chains.into_iter().partition(|c| length(c) >= 5 && travels(c));
    long.sort_by_key(|c| c[0].first);
    let first = |c: &[Tracklet]| c[0].first;
    let last = |c: &[Tracklet]| c[c.len() - 1].last();
    let mut i = 0;
    while i < long.len() {
        let end = last(&long[i]);
        let Some(j) = (0..long.len()).find(|&j| first(&long[j]) > end) else {
            i += 1;
            continue;
        };
        let begin = first(&long[j]);
        let alone = (0..long.len())
            .filter(|&k| k != i && k != j)
            .all(|k| first(&long[k]) >= begin + 3 || last(&long[k]) + 3 <= end);
        let (a, b) = (&long[i][long[i].len() - 1], &long[j][0]);
        let (la, lb) = (a.look(), b.look());
        let alike = (la[0] - lb[0]).abs() < 0.7 && (la[1] - lb[1]).abs() < 0.8;
        let fastest = a.longest_step_px().max(b.longest_step_px());
        let (p, q) = (&a.spots[a.spots.len() - 1], &b.spots[0]);
        let near = (p.x - q.x).hypot(p.y - q.y) <= 1.5 * fastest * (begin - end) as f64 + 3.0 * radius_px;
        if alone && alike && near {
            let tail = long.remove(j);
            long[i].extend(tail);
        } else {
            i += 1;
        }
    }
    long.extend(short);
    long
}

/// The tracks of spots in consecutive pictures: linked, and joined over gaps.
pub fn linked(pictures: &[Vec<Spot>], radius_px: f64, width_px: f64) -> Vec<Track> {
    let chains = join_lone(join(link(pictures, radius_px, width_px, 0), radius_px), radius_px);
    tracks(chains, radius_px, pictures.len())
}

/// The tracks of chains that are long enough to judge.
pub fn tracks(chains: Vec<Vec<Tracklet>>, radius_px: f64, pictures: usize) -> Vec<Track> {
    let least = (0.02 * pictures as f64).max(8.0);
    chains.into_iter().filter(|c| length(c) as f64 >= least).map(|c| Track::of(c, radius_px)).collect()
}

/// Places of a track, evenly chosen, at most `most`: (piece, spot in it).
pub fn chosen(track: &Track, most: usize) -> Vec<(usize, usize)> {
    let all: Vec<(usize, usize)> =
        track.pieces.iter().enumerate().flat_map(|(p, t)| (0..t.spots.len()).map(move |i| (p, i))).collect();
    if all.len() <= most {
        return all;
    }
    (0..most).map(|k| all[(k as f64 * (all.len() - 1) as f64 / (most - 1).max(1) as f64) as usize]).collect()
}
