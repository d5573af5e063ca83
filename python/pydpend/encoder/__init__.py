"""The encoder beside the video: reading, calibration, clocks and comparison.

``signal``, ``tdms``: files. ``holds``, ``calibration``: holds to a line. ``convert``: volts to angles.
``sync``: clocks. ``compare``: the comparison.
"""

from __future__ import annotations

from pydpend.encoder.calibration import (
    Calibration,
    calibrate,
    read_calibration,
)
from pydpend.encoder.comparison import Comparison, compare
from pydpend.encoder.convert import encoder_angles
from pydpend.encoder.holds import Hold, hold_of, read_holds
from pydpend.encoder.signal import EncoderSignal, read_encoder
from pydpend.encoder.sync import Synchronisation, synchronise

__all__ = [
    "Calibration",
    "Comparison",
    "EncoderSignal",
    "Hold",
    "Synchronisation",
    "calibrate",
    "compare",
    "encoder_angles",
    "hold_of",
    "read_calibration",
    "read_encoder",
    "read_holds",
    "synchronise",
]
