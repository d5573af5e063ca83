//! What is read is never replaced, and what is there only if asked.

use super::*;

#[test]
fn pictures_of_a_longer_film_are_not_taken_for_this_ones() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let film = |frames: &str, output: &str| {
        ["film", "--preset", "clean", "-q", "--force", "--frame-count", frames, "-o", output]
            .map(str::to_owned)
    };
    // Other names, other endings, folders and links that lead nowhere are read by nobody as frames of this film.
    fs::create_dir_all(at.join("frm/050.png")).unwrap();
    for name in ["frm/cover.png", "frm/7.tif", "frm/a007.png", "frm/007b.png"] {
        fs::write(at.join(name), b"mine").unwrap();
    }
    symlink("nowhere", at.join("frm/060.png")).unwrap();
    fs::write(at.join("precious"), b"precious").unwrap();
    done(at, &film("6", "frm/%03d.png"));
    done(at, &film("6", "frm/%03d.png"));
    let before = names_in(&at.join("frm"));
    let first = fs::read(at.join("frm/000.png")).unwrap();
    // Fewer frames; other digits, which read as the same numbers; one number far off; a link to a file.
    let said = "frames (003.png, 004.png, 005.png). Remove them, or choose a new folder";
    refused(
        at,
        &film("3", "frm/%03d.png"),
        &format!("3 pictures there are not this film's and would be taken for its {said}"),
    );
    refused(at, &film("6", "frm/%d.png"), "6 pictures there are not this film's");
    refused(at, &film("6", "frm/%04d.png"), "6 pictures there are not this film's");
    assert_eq!(names_in(&at.join("frm")), before);
    for (made, name) in [("frm/99999.png", "99999.png"), ("frm/070.png", "070.png")] {
        match name {
            "070.png" => symlink("../precious", at.join(made)).unwrap(),
            _ => fs::write(at.join(made), b"mine").unwrap(),
        }
        let rig = ["--rig".to_owned(), "rig.toml".to_owned()];
        refused(
            at,
            &[&film("6", "frm/%03d.png")[..], &rig].concat(),
            &format!("1 pictures there are not this film's and would be taken for its frames ({name})"),
        );
        assert!(fs::symlink_metadata(at.join(made)).is_ok() && !at.join("rig.toml").exists());
        fs::remove_file(at.join(made)).unwrap();
    }
    assert_eq!(fs::read(at.join("precious")).unwrap(), b"precious");
    assert!(fs::read(at.join("frm/000.png")).unwrap() == first);
    for n in 3..6 {
        fs::remove_file(at.join(format!("frm/00{n}.png"))).unwrap();
    }
    done(at, &film("3", "frm/%03d.png"));
    // Where the pattern names the only number in a name, other numbers belong to other films.
    done(at, &film("3", "frm/one_%d.png"));
    done(at, &film("2", "frm/two_%d.png"));
    let info = run(at, &["info", "frm/%03d.png", "--fps", "1000", "--json"]);
    let facts: serde_json::Value = serde_json::from_str(&info.out).unwrap();
    assert_eq!(facts["frames"], 3, "{}", info.out);
}

#[test]
fn what_is_read_is_never_replaced() {
    let folder = folder_with(&["film.mp4", "film.mraw", "film.cih", "rig.toml"]);
    let at = folder.path();
    done(at, &["film", "--preset", "clean", "--print-scene", "-o", "one.tif", "--frame-count", "2", "-q"]);
    fs::write(
        at.join("scene.toml"),
        run(at, &["film", "--preset", "clean", "--print-scene", "--frame-count", "2"]).out,
    )
    .unwrap();
    fs::create_dir(at.join("pictures")).unwrap();
    done(at, &["film", "--preset", "clean", "--frame-count", "20", "-q", "-o", "pictures/%03d.png"]);
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
    let film = ["film", "--preset", "clean", "--frame-count", "20", "-q", "-o"];
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
