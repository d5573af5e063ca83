"""A pendulum's TOML file: parts, or reduced constants (docs/reference/model.md)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pydpend.components import Balls, Cage, Configuration, Part, Quantity, Races, Rigid
from pydpend.documents import Table, read_toml
from pydpend.errors import ModelError, OptionError, Setting, fault, listed
from pydpend.kinds import expect
from pydpend.model.pendulum import CONSTANTS, Model, uniform_bar
from pydpend.model.reduce import ModelWarning, constants_of, derived, from_parts, published
from pydpend.output import AnyPath, path_of
from pydpend.typed import typed

# Every number may be plain or [value, standard uncertainty]; its key ends in its unit.
_UNITS = {
    "mass": {"g": 1.0, "kg": 1e3},
    "length": {"mm": 1.0, "m": 1e3},
    "inertia": {"g_mm2": 1.0, "kg_m2": 1e9},
}
_PART = {"name", "body", "count", "mass", "inertia", "place", "across", "at"}
_BEARING = {"name", "at", "inner", "outer", "count", "balls", "d_inner", "d_ball"} | {
    "ball_mass",
    "ball_inertia",
    "cage_mass",
    "cage_inertia",
}
MOST = 1e30
"""No quantity of a pendulum comes near this in any unit, and its square is still a float64."""
ONE_LINK = ("psi_kg_m2", "sigma_j", "m1_kg")
"""Constants of a single pendulum; a file with these alone is one's, m1 being optional."""
_KIND = {
    "mass": "mass",
    "inertia": "inertia",
    "place": "length",
    "across": "length",
    "l1": "length",
    "lower_inner": "length",
    "lower_outer": "length",
    "d_inner": "length",
    "d_ball": "length",
    "ball_mass": "mass",
    "ball_inertia": "inertia",
    "cage_mass": "mass",
    "cage_inertia": "inertia",
}


@typed()
def read_model(path: AnyPath) -> Model:
    """A pendulum from a TOML file of parts or of reduced constants (docs/reference/model.md has the form).

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    Model
        The model, SI.

    Raises
    ------
    ModelError
        Naming the file and the part or key at fault.
    """
    path = path_of(path)
    expect(path, ("model",), ModelError)
    data = read_toml(path, ModelError, "docs/reference/model.md has examples")
    if ("constants" in data) == ("part" in data):
        raise ModelError(
            fault(
                str(path),
                "needs either a table [constants] or tables [[part]]",
                "docs/reference/model.md has examples",
            )
        )
    return _from_constants(data, path) if "constants" in data else _from_parts(data, path)


def of_ratios() -> Model:
    """A pendulum of which nothing is known: a fit has all its constants over psi from the motion.

    Returns
    -------
    Model
        A model without a scale; its numbers are the paper's, and a fit begins from others.
    """
    return replace(derived("A").of_unknown_scale(), name="ratios")


NAMED: Mapping[str, Callable[[], Model]] = {
    "derived": lambda: derived("A"),
    "published": published,
    "ratios": of_ratios,
}
"""Models by the word that an option has for them: two of the paper's pendulum, and that of which nothing is known."""


def model_called(word: str) -> Model:
    """The model that the option ``model`` names: one of `NAMED`, or a TOML file.

    What is wrong with the published constants is not warned of: whoever uses them says it with numbers.

    Raises
    ------
        OptionError: if there is no such file.
        ModelError: as `read_model`.
    """
    if word in NAMED:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)
            return NAMED[word]()
    check_model_called(word)
    return read_model(word)


def check_model_called(word: str) -> None:
    """Raises OptionError if the option ``model`` names neither one of `NAMED` nor a file."""
    if word not in NAMED and not Path(word).is_file():
        expect(word, ("model",), OptionError, "model")
        advice = f"Give {listed((*NAMED, 'a pendulum in TOML'))}"
        raise OptionError(fault(Setting("model"), f"there is no file {word}", advice))


def _pair(value: Any, where: str, key: str) -> tuple[float, float]:
    items = value if isinstance(value, list) else [value, 0.0]
    good = len(items) == 2 and all(isinstance(x, int | float) and not isinstance(x, bool) for x in items)
    if not good or not all(abs(x) < MOST for x in items) or items[1] < 0:
        raise ModelError(
            fault(where, f"{key} is {value!r}", "Give a number, or [value, standard uncertainty]", place="")
        )
    return float(items[0]), float(items[1])


class _Numbers:
    """Reads the numbers of one table into quantities in g and mm, and refuses keys it does not know."""

    def __init__(self, table: Mapping[str, Any], known: set[str], where: str) -> None:
        self.where = where
        self.plain: dict[str, Any] = {}
        self.values: dict[str, tuple[float, float]] = {}
        for key, value in table.items():
            quantity, unit = _split(key)
            if quantity in known and unit:
                factor = _UNITS[_KIND[quantity]][unit]
                v, s = _pair(value, where, key)
                if quantity in self.values:
                    raise ModelError(fault(where, f"{quantity} is given twice"))
                self.values[quantity] = (v * factor, s * factor)
            elif key in known and key not in _KIND:
                self.plain[key] = value
            else:
                raise ModelError(fault(where, f"unknown key {key!r}", f"Known: {', '.join(_known(known))}"))

    def integer(self, key: str, default: int | None, allowed: range) -> int:
        value = self.plain.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or value not in allowed:
            raise ModelError(
                fault(self.where, f"{key} is {value!r}", f"Give a whole number {allowed[0]} to {allowed[-1]}")
            )
        return value

    def need(self, key: str) -> tuple[float, float]:
        if key not in self.values:
            units = " or ".join(f"{key}_{u}" for u in _UNITS[_KIND[key]])
            raise ModelError(fault(self.where, f"no {key}", f"Give {units}"))
        return self.values[key]


def _split(key: str) -> tuple[str, str]:
    """``mass_g`` to (``mass``, ``g``); no known unit gives (key, '')."""
    for quantity, kind in _KIND.items():
        for unit in _UNITS[kind]:
            if key == f"{quantity}_{unit}":
                return quantity, unit
    return key, ""


def _known(known: set[str]) -> list[str]:
    out = []
    for key in sorted(known):
        out += [f"{key}_{u}" for u in _UNITS[_KIND[key]]] if key in _KIND else [key]
    return out


def _gravity(data: Table, path: Path) -> float:
    g = _pair(data.values.get("g_m_s2", 9.81), str(path), "g_m_s2")[0]
    if g < 0:
        raise ModelError(fault(str(path), f"g_m_s2 is {g}", "It cannot be negative"))
    return g


def _name(data: Table, path: Path) -> str:
    return str(data.values.get("name", path.stem))


def _from_constants(data: Table, path: Path) -> Model:
    where = f"{path}, [constants]"
    table = data.table("constants").values
    for key in data:
        if key not in ("name", "g_m_s2", "constants"):
            raise ModelError(fault(str(path), f"unknown key {key!r}", "Known: name, g_m_s2, constants"))
    known = {*CONSTANTS, "lower_inner_m", "lower_outer_m"}
    for key in table:
        if key not in known:
            raise ModelError(fault(where, f"unknown key {key!r}", f"Known: {', '.join(sorted(known))}"))
    pairs = {key: _pair(value, where, key) for key, value in table.items()}
    g = _gravity(data, path)
    if pairs and not pairs.keys() - set(ONE_LINK):
        for key in ONE_LINK[:2]:
            if key not in pairs:
                raise ModelError(fault(where, f"no {key}"))
        pairs.setdefault("m1_kg", (0.0, 0.0))
        (psi, sigma, m1), errors = zip(*(pairs[key] for key in ONE_LINK), strict=True)
        return Model.one_link(psi, sigma, m1, g, np.diag(np.square(errors)), _name(data, path)).checked()
    pairs.setdefault("zeta_kg_m2", (0.0, 0.0))
    for key in ("m1_kg", "m2_kg"):
        pairs.setdefault(key, (0.0, 0.0))
    if "a3_kg_m2" not in pairs and g > 0 and "kappa_j" in pairs and "l1_m" in pairs:
        # a3 = l1 kappa / g for any rigid lower link (erratum section 0).
        k, length = pairs["kappa_j"], pairs["l1_m"]
        value = k[0] * length[0] / g
        pairs["a3_kg_m2"] = (value, math.hypot(k[1] * length[0], k[0] * length[1]) / g)
    for key in CONSTANTS:
        if key not in pairs:
            raise ModelError(fault(where, f"no {key}"))
    numbers = {key: pairs[key][0] for key in CONSTANTS}
    m2 = numbers["m2_kg"]
    centre = numbers["kappa_j"] / (g * m2) if g > 0 and m2 > 0 else 0.0
    inner, outer = uniform_bar(m2, 2 * numbers["lambda_kg_m2"] - m2 * centre**2, centre)
    return Model(
        **numbers,
        g_m_s2=g,
        lower_inner_m=pairs.get("lower_inner_m", (inner, 0.0))[0],
        lower_outer_m=pairs.get("lower_outer_m", (outer, 0.0))[0],
        covariance=np.diag([pairs[key][1] ** 2 for key in CONSTANTS]),
        name=_name(data, path),
        scale_known=True,
    ).checked()


def _from_parts(data: Table, path: Path) -> Model:
    part_tables = [t.values for t in data.tables("part")]
    bearing_tables = [t.values for t in data.tables("bearing")] if "bearing" in data else []
    head = {k: v for k, v in data.values.items() if k not in ("name", "g_m_s2", "part", "bearing")}
    top = _Numbers(head, {"l1", "lower_inner", "lower_outer"}, str(path))
    quantities: dict[str, Quantity] = {}

    def keep(symbol: str, pair: tuple[float, float], unit: str) -> str:
        quantities[symbol] = Quantity(symbol, symbol, *pair, unit, "", "given", str(path))
        return symbol

    single = not top.values and not any(_on_elbow(t) for t in (*part_tables, *bearing_tables))
    # Nothing of a single pendulum is at the elbow, wherever that is.
    keep("l1", (1.0, 0.0) if single else top.need("l1"), "mm")
    parts: list[Part] = []
    imbalance = {1: 0.0, 2: 0.0}
    for i, table in enumerate(part_tables, 1):
        where = f"{path}, part {i} ({table.get('name', 'no name')})"
        numbers = _Numbers(table, _PART, where)
        body = numbers.integer("body", None, range(1, 3))
        count = numbers.integer("count", 1, range(1, 1001))
        mass, inertia = numbers.need("mass"), numbers.values.get("inertia", (0.0, 0.0))
        for kind, pair in (("mass", mass), ("inertia", inertia)):
            if pair[0] < 0:
                raise ModelError(fault(where, f"{kind} is negative ({pair[0]:g})"))
        if numbers.plain.get("at", "elbow") != "elbow" or ("at" in numbers.plain and body == 2):
            problem = f"at is {numbers.plain['at']!r}"
            raise ModelError(fault(where, problem, "It may only be 'elbow', for a part of body 1"))
        if "at" in numbers.plain and numbers.values.keys() & {"place", "across"}:
            raise ModelError(fault(where, "both at and a place are given", "Keep one"))
        if "at" in numbers.plain:
            along = "l1"
        else:
            along = keep(f"part {i} place", numbers.values.get("place", (0.0, 0.0)), "mm")
        across, across_sigma = numbers.values.get("across", (0.0, 0.0))
        distance = None
        if across:
            imbalance[body] += count * mass[0] * across
            value = quantities[along].value or 0.0
            true = math.hypot(value, across)
            sigma = math.hypot(value * quantities[along].sigma, across * across_sigma) / true
            distance = keep(f"part {i} distance", (true, sigma), "mm")
        m = keep(f"part {i} mass", mass, "g")
        inertia_symbol = keep(f"part {i} inertia", inertia, "g mm2")
        place = Rigid(body, along, distance)
        parts.append(
            Part(str(i), str(table.get("name", f"part {i}")), m, inertia_symbol, place, count, carried=body)
        )
    for i, table in enumerate(bearing_tables, 1):
        parts += _bearing(table, f"{path}, bearing {i}", i, keep)
    pendulum = Configuration(_name(data, path), tuple(parts), quantities, length="l1")
    g = _gravity(data, path)
    if single:
        constants, covariance, _ = constants_of(pendulum, gravity=g * 1e3)
        which = [CONSTANTS.index(key) for key in ONE_LINK]
        psi, sigma, m1 = constants[which].tolist()
        model = Model.one_link(psi, sigma, m1, g, covariance[np.ix_(which, which)], pendulum.name).checked()
    else:
        model = from_parts(pendulum, gravity=g * 1e3, name=pendulum.name)
    if g > 0:
        for body, moment in ((1, model.sigma_j / g * 1e6), (2, model.kappa_j / g * 1e6)):
            if abs(imbalance[body]) > 0.01 * abs(moment):
                raise ModelError(
                    fault(
                        str(path),
                        f"the parts of body {body} do not balance across it ({imbalance[body]:.3g} g mm, "
                        f"along it {moment:.3g} g mm)",
                        "Measure place along the line from the joint to the body's centre of mass",
                    )
                )
    return model if single else _with_extent(model, top)


def _on_elbow(table: Mapping[str, Any]) -> bool:
    """Whether a part or bearing is of the lower link or sits at the elbow: then there are two links."""
    return table.get("at") == "elbow" or 2 in (table.get("body"), table.get("inner"), table.get("outer"))


def _with_extent(model: Model, top: _Numbers) -> Model:
    """The lower link's ends: as given, else those of the uniform bar equal to the whole lower link."""
    m2 = model.m2_kg
    centre = model.kappa_j / (model.g_m_s2 * m2) if model.g_m_s2 > 0 and m2 > 0 else 0.0
    inner, outer = uniform_bar(m2, 2 * model.lambda_kg_m2 - m2 * centre**2, centre)
    if "lower_inner" in top.values:
        inner = top.values["lower_inner"][0] * 1e-3
    if "lower_outer" in top.values:
        outer = top.values["lower_outer"][0] * 1e-3
    return replace(model, lower_inner_m=inner, lower_outer_m=outer)


def _bearing(table: Mapping[str, Any], where: str, i: int, keep: Any) -> list[Part]:
    """Cage and balls of one kind of bearing (its races are ordinary parts)."""
    numbers = _Numbers(table, _BEARING, where)
    at = numbers.plain.get("at")
    if at not in ("pivot", "elbow"):
        raise ModelError(fault(where, f"at is {at!r}", "Give 'pivot' or 'elbow'"))
    count = numbers.integer("count", 1, range(1, 101))
    balls = numbers.integer("balls", None, range(1, 1001))
    races = Races(
        inner=numbers.integer("inner", None, range(3)),
        outer=numbers.integer("outer", None, range(3)),
        at_elbow=at == "elbow",
        d_inner=keep(f"bearing {i} d_inner", numbers.need("d_inner"), "mm"),
        d_ball=keep(f"bearing {i} d_ball", numbers.need("d_ball"), "mm"),
    )
    if min(numbers.need("d_inner")[0], numbers.need("d_ball")[0]) <= 0:
        raise ModelError(fault(where, "a diameter is not positive"))
    name = str(numbers.plain.get("name", f"bearing {i}"))
    carried = 1 if races.at_elbow else 0
    none = (0.0, 0.0)

    def part(what: str, place: Cage | Balls) -> Part:
        mass = keep(f"bearing {i} {what} mass", numbers.values.get(f"{what}_mass", none), "g")
        inertia = keep(f"bearing {i} {what} inertia", numbers.values.get(f"{what}_inertia", none), "g mm2")
        return Part(f"b{i}", f"{name} {what}", mass, inertia, place, count, carried)

    return [part("ball", Balls(races, balls)), part("cage", Cage(races))]
