//! Keeps the detections of a whole recording, in memory and past a bound on disk.
//!
//! Owns: [`DetectionStore`]. Must not: know what a detection is followed into.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use super::block::{BLOCK_FRAMES, Block};
use super::spool::{Finished, Spool};
use super::stamp::FrameStamp;
use crate::detect::Detection;
use crate::error::{Error, Fault, Place, Result};
use crate::pixel_aspect::PixelAspect;

/// Bytes of detections held in memory before they go to disk: about 15,000 frames of 20 markers.
pub const MEMORY_BOUND_BYTES: usize = 12 << 20;

/// Blocks read back from disk that are kept, so that reading forwards, backwards and a little to and fro
/// reads each block once.
const CACHED_BLOCKS: usize = 3;

/// Stamps and detections of consecutive frames, read forwards, backwards or at random.
#[derive(Debug)]
pub struct DetectionStore {
    len: usize,
    /// Whole blocks, while they are in memory; empty once they are on disk.
    memory: Vec<Arc<Block>>,
    memory_bytes: usize,
    bound_bytes: usize,
    /// The file behind the store: a resumable spool from the start, or a temporary one past the bound.
    spool: Option<Spool>,
    /// Whether whole blocks are read from `memory`.
    in_memory: bool,
    /// The block being filled.
    tail: Block,
    cache: Mutex<Vec<(usize, Arc<Block>)>>,
    /// Width to height of a pixel of what is pushed; what is read is in square pixels.
    pixel_aspect: PixelAspect,
    /// The first thing that went wrong while reading back.
    fault: OnceLock<Error>,
}

impl Default for DetectionStore {
    fn default() -> Self {
        Self::with_bound(MEMORY_BOUND_BYTES)
    }
}

impl DetectionStore {
    /// An empty store that goes to a temporary file past [`MEMORY_BOUND_BYTES`].
    pub fn new() -> Self {
        Self::default()
    }

    /// An empty store that goes to a temporary file past `bound_bytes` of detections.
    pub fn with_bound(bound_bytes: usize) -> Self {
        Self {
            len: 0,
            memory: Vec::new(),
            memory_bytes: 0,
            bound_bytes,
            spool: None,
            in_memory: true,
            tail: Block::default(),
            cache: Mutex::new(Vec::new()),
            pixel_aspect: PixelAspect::SQUARE,
            fault: OnceLock::new(),
        }
    }

    /// A store on a resumable file, holding what the file holds already.
    ///
    /// # Errors
    /// [`Error::Table`] if the file cannot be read.
    pub fn on_spool(mut spool: Spool) -> Result<Self> {
        let tail = spool.take_short_block()?;
        let mut store = Self::with_bound(MEMORY_BOUND_BYTES);
        store.len = spool.blocks() * BLOCK_FRAMES + tail.len();
        store.tail = tail;
        // Blocks of an earlier run are on disk only; then all are read from there.
        store.in_memory = spool.blocks() == 0;
        store.spool = Some(spool);
        Ok(store)
    }

    /// The store of a recording with pixels of this aspect.
    #[must_use]
    pub fn of_pixels(self, pixel_aspect: PixelAspect) -> Self {
        Self { pixel_aspect, ..self }
    }

    /// Width to height of a pixel of the recording.
    pub fn pixel_aspect(&self) -> PixelAspect {
        self.pixel_aspect
    }

    /// Adds the next frame, its detections in recorded pixels.
    ///
    /// # Errors
    /// [`Error::Table`] if the disk behind the store is full or cannot be written.
    pub fn push(&mut self, stamp: FrameStamp, detections: &[Detection]) -> Result<()> {
        self.tail.push(stamp, detections);
        self.len += 1;
        if self.tail.len() == BLOCK_FRAMES {
            let block = std::mem::take(&mut self.tail);
            self.keep(block)?;
        }
        Ok(())
    }

    fn keep(&mut self, block: Block) -> Result<()> {
        if let Some(spool) = &mut self.spool {
            spool.append(&block)?;
        }
        if self.in_memory {
            self.memory_bytes += block.bytes();
            self.memory.push(Arc::new(block));
            if self.memory_bytes > self.bound_bytes {
                if self.spool.is_none() {
                    let mut spool = Spool::temporary()?;
                    for block in &self.memory {
                        spool.append(block)?;
                    }
                    self.spool = Some(spool);
                }
                self.memory = Vec::new();
                self.in_memory = false;
            }
        }
        Ok(())
    }

    /// Writes what is still in memory to the resumable file, if there is one, and makes sure it is on disk.
    /// Nothing may be pushed after it. `finished` says how the recording ended, `None` that it was left early
    /// and is to be gone on with.
    ///
    /// # Errors
    /// [`Error::Table`] if the disk is full or cannot be written.
    pub fn close(&mut self, finished: Option<&Finished>) -> Result<()> {
        if let Some(spool) = &mut self.spool {
            spool.close(&self.tail, finished)?;
        }
        Ok(())
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are no frames.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether all that was read was there. A disk that fails while detections are read back gives frames without
    /// detections from then on; whoever makes something of them asks here before it is given out.
    ///
    /// # Errors
    /// The first fault: [`Error::Table`] for a disk that cannot be read, [`Error::Argument`] for a frame past the
    /// end.
    pub fn check(&self) -> Result<()> {
        self.fault.get().map_or(Ok(()), |e| Err(e.clone()))
    }

    /// Stamp of the `i`-th frame stored; see [`DetectionStore::check`].
    pub fn stamp(&self, i: usize) -> FrameStamp {
        self.with_block(i, |block, k| block.stamp(k)).unwrap_or_else(|e| self.lost(i, e))
    }

    /// Copies the detections of the `i`-th frame stored into `out`, cleared first, in square pixels: there alone bodies
    /// are rigid. See [`DetectionStore::check`].
    pub fn read(&self, i: usize, out: &mut Vec<Detection>) {
        out.clear();
        if let Err(e) = self.with_block(i, |block, k| out.extend_from_slice(block.detections(k))) {
            self.lost(i, e);
        }
        if !self.pixel_aspect.is_square() {
            out.iter_mut().for_each(|d| *d = d.to_square(self.pixel_aspect));
        }
    }

    /// A copy of some frames.
    ///
    /// # Errors
    /// [`Error::Table`] if they cannot be read back.
    pub fn stretch(&self, frames: std::ops::Range<usize>) -> Result<Self> {
        let mut out = Self::new().of_pixels(self.pixel_aspect);
        for i in frames {
            let (stamp, detections) =
                self.with_block(i, |block, k| (block.stamp(k), block.detections(k).to_vec()))?;
            out.push(stamp, &detections)?;
        }
        Ok(out)
    }

    /// Remembers what went wrong.
    fn lost(&self, i: usize, fault: Error) -> FrameStamp {
        self.fault.get_or_init(|| fault);
        FrameStamp { index: i as u64, ticks: i as i64, decoded: false }
    }

    fn with_block<T>(&self, i: usize, take: impl FnOnce(&Block, usize) -> T) -> Result<T> {
        let (b, k) = (i / BLOCK_FRAMES, i % BLOCK_FRAMES);
        let whole = self.len / BLOCK_FRAMES;
        if i >= self.len {
            return Err(Error::Argument(
                Fault::new("detections", format!("only {} frames are stored", self.len))
                    .at(Place::Frame(i as u64)),
            ));
        }
        if b >= whole {
            return Ok(take(&self.tail, k));
        }
        if self.in_memory {
            return Ok(take(&self.memory[b], k));
        }
        let Some(spool) = &self.spool else {
            return Err(Error::Table(Fault::new("detections", "a block is neither in memory nor on disk")));
        };
        let mut cache = self.cached();
        if let Some(at) = cache.iter().position(|(n, _)| *n == b) {
            let block = Arc::clone(&cache[at].1);
            drop(cache);
            return Ok(take(&block, k));
        }
        let block = Arc::new(spool.read(b)?);
        if cache.len() == CACHED_BLOCKS {
            cache.remove(0);
        }
        cache.push((b, Arc::clone(&block)));
        drop(cache);
        Ok(take(&block, k))
    }

    fn cached(&self) -> MutexGuard<'_, Vec<(usize, Arc<Block>)>> {
        // A cache is right whoever panicked while holding it: entries are pushed whole.
        self.cache.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(i: u64) -> (FrameStamp, Vec<Detection>) {
        let stamp = FrameStamp { index: i + 3, ticks: 7 * i as i64, decoded: !i.is_multiple_of(5) };
        let detections = (0..i % 4)
            .map(|k| Detection {
                x_px: i as f64 + 0.25 * k as f64,
                y_px: -1.5,
                area_px: 12.5,
                sigma_px: 0.01,
                peak: 200.0,
                elongation: 1.1,
                flags: crate::detect::Flags(k as u8),
            })
            .collect();
        (stamp, detections)
    }

    fn filled(mut store: DetectionStore, frames: u64) -> DetectionStore {
        for i in store.len() as u64..frames {
            let (stamp, detections) = frame(i);
            store.push(stamp, &detections).unwrap();
        }
        store
    }

    fn assert_holds(store: &DetectionStore, frames: u64) {
        assert_eq!(store.len() as u64, frames);
        let mut out = Vec::new();
        let there = 0..frames;
        for i in there.clone().chain(there.rev().step_by(3)) {
            let (stamp, detections) = frame(i);
            store.read(i as usize, &mut out);
            assert_eq!(out, detections);
            assert_eq!(store.stamp(i as usize), stamp);
        }
        store.check().unwrap();
    }

    #[test]
    fn reads_back_what_was_pushed_in_memory_and_on_disk() {
        assert_holds(&filled(DetectionStore::new(), 1500), 1500);
        let spilled = filled(DetectionStore::with_bound(1000), 1500);
        assert!(!spilled.in_memory && spilled.memory.is_empty());
        assert_holds(&spilled, 1500);
    }

    #[test]
    fn a_spool_cut_anywhere_gives_its_good_blocks_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.partial");
        let whole = {
            let mut store =
                filled(DetectionStore::on_spool(Spool::create(&path, "header").unwrap()).unwrap(), 1100);
            store.close(None).unwrap();
            assert_holds(&store, 1100);
            drop(store);
            std::fs::read(&path).unwrap()
        };
        for cut in (0..=whole.len()).rev().step_by(4099).chain([whole.len() - 1, 17, 16, 15, 3, 0]) {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let Ok((spool, header)) = Spool::resume(&path) else {
                assert!(cut < 32, "a file with its header whole ({cut} bytes) was refused");
                continue;
            };
            assert_eq!(header, "header");
            let store = DetectionStore::on_spool(spool).unwrap();
            let kept = store.len() as u64;
            assert!(kept == 1100 || kept.is_multiple_of(BLOCK_FRAMES as u64));
            assert_holds(&store, kept);
            let store = filled(store, 1100);
            assert_holds(&store, 1100);
        }
    }

    #[test]
    fn a_damaged_block_ends_what_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.partial");
        let mut store =
            filled(DetectionStore::on_spool(Spool::create(&path, "h").unwrap()).unwrap(), 3 * 256);
        let done = Finished { ending: "\"Complete\"".into() };
        store.close(Some(&done)).unwrap();
        drop(store);
        let (spool, _) = Spool::resume(&path).unwrap();
        assert_eq!(spool.finished(), Some(&done));
        drop(spool);
        let mut bytes = std::fs::read(&path).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        let (spool, _) = Spool::resume(&path).unwrap();
        assert_eq!(spool.finished(), None);
        let store = DetectionStore::on_spool(spool).unwrap();
        assert_holds(&store, 256);
    }

    #[test]
    fn what_cannot_be_read_back_is_an_error_that_stays() {
        let store = filled(DetectionStore::new(), 10);
        let mut out = Vec::new();
        store.read(10, &mut out);
        assert!(out.is_empty());
        let said = store.check().unwrap_err().to_string();
        assert!(said.contains("frame 10") && said.contains("only 10 frames"), "{said}");

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.partial");
        let spool = Spool::create(&path, "h").unwrap();
        let mut store = DetectionStore { in_memory: false, ..DetectionStore::on_spool(spool).unwrap() };
        store = filled(store, 600);
        std::fs::write(&path, "gone").unwrap();
        store.read(0, &mut out);
        assert!(store.check().unwrap_err().to_string().contains("a.partial"));
    }

    #[test]
    fn two_runs_cannot_write_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.partial");
        let first = Spool::create(&path, "h").unwrap();
        assert!(Spool::resume(&path).unwrap_err().to_string().contains("another run"));
        assert!(Spool::create(&path, "h").is_err());
        drop(first);
        assert!(Spool::resume(&path).is_ok());
    }
}
