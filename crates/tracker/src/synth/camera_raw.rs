//! Writes Photron recordings: pixels in `.mraw`, facts in `.cih`. For trying out and testing; layouts as read by `source`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::encode::cannot_write;
use super::film::Film;
use crate::error::{Error, Fault, Place, Result};
use crate::name::text;
use crate::output::NewFile;

/// A pair of files being written.
pub(crate) struct MrawWriter {
    name: String,
    pixels: BufWriter<File>,
    /// The files of pixels and of facts, in the order in which they take their names.
    new: [NewFile; 2],
    bits: u32,
    deep: bool,
    packed: Vec<u8>,
}

/// The two names of a pair of which one is given.
pub(crate) fn pair(path: &Path) -> [PathBuf; 2] {
    [path.with_extension("mraw"), path.with_extension("cih")]
}

impl MrawWriter {
    /// Begins a pair with `bits` per pixel (8, 10, 12 or 16; `None` is the fewest that hold the film's depth).
    pub(crate) fn create(path: &Path, film: &Film, bits: Option<u32>) -> Result<Self> {
        let scene = film.scene();
        let depth = scene.camera.depth_bits;
        let bits = bits.unwrap_or_else(|| [8, 10, 12, 16].into_iter().find(|&b| b >= depth).unwrap_or(16));
        let [pixels, header] = pair(path);
        let name = text(&pixels);
        let refuse = |problem: String, advice: &str| {
            Err(Error::Film(Fault::new(&name, problem).at(Place::Key("bits".into())).advice(advice)))
        };
        if ![8, 10, 12, 16].contains(&bits) || bits < depth {
            return refuse(
                format!("{bits} bits per pixel cannot hold a film of {depth} bits"),
                "Choose 8, 10, 12 or 16",
            );
        }
        let [w, h] = scene.image_px.map(u64::from);
        if w * h * u64::from(bits) % 40 != 0 && bits == 10 || w * h % 2 != 0 && bits == 12 {
            return refuse(
                format!("frames of {w} x {h} px do not end on whole bytes"),
                "Give a width that is a multiple of 4",
            );
        }
        let facts = NewFile::create(&header)
            .and_then(|new| new.file().write_all(cih(film, bits).as_bytes()).map(|()| new))
            .map_err(|e| cannot_write(&text(&header), &e))?;
        let new = NewFile::create(&pixels).map_err(|e| cannot_write(&name, &e))?;
        let file = new.file().try_clone().map_err(|e| cannot_write(&name, &e))?;
        let pixels = BufWriter::with_capacity(1 << 20, file);
        Ok(Self { name, pixels, new: [new, facts], bits, deep: depth > 8, packed: Vec::new() })
    }

    /// Adds a frame of recorded samples.
    pub(crate) fn write(&mut self, samples: &[u8]) -> Result<()> {
        let bytes = pack(samples, self.deep, self.bits, &mut self.packed);
        self.pixels
            .write_all(bytes)
            .map_err(|e| Error::Film(Fault::new(&self.name, format!("writing failed ({e})")).caused_by(&e)))
    }

    /// Ends the pair.
    pub(crate) fn finish(mut self) -> Result<()> {
        let [pixels, facts] = self.new;
        self.pixels
            .flush()
            .and_then(|()| pixels.publish(true))
            .and_then(|()| facts.publish(true))
            .map_err(|e| cannot_write(&self.name, &e))
    }
}

/// Samples in the camera's packing.
fn pack<'a>(samples: &'a [u8], deep: bool, bits: u32, out: &'a mut Vec<u8>) -> &'a [u8] {
    if bits == if deep { 16 } else { 8 } {
        return samples;
    }
    let value = |i: usize| -> u16 {
        if deep { u16::from_le_bytes([samples[2 * i], samples[2 * i + 1]]) } else { u16::from(samples[i]) }
    };
    let n = if deep { samples.len() / 2 } else { samples.len() };
    out.clear();
    match bits {
        16 => (0..n).for_each(|i| out.extend_from_slice(&value(i).to_le_bytes())),
        // Most significant bits first, over the ends of rows.
        _ => {
            let (mut held, mut count) = (0u32, 0);
            for i in 0..n {
                held = held << bits | u32::from(value(i));
                count += bits;
                while count >= 8 {
                    count -= 8;
                    out.push((held >> count) as u8);
                }
                held &= (1 << count) - 1;
            }
        }
    }
    out
}

fn cih(film: &Film, bits: u32) -> String {
    let s = film.scene();
    let shutter = if s.camera.exposure_s > 0.0 {
        format!("1/{:.0}", 1.0 / s.camera.exposure_s)
    } else {
        format!("1/{:.0}", s.rate_hz)
    };
    format!(
        "#Camera Information Header\n\
         Camera Type : tracker film\n\
         Record Rate(fps) : {rate}\n\
         Shutter Speed(s) : {shutter}\n\
         Trigger Mode : Start\n\
         Original Total Frame : {frames}\n\
         Total Frame : {frames}\n\
         Start Frame : 0\n\
         Correct Trigger Frame : 0\n\
         Save Step : 1\n\
         Image Width : {w}\n\
         Image Height : {h}\n\
         Color Type : Mono\n\
         Color Bit : {bits}\n\
         File Format : MRaw\n\
         EffectiveBit Depth : {depth}\n\
         EffectiveBit Side : Lower\n\
         Comment Text : scene of seed {seed}\n",
        rate = s.rate_hz,
        frames = s.frames,
        w = s.image_px[0],
        h = s.image_px[1],
        depth = s.camera.depth_bits,
        seed = s.seed,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packing_is_most_significant_bits_first() {
        let mut out = Vec::new();
        let twelve: Vec<u8> = [0xabc_u16, 0x123].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(pack(&twelve, true, 12, &mut out), [0xab, 0xc1, 0x23]);
        let ten: Vec<u8> =
            [0b1100000011_u16, 0, 0b1111111111, 1].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(
            pack(&ten, true, 10, &mut out),
            [0b11000000, 0b11000000, 0b00001111, 0b11111100, 0b00000001]
        );
        assert_eq!(pack(&[7, 9], false, 16, &mut out), [7, 0, 9, 0]);
    }
}
