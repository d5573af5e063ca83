"""Results that are tables: to pandas, to Arrow and to a notebook, from their columns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pydpend.datasets import table_dataset
from pydpend.output import whole

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    import xarray as xr


class TableResult(ABC):
    """A result whose rows are a table."""

    @abstractmethod
    def to_columns(self) -> Mapping[str, NDArray[Any]]:
        """The table's columns.

        Returns
        -------
        dict of str to ndarray
            By name, with their units at the end of the names.
        """

    def to_dataframe(self) -> pd.DataFrame:
        """The table as pandas has it; pandas must be installed.

        Returns
        -------
        pandas.DataFrame
            The columns of `to_columns`; NaN where there is no number.
        """
        import pandas as pd

        return pd.DataFrame(dict(self.to_columns()))

    def to_arrow(self) -> pa.Table:
        """The table as Arrow has it.

        Returns
        -------
        pyarrow.Table
            The columns of `to_columns`; null where there is no number.
        """
        import pyarrow as pa

        return pa.table({name: pa.array(v, from_pandas=True) for name, v in self.to_columns().items()})

    def to_xarray(self) -> xr.Dataset:
        """The table as xarray has it; xarray must be installed.

        Returns
        -------
        xarray.Dataset
            A variable for each of `to_columns` with its unit, along ``time`` (s) where there is one, else along
            ``row``; NaN where there is no number.

        Raises
        ------
        TableError
            If xarray is not installed.
        """
        return table_dataset(self.to_columns())

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """The table as an Arrow stream: ``pyarrow.table(result)``, ``polars.DataFrame(result)``."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)


def by_link(
    columns: Mapping[str, NDArray[np.float64]], names: Sequence[str] = ()
) -> dict[str, NDArray[np.float64]]:
    """Columns of arrays (T,) and (T, L): ``"phi#_rad"`` becomes ``phi1_rad``, ``phi2_rad``, or ``phi_crank_rad``."""
    ends = [f"_{name}" for name in names]
    out = {}
    for name, values in columns.items():
        if values.ndim == 1:
            out[name] = values
        else:
            own = ends or [str(k + 1) for k in range(values.shape[1])]
            out |= {name.replace("#", end): values[:, k] for k, end in enumerate(own)}
    return out


def html_rows(title: str, columns: Mapping[str, NDArray[np.float64]], most: int = 5) -> str:
    """The first rows of a table of numbers, for a notebook."""
    rows = zip(*([f"{value:.6g}" for value in values[:most]] for values in columns.values()), strict=True)
    return html_table(title, list(columns), rows)


def html_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A small table for a notebook."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><caption>{escape(title)}</caption><tr>{head}</tr>{body}</table>"


def write_csv(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """A CSV table of numbers, whole or not at all; nan where there is no number."""
    with whole(path) as new:
        np.savetxt(
            new,
            np.column_stack(list(columns.values())),
            fmt="%.9g",
            delimiter=",",
            header=",".join(columns),
            comments="",
        )


def write_parquet(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """A Parquet table, whole or not at all."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    # A file, because pyarrow looks for addresses in names.
    with whole(path) as new, new.open("wb") as file:
        pq.write_table(pa.table(dict(columns)), file, use_dictionary=False, write_page_checksum=True)
