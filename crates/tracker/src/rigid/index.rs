//! Indexes one frame's detections by place (k-d tree): which are nearest to a place.
//!
//! Owns: [`DetectionIndex`]. It is a k-d tree (kiddo's immutable one, which takes any number of equal coordinates).

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::Vector2;

use crate::detect::{Detection, Flags};

/// Spatial index (k-d tree) over one frame's detections.
pub struct DetectionIndex<'a> {
    detections: &'a [Detection],
    tree: Option<ImmutableKdTree<f64, 2>>,
    widest_px: f64,
}

impl<'a> DetectionIndex<'a> {
    /// Number of detections below which a straight search beats building a tree.
    const STRAIGHT: usize = 24;

    /// The detections as they are; those with a place that is not finite are never found.
    pub fn new(detections: &'a [Detection]) -> Self {
        let tree = if detections.len() > Self::STRAIGHT {
            // A place that is not finite is moved to where nobody asks.
            let points: Vec<[f64; 2]> =
                detections
                    .iter()
                    .map(|d| {
                        if d.x_px.is_finite() && d.y_px.is_finite() { [d.x_px, d.y_px] } else { [-1e9, -1e9] }
                    })
                    .collect();
            ImmutableKdTree::new_from_slice(&points).ok()
        } else {
            None
        };
        let widest_px = detections.iter().map(|d| f64::from(d.sigma_px)).fold(0.0, f64::max);
        Self { detections, tree, widest_px }
    }

    /// Number of detections.
    pub fn len(&self) -> usize {
        self.detections.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.detections.is_empty()
    }

    /// A detection.
    pub fn get(&self, i: usize) -> &Detection {
        &self.detections[i]
    }

    /// The greatest standard uncertainty among them, px.
    pub fn widest_px(&self) -> f64 {
        self.widest_px
    }

    /// A detection's centre, px.
    pub fn place(&self, i: usize) -> Vector2<f64> {
        Vector2::new(self.detections[i].x_px, self.detections[i].y_px)
    }

    /// Whether a detection is the whole of one marker, as far as its picture tells.
    pub fn whole(&self, i: usize) -> bool {
        !self.detections[i].flags.has(Flags::MERGED | Flags::PARTIAL | Flags::BORDER)
    }

    /// Whether a detection is one marker that the image's border does not cut, though something else may.
    pub fn single(&self, i: usize) -> bool {
        !self.detections[i].flags.has(Flags::MERGED | Flags::BORDER)
    }

    /// The nearest detection within `radius_px` of `place`, and its distance in px.
    pub fn nearest(&self, place: Vector2<f64>, radius_px: f64) -> Option<(usize, f64)> {
        if let Some(tree) = &self.tree {
            if !(place.x.is_finite() && place.y.is_finite()) {
                return None;
            }
            let found = tree.query(&[place.x, place.y]).nearest_one::<SquaredEuclidean<f64>>().execute();
            let distance = found.distance.sqrt();
            return (distance <= radius_px).then_some((found.item as usize, distance));
        }
        let mut best: Option<(usize, f64)> = None;
        for i in 0..self.len() {
            let distance = (self.place(i) - place).norm();
            if distance <= radius_px && best.is_none_or(|(_, d)| distance < d) {
                best = Some((i, distance));
            }
        }
        best
    }

    /// All detections within `radius_px` of `place`, by their index.
    pub fn within(&self, place: Vector2<f64>, radius_px: f64, out: &mut Vec<usize>) {
        out.clear();
        if let Some(tree) = &self.tree {
            if !(place.x.is_finite() && place.y.is_finite() && radius_px.is_finite()) {
                return;
            }
            let found = tree
                .query(&[place.x, place.y])
                .within::<SquaredEuclidean<f64>>(radius_px * radius_px)
                .execute();
            out.extend(found.iter().map(|f| f.item as usize));
            out.sort_unstable();
            return;
        }
        out.extend((0..self.len()).filter(|&i| (self.place(i) - place).norm() <= radius_px));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x_px: f64, y_px: f64) -> Detection {
        Detection { x_px, y_px, sigma_px: 0.1, ..Default::default() }
    }

    #[test]
    fn tree_and_straight_search_agree_also_on_one_line() {
        // 60 points of which 40 share one coordinate: the case that breaks mutable trees.
        let many: Vec<Detection> = (0..60)
            .map(|i| if i < 40 { at(7.0, f64::from(i)) } else { at(f64::from(i * 13 % 50), f64::from(i)) })
            .collect();
        let tree = DetectionIndex::new(&many);
        let straight = DetectionIndex { detections: &many, tree: None, widest_px: 0.1 };
        for i in 0..200 {
            let place = Vector2::new(f64::from(i * 17 % 53) + 0.3, f64::from(i * 29 % 61) + 0.1);
            assert_eq!(tree.nearest(place, 9.0), straight.nearest(place, 9.0));
            let (mut a, mut b) = (vec![], vec![]);
            tree.within(place, 11.0, &mut a);
            straight.within(place, 11.0, &mut b);
            assert_eq!(a, b);
        }
    }
}
