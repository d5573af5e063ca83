//! Follows what moves in a recording without markers, by `tracker::moving`, and writes a table of it:
//! `cargo run --release --example follow_moving -- FILM OUT.csv`. Prints how it was found and how sure that is.
//!
//! The table has the columns of a node table in CSV and no metadata beside it.

use std::fmt::Write;
use std::path::Path;

use tracker::moving::{Film, WorkFilm, follow};
use tracker::source::{OpenOptions, open};
use tracker::stop::Stop;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [film, table] = arguments.as_slice() else {
        return Err("give a film and the table to write, FILM OUT.csv".into());
    };
    let stop = Stop::default();
    let mut source = open(film, &OpenOptions { colour: true, ..OpenOptions::default() })?;
    let pictures = WorkFilm::read(source.as_mut(), 0..u64::MAX, &stop, &mut |_| {})?;
    let Some(followed) = follow(&pictures)? else {
        println!("{film}: nothing moves smoothly before a still ground");
        return Ok(());
    };
    let mut text = String::from("frame,time_s,node,body,x_px,y_px,sigma_px,area_px,status\n");
    let area = (pictures.shrink() * pictures.shrink()) as f64;
    let time_base = source.info().time_base;
    for (n, track) in followed.tracks.iter().enumerate() {
        for (picture, spot) in track.spots() {
            for &place in pictures.frames(picture) {
                let frame = pictures.stamps()[place].index;
                writeln!(
                    text,
                    "{frame},{:.9},n{n},body{},{:.4},{:.4},{:.4},{:.1},seen",
                    time_base.seconds(frame as i64),
                    n + 1,
                    pictures.recorded_px(spot.x),
                    pictures.recorded_px(spot.y),
                    track.sigma_px(spot) * pictures.shrink() as f64,
                    spot.area * area,
                )?;
            }
        }
    }
    std::fs::write(Path::new(table), text)?;
    println!(
        "{film}: {} things of one look in {} pictures ({} copies left out), {:.0} px across, {}; confidence {:.2}; {} others move",
        followed.tracks.len(),
        pictures.count(),
        pictures.copies(),
        2.0 * followed.radius_px * pictures.shrink() as f64,
        if followed.model.sign > 0.0 { "bright" } else { "dark" },
        followed.confidence,
        followed.others.len(),
    );
    Ok(())
}
