"""Many recordings, each analysed into a run folder of its own, on this machine or on as many as there are."""

from __future__ import annotations

from pydpend.batching.journal import BatchError
from pydpend.batching.options import BatchOptions
from pydpend.batching.recording import Ended, Fault
from pydpend.batching.row import Light, State
from pydpend.batching.run import Advance, Batch, batch

__all__ = ["Advance", "Batch", "BatchError", "BatchOptions", "Ended", "Fault", "Light", "State", "batch"]
