"""Every public function that computes on threads, called here and then in workers: ``worker_calls.py HERE HOW NAMES``.

``HOW``: threads, fork, spawn, forkserver, executor (of concurrent.futures, forking), nested (a fork of a fork), loky
(joblib's). Prints what the calls gave; ends with an error if workers give anything else.
"""

from __future__ import annotations

import multiprocessing
import sys
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from threading import get_ident

import numpy as np
import pydpend as dp

HERE = Path(sys.argv[1])
DAMPING = dp.Damping(mu_v1=3e-4, mu_v2=1e-4)
TIMES = np.arange(0, 4, 2e-3)


def _own(ending: str) -> Path:
    """A file of this process and thread alone."""
    return HERE / f"{multiprocessing.current_process().pid}-{get_ident()}{ending}"


def _fit() -> float:
    measured = dp.read_angles(HERE / "angles.parquet")
    found = dp.fit_damping(measured, dp.derived("A"), laws="mu_v1,mu_v2", ratios=False)
    return found.coefficients["mu_v1"].value


def _pictures() -> int:
    return len(dp.track(HERE / "pictures", fps=500, progress=False))


def _written() -> int:
    path = _own(".csv")
    dp.read_nodes(HERE / "nodes.parquet").write(path)
    return len(dp.read_nodes(path))


def _drawn() -> int:
    nodes = dp.read_nodes(HERE / "nodes.parquet")
    return len(dp.overlay(HERE / "film.mp4", nodes, _own(".mp4"), progress=False).frame)


def _filmed() -> int:
    return len(dp.film("clean", _own(".avi"), _own(".parquet"), seed=1, frames=6).truth().t_s)


def _plotted() -> int:
    from pydpend.plots.angles import angles_figure
    from pydpend.plots.style import save

    path = _own(".png")
    save(angles_figure(dp.read_angles(HERE / "angles.parquet")), path)
    return int(path.stat().st_size > 0)


def _live() -> int:
    film = dp.Film("clean", seed=1, frames=40)
    tracker = dp.Tracker(dp.read_nodes(HERE / "nodes.parquet").rig)
    return int(np.isfinite(tracker.step(film.image(0)).xy_px).all())


CALLS: dict[str, Callable[[], float]] = {
    "read_nodes": lambda: len(dp.read_nodes(HERE / "nodes.parquet")),
    "write": _written,
    "track": lambda: len(dp.track(HERE / "film.mp4", progress=False)),
    "track_pictures": _pictures,
    "setup": lambda: len(dp.setup(HERE / "film.mp4", progress=False).rig.nodes),
    "overlay": _drawn,
    "info": lambda: dp.info(HERE / "film.mp4")["width"],
    "detect": lambda: len(dp.detect(dp.Film("clean", seed=1, frames=40).image(0))),
    "live": _live,
    "film": _filmed,
    "score": lambda: dp.score(dp.read_nodes(HERE / "nodes.parquet"), HERE / "truth.parquet").rms_px[0],
    "angles": lambda: len(dp.angles(dp.read_nodes(HERE / "nodes.parquet"), zero=[0.0, 0.0], gaps="stop").t_s),
    "read_angles": lambda: len(dp.read_angles(HERE / "angles.parquet").t_s),
    "simulate": lambda: dp.simulate(dp.derived("A"), DAMPING, [1.5, 0.5, 0, 0], TIMES).phi_rad[-1, 0],
    "simulate_many": lambda: dp.simulate_many(
        dp.derived("A"), DAMPING, np.ones((8, 4)), TIMES[:100]
    ).phi_rad.sum(),
    "poincare": lambda: len(dp.poincare(dp.derived("A"), dp.Damping(), [1.5, 0.5, 0, 0], 5.0).t_s),
    "states": lambda: len(dp.states(dp.read_angles(HERE / "angles.parquet")).t_s),
    "fit_damping": _fit,
    "plot": _plotted,
}


def use(name: str) -> float:
    """One call."""
    warnings.simplefilter("ignore")
    return float(CALLS[name]())


def _in_a_fork(names: Sequence[str]) -> list[float]:
    """All calls in a process forked from one forked from this, which has made them too."""
    context = multiprocessing.get_context("fork")
    ends, begins = context.Pipe(False)

    def second() -> None:
        begins.send([use(name) for name in names])

    def first() -> None:
        for name in names:
            use(name)
        inner = context.Process(target=second)
        inner.start()
        inner.join()

    outer = context.Process(target=first)
    outer.start()
    found: list[float] = ends.recv()
    outer.join()
    return found


def in_workers(how: str, names: Sequence[str]) -> list[float]:
    """Each call in a worker made in the way ``how``."""
    if how == "threads":
        with ThreadPoolExecutor(2) as threads:
            return list(threads.map(use, names))
    if how == "executor":
        with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("fork")) as processes:
            return list(processes.map(use, names))
    if how == "nested":
        return _in_a_fork(names)
    if how == "loky":
        from joblib import Parallel, delayed

        return list(Parallel(n_jobs=2)(delayed(use)(name) for name in names))
    with multiprocessing.get_context(how).Pool(2) as pool:
        return pool.map(use, names, chunksize=1)


if __name__ == "__main__":
    wanted = sys.argv[3].split(",") if len(sys.argv) > 3 else list(CALLS)
    here = [use(name) for name in wanted]
    there = in_workers(sys.argv[2], wanted)
    print(dict(zip(wanted, here, strict=True)))
    if there != here:
        sys.exit(f"workers gave {there}")
