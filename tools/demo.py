"""The demo: the bundled film to a report, and every result beside its truth. Run by `make demo`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from pydpend.analyse import Options, analyse
from pydpend.angles import read_angles
from pydpend.filming import read_truth

ROOT = Path(__file__).resolve().parent.parent
DEMO = ROOT / "fixtures" / "demo"
OUT = ROOT / "out" / "demo"
