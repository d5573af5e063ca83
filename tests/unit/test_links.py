"""The programs are linked to what they use: OpenCV's readers of films and pictures bring two hundred libraries."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from pydpend import _native

ROOT = Path(__file__).parent.parent.parent
PROGRAMS = {"tracker": ROOT / "target" / "release" / "tracker", "extension": Path(str(_native.__file__))}


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_is_not_linked_to_the_second_decoder(name: str) -> None:
    listed = subprocess.run(["ldd", PROGRAMS[name]], capture_output=True, text=True, check=True).stdout
    opencv = sorted({line.split()[0].split(".")[0] for line in listed.splitlines() if "libopencv_" in line})
    # Those two that `calib3d` needs come with the three that are used.
    assert opencv == [f"libopencv_{part}" for part in ("calib3d", "core", "features2d", "flann", "imgproc")]
