//! Reading recordings: files made by the `ffmpeg` program from known pictures, and real ones.
#![allow(clippy::unwrap_used, clippy::panic)]

mod film;

mod cine;
mod damage;
mod ffmpeg;
mod images;
mod info;
mod lies;
mod mraw;
mod opencv;
mod pixels;
mod program;
mod times;
