"""One result of each kind, as small as it can be; each is made once."""

from __future__ import annotations

import dataclasses
from functools import cache
from pathlib import Path

import numpy as np
import pydpend as dp
from pydpend.analyse.run import Outcome
from pydpend.analyse.state import RunState, StageState
from pydpend.batching.status import Status
from pydpend.damping import predict
from pydpend.damping.recording import prepare
from pydpend.encoder import EncoderSignal, compare, encoder_angles, hold_of
from pydpend.linear import Section
from pydpend.simulation import Ensemble
from pydpend.trials import Trials, summary

from tests.support.drawn_nodes import some_nodes
from tests.support.free_decays import measured, released


@cache
def motion() -> dp.LinkAngles:
    return measured(released(3, 4.0, 250.0), 3, 0.05)


@cache
def fit() -> dp.DampingFit:
    return dp.fit_damping(
        motion(), dp.derived("A"), laws="mu_v1,mu_v2", ratios=False, start_s=0.1, stop_s=4.0
    )


@cache
def comparison() -> dp.Comparison:
    angles = motion()
    noise = np.random.default_rng(5).normal(0.0, 1e-3, angles.t_s.size)
    return compare(angles, encoder_angles(EncoderSignal(angles.t_s, angles.phi_rad[:, 0] + noise, "rad")))


def simulation() -> dp.Simulation:
    return dp.simulate(dp.derived("A"), dp.Damping(), [0.5, 0.2, 0.0, 0.0], np.arange(0.0, 0.1, 0.01))


STATES = [[0.5, 0.2, 0.0, 0.0], [1.5, 0.2, 0.0, 0.0], [2.5, 0.2, 0.0, 0.0]]


def section() -> Section:
    return dp.poincare(dp.derived("A"), dp.Damping(), STATES[0], 8.0)


@cache
def score() -> dp.Score:
    nodes = some_nodes()
    frames, markers = nodes.status.shape
    film = dp.Film("clean", frames=frames)
    places = np.repeat(film.truth().xy_px[:, :1], markers, axis=1)
    return dp.score(dataclasses.replace(nodes, xy_px=np.ascontiguousarray(places)), film)


@cache
def calibration() -> dp.Calibration:
    noise = np.random.default_rng(3).normal(0.0, 1e-3, (4, 50))
    times = np.arange(50.0)
    return dp.calibrate(
        [hold_of(EncoderSignal(times, 5 + k + noise[k], "v", f"hold {k}"), 0.5 * k) for k in range(4)]
    )


@cache
def prediction() -> dp.Prediction:
    angles = motion()
    return predict(prepare(angles, dp.derived("A"), 0.1, 4.0), fit().parameters, (0.5,))


@cache
def trials() -> Trials:
    each = [
        dp.fit_damping(
            measured(released(seed, 4.0, 250.0), seed, 0.05),
            dp.derived("A"),
            laws="mu_v1,mu_v2",
            start_s=0.1,
            stop_s=4.0,
        )
        for seed in (3, 5)
    ]
    return summary(each, each[0])


def outcome() -> Outcome:
    states = {"drop/track": StageState.DONE, "fit": StageState.NOT_DONE}
    return Outcome(Path("run"), RunState.PARTLY, "1 of 2", states, {"fit": "no rest"}, {"drop/track": 1.5})


def many() -> dp.Batch:
    counts = {"done": 1, "partly": 0, "failed": 1}
    return dp.Batch(
        Path("results"), "1 of 2", counts, 0, {"b": "no film"}, {"b": "pydpend analyse b"}, "agree"
    )


def how_far() -> Status:
    counts = {"done": 1, "partly": 0, "failed": 1}
    return Status("1 of 3", 3, counts, "here, process 1", {"c": "here, process 2"}, {"b": "no film"}, 3.5)


def ensemble() -> Ensemble:
    return dp.simulate_many(dp.derived("A"), dp.Damping(), STATES, [0.0, 0.1])
