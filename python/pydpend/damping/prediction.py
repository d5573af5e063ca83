"""Prediction of a recording from a fit that has not seen it: the number a user can trust.

In a window only the initial state is fitted (and the recording's two angle zeros, common to all windows). A
forecast fits the state to the past alone and looks ahead; while the lower link tumbles that is chaos,
whatever the model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from pydpend.damping import shooting
from pydpend.damping.fitted_recording import Window
from pydpend.damping.maps import Maps, corrected
from pydpend.damping.recording import Recording
from pydpend.damping.result import DampingFit
from pydpend.damping.shooting import Segments, Track
from pydpend.documents import Table
from pydpend.errors import PREDICT, FitError, Setting, fault
from pydpend.json_text import JsonResult, plain
from pydpend.tabular import TableResult

Floats = NDArray[np.float64]

WINDOWS_S = (0.5, 1.0, 2.0)
PIECE_S = 0.25
"""Pieces a window is shot over before it becomes one motion."""
PAST_S = 0.5
"""Length of the past a forecast's state is fitted to."""
NO_SLACK = 1e-3
"""Slack inside a window, relative to a segment's own state: so small that a window is one motion."""
LOOSE = 5.0
"""Slack of the first, loose fit in the same unit."""
HELD_OUT = 0.3
"""Last part of a single recording that is left out of a fit and predicted."""


def slashed(values: Sequence[float]) -> str:
    """One number per link: ``0.105/0.139``."""
    return "/".join(f"{v:.3f}" for v in values)


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(JsonResult, TableResult):
    """The errors with which a fit predicts one recording that it has not seen.

    In a window only the initial state is fitted; a forecast fits the state to the past half second alone and looks
    ahead.

    Attributes
    ----------
    name : str
        Name of the recording.
    in_window : dict of str to pydpend.damping.Window
        Errors in windows, by their length in s.
    forecast : dict of str to pydpend.damping.Window
        Errors of forecasts, by how far ahead in s.
    calm : dict of str to pydpend.damping.Window
        The forecasts after the lower link has stopped tumbling.
    zeros_rad : tuple of float
        Zeros of the recording's two angles that were found, rad.
    rows : dict of str to ndarray of float, each of shape (n, 3)
        By window length in s: start time (s) and the two root mean squares (deg) of each window.
    message : str
        Free decay and errors in words.
    """

    _error: ClassVar = FitError
    _source: ClassVar = "predict.json"
    _advice: ClassVar = "Give the predict.json that " + PREDICT + " wrote"

    name: str
    in_window: dict[str, Window]
    forecast: dict[str, Window]
    calm: dict[str, Window]
    zeros_rad: tuple[float, float]
    rows: dict[str, Floats]
    message: str

    def __repr__(self) -> str:
        """A line for people."""
        errors = ", ".join(f"{slashed(w.rms_deg)} deg in {k} s" for k, w in self.in_window.items())
        return f"<Prediction {self.name}: RMS {errors}>"

    def to_dict(self) -> dict[str, Any]:
        """The prediction as plain values: ``predict.json``.

        Returns
        -------
        dict
            Numbers, texts, lists and tables.
        """

        def group(windows: Mapping[str, Window]) -> dict[str, Any]:
            return {k: w.to_dict() for k, w in windows.items()}

        out: dict[str, Any] = {
            "name": self.name,
            "in_window": group(self.in_window),
            "forecast": group(self.forecast),
            "forecast_calm": group(self.calm),
            "zeros_deg": [float(np.degrees(z)) for z in self.zeros_rad],
            "zeros_rad": list(self.zeros_rad),
            "windows": {k: plain(rows) for k, rows in self.rows.items()},
            "message": self.message,
        }
        return out

    @classmethod
    def of_table(cls, table: Table) -> Prediction:
        """The prediction from a ``predict.json`` that is read already.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_json` gave.

        Returns
        -------
        Prediction
            The prediction.

        Raises
        ------
        FitError
            Naming the key that is missing or not what it must be.
        """

        def group(key: str) -> dict[str, Window]:
            given = table.table(key)
            return {window: Window.of_table(given.table(window)) for window in given}

        rows = {length: _rows_of(table.table("windows"), length) for length in table.table("windows")}
        upper, lower = table.array("zeros_rad", 2).tolist()
        return cls(
            table.text("name"),
            group("in_window"),
            group("forecast"),
            group("forecast_calm"),
            (upper, lower),
            rows,
            table.text("message"),
        )

    def to_columns(self) -> dict[str, Floats]:
        """The windows as columns of a table: ``windows.csv``.

        Returns
        -------
        dict of str to ndarray, each of shape (n,)
            ``window_s`` and ``start_s`` of each window, and the root mean square of each link (``phi1_rms_deg``).
        """
        found = [(float(window), *row) for window, rows in self.rows.items() for row in rows]
        links = next((rows.shape[1] - 1 for rows in self.rows.values()), 2)
        table = np.array(found, dtype=np.float64).reshape(-1, 2 + links)
        names = ("window_s", "start_s", "phi1_rms_deg", "phi2_rms_deg")[: 2 + links]
        return dict(zip(names, table.T, strict=True))


def _rows_of(windows: Table, length: str) -> Floats:
    """The windows of one length, (n, 1 + links), checked."""
    rows = windows.array(length, -1, -1)
    try:
        known = float(length) > 0
    except ValueError:
        known = False
    if not known:
        windows.refuse(length, f"{length!r} is no length of a window in s")
    if rows.size and rows.shape[1] not in (2, 3):
        windows.refuse(length, "a start and the error of one link or two are expected in each row")
    return rows


def predict(
    recording: Recording,
    parameters: dict[str, float],
    windows_s: Sequence[float] = WINDOWS_S,
    maps: Maps | None = None,
    *,
    forecasts: bool = True,
) -> Prediction:
    """Predicts a recording with given parameters of the motion. Raises FitError when no window fits into it."""
    track = recording.track if maps is None else corrected([recording.track], maps)[0]
    base = shooting.cut([track], [recording.span], PIECE_S)
    if len(base) == 0:
        raise FitError(
            fault(recording.angles.name, "no segment has enough samples", "Give angles with fewer gaps")
        )
    # Zeros and smooth states first, with loose joints: no window starts from a bad state.
    loose = shooting.solve(
        [track], base, parameters, np.zeros((1, 2)), slack=LOOSE, learned=False, max_iterations=30
    )
    base, zeros = loose.segments, loose.zeros_rad
    in_window: dict[str, Window] = {}
    rows: dict[str, Floats] = {}
    for window in windows_s:
        size = max(1, round(window / PIECE_S))
        errors, start = _windows(track, base, parameters, zeros, size)
        if start.size:
            in_window[f"{window:g}"] = _summary(errors)
            rows[f"{window:g}"] = np.column_stack([start, errors.rms])
    if not in_window:
        raise FitError(
            fault(
                recording.angles.name,
                f"no window of {min(windows_s):g} s fits into the free decay without a gap",
                "Ask for shorter windows",
            )
        )
    forecast: dict[str, Window] = {}
    calm: dict[str, Window] = {}
    if forecasts:
        after = _tumbling_stops(recording)
        for window in windows_s:
            errors, start = _forecast(track, base, parameters, zeros, window)
            if start.size:
                forecast[f"{window:g}"] = _summary(errors)
                late = start >= after
                if late.any():
                    calm[f"{window:g}"] = _summary(errors.take(late))
    taken_off = np.pad(recording.taken_off_rad, (0, 2 - recording.angles.links))
    words = ", ".join(f"{k} s: {slashed(w.rms_deg)} deg" for k, w in in_window.items())
    return Prediction(
        recording.angles.name,
        in_window,
        forecast,
        calm,
        (float(zeros[0, 0] + taken_off[0]), float(zeros[0, 1] + taken_off[1])),
        rows,
        f"{recording.decay.message}; RMS in windows {words}",
    )


def initial_state(track: Track, parameters: dict[str, float], start_s: float, length_s: float) -> Floats:
    """State (phi1, phi2, w1, w2) at ``start_s`` from which one motion fits the ``length_s`` that follow best.

    Raises FitError where they have a gap.
    """
    base = shooting.cut([track], [(start_s, start_s + length_s)], PIECE_S)
    size = max(1, len(base))
    chain = base.grouped(size)
    if (
        len(chain) == 0
        or chain.times_s[0, 0] > start_s + 1e-9
        or chain.times_s[-1, 1] < start_s + 0.5 * length_s
    ):
        raise FitError(
            fault(
                Setting("start_s"), f"{length_s:g} s from {start_s:g} s on have a gap", "Choose another start"
            )
        )
    loose = shooting.solve([track], chain, parameters, np.zeros((1, 2)), slack=LOOSE, learned=False)
    tied = shooting.solve(
        [track],
        loose.segments,
        parameters,
        loose.zeros_rad,
        zeros=False,
        slack=NO_SLACK,
        learned=False,
        huber=1e3,
    )
    state: Floats = tied.segments.merged(size).states[0]
    return state


@dataclass(frozen=True, eq=False)
class _Errors:
    """Squared errors per window, deg^2, and counts, (n, 2)."""

    squares: Floats
    counts: Floats

    @property
    def rms(self) -> Floats:
        out: Floats = np.sqrt(self.squares / np.maximum(self.counts, 1))
        return out

    def take(self, keep: NDArray[np.bool_]) -> _Errors:
        return _Errors(self.squares[keep], self.counts[keep])


def _summary(errors: _Errors) -> Window:
    total = np.sqrt(errors.squares.sum(axis=0) / np.maximum(errors.counts.sum(axis=0), 1))
    middle = np.median(errors.rms, axis=0)
    return Window(tuple(total.tolist()), tuple(middle.tolist()), len(errors.counts))


def _errors(
    track: Track,
    segments: Segments,
    parameters: dict[str, float],
    zeros: Floats,
    label: NDArray[np.int64],
    count: int,
    since: Floats | None = None,
) -> _Errors:
    """Squared errors of each window.

    ``label`` says which window a segment belongs to; ``since`` leaves out samples before that time of each segment.
    """
    path = shooting.trace([track], segments, parameters)
    r = np.degrees(shooting.residuals([track], path, zeros))
    window = label[path.segment]
    if since is not None:
        r[track[0][path.sample] < since[path.segment]] = np.nan
    squares, counts = np.zeros((count, r.shape[1])), np.zeros((count, r.shape[1]))
    for j in range(r.shape[1]):
        good = np.isfinite(r[:, j])
        squares[:, j] = np.bincount(window[good], r[good, j] ** 2, count)
        counts[:, j] = np.bincount(window[good], minlength=count)
    return _Errors(squares, counts)


def _none(track: Track) -> tuple[_Errors, Floats]:
    empty = np.zeros((0, track[1].shape[1]))
    return _Errors(empty, empty), np.zeros(0)


def _windows(
    track: Track, base: Segments, parameters: dict[str, float], zeros: Floats, size: int
) -> tuple[_Errors, Floats]:
    """Errors in windows of ``size`` segments with the initial state fitted in each."""
    chains = base.grouped(size)
    if len(chains) == 0:
        return _none(track)
    # Staged: the pieces are tied ever more tightly, then each window is one motion from one state.
    solution = shooting.solve(
        [track], chains, parameters, zeros, slack=NO_SLACK, learned=False, max_iterations=40, huber=1e3
    )
    whole = solution.segments.merged(size)
    count = len(whole)
    errors = _errors(track, whole, parameters, solution.zeros_rad, np.arange(count), count)
    return errors, whole.times_s[:, 0]


def _forecast(
    track: Track, base: Segments, parameters: dict[str, float], zeros: Floats, ahead_s: float
) -> tuple[_Errors, Floats]:
    """Errors from the end of each stretch of the past to ``ahead_s`` later; zeros are given."""
    size = max(1, round(PAST_S / PIECE_S))
    chains = base.grouped(size)
    if len(chains) == 0:
        return _none(track)
    past = shooting.solve(
        [track],
        chains,
        parameters,
        zeros,
        zeros=False,
        slack=NO_SLACK,
        learned=False,
        max_iterations=40,
        huber=1e3,
    )
    whole = past.segments.merged(size)
    now = whole.times_s[:, 1]
    inside = now + ahead_s <= base.times_s[-1, 1] + 1e-9
    rows, times = whole.rows[inside].copy(), whole.times_s[inside].copy()
    times[:, 1] += ahead_s
    rows[:, 2] = np.searchsorted(track[0], times[:, 1])
    future = Segments(rows, times, whole.states[inside])
    count = len(future)
    errors = _errors(track, future, parameters, zeros, np.arange(count), count, since=now[inside])
    seen = errors.counts.min(axis=1) > 0
    return errors.take(seen), now[inside][seen]


def _tumbling_stops(recording: Recording) -> float:
    """The time at which the lower link has passed the top for the last time, s."""
    t, phi = recording.angles.t_s, recording.angles.phi_rad[:, -1]
    here = (t >= recording.span[0]) & (t <= recording.span[1]) & np.isfinite(phi)
    turns = np.floor((phi[here] + np.pi) / (2 * np.pi))
    passed = np.flatnonzero(np.diff(turns))
    return float(t[here][passed[-1] + 1]) if passed.size else recording.span[0]


def split(recordings: Sequence[Recording]) -> tuple[list[Recording], Recording]:
    """Splits recordings into a part to fit and one to predict: the last recording, or the last part of the only one.

    Raises FitError when it is too short for that.
    """
    if len(recordings) > 1:
        return list(recordings[:-1]), recordings[-1]
    only = recordings[0]
    edge = only.span[1] - HELD_OUT * (only.span[1] - only.span[0])
    if edge - only.span[0] < 2.0 or only.span[1] - edge < 1.0:
        raise FitError(
            fault(only.angles.name, "too short to leave a part out for prediction", "Record longer than 4 s")
        )
    early = replace(only, decay=replace(only.decay, stop_s=edge))
    return [early], replace(only, decay=replace(only.decay, start_s=edge))


def held_out(
    recordings: Sequence[Recording], run: Callable[[Sequence[Recording]], DampingFit]
) -> tuple[dict[str, Window], str]:
    """Prediction of what a fit has not seen: each recording from the others, or the last part of the only one.

    Returns the errors by length of window and a sentence. Too short a recording gives none, and the
    sentence why.
    """
    if len(recordings) > 1:
        parts = [([o for o in recordings if o is not r], r) for r in recordings]
        words = "each recording predicted from a fit to the others"
    else:
        try:
            known, late = split(recordings)
        except FitError:
            return {}, "too short to leave a part out: no prediction of unseen data"
        parts = [(known, late)]
        words = f"the last {100 * HELD_OUT:.0f} % (from {late.span[0]:.2f} s) predicted from a fit to what comes before"
    collected: dict[str, list[Window]] = {}
    for known, unknown in parts:
        try:
            fit = run(known)
            maps = None if fit.maps is None else Maps.of(fit.maps)
            result = predict(unknown, fit.parameters, maps=maps, forecasts=False)
        except FitError as problem:
            return {}, f"no prediction of unseen data: {problem}"
        for key, window in result.in_window.items():
            collected.setdefault(key, []).append(window)
    return {key: _together(windows) for key, windows in collected.items()}, words


def _together(windows: Sequence[Window]) -> Window:
    """The errors of windows of one length over several recordings."""
    n = np.array([w.n for w in windows], dtype=np.float64)
    rms = np.sqrt(np.average([np.square(w.rms_deg) for w in windows], axis=0, weights=n))
    middle = np.average([w.median_deg for w in windows], axis=0, weights=n)
    return Window(tuple(rms.tolist()), tuple(middle.tolist()), int(n.sum()))
