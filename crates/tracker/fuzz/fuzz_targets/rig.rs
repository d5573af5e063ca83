#![no_main]
//! Any text as a rig: an error, or a rig that is written and read again as itself.

use libfuzzer_sys::fuzz_target;
use tracker_fuzz::rig::Rig;

fuzz_target!(|text: &str| {
    if let Ok(rig) = Rig::parse(text, "rig.toml") {
        let written = rig.to_toml().expect("a checked rig has a TOML form");
        assert_eq!(Rig::parse(&written, "rig.toml").expect("what was written can be read"), rig);
    }
});
