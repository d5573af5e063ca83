//! Writes and reads the file behind a store: blocks with checksums, so that what a killed run left is known to be good.
//!
//! Owns: [`Spool`]. Form: `PDSPOOL1`, then records of an 8-byte head `kind (4 bytes), payload length (u32)`, the
//! CRC-32 of kind, length and payload (u32), and the payload. Kinds: `HEAD` (text of the run's settings, first),
//! `BLCK` (frames as u32, then a block), `DONE` (text, last). All little-endian.
//! Must not: know what the header's text means.

use std::fs::{File, OpenOptions};
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};

use super::block::{BLOCK_FRAMES, Block};
use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::message::Setting;
use crate::name::text;

const MAGIC: &[u8; 8] = b"PDSPOOL1";
const HEAD: [u8; 4] = *b"HEAD";
const BLCK: [u8; 4] = *b"BLCK";
const DONE: [u8; 4] = *b"DONE";
const RECORD_HEAD_BYTES: usize = 12;

/// Bytes written between two calls that make them survive a power cut.
const SYNC_BYTES: u64 = 4 << 20;

/// A payload longer than this is damage, not a block: 256 frames of 100,000 detections are 0.85 GB.
const LONGEST_PAYLOAD: u32 = 1 << 30;

/// Ending of a recording, as the pipeline writes it; the spool does not read it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finished {
    /// Text, JSON of the pipeline's making.
    pub ending: String,
}

/// A file of blocks, only ever appended to.
#[derive(Debug)]
pub struct Spool {
    file: File,
    name: String,
    path: Option<PathBuf>,
    /// Offset and length of each whole block's payload.
    blocks: Vec<(u64, u32)>,
    /// The last block, if it is not full.
    short: Option<(u64, u32)>,
    end: u64,
    unsynced: u64,
    finished: Option<Finished>,
    scratch: Vec<u8>,
}

impl Spool {
    /// A new file at `path` that must not be in use by another run. What an earlier run left there is gone; anything
    /// else stays and is refused, and a link is never followed.
    ///
    /// # Errors
    /// [`Error::Table`] if it cannot be made, is no file of a run, or another run holds it.
    pub fn create(path: &Path, header: &str) -> Result<Self> {
        let name = text(path);
        let made = OpenOptions::new().read(true).write(true).create_new(true).open(path);
        let file = match made {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => Self::open_own(path)?,
            made => made.map_err(|e| write_fault(&name, &e))?,
        };
        lock(&file, &name)?;
        file.set_len(0).map_err(|e| write_fault(&name, &e))?;
        let mut spool = Self::over(file, name, Some(path.to_owned()));
        spool.write(MAGIC)?;
        spool.record(HEAD, header.as_bytes())?;
        spool.sync()?;
        Ok(spool)
    }

    /// Opens what is at `path` if it is a file that a run left.
    fn open_own(path: &Path) -> Result<File> {
        let name = text(path);
        let unreadable = |e: std::io::Error| {
            Error::Table(
                Fault::new(&name, format!("the state of the earlier run cannot be read ({e})"))
                    .caused_by(&e)
                    .advice("Check its permissions"),
            )
        };
        let there = path.symlink_metadata().map_err(unreadable)?;
        let mut magic = Vec::new();
        let opened = if there.is_file() {
            let file = OpenOptions::new().read(true).write(true).open(path).map_err(unreadable)?;
            let now = file.metadata().map_err(unreadable)?;
            (&file).take(MAGIC.len() as u64).read_to_end(&mut magic).map_err(unreadable)?;
            ((now.dev(), now.ino()) == (there.dev(), there.ino())).then_some(file)
        } else {
            None
        };
        // A run that was killed at once may have left less than the whole beginning.
        opened.filter(|_| MAGIC.starts_with(&magic)).ok_or_else(|| {
            Error::Table(
                Fault::new(&name, "a run would keep its state here, and what is here no run has left")
                    .advice("Move it away, or choose another output"),
            )
        })
    }

    /// Whether a run could keep its state at `path`: nothing is there (`false`), or what an earlier run left (`true`).
    ///
    /// # Errors
    /// [`Error::Table`] if something else is there.
    pub fn is_at(path: &Path) -> Result<bool> {
        if path.symlink_metadata().is_err() {
            return Ok(false);
        }
        Self::open_own(path).map(|_| true)
    }

    /// A file that vanishes with the program.
    ///
    /// # Errors
    /// [`Error::Table`] if the temporary folder cannot be written.
    pub fn temporary() -> Result<Self> {
        let name = std::env::temp_dir().display().to_string();
        let file = tempfile::tempfile().map_err(|e| write_fault(&name, &e))?;
        Ok(Self::over(file, name, None))
    }

    fn over(file: File, name: String, path: Option<PathBuf>) -> Self {
        Self {
            file,
            name,
            path,
            blocks: Vec::new(),
            short: None,
            end: 0,
            unsynced: 0,
            finished: None,
            scratch: Vec::new(),
        }
    }

    /// Opens what an earlier run left, keeps its good beginning and cuts off the rest. Also gives the header.
    ///
    /// # Errors
    /// [`Error::Table`] if there is no such file, its header is not whole, or another run holds it.
    pub fn resume(path: &Path) -> Result<(Self, String)> {
        let name = text(path);
        let file = Self::open_own(path)?;
        lock(&file, &name)?;
        let mut spool = Self::over(file, name, Some(path.to_owned()));
        let header = spool.scan()?;
        spool.file.set_len(spool.end).map_err(|e| write_fault(&spool.name, &e))?;
        Ok((spool, header))
    }

    /// Reads records until the first that is not whole and good.
    fn scan(&mut self) -> Result<String> {
        let mut reader = BufReader::with_capacity(1 << 20, &self.file);
        reader.seek(SeekFrom::Start(0)).map_err(|e| read_fault(&self.name, &e, 0))?;
        let damaged = |name: &str| {
            Error::Table(
                Fault::new(name, "its beginning is damaged, so nothing of the earlier run can be kept")
                    .of_kind(FaultKind::Damaged)
                    .advice("Run without " + Setting::Resume),
            )
        };
        let mut magic = [0; 8];
        if !fill(&mut reader, &mut magic).map_err(|e| read_fault(&self.name, &e, 0))? || &magic != MAGIC {
            return Err(damaged(&self.name));
        }
        let mut at = MAGIC.len() as u64;
        let mut header = None;
        let mut payload = Vec::new();
        loop {
            let kind = next_record(&mut reader, &mut payload).map_err(|e| read_fault(&self.name, &e, at))?;
            let start = at + RECORD_HEAD_BYTES as u64;
            match kind {
                Some(HEAD) if header.is_none() => match String::from_utf8(std::mem::take(&mut payload)) {
                    Ok(text) => {
                        at = start + text.len() as u64;
                        header = Some(text);
                        continue;
                    }
                    Err(_) => return Err(damaged(&self.name)),
                },
                Some(BLCK) if header.is_some() && self.short.is_none() => {
                    let Some(frames) = frames_of(&payload) else { break };
                    let place = (start, payload.len() as u32);
                    if frames == BLOCK_FRAMES {
                        self.blocks.push(place);
                    } else {
                        self.short = Some(place);
                    }
                }
                Some(DONE) if header.is_some() => {
                    let Ok(ending) = std::str::from_utf8(&payload) else { break };
                    self.finished = Some(Finished { ending: ending.to_owned() });
                    at = start + payload.len() as u64;
                    break;
                }
                _ => break,
            }
            at = start + payload.len() as u64;
        }
        self.end = at;
        header.ok_or_else(|| damaged(&self.name))
    }

    /// Whole blocks in it.
    pub(super) fn blocks(&self) -> usize {
        self.blocks.len()
    }

    /// The end of the recording, if the earlier run read all of it.
    pub fn finished(&self) -> Option<&Finished> {
        self.finished.as_ref()
    }

    /// The path of the file; `None` for a temporary one.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// Takes the last block, if it is not full, out of the file again, to go on filling it.
    pub(super) fn take_short_block(&mut self) -> Result<Block> {
        let Some((start, length)) = self.short.take() else { return Ok(Block::default()) };
        let block = self.read_at(start, length)?;
        if self.finished.is_none() {
            self.end = start - RECORD_HEAD_BYTES as u64;
            self.file.set_len(self.end).map_err(|e| write_fault(&self.name, &e))?;
        }
        Ok(block)
    }

    /// Adds a full block.
    pub(super) fn append(&mut self, block: &Block) -> Result<()> {
        let place = self.write_block(block)?;
        self.blocks.push(place);
        // A temporary file need not survive anything.
        if self.path.is_some() && self.unsynced >= SYNC_BYTES {
            self.sync()?;
        }
        Ok(())
    }

    fn write_block(&mut self, block: &Block) -> Result<(u64, u32)> {
        let mut payload = std::mem::take(&mut self.scratch);
        payload.clear();
        payload.extend_from_slice(&(block.len() as u32).to_le_bytes());
        block.encode(&mut payload);
        let start = self.end + RECORD_HEAD_BYTES as u64;
        let length = payload.len() as u32;
        let written = self.record(BLCK, &payload);
        self.scratch = payload;
        written.map(|()| (start, length))
    }

    /// Writes the last block and, if the recording was read to its end, how it ended.
    pub(super) fn close(&mut self, tail: &Block, finished: Option<&Finished>) -> Result<()> {
        if self.path.is_none() || self.finished.is_some() {
            return Ok(());
        }
        if tail.len() > 0 {
            self.short = Some(self.write_block(tail)?);
        }
        if let Some(finished) = finished {
            self.record(DONE, finished.ending.as_bytes())?;
            self.finished = Some(finished.clone());
        }
        self.sync()
    }

    /// Reads the `b`-th whole block.
    pub(super) fn read(&self, b: usize) -> Result<Block> {
        let (start, length) = self.blocks[b];
        self.read_at(start, length)
    }

    fn read_at(&self, start: u64, length: u32) -> Result<Block> {
        let mut payload = vec![0; length as usize];
        self.file.read_exact_at(&mut payload, start).map_err(|e| read_fault(&self.name, &e, start))?;
        frames_of(&payload).and_then(|frames| Block::decode(&payload[4..], frames)).ok_or_else(|| {
            Error::Table(
                Fault::new(&self.name, "a block of detections has changed on disk")
                    .of_kind(FaultKind::Damaged)
                    .at(Place::Byte(start))
                    .advice("Run again without " + Setting::Resume),
            )
        })
    }

    fn record(&mut self, kind: [u8; 4], payload: &[u8]) -> Result<()> {
        let length =
            u32::try_from(payload.len()).ok().filter(|&n| n <= LONGEST_PAYLOAD).ok_or_else(|| {
                Error::Detect(
                    Fault::new(&self.name, format!("{} frames hold too many detections", BLOCK_FRAMES))
                        .advice("Set a higher " + Setting::Threshold),
                )
            })?;
        let mut head = [0; RECORD_HEAD_BYTES];
        head[..4].copy_from_slice(&kind);
        head[4..8].copy_from_slice(&length.to_le_bytes());
        let crc = checksum(&head[..8], payload);
        head[8..].copy_from_slice(&crc.to_le_bytes());
        let start = self.end;
        let written = self.write(&head).and_then(|()| self.write(payload));
        if written.is_err() {
            // A full disk may still take the cut; if not, the checksum shows what is half written.
            self.end = start;
            let _ = self.file.set_len(start);
        }
        written
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all_at(bytes, self.end).map_err(|e| write_fault(&self.name, &e))?;
        self.end += bytes.len() as u64;
        self.unsynced += bytes.len() as u64;
        Ok(())
    }

    fn sync(&mut self) -> Result<()> {
        self.file.flush().and_then(|()| self.file.sync_data()).map_err(|e| write_fault(&self.name, &e))?;
        self.unsynced = 0;
        Ok(())
    }
}

fn lock(file: &File, name: &str) -> Result<()> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(std::fs::TryLockError::WouldBlock) => Err(Error::Table(
            Fault::new(name, "another run is writing it")
                .of_kind(FaultKind::Exists)
                .advice("Wait for it or choose another output"),
        )),
        // A file system without locks (some network ones): two runs at once are then the user's care.
        Err(std::fs::TryLockError::Error(e)) if e.kind() == ErrorKind::Unsupported => Ok(()),
        Err(std::fs::TryLockError::Error(e)) => Err(write_fault(name, &e)),
    }
}

fn checksum(head: &[u8], payload: &[u8]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(head);
    crc.update(payload);
    crc.finalize()
}

/// The kind of the next record, its payload in `payload`; `None` if it is not whole and good.
fn next_record(reader: &mut impl Read, payload: &mut Vec<u8>) -> std::io::Result<Option<[u8; 4]>> {
    let mut head = [0; RECORD_HEAD_BYTES];
    if !fill(reader, &mut head)? {
        return Ok(None);
    }
    let [k0, k1, k2, k3, l0, l1, l2, l3, c0, c1, c2, c3] = head;
    let length = u32::from_le_bytes([l0, l1, l2, l3]);
    if length > LONGEST_PAYLOAD {
        return Ok(None);
    }
    payload.clear();
    let read = reader.by_ref().take(u64::from(length)).read_to_end(payload)?;
    let whole =
        read == length as usize && checksum(&head[..8], payload) == u32::from_le_bytes([c0, c1, c2, c3]);
    Ok(whole.then_some([k0, k1, k2, k3]))
}

fn frames_of(payload: &[u8]) -> Option<usize> {
    let frames = u32::from_le_bytes(*payload.first_chunk::<4>()?) as usize;
    (frames > 0 && frames <= BLOCK_FRAMES).then_some(frames)
}

/// Whether `bytes` could be filled before the end of the file.
fn fill(reader: &mut impl Read, bytes: &mut [u8]) -> std::io::Result<bool> {
    match reader.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(e),
    }
}

fn read_fault(name: &str, e: &std::io::Error, at: u64) -> Error {
    Error::Table(Fault::new(name, format!("it cannot be read ({e})")).caused_by(e).at(Place::Byte(at)))
}

fn write_fault(name: &str, e: &std::io::Error) -> Error {
    let advice = match e.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "Free some space and go on with " + Setting::Resume + "; what was done is kept"
        }
        _ => "Choose a folder that can be written".into(),
    };
    Error::Table(Fault::new(name, format!("it cannot be written ({e})")).caused_by(e).advice(advice))
}
