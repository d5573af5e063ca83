#![no_main]
//! Any bytes as a CINE header: an error, or stamps that rise.

use libfuzzer_sys::fuzz_target;
use tracker_fuzz::source::cine_header::{Header, plausible};

fuzz_target!(|bytes: &[u8]| {
    if let Ok(header) = Header::parse(bytes, "a.cine") {
        assert!(header.width > 0 && header.stamps.len() <= bytes.len());
        if let Some(stamps) = header.stamps() {
            assert!(stamps.ticks.windows(2).all(|w| w[0] < w[1]));
        }
    }
    // Stamps alone, without the need to build a header around them.
    let stamps: Vec<u64> =
        bytes.chunks_exact(8).map(|c| u64::from_le_bytes([c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7]])).collect();
    if let Some(mended) = plausible(&stamps) {
        assert_eq!(mended.ticks.len(), stamps.len());
        assert!(mended.ticks.windows(2).all(|w| w[0] < w[1]) && mended.ticks[0] == 0);
    }
});
