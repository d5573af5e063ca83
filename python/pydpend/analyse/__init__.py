"""From recordings to a report: one call that does every stage that applies and repeats none needlessly."""

from __future__ import annotations

from pydpend.analyse.options import Options, read_config, write_config
from pydpend.analyse.run import Outcome, analyse, plan
from pydpend.analyse.state import RunState, StageState

__all__ = ["Options", "Outcome", "RunState", "StageState", "analyse", "plan", "read_config", "write_config"]
