//! Lends frames that lie in a file as they are: each is read when its pixels are first looked at, by whoever looks.
//!
//! Owns: [`RawFrames`], [`Stored`]. Read and not mapped into memory: where another program cuts a file that is mapped, the
//! system ends this program by a signal; a read says how much there was. Must not: know what a header says.

use std::fs::File;
use std::io::ErrorKind;
use std::num::NonZeroU64;
use std::os::unix::fs::FileExt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rustix::fs::{Advice, fadvise};

use crate::error::{Error, Fault, FaultKind, Place, Result};
use crate::frame::Bytes;

/// Bytes that the system is asked to have ready, anew when half of them are read.
const AHEAD_BYTES: u64 = 32 << 20;

/// Storage of samples in the file, where detection does not take them so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stored {
    /// As detection takes them: bytes, little-endian pairs, or packed.
    Plain,
    /// Pairs of bytes.
    Words {
        /// The upper byte comes first.
        big_endian: bool,
        /// Bits below the significant ones.
        shift: u32,
        /// Whether 0 is white.
        inverted: bool,
    },
    /// Bytes of which 0 is white.
    Inverted,
    /// Three bytes of colour, and as many more that mean nothing as make up `bytes` of a pixel.
    Colour {
        /// Bytes of a pixel.
        bytes: usize,
        /// Red comes first; else blue does.
        red_first: bool,
    },
}

impl Stored {
    /// Makes of bytes as they lie in the file what detection takes.
    fn arrange(self, bytes: &mut Vec<u8>) {
        match self {
            Stored::Plain => {}
            Stored::Words { big_endian, shift, inverted } => {
                let flip = if inverted { u16::MAX } else { 0 };
                for pair in bytes.as_chunks_mut::<2>().0 {
                    let value =
                        if big_endian { u16::from_be_bytes(*pair) } else { u16::from_le_bytes(*pair) };
                    *pair = ((value ^ flip) >> shift).to_le_bytes();
                }
            }
            Stored::Inverted => bytes.iter_mut().for_each(|b| *b = !*b),
            Stored::Colour { bytes: step, red_first } => {
                let count = bytes.len() / step;
                for i in 0..count {
                    let [a, b, c] = [0, 1, 2].map(|k| bytes[i * step + k]);
                    bytes[i] = brightness(if red_first { [a, b, c] } else { [c, b, a] }) as u8;
                }
                bytes.truncate(count);
            }
        }
    }
}

/// Red, green and blue weighted as by OpenCV (ITU-R BT.601, over 2^14).
pub(super) fn brightness<T: Copy + Into<u32>>([red, green, blue]: [T; 3]) -> u32 {
    (4899 * red.into() + 9617 * green.into() + 1868 * blue.into() + (1 << 13)) >> 14
}

/// A file with frames in it, and buffers that go round, so that a frame is looked at while caches hold it.
#[derive(Clone)]
pub(super) struct RawFrames(Arc<Shared>);

struct Shared {
    file: File,
    name: String,
    stored: Stored,
    spare: Mutex<Vec<Vec<u8>>>,
    /// Up to where the system was asked to read.
    asked: AtomicU64,
}

impl RawFrames {
    /// The frames of `file`, all stored alike; `name` is for messages.
    pub fn new(file: File, name: &str, stored: Stored) -> Self {
        let (spare, asked) = (Mutex::default(), AtomicU64::new(0));
        Self(Arc::new(Shared { file, name: name.to_owned(), stored, spare, asked }))
    }

    /// The frame `index`, `length` bytes from byte `at` of the file on. Nothing is read yet.
    pub fn lend(&self, index: u64, at: u64, length: usize) -> Box<dyn Bytes> {
        Box::new(Lent { shared: Arc::clone(&self.0), index, at, length, read: OnceLock::new() })
    }

    /// A copy of the frame `index`, read at once.
    ///
    /// # Errors
    /// [`Error::Source`] if it cannot be read whole.
    pub fn copy(&self, index: u64, at: u64, length: usize) -> Result<Box<dyn Bytes>> {
        let mut bytes = Vec::new();
        match self.0.read(index, at, length, &mut bytes) {
            Ok(()) => Ok(Box::new(bytes)),
            Err(fault) => Err(Error::Source(fault)),
        }
    }
}

impl Shared {
    fn read(&self, index: u64, at: u64, length: usize, bytes: &mut Vec<u8>) -> Result<(), Fault> {
        bytes.resize(length, 0);
        self.file.read_exact_at(bytes, at).map_err(|e| self.fault(index, &e))?;
        self.stored.arrange(bytes);
        Ok(())
    }

    /// Several threads read frames side by side, in which the system sees no order, so it is told what comes next.
    fn ask_ahead(&self, at: u64) {
        let until = self.asked.load(Ordering::Relaxed);
        if at.saturating_add(AHEAD_BYTES / 2) <= until {
            return;
        }
        let (from, to) = (until.max(at), at.saturating_add(AHEAD_BYTES));
        if self.asked.compare_exchange(until, to, Ordering::Relaxed, Ordering::Relaxed).is_ok() {
            // It only makes things faster.
            let _ = fadvise(&self.file, from, NonZeroU64::new(to - from), Advice::WillNeed);
        }
    }

    fn fault(&self, index: u64, error: &std::io::Error) -> Fault {
        let fault = if error.kind() == ErrorKind::UnexpectedEof {
            Fault::new(&self.name, "the file became shorter while it was read")
                .of_kind(FaultKind::Damaged)
                .advice("Wait until no other program writes to it, and run again")
        } else {
            Fault::new(&self.name, format!("the file cannot be read ({error})"))
                .caused_by(error)
                .advice("Copy it to a local disk")
        };
        fault.at(Place::Frame(index))
    }

    fn spare(&self) -> std::sync::MutexGuard<'_, Vec<Vec<u8>>> {
        // A vector of buffers is whole whatever happened to who held it.
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A frame that is read when it is first looked at.
struct Lent {
    shared: Arc<Shared>,
    index: u64,
    at: u64,
    length: usize,
    read: OnceLock<Result<Vec<u8>, Fault>>,
}

impl Lent {
    fn read(&self) -> &Result<Vec<u8>, Fault> {
        self.read.get_or_init(|| {
            self.shared.ask_ahead(self.at);
            let mut bytes = self.shared.spare().pop().unwrap_or_default();
            self.shared.read(self.index, self.at, self.length, &mut bytes).map(|()| bytes)
        })
    }
}

impl Bytes for Lent {
    fn bytes(&self) -> &[u8] {
        self.read().as_deref().unwrap_or_default()
    }

    fn fault(&self) -> Option<&Fault> {
        self.read().as_ref().err()
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        if let Some(Ok(bytes)) = self.read.take() {
            self.shared.spare().push(bytes);
        }
    }
}
