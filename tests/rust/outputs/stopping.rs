//! Threads that are begun, and signals while the rig is sought.

use super::*;

#[test]
fn more_threads_than_are_of_use_are_not_begun() {
    let folder = folder_with(&["film.mp4"]);
    let at = folder.path();
    done(at, &["track", "film.mp4", "-o", "few.parquet", "--quiet", "--threads", "2"]);
    for threads in ["5000", "100000", "18446744073709551615"] {
        let said =
            run(at, &["track", "film.mp4", "-o", "t.parquet", "--threads", threads, "--force", "--json"]);
        assert_eq!(said.status, 0, "{}", said.error);
        assert!(said.error.contains(&format!("{threads} threads were asked for")), "{}", said.error);
        assert!(fs::read(at.join("t.parquet")).unwrap() == fs::read(at.join("few.parquet")).unwrap());
    }
}

/// Points that wander over dark ground, each on a way of its own, as MRAW: nothing is rigid and much has to be tried.
fn clutter(at: &Path, points: u64, frames: u64) {
    let (w, h) = (640_u64, 480_u64);
    let head = format!(
        "#Camera Information Header\nRecord Rate(fps) : 1000\nTotal Frame : {frames}\nImage Width : {w}\nImage Height : {h}\nColor Type : Mono\nColor Bit : 8\nFile Format : MRaw\nEffectiveBit Depth : 8\nEffectiveBit Side : Lower\n"
    );
    fs::write(at.join("clutter.cih"), head).unwrap();
    let mut file = std::io::BufWriter::new(fs::File::create(at.join("clutter.mraw")).unwrap());
    let mut frame = vec![10_u8; (w * h) as usize];
    for t in 0..frames {
        frame.fill(10);
        for p in 0..points {
            // Each to and fro with its own periods.
            let way = |size: u64, k: u64| {
                let phase = (t * (3 + (p * 7 + k * 5) % 11) + p * 37 * (k + 1)) % (2 * (size - 12));
                6 + if phase < size - 12 { phase } else { 2 * (size - 12) - phase }
            };
            let (x, y) = (way(w, 0), way(h, 1));
            for dy in 0..5 {
                for dx in 0..5 {
                    frame[((y + dy - 2) * w + x + dx - 2) as usize] = 200;
                }
            }
        }
        file.write_all(&frame).unwrap();
    }
    file.flush().unwrap();
}

#[test]
fn a_signal_is_heard_while_the_rig_is_sought() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    clutter(at, 100, 300);
    for (command, name) in [
        (&["track", "clutter.mraw", "-o", "t.parquet"][..], "-TERM"),
        (&["track", "clutter.mraw", "-o", "u.parquet"], "-INT"),
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_tracker"))
            .args(command)
            .arg("--quiet")
            .current_dir(at)
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Once all detections are on disk the rig is sought.
        let state = at.join(command[3]).with_extension("parquet.partial");
        let length = || fs::metadata(&state).map_or(0, |m| m.len());
        let (begun, mut known) = (Instant::now(), 0);
        while known < 100_000 || known != length() {
            assert!(begun.elapsed() < Duration::from_secs(60) && child.try_wait().unwrap().is_none());
            known = length();
            std::thread::sleep(Duration::from_millis(300));
        }
        let asked = Instant::now();
        assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
        let status = child.wait().unwrap();
        assert_eq!(status.code(), Some(130), "{command:?}");
        // A second, and as much again for a machine that does other things too.
        assert!(asked.elapsed() < Duration::from_secs(2), "{command:?}: {:?}", asked.elapsed());
    }
    // What was detected is kept where it can be gone on with, and nothing else is left.
    assert_eq!(names_in(at), ["clutter.cih", "clutter.mraw", "t.parquet.partial", "u.parquet.partial"]);
}

#[test]
fn a_signal_is_heard_while_a_film_is_encoded() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for name in ["-TERM", "-INT"] {
        // x264's slowest ways take it a good part of a second for each picture, of which it holds sixty.
        let mut child = Command::new(env!("CARGO_BIN_EXE_tracker"))
            .args(["film", "--preset", "noisy", "--frame-count", "3000", "--x264-preset", "veryslow", "-q"])
            .args(["-o", "film.mp4", "--truth", "truth.csv", "--rig", "rig.toml"])
            .current_dir(at)
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begun = Instant::now();
        let is_encoding =
            || fs::read_dir(at).unwrap().any(|e| e.unwrap().metadata().is_ok_and(|m| m.len() > 10_000));
        while !is_encoding() {
            assert!(begun.elapsed() < Duration::from_secs(120) && child.try_wait().unwrap().is_none());
            std::thread::sleep(Duration::from_millis(50));
        }
        let asked = Instant::now();
        assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
        assert_eq!(child.wait().unwrap().code(), Some(130), "{name}");
        // A second, and as much again for a machine that does other things too.
        assert!(asked.elapsed() < Duration::from_secs(2), "{name}: {:?}", asked.elapsed());
        assert!(names_in(at).is_empty(), "{name}: {:?}", names_in(at));
    }
}
