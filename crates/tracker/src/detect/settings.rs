//! Defines the settings of detection: threshold, polarity, kind of centre, limits of area, region, lens.
//!
//! Owns: [`DetectSettings`], [`Threshold`], [`Polarity`], [`Centroid`]. Must not: learn what a setting leaves open
//! (`learn` does).

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serializer};

use crate::message::Setting;
use crate::pixel_aspect::PixelAspect;
use crate::rig::{Lens, Region};
use crate::setting_words::{Worded, words};

/// The origin of the threshold.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Threshold {
    /// Learned from the recording.
    #[default]
    Auto,
    /// Given in raw units of the recording.
    Raw(f64),
}

/// Whether markers are brighter or darker than what surrounds them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Polarity {
    /// Brighter.
    Bright,
    /// Darker.
    Dark,
}

impl Polarity {
    /// 1 for bright, -1 for dark: turns raw values into heights above the background.
    pub fn sign(self) -> f64 {
        match self {
            Polarity::Bright => 1.0,
            Polarity::Dark => -1.0,
        }
    }
}

/// The polarity as a user may say it; `None` is found out from the recording.
pub type PolaritySetting = Option<Polarity>;

impl Worded for PolaritySetting {
    const SETTING: Setting = Setting::Polarity;
    const WORDS: &'static [(&'static str, Self)] =
        &[("auto", None), ("bright", Some(Polarity::Bright)), ("dark", Some(Polarity::Dark))];
}

/// The estimator of a blob's centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Centroid {
    /// The centre of the disc that fits the blob's edge best; of a blob that is no disc, as `Weighted`.
    #[default]
    // Files from before it had this word say `weighted`.
    #[serde(alias = "weighted")]
    Disc,
    /// The mean place of the blob's pixels, each weighted by how far it rises above the local background.
    #[serde(rename = "intensity_weighted")]
    Weighted,
    /// The paper's: OpenCV's `findContours` and `moments` (Section 5.2).
    Contour,
}

words!(Centroid, Setting::Centroid, [
    "disc" => Centroid::Disc,
    "weighted" => Centroid::Weighted,
    "contour" => Centroid::Contour,
]);

impl FromStr for Threshold {
    type Err = &'static str;

    /// `auto`, or a number in raw units of the recording.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "auto" {
            return Ok(Threshold::Auto);
        }
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Threshold::Raw(value)),
            _ => Err("expected auto or a number in the recording's units"),
        }
    }
}

/// The settings of detection. By default all of them are learned from the recording.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct DetectSettings {
    /// Threshold.
    pub threshold: Threshold,
    /// Polarity.
    #[serde(serialize_with = "say_polarity", deserialize_with = "read_polarity")]
    pub polarity: PolaritySetting,
    /// Centre.
    pub centroid: Centroid,
    /// Least area, px; `None` is learned.
    pub min_area_px: Option<f64>,
    /// Greatest area, px; `None` is learned.
    pub max_area_px: Option<f64>,
    /// Where to look; `None` is the whole image.
    pub region: Option<Region>,
    /// Lens correction of centres; `None` is none.
    pub lens: Option<Lens>,
    /// Width to height of a pixel: a disc is as much narrower in the image.
    #[serde(default, skip_serializing_if = "PixelAspect::is_square")]
    pub pixel_aspect: PixelAspect,
}

/// The polarity in files, by its word.
fn say_polarity<S: Serializer>(polarity: &PolaritySetting, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(polarity.word())
}

/// Reads the polarity from its word in a file.
fn read_polarity<'de, D: Deserializer<'de>>(from: D) -> Result<PolaritySetting, D::Error> {
    let word = String::deserialize(from)?;
    PolaritySetting::from_word(&word).map_err(serde::de::Error::custom)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_say_the_centre_so_that_older_ones_are_understood() {
        let told = |c: Centroid| serde_json::to_string(&c).unwrap();
        let all = [Centroid::Disc, Centroid::Weighted, Centroid::Contour];
        assert_eq!(all.map(told), ["\"disc\"", "\"intensity_weighted\"", "\"contour\""]);
        for centroid in all {
            assert_eq!(serde_json::from_str::<Centroid>(&told(centroid)).unwrap(), centroid);
        }
        // The fit of discs was called so.
        assert_eq!(serde_json::from_str::<Centroid>("\"weighted\"").unwrap(), Centroid::Disc);
    }

    #[test]
    fn the_polarity_is_its_word_in_files() {
        for (word, polarity) in PolaritySetting::WORDS {
            let settings = DetectSettings { polarity: *polarity, ..DetectSettings::default() };
            let told = serde_json::to_value(&settings).unwrap();
            assert_eq!(told["polarity"], *word);
            assert_eq!(serde_json::from_value::<DetectSettings>(told).unwrap(), settings);
        }
    }
}
