//! A run as a person at a terminal sees it: a bar with rate and remaining time, and ctrl-c.
//!
//! Owns: [`Watch`]. The first ctrl-c (or a termination signal) stops the run and closes the table, the second leaves.

use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::Context;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tracker::pipeline::{Observer, Stage};

/// Shows progress on a terminal's standard error and hears ctrl-c.
pub struct Watch {
    bar: ProgressBar,
    asked: Arc<AtomicUsize>,
}

impl Watch {
    /// Begins to listen; shows nothing if `quiet` or if standard error is no terminal.
    pub fn new(quiet: bool) -> anyhow::Result<Self> {
        let asked = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&asked);
        ctrlc::set_handler(move || {
            count.fetch_add(1, Ordering::Relaxed);
        })
        .context("ctrl-c cannot be listened to")?;
        let target = if quiet || !std::io::stderr().is_terminal() {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr_with_hz(8)
        };
        Ok(Self { bar: ProgressBar::with_draw_target(None, target), asked })
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.finish();
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

    fn progress(&mut self, done: u64) {
        self.bar.set_position(done);
    }

    fn interrupted(&mut self) -> bool {
        self.asked.load(Ordering::Relaxed) > 0
    }

    fn abandoned(&mut self) -> bool {
        self.asked.load(Ordering::Relaxed) > 1
    }
}
