//! `tracker check`: what became of each node, and which tables are refused.

use super::*;

#[test]
fn check_tells_what_became_of_each_node() {
    let case = Case::new();
    let csv = case.path("t.csv");
    said(&["track", &film("film.mp4"), "-o", &case.text("t.csv"), "--frames", "0..60", "--quiet"]);
    let nodes = |csv: &Path| -> Vec<serde_json::Value> {
        let (status, stdout, error) = said(&["check", "--json", csv.to_str().unwrap()]);
        assert_eq!(status, 0, "{error}");
        let told: serde_json::Value = serde_json::from_str(&stdout).unwrap();
        assert_eq!(told["frames"], 60);
        told["nodes"].as_array().unwrap().clone()
    };
    let good = nodes(&csv);
    let whole = good.iter().position(|n| n["summary"]["seen"] == 60 && n["motion"]["gaps"] == 0).unwrap();
    let name = good[whole]["summary"]["node"].as_str().unwrap().to_owned();
    let motion = |told: &[serde_json::Value], key: &str| told[whole]["motion"][key].as_f64().unwrap();
    let [residual_px, fastest_px] = ["residual_px", "fastest_px"].map(|key| motion(&good, key));
    assert!(residual_px < 0.1 && fastest_px < 10.0, "{:?}", good[whole]);
    // Lost in frames 10 to 16 and in 30, and 30 px off its place in frame 45.
    let spoiled: Vec<String> = fs::read_to_string(&csv)
        .unwrap()
        .lines()
        .map(|line| {
            let mut fields: Vec<String> = line.split(',').map(String::from).collect();
            if fields[2] == name {
                match fields[0].parse::<u64>().unwrap() {
                    10..17 | 30 => {
                        fields[4..8].iter_mut().for_each(String::clear);
                        fields[8] = "missing".into();
                    }
                    45 => fields[4] = format!("{}", fields[4].parse::<f64>().unwrap() + 30.0),
                    _ => {}
                }
            }
            fields.join(",")
        })
        .collect();
    fs::write(&csv, spoiled.join("\n") + "\n").unwrap();
    let told = nodes(&csv);
    let count = |of: &str, key: &str| told[whole][of][key].as_u64().unwrap();
    assert_eq!(
        (count("summary", "seen"), count("summary", "longest_gap"), count("motion", "gaps")),
        (52, 7, 2)
    );
    assert!(motion(&told, "fastest_px") > 20.0, "{:?}", told[whole]);
    assert!(motion(&told, "residual_px") > 10.0 * residual_px, "{:?}", told[whole]);
    // The others are as they were.
    assert!((0..good.len()).filter(|&k| k != whole).all(|k| told[k]["summary"] == good[k]["summary"]));
}

#[test]
fn tables_that_are_not_whole_or_not_right_are_refused_by_check() {
    let case = Case::new();
    let (parquet, csv) = (case.path("t.parquet"), case.path("t.csv"));
    for name in ["t.parquet", "t.csv"] {
        let arguments = ["track", &film("film.mp4"), "-o", &case.text(name), "--frames", "0..40", "--quiet"];
        assert!(said(&arguments).0 <= 1);
    }
    let refused = |path: &Path, expected: &[&str]| {
        let (status, stdout, error) = said(&["check", path.to_str().unwrap()]);
        assert_eq!(status, 2, "{error}");
        assert!(stdout.is_empty() && !error.contains("panicked"), "{error}");
        let name = path.file_name().unwrap().to_str().unwrap();
        for word in [name].iter().chain(expected) {
            assert!(error.contains(word), "{word:?} is not in {error:?}");
        }
    };
    let bytes = fs::read(&parquet).unwrap();
    fs::write(&parquet, &bytes[..bytes.len() / 2]).unwrap();
    refused(&parquet, &["not a whole Parquet file", "copy it again"]);
    let text = fs::read_to_string(&csv).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let field = |line: usize, at: usize, with: &str| {
        let mut fields: Vec<&str> = lines[line].split(',').collect();
        fields[at] = with;
        let mut out = lines.clone();
        let changed = fields.join(",");
        out[line] = &changed;
        out.join("\n") + "\n"
    };
    let frame_again = lines[..19].iter().chain(&lines[10..]).copied().collect::<Vec<_>>().join("\n") + "\n";
    for (changed, expected) in [
        (field(0, 5, "y"), &["line 1", "there is no column y_px"][..]),
        (field(4, 4, "far"), &["line 5", "column x_px", "\"far\" is not a number"]),
        (field(4, 5, "NaN"), &["line 5", "column y_px", "NaN is not a finite number"]),
        (frame_again, &["frame 1 comes after frame 1"]),
        (field(7, 2, "n99"), &["line 8", "node \"n99\"", "expected"]),
        (text[..text.len() - 30].to_owned(), &["line"]),
    ] {
        fs::write(&csv, changed).unwrap();
        refused(&csv, expected);
    }
}
