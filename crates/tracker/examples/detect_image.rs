//! Detects the markers of one picture (PNG, TIFF, BMP, JPEG): `cargo run --release --example detect_image -- PICTURE`.
//! Prints a line for each: centre and its standard uncertainty, area, all in px.

use std::sync::Arc;

use tracker::detect::{DetectSettings, Detector, Levels};
use tracker::source::{OpenOptions, open};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Some(picture) = std::env::args().nth(1) else { return Err("give a picture".into()) };
    let mut source = open(&picture, &OpenOptions::default())?;
    let settings = DetectSettings { pixel_aspect: source.info().pixel_aspect, ..DetectSettings::default() };
    // What is bright or dark enough is learned from the picture itself; of a film, from frames spread over it.
    let levels = Levels::learn(&source.sample(1)?, &settings)?;
    let mut detector = Detector::new(Arc::new(levels), &settings)?;
    let mut markers = Vec::new();
    if let Some(frame) = source.next_frame()? {
        detector.detect(&frame, &mut markers)?;
    }
    println!("x_px,y_px,sigma_px,area_px");
    for m in &markers {
        println!("{:.3},{:.3},{:.4},{:.1}", m.x_px, m.y_px, m.sigma_px, m.area_px);
    }
    Ok(())
}
