"""Arguments of public functions, checked against their annotations before anything is done with them.

What the annotations of `pydpend` mean to a caller differs from what they mean to a type checker: NumPy's numbers are
numbers, whatever NumPy makes an array of numbers of is one, a text is no sequence, and True is no number. The message
is one line in the caller's words, `threads: a whole number is needed, and this is '2'. Write threads=2`.
"""

from __future__ import annotations

import inspect
import math
import os
import reprlib
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, wraps
from numbers import Integral, Real
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

from pydpend.argument_types import of_type
from pydpend.errors import ArgumentError, Setting, Text, WrongTypeError, fault, listed

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C", bound=type)

LARGE = 1 << 31
"""Whole numbers from this on may be too large for what takes them."""

Accepts = Callable[[Any], bool]

NUMBERS = "biuf"
"""Kinds of NumPy's types that are numbers."""

LONGEST = 40
"""Characters of a value that a message quotes."""


def typed(*own: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """The function with arguments of another type than annotated refused by WrongTypeError.

    ``own``: the keywords that it checks itself.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                given = signature.bind(*args, **kwargs).arguments
            except TypeError:
                # Python's own words tell which argument lacks or is too many.
                return function(*args, **kwargs)
            hints = _hints(function)
            for name, value in given.items():
                if name in hints and name not in own:
                    several = signature.parameters[name].kind is inspect.Parameter.VAR_POSITIONAL
                    for one in value if several else (value,):
                        check(name, one, hints[name])
            try:
                return function(*args, **kwargs)
            except OverflowError as problem:
                refused = _out_of_range(given)
                if refused is None:
                    raise
                raise refused from problem

        return call

    return decorate


def _out_of_range(given: Mapping[str, Any]) -> ArgumentError | None:
    """The error for a whole number that is negative or too large for what takes it; None if there is none."""
    for name, value in given.items():
        for one in value if isinstance(value, (list, tuple)) else (value,):
            if _is_whole(one) and not 0 <= one < LARGE:
                said = str(one) if abs(one) < 10**LONGEST else "a number of many digits"
                return ArgumentError(fault(Setting(name), f"{said} is out of range", "Give one within it"))
    return None


def typed_class(*own: str) -> Callable[[C], C]:
    """The class with its constructor's arguments checked as those of a `typed` function."""

    def decorate(cls: C) -> C:
        # Of a class with fields the constructor is made, and replaced here; nothing else of the class changes.
        cls.__init__ = typed(*own)(cls.__init__)  # type: ignore[misc]
        return cls

    return decorate


@cache
def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    """The annotations of what has one type; results may be annotated with what is imported for type checkers only."""
    kinds = inspect.signature(function).parameters
    plain = {
        name: note
        for name, note in function.__annotations__.items()
        if name in kinds and kinds[name].kind is not inspect.Parameter.VAR_KEYWORD
    }
    holder = types.SimpleNamespace(__annotations__=plain)
    return get_type_hints(holder, globalns=getattr(function, "__globals__", None))


def check(name: str, value: object, hint: Any) -> None:
    """Raises WrongTypeError if a value is not of the type that ``hint`` says."""
    if _accepts(value, hint):
        return
    members = _members(hint)
    classes = [member for member in members if _is_class(member)]
    parts = [part for member in members if get_origin(member) in _MANY for part in get_args(member)]
    if parts and isinstance(value, (list, tuple, np.ndarray, dict)) and all(map(_is_class, parts)):
        for one in value:
            of_type(name, one, *parts)
    elif classes or (parts and all(map(_is_class, parts))):
        of_type(name, value, *(classes or parts))
    problem = f"{_needed(members)} is needed, and this is {_quoted(value)}"
    raise WrongTypeError(fault(Setting(name), problem, _advice(name, value, members)))


def _members(hint: Any) -> tuple[Any, ...]:
    """The types of a union; the hint alone if it is none."""
    if get_origin(hint) not in (Union, types.UnionType):
        return (hint,)
    parts, array_like = get_args(hint), get_args(npt.ArrayLike)
    if set(array_like) <= set(parts):
        # A union of unions is one flat union.
        parts = (np.ndarray, *(part for part in parts if part not in array_like))
    return tuple(part for member in parts for part in _members(member))


def _is_class(hint: Any) -> bool:
    """Whether it is a class of this package."""
    return isinstance(hint, type) and hint.__module__.startswith("pydpend.")


def _accepts(value: object, hint: Any) -> bool:
    return any(_accepts_one(value, member) for member in _members(hint))


def _accepts_one(value: object, hint: Any) -> bool:
    origin, parts = get_origin(hint) or hint, get_args(hint)
    if origin in _ACCEPTS:
        return _ACCEPTS[origin](value)
    if origin is Literal:
        return any(type(value) is type(word) for word in parts)
    if origin is tuple:
        return _is_tuple(value, parts)
    if origin in _MANY:
        return _is_many(value, parts)
    # A protocol asks for attributes, which what takes it looks for itself.
    return not isinstance(origin, type) or getattr(origin, "_is_protocol", False) or isinstance(value, origin)


def _is_array(value: object) -> bool:
    """Whether NumPy makes an array of numbers of it."""
    try:
        array = np.asarray(value)
        if array.dtype.kind == "O" and array.ndim > 0:
            array = array.astype(np.float64)
    except (TypeError, ValueError):
        return False
    return array.dtype.kind in NUMBERS


def _is_sequence(value: object) -> bool:
    many = isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping, set))
    return many and getattr(value, "ndim", 1) > 0


def _is_tuple(value: Any, parts: tuple[Any, ...]) -> bool:
    if not _is_sequence(value):
        return False
    held = list(value)
    if len(parts) == 2 and parts[1] is Ellipsis:
        parts = parts[:1] * len(held)
    return len(held) == len(parts) and all(map(_accepts, held, parts))


def _is_many(value: Any, parts: tuple[Any, ...]) -> bool:
    if not _is_sequence(value):
        return False
    if isinstance(value, np.ndarray) and parts in ((int,), (float,)):
        return value.dtype.kind in (NUMBERS if parts == (float,) else "iu")
    # What can be gone through once only is not gone through here.
    known = isinstance(value, (list, tuple, np.ndarray)) and bool(parts)
    return not known or all(_accepts(one, parts[0]) for one in value)


def _is_number(value: object) -> bool:
    plain = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    return isinstance(plain, Real) and not isinstance(plain, (bool, np.bool_))


def _is_whole(value: object) -> bool:
    return isinstance(value, Integral) and not isinstance(value, (bool, np.bool_))


_ACCEPTS: Mapping[Any, Accepts] = {
    Any: lambda value: True,
    object: lambda value: True,
    float: _is_number,
    int: _is_whole,
    bool: lambda value: isinstance(value, (bool, np.bool_)),
    np.ndarray: _is_array,
    Callable: callable,
}
"""Types that mean more, or less, to a caller than to Python."""

_MANY = (Sequence, Iterable, list)
"""Annotations of several values of one kind."""

_WORDS: Mapping[Any, str] = {
    float: "a number",
    int: "a whole number",
    bool: "True or False",
    str: "text",
    bytes: "a path",
    os.PathLike: "a path",
    np.ndarray: "an array of numbers",
    dict: "a dictionary",
    Mapping: "a dictionary",
    range: "a range",
    Callable: "a function",
    type(None): "None",
}
"""Words for the types."""


def _needed(members: tuple[Any, ...]) -> str:
    """Words for what may be given; None is what leaving the argument out means."""
    words = list(dict.fromkeys(_word(member) for member in members))
    if "a path" in words:
        words = [word for word in words if word != "text"]
    return listed([word for word in words if word != "None"] or words)


def _word(hint: Any) -> str:
    origin, parts = get_origin(hint) or hint, get_args(hint)
    if origin in _WORDS:
        return _WORDS[origin]
    if origin is Literal:
        return listed(map(repr, parts))
    if origin is tuple and parts[-1:] != (Ellipsis,):
        return f"({', '.join(_needed(_members(part)) for part in parts)})"
    if origin in (tuple, *_MANY):
        return f"a sequence, each {_needed(_members(parts[0]))}," if parts else "a sequence"
    return str(getattr(origin, "__name__", origin))


def _quoted(value: object) -> str:
    if isinstance(value, (str, bytes, bool, int, float, complex, type(None), list, tuple, dict)):
        said = reprlib.repr(value)
        return said if len(said) <= LONGEST else said[:LONGEST] + "..."
    return f"of type {type(value).__name__}"


def _advice(name: str, value: object, members: tuple[Any, ...]) -> Text:
    """The number that a text is, or the whole number that a number is, where one is needed."""
    if not {int, float} & set(members) or not isinstance(value, (str, float)):
        return ""
    try:
        number = float(value)
    except ValueError:
        return ""
    if not math.isfinite(number):
        return ""
    if number.is_integer():
        return "Write " + Setting(name, int(number))
    return "Write " + Setting(name, number) if float in members else ""
