"""``batch.parquet``: a row a recording, with the same columns whatever was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydpend.batching.row import COLUMNS
from pydpend.output import whole

TABLE = "batch.parquet"


def write_table(results: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Writes the rows in their order; null where a recording has no value."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {
        "text": pa.string(),
        "texts": pa.list_(pa.string()),
        "whole": pa.int64(),
        "number": pa.float64(),
    }
    kinds = dict(COLUMNS)
    for row in rows:
        # Columns of the sheet that were kept.
        kinds |= {name: "text" for name in row if name.startswith("sheet_")}
    arrays = [pa.array([_valid(row.get(name)) for row in rows], types[kind]) for name, kind in kinds.items()]
    table = pa.Table.from_arrays(arrays, names=list(kinds))
    # A file, because pyarrow looks for addresses in names.
    with whole(results / TABLE) as new, new.open("wb") as file:
        pq.write_table(table, file, write_page_checksum=True)


def _valid(value: Any) -> Any:
    """Text without what UTF-8 cannot hold, as a name that is not UTF-8 has."""
    return value.encode("utf-8", "backslashreplace").decode("utf-8") if isinstance(value, str) else value
