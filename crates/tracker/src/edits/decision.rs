//! Defines one decision: what it says of a node in which frames, and who made it when.
//!
//! Owns: [`Decision`], [`What`]. Must not: read files, or change rows.

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// Kinds of decisions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum What {
    /// The node is at a place of one frame, with a standard uncertainty.
    Place,
    /// The node is not seen in some frames.
    NoMarker,
    /// The detection at a place of one frame is the node, in some frames around it as far as it can be followed.
    Name,
    /// Two nodes have each other's names in some frames.
    Exchange,
}

/// One decision of a person.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decision {
    /// Kind of the decision.
    pub what: What,
    /// The node's name.
    pub node: String,
    /// The frame in which `at_px` is: of `place` and `name`.
    pub frame: Option<u64>,
    /// Frames `A..B`, from A up to but not B: of all but `place`.
    pub frames: Option<String>,
    /// Place in recorded pixels, x right and y down: of `place` and `name`.
    pub at_px: Option<[f64; 2]>,
    /// Standard uncertainty of each coordinate in square pixels as high as the recorded ones: of `place`.
    pub sigma_px: Option<f64>,
    /// The other node: of `exchange`.
    pub with: Option<String>,
    /// Who decided.
    pub by: String,
    /// When.
    pub when: toml::value::Datetime,
}

impl Decision {
    /// The frames that it is about. A [`Decision::check`]ed one has them.
    pub fn span(&self) -> Range<u64> {
        match (&self.frames, self.frame) {
            (Some(text), _) => crate::setting_words::frame_range(text).unwrap_or(0..0),
            (None, Some(frame)) => frame..frame.saturating_add(1),
            (None, None) => 0..0,
        }
    }

    /// Whether it says all that its kind needs and nothing else: the key at fault, and what is wrong.
    pub(super) fn check(&self) -> Result<(), (&'static str, String)> {
        let has = [
            ("frame", self.frame.is_some()),
            ("frames", self.frames.is_some()),
            ("at_px", self.at_px.is_some()),
            ("sigma_px", self.sigma_px.is_some()),
            ("with", self.with.is_some()),
        ];
        let (kind, needs): (&str, &[&str]) = match self.what {
            What::Place => ("place", &["frame", "at_px", "sigma_px"]),
            What::NoMarker => ("no_marker", &["frames"]),
            What::Name => ("name", &["frame", "frames", "at_px"]),
            What::Exchange => ("exchange", &["frames", "with"]),
        };
        for (key, there) in has {
            match (needs.contains(&key), there) {
                (true, false) => return Err((key, format!("a {kind} needs it"))),
                (false, true) => {
                    return Err((key, format!("a {kind} has none; it has {}", needs.join(", "))));
                }
                _ => {}
            }
        }
        if let Some(text) = &self.frames {
            let frames = crate::setting_words::frame_range(text)
                .map_err(|why| ("frames", format!("{text:?} cannot be: {why}")))?;
            if frames.is_empty() {
                return Err(("frames", format!("{text:?} holds no frame")));
            }
            if let (What::Name, Some(frame)) = (self.what, self.frame)
                && !frames.contains(&frame)
            {
                return Err(("frame", format!("{frame} is not among the frames {text}")));
            }
        }
        if self.at_px.is_some_and(|place| place.iter().any(|v| !v.is_finite())) {
            return Err(("at_px", "it is no place".into()));
        }
        if let Some(sigma) = self.sigma_px
            && !(sigma.is_finite() && sigma > 0.0)
        {
            return Err(("sigma_px", format!("{sigma} is no standard uncertainty: it is above 0")));
        }
        if self.with.as_ref() == Some(&self.node) {
            return Err(("with", format!("{} is itself", self.node)));
        }
        Ok(())
    }
}
