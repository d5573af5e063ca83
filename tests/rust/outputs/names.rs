//! Names of files that are written: whatever they look like, they are names of files.

use super::*;

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
            &["film", "--preset", "clean", "--frame-count", "2", "-q", "-o"]
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
    let film = ["film", "--preset", "clean", "--frame-count", "2", "-q", "-o"];
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
