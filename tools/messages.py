"""Every refusal that the sources spell out, with what varies as an ellipsis; printed by ``python -m tools.messages``.

Python's are read with ``ast``, Rust's by their calls of ``Fault::new`` and ``Fault::of``. A message whose words are put
together elsewhere has no fixed words at its call and is not listed.
"""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VARIES = "…"


@dataclass(frozen=True, order=True)
class Said:
    """One message: the part of the sources that says it, from their root, and its words."""

    part: str
    words: str


def every() -> list[Said]:
    """All of them, by part, each once."""
    found = {said for said in (*_python(), *_rust()) if _has_words(said.words)}
    return sorted(found)


def _has_words(text: str) -> bool:
    return len(re.findall(r"[A-Za-z]{2,}", re.sub(r"`[^`]*`", "", text))) >= 3


def _tidy(text: str) -> str:
    text = re.sub(r"\s+", " ", text.replace("\n", " ")).strip()
    return re.sub(rf"{VARIES}(?:\s*{VARIES})+", VARIES, text)


def _python() -> Iterator[Said]:
    package = ROOT / "python" / "pydpend"
    for path in sorted(package.rglob("*.py")):
        part = str(path.relative_to(package).with_suffix("")).removesuffix("/__init__")
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and _refuses(_name(node.func)):
                words = (
                    _spelt(node) if _name(node.func) == "fault" else _spelt(node.args[0]) if node.args else ""
                )
                yield Said(f"python/{part}", _tidy(words))


def _refuses(function: str) -> bool:
    return function in ("fault", "DoesNotApply") or (
        function.endswith("Error") and not hasattr(builtins, function)
    )


def _name(function: ast.expr) -> str:
    if isinstance(function, ast.Name):
        return function.id
    return function.attr if isinstance(function, ast.Attribute) else ""


def _spelt(node: ast.expr) -> str:
    """The fixed words of an expression."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(_spelt(part) for part in parts)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return _spelt(left) + _spelt(right)
        case ast.IfExp(body=body, orelse=other):
            return max(_spelt(body), _spelt(other), key=len)
        case ast.Call(func=function, args=[ast.Constant(value=str(setting)), *_]) if (
            _name(function) == "Setting"
        ):
            return f"`{setting}`"
        case ast.Call(func=function, args=args) if _name(function) == "fault":
            said = [_spelt(arg) for arg in args]
            return f"{said[0]}: {said[1]}" + (f". {said[2]}" if len(said) > 2 else "")
    return VARIES


LITERAL = re.compile(r'"((?:[^"\\]|\\.)*)"', re.S)
TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|Setting::[A-Z]\w*|[A-Za-z_][\w:.]*(?:\(\))?', re.S)


def _rust() -> Iterator[Said]:
    crates = ROOT / "crates"
    for path in sorted(crates.glob("*/src/**/*.rs")):
        source = re.sub(r"^\s*//.*$", "", path.read_text("utf-8").split("#[cfg(test)]")[0], flags=re.M)
        part = str(path.relative_to(crates).with_suffix("")).replace("/src/", "/").removesuffix("/mod")
        fault = r"(?:Fault|Self)" if path.name == "error.rs" else "Fault"
        for call in re.finditer(rf"\b{fault}::(?:new|of|without)\(", source):
            inside, end = _bracketed(source, call.end())
            subject, _, problem = _first_comma(inside)
            words = f"{_rust_words(subject) or VARIES}: {_rust_words(problem)}"
            advice = re.match(
                r"(?:\s*\.(?:of_kind|at|caused_by)\([^()]*(?:\([^()]*\)[^()]*)*\))*\s*\.advice\(",
                source[end:],
            )
            if advice:
                words += ". " + _rust_words(_bracketed(source, end + advice.end())[0])
            yield Said(f"rust/{part}", _tidy(words))


def _bracketed(source: str, start: int) -> tuple[str, int]:
    """What stands up to the bracket that closes the one before ``start``, and the place behind it."""
    depth, at = 1, start
    while depth:
        literal = LITERAL.match(source, at) if source[at] == '"' else None
        if literal:
            at = literal.end()
            continue
        depth += {"(": 1, ")": -1}.get(source[at], 0)
        at += 1
    return source[start : at - 1], at


def _first_comma(text: str) -> tuple[str, str, str]:
    depth = at = 0
    while at < len(text):
        literal = LITERAL.match(text, at) if text[at] == '"' else None
        if literal:
            at = literal.end()
            continue
        depth += {"(": 1, "[": 1, ")": -1, "]": -1}.get(text[at], 0)
        if text[at] == "," and depth == 0:
            return text[:at], ",", text[at + 1 :]
        at += 1
    return text, "", ""


def _rust_words(text: str) -> str:
    """The fixed words of Rust's arguments: texts with their fields, settings by their names in Python."""
    found = []
    for token in TOKEN.findall(re.sub(r'\.set_to\("(\w+)"\)', r' "=\1"', text)):
        if token.startswith('"'):
            plain = re.sub(r"\\\n\s*", "", token[1:-1]).replace('\\"', '"')
            plain = re.sub(r"\{[^{}]*\}", VARIES, plain)
            found.append(plain)
        elif token.startswith("Setting::"):
            name = token.removeprefix("Setting::").split(".")[0].split("::")[0]
            found.append("`" + re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower() + "`")
    return "".join(found)


if __name__ == "__main__":
    for said in every():
        print(f"{said.part}: {said.words}")
