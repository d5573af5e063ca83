"""The batch to which everything happens, with 200 films: ``python -m tests.validation.validate_batch``."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tests.support.small_cluster import check, everything_happens

FILMS = 200
COMPARED = 20
"""Films whose results are compared with those of serial runs."""


def main() -> None:
    """Says what it did, or ends with what is wrong."""
    with tempfile.TemporaryDirectory() as folder:
        rows = everything_happens(Path(folder), FILMS)
        check(Path(folder), rows, FILMS, COMPARED)
    print(
        f"{FILMS} films; a worker was killed, the scheduler restarted, a film replaced, one crashed, one never ended"
    )
    print(f"{len(rows)} rows, {COMPARED} compared with serial runs, equal to the byte")


if __name__ == "__main__":
    main()
