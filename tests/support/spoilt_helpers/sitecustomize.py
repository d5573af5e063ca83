"""For helpers of a batch: a film called crash ends its process, one called endless never ends.

Python imports this first where its folder is on the path. No film does either as far as is known, so a fork stands in.
"""

import os
import sys
import time
from pathlib import Path

_fork = os.fork


def _spoilt() -> int:
    child = _fork()
    given = sys._getframe(1).f_locals.get("given")
    if child == 0 and given is not None:
        stem = Path(given.path).stem
        if stem.startswith("crash"):
            os.abort()
        if stem.startswith("endless"):
            # As a film does that is read: the recording is begun and its lock is held.
            vars(sys.modules["pydpend.batching.recording"])["_analysed"] = lambda *given: time.sleep(3600)
    return child


os.fork = _spoilt
