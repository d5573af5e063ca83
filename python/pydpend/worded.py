"""Enums whose members carry their words: programs compare members, people read words."""

from __future__ import annotations

from enum import StrEnum


class Words(StrEnum):
    """Members are their values, in files and to whoever compares; ``words`` is what people read."""

    words: str

    def __new__(cls, value: str, words: str = "") -> Words:
        """A member of this value."""
        member = str.__new__(cls, value)
        member._value_ = value
        member.words = words
        return member
