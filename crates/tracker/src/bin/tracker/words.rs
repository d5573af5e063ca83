//! Writes the library's messages in the words of the command line: settings are flags, steps are commands to type.

use tracker::message::{FrontEnd, Message, Setting};

/// The command line at the subcommand that runs. A setting that it has not is named with a subcommand that has it.
pub struct CommandLine {
    whole: clap::Command,
    subcommand: &'static str,
}

impl CommandLine {
    pub fn new(whole: clap::Command, subcommand: &'static str) -> Self {
        Self { whole, subcommand }
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
            Some(owner) if owner != self.subcommand => format!("{flag} (of `tracker {owner}`)"),
            _ => flag,
        }
    }

    fn step(&self, command: &str, _call: &str) -> String {
        format!("`{command}`")
    }
}
