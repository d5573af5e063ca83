//! Lists the files of a picture sequence in the order of their numbers.
//!
//! Owns: [`list`], [`Numbered`]. Must not: open a picture.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Fault, FaultKind, Result};
use crate::message::Message;
use crate::name::{path, text};

/// Endings of files that are taken for pictures.
const ENDINGS: [&str; 7] = ["png", "tif", "tiff", "bmp", "pgm", "jpg", "jpeg"];

/// The files of a sequence in their order; `None` stands for one that its numbering leaves out.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Numbered {
    /// Files, and gaps between them.
    pub files: Vec<Option<PathBuf>>,
    /// Warnings about the numbering.
    pub warnings: Vec<Message>,
}

/// Whether a name is a pattern: a glob, or printf's `%d`.
pub fn is_pattern(name: &str) -> bool {
    name.contains(['*', '?']) || printf(name).is_some()
}

/// The files that a folder holds or a pattern fits, in natural order of the numbers in their names.
///
/// # Errors
/// [`Error::Source`] if there are none.
pub fn list(name: &str) -> Result<Numbered> {
    let path = path(name);
    let (folder, pattern) = if path.is_dir() {
        (path.clone(), None)
    } else {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        (folder.to_owned(), path.file_name().map(text))
    };
    let entries = fs::read_dir(&folder).map_err(|e| {
        Error::Source(
            Fault::new(folder.display(), format!("the folder cannot be read ({e})"))
                .caused_by(&e)
                .advice("Check its name; a pattern may stand for file names only, not for folders"),
        )
    })?;
    let mut names: Vec<String> = entries
        .flatten()
        .filter(|e| e.path().is_file())
        .map(|e| text(e.file_name()))
        .filter(|n| match &pattern {
            Some(p) => fits(p, n) && (!n.starts_with('.') || p.starts_with('.')),
            None => is_picture(n) && !n.starts_with('.'),
        })
        .collect();
    if names.is_empty() {
        return Err(Error::Source(
            Fault::new(name, "no pictures (PNG, TIFF, BMP, PGM, JPEG) are there")
                .of_kind(FaultKind::Missing)
                .advice("Give a folder, or a pattern such as 'frames/img_%05d.png'"),
        ));
    }
    names.sort_by(|a, b| natural(a, b));
    let left_out = if pattern.is_none() { leave_out(name, &mut names)? } else { None };
    let mut numbered = gaps(&names);
    numbered.warnings.extend(left_out.map(Message::from));
    for file in numbered.files.iter_mut().flatten() {
        *file = folder.join(crate::name::path(&file.to_string_lossy()));
    }
    Ok(numbered)
}

/// Ratio of the numbers of pictures of two namings from which on the rarer ones are company: covers and previews.
const CLEARLY_MORE: usize = 10;

/// The naming of a file: its name with `#` for each number.
fn naming(name: &str) -> String {
    runs(&name.to_lowercase()).into_iter().map(|r| if r.starts_with(is_digit) { "#" } else { r }).collect()
}

/// Leaves the pictures of a folder that belong to one sequence, and says which ones were left out.
fn leave_out(folder: &str, names: &mut Vec<String>) -> Result<Option<String>> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for name in &*names {
        *counts.entry(naming(name)).or_default() += 1;
    }
    let mut by_count: Vec<(usize, String)> = counts.into_iter().map(|(naming, n)| (n, naming)).collect();
    by_count.sort_by(|a, b| b.0.cmp(&a.0).then_with(|| a.1.cmp(&b.1)));
    let [(most, naming_of_most), (second, _), ..] = &by_count[..] else { return Ok(None) };
    // Names that are all different tell nothing; two pictures alike by chance neither.
    if *most < 3 {
        return Ok(None);
    }
    let kinds: Vec<String> = by_count.iter().take(3).map(|(n, naming)| format!("{n} {naming}")).collect();
    let more = if by_count.len() > 3 { ", ..." } else { "" };
    if second * CLEARLY_MORE > *most && *second > 1 {
        return Err(Error::Source(
            Fault::new(
                folder,
                format!("the folder holds several sequences of pictures ({}{more})", kinds.join(", ")),
            )
            .of_kind(FaultKind::Unsupported)
            .advice("Give one of them as a pattern, such as 'frames/img_%05d.png'"),
        ));
    }
    let (kept, others): (Vec<String>, Vec<String>) =
        std::mem::take(names).into_iter().partition(|n| naming(n) == *naming_of_most);
    *names = kept;
    let some: Vec<&str> = others.iter().take(3).map(String::as_str).collect();
    let more = if others.len() > 3 { ", ..." } else { "" };
    Ok(Some(format!(
        "{} other pictures in the folder are left out ({}{more}): they are not named as the {most} {naming_of_most}",
        others.len(),
        some.join(", ")
    )))
}

/// Whether a file's ending is one of pictures.
pub fn is_picture(name: &str) -> bool {
    let ending = Path::new(name).extension().and_then(|e| e.to_str()).map(str::to_lowercase);
    ending.is_some_and(|e| ENDINGS.contains(&e.as_str()))
}

/// Compares names so that numbers in them count as numbers: `a2` before `a10`.
pub fn natural(a: &str, b: &str) -> Ordering {
    let (left, right) = (runs(a), runs(b));
    for (x, y) in left.iter().zip(&right) {
        let order = match (x.starts_with(is_digit), y.starts_with(is_digit)) {
            (true, true) => {
                let (n, m) = (x.trim_start_matches('0'), y.trim_start_matches('0'));
                n.len().cmp(&m.len()).then_with(|| n.cmp(m))
            }
            _ => x.cmp(y),
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

fn is_digit(c: char) -> bool {
    c.is_ascii_digit()
}

/// A name cut where digits begin or end.
fn runs(name: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let digit = is_digit(first);
        let end = rest.find(|c| is_digit(c) != digit).unwrap_or(rest.len());
        parts.push(&rest[..end]);
        rest = &rest[end..];
    }
    parts
}

/// Puts a gap where numbers are left out. The last number in the stem counts; the smallest step is the usual
/// one. Numbers that would make more gaps than files are something else, a date or a time.
fn gaps(names: &[String]) -> Numbered {
    let number = |name: &String| {
        let stem = Path::new(name).file_stem()?.to_string_lossy().into_owned();
        runs(&stem).into_iter().rev().find(|r| r.starts_with(is_digit))?.parse::<u64>().ok()
    };
    let mut out =
        Numbered { files: names.iter().map(|n| Some(PathBuf::from(n))).collect(), warnings: vec![] };
    let Some(numbers) = names.iter().map(number).collect::<Option<Vec<u64>>>() else {
        if names.len() > 1 {
            out.warnings.push("some names hold no number; pictures are in order of their names".into());
        }
        return out;
    };
    let steps: Vec<u64> = numbers.windows(2).map(|w| w[1].saturating_sub(w[0])).collect();
    let Some(step) = steps.iter().copied().min() else { return out };
    if step == 0 {
        out.warnings.push("numbers in the names do not rise; gaps cannot be seen".into());
        return out;
    }
    let left_out: u64 = steps.iter().map(|s| s.div_ceil(step) - 1).fold(0, u64::saturating_add);
    if left_out == 0 {
        return out;
    }
    let first = steps.iter().position(|s| *s > step).unwrap_or(0);
    let place = format!("the first between {} and {}", names[first], names[first + 1]);
    if left_out > names.len() as u64 || steps.iter().any(|s| s % step != 0) {
        out.warnings.push(format!(
            "numbers in the names are not evenly spaced ({place}); pictures are taken as evenly spaced in time"
        ).into());
        return out;
    }
    out.warnings.push(
        format!("{left_out} pictures are missing by their numbers, {place}; their frames are kept empty")
            .into(),
    );
    out.files.clear();
    for (i, name) in names.iter().enumerate() {
        let gap = if i == 0 { 0 } else { steps[i - 1] / step - 1 };
        out.files.extend((0..gap).map(|_| None));
        out.files.push(Some(PathBuf::from(name)));
    }
    out
}

/// The parts of a printf pattern around its number, and the number's width.
fn printf(pattern: &str) -> Option<(&str, usize, &str)> {
    let at = pattern.find('%')?;
    let rest = &pattern[at + 1..];
    let end = rest.find(|c: char| !c.is_ascii_digit())?;
    let width = if end == 0 { 0 } else { rest[..end].parse().ok()? };
    rest[end..].strip_prefix('d').map(|tail| (&pattern[..at], width, tail))
}

/// Whether a file name fits a pattern.
fn fits(pattern: &str, name: &str) -> bool {
    if let Some((head, width, tail)) = printf(pattern) {
        let Some(number) = name.strip_prefix(head).and_then(|n| n.strip_suffix(tail)) else { return false };
        return !number.is_empty()
            && number.chars().all(is_digit)
            && (number.len() == width || number.len() > width && !number.starts_with('0') || width == 0);
    }
    glob(&pattern.chars().collect::<Vec<_>>(), &name.chars().collect::<Vec<_>>())
}

/// `*` stands for any run of characters, `?` for one.
fn glob(pattern: &[char], name: &[char]) -> bool {
    let (mut p, mut n) = (0, 0);
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        if p < pattern.len() && pattern[p] == '*' {
            star = Some((p, n));
            p += 1;
        } else if p < pattern.len() && (pattern[p] == '?' || pattern[p] == name[n]) {
            p += 1;
            n += 1;
        } else if let Some((at, from)) = star {
            star = Some((at, from + 1));
            p = at + 1;
            n = from + 1;
        } else {
            return false;
        }
    }
    pattern[p..].iter().all(|c| *c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(list: &[&str]) -> Vec<String> {
        list.iter().map(|s| (*s).to_owned()).collect()
    }

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let mut list =
            names(&["a10.png", "a2.png", "a1.png", "a02b.png", "b1.png", "a99999999999999999999999.png"]);
        list.sort_by(|a, b| natural(a, b));
        assert_eq!(
            list,
            names(&["a1.png", "a2.png", "a02b.png", "a10.png", "a99999999999999999999999.png", "b1.png"])
        );
    }

    #[test]
    fn patterns_fit_what_they_should() {
        for (pattern, name, expected) in [
            ("img_%05d.tif", "img_00012.tif", true),
            ("img_%05d.tif", "img_123456.tif", true),
            ("img_%05d.tif", "img_12.tif", false),
            ("img_%d.tif", "img_12.tif", true),
            ("img_%d.tif", "img_.tif", false),
            ("*.png", "a.png", true),
            ("*.png", "a.png.txt", false),
            ("a?c*", "abcdef", true),
            ("*a*b*", "xxaxxbx", true),
            ("*a*b*", "xxbxxax", false),
        ] {
            assert_eq!(fits(pattern, name), expected, "{pattern} {name}");
        }
        assert!(is_pattern("f/img_%05d.tif") && is_pattern("f/*.png") && !is_pattern("f/100%.png"));
    }

    #[test]
    fn left_out_numbers_are_gaps() {
        let gap = gaps(&names(&["f7.png", "f8.png", "f11.png"]));
        assert_eq!(
            gap.files.iter().map(Option::is_some).collect::<Vec<_>>(),
            [true, true, false, false, true]
        );
        assert!(gap.warnings[0].to_string().contains("2 pictures are missing"), "{:?}", gap.warnings);
        let tens = gaps(&names(&["f0.png", "f10.png", "f20.png"]));
        assert_eq!((tens.files.len(), tens.warnings.len()), (3, 0));
        let times = gaps(&names(&["f1.png", "f2.png", "f1000000000.png"]));
        assert_eq!((times.files.len(), times.warnings.len()), (3, 1));
    }
}
