//! Refuses a lens in a program that was built without the feature `opencv`.

use super::detection::Detection;
use crate::error::{Error, Fault, Result};
use crate::rig::Lens;

/// The correction for a lens: there is none.
#[derive(Debug)]
pub(crate) enum Undistort {}

impl Undistort {
    pub fn new(_: &Lens) -> Result<Self> {
        Err(Error::Detect(Fault::without("opencv", "lens", "centres are not corrected for a lens")))
    }

    pub fn apply(&mut self, _: &mut [Detection]) -> Result<()> {
        match *self {}
    }
}
