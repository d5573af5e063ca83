//! Things of made texture before a still ground of texture, drawn with their truth.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal, Uniform};

use super::follow::{Lost, follow_picture};
use super::search::Plane;
use super::still::Still;
use super::surface::Surface;
use super::template::{Pose, Template};
use crate::error::{Error, Result};
use crate::moving::picture::{Film, Picture};
use crate::moving::spot::Spot;

const SIZE: (usize, usize) = (240, 200);

/// A place in a picture, px.
struct Click {
    picture: usize,
    x: f64,
    y: f64,
}

/// A smooth texture: a sum of bells of random places, widths and heights, in a square.
struct Texture {
    bells: Vec<[f64; 4]>,
    level: f64,
}

impl Texture {
    fn new(seed: u64, half_px: f64, count: usize, widths: (f64, f64), level: f64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut within = |a: f64, b: f64| Uniform::new(a, b).unwrap().sample(&mut rng);
        let bells = (0..count)
            .map(|_| {
                let width = within(widths.0, widths.1);
                [
                    within(-half_px, half_px),
                    within(-half_px, half_px),
                    0.5 / (width * width),
                    within(-60.0, 60.0),
                ]
            })
            .collect();
        Self { bells, level }
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        let bell = |b: &[f64; 4]| {
            let d = b[2] * ((x - b[0]).powi(2) + (y - b[1]).powi(2));
            if d < 12.0 { b[3] * (-d).exp() } else { 0.0 }
        };
        self.level + self.bells.iter().map(bell).sum::<f64>()
    }
}

/// A disc of texture that moves before a wall of texture.
struct Made {
    pictures: Vec<Picture>,
    stopped: bool,
}

/// For each picture the pose of the thing and its opacity.
type Script<'a> = &'a dyn Fn(usize) -> (Pose, f64);

impl Made {
    fn new(seed: u64, count: usize, radius: f64, noise: f64, script: Script) -> Self {
        let wall = Texture::new(seed + 100, 130.0, 700, (2.0, 6.0), 120.0);
        let thing = Texture::new(seed, radius + 4.0, 60, (1.5, 3.0), 120.0);
        let behind: Vec<f64> = (0..SIZE.0 * SIZE.1)
            .map(|i| wall.at((i % SIZE.0) as f64 - 120.0, (i / SIZE.0) as f64 - 100.0))
            .collect();
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
        let normal = Normal::new(0.0, noise).unwrap();
        let pictures = (0..count)
            .map(|k| {
                let (pose, opacity) = script(k);
                let reach = radius * pose.log_size.exp() + 2.0;
                let luma = (0..SIZE.0 * SIZE.1)
                    .map(|i| {
                        let (x, y) = ((i % SIZE.0) as f64, (i / SIZE.0) as f64);
                        let mut v = behind[i];
                        if (x - pose.x).hypot(y - pose.y) < reach {
                            let [u, w] = pose.point([x, y]);
                            let part = (radius + 0.5 - u.hypot(w)).clamp(0.0, 1.0) * opacity;
                            v += (thing.at(u, w) - v) * part;
                        }
                        (v + normal.sample(&mut rng)).round().clamp(0.0, 255.0) as u8
                    })
                    .collect();
                Picture { width: SIZE.0, height: SIZE.1, luma, chroma: None }
            })
            .collect();
        Self { pictures, stopped: false }
    }

    fn follow(&self, click: &Click) -> Result<Result<super::follow::Places, Lost>> {
        follow_picture(self, &Still::learn(self)?, click.picture, [click.x, click.y])
    }
}

impl Film for Made {
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

/// Round a circle, and round itself twice the other way.
fn turning(k: usize) -> (Pose, f64) {
    let a = TAU * k as f64 / 90.0;
    let pose = Pose {
        x: 120.0 + 60.3 * a.cos(),
        y: 100.0 + 60.3 * a.sin(),
        angle: -2.0 * a,
        log_size: 0.1 * a.sin(),
    };
    (pose, 1.0)
}

#[test]
fn texture_is_followed_over_full_turns_to_the_bound_and_its_uncertainty_is_true() {
    let (mut squares, mut weighted, mut bound, mut n) = (0.0, 0.0, 0.0, 0.0);
    for seed in 0..24 {
        let film = Made::new(seed, 60, 14.0, 3.0, &turning);
        let click = Click { picture: 20, x: turning(20).0.x, y: turning(20).0.y };
        let (places, _) = film.follow(&click).unwrap().unwrap();
        assert!(places.len() >= 58, "seed {seed}: {} of 60", places.len());
        // The bound of the pixels that are surely the thing's, in its first picture, twice: of the template and of each picture.
        let plane =
            Plane { values: film.pictures[20].luma.iter().map(|&v| f32::from(v)).collect(), size: SIZE };
        let surface = Surface::around(&plane.values, SIZE, [click.x, click.y], 20.0).unwrap();
        let start = Pose { x: click.x, y: click.y, angle: 0.0, log_size: 0.0 };
        let disc = |x: i64, y: i64| (x as f64 - click.x).hypot(y as f64 - click.y) < 13.5;
        let whole = Template::cut(&surface, &start, 14, disc).unwrap();
        let noise = 3f64.hypot(1.0 / 12f64.sqrt());
        for (k, s) in places.iter().filter(|(k, _)| *k != 20) {
            let truth = turning(*k).0;
            bound += 2.0 * (2.0 * whole.bound_px(noise).powi(2)) * truth.log_size.exp().powi(2);
            for d in [s.x - truth.x, s.y - truth.y] {
                squares += d * d;
                weighted += (d / s.doubt_px).powi(2);
            }
            n += 1.0;
        }
    }
    let (over_bound, over_sigma) = (f64::sqrt(squares / bound), f64::sqrt(weighted / (2.0 * n)));
    assert!(over_bound < 1.5, "{over_bound} of the bound");
    assert!((0.9..1.2).contains(&over_sigma), "{over_sigma} of the stated uncertainty");
}

/// Pictures in which something is seen, and how far it is at most from its truth, px.
fn off(places: &[(usize, Spot)], truth: impl Fn(usize) -> Pose) -> (Vec<usize>, f64) {
    let far = places.iter().map(|(k, s)| (s.x - truth(*k).x).hypot(s.y - truth(*k).y)).fold(0.0, f64::max);
    (places.iter().map(|p| p.0).collect(), far)
}

/// Along a line, at rest before picture 10.
fn sliding(k: usize) -> Pose {
    let t = (k as f64 - 10.0).max(0.0);
    Pose { x: 60.0 + 2.0 * t, y: 80.0 + 0.7 * t, angle: 0.02 * t, log_size: 0.0 }
}

#[test]
fn a_thing_that_is_seen_through_does_not_become_the_wall_behind_it() {
    for (seed, opacity) in [(40, 0.15), (41, 0.3), (42, 0.5), (43, 0.15), (44, 0.3)] {
        let film = Made::new(seed, 60, 14.0, 1.0, &|k| (sliding(k), opacity));
        let start = sliding(5);
        // It rests there: the wall at this place looks nearly the same without it.
        match film.follow(&Click { picture: 5, x: start.x, y: start.y }).unwrap() {
            Ok((places, _)) => {
                let (seen, far) = off(&places, sliding);
                assert!(far < 1.0, "seed {seed}, opacity {opacity}: {far} px off, {} pictures", seen.len());
            }
            Err(lost) => assert!(matches!(lost, Lost::Still | Lost::Soon(_)), "{lost:?}"),
        }
    }
}

#[test]
fn what_is_hidden_is_lost_and_found_again_and_nothing_is_named_meanwhile() {
    for seed in 50..54 {
        let hidden = 30..42;
        let film =
            Made::new(seed, 70, 14.0, 2.0, &|k| (sliding(k), if hidden.contains(&k) { 0.0 } else { 1.0 }));
        let start = sliding(20);
        let (places, _) = film.follow(&Click { picture: 20, x: start.x, y: start.y }).unwrap().unwrap();
        let (seen, far) = off(&places, sliding);
        assert!(seen.iter().all(|k| !hidden.contains(k)), "seed {seed}: {seen:?}");
        assert!(far < 0.3, "seed {seed}: {far} px");
        assert!(seen.len() >= 55, "seed {seed}: {seen:?}");
        // For good: no other part of the wall takes its place.
        let gone = Made::new(seed, 70, 14.0, 2.0, &|k| (sliding(k), if k >= 40 { 0.0 } else { 1.0 }));
        let (places, _) = gone.follow(&Click { picture: 20, x: start.x, y: start.y }).unwrap().unwrap();
        let (seen, far) = off(&places, sliding);
        assert!(seen.last() < Some(&40) && far < 0.3, "seed {seed}: {seen:?}, {far} px");
    }
}

#[test]
fn walls_and_plain_things_are_refused_and_a_wish_to_stop_is_heard() {
    let mut film = Made::new(60, 40, 14.0, 2.0, &|k| (sliding(k), 1.0));
    let wall = Click { picture: 20, x: 200.0, y: 30.0 };
    assert!(matches!(film.follow(&wall).unwrap(), Err(Lost::Still)));
    let thing = Click { picture: 20, x: sliding(20).x, y: sliding(20).y };
    let one = film.follow(&thing).unwrap().unwrap().0;
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(alone.install(|| film.follow(&thing)).unwrap().unwrap().0 == one, "another number of threads");
    film.stopped = true;
    assert!(matches!(film.follow(&thing), Err(Error::Interrupted)));
}
