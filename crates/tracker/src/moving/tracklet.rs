//! Tracklets: one marker's spots in consecutive pictures, ended where continuity is not certain.
//!
//! Owns: [`Tracklet`], [`End`], [`link`]. Must not: join over a gap, or know which marker is wanted.

use super::spot::Spot;

/// The reason for which a tracklet ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The recording, or the stretch of it, ended.
    Recording,
    /// Nothing is near enough to where it was expected.
    Lost,
    /// Two spots, or two tracklets, compete.
    Ambiguous,
    /// The spot there looks different.
    Look,
}

/// One marker's spots in consecutive pictures.
#[derive(Debug, Clone)]
pub struct Tracklet {
    /// Index of its first picture.
    pub first: usize,
    /// Its spots.
    pub spots: Vec<Spot>,
    /// Why it ended.
    pub end: End,
    /// Running root mean square of prediction errors, px.
    scatter_px: Option<f64>,
}

/// Points on which a prediction is based.
const MEMORY: usize = 5;
/// Gate in units of the innovation scale.
const GATE: f64 = 4.0;
/// So many times farther the second candidate must be than the first, for a tracklet whose motion is known.
const CLEAR_RATIO: f64 = 2.5;
/// Part of the second candidate's distance within which the first must be, for a young tracklet.
const YOUNG_RATIO: f64 = 0.4;
/// Part of the error of a step that is forgotten with each new one.
const FORGET: f64 = 0.15;
/// Largest change of a peak's and of an area's logarithm between two pictures: a factor 2 and 2.5.
const PEAK_CHANGE: f64 = 0.7;
const AREA_CHANGE: f64 = 0.9;

impl Tracklet {
    fn new(first: usize, spot: Spot) -> Self {
        Self { first, spots: vec![spot], end: End::Recording, scatter_px: None }
    }

    /// The tracklets of spots in pictures of rising index: a new one after each gap.
    pub fn runs(spots: &[(usize, Spot)]) -> Vec<Self> {
        let mut out: Vec<Self> = Vec::new();
        for &(k, s) in spots {
            match out.last_mut() {
                Some(t) if t.last() + 1 == k => t.spots.push(s),
                _ => out.push(Self::new(k, s)),
            }
        }
        out
    }

    /// Index of its last picture.
    pub fn last(&self) -> usize {
        self.first + self.spots.len() - 1
    }

    /// Length of its last step, px.
    fn step_px(&self) -> f64 {
        match self.spots.as_slice() {
            [.., a, b] => (b.x - a.x).hypot(b.y - a.y),
            _ => 0.0,
        }
    }

    /// The place at which the tracklet is expected in the next picture: a line through two, half line half parabola through
    /// three, the least-squares parabola through the last four or five.
    fn expected(&self) -> [f64; 2] {
        let n = self.spots.len().min(MEMORY);
        let weights: &[f64] = match n {
            1 => &[1.0],
            2 => &[-1.0, 2.0],
            // Mean of the line's -2/3, 1/3, 4/3 and the parabola's 1, -3, 3.
            3 => &[1.0 / 6.0, -4.0 / 3.0, 13.0 / 6.0],
            4 => &[0.75, -1.25, -0.75, 2.25],
            _ => &[0.6, -0.6, -0.8, 0.0, 1.8],
        };
        let last = &self.spots[self.spots.len() - n..];
        let sum = |f: fn(&Spot) -> f64| last.iter().zip(weights).map(|(s, w)| w * f(s)).sum();
        [sum(|s| s.x), sum(|s| s.y)]
    }

    /// Medians of the logarithms of peak and area.
    pub fn look(&self) -> [f64; 2] {
        let median = |k: usize| {
            let mut v: Vec<f64> = self.spots.iter().map(|s| s.look()[k]).collect();
            median(&mut v)
        };
        [median(0), median(1)]
    }

    /// Longest step, px.
    pub fn longest_step_px(&self) -> f64 {
        self.spots.windows(2).map(|p| (p[1].x - p[0].x).hypot(p[1].y - p[0].y)).fold(0.0, f64::max)
    }
}

/// The middle value; the mean of the two middle ones of an even number. 0 of none.
pub fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    if n % 2 == 1 { values[n / 2] } else { (values[n / 2 - 1] + values[n / 2]) / 2.0 }
}

fn look_agrees(a: &Spot, b: &Spot) -> bool {
    (a.peak / b.peak).ln().abs() < PEAK_CHANGE && (a.area / b.area).ln().abs() < AREA_CHANGE
}

/// Links spots of consecutive pictures, the first of index `first`. `radius_px` is that of the markers sought; `width_px` of the
/// picture.
pub fn link(pictures: &[Vec<Spot>], radius_px: f64, width_px: f64, first: usize) -> Vec<Tracklet> {
    let mut links = Links {
        live: Vec::new(),
        done: Vec::new(),
        radius_px,
        floor_px: 0.15 * radius_px + 0.3,
        first_step_px: (14.0 * radius_px).max(0.05 * width_px),
    };
    for (i, spots) in pictures.iter().enumerate() {
        links.step(first + i, spots);
    }
    links.done.append(&mut links.live);
    links.done
}

struct Links {
    live: Vec<Tracklet>,
    done: Vec<Tracklet>,
    radius_px: f64,
    floor_px: f64,
    first_step_px: f64,
}

impl Links {
    fn step(&mut self, picture: usize, spots: &[Spot]) {
        let mut free = vec![true; spots.len()];
        let mut next = Vec::new();
        let (known, young): (Vec<Tracklet>, Vec<Tracklet>) =
            std::mem::take(&mut self.live).into_iter().partition(|t| t.spots.len() >= 3);
        // Those whose motion is known choose first.
        for group in [known, young] {
            self.choose(group, spots, &mut free, &mut next);
        }
        next.extend(
            spots.iter().zip(&free).filter(|(_, free)| **free).map(|(s, _)| Tracklet::new(picture, *s)),
        );
        self.live = next;
    }

    fn choose(&mut self, group: Vec<Tracklet>, spots: &[Spot], free: &mut [bool], next: &mut Vec<Tracklet>) {
        let open: Vec<usize> = (0..spots.len()).filter(|&i| free[i]).collect();
        if open.is_empty() {
            self.done.extend(group.into_iter().map(|t| Tracklet { end: End::Lost, ..t }));
            return;
        }
        let errors: Vec<Vec<f64>> = group
            .iter()
            .map(|t| {
                let [x, y] = t.expected();
                open.iter().map(|&i| (spots[i].x - x).hypot(spots[i].y - y)).collect()
            })
            .collect();
        let scales: Vec<f64> = group.iter().map(|t| t.scatter_px.unwrap_or(0.0).max(self.floor_px)).collect();
        let decided: Vec<Result<usize, End>> =
            (0..group.len()).map(|a| self.decide(&group, a, &errors, &scales, &open, spots)).collect();
        for ((mut t, decision), errors) in group.into_iter().zip(decided).zip(&errors) {
            match decision {
                Ok(b) => {
                    free[open[b]] = false;
                    t.spots.push(spots[open[b]]);
                    if t.spots.len() >= 4 {
                        let e = errors[b];
                        let scatter =
                            t.scatter_px.map_or(e, |s| ((1.0 - FORGET) * s * s + FORGET * e * e).sqrt());
                        t.scatter_px = Some(scatter.min(3.0 * self.floor_px + 0.3 * t.step_px()));
                    }
                    next.push(t);
                }
                Err(end) => self.done.push(Tracklet { end, ..t }),
            }
        }
    }

    /// The open spot that goes on tracklet `a`, where nothing competes.
    fn decide(
        &self,
        group: &[Tracklet],
        a: usize,
        errors: &[Vec<f64>],
        scales: &[f64],
        open: &[usize],
        spots: &[Spot],
    ) -> Result<usize, End> {
        let e = &errors[a];
        let (mut b, mut e1, mut e2) = (0, f64::INFINITY, f64::INFINITY);
        for (i, &d) in e.iter().enumerate() {
            if d < e1 {
                (b, e1, e2) = (i, d, e1);
            } else if d < e2 {
                e2 = d;
            }
        }
        let t = &group[a];
        let others = |scaled: bool| {
            (0..group.len())
                .filter(|&o| o != a)
                .map(|o| if scaled { errors[o][b] / scales[o] } else { errors[o][b] })
                .fold(f64::INFINITY, f64::min)
        };
        match t.spots.len() {
            1 | 2 => {
                let gate = if t.spots.len() == 2 {
                    0.6 * t.step_px() + self.radius_px + 1.0
                } else {
                    self.first_step_px
                };
                if !(e1 < gate && e1 < YOUNG_RATIO * e2 && e1 < YOUNG_RATIO * others(false)) {
                    return Err(End::Ambiguous);
                }
            }
            _ => {
                let z = e1 / scales[a];
                if z >= GATE {
                    return Err(End::Lost);
                }
                let clear = e2 > CLEAR_RATIO * e1 && e2 - e1 > 2.0 * scales[a];
                if !clear || others(true) <= GATE.max(CLEAR_RATIO * z) {
                    return Err(End::Ambiguous);
                }
            }
        }
        let last = t.spots.last().ok_or(End::Lost)?;
        if look_agrees(last, &spots[open[b]]) { Ok(b) } else { Err(End::Look) }
    }
}
