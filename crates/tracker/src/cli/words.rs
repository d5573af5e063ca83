//! Writes the library's messages in the words of the command line: settings are flags, steps are commands to type.

use super::print;
use crate::message::{FrontEnd, Message, Setting};

/// The command line at the subcommand that runs. A setting that it has not is named with a subcommand that has it.
pub struct CommandLine {
    program: &'static str,
    whole: clap::Command,
    subcommand: &'static str,
}

impl CommandLine {
    pub fn new(program: &'static str, whole: clap::Command, subcommand: &'static str) -> Self {
        Self { program, whole, subcommand }
    }

    /// Prints a message on standard error, in the program's name.
    pub fn tell(&self, message: impl std::fmt::Display) {
        print::say(self.program, message);
    }

    /// A message as this subcommand's user types it.
    pub fn say(&self, message: &Message) -> String {
        message.render(self)
    }

    /// A subcommand with this flag, and whether it is the one that runs.
    fn owner(&self, flag: &str) -> Option<String> {
        let has = |c: &clap::Command| c.get_arguments().any(|a| a.get_long() == Some(flag));
        let here = self.whole.find_subcommand(self.subcommand).filter(|c| has(c));
        here.or_else(|| self.whole.get_subcommands().find(|c| has(c))).map(|c| c.get_name().to_owned())
    }
}

impl FrontEnd for CommandLine {
    fn setting(&self, setting: Setting, value: Option<&str>) -> String {
        let name = setting.name().replace('_', "-");
        let flag = value.map_or_else(|| format!("--{name}"), |v| format!("--{name} {v}"));
        match self.owner(&name) {
            Some(owner) if owner != self.subcommand => format!("{flag} (of `{} {owner}`)", self.program),
            _ => flag,
        }
    }

    fn step(&self, command: &str, _call: &str) -> String {
        // Steps are those of the whole program. What this one can do too is done with this one.
        let own =
            |words: &&str| self.whole.find_subcommand(words.split(' ').next().unwrap_or(words)).is_some();
        match command.strip_prefix("pydpend ").filter(own) {
            Some(words) => format!("`{} {words}`", self.program),
            None => format!("`{command}`"),
        }
    }
}
