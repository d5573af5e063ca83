"""Everything ``pydpend batch`` can be told besides the options of `pydpend.analyse`."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, TypedDict

from pydpend.errors import OptionError, Setting, fault
from pydpend.typed import typed_class


class BatchKeywords(TypedDict, total=False):
    """The fields of `BatchOptions` as keywords."""

    sheet: str | None
    keep: str
    one_rig: bool
    workers: int | None
    scheduler: str | None
    scheduler_file: str | None
    retries: int
    time_limit_s: float | None
    reconnect_s: float


@typed_class()
@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """How many recordings are analysed.

    Every parameter is a flag of the same name in ``pydpend batch``.

    Parameters
    ----------
    sheet : str, optional
        Table of recordings (CSV with commas, semicolons or tabs): a column ``path``, and a column for each option of
        ``pydpend analyse`` that differs between recordings. Relative names are looked for beside the sheet.
    keep : str
        Columns of the sheet, with commas, that are no options and go into batch.parquet as they are; ``all`` for
        every such column.
    one_rig : bool
        The rig found in the first recording, or the one given, is used for all recordings that it fits, so that a name
        is the same marker in all of them. A recording that it does not fit is given its own, and it is said.
    workers : int, optional
        Recordings at a time on this machine; as many as cores and memory allow if not given.
    scheduler : str, optional
        Address of a dask.distributed scheduler (``tcp://host:8786``) whose workers do the work.
    scheduler_file : str, optional
        File that ``dask scheduler --scheduler-file`` wrote, instead of its address.
    retries : int
        How often a recording is tried again whose process crashed, whose worker was lost, or that was replaced
        meanwhile. What pydpend itself refuses is not tried again.
    time_limit_s : float, optional
        Longest time for one recording, s; it is then ended and listed as failed. No limit if not given.
    reconnect_s : float
        How long a scheduler that is lost is waited for, s.

    Raises
    ------
    OptionError
        For a value that makes no sense.
    """

    sheet: str | None = None
    keep: str = ""
    one_rig: bool = False
    workers: int | None = None
    scheduler: str | None = None
    scheduler_file: str | None = None
    retries: int = 1
    time_limit_s: float | None = None
    reconnect_s: float = 60.0

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise _senseless("workers", self.workers, "Give 1 or more")
        if self.retries < 0:
            raise _senseless("retries", self.retries, "Give 0 or more")
        for name in ("time_limit_s", "reconnect_s"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise _senseless(name, value, "Give seconds above 0")
        if self.keep and self.sheet is None:
            raise OptionError(
                fault(Setting("keep"), "is of a sheet's columns", "Name the sheet with " + Setting("sheet"))
            )
        if self.scheduler and self.scheduler_file:
            raise OptionError(
                fault(Setting("scheduler_file"), "a scheduler is named too", "Leave out one of the two")
            )
        if self.on_cluster and self.workers is not None:
            raise OptionError(
                fault(Setting("workers"), "the scheduler's workers do the work", "Leave it out")
            )

    @property
    def on_cluster(self) -> bool:
        """Whether the workers of a scheduler do the work."""
        return bool(self.scheduler or self.scheduler_file)

    @property
    def kept_columns(self) -> tuple[str, ...]:
        """The names in `keep`."""
        return tuple(name.strip() for name in self.keep.split(",") if name.strip())


def _senseless(name: str, value: Any, advice: str) -> OptionError:
    return OptionError(fault(Setting(name), f"{value:g} makes no sense", advice))


BATCH_FIELDS = fields(BatchOptions)
"""Every option, in the order in which help lists them."""
