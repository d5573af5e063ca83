//! A table is only replaced if asked, and gone on with as it was begun.

use super::*;

#[test]
fn an_output_is_only_replaced_if_asked() {
    let case = Case::new();
    fs::write(case.path("t.parquet"), "mine").unwrap();
    let out = case.text("t.parquet");
    let (status, _, error) = said(&["track", &film("film.mp4"), "-o", &out, "--quiet"]);
    assert_eq!(status, 2);
    assert!(error.contains("it is there already") && error.contains("--force"), "{error}");
    assert_eq!(fs::read(&out).unwrap(), b"mine");
    let (status, _, _) = said(&["track", &film("film.mp4"), "-o", &out, "--quiet", "--force"]);
    assert_eq!(status, 0);
    assert!(read_table(&case.path("t.parquet")).is_ok());
}

#[test]
fn a_run_goes_on_only_with_what_it_began_with() {
    let case = Case::new();
    let input = film("film.mp4");
    let out = case.text("t.parquet");
    let limited = format!("trap '' XFSZ; ulimit -f 12; exec \"$0\" track '{input}' -o '{out}' --quiet");
    Command::new("sh").args(["-c", &limited, env!("CARGO_BIN_EXE_tracker")]).output().unwrap();
    assert!(case.path("t.parquet.partial").exists());
    let refused = |more: &[&str], expected: &str| {
        let mut arguments = vec!["track", &input, "-o", &out, "--quiet"];
        arguments.extend(more);
        let (status, _, error) = said(&arguments);
        assert!(status == 2 && error.contains(expected), "{more:?}: {error}");
    };
    refused(&[], "an earlier run was stopped and can go on");
    refused(&["--resume", "--fps", "77"], "another");
    refused(&["--resume", "--threshold", "90"], "another detection settings");
    refused(&["--resume", "--frames", "0..9"], "another --frames");
    let other = film("film.avi");
    let another_film = || {
        let (status, _, error) = said(&["track", &other, "-o", &out, "--quiet", "--resume"]);
        assert!(status == 2 && error.contains("another recording"), "{error}");
    };
    another_film();
    assert_eq!(said(&["track", &input, "-o", &out, "--quiet", "--resume"]).0, 0);
    // The same of a table that is whole.
    let bytes = fs::read(&out).unwrap();
    assert_eq!(said(&["track", &input, "-o", &out, "--quiet", "--resume"]).0, 0);
    refused(&["--resume", "--fps", "77"], "another");
    refused(&["--resume", "--threshold", "90"], "complete and had another detection settings");
    refused(&["--resume", "--frames", "0..9"], "complete and had another --frames");
    let rig = case.text("rig.toml");
    fs::write(&rig, read_table(&case.path("t.parquet")).unwrap().meta.rig.to_toml().unwrap()).unwrap();
    refused(&["--resume", "--rig", &rig], "complete and had another rig");
    another_film();
    assert!(fs::read(&out).unwrap() == bytes);
}
