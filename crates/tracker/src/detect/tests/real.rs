//! Real recordings of the shared folder, where it is there.

use std::path::PathBuf;

use super::*;
use crate::source::{OpenOptions, open};

fn shared(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if !path.exists() {
        eprintln!("skipped: {} is not here", path.display());
        return None;
    }
    Some(path)
}

/// Detections of every frame, without settings.
fn all(recording: &str) -> Option<Vec<Vec<Detection>>> {
    let path = shared(recording)?;
    let mut source = open(path.to_str()?, &OpenOptions::default()).unwrap();
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        frames.push(frame);
    }
    let settings = DetectSettings::default();
    let samples: Vec<Frame> = open(path.to_str()?, &OpenOptions::default()).unwrap().sample(12).unwrap();
    let levels = learn(&samples, &settings);
    Some(frames.iter().map(|frame| detect(frame, &levels, &settings)).collect())
}

#[test]
fn the_tossed_ball_is_where_a_person_clicked() {
    let Some(found) = all("balltoss/BallTossOut.mp4") else { return };
    let clicks = std::fs::read_to_string(shared("balltoss/human_clicks.csv").unwrap()).unwrap();
    let mut count = 0;
    for line in clicks.lines().skip(1) {
        let row: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        let off = found[2 * row[0] as usize + 6]
            .iter()
            .map(|d| (d.x_px - row[1]).hypot(d.y_px - row[2]))
            .fold(f64::INFINITY, f64::min);
        // What a person's clicks on the ball scatter.
        assert!(off < 2.3, "{line}: {off} px");
        count += 1;
    }
    assert_eq!(count, 11);
}

#[test]
fn the_falling_ball_falls_straight() {
    let Some(found) = all("photron/ball_12bit.cihx") else { return };
    // Of dark things the ball is the largest that is whole.
    let ball: Vec<Detection> = found
        .iter()
        .map(|f| {
            let whole = f.iter().filter(|d| !d.flags.has(Flags::BORDER));
            *whole.max_by(|a, b| a.area_px.total_cmp(&b.area_px)).unwrap()
        })
        .collect();
    assert_eq!(ball.len(), 15);
    let (n, middle) = (ball.len() as f64, (ball.len() - 1) as f64 / 2.0);
    for (axis, step) in
        [(|d: &Detection| d.x_px) as fn(&Detection) -> f64, |d| d.y_px].iter().zip([0.01, 2.647])
    {
        let mean = ball.iter().map(axis).sum::<f64>() / n;
        let (mut sxy, mut sxx) = (0.0, 0.0);
        for (i, d) in ball.iter().enumerate() {
            sxy += (i as f64 - middle) * (axis(d) - mean);
            sxx += (i as f64 - middle).powi(2);
        }
        let slope = sxy / sxx;
        let squares: f64 = ball
            .iter()
            .enumerate()
            .map(|(i, d)| (axis(d) - mean - slope * (i as f64 - middle)).powi(2))
            .sum();
        // It falls: the speed grows by 0.003 px a frame over the recording.
        assert!((slope - step).abs() < 0.005, "{slope} px per frame");
        assert!((squares / (n - 2.0)).sqrt() < 0.03, "{}", (squares / (n - 2.0)).sqrt());
    }
}
