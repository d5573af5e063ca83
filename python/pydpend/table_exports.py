"""Tables of results, as angles and states, in the forms of other programs: CSV, MAT, NetCDF, Excel, OpenSim's storage.

Each number is written so that it is read back to its last bit.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pydpend.columns import read_columns
from pydpend.datasets import table_dataset
from pydpend.errors import TableError, fault
from pydpend.tabular import TableResult

Columns = Mapping[str, NDArray[Any]]


class StoredTable(TableResult):
    """A table of numbers in a file, with all its columns: angles, states, or places of points."""

    def __init__(self, path: Path) -> None:
        """Reads it. Raises TableError naming line and column of what is no number."""
        self._columns = read_columns(path, ("time_s",), None, error=TableError).values

    def to_columns(self) -> dict[str, NDArray[Any]]:
        """The columns of the file, in its order."""
        return self._columns


EXCEL_ROWS = 1_048_576
"""Rows of a sheet of Excel, with the header."""

MAT_NAME = 63
"""Characters of a name in MATLAB."""


def _csv(result: TableResult, path: Path, name: str) -> None:
    columns = result.to_columns()
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(_cells(values) for values in columns.values()), strict=True))


def _cells(values: NDArray[Any]) -> list[str]:
    """A column's fields: the shortest digits that give each number back, empty where there is none."""
    if values.dtype.kind == "f":
        # 32 bits have shorter digits than the same number in 64.
        return ["" if np.isnan(v) else str(v) for v in values]
    return ["" if v is None else str(v) for v in values.tolist()]


def _mat(result: TableResult, path: Path, name: str) -> None:
    from scipy.io import savemat

    columns = result.to_columns()
    content: dict[str, Any] = {}
    for column, values in columns.items():
        word = re.sub(r"\W", "_", column, flags=re.ASCII)
        word = (word if word[:1].isalpha() else f"c_{word}")[:MAT_NAME]
        if word in content:
            problem = f"the columns {column} and another have one name, {word}, in MATLAB"
            raise TableError(fault(name, problem, "Write it as .csv"))
        content[word] = values.astype(object) if values.dtype.kind in "OUS" else values[:, None]
    savemat(path, content, do_compression=True, long_field_names=True)


def _netcdf(result: TableResult, path: Path, name: str) -> None:
    write_netcdf(table_dataset(result.to_columns()), path, name)


def write_netcdf(dataset: Any, path: Path, name: str) -> None:
    """A dataset as NetCDF 4. Raises TableError if h5netcdf is not installed."""
    try:
        import h5netcdf  # noqa: F401  xarray takes it by its name
    except ImportError:
        said = "NetCDF is written by h5netcdf, which is not installed"
        raise TableError(fault(name, said, "pip install 'pydpend[tracks]'")) from None
    dataset.to_netcdf(path, engine="h5netcdf")


def _excel(result: TableResult, path: Path, name: str) -> None:
    write_excel(result.to_dataframe, len(next(iter(result.to_columns().values()))), path, name)


def write_excel(frame: Callable[[], Any], rows: int, path: Path, name: str) -> None:
    """A DataFrame as a sheet of Excel. Raises TableError if it has too many rows or a library is not installed."""
    if rows >= EXCEL_ROWS:
        problem = f"it has {rows} rows, and a sheet of Excel has {EXCEL_ROWS} with the header"
        raise TableError(fault(name, problem, "Write it as .csv, .mat or .nc"))
    try:
        import openpyxl  # noqa: F401  pandas takes it by its name

        table = frame()
    except ImportError:
        said = "Excel is written by pandas and openpyxl, which are not installed"
        raise TableError(fault(name, said, "pip install 'pydpend[export]'")) from None
    table.to_excel(path, index=False, engine="openpyxl")


def _storage(result: TableResult, path: Path, name: str) -> None:
    """OpenSim's storage: its header, then ``time`` and the other columns by tabs; rad, and NaN where there is none."""
    columns = dict(result.to_columns())
    if "time_s" not in columns:
        raise TableError(fault(name, "it has no times, and OpenSim's files need them", "Write it as .csv"))
    words = [column for column, values in columns.items() if values.dtype.kind not in "fiu"]
    if words:
        problem = f"OpenSim's files hold numbers alone, and {', '.join(words)} is text"
        raise TableError(fault(name, problem, "Write it as .csv"))
    times = columns.pop("time_s")
    head = [
        Path(name).stem,
        "version=1",
        f"nRows={len(times)}",
        f"nColumns={len(columns) + 1}",
        "inDegrees=no",
        "endheader",
    ]
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write("\n".join([*head, "\t".join(["time", *columns])]) + "\n")
        cells = ([text or "NaN" for text in _cells(values)] for values in (times, *columns.values()))
        file.writelines("\t".join(row) + "\n" for row in zip(*cells, strict=True))


def _parquet(result: TableResult, path: Path, name: str) -> None:
    import pyarrow.parquet as pq

    with path.open("wb") as file:
        pq.write_table(result.to_arrow(), file, write_page_checksum=True)


TABLE_WRITERS: dict[str, Callable[[TableResult, Path, str], None]] = {
    ".csv": _csv,
    ".mat": _mat,
    ".nc": _netcdf,
    ".xlsx": _excel,
    ".mot": _storage,
    ".sto": _storage,
    ".parquet": _parquet,
}
"""The writer of a table by the ending of the file: the result, the new file, and its name for messages."""
