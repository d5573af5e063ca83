//! Tells packed files and archives by what they begin with, and the command that unpacks each.
//!
//! Owns: [`is_packed`], [`first_part`], [`unpacking`]. Must not: unpack.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::name::{shell_word, text};

/// Command that unpacks a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Command {
    /// A program that writes the one packed file to its output.
    Stream(&'static str),
    /// A command that unpacks all files of an archive.
    Archive(&'static str),
}

/// A form of packed files: what stands where in its first bytes, the ending of its name, how it is unpacked.
struct Form {
    place: usize,
    magic: &'static [u8],
    ending: &'static str,
    command: Command,
}

const fn form(place: usize, magic: &'static [u8], ending: &'static str, command: Command) -> Form {
    Form { place, magic, ending, command }
}

const FORMS: [Form; 9] = [
    form(0, b"\x1f\x8b", "gz", Command::Stream("gzip -dc")),
    form(0, b"BZh", "bz2", Command::Stream("bzip2 -dc")),
    form(0, b"\xfd7zXZ\0", "xz", Command::Stream("xz -dc")),
    form(0, b"\x28\xb5\x2f\xfd", "zst", Command::Stream("zstd -dc")),
    form(0, b"\x04\x22\x4d\x18", "lz4", Command::Stream("lz4 -dc")),
    form(0, b"PK\x03\x04", "zip", Command::Archive("unzip")),
    form(0, b"7z\xbc\xaf\x27\x1c", "7z", Command::Archive("7z x")),
    form(0, b"Rar!\x1a\x07", "rar", Command::Archive("unrar x")),
    form(257, b"ustar", "tar", Command::Archive("tar -xf")),
];

/// Bytes that tell all forms.
const BEGINNING: u64 = 512;

fn form_of(bytes: &[u8]) -> Option<&'static Form> {
    FORMS.iter().find(|f| bytes.get(f.place..).is_some_and(|b| b.starts_with(f.magic)))
}

/// Whether a file that begins with these bytes is packed. A zip may be a document or a table of a program's own: that is
/// what it is then.
pub fn is_packed(bytes: &[u8]) -> bool {
    form_of(bytes).is_some_and(|f| f.ending != "zip" || !is_document(bytes))
}

/// The name of a zip's first part; empty for what is no zip.
pub fn first_part(bytes: &[u8]) -> &[u8] {
    /// Bytes before the name in a part's header, and where in it the name's length is.
    const HEADER: usize = 30;
    const LENGTH: usize = 26;
    if !bytes.starts_with(b"PK\x03\x04") {
        return &[];
    }
    let length = bytes.get(LENGTH..LENGTH + 2).map_or(0, |b| usize::from(u16::from_le_bytes([b[0], b[1]])));
    bytes.get(HEADER..HEADER + length).unwrap_or_default()
}

/// Whether a zip is a document or a table of a program's own, by the name of its first part.
fn is_document(zip: &[u8]) -> bool {
    let name = first_part(zip);
    let parts: [&[u8]; 7] =
        [b"[Content_Types].xml", b"mimetype", b"_rels/", b"docProps/", b"xl/", b"Index/", b"META-INF/"];
    parts.iter().any(|p| name.starts_with(p)) || name.ends_with(b".npy")
}

/// The command of a shell that unpacks a file; `None` for one that is not packed.
pub fn unpacking(path: &Path) -> Option<String> {
    let mut bytes = Vec::new();
    File::open(path).ok()?.take(BEGINNING).read_to_end(&mut bytes).ok()?;
    let form = form_of(&bytes)?;
    let file = shell_word(&text(path));
    Some(match form.command {
        Command::Archive(command) => format!("{command} {file}"),
        Command::Stream(command) => {
            let has_ending = path.extension().is_some_and(|e| e.eq_ignore_ascii_case(form.ending));
            let out = if has_ending {
                path.with_extension("")
            } else {
                let mut name = path.file_stem().unwrap_or_default().to_owned();
                name.push("-unpacked");
                if let Some(ending) = path.extension() {
                    name.push(".");
                    name.push(ending);
                }
                path.with_file_name(name)
            };
            format!("{command} {file} > {}", shell_word(&text(out)))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_form_is_unpacked_by_its_own_program() {
        let folder = tempfile::tempdir().unwrap();
        let said = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let place = format!("{}/", folder.path().display());
            unpacking(&path).map(|words| words.replace(&place, ""))
        };
        let zip = [&b"PK\x03\x04"[..], &[0; 22], &[8, 0, 0, 0], b"drop.mp4"].concat();
        let tar = [&[b'a'; 257][..], b"ustar\0"].concat();
        for (name, bytes, words) in [
            ("drop.mp4.gz", &b"\x1f\x8b\x08...."[..], "gzip -dc drop.mp4.gz > drop.mp4"),
            ("drop.mp4", b"\x1f\x8b\x08....", "gzip -dc drop.mp4 > drop-unpacked.mp4"),
            ("a b.csv.bz2", b"BZh91AY&SY", "bzip2 -dc 'a b.csv.bz2' > 'a b.csv'"),
            ("drop.csv.xz", b"\xfd7zXZ\0....", "xz -dc drop.csv.xz > drop.csv"),
            ("drop.ZST", b"\x28\xb5\x2f\xfd....", "zstd -dc drop.ZST > drop"),
            ("drop.lz4", b"\x04\x22\x4d\x18....", "lz4 -dc drop.lz4 > drop"),
            ("drop.zip", &zip, "unzip drop.zip"),
            ("drop.7z", b"7z\xbc\xaf\x27\x1c..", "7z x drop.7z"),
            ("drop.rar", b"Rar!\x1a\x07..", "unrar x drop.rar"),
            ("drop.tar", &tar, "tar -xf drop.tar"),
        ] {
            assert!(is_packed(bytes), "{name}");
            assert_eq!(said(name, bytes).unwrap().replace("''", ""), words, "{name}");
        }
        assert_eq!(said("a.csv", b"time_s,phi1_rad\n"), None);
        let sheet = [&b"PK\x03\x04"[..], &[0; 22], &[8, 0, 0, 0], b"mimetype"].concat();
        assert!(!is_packed(&sheet));
    }
}
