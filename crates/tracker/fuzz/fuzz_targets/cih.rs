#![no_main]
//! Any bytes as a `.cih`: a header or an error, and whatever it says, sizes and times without overflow.

use libfuzzer_sys::fuzz_target;
use tracker_fuzz::source::mraw::cih;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(header) = cih::parse(bytes, "a.cih") {
        assert!(header.width > 0 && header.height > 0 && header.save_step > 0);
        if let Ok(packing) = header.packing("a.cih") {
            assert!(packing.frame_bytes > 0 && packing.depth_bits <= 16 && packing.shift <= 8);
        }
        if let Some(base) = header.time_base() {
            assert!(base.numerator > 0 && base.denominator > 0);
            let _ = base.seconds(i64::MAX);
        }
        let _ = header.trigger_index();
    }
});
