//! Phantom CINE: the real file's pixels and times, and copies of it that are cut or lie.

use tracker::frame::{Ending, RateOrigin};
use tracker::source::{OpenOptions, open};

use crate::film::{checksums, read_all, real, samples};

#[test]
fn stamps_count_and_not_the_header_rate() {
    let Some(path) = real("phantom/cine_781.cine") else { return };
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let info = source.info().clone();
    assert_eq!((info.width, info.height, info.declared_frames), (256, 256, Some(15)));
    assert_eq!(info.rate_origin, RateOrigin::TimeStamps);
    let rate = info.rate_hz.unwrap();
    assert!((rate - 9003.0).abs() < 1.0, "{rate}");
    assert!(info.warnings.iter().any(|w| w.to_string().contains("90000")), "{:?}", info.warnings);
    let frames = read_all(&mut *source);
    assert_eq!((frames.len(), source.ending()), (15, Ending::Complete));
    for pair in frames.windows(2) {
        let step = info.time_base.seconds(pair[1].ticks) - info.time_base.seconds(pair[0].ticks);
        // 111.07 us apart; the camera's clock counts in parts of a microsecond.
        assert!((step - 111.07e-6).abs() < 0.5e-6, "{step}");
    }
    let values = samples(&frames[0]).unwrap();
    assert!(values.iter().max() > Some(&4095), "16-bit range");
}

#[test]
fn another_reader_sees_the_same_pixels() {
    let Some(path) = real("phantom/cine_781.cine") else { return };
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let mut frames = read_all(&mut *source);
    // FFmpeg stretches the camera's 12 bits to 16; taken back, they are whole numbers again. pycine then takes the black
    // level of 64 away and stretches what is left up to the white level of 4064.
    for frame in &mut frames {
        let twelve = samples(frame).unwrap().into_iter().map(|v| (v * 4095 + 32767) / 65535);
        let stretched = twelve.map(|v| (v.saturating_sub(64) * 4095 / 4000) as u16);
        frame.plane = Some(Box::new(stretched.flat_map(u16::to_le_bytes).collect::<Vec<u8>>()));
        frame.stride = 512;
    }
    // From pycine 0.3.2 (PyPI): `pycine.raw.read_frames(path, start_frame=1, count=15)`, turned upside down, because it
    // does not heed the header's `bFlipV`; sums as in `mraw.rs`.
    assert_eq!(
        checksums(&frames),
        [5_859_161_517_127, 5_860_090_296_714, 5_860_600_022_942, 87_816_170_160_976]
    );
}

#[test]
fn a_cut_file_gives_its_good_frames_and_a_lying_one_an_error() {
    let Some(path) = real("phantom/cine_781.cine") else { return };
    let whole = std::fs::read(path).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("cut.cine");
    std::fs::write(&copy, &whole[..whole.len() * 2 / 3]).unwrap();
    let mut source = open(copy.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let frames = read_all(&mut *source);
    assert!((5..15).contains(&frames.len()), "{}", frames.len());
    assert!(frames.iter().all(|f| f.plane.is_some()));
    let Ending::Early { frames: n, reason, .. } = source.ending() else { panic!("not early") };
    assert_eq!(n as usize, frames.len(), "{reason}");

    let mut lying = whole.clone();
    // Width and height of 10^9 px; then 2^31 frames.
    lying[48..52].copy_from_slice(&1_000_000_000u32.to_le_bytes());
    lying[52..56].copy_from_slice(&1_000_000_000u32.to_le_bytes());
    std::fs::write(&copy, &lying).unwrap();
    assert!(open(copy.to_str().unwrap(), &OpenOptions::default()).is_err());
    let mut lying = whole;
    lying[20..24].copy_from_slice(&0x7fff_ffffu32.to_le_bytes());
    std::fs::write(&copy, &lying).unwrap();
    if let Ok(mut source) = open(copy.to_str().unwrap(), &OpenOptions::default()) {
        let _ = source.sample(4);
    }
}
