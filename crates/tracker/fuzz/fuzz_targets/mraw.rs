#![no_main]
//! A pair of files: the header up to the first zero byte, pixels after it. What opens must give every frame
//! that it promises, each with the bytes that its size needs.

use std::fs;
use std::path::PathBuf;

use libfuzzer_sys::fuzz_target;
use tracker_fuzz::frame::{Ending, FrameSource};
use tracker_fuzz::source::OpenOptions;
use tracker_fuzz::source::mraw::MrawSource;

fuzz_target!(|bytes: &[u8]| {
    let folder = PathBuf::from(format!("/dev/shm/fuzz-mraw-{}", std::process::id()));
    let _ = fs::create_dir(&folder);
    let cut = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    let header = folder.join("a.cih");
    if fs::write(&header, &bytes[..cut]).is_err()
        || fs::write(folder.join("a.mraw"), &bytes[(cut + 1).min(bytes.len())..]).is_err()
    {
        return;
    }
    if let Ok(mut source) = MrawSource::open(header.to_str().unwrap_or(""), &OpenOptions::default()) {
        let bits = u64::from(source.info().width)
            * u64::from(source.info().height)
            * u64::from(source.info().format.bits_per_pixel());
        assert!(!source.sample(3).expect("a file that opened can be sampled").is_empty());
        let mut count = 0;
        while let Some(frame) = source.next_frame().expect("a file that opened can be read") {
            let plane = frame.plane.expect("every frame has a plane");
            assert_eq!(plane.bytes().len() as u64, bits.div_ceil(8));
            count += 1;
            if count > 2000 {
                return;
            }
        }
        if let Ending::Early { frames, .. } = source.ending() {
            assert_eq!(frames, count);
        }
    }
});
