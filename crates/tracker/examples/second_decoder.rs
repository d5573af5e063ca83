//! The program `tracker` with the second decoder, OpenCV's, to check the first against: `--decoder opencv`.
//!
//! `cargo run --release --workspace --locked --example second_decoder -- track film.mp4 --decoder opencv -o nodes.parquet`

use std::env::args_os;
use std::process::ExitCode;

fn main() -> ExitCode {
    tracker::source::use_opencv_decoder();
    ExitCode::from(tracker::cli::run(args_os().skip(1), "tracker"))
}
