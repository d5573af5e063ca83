//! Checks the sums that a PNG picture carries of its parts: whole pictures of wrong pixels would be made of what is damaged.
//!
//! Owns: [`check`]. Must not: decode. PNG (ISO/IEC 15948), 5.3.

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Whether all parts of a PNG picture up to its end are as their sums say; what is no PNG is not doubted. An error is a clause.
pub(super) fn check(bytes: &[u8]) -> Result<(), String> {
    let Some(mut rest) = bytes.strip_prefix(SIGNATURE) else { return Ok(()) };
    while let Some((length, behind)) = rest.split_first_chunk() {
        let length = u32::from_be_bytes(*length) as usize;
        let Some((part, sum)) = behind.split_at_checked(length + 4) else { break };
        let Some((sum, next)) = sum.split_first_chunk() else { break };
        if crc32fast::hash(part) != u32::from_be_bytes(*sum) {
            return Err("its data are not what their check sum says".to_owned());
        }
        if part.starts_with(b"IEND") {
            return Ok(());
        }
        rest = next;
    }
    Err("it is cut".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_changed_byte_behind_the_signature_is_seen() {
        let mut png = SIGNATURE.to_vec();
        for part in [&b"IHDR\0\0\0\x01"[..], b"IDATdata", b"IEND"] {
            png.extend((part.len() as u32 - 4).to_be_bytes());
            png.extend(part);
            png.extend(crc32fast::hash(part).to_be_bytes());
        }
        assert_eq!(check(&png), Ok(()));
        for at in SIGNATURE.len()..png.len() {
            let mut bad = png.clone();
            bad[at] ^= 4;
            assert!(check(&bad).is_err(), "byte {at}");
            assert!(check(&png[..at]).is_err(), "cut at {at}");
        }
        assert_eq!(check(b"BM"), Ok(()));
    }
}
