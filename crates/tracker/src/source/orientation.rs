//! Turns and mirrors pictures as a recording says before they are looked at.
//!
//! Owns: [`Orientation`]. Must not: know where a recording says it.

use crate::message::Message;

/// Turn that shows a picture as it was filmed: first transposed, then mirrored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Orientation {
    /// Rows become columns.
    pub transposed: bool,
    /// Left and right are exchanged, after that.
    pub mirrored_x: bool,
    /// Top and bottom are exchanged, after that.
    pub mirrored_y: bool,
}

impl Orientation {
    /// From the first two columns of a display matrix, row by row: a point (x, y) is shown at
    /// (a x + c y, b x + d y). `None` for turns that are not by a right angle.
    pub(crate) fn from_matrix(a: i32, b: i32, c: i32, d: i32) -> Option<Self> {
        match (a, b, c, d) {
            (a, 0, 0, d) if a != 0 && d != 0 => {
                Some(Self { transposed: false, mirrored_x: a < 0, mirrored_y: d < 0 })
            }
            (0, b, c, 0) if b != 0 && c != 0 => {
                Some(Self { transposed: true, mirrored_x: c < 0, mirrored_y: b < 0 })
            }
            _ => None,
        }
    }

    /// From the number that EXIF and TIFF give, 1 to 8; `None` for all others, which no viewer heeds.
    pub(crate) fn from_tag(number: u32) -> Option<Self> {
        let of = |transposed, mirrored_x, mirrored_y| Some(Self { transposed, mirrored_x, mirrored_y });
        match number {
            1 => of(false, false, false),
            2 => of(false, true, false),
            3 => of(false, true, true),
            4 => of(false, false, true),
            5 => of(true, false, false),
            6 => of(true, true, false),
            7 => of(true, true, true),
            8 => of(true, false, true),
            _ => None,
        }
    }

    /// In words, also where nothing is turned.
    pub(crate) fn words_or_none(self) -> &'static str {
        self.words().unwrap_or("not turned")
    }

    /// The warning of turned pictures, if they are turned.
    pub(crate) fn warning(self) -> Option<Message> {
        self.words().map(|words| format!("turned as the file says: {words}").into())
    }

    /// Width and height after turning.
    pub(crate) fn size(self, width: u32, height: u32) -> (u32, u32) {
        if self.transposed { (height, width) } else { (width, height) }
    }

    /// In words, clockwise; `None` if nothing is turned.
    fn words(self) -> Option<&'static str> {
        match (self.transposed, self.mirrored_x, self.mirrored_y) {
            (false, false, false) => None,
            (false, true, true) => Some("180 degrees"),
            (true, true, false) => Some("90 degrees clockwise"),
            (true, false, true) => Some("90 degrees counter-clockwise"),
            (false, true, false) => Some("mirrored left to right"),
            (false, false, true) => Some("mirrored top to bottom"),
            (true, false, false) => Some("mirrored at its diagonal"),
            (true, true, true) => Some("mirrored at its other diagonal"),
        }
    }

    /// The turned samples and their row length in pixels.
    pub(crate) fn apply(
        self,
        samples: Vec<u8>,
        width: usize,
        height: usize,
        bytes: usize,
    ) -> (Vec<u8>, usize) {
        if self == Self::default() {
            return (samples, width);
        }
        let (w, h) = if self.transposed { (height, width) } else { (width, height) };
        let mut turned = vec![0u8; samples.len()];
        for y in 0..h {
            let v = if self.mirrored_y { h - 1 - y } else { y };
            for x in 0..w {
                let u = if self.mirrored_x { w - 1 - x } else { x };
                let from = if self.transposed { (u * width + v) * bytes } else { (v * width + u) * bytes };
                let to = (y * w + x) * bytes;
                turned[to..to + bytes].copy_from_slice(&samples[from..from + bytes]);
            }
        }
        (turned, w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_move_every_pixel_to_its_place() {
        // 1 2 3
        // 4 5 6
        let picture = vec![1, 2, 3, 4, 5, 6];
        let turn = |transposed, mirrored_x, mirrored_y| {
            Orientation { transposed, mirrored_x, mirrored_y }.apply(picture.clone(), 3, 2, 1)
        };
        assert_eq!(turn(false, true, true), (vec![6, 5, 4, 3, 2, 1], 3));
        assert_eq!(turn(true, true, false), (vec![4, 1, 5, 2, 6, 3], 2), "clockwise");
        assert_eq!(turn(true, false, true), (vec![3, 6, 2, 5, 1, 4], 2), "counter-clockwise");
        assert_eq!(turn(true, false, false), (vec![1, 4, 2, 5, 3, 6], 2));
    }

    #[test]
    fn the_numbers_of_exif_are_those_of_its_figure() {
        // Where the standard says that the first row and the first column of the stored picture are seen.
        let corners = [
            (1, "12 34"),
            (2, "21 43"),
            (3, "43 21"),
            (4, "34 12"),
            (5, "13 24"),
            (6, "31 42"),
            (7, "42 31"),
            (8, "24 13"),
        ];
        for (number, seen) in corners {
            let (turned, _) = Orientation::from_tag(number).unwrap().apply(b"1234".to_vec(), 2, 2, 1);
            let seen: Vec<u8> = seen.bytes().filter(|b| *b != b' ').collect();
            assert_eq!(turned, seen, "{number}");
        }
        assert!([0, 9, 65535].iter().all(|n| Orientation::from_tag(*n).is_none()));
    }
}
