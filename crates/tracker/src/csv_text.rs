//! Writes and reads the text cells of CSV files.
//!
//! Owns: [`Cells`], [`split`], [`read_cell`].
//!
//! A spreadsheet takes a cell that begins with `=`, `+`, `-`, `@`, a tab or a carriage return for a formula and
//! calculates it. Where that is asked for, such a cell gets a `'` before it, which spreadsheets take for "this is
//! text". Readers take the mark off again; so that they can tell it from a name's own, a name that looks marked already
//! is marked once more, always.

/// Form of text cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Cells {
    /// As they are.
    #[default]
    Plain,
    /// So that no spreadsheet calculates them.
    Safe,
}

fn is_formula(text: &str) -> bool {
    text.starts_with(['=', '+', '-', '@', '\t', '\r'])
}

/// Whether `text` reads as one that was marked.
fn is_marked(text: &str) -> bool {
    text.strip_prefix('\'').is_some_and(|rest| is_formula(rest) || is_marked(rest))
}

impl Cells {
    /// A name as a field of a row.
    ///
    /// # Errors
    /// What is wrong with a name that no row can hold.
    pub fn field(self, name: &str) -> Result<String, String> {
        if name.contains(['\n', '\r']) {
            return Err(format!("the name {name:?} has a line break, which a CSV row cannot hold"));
        }
        let mark = if is_marked(name) || (self == Cells::Safe && is_formula(name)) { "'" } else { "" };
        let plain = !name.contains([',', '"']) && name.trim() == name;
        Ok(if plain { format!("{mark}{name}") } else { format!("\"{mark}{}\"", name.replace('"', "\"\"")) })
    }
}

/// The name that a cell holds, without quotes already.
pub fn read_cell(text: &str) -> &str {
    if is_marked(text) { &text[1..] } else { text }
}

/// Splits a line into fields, one after the other in `out`, each up to its entry in `ends`.
///
/// # Errors
/// What is wrong with the line.
pub fn split(line: &str, out: &mut String, ends: &mut Vec<usize>) -> Result<(), String> {
    out.clear();
    ends.clear();
    let mut rest = line;
    loop {
        if let Some(quoted) = rest.strip_prefix('"') {
            rest = quoted;
            loop {
                let Some(at) = rest.find('"') else { return Err("a quoted name has no end".into()) };
                out.push_str(&rest[..at]);
                rest = &rest[at + 1..];
                let Some(more) = rest.strip_prefix('"') else { break };
                out.push('"');
                rest = more;
            }
        }
        let at = rest.find(',').unwrap_or(rest.len());
        out.push_str(&rest[..at]);
        ends.push(out.len());
        if at == rest.len() {
            return Ok(());
        }
        rest = &rest[at + 1..];
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn fields(line: &str) -> Vec<String> {
        let (mut out, mut ends) = (String::new(), Vec::new());
        split(line, &mut out, &mut ends).unwrap();
        let starts = std::iter::once(0).chain(ends.iter().copied());
        starts.zip(&ends).map(|(a, &b)| out[a..b].to_owned()).collect()
    }

    proptest! {
        #[test]
        fn every_name_comes_back(names in proptest::collection::vec("['=+@\\-\t,\" a]{0,5}", 1..4)) {
            for cells in [Cells::Plain, Cells::Safe] {
                let line: Vec<String> = names.iter().map(|n| cells.field(n).unwrap()).collect();
                let read = fields(&line.join(","));
                let back: Vec<&str> = read.iter().map(|f| read_cell(f)).collect();
                prop_assert_eq!(&back, &names.iter().map(String::as_str).collect::<Vec<_>>());
                prop_assert!(cells == Cells::Plain || !read.iter().any(|f| is_formula(f)), "{:?}", read);
            }
        }
    }

    #[test]
    fn formulas_are_marked_when_asked() {
        for name in ["=1+1", "+cmd", "-2", "@sum", "\tx"] {
            let marked = read_cell(&Cells::Safe.field(name).unwrap()).to_owned();
            assert!(Cells::Safe.field(name).unwrap().trim_matches('"').starts_with('\''), "{marked}");
            assert!(!Cells::Plain.field(name).unwrap().trim_matches('"').starts_with('\''));
        }
        assert_eq!(Cells::Safe.field("n0"), Ok("n0".into()));
        assert_eq!(Cells::Safe.field("'tis"), Ok("'tis".into()));
        assert!(Cells::Safe.field("a\nb").is_err());
    }
}
