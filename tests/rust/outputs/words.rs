//! Texts out of files on a terminal and in cells of a CSV.

use super::*;

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
    let scene = run(at, &["film", "--preset", "clean", "--print-scene", "--frame-count", "20"]).out;
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
