//! The user's choice of markers to follow: places that were pointed at, how many markers there are, numbers of the picture, nodes
//! that are one marker.
//!
//! Owns: [`Wanted`], [`Pointed`]. Must not: look at a recording.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Fault, Result};
use crate::message::Setting;

/// A place of a marker, in pixels of the recording.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pointed {
    /// Where, px.
    pub x_px: f64,
    /// Where, px.
    pub y_px: f64,
    /// In which frame; `None` is the first one that is read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<u64>,
}

/// The markers that are to be followed. By default none is named, and all are found.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Wanted {
    /// How many markers there are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub markers: Option<usize>,
    /// Numbers of the picture that are to be followed too.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub also: Vec<usize>,
    /// Names of two nodes that are one marker; the first name stays.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub same: Vec<[String; 2]>,
    /// Places of markers.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub marker: Vec<Pointed>,
}

impl Wanted {
    /// Whether nothing was said.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Whether something is named that only moves: places, and numbers and names of what moves.
    pub fn names_what_moves(&self) -> bool {
        !(self.marker.is_empty() && self.also.is_empty() && self.same.is_empty())
    }

    /// Whether it says things that contradict each other or that cannot be.
    ///
    /// # Errors
    /// [`Error::Argument`] naming the setting.
    pub fn check(&self, image_px: [u32; 2]) -> Result<()> {
        let refuse = |setting, problem: String, advice: &str| {
            Err(Error::Argument(Fault::of(setting, problem).advice(advice)))
        };
        if self.markers == Some(0) {
            return refuse(Setting::Markers, "0 markers cannot be followed".into(), "Give 1 or more");
        }
        if let (false, Some(n)) = (self.marker.is_empty(), self.markers)
            && n != self.marker.len()
        {
            return Err(Error::Argument(
                Fault::of(
                    Setting::Markers,
                    format!("{n} markers, and {} were pointed at", self.marker.len()),
                )
                .advice(
                    "Give " + Setting::Marker + " for each of them, or leave " + Setting::Markers + " out",
                ),
            ));
        }
        if !self.marker.is_empty() && !self.also.is_empty() {
            return Err(Error::Argument(
                Fault::of(
                    Setting::Also,
                    "the numbers are those of a picture for which nothing was pointed at",
                )
                .advice("Give all by their numbers, or all by " + Setting::Marker),
            ));
        }
        let [w, h] = image_px.map(f64::from);
        let inside = |v: f64, n: f64| (-0.5..=n - 0.5).contains(&v);
        if let Some(p) = self.marker.iter().find(|p| !inside(p.x_px, w) || !inside(p.y_px, h)) {
            return refuse(
                Setting::Marker,
                format!("({}, {}) px is not in the picture of {w} x {h} px", p.x_px, p.y_px),
                "Give column and row of the marker's centre, counted from the upper left corner",
            );
        }
        if let Some([a, _]) = self.same.iter().find(|[a, b]| a == b) {
            return refuse(Setting::Same, format!("{a} is itself"), "Give two names of nodes");
        }
        Ok(())
    }
}

impl FromStr for Pointed {
    type Err = String;

    /// Of `X,Y` or `X,Y@FRAME`.
    fn from_str(text: &str) -> Result<Self, String> {
        let form = "expected X,Y or X,Y@FRAME, for example 312,201@57";
        let (place, frame) = match text.split_once('@') {
            Some((place, frame)) => (place, Some(frame.trim().parse().map_err(|_| form)?)),
            None => (text, None),
        };
        let (x, y) = place.split_once(',').ok_or(form)?;
        let number = |t: &str| t.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or(form);
        Ok(Self { x_px: number(x)?, y_px: number(y)?, frame })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x_px: f64, y_px: f64, frame: Option<u64>) -> Pointed {
        Pointed { x_px, y_px, frame }
    }

    #[test]
    fn places_are_read_with_and_without_a_frame() {
        assert_eq!("312,201.5@57".parse(), Ok(at(312.0, 201.5, Some(57))));
        assert_eq!(" 3 , 4 ".parse(), Ok(at(3.0, 4.0, None)));
        for wrong in ["", "3", "3,4@", "3,4@-1", "3,4,5", "a,b", "nan,1", "3;4"] {
            assert!(wrong.parse::<Pointed>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_cannot_be_is_refused_by_its_setting() {
        let wrong: [(Wanted, &str); 6] = [
            (Wanted { markers: Some(0), ..Wanted::default() }, "markers: 0"),
            (
                Wanted { markers: Some(2), marker: vec![at(1.0, 1.0, None)], ..Wanted::default() },
                "markers: 2",
            ),
            (Wanted { also: vec![2], marker: vec![at(1.0, 1.0, None)], ..Wanted::default() }, "also:"),
            (Wanted { marker: vec![at(100.0, 1.0, None)], ..Wanted::default() }, "marker: (100, 1) px"),
            (Wanted { marker: vec![at(1.0, -1.0, None)], ..Wanted::default() }, "marker: (1, -1) px"),
            (Wanted { same: vec![["n1".into(), "n1".into()]], ..Wanted::default() }, "same: n1"),
        ];
        for (wanted, said) in wrong {
            let error = wanted.check([100, 50]).unwrap_err().to_string();
            assert!(error.starts_with(said), "{error}");
        }
        let right = Wanted { marker: vec![at(99.4, 49.0, Some(3))], markers: Some(1), ..Wanted::default() };
        assert!(right.check([100, 50]).is_ok());
        assert!(Wanted::default().is_default() && !right.is_default());
    }
}
