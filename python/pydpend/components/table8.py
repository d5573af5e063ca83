"""Table 8 as data (units g, mm; configuration A), the assumed places it lacks, and the symbols of Section 8.1."""

from __future__ import annotations

from pydpend.components.quantity import Quantity

# symbol | description | instrument | method | value | sigma | unit
_TABLE_8 = """
m_2  | flexible coupling mass     | SP601 balance | manufacturer's data | 22.3 | 0.1 | g
m_31 | bearing inner race mass    | SP601 balance | manufacturer's data | 2.9 | 0.1 | g
m_32 | bearing ball spacer mass   | SP601 balance | manufacturer's data | 0.2 | 0.1 | g
m_33 | bearing ball mass          | SP601 balance | manufacturer's data | 0.3 | 0.1 | g
m_4  | upper shaft mass           | SP601 balance | calculation | 30 | 0.5 | g
m_5  | upper arm mass, each of two | calculation  | calculation | 132 | 2 | g
m_6  | lower shaft mass           | SP601 balance | calculation | 3.8 | 0.2 | g
m_7  | dowel pin mass             | McMaster      | calculation | 2.7 | 0.2 | g
m_81 | bearing inner race mass    | SP601 balance | manufacturer's data | 2.9 | 0.1 | g
m_82 | bearing ball spacer mass   | SP601 balance | manufacturer's data | 0.2 | 0.1 | g
m_83 | bearing ball mass          | SP601 balance | manufacturer's data | 0.3 | 0.1 | g
m_84 | bearing outer race mass    | SP601 balance | manufacturer's data | 6.5 | 0.1 | g
m_9  | lower arm mass             | calculation   | calculation | 116 | 2 | g
m_10 | upper tracker mass         | SP601 balance | calculation | 0.2 | 0.1 | g
m_11 | lower tracker mass         | SP601 balance | calculation | 0.3 | 0.1 | g
m_12 | upper arm tape mass        | SP601 balance | calculation | 0.7 | 0.1 | g
m_13 | lower arm tape mass        | SP601 balance | calculation | 0.6 | 0.1 | g
r_4  | pivot to set screw         | calculation   | calculation | 4.0 | 0.5 | mm
l_u  | pivot to elbow             | calipers and calculation | calculation | 171.9 | 0.3 | mm
r_5  | pivot to upper arm centre  | calipers and calculation | calculation | 86.0 | 0.2 | mm
r_9  | elbow to lower arm centre  | calipers and calculation | calculation | 71.5 | 0.4 | mm
I_1  | encoder inertia            | manufacturer's data | manufacturer's data | 2000 | 200 | g mm2
I_2  | flexible coupling inertia  | Solidworks    | calculation | 1100 | 5 | g mm2
I_31 | inner race inertia         | Solidworks    | uncertainty negligible | 103 | 0 | g mm2
I_32 | ball spacer inertia        | calculation   | uncertainty negligible (yet printed) | 40 | 20 | g mm2
I_33 | bearing ball inertia       | Solidworks    | uncertainty negligible | 0.4 | 0 | g mm2
I_4  | upper shaft inertia        | calculation   | uncertainty negligible (yet printed) | 242 | 4 | g mm2
I_5  | upper arm inertia          | calculation   | calculation | 470000 | 9000 | g mm2
I_6  | lower shaft inertia        | calculation   | calculation | 12 | 1 | g mm2
I_7  | dowel pin inertia          | calculation   | calculation | 61 | 2 | g mm2
I_81 | inner race inertia         | Solidworks    | uncertainty negligible | 103 | 0 | g mm2
I_82 | ball spacer inertia        | calculation   | uncertainty negligible | 2.5 | 0 | g mm2
I_83 | bearing ball inertia       | Solidworks    | uncertainty negligible | 0.4 | 0 | g mm2
I_84 | outer race inertia         | Solidworks    | uncertainty negligible | 544 | 0 | g mm2
I_9  | lower arm inertia          | calculation   | calculation | 245000 | 5000 | g mm2
I_10 | upper tracker inertia      | Solidworks    | calculation | 4 | 1 | g mm2
I_11 | lower tracker inertia      | Solidworks    | calculation | 9 | 1 | g mm2
I_12 | upper arm tape inertia     | Solidworks    | calculation | 2500 | 200 | g mm2
I_13 | lower arm tape inertia     | Solidworks    | calculation | 1300 | 200 | g mm2
d_I  | inner race diameter        | calipers      | calculation | 11.062 | 0.002 | mm
d_B  | bearing ball diameter      | calipers      | calculation | 3.932 | 0.002 | mm
"""

# Table 8 has no places for items 10 to 13; these are assumptions, to be replaced by anyone's measured ones.
_ASSUMED = """
r_10 | pivot to upper trackers, mean     | none | assumed: centre of the upper arm | 86.0 | 0 | mm
r_11 | elbow to lower trackers, mean     | none | assumed: centre of the lower arm | 71.5 | 0 | mm
r_11_rms | elbow to lower trackers, RMS  | none | assumed: spread over the lower arm | 90.0 | 0 | mm
r_12 | pivot to upper tape centre        | none | assumed: centre of the upper arm | 86.0 | 0 | mm
r_13 | elbow to lower tape centre        | none | assumed: centre of the lower arm | 71.5 | 0 | mm
"""

# Configuration B: the paper lists expressions (Section 8.1) but prints no value.
_SECTION_8_1 = """
m_1  | upper arm mass | g
I_1  | upper arm inertia | g mm2
r_1  | pivot to upper arm centre | mm
I_21 | upper bearing outer race inertia | g mm2
I_22 | upper bearing spacer inertia | g mm2
m_23 | upper bearing ball mass | g
I_23 | upper bearing ball inertia | g mm2
m_3  | lower screw mass | g
I_3  | lower screw inertia | g mm2
m_4  | lower hex nut mass | g
I_4  | lower hex nut inertia | g mm2
m_5  | lower small spacer mass | g
I_5  | lower small spacer inertia | g mm2
m_6  | lower large spacer mass | g
I_6  | lower large spacer inertia | g mm2
m_71 | lower bearing inner race mass | g
I_71 | lower bearing inner race inertia | g mm2
m_72 | lower bearing spacer mass | g
I_72 | lower bearing spacer inertia | g mm2
m_73 | lower bearing ball mass | g
I_73 | lower bearing ball inertia | g mm2
m_74 | lower bearing outer race mass | g
I_74 | lower bearing outer race inertia | g mm2
m_8  | lower arm mass | g
I_8  | lower arm inertia | g mm2
r_8  | elbow to lower arm centre | mm
l_u  | pivot to elbow | mm
d_I  | inner race diameter | mm
d_B  | ball diameter | mm
"""


def _rows(text: str, source: str) -> dict[str, Quantity]:
    out = {}
    for line in text.strip().splitlines():
        symbol, description, instrument, method, value, sigma, unit = (c.strip() for c in line.split("|"))
        out[symbol] = Quantity(
            symbol, description, float(value), float(sigma), unit, instrument, method, source
        )
    return out


def _unvalued(text: str, source: str) -> dict[str, Quantity]:
    out = {}
    for line in text.strip().splitlines():
        symbol, description, unit = (c.strip() for c in line.split("|"))
        out[symbol] = Quantity(symbol, description, None, 0.0, unit, "none", "not published", source)
    return out


def table_8() -> dict[str, Quantity]:
    """Table 8 of the paper, by symbol (the encoder's mass, printed as not applicable, is not there)."""
    return _rows(_TABLE_8, "paper Table 8")


def assumed_places() -> dict[str, Quantity]:
    """Places of trackers and tape, which no table gives (erratum 4): assumptions, marked so."""
    return _rows(_ASSUMED, "assumed (erratum 4)")


def section_8_1() -> dict[str, Quantity]:
    """The quantities of configuration B: symbols and units, no values (the paper prints none)."""
    return _unvalued(_SECTION_8_1, "paper Section 8.1")


IDENTICAL = (("m_31", "m_81"), ("m_32", "m_82"), ("m_33", "m_83"))
"""Symbols of Table 8 for one and the same part, weighed once: fully correlated."""
