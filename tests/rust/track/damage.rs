//! Recordings that are cut or damaged.

use super::*;

#[test]
fn a_recording_cut_off_gives_all_that_is_good_and_status_1() {
    let case = Case::new();
    let bytes = fs::read(film("film.avi")).unwrap();
    fs::write(case.path("cut.avi"), &bytes[..bytes.len() * 2 / 3]).unwrap();
    let out = case.text("cut.csv");
    let (status, text, error) =
        said(&["track", &case.text("cut.avi"), "-o", &out, "--rig", &film("rig.toml"), "--json"]);
    assert_eq!(status, 1, "{error}");
    assert!(error.contains("ended early"), "{error}");
    let said: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(said["status"], 1);
    assert_eq!(said["ending"]["kind"], "early");
    let table = read_table(&case.path("cut.csv")).unwrap();
    assert!(table.frames() > 100 && table.frames() < 240, "{}", table.frames());
    assert!(matches!(table.meta.ending, RunEnding::Early { .. }));
    assert!(!case.path("cut.csv.partial").exists());
}

#[test]
fn frames_that_cannot_be_decoded_are_named_and_have_a_status_of_their_own() {
    let case = Case::new();
    let mut bytes = fs::read(film("film.mp4")).unwrap();
    // In the middle of the coded pictures: some cannot be decoded, and those that are predicted from them.
    let middle = bytes.len() / 2;
    bytes[middle..middle + 500].fill(0);
    let input = case.text("damaged.mp4");
    fs::write(&input, &bytes).unwrap();
    for name in ["o.parquet", "o.csv"] {
        let out = case.text(name);
        let (status, text, error) = said(&["track", &input, "-o", &out]);
        assert_eq!(status, 1, "{text}{error}");
        let line = error.lines().find(|l| l.contains(": damaged: frame")).unwrap();
        assert!(line.contains(" cannot be decoded") && line.contains(name), "{line}");
        let table = read_table(Path::new(&out)).unwrap();
        assert_eq!((table.frames(), &table.meta.ending), (240, &RunEnding::Damaged));
        let lost = &table.meta.damage.undecoded;
        assert!(lost.frames > 0 && lost.frames < 200, "{lost:?}");
        let within = |t: u64| lost.stretches.iter().any(|[a, b]| (*a..=*b).contains(&t));
        for (t, row) in table.rows.status.chunks_exact(table.nodes()).enumerate() {
            let undecoded = row.iter().filter(|s| **s == Status::Undecoded as u8).count();
            assert_eq!(undecoded, if within(t as u64) { table.nodes() } else { 0 }, "frame {t}");
        }
        assert!(table.summary().iter().all(|n| n.undecoded == lost.frames));
        let (status, checked, error) = said(&["check", &out]);
        assert_eq!(status, 0, "{error}");
        assert!(checked.contains(&format!("damaged: {} cannot be decoded", lost.words())), "{checked}");
        // It is complete, and still damaged.
        let (status, _, error) = said(&["track", &input, "-o", &out, "--resume"]);
        assert!(status == 1 && error.contains("was complete already"), "{error}");
    }
    let (status, text, _) = said(&["info", "--count", &input]);
    assert!(status == 1 && text.contains("damaged: frame"), "{text}");
    // The rig of what can be read is written, and the status is that of the film.
    let rig = case.text("damaged.toml");
    let (status, text, error) = said(&["setup", &input, "-o", &rig]);
    assert!(status == 1 && error.contains("damaged: frame") && Path::new(&rig).exists(), "{text}{error}");
    let cut = case.text("early.avi");
    let whole = fs::read(film("film.avi")).unwrap();
    fs::write(&cut, &whole[..whole.len() * 8 / 10]).unwrap();
    let (status, text, error) = said(&["setup", &cut, "-o", &rig, "--force", "--quiet"]);
    assert!(status == 1 && error.contains("the recording ended early"), "{text}{error}");
    let (status, _, error) = said(&["setup", &film("film.mp4"), "-o", &rig, "--force"]);
    assert_eq!(status, 0, "{error}");
    let (status, json, _) = said(&["info", "--count", "--json", &input]);
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((status, &value["ending"]["status"]), (1, &serde_json::json!("damaged")));
    assert_eq!(value["declared_frames"], 240);
    let counted = value["decoded_frames"].as_u64().unwrap() + value["undecodable_frames"].as_u64().unwrap();
    assert_eq!(counted, 240);
}
