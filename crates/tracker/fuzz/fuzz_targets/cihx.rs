#![no_main]
//! Any bytes as a `.cihx`, bare and inside its envelope.

use libfuzzer_sys::fuzz_target;
use tracker_fuzz::source::mraw::cihx;

fuzz_target!(|bytes: &[u8]| {
    for wrapped in [bytes.to_vec(), [b"<cih>".as_slice(), bytes, b"</cih>"].concat()] {
        if let Ok(header) = cihx::parse(&wrapped, "a.cihx") {
            let _ = header.packing("a.cihx");
            if let Some(base) = header.time_base() {
                assert!(base.numerator > 0 && base.denominator > 0);
            }
            let _ = header.trigger_index();
        }
    }
});
