//! Formats are opened by name, and names are files.

use std::path::Path;
use std::process::{Command, Stdio};

use tracker::source::{OpenOptions, open};

use crate::film::{encode, have_ffmpeg, read_all};

fn problem(name: &str) -> String {
    open(name, &OpenOptions::default()).err().map_or_else(|| format!("{name} was opened"), |e| e.to_string())
}

fn ffmpeg(arguments: &[&str], to: &Path) {
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-y"]).args(arguments).arg(to).stdin(Stdio::null());
    assert!(command.status().unwrap().success(), "{arguments:?}");
}

#[test]
fn text_is_no_film_whatever_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let table: String = (0..20_000).map(|i| format!("{i},{}\n", i * 2)).collect();
    let latin = b"D\xe4mpfung und Reibung, in einer anderen Schrift\n".repeat(200);
    for (name, text, expected) in [
        ("notes.txt", b"just some words, and some more of them\n".to_vec(), "text, not a recording"),
        ("drop.mp4", b"just some words\n".to_vec(), "text, not a recording"),
        ("table.csv", table.into_bytes(), "text, not a recording"),
        ("latin.txt", latin, "text, not a recording"),
        ("art.ans", b"\x1b[31mred\x1b[0m plain\r\n".repeat(100), "text, not a recording"),
        ("a.nfo", b"+-----+\r\n| abc |\r\n+-----+\r\n".repeat(100), "text, not a recording"),
        (
            "a.srt",
            b"1\n00:00:01,000 --> 00:00:02,000\nHi\n\n".to_vec(),
            "text (SubRip subtitle), not a recording",
        ),
        (
            "a.vtt",
            b"WEBVTT\n\n00:01.000 --> 00:02.000\nHi\n".to_vec(),
            "text (WebVTT subtitle), not a recording",
        ),
        ("empty.mp4", Vec::new(), "the file is empty"),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let told = problem(path.to_str().unwrap());
        assert!(told.contains(expected), "{told}");
    }
}

#[test]
fn lists_of_files_are_refused_and_open_nothing() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let film = encode(folder.path(), "a.mp4", 5, &["-c:v", "libx264"]);
    let film = film.display();
    // A pipe that nobody writes to: whoever opens it waits for ever.
    let trap = folder.path().join("trap.ts");
    assert!(Command::new("mkfifo").arg(&trap).status().unwrap().success());
    let trap = trap.display();
    for (name, text) in [
        ("a.m3u8", format!("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{trap}\n#EXT-X-ENDLIST\n")),
        ("b.m3u", format!("#EXTM3U\n#EXTINF:1,\n{film}\n")),
        ("a.ffconcat", format!("ffconcat version 1.0\nfile '{trap}'\n")),
        ("drop.mp4", format!("ffconcat version 1.0\nfile {film}\n")),
        (
            "a.sdp",
            "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 5004 RTP/AVP 96\n".into(),
        ),
        (
            "a.mpd",
            format!(
                "<?xml version=\"1.0\"?>\n<MPD xmlns=\"urn:mpeg:dash:schema:mpd:2011\" type=\"static\" \
                 mediaPresentationDuration=\"PT1S\"><Period><AdaptationSet mimeType=\"video/mp4\"><Representation \
                 id=\"0\" bandwidth=\"1\"><BaseURL>{trap}</BaseURL></Representation></AdaptationSet></Period></MPD>"
            ),
        ),
        ("a.pls", format!("[playlist]\nFile1={film}\n")),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let told = problem(path.to_str().unwrap());
        assert!(told.contains("a list of other files, not a recording"), "{told}");
    }
}

#[test]
fn sound_is_no_film() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("a.jpg");
    ffmpeg(&["-f", "lavfi", "-i", "testsrc=s=64x48:d=0.04"], &picture);
    let tone = ["-f", "lavfi", "-i", "sine=d=0.2"];
    for (name, more, expected) in [
        ("a.wav", &[][..], "\"WAV / WAVE (Waveform Audio)\", which is not read"),
        ("a.flac", &[], "\"raw FLAC\", which is not read"),
        ("a.m4a", &[], "it holds no video stream"),
        ("a.mka", &[], "it holds no video stream"),
    ] {
        let path = folder.path().join(name);
        ffmpeg(&[&tone[..], more].concat(), &path);
        let told = problem(path.to_str().unwrap());
        assert!(told.contains(expected), "{told}");
    }
    let path = folder.path().join("cover.m4a");
    let cover = [
        "-i",
        picture.to_str().unwrap(),
        "-map",
        "0",
        "-map",
        "1",
        "-c:v",
        "mjpeg",
        "-disposition:v",
        "attached_pic",
    ];
    ffmpeg(&[&tone[..], &cover].concat(), &path);
    let told = problem(path.to_str().unwrap());
    assert!(told.contains("only sound with a cover picture"), "{told}");
}

#[test]
fn a_name_is_a_file_whatever_it_looks_like() {
    if !have_ffmpeg() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let film = encode(folder.path(), "a.mp4", 5, &["-c:v", "libx264"]);
    for name in [
        "12:30 drop.mp4",
        "http:a.mp4",
        "concat:a|b.mp4",
        "-x.mp4",
        "f%03d.mp4",
        "a*b.mp4",
        "tee:a.mp4",
        "a?b#c.mp4",
    ] {
        let path = folder.path().join(name);
        std::fs::copy(&film, &path).unwrap();
        // As a user in that folder would type it.
        let done = Command::new(env!("CARGO_BIN_EXE_tracker"))
            .args(["info", "--count", "--", name])
            .current_dir(folder.path())
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&[done.stdout, done.stderr].concat()).into_owned();
        assert!(done.status.success() && text.contains("5 frames"), "{name}: {text}");
        assert_eq!(read_all(&mut *open(path.to_str().unwrap(), &OpenOptions::default()).unwrap()).len(), 5);
    }
}

#[test]
fn a_name_without_a_file_says_so_or_that_it_is_an_address() {
    for name in ["no/such/file.mp4", "12:30 drop.mp4", "C:drop.mp4", "file:drop.mp4", "odd+scheme:drop.mp4"] {
        assert!(problem(name).contains("no such file"), "{}", problem(name));
    }
    for name in [
        "http://127.0.0.1:9/a.mp4",
        "rtsp://127.0.0.1/a",
        "concat:a.ts|b.ts",
        "tee:a.mp4",
        "pipe:0",
        "data:,x",
        "subfile,,start,0,end,9,,:a.mp4",
        "crypto:a.mp4",
    ] {
        assert!(problem(name).contains("allow_protocol"), "{}", problem(name));
    }
}
