//! Reading recordings: files made by the `ffmpeg` program from known pictures, and real ones.
#![allow(clippy::unwrap_used, clippy::panic)]

mod film;

mod aspect;
mod cine;
mod codecs;
mod coded_damage;
mod cut;
mod cut_out;
mod damage;
mod edits;
mod ffmpeg;
mod fields;
mod formats;
mod gaps;
mod images;
mod info;
mod lies;
mod mraw;
mod mutants;
mod norpix;
mod noticed;
mod ome;
mod opencv;
mod orientation;
mod pictures;
mod pixels;
mod program;
mod tiffs;
mod times;
