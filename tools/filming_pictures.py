"""The pictures of docs/how-to/filming.md, made by ``python -m tools.filming_pictures``."""

from __future__ import annotations

import copy
import sys
from typing import Any

import numpy as np
import pydpend as dp
from pydpend.plots.style import COLORS, new_figure, save, style

from tools.expected import PICTURES

FRAME = 3


def crops() -> None:
    """Four frames of one scene: as it should be, exposed too long, with little light, with a room behind."""
    good: dict[str, Any] = dp.Film("clean").scene
    good["frames"] = 2 * FRAME
    blurred = copy.deepcopy(good)
    blurred["camera"]["exposure_s"] = 1 / good["rate_hz"] * 0.999
    for link in blurred["link"]:
        link["motion"] = {"kind": "rotation", "phi_rad": 1.0, "rate_rad_s": 40.0}
    dark = copy.deepcopy(good)
    for marker in dark["marker"]:
        marker["level"] = 30.0
    dark["camera"]["read_noise"] = 5.0
    bright = copy.deepcopy(good)
    bright["light"]["background"] = 170.0
    for link in bright["link"]:
        link["level"] = 150.0
    shown = {
        "good: dark, sharp, round": good,
        "exposed for a whole frame": blurred,
        "too little light": dark,
        "a bright wall behind": bright,
    }
    with style():
        figure = new_figure(7.6, 2.2)
        for axes, (title, scene) in zip(figure.subplots(1, 4), shown.items(), strict=True):
            axes.imshow(dp.Film(scene).image(FRAME)[190:600, 230:640], cmap="gray", vmin=0, vmax=255)
            axes.set_title(title, fontsize=7.5)
            axes.set_axis_off()
        save(figure, PICTURES / "filming.png")


def rest() -> None:
    """The one rule: the angles of a recording that hangs still at both ends, and what each part gives."""
    t_s = np.arange(0, 8, 0.004)
    moved = dp.simulate(
        dp.derived("A"), dp.Damping(mu_v1=3e-3, mu_v2=6e-4, tau_c1=2.5e-2, tau_c2=3e-3), [1.2, 1.3, 0, 0], t_s
    )
    phi = np.degrees(moved.phi_rad)
    with style():
        figure = new_figure(6.5, 2.4)
        axes = figure.subplots()
        for k in range(2):
            axes.plot(t_s + 2, phi[:, k], color=COLORS[k], label=f"link {k + 1}")
            lifted = phi[0, k] * np.clip((np.linspace(-2, 2, 400) - 0.2) / 1.3, 0, 1) ** 2
            axes.plot(np.linspace(-2, 2, 400), lifted, color=COLORS[k])
        axes.axvspan(-2, 0, color=COLORS[2], alpha=0.25, lw=0)
        axes.axvspan(8, 10, color=COLORS[2], alpha=0.25, lw=0)
        axes.annotate("2 s still:\nthe zero", (-1, 8), ha="center")
        axes.annotate("lifted", (0.5, 50), ha="center")
        axes.annotate("free decay", (4.6, 55), ha="center")
        axes.annotate("still again", (9, 8), ha="center")
        axes.set(xlabel="time, s", ylabel="angle, deg", xlim=(-2, 10))
        axes.legend(loc="upper right")
        save(figure, PICTURES / "rest.png")


if __name__ == "__main__":
    crops()
    rest()
    sys.exit(0)
