"""From recordings to a report: one call that does every stage that applies and repeats none needlessly."""

from __future__ import annotations

from pydpend.analyse.options import Options, read_config, write_config
from pydpend.analyse.run import Outcome, analyse, plan

__all__ = ["Options", "Outcome", "analyse", "plan", "read_config", "write_config"]
