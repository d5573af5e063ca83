"""The measured table and chart of docs/how-to/expected.md: films of one drop in other sizes and at other rates.

``python -m tools.expected`` films, tracks and compares with the truth (some minutes), writes ``expected.csv`` and
draws; ``--draw`` draws from the table alone.
"""

from __future__ import annotations

import csv
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pydpend as dp
from pydpend.plots.style import new_figure, save, style

PICTURES = Path(__file__).resolve().parent.parent / "docs" / "pictures"
TABLE = PICTURES / "expected.csv"
WIDTHS_PX = (240, 480, 720)
RATES_HZ = (60, 120, 240, 500, 1000)
LENGTH_S = 2.0
EXPOSURE_S = 1 / 2000
"""A phone's in bright light; a laboratory's lamp allows less."""
SEED = 25
COLUMNS = ("width_px", "rate_hz", "seen_percent", "phi1_deg", "phi2_deg", "w1_rad_s", "w2_rad_s")


def motion(rate_hz: float) -> dp.Simulation:
    """The paper's pendulum let go at 115 and 120 degrees: the lower link swings over once."""
    t_s = np.arange(0, LENGTH_S, 1 / rate_hz)
    return dp.simulate(dp.derived("A"), dp.Damping(mu_v1=1.2e-4, tau_c1=2e-3), [2.0, 2.1, 0, 0], t_s)


def scene(width_px: int, rate_hz: float) -> dict[str, Any]:
    """The preset ``clean`` in another size: the links reach over 0.44 of the picture's width."""
    made: dict[str, Any] = dp.Film("clean").scene
    by = width_px / made["image_px"][0]
    made |= {"image_px": [width_px, width_px], "rate_hz": float(rate_hz), "seed": SEED}
    made["frames"] = round(LENGTH_S * rate_hz)
    made["camera"] |= {"exposure_s": EXPOSURE_S}
    for part in made["link"]:
        part.pop("motion", None)
        part |= {
            "joint_px": [by * x for x in part["joint_px"]],
            "along_px": [by * x for x in part["along_px"]],
        }
        part["width_px"] *= by
    for marker in made["marker"]:
        marker |= {"at_px": [by * x for x in marker["at_px"]], "radius_px": by * marker["radius_px"]}
    return made


def measured(width_px: int, rate_hz: float, folder: Path) -> list[float]:
    """One row of the table; errors are RMS about their mean, which is the zero's."""
    true = motion(rate_hz)
    path = folder / f"{width_px}-{rate_hz}.mp4"
    dp.film(scene(width_px, rate_hz), path, motion=(true.t_s, true.phi_rad))
    try:
        nodes = dp.track(path)
        angles = dp.angles(nodes, zero="vertical")
        states = dp.states(angles)
    except dp.PydpendError as refused:
        print(f"{width_px} px, {rate_hz} Hz: {refused}", file=sys.stderr)
        return [width_px, rate_hz, *[float("nan")] * 5]
    seen = np.isfinite(angles.phi_rad).all(axis=1)
    off = angles.phi_rad - true.phi_rad
    off_deg = np.degrees(np.nanstd(off, axis=0))
    true_w = np.column_stack([np.interp(states.t_s, true.t_s, w) for w in true.w_rad_s.T])
    off_rad_s = np.nanstd(states.w_rad_s - true_w, axis=0)
    return [width_px, rate_hz, 100 * seen.mean(), *off_deg, *off_rad_s]


def rows() -> Iterator[list[float]]:
    """All of them, a film at a time."""
    with tempfile.TemporaryDirectory() as folder:
        for width_px in WIDTHS_PX:
            for rate_hz in RATES_HZ:
                row = measured(width_px, rate_hz, Path(folder))
                print(row, flush=True)
                yield row


def draw() -> None:
    """The chart: error of an angle and of a rate against frames a second, a line a width."""
    with TABLE.open(encoding="utf-8") as f:
        table = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(f)]
    with style():
        figure = new_figure(6.5, 3.0)
        left, right = figure.subplots(1, 2)
        for marker, width_px in zip("os^", WIDTHS_PX, strict=True):
            of = [row for row in table if row["width_px"] == width_px]
            at = [row["rate_hz"] for row in of]
            left.loglog(at, [row["phi2_deg"] for row in of], marker=marker, label=f"{width_px} px")
            right.loglog(at, [row["w2_rad_s"] for row in of], marker=marker, label=f"{width_px} px")
        for axes, what in ((left, "angle of the lower link, deg"), (right, "its rate, rad/s")):
            axes.set(
                xlabel="frames a second",
                ylabel=f"RMS error, {what}",
                xticks=RATES_HZ,
                xticklabels=map(str, RATES_HZ),
            )
            axes.minorticks_off()
        left.legend(title="picture's width")
        save(figure, PICTURES / "expected.svg")


def main() -> int:
    """Measures unless told only to draw."""
    if "--draw" not in sys.argv[1:]:
        with TABLE.open("w", encoding="utf-8", newline="") as f:
            out = csv.writer(f)
            out.writerow(COLUMNS)
            out.writerows([f"{value:.4g}" for value in row] for row in rows())
    draw()
    return 0


if __name__ == "__main__":
    sys.exit(main())
