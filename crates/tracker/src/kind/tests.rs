//! Tests of the kinds of files.

use super::{Kind, kind_of, misplaced};

#[test]
fn a_file_is_known_by_what_is_in_it_and_not_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let zip = |name: &str| {
        let mut bytes = [&b"PK\x03\x04"[..], &[0; 22], &[name.len() as u8, 0, 0, 0]].concat();
        bytes.extend(name.as_bytes());
        bytes
    };
    let cases: [(&str, &[u8], Kind); 21] = [
        ("a.csv", b"\0\0\0\x18ftypisom", Kind::Film),
        ("b.mp4", b"time_s,phi1_rad\n0,1\n", Kind::Angles),
        ("c.csv", b"# made by hand\ntime_s;phi1_deg;phi2_deg\n", Kind::Angles),
        ("d.csv", b"frame,time_s,node,body,x_px,y_px,sigma_px,area_px,status\n", Kind::NodeTable),
        ("e.csv", b"frame,time_s,node,body,x_px,y_px,visible\n", Kind::Truth),
        ("f.txt", b"\xef\xbb\xbftime_s,voltage_v\n", Kind::Encoder),
        ("g.bin", b"TDSm....", Kind::Encoder),
        ("h.toml", b"schema = 1\n[[node]]\nname = 'n0'\n", Kind::Rig),
        ("i.toml", b"[[part]]\nname = 'bar'\n", Kind::Model),
        ("j.toml", b"frames = 4\n[camera]\ndepth_bits = 8\n", Kind::Scene),
        ("j.toml", b"[[marker]]\nradius_px = 3\n", Kind::Scene),
        ("j.toml", b"schema = 1\n[film]\nname = 'drop.mp4'\n", Kind::Edits),
        ("j.toml", b"inputs = []\nmarker = ['3,4@5']\n", Kind::Config),
        ("k.json", b"{\"slope_v_per_rad\": 0.1, \"offset_v\": 0, \"holds\": []}", Kind::Calibration),
        ("l.xlsx", &zip("[Content_Types].xml"), Kind::Spreadsheet),
        ("l.npz", &zip("phi.npy"), Kind::NumpyArchive),
        ("l.zip", &zip("arrays/phi.npy"), Kind::NumpyArchive),
        ("l.mp4", &zip("drop.mp4"), Kind::Compressed),
        ("o.mp4", b"\x1f\x8b\x08....", Kind::Compressed),
        ("m.txt", b"Dear all,\nthe pendulum is broken.\n", Kind::Unknown),
        ("n.html", b"<!DOCTYPE html>\n", Kind::Page),
    ];
    for (name, bytes, kind) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(kind_of(&path), kind, "{name}");
    }
    assert_eq!(kind_of(&folder.path().join("none")), Kind::Unknown);
}

#[test]
fn what_is_misplaced_is_named_with_the_next_command() {
    let folder = tempfile::tempdir().unwrap();
    let film = folder.path().join("my drop.mp4");
    std::fs::write(&film, b"\0\0\0\x18ftypisom").unwrap();
    let said = misplaced(&film, &[Kind::Angles]).unwrap().to_string();
    assert!(said.contains("it is a film, not an angles table. Next: `pydpend track '"), "{said}");
    assert!(said.contains("my drop.mp4' -o '") && said.contains("my drop.parquet'`"), "{said}");
    assert!(misplaced(&film, &[Kind::Film]).is_none());
    let archive = folder.path().join("run.npz");
    let part = [&b"PK\x03\x04"[..], &[0; 22], &[7, 0, 0, 0], b"phi.npy"].concat();
    std::fs::write(&archive, part).unwrap();
    let said = misplaced(&archive, &[Kind::Angles]).unwrap().to_string();
    assert!(
        said.contains("it is a NumPy archive (.npz), not an angles table. Write its arrays as"),
        "{said}"
    );
    assert!(said.contains("run.npy\", numpy.load(") && said.ends_with("run.npz\")[\"phi\"])"), "{said}");
    for kind in Kind::ALL {
        assert!(kind == Kind::Unknown || !kind.next(&film).is_empty(), "{kind:?}");
    }
}
