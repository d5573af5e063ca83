//! Walks containers whose packets lie in pages: each page is found by itself, numbered, and may hold many packets or a part
//! of one.
//!
//! Owns: [`Paged`], [`Pages`].

use super::bytes::Bytes;
use super::{Fit, Walk};

/// A kind of page.
pub(super) trait Pages: Send {
    /// The end of the page at `at`, and how it and the pages before it fit together; `None` where there is no whole page.
    fn page(&mut self, file: &mut Bytes, at: u64) -> Option<(u64, Fit)>;

    /// The next place after `at` where a page may begin.
    fn find(&mut self, file: &mut Bytes, at: u64) -> u64;

    /// Whether what the last page holds is whole.
    fn is_whole(&self) -> bool {
        true
    }

    /// The place at which the pages end.
    fn end(&self, file: &Bytes) -> u64 {
        file.length()
    }
}

/// The walk through pages. The reader's packets have the place of the page in which they begin.
pub(super) struct Paged<P> {
    pages: P,
    at: u64,
    /// How the page before `at` fits.
    last: Fit,
}

impl<P: Pages> Paged<P> {
    /// The first page is at `at`.
    pub(super) fn new(pages: P, at: u64) -> Self {
        Self { pages, at, last: Fit::Whole }
    }

    fn step(&mut self, file: &mut Bytes) -> Fit {
        match self.pages.page(file, self.at) {
            Some((end, fit)) => {
                self.at = end;
                self.last = fit;
            }
            None => {
                self.at = self.pages.find(file, self.at);
                self.last = Fit::Broken;
            }
        }
        self.last
    }
}

impl<P: Pages> Walk for Paged<P> {
    fn reach(&mut self, file: &mut Bytes, to: u64) -> Fit {
        // Another packet of a page that is damaged may be damaged too.
        if to < self.at {
            return if self.last == Fit::Broken { Fit::Broken } else { Fit::Whole };
        }
        let mut fit = Fit::Whole;
        while self.at <= to && self.at < self.pages.end(file) {
            fit = fit.max(self.step(file));
        }
        fit
    }

    fn rest(&mut self, file: &mut Bytes) -> Fit {
        let mut fit = self.last;
        while self.at < self.pages.end(file) {
            fit = fit.max(self.step(file));
        }
        if self.pages.end(file) > file.length() || !self.pages.is_whole() { Fit::Broken } else { fit }
    }
}
