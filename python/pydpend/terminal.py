"""Text for a terminal: what comes out of files and of their names is never shown as it is."""

from __future__ import annotations

import os
import re
import shlex
from typing import Any, TextIO

_OBEYED = re.compile(
    "[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\U0010ff00-\U0010ffff]"
)
"""Characters that a terminal obeys or cannot show: controls, marks that turn the direction of writing, and what
stands for a byte of a name that is not UTF-8, here and in the compiled half."""


def shown(text: str) -> str:
    r"""Text of a file's name or of what is in a file, for a terminal: what is no character to be seen is written out.

    An escape is ``\x1b``, a line end ``\n``; a byte of a name that is not UTF-8 is ``\xf6``.
    """

    def written(match: re.Match[str]) -> str:
        code = ord(match[0])
        if 0xDC80 <= code <= 0xDCFF or code >= 0x10FF00:
            return f"\\x{code & 0xFF:02x}"
        known = {9: r"\t", 10: r"\n", 13: r"\r"}.get(code)
        return known or (f"\\x{code:02x}" if code < 0x80 else f"\\u{{{code:x}}}")

    return _OBEYED.sub(written, text)


_LONG = re.compile(r"[^\s/]{300,}")
"""Words longer than the name of any file."""


def shortened(text: str) -> str:
    """Text in which a word that is longer than any file's name, as a key of a damaged file may be, is cut."""
    return _LONG.sub(lambda match: f"{match[0][:60]}...{match[0][-10:]}", text)


def is_plain(text: str) -> bool:
    """Whether a text is shown by a terminal as it is."""
    return _OBEYED.search(text) is None


def shell_word(name: str) -> str:
    r"""A name as a word to paste into a shell; what is no character to be seen is written out, ``$'dr\xf6p.mp4'``.

    That form is read by bash, zsh and ksh.
    """
    if is_plain(name):
        return shlex.quote(name)

    def written(match: re.Match[str]) -> str:
        return "".join(f"\\x{byte:02x}" for byte in os.fsencode(match[0]))

    quoted = name.replace("\\", r"\\").replace("'", r"\'")
    return f"$'{_OBEYED.sub(written, quoted)}'"


class Shown:
    """A text stream to which nothing but lines of characters to be seen is written, whoever writes.

    What moves the cursor on purpose is written to the stream below it, see `below`.
    """

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Writes text; ends of lines and tabs stay."""
        self.stream.write(re.sub(r"[^\n\t]+", lambda part: shown(part[0]), text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def below(stream: Any) -> TextIO:
    """The stream as it is, for text of which every part that is not ours went through `shown`."""
    plain: TextIO = stream.stream if isinstance(stream, Shown) else stream
    return plain
