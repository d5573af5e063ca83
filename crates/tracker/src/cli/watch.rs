//! Shows a run to a person at a terminal: a bar with rate and remaining time, ctrl-c, and what is printed.
//!
//! Owns: [`listen`], [`Watch`]. The first ctrl-c (or a termination signal) stops a run, which closes its table if that is
//! done at once; the second leaves the table too. A command that has nothing to close ends at the first.

use std::io::IsTerminal;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use super::print;
use crate::output;
use crate::pipeline::{Candidates, Observer, Stage};
use anyhow::anyhow;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Whether signals are listened to, or what kept them from being.
static LISTENS: OnceLock<Result<(), String>> = OnceLock::new();
/// Number of times that the user asked to stop.
static ASKED: AtomicUsize = AtomicUsize::new(0);
/// Time at which the user first asked to stop.
static FIRST: OnceLock<Instant> = OnceLock::new();
/// Whether somebody looks at the run.
static WATCHED: AtomicBool = AtomicBool::new(false);

/// Longest time that a stopped run may take to close its table.
const PATIENCE: Duration = Duration::from_millis(800);

/// Exit status of what the user stopped.
pub const INTERRUPTED: u8 = 130;

/// Begins to listen for ctrl-c and termination signals, once in a process.
pub fn listen(program: &'static str) -> anyhow::Result<()> {
    let listens = LISTENS.get_or_init(|| {
        ctrlc::set_handler(move || {
            FIRST.get_or_init(Instant::now);
            ASKED.fetch_add(1, Ordering::Relaxed);
            if !WATCHED.load(Ordering::Relaxed) {
                output::discard();
                if std::io::stderr().is_terminal() {
                    // In place of the bar.
                    eprint!("\r\x1b[K");
                }
                print::say(program, "interrupted");
                std::process::exit(INTERRUPTED.into());
            }
        })
        .map_err(|error| error.to_string())
    });
    listens.clone().map_err(|error| anyhow!("ctrl-c cannot be listened to: {error}"))
}

/// Shows progress on a terminal's standard error and hears ctrl-c.
pub struct Watch {
    bar: ProgressBar,
    /// Candidates among what moves, if they were looked for.
    pub candidates: Option<Candidates>,
}

impl Watch {
    /// Begins to watch; shows nothing if `quiet` or if standard error is no terminal.
    pub fn new(quiet: bool) -> Self {
        WATCHED.store(true, Ordering::Relaxed);
        Self::without_end(quiet)
    }

    /// A watch over a command that has nothing to close: ctrl-c ends it at once, whatever it waits for.
    pub fn without_end(quiet: bool) -> Self {
        let target = if quiet || !std::io::stderr().is_terminal() {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr_with_hz(8)
        };
        Self { bar: ProgressBar::with_draw_target(None, target), candidates: None }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.finish();
        WATCHED.store(false, Ordering::Relaxed);
    }
}

impl Observer for Watch {
    fn stage(&mut self, stage: Stage, total: Option<u64>) {
        let form = match total {
            Some(_) => "{msg:>15} {wide_bar} {human_pos}/{human_len} frames  {per_sec}  {eta} left",
            None => "{msg:>15} {spinner} {human_pos} frames  {per_sec}  {elapsed}",
        };
        self.bar.reset();
        self.bar.set_position(0);
        match total {
            Some(total) => self.bar.set_length(total),
            None => self.bar.unset_length(),
        }
        if let Ok(style) = ProgressStyle::with_template(form) {
            self.bar.set_style(style);
        }
        self.bar.set_message(stage.as_str());
    }

    fn candidates(&mut self, found: Candidates) {
        self.candidates = Some(found);
    }

    fn progress(&mut self, done: u64) {
        self.bar.set_position(done);
    }

    fn interrupted(&mut self) -> bool {
        ASKED.load(Ordering::Relaxed) > 0
    }

    fn abandoned(&mut self) -> bool {
        ASKED.load(Ordering::Relaxed) > 1 || FIRST.get().is_some_and(|first| first.elapsed() >= PATIENCE)
    }
}
