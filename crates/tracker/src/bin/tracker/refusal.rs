//! Explains in one line a command line that cannot be understood: what is wrong, and the choices or the nearest word.

use std::error::Error;
use std::num::{IntErrorKind, ParseFloatError, ParseIntError};
use std::path::Path;

use clap::CommandFactory;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use tracker::kind::misplaced;

use crate::args::Cli;
use crate::words::CommandLine;

/// Commands of the other program, and American spellings of them.
const PYDPEND: [(&str, &str); 11] = [
    ("analyse", "analyse"),
    ("analyze", "analyse"),
    ("angles", "angles"),
    ("animate", "animate"),
    ("calibrate", "calibrate"),
    ("compare", "compare"),
    ("export", "export"),
    ("fit", "fit"),
    ("plot", "plot"),
    ("predict", "predict"),
    ("report", "analyse"),
];

/// The line; `None` for help, versions and what clap says better itself.
pub fn line(error: &clap::Error) -> Option<String> {
    let arguments = words(error, ContextKind::InvalidArg);
    let argument = arguments.join(", ");
    let value = words(error, ContextKind::InvalidValue).concat();
    match error.kind() {
        ErrorKind::InvalidValue if value.is_empty() => Some(format!("{argument}: a value is missing")),
        ErrorKind::InvalidValue => {
            let known = listed(&words(error, ContextKind::ValidValue));
            Some(format!("{argument}: {value:?} is not known. Give {known}"))
        }
        ErrorKind::ValueValidation => {
            let why = error.source().map(why).unwrap_or_default();
            Some(format!("{argument}: {value:?} cannot be ({why})"))
        }
        ErrorKind::UnknownArgument => {
            Some(unknown_option(&argument, &words(error, ContextKind::SuggestedArg)))
        }
        ErrorKind::InvalidSubcommand => {
            let word = words(error, ContextKind::InvalidSubcommand).concat();
            Some(unknown_command(&word, &words(error, ContextKind::SuggestedSubcommand)))
        }
        ErrorKind::MissingRequiredArgument => Some(format!("{argument} is missing. See `tracker help`")),
        ErrorKind::ArgumentConflict => {
            let others = words(error, ContextKind::PriorArg).join(", ");
            Some(format!("{argument} and {others} cannot be given together. Leave one out"))
        }
        _ => None,
    }
}

/// The reason for which a value cannot be.
fn why(source: &(dyn Error + 'static)) -> String {
    let whole = source.downcast_ref::<ParseIntError>().map(|e| match e.kind() {
        IntErrorKind::PosOverflow => "the number is too large".to_owned(),
        // No option takes whole numbers below zero.
        _ => "expected a whole number of 0 or more".to_owned(),
    });
    let number = || source.is::<ParseFloatError>().then(|| "expected a number".to_owned());
    whole.or_else(number).unwrap_or_else(|| source.to_string())
}

fn unknown_option(option: &str, near: &[String]) -> String {
    let name = option.trim_start_matches('-').split('=').next().unwrap_or_default();
    let whole = Cli::command();
    let owners: Vec<String> = whole
        .get_subcommands()
        .filter(|c| c.get_arguments().any(|a| a.get_long() == Some(name)))
        .map(|c| format!("`tracker {}`", c.get_name()))
        .collect();
    let advice = match near.first() {
        _ if !owners.is_empty() => format!("{} has it", listed(&owners)),
        Some(near) => format!("Did you mean {near}?"),
        None => "See `tracker help`".into(),
    };
    format!("{option}: it is not an option of this command. {advice}")
}

fn unknown_command(word: &str, near: &[String]) -> String {
    if let Some(fault) = misplaced(Path::new(word), &[]) {
        return CommandLine::new(Cli::command(), "track").say(&fault.message());
    }
    if let Some((_, command)) = PYDPEND.iter().find(|(known, _)| *known == word.to_lowercase()) {
        return format!("{word:?} is not a command of tracker but of pydpend. Type `pydpend {command}`");
    }
    let whole = Cli::command();
    let known: Vec<String> = whole.get_subcommands().map(|c| c.get_name().to_owned()).collect();
    let advice =
        near.first().map_or_else(|| format!("Give {}", listed(&known)), |n| format!("Did you mean {n}?"));
    format!("{word:?} is not a command. {advice}")
}

/// The words that clap keeps of an error under a name.
fn words(error: &clap::Error, kind: ContextKind) -> Vec<String> {
    match error.get(kind) {
        Some(ContextValue::String(word)) => vec![word.clone()],
        Some(ContextValue::Strings(words)) => words.clone(),
        _ => Vec::new(),
    }
}

/// `a, b or c`.
fn listed(words: &[String]) -> String {
    match words.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} or {last}", before.join(", ")),
        Some((only, _)) => only.clone(),
        None => String::new(),
    }
}
