//! The response of a picture to discs: centre minus surround, in octaves and colour directions.
//!
//! Owns: [`Direction`], [`Octaves`], [`Response`]. Must not: know what stands still.

use super::picture::Picture;

/// Octaves that are looked at: discs of 2, 4, 8, 16 and 32 px radius.
pub const OCTAVES: usize = 5;
/// An octave must be at least this high and wide, px: the surround's own width.
const LEAST_SIDE_PX: usize = 14;
/// Standard deviation of the centre's and of the surround's Gaussian, px. Their difference answers most to a disc of 2 px
/// radius.
const CENTRE_PX: f64 = 1.1;
const SURROUND_PX: f64 = 2.2;

/// A direction in colour space, as weights of luma and of the blue and red colour differences.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction(pub [f32; 3]);

impl Direction {
    /// Luma alone.
    pub const LUMA: Self = Self([1.0, 0.0, 0.0]);
    /// Luma, B - Y, R - Y, G - (R + B) / 2 and 0.7 (B - R), by the weights of BT.601.
    pub const ALL: [Self; 5] = [
        Self::LUMA,
        Self([0.0, 1.772, 0.0]),
        Self([0.0, 0.0, 1.402]),
        Self([0.0, -1.230, -1.415]),
        Self([0.0, 1.240, -0.981]),
    ];

    /// The value of a colour.
    pub fn of(&self, luma: f32, blue: f32, red: f32) -> f32 {
        self.0[0] * luma + self.0[1] * blue + self.0[2] * red
    }
}

/// One octave of a picture: its planes (luma, and two of colour where there are) as numbers.
#[derive(Debug, Clone)]
pub struct Planes {
    /// Width, px of the octave.
    pub width: usize,
    /// Height, px of the octave.
    pub height: usize,
    /// Luma, then colour.
    pub planes: Vec<Vec<f32>>,
}

impl Planes {
    /// The full octave of a picture.
    pub fn of(picture: &Picture) -> Self {
        let floats = |v: &[u8], zero: f32| v.iter().map(|&b| f32::from(b) - zero).collect();
        let mut planes = vec![floats(&picture.luma, 0.0)];
        if let Some(chroma) = &picture.chroma {
            planes.extend(chroma.iter().map(|c| floats(c, 128.0)));
        }
        Self { width: picture.width, height: picture.height, planes }
    }

    /// An octave of a picture.
    pub fn of_octave(picture: &Picture, octave: usize) -> Self {
        (0..octave).fold(Self::of(picture), |planes, _| planes.halved())
    }

    /// Half the size, by means of four pixels.
    pub fn halved(&self) -> Self {
        let (w, h) = (self.width / 2, self.height / 2);
        let planes = self
            .planes
            .iter()
            .map(|p| {
                let mut out = Vec::with_capacity(w * h);
                for y in 0..h {
                    let (a, b) = (&p[2 * y * self.width..], &p[(2 * y + 1) * self.width..]);
                    out.extend((0..w).map(|x| (a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1]) / 4.0));
                }
                out
            })
            .collect();
        Self { width: w, height: h, planes }
    }

    /// One plane along a direction.
    pub fn along(&self, direction: Direction) -> Vec<f32> {
        combine(&self.planes, direction)
    }
}

fn combine(planes: &[Vec<f32>], direction: Direction) -> Vec<f32> {
    let [l, b, r] = direction.0;
    match planes {
        [luma, blue, red] if direction != Direction::LUMA => {
            luma.iter().zip(blue).zip(red).map(|((&y, &cb), &cr)| l * y + b * cb + r * cr).collect()
        }
        [luma, ..] => luma.iter().map(|v| l * v).collect(),
        [] => Vec::new(),
    }
}

/// Number of octaves of a picture.
pub fn octaves(width: usize, height: usize) -> usize {
    (0..OCTAVES).take_while(|l| width.min(height) >> l >= LEAST_SIDE_PX).count()
}

/// Centre minus surround of each plane of one octave; along any direction it is the same sum of them.
#[derive(Debug, Clone)]
pub struct Response {
    /// Width, px of the octave.
    pub width: usize,
    /// Height, px of the octave.
    pub height: usize,
    planes: Vec<Vec<f32>>,
}

impl Response {
    /// Of one octave.
    pub fn of(planes: &Planes) -> Self {
        let (width, height) = (planes.width, planes.height);
        let planes = planes.planes.iter().map(|p| centre_minus_surround(p, width, height)).collect();
        Self { width, height, planes }
    }

    /// Along a direction.
    pub fn along(&self, direction: Direction) -> Vec<f32> {
        combine(&self.planes, direction)
    }

    /// The planes' values at a pixel: luma, blue, red.
    pub fn at(&self, i: usize) -> [f32; 3] {
        std::array::from_fn(|k| self.planes.get(k).map_or(0.0, |p| p[i]))
    }
}

/// The response of each octave of a picture, from the full one on.
pub fn responses(picture: &Picture, count: usize) -> Vec<Response> {
    let mut out = Vec::with_capacity(count);
    let mut planes = Planes::of(picture);
    for l in 0..count {
        if l > 0 {
            planes = planes.halved();
        }
        out.push(Response::of(&planes));
    }
    out
}

/// The response of one octave alone.
pub fn response(picture: &Picture, octave: usize) -> Response {
    let mut planes = Planes::of(picture);
    for _ in 0..octave {
        planes = planes.halved();
    }
    Response::of(&planes)
}

fn kernel(sigma: f64, radius: usize) -> Vec<f32> {
    let weights: Vec<f64> =
        (0..=2 * radius).map(|i| (-0.5 * ((i as f64 - radius as f64) / sigma).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| (w / sum) as f32).collect()
}

/// Difference of two Gaussian means; the picture goes on beyond its edges as in a mirror.
pub fn centre_minus_surround(plane: &[f32], width: usize, height: usize) -> Vec<f32> {
    let narrow = blurred(plane, width, height, &kernel(CENTRE_PX, 4));
    let wide = blurred(plane, width, height, &kernel(SURROUND_PX, 7));
    narrow.iter().zip(&wide).map(|(a, b)| a - b).collect()
}

/// `i` mirrored about the first and last of `n` places.
fn mirrored(i: isize, n: usize) -> usize {
    let last = n as isize - 1;
    if last <= 0 {
        return 0;
    }
    let period = 2 * last;
    let i = i.rem_euclid(period);
    (if i > last { period - i } else { i }) as usize
}

fn blurred(plane: &[f32], width: usize, height: usize, kernel: &[f32]) -> Vec<f32> {
    let radius = kernel.len() / 2;
    let mut rows = vec![0f32; width * height];
    let mut padded = vec![0f32; width + 2 * radius];
    for y in 0..height {
        let row = &plane[y * width..][..width];
        padded[radius..radius + width].copy_from_slice(row);
        for k in 0..radius {
            padded[k] = row[mirrored(k as isize - radius as isize, width)];
            padded[radius + width + k] = row[mirrored((width + k) as isize, width)];
        }
        let out = &mut rows[y * width..][..width];
        for (k, &w) in kernel.iter().enumerate() {
            for (o, v) in out.iter_mut().zip(&padded[k..]) {
                *o += w * v;
            }
        }
    }
    let mut out = vec![0f32; width * height];
    for y in 0..height {
        let target = &mut out[y * width..][..width];
        for (k, &w) in kernel.iter().enumerate() {
            let from = mirrored(y as isize + k as isize - radius as isize, height);
            for (o, v) in target.iter_mut().zip(&rows[from * width..][..width]) {
                *o += w * v;
            }
        }
    }
    out
}
