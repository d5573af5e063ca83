//! Explains in one line a command line that cannot be understood: what is wrong, and the choices or the nearest word.

use std::error::Error;
use std::ffi::OsString;
use std::num::{IntErrorKind, ParseFloatError, ParseIntError};
use std::path::Path;

use clap::Command;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use crate::kind::misplaced;

use super::args::command;
use super::words::CommandLine;

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

/// The line; `None` for help, versions and what clap says better itself. `first` is the first word behind the program's name.
pub fn line(error: &clap::Error, program: &'static str, first: Option<&OsString>) -> Option<String> {
    let whole = command(program);
    let help = match first.and_then(|word| whole.find_subcommand(word)) {
        Some(subcommand) => format!("See `{program} {} --help`", subcommand.get_name()),
        None => format!("See `{program} --help`"),
    };
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
            let owners = owners(&whole, &argument).map(|name| format!("`{program} {name}`"));
            let owners: Vec<String> = owners.collect();
            Some(unknown_option(&argument, &words(error, ContextKind::SuggestedArg), &owners, &help))
        }
        ErrorKind::InvalidSubcommand => {
            let word = words(error, ContextKind::InvalidSubcommand).concat();
            Some(unknown_command(&word, &words(error, ContextKind::SuggestedSubcommand), program))
        }
        ErrorKind::MissingRequiredArgument => Some(format!("{argument} is missing. {help}")),
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

/// Subcommands that have an option.
fn owners<'a>(whole: &'a Command, option: &'a str) -> impl Iterator<Item = &'a str> {
    let name = option.trim_start_matches('-').split('=').next().unwrap_or_default();
    let has = move |c: &&Command| c.get_arguments().any(|a| a.get_long() == Some(name));
    whole.get_subcommands().filter(has).map(Command::get_name)
}

fn unknown_option(option: &str, near: &[String], owners: &[String], help: &str) -> String {
    let advice = match near.first() {
        _ if !owners.is_empty() => format!("{} has it", listed(owners)),
        Some(near) => format!("Did you mean {near}?"),
        None => help.to_owned(),
    };
    format!("{option}: it is not an option of this command. {advice}")
}

fn unknown_command(word: &str, near: &[String], program: &'static str) -> String {
    if let Some(fault) = misplaced(Path::new(word), &[]) {
        return CommandLine::new(program, command(program), "track").say(&fault.message());
    }
    if let Some((_, known)) = PYDPEND.iter().find(|(w, _)| *w == word.to_lowercase()) {
        return format!("{word:?} is not a command of tracker but of pydpend. Type `pydpend {known}`");
    }
    let whole = command(program);
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
