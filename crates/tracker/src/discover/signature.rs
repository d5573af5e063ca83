//! The nearest-neighbour matrix and its columns, the paper's signatures (Section 8.2).
//!
//! Owns: [`Signatures`], [`Named`]. Must not: know of poses; it compares distances only.
//!
//! A node's signature is the list of its distances to the other nodes of its body, nearest first. While a node is
//! missing, every reference to it is masked.

use nalgebra::Vector2;

/// The signatures of one body.
#[derive(Debug, Clone)]
pub struct Signatures {
    /// For each node the others, nearest first, with their distances in px.
    columns: Vec<Vec<(usize, f64)>>,
}

/// What a masked comparison says of a detection that appeared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Named {
    /// It is this node.
    Node(usize),
    /// Two missing nodes at least would fit: left open.
    Open,
    /// It is none of the missing nodes.
    None,
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

    /// The nodes of a column, nearest first, those that are missing masked by `None`.
    pub fn masked(&self, node: usize, seen: &[Option<Vector2<f64>>]) -> Vec<Option<usize>> {
        self.columns[node].iter().map(|&(j, _)| seen[j].map(|_| j)).collect()
    }

    /// Compares a detection with the masked signatures of the missing nodes: it is the one whose distances to
    /// the nodes seen it has, each within `reach_px`. At least two nodes must be seen.
    pub fn name(&self, place: Vector2<f64>, seen: &[Option<Vector2<f64>>], reach_px: f64) -> Named {
        let mut fits = None;
        for (node, column) in self.columns.iter().enumerate() {
            if seen[node].is_some() {
                continue;
            }
            let mut compared = 0;
            let agrees = column.iter().all(|&(j, distance)| {
                seen[j].is_none_or(|p| {
                    compared += 1;
                    ((p - place).norm() - distance).abs() <= reach_px
                })
            });
            if agrees && compared >= 2 {
                if fits.is_some() {
                    return Named::Open;
                }
                fits = Some(node);
            }
        }
        fits.map_or(Named::None, Named::Node)
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
    fn a_returning_node_is_named_with_others_masked() {
        let places = layout();
        let s = Signatures::new(&places);
        let mut seen: Vec<_> = places.iter().map(|&p| Some(p)).collect();
        seen[1] = None;
        seen[3] = None;
        assert_eq!(s.masked(0, &seen), [None, Some(2), None]);
        assert_eq!(s.name(Vector2::new(30.1, 5.1), &seen, 0.5), Named::Node(1));
        assert_eq!(s.name(Vector2::new(109.9, 4.0), &seen, 0.5), Named::Node(3));
        assert_eq!(s.name(Vector2::new(50.0, 50.0), &seen, 0.5), Named::None);
    }

    #[test]
    fn a_mirror_image_is_left_open() {
        // Nodes 2 and 3 are mirror images about the line through 0 and 1.
        let places = [[0.0, 0.0], [100.0, 0.0], [40.0, 30.0], [40.0, -30.0]].map(Vector2::from);
        let s = Signatures::new(&places);
        let seen = [Some(places[0]), Some(places[1]), None, None];
        assert_eq!(s.name(places[2], &seen, 0.5), Named::Open);
        assert_eq!(s.alike(1.0), [(2, 3)]);
        assert!(Signatures::new(&layout()).alike(1.0).is_empty());
    }
}
