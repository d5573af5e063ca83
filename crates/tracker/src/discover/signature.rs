//! Compares the columns of the nearest-neighbour matrix, the paper's signatures (Section 8.2).
//!
//! Owns: [`Signatures`]. Must not: know of poses; it compares distances only.
//!
//! A node's signature is the list of its distances to the other nodes of its body, nearest first.

use nalgebra::Vector2;

/// The signatures of one body.
#[derive(Debug, Clone)]
pub struct Signatures {
    /// For each node the others, nearest first, with their distances in px.
    columns: Vec<Vec<(usize, f64)>>,
}

impl Signatures {
    /// From places of the nodes of one body, px.
    pub fn new(places: &[Vector2<f64>]) -> Self {
        let columns = (0..places.len())
            .map(|i| {
                let mut column: Vec<(usize, f64)> = (0..places.len())
                    .filter(|&j| j != i)
                    .map(|j| (j, (places[i] - places[j]).norm()))
                    .collect();
                column.sort_by(|a, b| a.1.total_cmp(&b.1));
                column
            })
            .collect();
        Self { columns }
    }

    /// Pairs of nodes whose whole signatures agree within `reach_px`: with both missing, nothing but motion tells
    /// which has come back.
    pub fn alike(&self, reach_px: f64) -> Vec<(usize, usize)> {
        let mut out = Vec::new();
        for i in 0..self.columns.len() {
            for j in i + 1..self.columns.len() {
                // Distances to each other say nothing of which is which.
                let own = |i: usize, j: usize| -> Vec<f64> {
                    self.columns[i].iter().filter(|c| c.0 != j).map(|c| c.1).collect()
                };
                let (a, b) = (own(i, j), own(j, i));
                if !a.is_empty() && a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= reach_px) {
                    out.push((i, j));
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout() -> Vec<Vector2<f64>> {
        [[0.0, 0.0], [30.0, 5.0], [70.0, -12.0], [110.0, 4.0]].map(Vector2::from).to_vec()
    }

    #[test]
    fn nodes_that_are_mirror_images_are_alike() {
        // Nodes 2 and 3 are mirror images about the line through 0 and 1.
        let places = [[0.0, 0.0], [100.0, 0.0], [40.0, 30.0], [40.0, -30.0]].map(Vector2::from);
        let s = Signatures::new(&places);
        assert_eq!(s.alike(1.0), [(2, 3)]);
        assert!(Signatures::new(&layout()).alike(1.0).is_empty());
    }
}
