//! Reads what an OME-TIFF says of its pictures, which may lie in several files (OME-XML, 2016-06, `Pixels` and `TiffData`).
//!
//! Owns: [`Ome`]. Must not: open other files.

use std::io::{Read, Seek};

use tiff::decoder::Decoder;
use tiff::tags::Tag;

use super::tiff_layout::Layout;

/// Names of other files that a message lists at most.
const MOST_NAMED: usize = 3;

/// The description in the first page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Ome {
    /// Pictures of the whole recording; `None` where the description is in another file.
    pub pictures: Option<u64>,
    /// Warnings: of an order that is not simply that of moments, of a description in another file.
    pub warnings: Vec<String>,
    /// Other files in which some of the pictures are.
    elsewhere: Vec<String>,
}

impl Ome {
    /// The description of the page at which a decoder stands; `None` if it has none.
    pub fn of<R: Read + Seek>(decoder: &mut Decoder<R>, layout: &Layout) -> Option<Self> {
        let text = decoder.get_tag_ascii_string(Tag::ImageDescription).ok()?;
        Self::read(&text, u64::from(layout.samples).max(1))
    }

    /// The description in `text`, of pictures with `samples` for each pixel.
    fn read(text: &str, samples: u64) -> Option<Self> {
        let text = without_comments(text);
        let all: Vec<Element> = elements(&text).collect();
        let own = all.iter().find(|e| e.name == "OME")?.value("UUID");
        if let Some(other) = all.iter().find(|e| e.name == "BinaryOnly") {
            let file = other.value("MetadataFile").unwrap_or("another file");
            let warning = format!(
                "its OME description is in {file}, which is not read: whether pictures lack is not known"
            );
            return Some(Self { pictures: None, warnings: vec![warning], elsewhere: Vec::new() });
        }
        let mut found = Self { pictures: Some(0), warnings: Vec::new(), elsewhere: Vec::new() };
        for pixels in all.iter().filter(|e| e.name == "Pixels") {
            let size = |key: &str| pixels.value(key)?.parse::<u64>().ok();
            let [all_samples, slices, moments] = [size("SizeC")?, size("SizeZ")?, size("SizeT")?];
            // The colours of a pixel count as channels there.
            let channels = (all_samples / samples).max(1);
            let pictures = channels.checked_mul(slices)?.checked_mul(moments)?;
            found.pictures = found.pictures.and_then(|n| n.checked_add(pictures));
            if channels > 1 || slices > 1 && moments > 1 {
                found.warnings.push(format!(
                    "OME says {channels} channels, {slices} slices and {moments} moments: its pages are read as frames, in \
                     the file's order. Save one channel and slice as a stack of its own"
                ));
            }
        }
        let others = all.iter().filter(|e| e.name == "UUID" && (own.is_none() || Some(e.text.trim()) != own));
        for name in others.filter_map(|e| e.value("FileName")) {
            if !found.elsewhere.iter().any(|known| known == name) {
                found.elsewhere.push(name.to_owned());
            }
        }
        Some(found)
    }

    /// Where the pictures are that the file lacks, a clause to add; empty where nothing tells. `file` is its own name.
    pub fn elsewhere(&self, file: &str) -> String {
        let others: Vec<&str> = self.elsewhere.iter().map(String::as_str).filter(|n| *n != file).collect();
        if others.is_empty() {
            return String::new();
        }
        let more = if others.len() > MOST_NAMED { " and others" } else { "" };
        format!("; by that some are in {}{more}", others[..others.len().min(MOST_NAMED)].join(", "))
    }
}

/// An element's beginning and the text after it.
struct Element<'a> {
    /// Without the name space.
    name: &'a str,
    inside: &'a str,
    text: &'a str,
}

impl<'a> Element<'a> {
    /// The value of an attribute.
    fn value(&self, key: &str) -> Option<&'a str> {
        let mut rest = self.inside;
        loop {
            let (before, after) = rest.split_once('=')?;
            let after = after.trim_start();
            let quote = after.chars().next().filter(|c| ['"', '\''].contains(c))?;
            let (value, next) = after[1..].split_once(quote)?;
            if before.trim() == key {
                return Some(value);
            }
            rest = next;
        }
    }
}

/// A text without its comments.
fn without_comments(text: &str) -> String {
    let mut parts = text.split("<!--");
    let first = parts.next().unwrap_or_default().to_owned();
    first + &parts.filter_map(|part| Some(part.split_once("-->")?.1)).collect::<String>()
}

/// The elements that begin in a text, in order.
fn elements(text: &str) -> impl Iterator<Item = Element<'_>> {
    text.split('<').skip(1).filter(|part| !part.starts_with(['/', '?', '!'])).filter_map(|part| {
        let (tag, text) = part.split_once('>')?;
        let tag = tag.trim_end_matches('/');
        let (name, inside) = tag.split_once(char::is_whitespace).unwrap_or((tag, ""));
        let name = name.rsplit(':').next()?;
        Some(Element { name, inside, text })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_all_images_are_counted_and_other_files_named() {
        let text = r#"<?xml version="1.0"?><!-- <Pixels SizeC="9"/> --><ome:OME xmlns:ome='a' UUID="urn:1"><ome:Image
            Name="a=b"><ome:Pixels ID='Pixels:0' SizeC = "3" SizeT="4" SizeX="8" SizeZ="1"><TiffData><UUID
            FileName="own.ome.tif">urn:1</UUID></TiffData><TiffData><UUID FileName='b.ome.tif'>urn:2</UUID></TiffData>
            <UUID FileName="b.ome.tif">urn:2</UUID></ome:Pixels></ome:Image><Pixels SizeC="1" SizeZ="2" SizeT="1"/></ome:OME>"#;
        let ome = Ome::read(text, 3).unwrap();
        assert_eq!((ome.pictures, ome.warnings.len()), (Some(6), 0));
        assert_eq!(ome.elsewhere("renamed.tif"), "; by that some are in b.ome.tif");
        let ome = Ome::read(text, 1).unwrap();
        assert_eq!((ome.pictures, ome.warnings.len()), (Some(14), 1));
        let ome =
            Ome::read(r#"<OME><BinaryOnly MetadataFile="a.companion.ome" UUID="urn:1"/></OME>"#, 1).unwrap();
        assert!(ome.pictures.is_none() && ome.warnings[0].contains("a.companion.ome"));
        assert_eq!(Ome::read("ImageJ=1.54f", 1), None);
        assert_eq!(Ome::read("<OME><Pixels SizeC=", 1).unwrap().pictures, Some(0));
    }
}
