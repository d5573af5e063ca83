//! Takes NumPy images as frames.
//!
//! Owns: what an image may be: (H, W), uint8 or uint16, any strides. A frame owns its bytes, so they are copied once.

use numpy::{PyArray2, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use tracker::frame::{Frame, PixelFormat};

use crate::errors::argument;

/// An image as a frame. `depth_bits` are the significant bits of a sample; `None` is all of them.
pub fn frame_of(
    image: &Bound<'_, PyAny>,
    name: &str,
    index: u64,
    ticks: i64,
    depth_bits: Option<u32>,
) -> PyResult<Frame> {
    let py = image.py();
    let advice = "Give a two-dimensional array (H, W) of uint8 or uint16";
    let Ok(array) = image.cast::<PyUntypedArray>() else {
        let found = image.get_type().name()?;
        return Err(argument(py, name, format!("it is a {found}, not a NumPy array"), advice));
    };
    if array.ndim() != 2 {
        return Err(argument(py, name, format!("its shape is {:?}", array.shape()), advice));
    }
    let &[height, width] = array.shape() else {
        return Err(argument(py, name, "it has no height and width", advice));
    };
    if height == 0 || width == 0 || height > 1 << 16 || width > 1 << 16 {
        return Err(argument(py, name, format!("its shape is {height} x {width}"), advice));
    }
    let (bytes, bits, format) = if let Ok(array) = image.cast::<PyArray2<u8>>() {
        let array = array.readonly();
        (array.as_array().iter().copied().collect::<Vec<u8>>(), 8, PixelFormat::Gray8)
    } else if let Ok(array) = image.cast::<PyArray2<u16>>() {
        let array = array.readonly();
        let bytes = array.as_array().iter().flat_map(|v| v.to_le_bytes()).collect();
        (bytes, 16, PixelFormat::Gray16)
    } else {
        return Err(argument(py, name, format!("its type is {}", array.dtype().str()?), advice));
    };
    let depth_bits = depth_bits.unwrap_or(bits);
    if depth_bits == 0 || depth_bits > bits {
        let problem = format!("{depth_bits} bits do not fit a sample of {bits}");
        return Err(argument(
            py,
            "depth_bits",
            problem,
            "Give the significant bits of a sample, for example 12",
        ));
    }
    Ok(Frame {
        index,
        ticks,
        width: width as u32,
        height: height as u32,
        stride: width * bits as usize / 8,
        format,
        depth_bits,
        plane: Some(Box::new(bytes)),
        colour: None,
    })
}
