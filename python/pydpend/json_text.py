"""Results as JSON: one form for all that have one, there and back."""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from pydpend.documents import Table, parse_json
from pydpend.errors import PydpendError, Text
from pydpend.output import write_text
from pydpend.typed import typed


class JsonResult(ABC):
    """A result with a form in plain values, and that as text."""

    _error: ClassVar[type[PydpendError]] = PydpendError
    """Error that text which is not JSON raises."""
    _source: ClassVar[str] = "the text"
    """Name of the text in messages."""
    _advice: ClassVar[Text] = "Give what to_json gave"
    """Advice about text that is not JSON."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The result as plain values.

        Returns
        -------
        dict
            Plain numbers, texts, lists and tables; None for what is not defined.
        """

    def to_json(self) -> str:
        """The result as JSON.

        Returns
        -------
        str
            `to_dict` as text.
        """
        return json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n"

    @classmethod
    @typed()
    def from_json(cls, text: str, source: str | None = None) -> Self:
        """The result that `to_json` gave as text; each value is checked.

        Parameters
        ----------
        text : str
            What `to_json` gave.
        source : str, optional
            Name of the text, for messages.

        Returns
        -------
        Self
            The result; what its class says is in a table of its own is empty.

        Raises
        ------
        PydpendError
            The error of the result's part (`FitError` for a fit), naming the key, for a text that is none.
        """
        return cls.of_table(parse_json(text, source or cls._source, cls._error, cls._advice))

    @classmethod
    @abstractmethod
    def of_table(cls, table: Table) -> Self:
        """The result from a document that is read already.

        Parameters
        ----------
        table : pydpend.documents.Table
            What `to_json` gave, or a part of a document.

        Returns
        -------
        Self
            The result, as of `from_json`.

        Raises
        ------
        PydpendError
            The document's error, naming the key that is missing or not what it must be.
        """


def write_json(path: Path, value: Any) -> None:
    """A JSON file, whole or not at all; not-finite numbers as null."""
    write_text(path, json.dumps(plain(value), indent=1, allow_nan=False) + "\n")


def number(value: float) -> float | None:
    """The number, or None where it is not finite (JSON has no NaN)."""
    return float(value) if math.isfinite(value) else None


def plain(value: Any) -> Any:
    """Arrays as lists, numbers as Python's, not-finite ones as None, all the way down."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return number(float(value))
    return value
