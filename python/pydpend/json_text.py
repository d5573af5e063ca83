"""Results as JSON: one form for all that have one."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from typing import Any


class JsonResult(ABC):
    """A result with a form in plain values, and that as text."""

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
