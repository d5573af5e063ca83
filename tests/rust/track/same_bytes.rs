//! The same bytes for any number of threads, from run to run, and after a run was killed.

use super::*;

#[test]
fn tables_are_the_same_for_any_number_of_threads_and_from_run_to_run() {
    let case = Case::new();
    for ending in ["parquet", "csv"] {
        let mut first = None;
        for (i, threads) in ["1", "2", "8", "2"].into_iter().enumerate() {
            let out = case.text(&format!("t{i}.{ending}"));
            let (status, _, error) =
                said(&["track", &film("film.mp4"), "-o", &out, "--threads", threads, "--quiet"]);
            assert_eq!(status, 0, "{error}");
            let bytes = fs::read(&out).unwrap();
            assert!(*first.get_or_insert_with(|| bytes.clone()) == bytes, "{threads} threads, {ending}");
        }
    }
    assert_eq!(fs::read(case.path("t0.csv.json")).unwrap(), fs::read(case.path("t2.csv.json")).unwrap());
    let table = read_table(&case.path("t0.parquet")).unwrap();
    assert_eq!((table.frames(), table.nodes()), (240, 9));
    assert!(read_table(&case.path("t0.csv")).unwrap().rows.same(&table.rows));
}

#[test]
fn a_killed_run_goes_on_to_the_same_bytes() {
    for name in ["film.mp4", "film.avi"] {
        let case = Case::new();
        let expected = whole(&case, &film(name), "whole.parquet");
        let out = case.text("killed.parquet");
        // Wherever the kill falls, before the state exists, in detection or in the table, the result is the same.
        for wait_ms in [5, 60, 150, 300] {
            let input = film(name);
            let mut child = start(&["track", &input, "-o", &out, "--resume", "--quiet"]);
            std::thread::sleep(Duration::from_millis(wait_ms));
            child.kill().unwrap();
            child.wait().unwrap();
            if !case.path("killed.parquet.partial").exists() {
                continue;
            }
            assert!(!case.path("killed.parquet").exists(), "a table was there before it was whole");
        }
        let (status, _, error) = said(&["track", &film(name), "-o", &out, "--resume", "--quiet"]);
        assert_eq!(status, 0, "{error}");
        assert!(fs::read(&out).unwrap() == expected, "{name}: other bytes after a kill");
        assert_eq!(case.files(), ["killed.parquet", "whole.parquet"], "something was left behind");
        let (status, _, _) = said(&["track", &film(name), "-o", &out, "--resume", "--quiet"]);
        assert_eq!(status, 0, "a finished run is not done again, and that is no error");
    }
}

#[test]
fn a_state_cut_anywhere_goes_on_to_the_same_bytes() {
    let case = Case::new();
    let expected = whole(&case, &film("film.mp4"), "whole.parquet");
    let out = case.text("cut.parquet");
    // A run whose disk is full while it writes the table leaves the state of a whole recording.
    let input = film("film.mp4");
    let limited = format!("trap '' XFSZ; ulimit -f 12; exec \"$0\" track '{input}' -o '{out}' --quiet");
    let full = Command::new("sh").args(["-c", &limited, env!("CARGO_BIN_EXE_tracker")]).output().unwrap();
    let error = String::from_utf8_lossy(&full.stderr).into_owned();
    assert_eq!(full.status.code(), Some(2), "{error}");
    assert!(error.contains("cut.parquet") && error.contains("cannot be written"), "{error}");
    let state = fs::read(case.path("cut.parquet.partial")).unwrap();
    assert!(!case.path("cut.parquet").exists());
    for part in [1.0, 0.7, 0.3] {
        let cut = (state.len() as f64 * part) as usize;
        fs::write(case.path("cut.parquet.partial"), &state[..cut]).unwrap();
        let (status, _, error) = said(&["track", &input, "-o", &out, "--resume", "--quiet"]);
        if status == 2 {
            // Cut within its header, it is refused and says what to do.
            assert!(error.contains("without --resume"), "{error}");
            assert!(cut < 4096, "{error}");
            continue;
        }
        assert_eq!(status, 0, "{error}");
        assert!(fs::read(&out).unwrap() == expected);
        fs::remove_file(&out).unwrap();
    }
}
