//! What is read is never replaced, and what is there only if asked.

use super::*;

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
