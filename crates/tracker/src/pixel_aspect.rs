//! Holds the pixel aspect (width to height) and converts recorded pixels to square ones and back.
//!
//! Owns: [`PixelAspect`], [`AspectOrigin`]. Must not: know where a recording says it.
//!
//! Square pixels are as high as the recorded ones, so that only x changes. Uncertainties are in square pixels everywhere.

use std::fmt;
use std::str::FromStr;

use nalgebra::Vector2;

use crate::message::{Message, Setting};

/// Width to height of a pixel, in lowest terms.
///
/// ```
/// use tracker::pixel_aspect::PixelAspect;
///
/// let pal: PixelAspect = "32:30".parse().unwrap();
/// assert_eq!((pal.to_string().as_str(), pal.is_square()), ("16:15", false));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct PixelAspect {
    width: u32,
    height: u32,
}

/// Largest ratio of a pixel's sides that a camera may have. The most that H.264 and
/// HEVC have a number for is 32:11; a field of a film that is 2:1 already has 4:1.
pub const MOST_TIMES: u32 = 4;

/// Relative difference below which two ratios are the same: containers round the width at which a film is shown to whole
/// pixels, one in some thousand.
const SAME_PART: f64 = 2e-3;

/// Origin of a recording's pixel aspect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AspectOrigin {
    /// The recording; its pixels are square where it says nothing.
    #[default]
    Recording,
    /// The user said it; it replaces what the recording says.
    User,
}

impl AspectOrigin {
    /// In words, for people.
    pub fn words(self) -> &'static str {
        match self {
            Self::Recording => "as the recording says",
            Self::User => "as given",
        }
    }

    /// Whether it is the recording's own.
    pub fn is_recording(&self) -> bool {
        *self == Self::Recording
    }
}

impl Default for PixelAspect {
    fn default() -> Self {
        Self::SQUARE
    }
}

impl PixelAspect {
    /// As wide as high.
    pub const SQUARE: Self = Self { width: 1, height: 1 };

    /// `None` for a side of 0, and for more than [`MOST_TIMES`].
    pub fn new(width: u64, height: u64) -> Option<Self> {
        let times = |n: u64| u128::from(n) * u128::from(MOST_TIMES);
        if width == 0 || height == 0 || u128::from(width) > times(height) || u128::from(height) > times(width)
        {
            return None;
        }
        let (mut a, mut b) = (width, height);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        let (mut width, mut height) = (width / a, height / a);
        // Beyond 32 bits a half more or less is nothing.
        while width.max(height) > u64::from(u32::MAX) {
            (width, height) = (width / 2, height / 2);
        }
        Some(Self { width: u32::try_from(width).ok()?, height: u32::try_from(height).ok()? })
    }

    /// The pixel aspect that a recording states, 0 where it states none. A ratio that cannot be is warned of and not believed.
    pub(crate) fn said(width: u64, height: u64, warnings: &mut Vec<Message>) -> Self {
        if width == 0 || height == 0 {
            return Self::SQUARE;
        }
        match Self::new(width, height) {
            Some(aspect) if aspect.agrees(Self::SQUARE) => Self::SQUARE,
            Some(aspect) => aspect,
            None => {
                let said = format!(
                    "it says that its pixels are {width} wide and {height} high, as no camera's are: they are taken \
                     for square. Give what is true with "
                );
                warnings.push(Message::from(said) + Setting::PixelAspect);
                Self::SQUARE
            }
        }
    }

    /// Width and height, in lowest terms.
    pub fn parts(self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Width over height.
    pub fn ratio(self) -> f64 {
        f64::from(self.width) / f64::from(self.height)
    }

    /// Whether pixels are as wide as high.
    pub fn is_square(&self) -> bool {
        self.width == self.height
    }

    /// Of the picture turned by a quarter.
    #[must_use]
    pub fn turned(self) -> Self {
        Self { width: self.height, height: self.width }
    }

    /// Whether it is the other but for rounding.
    pub fn agrees(self, other: Self) -> bool {
        (self.ratio() / other.ratio() - 1.0).abs() < SAME_PART
    }

    /// A place in recorded pixels, in square ones.
    pub fn to_square(self, place_px: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(place_px.x * self.ratio(), place_px.y)
    }

    /// A place in square pixels, in recorded ones.
    pub fn to_recorded(self, place_px: Vector2<f64>) -> Vector2<f64> {
        Vector2::new(place_px.x / self.ratio(), place_px.y)
    }

    /// Width and height of a pixel in units of the square of its area.
    pub(crate) fn sides(self) -> [f64; 2] {
        let root = self.ratio().sqrt();
        [root, 1.0 / root]
    }

    /// In words, for people: `pixels 1.0667 wide (16:15)`.
    pub fn words(self) -> String {
        format!("pixels {:.4} wide ({self})", self.ratio())
    }
}

impl fmt::Display for PixelAspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.width, self.height)
    }
}

impl FromStr for PixelAspect {
    type Err = String;

    /// Of `W:H`. An error is a clause without a full stop.
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |t: &str| t.parse::<u32>().ok().filter(|n| *n > 0);
        let parts = text.split_once(':').and_then(|(w, h)| Some((number(w.trim())?, number(h.trim())?)));
        let Some((width, height)) = parts else {
            return Err(format!(
                "{text:?} is no pixel aspect; width:height is expected, two whole numbers above 0 such as 16:15"
            ));
        };
        Self::new(width.into(), height.into()).ok_or_else(|| {
            format!(
                "a pixel aspect of {text} is that of no camera; 1:{MOST_TIMES} to {MOST_TIMES}:1 is expected"
            )
        })
    }
}

impl TryFrom<String> for PixelAspect {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<PixelAspect> for String {
    fn from(aspect: PixelAspect) -> Self {
        aspect.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_is_kept_in_lowest_terms_and_absurd_ones_are_none() {
        assert_eq!("32:30".parse(), "16:15".parse::<PixelAspect>());
        assert_eq!("16:15".parse::<PixelAspect>().unwrap().to_string(), "16:15");
        for wrong in ["", "16", "16:0", "0:1", "-4:3", "1.5:1", "a:b", "1000:1", "1:5", "4:3:2"] {
            assert!(wrong.parse::<PixelAspect>().is_err(), "{wrong}");
        }
        assert!(PixelAspect::new(u64::MAX, u64::MAX - 1).is_some());
        assert!(PixelAspect::new(u64::MAX, 1).is_none());
    }

    #[test]
    fn a_turn_swaps_and_places_come_back() {
        let aspect: PixelAspect = "4:3".parse().unwrap();
        assert_eq!(aspect.turned().to_string(), "3:4");
        let place = Vector2::new(90.0, 7.0);
        assert_eq!(aspect.to_square(place), Vector2::new(120.0, 7.0));
        assert!((aspect.to_recorded(aspect.to_square(place)) - place).norm() < 1e-12);
        // 720 px shown as 853 are 32:27, rounded.
        assert!("853:720".parse::<PixelAspect>().unwrap().agrees("32:27".parse().unwrap()));
        assert!(!aspect.agrees(PixelAspect::SQUARE));
        let [w, h] = aspect.sides();
        assert!((w * h - 1.0).abs() < 1e-15 && (w / h - aspect.ratio()).abs() < 1e-15);
        assert_eq!(PixelAspect::SQUARE.sides(), [1.0, 1.0]);
    }
}
