//! Any table survives both forms; what is wrong is refused with its row, line or column.

use proptest::prelude::*;

use std::path::Path;

use super::*;
use crate::csv_text::Cells;
use crate::frame::RateOrigin;
use crate::gaps::Damage;
use crate::observation::{Observation, Status};
use crate::pixel_aspect::PixelAspect;
use crate::rig::{Body, Joint, Node, Rig};

pub(crate) fn meta(names: &[(String, usize)], bodies: &[String]) -> TableMeta {
    let rig = Rig {
        schema: 1,
        image_px: [640, 480],
        pixel_aspect: PixelAspect::SQUARE,
        reference_frame: Some(0),
        region: None,
        lens: None,
        wanted: Default::default(),
        camera: None,
        bodies: bodies.iter().map(|name| Body { name: name.clone() }).collect(),
        nodes: names
            .iter()
            .enumerate()
            .map(|(i, (name, b))| Node {
                name: name.clone(),
                body: bodies[*b].clone(),
                x_px: 10.1 + i as f64,
                y_px: 0.3,
            })
            .collect(),
        joints: vec![Joint {
            name: "pivot".into(),
            bodies: vec![bodies[0].clone()],
            x_px: 1.0 / 3.0,
            y_px: -7.0,
        }],
    };
    TableMeta {
        schema_version: SCHEMA_VERSION,
        tool: TableMeta::this_tool(),
        rig,
        source: SourceFacts {
            name: "drop.mraw".into(),
            container: "Photron MRAW".into(),
            codec: "packed 12 bit".into(),
            width: 640,
            height: 480,
            pixel_aspect: PixelAspect::SQUARE,
            pixel_aspect_origin: crate::pixel_aspect::AspectOrigin::Recording,
            depth_bits: 12,
            pixel_damage: None,
            declared_frames: Some(9),
            rate_hz: Some(1000.0),
            rate_origin: RateOrigin::CameraHeader,
            time_base: [1, 1000],
            converted_from: None,
            size_bytes: Some(12),
            sha256_first_mib: Some("00".into()),
            sha256_ends: Some("11".into()),
            warnings: vec!["a \"quoted\" warning, with a comma".into()],
        },
        time: None,
        settings: serde_json::json!({"detect": {"threshold": 0.1}}),
        ending: RunEnding::Early { frames: 9, byte: Some(77), reason: "cut".into() },
        damage: Damage::default(),
    }
}

fn two_by_three() -> NodeTable {
    let names: Vec<_> = (0..3).map(|i| (format!("n{i}"), i / 2)).collect();
    let meta = meta(&names, &["upper".into(), "lower".into()]);
    let mut rows = Rows::default();
    let seen = |x| Observation { x_px: x, y_px: 2.5, sigma_px: 0.02, area_px: 50.0, status: Status::Seen };
    rows.push(4, 0.004, &[seen(1.0), seen(2.0), Observation::MISSING]);
    let ambiguous = Observation { status: Status::Ambiguous, ..Observation::MISSING };
    rows.push(5, 0.005, &[seen(1.5), ambiguous, Observation { status: Status::Reacquired, ..seen(9.0) }]);
    NodeTable { meta, rows }
}

fn both_forms(table: &NodeTable) {
    let folder = tempfile::tempdir().unwrap();
    for name in ["t.parquet", "t.csv"] {
        let path = folder.path().join(name);
        table.write(&path, Cells::Plain).unwrap();
        let back = read_table(&path).unwrap();
        assert_eq!(back.meta, table.meta, "{name}");
        assert!(back.rows.same(&table.rows), "{name}:\n{:?}\n{:?}", back.rows, table.rows);
        assert_eq!(read_meta(&path).unwrap(), table.meta);
        let first = std::fs::read(&path).unwrap();
        table.write(&path, Cells::Plain).unwrap();
        assert_eq!(first, std::fs::read(&path).unwrap(), "the same table gave other bytes as {name}");
    }
    let left: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 3, "only the two tables and the .json may be left: {left:?}");
}

#[test]
fn a_small_table_survives_both_forms() {
    both_forms(&two_by_three());
}

#[test]
fn a_table_without_frames_survives_both_forms() {
    let mut table = two_by_three();
    table.rows = Rows::default();
    both_forms(&table);
}

#[test]
fn several_row_groups_come_back_as_one() {
    let mut table = two_by_three();
    table.rows = Rows::default();
    for t in 0..100_000u64 {
        let seen =
            |x| Observation { x_px: x, y_px: 0.25, sigma_px: 0.5, area_px: t as f32, status: Status::Seen };
        table.rows.push(t, t as f64 / 7.0, &[seen(t as f64), Observation::MISSING, seen(0.1)]);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    table.write(&path, Cells::Plain).unwrap();
    let back = read_table(&path).unwrap();
    assert!(back.rows.same(&table.rows));
    let file = std::fs::File::open(&path).unwrap();
    let reader = ::parquet::file::serialized_reader::SerializedFileReader::new(file).unwrap();
    use ::parquet::file::reader::FileReader;
    assert_eq!(reader.metadata().num_row_groups(), 3);
}

/// The error of a CSV table in which one piece of text is replaced.
fn csv_complaint(from: &str, to: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    two_by_three().write(&path, Cells::Plain).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{text}");
    std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
    read_table(&path).unwrap_err().to_string()
}

#[test]
fn a_csv_is_refused_with_the_line_and_column_at_fault() {
    for (from, to, expected) in [
        ("sigma_px", "sigma", "line 1: there is no column sigma_px"),
        ("4,0.004,n0", "four,0.004,n0", "line 2: column frame: \"four\" is not a number"),
        ("4,0.004,n1,upper,2.0", "4,0.004,n1,upper,x", "line 3: column x_px: \"x\" is not a number"),
        ("4,0.004,n1,upper,2.0", "4,0.004,n1,upper,NaN", "line 3: column x_px: NaN is not a finite number"),
        ("4,0.004,n1,upper,2.0", "4,0.004,n1,upper,", "row 1: node n1 is seen but its place is (NaN, 2.5)"),
        ("n1,upper", "n7,upper", "line 3: node \"n7\" of body \"upper\", expected \"n1\" of \"upper\""),
        ("5,0.005,n0", "4,0.004,n0", "line 6"),
        ("ambiguous", "unsure", "line 6: status \"unsure\""),
        ("5,0.005,n2,lower,9.0,2.5,0.02,50.0,reacquired\n", "", "line 7: the last frame has rows for 2 of 3"),
        (
            "9.0,2.5,0.02,50.0,reacquired\n",
            "9.0,2.",
            "line 7: the row has 6 fields, column status is missing",
        ),
    ] {
        let said = csv_complaint(from, to);
        assert!(said.contains(expected), "{from} -> {to}: {said}");
        assert!(said.contains("t.csv"), "{said}");
    }
    let whole =
        "5,0.005,n0,upper,1.5,2.5,0.02,50.0,seen\n5,0.005,n1,upper,,,,,ambiguous\n5,0.005,n2,lower,9.0";
    let twice = whole.replace("5,0.005", "4,0.004");
    assert!(csv_complaint(whole, &twice).contains("row 3: frame 4 comes after frame 4"));
}

#[test]
fn a_csv_cut_inside_its_last_number_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    two_by_three().write(&path, Cells::Plain).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    // As a spreadsheet may write it: the size of the spot last, seen or not.
    let turned: String = text
        .lines()
        .map(|line| {
            let (rest, status) = line.rsplit_once(',').unwrap();
            let (rest, area) = rest.rsplit_once(',').unwrap();
            format!("{rest},{status},{}\n", if area.is_empty() { "50.0" } else { area })
        })
        .collect();
    let complaint = |text: &str| {
        std::fs::write(&path, text).unwrap();
        read_table(&path).err().map(|e| e.to_string()).unwrap_or_default()
    };
    let whole = turned.trim_end();
    for cut in 1..3 {
        let said = complaint(&whole[..whole.len() - cut]);
        assert!(said.contains("line 7: the file ends with") && said.contains("cut off"), "{said}");
        assert!(!complaint(&format!("{}\n", &whole[..whole.len() - cut])).contains("cut off"));
    }
    assert!(!complaint(whole).contains("cut off"));
}

#[test]
fn a_csv_without_its_json_or_of_a_newer_schema_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    two_by_three().write(&path, Cells::Plain).unwrap();
    let json = folder.path().join("t.csv.json");
    let text = std::fs::read_to_string(&json).unwrap();
    for (from, to, expected) in [
        (
            "\"schema_version\": 1",
            "\"schema_version\": 2",
            "its schema version is 2, this program reads version 1",
        ),
        ("\"schema_version\": 1,", "", "there is no schema_version"),
        ("\"rig\"", "\"rug\"", "missing field `rig`"),
        ("\"body\": \"lower\"", "\"body\": \"third\"", "its body \"third\" is not in the rig"),
        ("{", "", "it is not JSON"),
    ] {
        assert!(text.contains(from));
        std::fs::write(&json, text.replacen(from, to, 1)).unwrap();
        let said = read_table(&path).unwrap_err().to_string();
        assert!(said.contains(expected) && said.contains("t.csv.json"), "{said}");
    }
    std::fs::remove_file(&json).unwrap();
    assert!(read_table(&path).unwrap_err().to_string().contains("t.csv.json is not there"));
    assert!(read_table(&folder.path().join("no.csv")).unwrap_err().to_string().contains("No such file"));
    assert!(read_table(&folder.path().join("no.txt")).unwrap_err().to_string().contains("unknown extension"));
}

#[test]
fn a_parquet_file_cut_anywhere_or_changed_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    two_by_three().write(&path, Cells::Plain).unwrap();
    let whole = std::fs::read(&path).unwrap();
    for cut in [0, 3, 4, 100, whole.len() / 2, whole.len() - 8, whole.len() - 1] {
        std::fs::write(&path, &whole[..cut]).unwrap();
        let said = read_table(&path).unwrap_err().to_string();
        assert!(said.contains("t.parquet") && said.contains("not a whole Parquet file"), "{said}");
    }
}

#[test]
fn names_that_are_formulas_survive_a_safe_csv() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    let names: Vec<_> = ["=1+1", "+a", "-b", "@c", "\td", "'=e", "n,\"0"].map(|n| (n.to_owned(), 0)).into();
    let meta = meta(&names, &["=HYPERLINK(\"x\")".into()]);
    let mut rows = Rows::default();
    rows.push(0, 0.0, &[Observation::MISSING; 7]);
    let table = NodeTable { meta, rows };
    for (cells, formulas) in [(Cells::Plain, true), (Cells::Safe, false)] {
        table.write(&path, cells).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.contains(",=1+1,"), formulas, "{text}");
        assert_eq!(text.contains("\"=HYPERLINK"), formulas, "{text}");
        assert_eq!(read_table(&path).unwrap().meta, table.meta);
    }
}

/// A change that spoils a table.
type Spoil = Box<dyn Fn(&mut NodeTable)>;

#[test]
fn an_invalid_table_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    let mut spoilt: Vec<(Spoil, &str)> = vec![
        (Box::new(|t| t.rows.time_s[1] = 0.004), "row 3: time_s 0.004 comes after 0.004"),
        (Box::new(|t| t.rows.time_s[0] = f64::NAN), "row 0: time_s of frame 4 is NaN"),
        (Box::new(|t| t.rows.frame[0] = -1), "row 0: frame -1 is below 0"),
        (Box::new(|t| t.rows.status[1] = 9), "row 1: status 9 of node n1"),
        (Box::new(|t| t.rows.sigma_px[1] = 0.0), "row 1: node n1 is seen but its sigma_px is 0"),
        (Box::new(|t| t.rows.xy_px[2] = 1.0), "row 1: nodes n0 and n1 are at one place (1, 2.5)"),
        (Box::new(|t| t.rows.area_px[2] = 4.0), "row 2: node n2 is missing but has a place"),
    ];
    spoilt.push((
        Box::new(|t| {
            t.rows.status.pop();
        }),
        "expected 2 frames x 3 nodes",
    ));
    for (spoil, expected) in spoilt {
        let mut table = two_by_three();
        spoil(&mut table);
        let said = table.write(&path, Cells::Plain).unwrap_err().to_string();
        assert!(said.contains(expected), "{said}");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0, "a file was left behind");
    }
}

#[test]
fn a_folder_that_is_not_there_is_an_error_that_names_the_file() {
    let said = two_by_three().write(Path::new("/nowhere/t.parquet"), Cells::Plain).unwrap_err().to_string();
    assert!(said.starts_with("/nowhere/t.parquet: it cannot be written"), "{said}");
}

#[test]
fn the_summary_counts_gaps() {
    let summary = two_by_three().summary();
    assert_eq!(
        (summary[0].seen, summary[1].ambiguous, summary[1].missing_at_end, summary[2].reacquired),
        (2, 1, 1, 1)
    );
    assert_eq!((summary[2].longest_gap, summary[2].missing_at_end), (1, 0));
    assert_eq!([0, 1, 2].map(|n| summary[n].stayed_lost()), [false, true, false]);
}

fn name() -> impl Strategy<Value = String> {
    // Whatever people call things, quotes and commas included, but no line breaks.
    "[ -~äøλ中]{1,8}"
}

prop_compose! {
    fn observation()(
        status in 0u8..4,
        x in prop_oneof![-1e3..1e4f64, proptest::num::f64::NORMAL],
        y in -1e3..1e4f64,
        sigma in 1e-6..10f32,
        area in 0f32..1e6,
    ) -> Observation {
        Observation { x_px: x, y_px: y, sigma_px: sigma, area_px: area, status: Status::from_number(status).unwrap() }
    }
}

/// Any number at all, with those that spoil a row often.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        2 => 0.0..100f64,
        1 => proptest::sample::select(vec![0.0, -0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e-300, 1e300]),
    ]
}

prop_compose! {
    fn any_observation()(status in 0u8..4, x in number(), y in number(), sigma in number(), area in number()) -> Observation {
        Observation {
            x_px: x,
            y_px: y,
            sigma_px: sigma as f32,
            area_px: area as f32,
            status: Status::from_number(status).unwrap(),
        }
    }
}

prop_compose! {
    fn table()(
        names in proptest::collection::btree_set(name(), 1..6),
        bodies in proptest::collection::btree_set(name(), 1..3),
        steps in proptest::collection::vec((1u64..5, 1e-9..1e3f64), 0..30),
    )(
        cells in proptest::collection::vec(observation(), steps.len() * names.len()),
        names in Just(names),
        bodies in Just(bodies.into_iter().collect::<Vec<_>>()),
        steps in Just(steps),
    ) -> NodeTable {
        // Every body needs a node, so no more bodies than nodes.
        let bodies = &bodies[..bodies.len().min(names.len())];
        let nodes = names.len();
        let names: Vec<_> = names.into_iter().enumerate().map(|(i, n)| (n, i % bodies.len())).collect();
        let meta = meta(&names, bodies);
        let mut rows = Rows::default();
        let (mut frame, mut time) = (0, -5.0);
        for (t, (step, dt)) in steps.into_iter().enumerate() {
            rows.push(frame, time, &cells[t * nodes..(t + 1) * nodes]);
            frame += step;
            time += dt;
        }
        NodeTable { meta, rows }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn whatever_is_written_is_read_and_the_rest_is_refused(
        frames in proptest::collection::vec((0u64..3, number(), [any_observation(), any_observation()]), 1..4),
        orderly in any::<bool>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let meta = meta(&[("a".into(), 0), ("b".into(), 0)], &["c".into()]);
        for name in ["t.parquet", "t.csv"] {
            let path = folder.path().join(name);
            let mut rows = Rows::default();
            let mut writer = TableWriter::create(&path, &meta.rig, Cells::Plain).unwrap();
            let mut written = Ok(());
            for (k, (frame, time_s, row)) in frames.iter().enumerate() {
                // Most times in order, or hardly any table would be whole.
                let (frame, time_s) = if orderly { (k as u64, k as f64) } else { (*frame, *time_s) };
                rows.push(frame, time_s, row);
                written = written.and_then(|()| writer.push(frame, time_s, row));
            }
            let written = written.and_then(|()| writer.finish(&meta));
            let table = NodeTable { meta: meta.clone(), rows };
            prop_assert_eq!(written.is_ok(), table.check("t").is_ok());
            match written {
                Ok(()) => prop_assert!(read_table(&path).unwrap().rows.same(&table.rows)),
                Err(error) => prop_assert!(!path.exists(), "{error}"),
            }
        }
    }

    #[test]
    fn any_table_survives_both_forms(table in table()) {
        // Two random centres are never one; times that differ by less than a rounding step are not a table.
        prop_assume!(table.check("t").is_ok());
        both_forms(&table);
    }
}

#[test]
fn a_frame_is_undecoded_for_all_nodes_and_both_forms_keep_it_and_what_is_lost() {
    use crate::gaps::{Cause, Gap};
    let mut table = two_by_three();
    table.rows.push(12, 0.05, &[Observation::UNDECODED; 3]);
    table.meta.ending = RunEnding::Damaged;
    table.meta.damage.undecoded.push(12);
    table.meta.damage.gaps.push(Gap { after: Some(7), frames: Some(2), cause: Cause::Damage });
    let folder = tempfile::tempdir().unwrap();
    for name in ["t.parquet", "t.csv"] {
        let path = folder.path().join(name);
        table.write(&path, Cells::default()).unwrap();
        let back = read_table(&path).unwrap();
        assert!(back.rows.same(&table.rows) && back.meta == table.meta, "{name}");
        assert_eq!(back.summary()[1].undecoded, 1);
        assert_eq!(
            read_meta(&path).unwrap().damage.words().unwrap(),
            "damaged: frame 12 cannot be decoded; 2 frames are lost between frames 7 and 8 (gap in the time stamps)"
        );
    }
    let last = table.rows.status.len() - 1;
    table.rows.status[last] = Status::Missing as u8;
    let error = table.check("t").unwrap_err().to_string();
    assert!(error.contains("frame 12 is undecoded for one of the nodes"), "{error}");
}

#[test]
fn a_frame_without_pixels_neither_ends_a_gap_nor_makes_it_longer() {
    let meta = meta(&[("n0".into(), 0)], &["upper".into()]);
    let mut tally = Tally::new(&meta.rig);
    let seen = Observation { x_px: 1.0, y_px: 1.0, sigma_px: 0.1, area_px: 9.0, status: Status::Seen };
    for o in [
        seen,
        Observation::MISSING,
        Observation::UNDECODED,
        Observation::MISSING,
        seen,
        Observation::UNDECODED,
    ] {
        tally.push(&[o]);
    }
    let node = &tally.summary()[0];
    assert_eq!(
        (node.seen, node.missing, node.undecoded, node.longest_gap, node.missing_at_end),
        (2, 2, 2, 2, 0)
    );
}

#[test]
fn types_that_an_arrow_writer_adds_are_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.parquet");
    let meta = meta(&[("a".into(), 0)], &["c".into()]);
    let mut writer = TableWriter::create(&path, &meta.rig, Cells::Plain).unwrap();
    writer.push(0, 0.0, &[Observation::MISSING]).unwrap();
    writer.finish(&meta).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let key = b"ARROW:schema";
    let at = whole.windows(key.len()).position(|w| w == key).unwrap() + key.len();
    // Behind the key comes its value, base64 of some hundred bytes: each of them damaged in turn, none is looked at.
    for k in (at + 8..at + 400).step_by(3) {
        let mut bytes = whole.clone();
        bytes[k] = if bytes[k] == b'A' { b'z' } else { b'A' };
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(crate::kind::kind_of(&path), crate::kind::Kind::NodeTable, "byte {k}");
        assert_eq!(read_table(&path).unwrap().frames(), 1, "byte {k}");
    }
}
