//! Shows the detections of a store in the plane in which bodies are rigid.
//!
//! Owns: [`PlaneView`]. Must not: keep detections.

use super::detection_store::DetectionStore;
use super::stamp::FrameStamp;
use crate::camera::{Camera, Plane};
use crate::detect::Detection;

/// A store as it looks without its camera's tilt and lens.
#[derive(Debug, Clone, Copy)]
pub struct PlaneView<'a> {
    store: &'a DetectionStore,
    plane: Plane,
}

impl<'a> PlaneView<'a> {
    /// A view of detections in the plane that a camera has filmed; without a camera the plane is faced squarely.
    pub fn new(store: &'a DetectionStore, camera: Option<Camera>) -> Self {
        Self { store, plane: Plane { pixel_aspect: store.pixel_aspect(), camera } }
    }

    /// The plane.
    pub fn plane(&self) -> Plane {
        self.plane
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.store.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.store.is_empty()
    }

    /// Stamp of the `i`-th frame.
    pub fn stamp(&self, i: usize) -> FrameStamp {
        self.store.stamp(i)
    }

    /// Copies the detections of the `i`-th frame into `out`, cleared first, in the plane's pixels. See
    /// [`DetectionStore::check`].
    pub fn read(&self, i: usize, out: &mut Vec<Detection>) {
        self.store.read(i, out);
        if self.plane.camera.is_some() {
            out.iter_mut().for_each(|d| *d = d.to_plane(&self.plane));
        }
    }
}
