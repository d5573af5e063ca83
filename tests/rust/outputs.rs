//! What the real binary writes, and where: names are names of files, nothing that is read or anybody's is replaced, a
//! run goes on with its own recording only, and nothing out of a file reaches a terminal.

#![allow(clippy::unwrap_used, clippy::panic)] // a test may fail by panicking

use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::Write;
use std::net::TcpListener;
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use tracker::table::read_table;

struct Said {
    status: i32,
    out: String,
    error: String,
}

/// A run of the program in a folder.
fn run<A: AsRef<OsStr>>(folder: &Path, arguments: &[A]) -> Said {
    let out = Command::new(env!("CARGO_BIN_EXE_tracker"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Said { status: out.status.code().unwrap_or(-1), out: text(&out.stdout), error: text(&out.stderr) }
}

fn refused<A: AsRef<OsStr> + std::fmt::Debug>(folder: &Path, arguments: &[A], expected: &str) {
    let said = run(folder, arguments);
    assert_eq!(said.status, 2, "{arguments:?}: {}", said.error);
    assert!(said.error.contains(expected), "{arguments:?}: {}", said.error);
    assert_eq!(said.error.trim_end().lines().count(), 1, "{}", said.error);
}

fn done<A: AsRef<OsStr> + std::fmt::Debug>(folder: &Path, arguments: &[A]) {
    let said = run(folder, arguments);
    assert_eq!(said.status, 0, "{arguments:?}: {}", said.error);
}

/// A folder with `film.mp4`, `film.mraw` of the same scene and a `rig.toml`, made once.
fn films() -> &'static Path {
    static FILMS: OnceLock<tempfile::TempDir> = OnceLock::new();
    FILMS
        .get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let scene = ["film", "--preset", "clean", "--frames", "20", "-q"];
            let more: [&[&str]; 2] =
                [&["-o", "film.mp4", "--speed", "ultrafast", "--rig", "rig.toml"], &["-o", "film.mraw"]];
            for more in more {
                done(folder.path(), &[&scene[..], more].concat());
            }
            folder
        })
        .path()
}

/// A folder with copies of some of them.
fn folder_with(names: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in names {
        fs::copy(films().join(name), folder.path().join(name)).unwrap();
    }
    folder
}

fn names_in(folder: &Path) -> Vec<OsString> {
    let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    names
}

/// Names that some library would take for something else, without an ending.
fn odd_names() -> Vec<OsString> {
    let mut names: Vec<OsString> = [
        "12:30 x",
        "tee:a|b",
        "s3:x",
        "C:\\x",
        "%d",
        "./-x",
        "x y",
        "#",
        "?",
        "a*b",
        "new\nline",
        "😀",
        "\x1b[31mred",
    ]
    .map(OsString::from)
    .into();
    names.push(OsString::from_vec(b"f\xf6r\xff".to_vec()));
    names.push(OsString::from_vec([&[b'n'; 246][..], b""].concat()));
    names
}

fn with(name: &OsStr, ending: &str) -> OsString {
    let mut name = name.to_owned();
    name.push(ending);
    name
}

#[test]
fn a_name_is_a_file_whatever_it_looks_like() {
    let rig = films().join("rig.toml").into_os_string();
    for name in odd_names() {
        let folder = folder_with(&[]);
        let at = folder.path();
        let (film, table, csv) = (with(&name, ".mp4"), with(&name, ".parquet"), with(&name, ".csv"));
        fs::copy(films().join("film.mp4"), at.join(&film)).unwrap();
        let word = OsString::from;
        done(at, &[word("info"), film.clone()]);
        let track = [word("track"), film.clone(), word("--rig"), rig.clone(), word("--quiet"), word("-o")];
        done(at, &[&track[..], std::slice::from_ref(&table)].concat());
        done(at, &[word("check"), table.clone()]);
        assert_eq!(read_table(&at.join(&table)).unwrap().frames(), 20);
        done(at, &[&track[..], std::slice::from_ref(&csv)].concat());
        let (seen, made) = (with(&name, ".mkv"), with(&name, ".avi"));
        done(
            at,
            &[
                word("overlay"),
                film.clone(),
                table.clone(),
                word("--every"),
                word("20"),
                word("-o"),
                seen.clone(),
            ],
        );
        done(
            at,
            &["film", "--preset", "clean", "--frames", "2", "-q", "-o"]
                .map(word)
                .into_iter()
                .chain([made.clone()])
                .collect::<Vec<_>>(),
        );
        let mut expected: Vec<OsString> = [film, table, with(&csv, ".json"), csv, seen, made]
            .iter()
            .map(|n| Path::new(n).file_name().unwrap().to_owned())
            .collect();
        expected.sort();
        assert_eq!(names_in(at), expected);
    }
}

#[test]
fn no_address_is_written_to() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let port = listener.local_addr().unwrap().port();
    let folder = folder_with(&["film.mp4"]);
    let address = format!("http://127.0.0.1:{port}/x.mp4");
    let film = ["film", "--preset", "clean", "--frames", "2", "-q", "-o"];
    refused(folder.path(), &[&film[..], &[&address]].concat(), "it cannot be written");
    // With the folders of that name it is a file like any other.
    fs::create_dir_all(folder.path().join(format!("http:/127.0.0.1:{port}"))).unwrap();
    done(folder.path(), &[&film[..], &[&address]].concat());
    assert!(folder.path().join(&address).is_file());
    assert!(listener.accept().is_err(), "something connected");
    // Containers that write files of their own are no films.
    for name in ["a.m3u8", "a.mpd", "a.png", "a"] {
        let arguments = ["overlay", "film.mp4", "t.parquet", "-o", name];
        done(folder.path(), &["track", "film.mp4", "-o", "t.parquet", "--quiet", "--force"]);
        refused(folder.path(), &arguments, "no film is written to a file that ends in");
    }
}

#[test]
fn what_is_read_is_never_replaced() {
    let folder = folder_with(&["film.mp4", "film.mraw", "film.cih", "rig.toml"]);
    let at = folder.path();
    done(at, &["film", "--preset", "clean", "--print-scene", "-o", "one.tif", "--frames", "2", "-q"]);
    fs::write(
        at.join("scene.toml"),
        run(at, &["film", "--preset", "clean", "--print-scene", "--frames", "2"]).out,
    )
    .unwrap();
    fs::create_dir(at.join("pictures")).unwrap();
    done(at, &["film", "--preset", "clean", "--frames", "20", "-q", "-o", "pictures/%03d.png"]);
    done(at, &["track", "film.mp4", "-o", "t.parquet", "--quiet"]);
    // Of everything that is read a hard and a symbolic link, with endings that the outputs may have.
    for (of, link) in [
        ("film.mp4", "hard.parquet"),
        ("film.mp4", "hard.mp4"),
        ("film.mp4", "hard.png"),
        ("rig.toml", "hard.csv"),
        ("film.mraw", "pixels.parquet"),
        ("film.cih", "facts.csv"),
        ("pictures/007.png", "seventh.parquet"),
        ("t.parquet", "table.mp4"),
        ("scene.toml", "scene.mp4"),
    ] {
        fs::hard_link(at.join(of), at.join(link)).unwrap();
        symlink(of, at.join(format!("soft_{link}"))).unwrap();
    }
    let before: Vec<(PathBuf, Vec<u8>)> =
        ["film.mp4", "film.mraw", "film.cih", "rig.toml", "t.parquet", "scene.toml", "pictures/007.png"]
            .into_iter()
            .map(|n| (at.join(n), fs::read(at.join(n)).unwrap()))
            .collect();
    for prefix in ["", "soft_"] {
        let name = |n: &str| format!("{prefix}{n}");
        for arguments in [
            vec!["track", "film.mp4", "-o", &name("hard.parquet")],
            vec!["track", "film.mp4", "--rig", "rig.toml", "-o", &name("hard.csv")],
            vec!["track", "film.cih", "-o", &name("pixels.parquet")],
            vec!["track", "film.mraw", "-o", &name("facts.csv")],
            vec!["track", "pictures", "-o", &name("seventh.parquet")],
            vec!["track", "pictures/%03d.png", "-o", &name("seventh.parquet")],
            vec!["overlay", "film.mp4", "t.parquet", "-o", &name("hard.mp4")],
            vec!["overlay", "film.mp4", "t.parquet", "-o", &name("table.mp4")],
            vec!["film", "scene.toml", "-o", &name("scene.mp4")],
            vec!["film", "scene.toml", "-o", "new.mp4", "--rig", &name("scene.mp4")],
            vec!["setup", "film.mp4", "-o", &name("hard.mp4")],
            vec!["setup", "film.mp4", "-o", "new.toml", "--picture", &name("hard.png")],
        ] {
            refused(at, &[&arguments[..], &["--force"]].concat(), "destroy");
        }
    }
    refused(
        at,
        &["overlay", "film.mp4", "t.parquet", "-o", "film.mp4", "--force"],
        "it is read, and writing it",
    );
    refused(at, &["film", "scene.toml", "-o", "new.mp4", "--truth", "scene.toml", "--force"], "destroy");
    refused(at, &["film", "scene.toml", "-o", "new.mp4", "--rig", "./new.mp4"], "two outputs have this name");
    refused(at, &["setup", "film.mp4", "-o", "new.png"], "two outputs have this name");
    for (path, bytes) in before {
        assert!(fs::read(&path).unwrap() == bytes, "{} was changed", path.display());
    }
    assert!(!at.join("new.mp4").exists() && !at.join("new.toml").exists());
}

#[test]
fn what_is_there_is_replaced_only_if_asked() {
    let folder = folder_with(&["film.mp4"]);
    let at = folder.path();
    let kept = ["a.mp4", "a.mraw", "a.cih", "p.00001.png", "a.csv", "a.csv.json", "a.toml", "a.png", "a.y4m"];
    let fill = || kept.iter().for_each(|n| fs::write(at.join(n), "mine").unwrap());
    fill();
    symlink("nowhere", at.join("broken.mkv")).unwrap();
    let film = ["film", "--preset", "clean", "--frames", "20", "-q", "-o"];
    let cases: Vec<Vec<&str>> = vec![
        [&film[..], &["a.mp4"]].concat(),
        [&film[..], &["a.mraw"]].concat(),
        [&film[..], &["a.cih"]].concat(),
        [&film[..], &["p.%05d.png"]].concat(),
        [&film[..], &["a.y4m"]].concat(),
        [&film[..], &["broken.mkv"]].concat(),
        [&film[..], &["new.mp4", "--truth", "a.csv"]].concat(),
        [&film[..], &["new.mp4", "--rig", "a.toml"]].concat(),
        vec!["track", "film.mp4", "-o", "a.csv"],
        vec!["setup", "film.mp4", "-o", "a.toml", "--picture", "new.png"],
        vec!["setup", "film.mp4", "-o", "new.toml", "--picture", "a.png"],
    ];
    for arguments in &cases {
        refused(at, arguments, "it is there already");
    }
    // The metadata beside a CSV is somebody's too.
    fs::remove_file(at.join("a.csv")).unwrap();
    refused(at, &["track", "film.mp4", "-o", "a.csv"], "a.csv.json: it is there already");
    fill();
    for name in kept {
        assert_eq!(fs::read(at.join(name)).unwrap(), b"mine", "{name}");
    }
    assert!(!at.join("nowhere").exists() && !at.join("new.mp4").exists() && !at.join("new.toml").exists());
    for arguments in &cases {
        done(at, &[&arguments[..], &["--force"]].concat());
    }
    // A link is replaced and not written through.
    assert!(!at.join("nowhere").exists() && at.join("broken.mkv").symlink_metadata().unwrap().is_file());
}

#[test]
fn a_state_is_kept_in_no_file_but_a_runs_own() {
    let folder = folder_with(&["film.mp4"]);
    let at = folder.path();
    fs::write(at.join("precious"), "precious").unwrap();
    let state = at.join("t.parquet.partial");
    let track = ["track", "film.mp4", "-o", "t.parquet", "--quiet"];
    let writing = at.join("t.parquet.writing");
    symlink("precious", &writing).unwrap();
    for make in [
        &(|| symlink("precious", &state).unwrap()) as &dyn Fn(),
        &|| symlink("nowhere", &state).unwrap(),
        &|| fs::write(&state, "my own notes").unwrap(),
        &|| fs::create_dir(&state).unwrap(),
    ] {
        make();
        for more in [&[][..], &["--force"], &["--resume"]] {
            refused(at, &[&track[..], more].concat(), "no run has left");
        }
        let facts = state.symlink_metadata().unwrap();
        if facts.is_file() {
            assert_eq!(fs::read(&state).unwrap(), b"my own notes");
        }
        if facts.is_dir() { fs::remove_dir(&state).unwrap() } else { fs::remove_file(&state).unwrap() }
    }
    done(at, &track);
    assert_eq!(fs::read(at.join("precious")).unwrap(), b"precious");
    assert!(writing.is_symlink() && !at.join("nowhere").exists());
    assert_eq!(names_in(at), ["film.mp4", "precious", "t.parquet", "t.parquet.writing"]);
}

/// A run that the disk stops after so many blocks of 512 bytes: its state is left.
fn begin(at: &Path, input: &str, blocks: u32) {
    let limited =
        format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" track '{input}' -o t.parquet --quiet --force");
    let shell =
        Command::new("sh").args(["-c", &limited, env!("CARGO_BIN_EXE_tracker")]).current_dir(at).output();
    assert_eq!(shell.unwrap().status.code(), Some(2));
    assert!(at.join("t.parquet.partial").exists());
}

/// What is changed in a recording.
type Change<'a> = (&'a str, &'a dyn Fn(&Path));

/// Changes the middle of a file by one byte; its times are then another.
fn middle(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let at = bytes.len() / 2;
    bytes[at] ^= 0x55;
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_run_goes_on_with_its_own_recording_only() {
    let pixels = |at: &Path| middle(&at.join("film.mraw"));
    let older = |at: &Path| {
        // Another film with the same length, ends and, since it is older, a time before the table's.
        let (now, then) = (at.join("film.mraw"), at.join("other"));
        fs::copy(&now, &then).unwrap();
        middle(&then);
        let file = fs::File::options().write(true).open(&then).unwrap();
        file.set_modified(
            fs::metadata(at.join("film.cih")).unwrap().modified().unwrap() - Duration::from_secs(99),
        )
        .unwrap();
        fs::rename(then, now).unwrap();
    };
    let picture = |at: &Path| middle(&at.join("pictures/011.png"));
    let removed = |at: &Path| fs::remove_file(at.join("pictures/019.png")).unwrap();
    let renamed = |at: &Path| fs::rename(at.join("pictures/019.png"), at.join("pictures/020.png")).unwrap();
    let first = |at: &Path| middle(&at.join("film.mp4"));
    let changes: [Change<'_>; 6] = [
        ("film.cih", &pixels),
        ("film.cih", &older),
        ("film.mp4", &first),
        ("pictures", &picture),
        ("pictures", &removed),
        ("pictures", &renamed),
    ];
    // Stopped before the table is there, and whole.
    for (blocks, whole) in [(16, false), (8, true)] {
        for (input, change) in changes {
            let folder = folder_with(&["film.mp4", "film.mraw", "film.cih"]);
            let at = folder.path();
            fs::create_dir(at.join("pictures")).unwrap();
            done(at, &["film", "--preset", "clean", "--frames", "20", "-q", "-o", "pictures/%03d.png"]);
            let resume = ["track", input, "-o", "t.parquet", "--quiet", "--resume"];
            begin(at, input, blocks);
            if whole {
                done(at, &resume);
                // Again with nothing changed.
                done(at, &resume);
            }
            let before = fs::read(at.join("t.parquet")).ok();
            // File systems count times in steps of some ms.
            std::thread::sleep(Duration::from_millis(20));
            change(at);
            let said = run(at, &resume);
            assert_eq!(said.status, 2, "{input}, whole {whole}: {}", said.error);
            assert!(said.error.contains("--force"), "{}", said.error);
            assert!(fs::read(at.join("t.parquet")).ok() == before, "{input}");
        }
    }
}

#[test]
fn what_comes_once_leaves_nothing_to_go_on_with() {
    let folder = folder_with(&["film.mp4"]);
    let at = folder.path();
    let pipe = at.join("pipe.y4m");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    refused(
        at,
        &["track", "pipe.y4m", "-o", "t.csv", "--resume"],
        "a pipe or an address cannot be read again",
    );
    let write = Command::new(env!("CARGO_BIN_EXE_tracker"))
        .args(["film", "--preset", "clean", "--frames", "20", "-q", "-o", "pipe.y4m"])
        .current_dir(at)
        .spawn();
    done(at, &["track", "pipe.y4m", "-o", "t.csv", "--quiet"]);
    assert!(write.unwrap().wait().unwrap().success());
    assert_eq!(names_in(at), ["film.mp4", "pipe.y4m", "t.csv", "t.csv.json"]);
}

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
fn nothing_out_of_a_file_reaches_a_terminal() {
    let folder = folder_with(&["film.mp4", "film.mraw", "film.cih", "rig.toml"]);
    let at = folder.path();
    let bad = "a\u{1b}[31m\u{9b}2J\u{7f}\rb\u{202e}c";
    let film = format!("{bad}.mp4");
    fs::copy(at.join("film.mp4"), at.join(&film)).unwrap();
    let facts = fs::read_to_string(at.join("film.cih")).unwrap();
    fs::write(at.join("film.cih"), facts.replace("scene of", "\u{1b}[31mscene\u{7} of\u{9b}2J")).unwrap();
    let rig = fs::read_to_string(at.join("rig.toml")).unwrap();
    fs::write(at.join("bad.toml"), rig.replace("\"upper\"", "\"\\u001b[31mupper\\u009b2J\"")).unwrap();
    let table = format!("{bad}.csv");
    for (arguments, status) in [
        (vec!["info", &film], 0),
        (vec!["info", "film.mraw"], 0),
        (vec!["info", "film.mraw", "--json"], 0),
        (vec!["track", &film, "--rig", "bad.toml", "-o", &table], 0),
        (vec!["track", &film, "--rig", "bad.toml", "-o", &table], 2),
        (vec!["track", &film, "--rig", "bad.toml", "-o", &table, "--force", "--json"], 0),
        (vec!["check", &table], 0),
        (vec!["check", &table, "--json"], 0),
        (vec!["setup", &film, "-o", &format!("{bad}.toml")], 0),
        (vec!["score", &table, &film], 2),
        (vec!["overlay", "film.mp4", &table, "-o", &format!("{bad}.m3u8")], 2),
        (vec!["info", bad], 2),
        (vec!["track", "film.mp4", "--rig", bad, "-o", "x.csv"], 2),
        (vec!["film", bad, "-o", "x.mp4"], 2),
        (vec!["film", "--preset", bad], 2),
        (vec!["track", bad, bad, bad], 2),
        (vec![bad], 2),
        (vec!["--\u{1b}[31m"], 2),
    ] {
        let said = run(at, &arguments);
        assert_eq!(said.status, status, "{arguments:?}: {}", said.error);
        for text in [&said.out, &said.error] {
            let obeyed = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
            assert!(!text.contains(obeyed), "{arguments:?}: {text:?}");
        }
        if arguments.contains(&"--json") {
            serde_json::from_str::<serde_json::Value>(&said.out).unwrap();
        }
    }
}

#[test]
fn cells_that_a_spreadsheet_would_calculate_are_marked_when_asked() {
    let folder = folder_with(&["film.mp4", "rig.toml"]);
    let at = folder.path();
    let rig = fs::read_to_string(at.join("rig.toml")).unwrap();
    fs::write(at.join("bad.toml"), rig.replace("\"upper\"", "\"=1+1\"").replace("\"n8\"", "\"@SUM(A1)\""))
        .unwrap();
    let track = ["track", "film.mp4", "--rig", "bad.toml", "--quiet", "-o"];
    for (name, more, formulas) in [("plain.csv", &[][..], true), ("safe.csv", &["--safe-csv"], false)] {
        done(at, &[&track[..], &[name], more].concat());
        let text = fs::read_to_string(at.join(name)).unwrap();
        assert_eq!((text.contains(",=1+1,"), text.contains(",@SUM(A1),")), (formulas, formulas), "{name}");
        let table = read_table(&at.join(name)).unwrap();
        assert!(table.meta.rig.nodes.iter().any(|n| n.name == "@SUM(A1)" && n.body != n.name));
        assert!(table.meta.rig.bodies.iter().any(|b| b.name == "=1+1"));
    }
    let scene = run(at, &["film", "--preset", "clean", "--print-scene", "--frames", "20"]).out;
    fs::write(at.join("scene.toml"), scene.replace("\"n8\"", "\"=n,8\"")).unwrap();
    let film = ["film", "scene.toml", "-q", "-o", "made.mp4", "--truth", "truth.csv", "--force"];
    for (more, formulas) in [(&[][..], true), (&["--safe-csv"], false)] {
        done(at, &[&film[..], more].concat());
        let text = fs::read_to_string(at.join("truth.csv")).unwrap();
        assert_eq!(text.contains(",\"=n,8\","), formulas);
        let score = run(at, &["score", "safe.csv", "truth.csv", "--json"]);
        assert_eq!(score.status, 0, "{}", score.error);
        assert!(score.out.contains("\"=n,8\""), "{}", score.out);
    }
}
