//! What a stopped run leaves to go on from, and with what it goes on.

use super::*;

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
            done(at, &["film", "--preset", "clean", "--frame-count", "20", "-q", "-o", "pictures/%03d.png"]);
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
        .args(["film", "--preset", "clean", "--frame-count", "20", "-q", "-o", "pipe.y4m"])
        .current_dir(at)
        .spawn();
    done(at, &["track", "pipe.y4m", "-o", "t.csv", "--quiet"]);
    assert!(write.unwrap().wait().unwrap().success());
    assert_eq!(names_in(at), ["film.mp4", "pipe.y4m", "t.csv", "t.csv.json"]);
}
