"""The demo: the bundled film to a report, and every result beside its truth. Run by `make demo`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from pydpend.analyse import Options, analyse
from pydpend.cli.analyse import teller
from pydpend.kinematics import read_angles

ROOT = Path(__file__).resolve().parent.parent
DEMO = ROOT / "fixtures" / "demo"
OUT = ROOT / "out" / "demo"


def rows() -> list[tuple[str, str, str]]:
    """Each result as (name, found, truth)."""
    truth = json.loads((DEMO / "truth.json").read_text("utf-8"))
    motion = pq.read_table(DEMO / "motion.parquet")
    true_phi = np.column_stack([motion["phi1_rad"].to_numpy(), motion["phi2_rad"].to_numpy()])
    angles = read_angles(OUT / "drop" / "angles.parquet")
    # Whole turns common to a recording are a choice of the first frame, not a measurement.
    error = angles.phi_rad - true_phi[: angles.t_s.size]
    error -= 2 * np.pi * np.round(np.nanmedian(error, axis=0) / (2 * np.pi))
    rms = np.degrees(np.sqrt(np.nanmean(error**2, axis=0)))
    found = [(f"RMS error of phi{k + 1} (deg)", f"{rms[k]:.4f}", "0") for k in range(2)]

    comparison = json.loads((OUT / "drop" / "comparison.json").read_text("utf-8"))
    clocks, encoder = comparison["clocks"], truth["encoder"]
    line = json.loads((OUT / "drop" / "encoder.json").read_text("utf-8"))
    per_turn = 2 * np.pi
    found += [
        (
            "film time less encoder time (ms)",
            f"{1e3 * clocks['offset_s']:.3f} +- {1e3 * clocks['offset_sigma_s']:.3f}",
            f"{-1e3 * encoder['clock_offset_s']:.3f}",
        ),
        (
            "encoder (V per turn)",
            f"{line['slope_v_per_rad'] * per_turn:.5f}",
            f"{encoder['slope_v_per_rad'] * per_turn:.5f}",
        ),
        ("gain of film over encoder", f"{comparison['gain']:.5f} +- {comparison['gain_sigma']:.5f}", "1"),
    ]

    linkage = json.loads((OUT / "drop" / "angles.json").read_text("utf-8"))["linkage"]
    scale, sigma = linkage["scale_m_per_px"], linkage["scale_sigma_m_per_px"]
    found.append(
        ("scale (px per m)", f"{1 / scale:.3f} +- {sigma / scale**2:.3f}", f"{truth['px_per_m']:.3f}")
    )
    fit = json.loads((OUT / "fit" / "fit.json").read_text("utf-8"))
    for name, c in fit["coefficients"].items():
        found.append(
            (
                f"{name} ({c['unit']})",
                f"{c['value']:.3e} +- {c['sigma']:.1e}",
                f"{truth['damping'].get(name, 0.0):.3e}",
            )
        )
    return found


def main() -> int:
    """Runs the demo."""
    options = Options(
        inputs=(str(DEMO / "drop.mp4"),),
        encoder=str(DEMO / "encoder.csv"),
        calibration=str(DEMO / "calibration"),
        zero=str(DEMO / "hanging.mp4"),
        link_length_m=0.1719,
        # A clamp lets go at 0.2 s, cleaner than a hand does: less of the start need be left out than by itself.
        start_s=0.6,
    )
    outcome = analyse(options, OUT, teller())
    table = rows()
    width = [max(len(r[i]) for r in [*table, ("result", "found", "truth")]) for i in range(3)]
    for r in [("result", "found", "truth"), *table]:
        print(f"{r[0]:<{width[0]}}  {r[1]:>{width[1]}}  {r[2]:>{width[2]}}")
    print(
        f"\nLook at {outcome.folder / 'report.html'}, or for a picture at {outcome.folder / 'fit' / 'energy.png'}"
    )
    return 0 if outcome.status == "done" else 1


if __name__ == "__main__":
    sys.exit(main())
