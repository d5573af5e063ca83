//! Chooses the walk for a container and follows it from packet to packet.
//!
//! Owns: [`Structure`]. Must not: decode, or decide what is lost.

use std::fs::File;

use super::bytes::Bytes;
use super::walk::{Fit, Walk};
use super::{asf, boxes, flv, gif, matroska, mxf, nut, ogg, pages, program, transport};

/// Follows the elements of a file from packet to packet.
pub(in super::super) struct Structure {
    file: Bytes,
    walk: Box<dyn Walk>,
}

impl Structure {
    /// The structure of a file, by its container's short names; `None` where none is known or the file cannot be
    /// read again. `stream_id` is the stream's number in the container, `is_alone` whether it is the only one.
    pub(in super::super) fn of(container: &str, path: &str, stream_id: i32, is_alone: bool) -> Option<Self> {
        let has = |name: &str| container.split(',').any(|c| c == name);
        let mut file = Bytes::new(File::open(path).ok()?)?;
        let walk: Box<dyn Walk> = if has("matroska") {
            Box::new(matroska::Matroska::default())
        } else if has("mpegts") {
            Box::new(transport::Transport::new(&mut file, stream_id)?)
        } else if has("mp4") {
            Box::new(boxes::Boxes::new(&mut file, is_alone))
        } else if has("gif") {
            Box::new(gif::Gif::default())
        } else if has("flv") {
            Box::new(flv::Flv::new(&mut file)?)
        } else if has("ogg") {
            Box::new(pages::Paged::new(ogg::Ogg::default(), 0))
        } else if has("mxf") {
            Box::new(mxf::Mxf::new(&mut file)?)
        } else if has("nut") {
            Box::new(nut::Nut::default())
        } else if has("mpeg") {
            Box::new(program::Program::default())
        } else if has("asf") {
            Box::new(asf::Asf::walk(&mut file, stream_id)?)
        } else {
            return None;
        };
        Some(Self { file, walk })
    }

    /// The fit of all elements from the last packet to the one whose first byte is at `to`.
    pub(in super::super) fn reach(&mut self, to: u64) -> Fit {
        self.walk.reach(&mut self.file, to)
    }

    /// The fit of all elements from the last packet to the end of the file.
    pub(in super::super) fn rest(&mut self) -> Fit {
        self.walk.rest(&mut self.file)
    }

    /// After [`Structure::rest`]: whether the file ends inside something that holds pictures.
    pub(in super::super) fn ends_in_pictures(&self) -> bool {
        self.walk.ends_in_pictures()
    }
}
