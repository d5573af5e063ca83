//! Describes the command line as data, for a program that has it among commands of its own.

use clap::{Arg, Command};
use serde_json::{Value, json};

use super::args::command;

/// Each subcommand of `program` with its name, what it is about, and its arguments: flags (none where the argument is given
/// by its place), the word for the value (null for a switch), help, and the words to choose from.
pub fn described(program: &'static str) -> Value {
    let whole = command(program);
    whole.get_subcommands().map(subcommand).collect()
}

fn subcommand(c: &Command) -> Value {
    let arguments: Vec<Value> = c.get_arguments().map(argument).collect();
    json!({"name": c.get_name(), "about": c.get_about().map(ToString::to_string), "arguments": arguments})
}

fn argument(a: &Arg) -> Value {
    let short = a.get_short().map(|s| format!("-{s}"));
    let long = a.get_long_and_visible_aliases().unwrap_or_default().into_iter().map(|l| format!("--{l}"));
    let flags: Vec<String> = short.into_iter().chain(long).collect();
    let takes = a.get_action().takes_values();
    let choices: Vec<String> = a.get_possible_values().iter().map(|v| v.get_name().to_owned()).collect();
    json!({
        "flags": flags,
        "name": a.get_id().as_str(),
        "value": takes.then(|| a.get_value_names().map(|names| names.join(" "))).flatten(),
        "help": a.get_help().map(ToString::to_string),
        "choices": if takes { choices } else { Vec::new() },
    })
}
