//! TIFF files that hold fewer pictures than OME-XML declares, and whose first page is no measure of the others.

use tracker::frame::Ending;
use tracker::source::{OpenOptions, open};

use crate::film::{read_all, samples};
use crate::tiffs::Values::{Short, Text};
use crate::tiffs::{H, Tiff, W, packed, read, tags, values, with};

#[test]
fn pictures_that_ome_declares_and_the_file_lacks_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a_0.ome.tif");
    let whole = |k: usize| packed(&values(k, 8), 8, false);
    let ome = |size_t: usize, blocks: &str| {
        let text = format!(
            "<?xml version=\"1.0\"?><OME UUID=\"urn:1\"><Image><Pixels SizeC=\"1\" SizeT=\"{size_t}\" SizeZ=\"1\">\
             {blocks}</Pixels></Image></OME>"
        );
        with(tags(8, 1, 1), vec![(270, Text(text))])
    };
    let in_other = "<TiffData><UUID FileName=\"a_1.ome.tif\">urn:2</UUID></TiffData>";
    for (pages, declared, blocks) in
        [(1, 12, ""), (1, 12, in_other), (4, 12, in_other), (3, 3, ""), (1, 1, "")]
    {
        let mut tiff = Tiff::new(false).page(ome(declared, blocks), &whole(0), W * H);
        for k in 1..pages {
            tiff = tiff.page(tags(8, 1, 1), &whole(k), W * H);
        }
        std::fs::write(&path, &tiff.bytes).unwrap();
        let (_, frames, ending, _) = read(&path);
        assert_eq!(frames.len(), pages);
        assert!(frames.iter().enumerate().all(|(k, f)| *f == values(k, 8)));
        if pages == declared {
            assert_eq!(ending, Ending::Complete);
            continue;
        }
        let Ending::Early { reason, .. } = ending else { panic!("{pages} of {declared}: complete") };
        assert!(reason.contains(&format!("after {pages} of 12 pictures")), "{reason}");
        assert_eq!(reason.contains("in a_1.ome.tif"), !blocks.is_empty(), "{reason}");
    }
    // The description in another file.
    let text = "<OME><BinaryOnly MetadataFile=\"a.companion.ome\" UUID=\"urn:1\"/></OME>".to_owned();
    let tiff = Tiff::new(false).page(with(tags(8, 1, 1), vec![(270, Text(text))]), &whole(0), W * H);
    std::fs::write(&path, &tiff.bytes).unwrap();
    let (_, _, _, said) = read(&path);
    assert!(said.iter().any(|w| w.contains("a.companion.ome")), "{said:?}");
}

#[test]
fn a_first_page_of_another_size_is_no_measure_of_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.tif");
    let small =
        || with(tags(8, 1, 1), vec![(256, Short(vec![4])), (257, Short(vec![2])), (278, Short(vec![2]))]);
    let mut tiff = Tiff::new(false).page(small(), &[9; 8], 8);
    for k in 0..3 {
        tiff = tiff.page(tags(8, 1, 1), &packed(&values(k, 8), 8, false), W * H);
    }
    std::fs::write(&path, &tiff.bytes).unwrap();
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    let info = source.info().clone();
    assert_eq!((info.width, info.height), (W as u32, H as u32));
    assert!(
        info.warnings.iter().any(|w| w.to_string().contains("frame 0: the page is 4 x 2 px, the others are"))
    );
    let frames = read_all(&mut *source);
    let seen: Vec<_> = frames.iter().map(samples).collect();
    assert_eq!(seen, [None, Some(values(0, 8)), Some(values(1, 8)), Some(values(2, 8))]);
    assert_eq!(source.reasons().len(), 1);
    // Of two pages neither is the odd one.
    let tiff = Tiff::new(false).page(small(), &[9; 8], 8);
    let tiff = tiff.page(tags(8, 1, 1), &packed(&values(0, 8), 8, false), W * H);
    std::fs::write(&path, &tiff.bytes).unwrap();
    let mut source = open(path.to_str().unwrap(), &OpenOptions::default()).unwrap();
    assert_eq!((source.info().width, read_all(&mut *source).len()), (4, 2));
}
