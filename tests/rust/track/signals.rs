//! Ctrl-C closes the table, and the run can go on.

use super::*;

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

/// Waits until something is so; fails if it never is.
fn until(what: &str, mut so: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !so() {
        assert!(begin.elapsed() < Duration::from_secs(120), "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn ctrl_c_closes_the_table_and_the_run_can_go_on() {
    let case = Case::new();
    let input = film("long.mp4");
    let expected = whole(&case, &input, "whole.csv");
    let out = case.text("stopped.csv");
    let rig = film("rig.toml");
    let state = case.path("stopped.csv.partial");
    // The signal is sent while the run stands still with some of its detections on disk. Only where it had come to
    // the table by then is there no more to stop, and another run shows it.
    let met = (0..20).any(|_| {
        let arguments = ["--rig", &rig, "--force", "--quiet", "--threads", "1"];
        let mut child = start(&[&["track", &input, "-o", &out], &arguments[..]].concat());
        until("the first detections", || {
            fs::metadata(&state).is_ok_and(|m| m.len() > 20_000) || child.try_wait().unwrap().is_some()
        });
        for name in ["-STOP", "-INT", "-CONT"] {
            signal(&child, name);
        }
        let status = child.wait().unwrap().code();
        assert!(matches!(status, Some(0 | 130)), "{status:?}");
        status == Some(130)
    });
    assert!(met, "no signal was heard in 20 runs");
    let table = read_table(&case.path("stopped.csv")).unwrap();
    assert_eq!(table.meta.ending, RunEnding::Interrupted);
    assert!(table.frames() > 0 && table.frames() < 800, "{}", table.frames());
    assert!(state.exists());
    let (status, _, error) = said(&["track", &input, "-o", &out, "--rig", &rig, "--quiet"]);
    assert_eq!(status, 2);
    assert!(error.contains("there already"), "{error}");
    let (status, _, error) = said(&["track", &input, "-o", &out, "--resume", "--quiet"]);
    assert_eq!(status, 0, "{error}");
    assert!(fs::read(&out).unwrap() == expected, "other bytes after ctrl-c");
}

#[test]
fn ctrl_c_is_heard_while_a_pipe_gives_nothing() {
    let case = Case::new();
    let pipe = case.path("pipe.y4m");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let head = b"YUV4MPEG2 W64 H48 F500:1 Ip A1:1 Cmono\n".to_vec();
    let frame = [&b"FRAME\n"[..], &[20; 64 * 48]].concat();
    // Nobody opens the other end; nobody writes; a head and no frame; two frames and no more.
    let given = [None, Some(vec![]), Some(head.clone()), Some([&head[..], &frame, &frame].concat())];
    for (k, bytes) in given.into_iter().enumerate() {
        let mut child = start(&["track", &case.text("pipe.y4m"), "-o", &case.text("t.csv"), "--quiet"]);
        // Opening a pipe to write waits for a reader, so the child has it open by then.
        let held = bytes.map(|bytes| {
            let mut end = fs::OpenOptions::new().write(true).open(&pipe).unwrap();
            end.write_all(&bytes).unwrap();
            end
        });
        // Bit 1 of the signals that it catches is ctrl-c.
        let status = format!("/proc/{}/status", child.id());
        until("the handler", || {
            let text = fs::read_to_string(&status).unwrap();
            let mask = text.lines().find_map(|l| l.strip_prefix("SigCgt:")).unwrap().trim();
            u64::from_str_radix(mask, 16).unwrap() & 2 != 0
        });
        signal(&child, "-INT");
        let mut code = None;
        until("the end after ctrl-c", || {
            code = child.try_wait().unwrap();
            code.is_some()
        });
        assert_eq!(code.unwrap().code(), Some(130), "case {k}");
        drop(held);
        assert_eq!(case.files(), ["pipe.y4m"], "case {k}");
    }
}
