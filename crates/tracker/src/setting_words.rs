//! Parses settings whose values are words: one list of words for the command line, Python and files.
//!
//! Owns: [`Worded`], [`frame_range`]. Each setting has its list beside its type.
//!
//! ```
//! use tracker::setting_words::Worded;
//! use tracker::source::Decoder;
//!
//! assert_eq!("opencv".parse(), Ok(Decoder::Opencv));
//! assert_eq!(Decoder::Opencv.word(), "opencv");
//! let said = "gstreamer".parse::<Decoder>().unwrap_err().to_string();
//! assert_eq!(said, "decoder: \"gstreamer\" is not known. Give auto, ffmpeg or opencv");
//! ```

use std::ops::Range;

use crate::error::Fault;
use crate::message::Setting;

/// The frames of `A..B`, `A..` or `..B`: from A up to but not B.
///
/// # Errors
/// What was expected.
pub fn frame_range(text: &str) -> Result<Range<u64>, String> {
    let form = "expected A..B, for example 0..1000";
    let (start, end) = text.split_once("..").ok_or(form)?;
    let number = |t: &str, none: u64| {
        if t.is_empty() { Ok(none) } else { t.parse().map_err(|_| format!("{t:?} is not a frame; {form}")) }
    };
    Ok(number(start, 0)?..number(end, u64::MAX)?)
}

/// A setting whose values are words.
pub trait Worded: Copy + PartialEq + Sized + 'static {
    /// The setting.
    const SETTING: Setting;
    /// Each word with its value, the default first.
    const WORDS: &'static [(&'static str, Self)];

    /// The value of a word.
    ///
    /// # Errors
    /// A fault of the setting that lists its words.
    fn from_word(text: &str) -> Result<Self, Fault> {
        let known = Self::WORDS.iter().find(|(word, _)| *word == text);
        known.map(|(_, value)| *value).ok_or_else(|| {
            Fault::of(Self::SETTING, format!("{text:?} is not known"))
                .advice(format!("Give {}", listed(Self::WORDS.iter().map(|(word, _)| *word))))
        })
    }

    /// The word of a value.
    fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, value)| *value == self).map_or("", |(word, _)| word)
    }
}

/// `a, b or c`.
fn listed<'a>(words: impl Iterator<Item = &'a str>) -> String {
    let words: Vec<&str> = words.collect();
    match words.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} or {last}", before.join(", ")),
        _ => words.concat(),
    }
}

/// Gives a type its words, and parses them with `str::parse`.
macro_rules! words {
    ($kind:ty, $setting:expr, [$($word:literal => $value:expr),+ $(,)?]) => {
        impl crate::setting_words::Worded for $kind {
            const SETTING: crate::message::Setting = $setting;
            const WORDS: &'static [(&'static str, Self)] = &[$(($word, $value)),+];
        }

        impl std::str::FromStr for $kind {
            type Err = crate::error::Fault;

            fn from_str(text: &str) -> Result<Self, Self::Err> {
                crate::setting_words::Worded::from_word(text)
            }
        }
    };
}
pub(crate) use words;

#[cfg(test)]
mod tests {
    use std::fmt::Debug;

    use super::*;
    use crate::detect::{Centroid, PolaritySetting};
    use crate::source::{Decoder, Interlaced};
    use crate::synth::encode::Codec;

    /// Each value has one word, which is read again.
    fn told_and_read<T: Worded + Debug + Default>() {
        assert_eq!(T::WORDS[0].1, T::default(), "the default comes first");
        agree::<T>();
    }

    fn agree<T: Worded + Debug>() {
        for &(word, value) in T::WORDS {
            assert_eq!(value.word(), word);
            assert_eq!(T::from_word(word), Ok(value));
        }
        let said = T::from_word("no such word").unwrap_err().to_string();
        let names = T::WORDS.iter().all(|(word, _)| said.contains(word));
        assert!(names && said.starts_with(T::SETTING.name()), "{said}");
    }

    #[test]
    fn words_are_read_as_they_are_told() {
        told_and_read::<PolaritySetting>();
        told_and_read::<Centroid>();
        told_and_read::<Decoder>();
        told_and_read::<Interlaced>();
        agree::<Codec>();
    }
}
