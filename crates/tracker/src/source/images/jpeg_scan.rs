//! Reads a JPEG picture's coded data without making pixels of them: decoders fill up what they cannot decode, and say nothing.
//!
//! Owns: [`check`]. Must not: judge what it does not follow (progressive, lossless and arithmetic coding). ITU-T T.81.

use super::jpeg_bits::{Bits, Codes};

/// Bytes behind the last block that are no damage: some cameras fill the data up to a multiple of a bus's width, at most 512 bits.
const FILLING: usize = 64;
/// Components that a picture has at most: those of colours for print.
const MOST_COMPONENTS: usize = 4;

/// A component as the frame's header describes it.
#[derive(Clone, Copy, Default)]
struct Component {
    id: u8,
    /// Blocks side by side and on top of each other in a unit of an interleaved scan.
    across: usize,
    down: usize,
}

/// The tables and sizes of the segments before a scan.
#[derive(Default)]
struct Header {
    width: usize,
    height: usize,
    components: Vec<Component>,
    /// Tables of the codes, by their class (0: sums of a block, 1: the other coefficients) and number.
    codes: [[Option<Codes>; 4]; 2],
    restart: usize,
}

/// Whether all blocks of a picture are coded, and nothing behind them; an error is a clause without a full stop. A picture that is
/// coded otherwise than block by block is not doubted.
pub(crate) fn check(jpeg: &[u8]) -> Result<(), String> {
    let mut header = Header::default();
    let mut at = 2;
    let mut scanned = 0;
    while let Some(&[0xff, marker]) = jpeg.get(at..at + 2) {
        if marker == 0xff {
            at += 1;
            continue;
        }
        // Markers without a segment: some encoders end the data with one more mark of a part.
        if matches!(marker, 0x01 | 0xd0..=0xd7) {
            at += 2;
            continue;
        }
        if marker == 0xd9 {
            break;
        }
        let Some(segment) = segment(jpeg, at + 2) else { return Err("it is cut".to_owned()) };
        at += 4 + segment.len();
        match marker {
            0xc0 | 0xc1 if header.components.is_empty() => header.frame(segment)?,
            0xc4 => header.codes(segment)?,
            // Other ways to code.
            0xc0..=0xcf if marker != 0xc8 => return Ok(()),
            0xdd => header.restart = segment.first_chunk().map_or(0, |b| usize::from(u16::from_be_bytes(*b))),
            0xda => {
                // Without a height it stands behind the picture.
                if header.height == 0 || header.components.is_empty() {
                    return Ok(());
                }
                let (end, components) = header.scan(segment, &jpeg[at..])?;
                at += end;
                scanned += components;
            }
            _ => {}
        }
    }
    if scanned < header.components.len() {
        return Err("it is cut".to_owned());
    }
    Ok(())
}

/// The contents of the segment whose length stands at byte `at`.
fn segment(jpeg: &[u8], at: usize) -> Option<&[u8]> {
    let length = usize::from(u16::from_be_bytes(*jpeg.get(at..)?.first_chunk()?));
    jpeg.get(at + 2..at + length).filter(|_| length >= 2)
}

fn broken() -> String {
    "its headers are damaged".to_owned()
}

impl Header {
    fn frame(&mut self, segment: &[u8]) -> Result<(), String> {
        let &[_, h1, h2, w1, w2, n, ref rest @ ..] = segment else { return Err(broken()) };
        self.height = usize::from(u16::from_be_bytes([h1, h2]));
        self.width = usize::from(u16::from_be_bytes([w1, w2]));
        let component =
            |c: &[u8]| Component { id: c[0], across: usize::from(c[1] >> 4), down: usize::from(c[1] & 15) };
        self.components = rest.chunks_exact(3).take(usize::from(n)).map(component).collect();
        let is_known = |c: &Component| (1..=4).contains(&c.across) && (1..=4).contains(&c.down);
        let is_whole = self.components.len() == usize::from(n) && n as usize <= MOST_COMPONENTS;
        (is_whole && n > 0 && self.width > 0 && self.components.iter().all(is_known))
            .then_some(())
            .ok_or_else(broken)
    }

    fn codes(&mut self, mut segment: &[u8]) -> Result<(), String> {
        while let Some((&[place, ref counts @ ..], rest)) = segment.split_first_chunk::<17>() {
            let n = counts.iter().map(|c| usize::from(*c)).sum();
            let values = rest.get(..n).ok_or_else(broken)?;
            let slot =
                self.codes.get_mut(usize::from(place >> 4)).and_then(|c| c.get_mut(usize::from(place & 15)));
            *slot.ok_or_else(broken)? = Some(Codes::new(counts, values).ok_or_else(broken)?);
            segment = &rest[n..];
        }
        Ok(())
    }

    /// Goes through the scan that a segment describes. Returns where the next marker is in `data`, and how many components it holds.
    fn scan(&self, segment: &[u8], data: &[u8]) -> Result<(usize, usize), String> {
        let &[n, ref rest @ ..] = segment else { return Err(broken()) };
        let n = usize::from(n);
        if n == 0 || rest.len() < 2 * n {
            return Err(broken());
        }
        let mut parts = Vec::new();
        for pair in rest.chunks_exact(2).take(n) {
            let component = self.components.iter().find(|c| c.id == pair[0]).ok_or_else(broken)?;
            let [dc, ac] = [(0, pair[1] >> 4), (1, pair[1] & 15)].map(|(class, k)| {
                let of_file = self.codes[class].get(usize::from(k))?.as_ref();
                of_file.or_else(|| Codes::usual(class, usize::from(k)))
            });
            let (Some(dc), Some(ac)) = (dc, ac) else { return Err(broken()) };
            // A scan of one component goes through its own blocks, without those that fill up the last unit.
            let blocks = if n == 1 { 1 } else { component.across * component.down };
            parts.push((dc, ac, blocks));
        }
        let most = |of: fn(&Component) -> usize| self.components.iter().map(of).max().unwrap_or(1);
        let (across, down) = (most(|c| c.across), most(|c| c.down));
        let units = if let (1, Some(own)) = (n, self.components.iter().find(|c| c.id == rest[0])) {
            let side = |whole: usize, own: usize, most: usize| (whole * own).div_ceil(most).div_ceil(8);
            side(self.width, own.across, across) * side(self.height, own.down, down)
        } else {
            self.width.div_ceil(8 * across) * self.height.div_ceil(8 * down)
        };
        let mut bits = Bits::new(data);
        for unit in 0..units {
            if self.restart > 0 && unit > 0 && unit.is_multiple_of(self.restart) {
                bits.restart((unit / self.restart - 1) % 8)?;
            }
            for (dc, ac, blocks) in &parts {
                for _ in 0..*blocks {
                    bits.block(dc, ac)?;
                }
            }
        }
        let (left, end) = bits.end();
        if left > FILLING {
            return Err(format!("its pixels are coded in {left} bytes fewer than there are"));
        }
        Ok((end, n))
    }
}
