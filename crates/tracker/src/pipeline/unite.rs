//! Unites columns of what moves that the user says are one marker.
//!
//! Owns: `Moving::unite`. Must not: find out which are.

use super::moving_nodes::Moving;
use crate::error::{Error, Fault, Place, Result};
use crate::message::Setting;

impl Moving {
    /// Makes one column of each two that are one marker; the first name stays.
    ///
    /// # Errors
    /// [`Error::Argument`] for a name that is none, and where both are seen in one frame at two places.
    pub fn unite(&mut self, same: &[[String; 2]]) -> Result<()> {
        for pair in same {
            let column = |name: &String| {
                self.names.iter().position(|n| n == name).ok_or_else(|| {
                    Error::Argument(
                        Fault::of(Setting::Same, format!("{name} is no node of what is followed"))
                            .advice(format!("Its nodes are {}", self.names.join(", "))),
                    )
                })
            };
            let (a, b) = (column(&pair[0])?, column(&pair[1])?);
            if a == b {
                continue;
            }
            let near_px = self.markers[a].radius_px * self.scale;
            for (stamp, row) in self.stamps.iter().zip(&mut self.rows) {
                let apart = (row[a].x_px - row[b].x_px).hypot(row[a].y_px - row[b].y_px);
                if apart > near_px {
                    return Err(Error::Argument(
                        Fault::of(
                            Setting::Same,
                            format!("{} and {} are both seen, {apart:.0} px apart", pair[0], pair[1]),
                        )
                        .at(Place::Frame(stamp.index))
                        .advice("Give two that are never seen together"),
                    ));
                }
                if !row[a].status.is_seen() && row[b].status.is_seen() {
                    row[a] = row[b];
                }
                row.remove(b);
            }
            self.names.remove(b);
            self.markers.remove(b);
        }
        Ok(())
    }
}
