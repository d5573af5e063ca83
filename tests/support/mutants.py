"""Damaged files: what disks, cables, transfers and editors do to a recording or a table, from a seed."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

EXTREMES = (
    0,
    1,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0x8000,
    0xFFFF,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    2**63 - 1,
    2**64 - 1,
)
"""Whole numbers at the edges of the types that files hold."""

WORDS = (
    *(b"", b"0", b"-1", b"1e999", b"-1e999", b"nan", b"inf", b"1e-320", b"99999999999999999999", b"0x10"),
    *(b"1,5", b"1.5.5", b"true", b"null", b"[]", b"{}", b'"', b"''", b"\xff\xfe", b"\x00", b"\xef\xbb\xbf"),
    *(b"9" * 5000, b"[" * 3000, b"../../etc/passwd", b"a,b", b"1_000", b"\xd9\xa1"),
    *(b"2024-05-01T12:00:00", b"12:00:00"),
)
"""What a field of a text may come to hold."""

Change = Callable[[bytearray, random.Random], str]


def _place(data: bytearray, rng: random.Random) -> int:
    """Anywhere, every second time in the first or last 256 bytes: headers and indices stand there."""
    size = len(data)
    if size <= 1:
        return 0
    near = min(256, size)
    choice = rng.random()
    if choice < 0.35:
        return rng.randrange(near)
    if choice < 0.5:
        return size - 1 - rng.randrange(near)
    return rng.randrange(size)


def _flip(data: bytearray, rng: random.Random) -> str:
    places = [_place(data, rng) for _ in range(rng.choice((1, 1, 2, 8)))]
    for at in places:
        if at < len(data):
            data[at] ^= 1 << rng.randrange(8)
    return f"bits flipped at bytes {places}"


def _zero(data: bytearray, rng: random.Random) -> str:
    at, length = _place(data, rng), rng.choice((4, 64, 512, 4096))
    data[at : at + length] = bytes(len(data[at : at + length]))
    return f"{length} bytes from {at} zeroed"


def _noise(data: bytearray, rng: random.Random) -> str:
    at, length = _place(data, rng), rng.choice((4, 64, 512))
    data[at : at + length] = rng.randbytes(len(data[at : at + length]))
    return f"{length} bytes from {at} random"


def _cut(data: bytearray, rng: random.Random) -> str:
    at = rng.choice((rng.randrange(len(data) + 1), _place(data, rng)))
    del data[at:]
    return f"cut off at byte {at}"


def _insert(data: bytearray, rng: random.Random) -> str:
    at, length = _place(data, rng), rng.choice((1, 4, 100))
    data[at:at] = rng.randbytes(length)
    return f"{length} bytes inserted at {at}"


def _remove(data: bytearray, rng: random.Random) -> str:
    at, length = _place(data, rng), rng.choice((1, 4, 100, 5000))
    del data[at : at + length]
    return f"{length} bytes lost at {at}"


def _repeat(data: bytearray, rng: random.Random) -> str:
    at, length = _place(data, rng), rng.choice((4, 100, 5000))
    to = _place(data, rng)
    data[to:to] = data[at : at + length]
    return f"{length} bytes from {at} again at {to}"


def _extreme(data: bytearray, rng: random.Random) -> str:
    at, width, value = _place(data, rng), rng.choice((1, 2, 4, 8)), rng.choice(EXTREMES)
    order = rng.choice(("little", "big"))
    field = (value % 2 ** (8 * width)).to_bytes(width, order)
    data[at : at + width] = field[: len(data[at : at + width])]
    return f"{value:#x} in {width} bytes at {at}, {order}-endian"


def _empty(data: bytearray, rng: random.Random) -> str:
    data.clear()
    return "emptied"


def _line(data: bytearray, rng: random.Random) -> str:
    lines = bytes(data).split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    how = rng.choice(("lost", "repeated", "swapped", "joined", "halved"))
    if how == "lost":
        del lines[i]
    elif how == "repeated":
        lines.insert(j, lines[i])
    elif how == "swapped":
        lines[i], lines[j] = lines[j], lines[i]
    elif how == "joined":
        lines[i : i + 2] = [b"".join(lines[i : i + 2])]
    else:
        lines[i] = lines[i][: len(lines[i]) // 2]
    data[:] = b"\n".join(lines)
    return f"line {i + 1} {how}"


def _field(data: bytearray, rng: random.Random) -> str:
    fields = list(re.finditer(rb"[^\s,;=:\[\]{}]+", bytes(data)))
    if not fields:
        return _empty(data, rng)
    found, word = rng.choice(fields), rng.choice(WORDS)
    data[found.start() : found.end()] = word
    return f"{word[:20]!r} for the word at byte {found.start()}"


MARKS = (
    *(
        (b".", b","),
        (b",", b";"),
        (b",", b"\t"),
        (b",", b" "),
        (b"\n", b"\r"),
        (b"\n", b"\r\n"),
        (b'"', b"'"),
    ),
    *((b"[[", b"["), (b"]]", b"]"), (b"=", b":")),
)
"""What an editor or a spreadsheet of another country writes for another."""


def _mark(data: bytearray, rng: random.Random) -> str:
    before, after = rng.choice(MARKS)
    at = [m.start() for m in re.finditer(re.escape(before), bytes(data))]
    if rng.random() < 0.5:
        data[:] = bytes(data).replace(before, after)
        return f"every {before!r} is {after!r}"
    if at:
        here = rng.choice(at)
        data[here : here + len(before)] = after
    return f"a {before!r} is {after!r}"


def _encode(data: bytearray, rng: random.Random) -> str:
    encoding = rng.choice(("utf-16", "utf-16-le", "utf-8-sig", "utf-32"))
    data[:] = bytes(data).decode("latin-1").encode(encoding)
    return f"written as {encoding}"


BINARY: tuple[Change, ...] = (
    _flip,
    _flip,
    _zero,
    _noise,
    _cut,
    _cut,
    _insert,
    _remove,
    _repeat,
    _extreme,
    _extreme,
)
TEXT: tuple[Change, ...] = (
    _line,
    _line,
    _field,
    _field,
    _field,
    _mark,
    _mark,
    _encode,
    _flip,
    _cut,
    _remove,
    _repeat,
)


def mutant(data: bytes, text: bool, rng: random.Random) -> tuple[bytes, str]:
    """A damaged copy and what was done to it."""
    out = bytearray(data)
    changes = TEXT if text else BINARY
    said = [rng.choice(changes)(out, rng) for _ in range(rng.choice((1, 1, 1, 2)))]
    if rng.random() < 0.01:
        said.append(_empty(out, rng))
    return bytes(out), "; ".join(said)
