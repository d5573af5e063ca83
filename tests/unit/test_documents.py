"""JSON, TOML and NumPy files that are not what they should be: one line with the file, the place, what was expected."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydpend.analyse import read_config
from pydpend.arrays import read_npy
from pydpend.documents import read_json, read_toml
from pydpend.encoder import read_calibration, read_encoder
from pydpend.errors import EncoderError, PydpendError
from pydpend.fit_folder import load_fit
from pydpend.kinematics import read_angles
from pydpend.model import read_model

DEEP = 5000
DIGITS = "9" * 5000

JSON: dict[str, tuple[str | bytes, str]] = {
    "cut off": ('{"a": [1,', r"a.json, line 1, column \d+: is not JSON"),
    "a list": ("[1]", r"a.json: a table is expected, the JSON is a list"),
    "null": ("null", r"the JSON is null"),
    "empty": ("", r"line 1, column 1: is not JSON"),
    "deep": ("[" * DEEP, r"a.json: its tables and lists stand more than 100 deep"),
    "deep and whole": ('{"a":' + "[" * 200 + "]" * 200 + "}", r"more than 100 deep"),
    "a huge number": (f'{{"a": {DIGITS}}}', r"a.json: a number in it has thousands of digits"),
    "not UTF-8": (b'{"a":\n "\xff"}', r"a.json, line 2, byte 8: is not text in UTF-8"),
    "cut UTF-16": (b"\xff\xfe{", r"a.json, line 1, byte 2: is not text in UTF-8"),
}


@pytest.mark.parametrize("kind", JSON)
@pytest.mark.parametrize("reader", [read_calibration, load_fit, lambda p: read_json(p, EncoderError)])
def test_json_that_is_none(tmp_path: Path, kind: str, reader: Callable[[Path], Any]) -> None:
    data, message = JSON[kind]
    path = tmp_path / "a.json"
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    with pytest.raises(PydpendError, match=message) as caught:
        reader(path)
    assert "\n" not in str(caught.value)


TOML: dict[str, tuple[str | bytes | None, str]] = {
    "cut off": ("a = [1,\n", r"a.toml, end of document: is not TOML \(invalid value\)"),
    "a line without a key": ("g_m_s2 = 9.81\n= 3\n", r"a.toml, line 2, column 1: is not TOML"),
    "deep": ("a = " + "[" * DEEP, r"more than 100 deep"),
    "a huge number": (f"a = {DIGITS}", r"a number in it has thousands of digits"),
    "not UTF-8": (b"# m\xfcller\n", r"a.toml, line 1, byte 3: is not text in UTF-8"),
    "a folder": (None, r"a.toml: the file cannot be read"),
}


@pytest.mark.parametrize("kind", TOML)
@pytest.mark.parametrize("reader", [read_model, read_config])
def test_toml_that_is_none(tmp_path: Path, kind: str, reader: Callable[[Path], Any]) -> None:
    data, message = TOML[kind]
    path = tmp_path / "a.toml"
    if data is None:
        path.mkdir()
    else:
        path.write_bytes(data.encode() if isinstance(data, str) else data)
    with pytest.raises(PydpendError, match=message) as caught:
        reader(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_and_other_line_ends_do_no_harm(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "m.toml"
    path.write_bytes('name = "bar"\r\n[constants]\rpsi_kg_m2 = 1e-3\nsigma_j = 0.1\n'.encode(encoding))
    assert read_model(path).psi_kg_m2 == 1e-3
    path.write_bytes("threads = 1\r\n".encode(encoding))
    assert read_config(path).threads == 1


MODELS = {
    "one [part]": (
        "l1_mm = 200\n[part]\nbody = 1\n",
        r"key part: it is one table \[part\] .* Write \[\[part\]\]",
    ),
    "one [bearing]": (
        "l1_mm = 200\n[bearing]\nat = 'pivot'\n[[part]]\nbody = 1\nmass_g = 1\n",
        r"Write \[\[bearing\]\]",
    ),
    "parts in words": ("part = ['a']\n", r"key part\[0\]: a table is expected, not 'a'"),
    "constants in a list": ("constants = [1]\n", r"key constants: a table is expected"),
    "a number beyond all": ("[constants]\npsi_kg_m2 = 1" + "0" * 400 + "\n", r"psi_kg_m2 is 1"),
    "a number whose square is": ("[constants]\npsi_kg_m2 = 1e200\nsigma_j = 1\n", r"psi_kg_m2 is 1e\+200"),
    "gravity of dates": (
        "g_m_s2 = 2024-05-01\n[constants]\npsi_kg_m2 = 1\nsigma_j = 1\n",
        r"g_m_s2 is datetime",
    ),
}


@pytest.mark.parametrize("kind", MODELS)
def test_models_that_are_none(tmp_path: Path, kind: str) -> None:
    text, message = MODELS[kind]
    path = tmp_path / "m.toml"
    path.write_text(text)
    with pytest.raises(PydpendError, match=message) as caught:
        read_model(path)
    assert "\n" not in str(caught.value)


CONFIGS = {
    "threads = 'two'": "key threads: a whole number",
    "threads = 1" + "0" * 30: "key threads: a whole number",
    "threads = 1.5": "key threads: a whole number",
    "fps = nan": "key fps: a finite number is expected",
    "fps = true": "key fps: a number is expected, not True",
    "inputs = 'a.mp4'": "key inputs: a list of texts is expected",
    "inputs = [1]": r"key inputs\[0\]: text is expected, not 1",
    "unknown = 1": "key unknown: unknown is not an option. Known are inputs",
}


@pytest.mark.parametrize("text", CONFIGS)
def test_configs_that_are_none(tmp_path: Path, text: str) -> None:
    path = tmp_path / "c.toml"
    path.write_text(text)
    with pytest.raises(PydpendError, match=CONFIGS[text]):
        read_config(path)


def npy(header: str, data: bytes = bytes(64), version: bytes = b"\1\0") -> bytes:
    text = header.encode("latin-1") + b"\n"
    return b"\x93NUMPY" + version + len(text).to_bytes(2, "little") + text + data


HEADER = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 4), }"
SHORT = HEADER.replace("(2, 4)", "(2, 400000000000000000000)")
ARRAYS: dict[str, tuple[bytes, str]] = {
    "no header": (b"\x93NUMPY", "its header is damaged"),
    "cut header": (npy(HEADER)[:30], "its header is damaged"),
    "a word in it": (npy(HEADER.replace("False", "Falze")), "its header is damaged"),
    "an open bracket": (npy(HEADER.replace("(2, 4)", "(2, 4")), "its header is damaged"),
    "deep": (npy("(" * 3000), "its header is damaged"),
    "no shape": (npy(HEADER.replace("shape", "shqpe")), "its header is damaged"),
    "no such type": (npy(HEADER.replace("<f8", "<q9")), "its header is damaged"),
    "a negative shape": (npy(HEADER.replace("(2, 4)", "(-2, -4)")), "its header is damaged"),
    "a huge shape": (npy(SHORT), r"needs 640{20} bytes of data, it has 64"),
    "cut data": (npy(HEADER, bytes(63)), r"shape \(2, 4\) of float64 needs 64 bytes of data, it has 63"),
    "a newer format": (npy(HEADER, version=b"\7\0"), "its header is damaged"),
    "objects": (npy(HEADER.replace("<f8", "|O")), "array of object, not of numbers"),
    "text": (npy(HEADER.replace("<f8", "<U2")), "not of numbers"),
    "three dimensions": (npy(HEADER.replace("(2, 4)", "(2, 2, 2)")), r"\(2, 2, 2\)"),
    "an archive": (b"PK\3\4" + bytes(60), "npz archive|a packed file"),
}  # fmt: skip


@pytest.mark.parametrize("kind", ARRAYS)
def test_arrays_that_are_none(tmp_path: Path, kind: str) -> None:
    data, message = ARRAYS[kind]
    (tmp_path / "DPmean_data_RB0.npy").write_bytes(data)
    with pytest.raises(PydpendError, match=message.split("|")[0]) as caught:
        read_angles(tmp_path)
    assert "\n" not in str(caught.value)
    with pytest.raises(PydpendError, match=message.split("|")[-1]) as caught:
        read_encoder(tmp_path / "DPmean_data_RB0.npy")
    assert "\n" not in str(caught.value)


def test_arrays_that_are_arrays(tmp_path: Path) -> None:
    for made in (
        np.arange(8.0).reshape(2, 4),
        np.asfortranarray(np.arange(8).reshape(2, 4)),
        np.zeros((2, 0)),
    ):
        np.save(tmp_path / "a.npy", made)
        found = read_npy(tmp_path / "a.npy", EncoderError, "")
        assert found.dtype == made.dtype
        assert np.array_equal(found, made)


def test_a_calibration_says_which_value_is_wrong(tmp_path: Path) -> None:
    value: dict[str, Any] = {
        "schema": 1,
        "offset_v": 5.0,
        "slope_v_per_rad": 0.1,
        "covariance": [[1, 0], [0, 1]],
    }
    value |= {"dof": 0, "holds": [], "linearity": 0.0, "noise_v": 1e-3, "spec_v": 1e-3, "noisy_holds": []}
    value |= {"range_v": [0, 10], "wraps": False, "notes": []}
    path = tmp_path / "c.json"
    path.write_text(json.dumps(value))
    assert read_calibration(path).offset_v == 5.0
    odd: dict[str, tuple[Any, str]] = {
        "offset_v": ("5,0", "key offset_v: a number is expected, not '5,0'"),
        "slope_v_per_rad": (0.0, "key slope_v_per_rad: no calibration has this value"),
        "covariance": ([[1, 0], [0]], r"key covariance\[1\]: a list of 2 is expected"),
        "dof": (10**30, "key dof: a whole number"),
        "holds": ([3], r"key holds\[0\]: a table is expected, not 3"),
        "noise_v": (float("nan"), "key noise_v: a finite number"),
        "range_v": ([10, 0], "key range_v: no calibration"),
        "wraps": (1, "key wraps: true or false is expected, not 1"),
    }
    for key, (wrong, message) in odd.items():
        path.write_text(json.dumps(value | {key: wrong}))
        with pytest.raises(EncoderError, match=message):
            read_calibration(path)


def test_documents_are_closed_to_what_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(
        EncoderError, match=r"none.toml: the file cannot be read \(No such file or directory\)"
    ):
        read_toml(tmp_path / "none.toml", EncoderError)
