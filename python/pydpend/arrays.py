"""NumPy's ``.npy`` files, with errors that name the file."""

from __future__ import annotations

import io
import math
import tokenize
from pathlib import Path

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from pydpend.documents import read_bytes
from pydpend.errors import PydpendError, fault

MAGIC = b"\x93NUMPY"

_HEADER_FAULTS = (
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    SyntaxError,
    EOFError,
    MemoryError,
    OverflowError,
    RecursionError,
    tokenize.TokenError,
)
"""Errors that NumPy raises for a header that is damaged: it is a Python literal, a type's name and a shape."""


def read_npy(path: Path, error: type[PydpendError], advice: str) -> NDArray[np.generic]:
    """The array of a ``.npy`` file: of numbers, or of ``datetime64`` and ``timedelta64``.

    Raises ``error`` naming the file if it cannot be read, is damaged or holds something else; ``advice`` says what to
    save instead.
    """
    data = read_bytes(path, error)
    if not data.startswith(MAGIC):
        found = "an .npz archive" if data[:2] == b"PK" else "no NumPy file"
        raise error(fault(str(path), f"it is {found}", advice))
    file = io.BytesIO(data)
    try:
        version = npy.read_magic(file)
        read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
        if read is None:
            raise ValueError(f"format {version[0]}.{version[1]} is not known")
        shape, fortran, dtype = read(file)
        count = math.prod(shape)
        if any(n < 0 for n in shape):
            raise ValueError(f"its shape is {shape}")
    except _HEADER_FAULTS as problem:
        said = " ".join(str(problem).split())[:200]
        raise error(fault(str(path), f"its header is damaged ({said})", "Copy it again")) from problem
    if dtype.kind not in "fiumM" or dtype.hasobject:
        raise error(fault(str(path), f"it is an array of {dtype}, not of numbers", advice))
    there = len(data) - file.tell()
    if there < count * dtype.itemsize:
        lack = f"shape {shape} of {dtype} needs {count * dtype.itemsize} bytes of data, it has {there}"
        raise error(fault(str(path), lack, "It is cut off: copy it again"))
    flat = np.frombuffer(data, dtype=dtype, count=count, offset=file.tell())
    return flat.reshape(shape, order="F" if fortran else "C")
