//! Arguments and files that make no sense are refused with what to do.

use super::*;

#[test]
fn what_makes_no_sense_is_refused_with_what_to_do() {
    let case = Case::new();
    let input = film("film.mp4");
    let out = case.text("t.csv");
    fs::write(case.path("text.mp4"), "not a film at all\n".repeat(50)).unwrap();
    fs::write(case.path("bad.toml"), "schema = 1\nimage_px = [720, 720]\nnode = 3\n").unwrap();
    let rig = fs::read_to_string(films().join("rig.toml")).unwrap();
    let named = rig.replacen("body = \"upper\"", "body = \"third\"", 1);
    fs::write(case.path("unknown.toml"), named).unwrap();
    fs::write(case.path("small.toml"), "schema = 1\nimage_px = [64, 48]\n[[body]]\nname = \"b\"\n[[node]]\nname = \"n0\"\nbody = \"b\"\nx_px = 1.0\ny_px = 1.0\n").unwrap();
    let (none, text) = (case.text("none.mp4"), case.text("text.mp4"));
    let (bad, unknown, small) = (case.text("bad.toml"), case.text("unknown.toml"), case.text("small.toml"));
    let nowhere = case.text("nowhere/t.csv");
    // No file can be made in /proc, not even by root.
    let closed = "/proc/t.csv".to_owned();
    for (arguments, expected) in [
        (vec![none.as_str(), "-o", &out], "no such file"),
        (vec![text.as_str(), "-o", &out], "text.mp4: text, not a recording"),
        (vec![&input, "-o", "t.xlsx"], "unknown extension, expected .parquet or .csv"),
        (vec![&input, "-o", &nowhere], "nowhere/t.csv"),
        (vec![&input, "-o", &closed], "/proc/t.csv"),
        (vec![&input, "-o", &out, "--rig", &none], "none.mp4: the rig file cannot be read"),
        (vec![&input, "-o", &out, "--rig", &bad], "bad.toml, line"),
        (vec![&input, "-o", &out, "--rig", &unknown], "its body \"third\" is not in the rig"),
        (
            vec![&input, "-o", &out, "--rig", &small],
            "it is for images of 64 x 48 px, the recording has 720 x 720",
        ),
        (vec![&input, "-o", &out, "--frames", "9..3"], "9..3 holds no frame"),
        (vec![&input, "-o", &out, "--frames", "9000..9001"], "it ends before frame 9000"),
        (vec![&input, "-o", &out, "--frames", "x"], "expected A..B"),
        (vec![&input, "-o", &out, "--threshold", "dim"], "expected auto or a number"),
        (vec![&input, "-o", &out, "--fps=-3"], "fps"),
        (vec!["-", "-o", &out, "--resume"], "standard input cannot be read again"),
        (vec![&input], "--output"),
    ] {
        let mut all = vec!["track"];
        all.extend(arguments);
        let (status, stdout, error) = said(&all);
        assert_eq!(status, 2, "{all:?}: {error}");
        assert!(error.contains(expected), "{all:?}: {error}");
        assert!(stdout.is_empty() && !error.contains("panicked"), "{error}");
    }
    let (status, _, _) = said(&["track", &input, "-o", &out, "--frames", "3..40", "--quiet"]);
    assert!(status == 0 || status == 1);
    let table = read_table(&case.path("t.csv")).unwrap();
    assert_eq!((table.rows.frame[0], table.frames()), (3, 37));
}

#[test]
fn numbers_that_an_option_cannot_have_are_refused_in_plain_words() {
    let (whole, number) = ("expected a whole number of 0 or more", "expected a number");
    for (arguments, option, expected) in [
        (&["track", "x", "-o", "y.csv", "--threads", "-1"][..], "--threads", whole),
        (&["track", "x", "-o", "y.csv", "--threads=-1"], "--threads", whole),
        (&["setup", "x", "-o", "y.toml", "--threads", "1.5"], "--threads", whole),
        (&["overlay", "x", "y", "-o", "z.mp4", "--every", "x"], "--every", whole),
        (&["overlay", "x", "y", "-o", "z.mp4", "--width", "-4"], "--width", "-4 is not in 0.."),
        (&["film", "--preset", "clean", "-o", "y.mp4", "--frame-count", "-3"], "--frame-count", whole),
        (
            &["film", "--preset", "clean", "-o", "y.mp4", "--seed", "99999999999999999999"],
            "--seed",
            "too large",
        ),
        (&["film", "--preset", "clean", "-o", "y.mp4", "--fps", "fast"], "--fps", number),
        (&["track", "x", "-o", "y.csv", "--fps", "1e"], "--fps", number),
        (
            &["film", "--preset", "clean", "-o", "y.mp4", "--x264-preset", "warp"],
            "--x264-preset",
            "is not known",
        ),
    ] {
        let (status, stdout, error) = said(arguments);
        assert_eq!(status, 2, "{arguments:?}: {error}");
        assert!(error.contains(option) && error.contains(expected), "{arguments:?}: {error}");
        assert!(stdout.is_empty() && error.trim_end().lines().count() == 1, "{error}");
    }
    let (status, _, error) = said(&["track", &film("film.mp4"), "-o", "/tmp/none/y.csv", "--fps", "-5"]);
    assert_eq!(status, 2);
    assert!(error.contains("-5 is not a rate") || error.contains("fps"), "{error}");
}
