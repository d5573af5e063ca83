"""Damping: every coefficient with an error bar that is true (Section 7.1 and beyond; docs/explanation/damping.md)."""

from __future__ import annotations

from pydpend.damping.compare import compare_terms
from pydpend.damping.consistency import Consistency, Explanation, LengthCheck, RatioCheck
from pydpend.damping.fit import fit_damping
from pydpend.damping.fitted_recording import AngleMaps, FittedRecording, Window
from pydpend.damping.maps import Maps
from pydpend.damping.omitted import Omitted
from pydpend.damping.prediction import Prediction, predict
from pydpend.damping.result import DampingFit
from pydpend.damping.result_parts import (
    EnergyCurve,
    Estimate,
    Identifiability,
    Interval,
    Residuals,
    Term,
)

__all__ = [
    "AngleMaps",
    "Consistency",
    "DampingFit",
    "EnergyCurve",
    "Estimate",
    "Explanation",
    "FittedRecording",
    "Identifiability",
    "Interval",
    "LengthCheck",
    "Maps",
    "Omitted",
    "Prediction",
    "RatioCheck",
    "Residuals",
    "Term",
    "Window",
    "compare_terms",
    "fit_damping",
    "predict",
]
