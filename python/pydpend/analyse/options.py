"""Everything ``pydpend analyse`` can be told, and its TOML form."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from pydpend.angles import parse_zero, roll_sigma
from pydpend.documents import read_toml
from pydpend.errors import OptionError, Setting, Step, fault, one_of
from pydpend.fit_options import INTERVALS, METHODS, RATIOS, check_fit
from pydpend.kinds import Kind, expect
from pydpend.model import check_model_called

CHOICES = {
    "method": METHODS,
    "ratios": RATIOS,
    "intervals": INTERVALS,
    "estimator": ("rigid", "linkage", "pairwise"),
    "unit": ("v", "rad", "deg"),
}
"""Options that are one of a few words."""


@dataclass(frozen=True)
class Options:
    """What to analyse and how. The defaults need no thought; every field is a flag of the same name."""

    inputs: tuple[str, ...] = ()
    """Films, node tables or angles tables; several are trials of one pendulum."""
    rig: str | None = None
    """Rig file for films; found in the film if not given."""
    fps: float | None = None
    """Frames per second of recorded time, where a film does not know."""
    pixel_aspect: str | None = None
    """Width to height of a film's pixels, e.g. ``16:15``, instead of what the film says."""
    encoder: str | None = None
    """Encoder file of the first recording: time_s and voltage_v (or an angle) as CSV, TDMS or NumPy."""
    column: str | None = None
    """Column or TDMS channel of the encoder file that holds the signal, where its name does not say."""
    time_column: str | None = None
    """Column or channel of the encoder file that holds the time, where its name does not say."""
    rate_hz: float | None = None
    """Samples per second of the encoder file, where it has no time."""
    unit: str | None = None
    """Unit of the encoder's column, ``v``, ``rad`` or ``deg``, where its name does not say."""
    calibration: str | None = None
    """Folder of hold recordings, or an encoder.json made by ``pydpend calibrate``."""
    model: str = "derived"
    """``derived``, ``published`` or a pendulum.toml."""
    method: str = "trajectory"
    """``trajectory`` or ``energy``."""
    laws: str = "full"
    """``full``, ``paper`` or a list of coefficients with commas."""
    ratios: str | None = None
    """``free``: the inertial ratios are fitted too (trajectory only, and its default); ``fixed``: the model's are
    believed."""
    free: str = ""
    """Further parameters to fit, with commas: added_inertia, tilt, offset1, offset2."""
    pinned: bool = False
    """The elbow is pinned: a single pendulum. A recording of one link needs a one-link model instead."""
    ten_coefficients: bool = False
    """Also the paper's ten, with a warning; needs the energy method and the paper's laws."""
    intervals: str = "covariance"
    """``covariance``: standard errors; ``profile``: 95 % intervals by profile likelihood too (takes much longer)."""
    comparison: bool | None = None
    """Leave each term out in turn, to say which the data ask for (trajectory only, and then done if not given)."""
    prediction: bool | None = None
    """Predict each recording from the others, or the last part of a single one from the rest (the latter trajectory
    only). Done if not given, where it can be."""
    start_s: float | None = None
    """Start of the free decay; found if not given."""
    stop_s: float | None = None
    """End of the free decay; found if not given."""
    angle_maps: bool = False
    """Learn angle-dependent tracking bias with the fit."""
    zero: str = "rest"
    """Where the links hang: ``rest`` (found in the recording), ``vertical`` (the picture's, uncertain by the camera's
    roll: 1 deg, or ``vertical=0.5``), ``reference_frame``, degrees of each link in the rig's reference picture
    (``180,180``), or a film or node table of the same rig hanging still."""
    bodies: str | None = None
    """Names of the links in node tables from the pivot outwards, with a comma; the rig's order if not given."""
    mirrored: bool = False
    """The film is mirror-inverted or taken from behind."""
    link_length_m: float | None = None
    """Pivot to elbow in m, for the scale."""
    estimator: str = "rigid"
    """How angles come from nodes: ``rigid``, ``linkage`` or ``pairwise``."""
    columns: str | None = None
    """Which columns of angles tables are which, e.g. ``time_s=t_s,phi1_rad=theta1_rad,phi2_rad=theta2_rad``."""
    hanging_deg: float = 0.0
    """Angle in degrees that angles tables have when the links hang straight down."""
    clockwise: bool = False
    """Angles tables count clockwise positive."""
    unwrap: bool = False
    """Angles tables keep their angles within one turn; rows are then taken to be less than half a turn apart."""
    overlay: bool = True
    """Draw what was found into the film, for the page. It takes about as long as tracking."""
    threads: int | None = None
    """Threads for tracking; all cores if not given. Changes no result."""

    def __post_init__(self) -> None:
        for field, known in CHOICES.items():
            value = getattr(self, field)
            if value is not None and value not in known:
                raise OptionError(one_of(field, value, known))
        check_fit(self.method, self.laws, vars(self), single=self.pinned)
        if self.columns is not None and any(
            not (ours.strip() and theirs.strip())
            for ours, _, theirs in (word.partition("=") for word in self.columns.split(","))
        ):
            raise OptionError(
                fault(
                    Setting("columns"),
                    f"{self.columns!r} is not OURS=THEIRS,...",
                    "Write time_s=t,phi1_rad=theta1",
                )
            )
        for name in ("fps", "rate_hz", "link_length_m"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise OptionError(fault(Setting(name), f"{value:g} is not above 0", "Give a number above 0"))
        if self.threads is not None and self.threads < 1:
            raise OptionError(fault(Setting("threads"), f"{self.threads} is below 1", "Give 1 or more"))
        for option in ("calibration", "column", "time_column", "rate_hz", "unit"):
            if getattr(self, option) is not None and self.encoder is None:
                raise OptionError(
                    fault(
                        Setting(option),
                        "is of the encoder's file",
                        "Name the file with " + Setting("encoder"),
                    )
                )


WANTED: Mapping[str, tuple[Kind, ...]] = {
    "rig": ("rig",),
    "encoder": ("encoder", "angles"),
    "calibration": ("calibration", "tables", "encoder"),
    "model": ("model",),
    "zero": ("film", "pictures", "nodes"),
}
"""What a file that an option names may be."""


def check_files(options: Options) -> None:
    """Whether the files that options name are there and what they are to be. Raises OptionError, naming the option,
    before anything is done."""
    for field, kinds in WANTED.items():
        name = getattr(options, field)
        if name is None or (field == "zero" and parse_zero(name) is not None):
            continue
        expect(name, kinds, OptionError, field)
        if field in ("rig", "encoder", "calibration") and not Path(name).exists():
            raise OptionError(fault(Setting(field), f"there is no file {name}", "Check the name"))
    check_model_called(options.model)
    zero = options.zero
    said = parse_zero(zero)
    if said is None and not Path(zero).exists():
        raise OptionError(
            fault(
                Setting("zero"),
                f"{zero} is no file and no degrees",
                "Give rest, vertical, reference_frame, 180,180, or a film or node table",
            )
        )
    if isinstance(said, str) and said.startswith("vertical"):
        roll_sigma(said)


def flag_of(field: str) -> str:
    """The flag of ``pydpend analyse`` for a field: ``start_s`` is ``--start``."""
    return "--" + field.removesuffix("_s").removesuffix("_deg").replace("_", "-")


WRITE_CONFIG = Step(
    "pydpend analyse --write-config", "pydpend.analyse.write_config(pydpend.analyse.Options())"
)
"""Prints every option with its default."""
READ_CONFIG = Step("pydpend analyse --config THIS_FILE", "pydpend.analyse.read_config(THIS_FILE)")
"""Uses a file of options."""


OLD_NAMES = {"encoder_column": "column"}
"""Names that options had."""


def read_config(path: str | Path) -> Options:
    """Options from a TOML file as ``--write-config`` writes it. Unknown keys are errors."""
    expect(path, ("config",), OptionError)
    raw = read_toml(Path(path), OptionError, "Start from what " + WRITE_CONFIG + " prints")
    known = {f.name: f for f in fields(Options)}
    values: dict[str, Any] = {}
    for key in raw:
        if key in OLD_NAMES:
            raw.refuse(key, f"the option is called {OLD_NAMES[key]} now", "Rename the key")
        if key not in known:
            raw.refuse(key, f"{key} is not an option", f"Known are {', '.join(known)}")
        wanted = str(known[key].type)
        if key == "inputs":
            values[key] = raw.texts(key)
        elif wanted.startswith("bool"):
            values[key] = raw.flag(key)
        elif wanted.startswith("int"):
            values[key] = raw.whole(key, -(2**31), 2**31 - 1)
        elif wanted.startswith("float"):
            values[key] = raw.number(key)
        else:
            values[key] = raw.text(key)
    return Options(**values)


def write_config(options: Options) -> str:
    """The options as TOML, each with what it means; what is not set is commented out."""
    docs = _field_docs()
    lines = [f"# {READ_CONFIG}", ""]
    for f in fields(Options):
        value = getattr(options, f.name)
        lines += [f"# {line}" for line in docs[f.name].splitlines()]
        if value is None:
            lines.append(f"# {f.name} = ")
        elif isinstance(value, bool):
            lines.append(f"{f.name} = {str(value).lower()}")
        elif isinstance(value, tuple):
            lines.append(f"{f.name} = [{', '.join(_quoted(v) for v in value)}]")
        elif isinstance(value, str):
            lines.append(f"{f.name} = {_quoted(value)}")
        else:
            lines.append(f"{f.name} = {value!r}")
        lines.append("")
    return "\n".join(lines)


def _quoted(text: str) -> str:
    """A TOML basic string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'


def _field_docs() -> dict[str, str]:
    """What the string under each field of `Options` says; the one place where options are explained."""
    import ast
    import inspect

    body = ast.parse(inspect.getsource(Options)).body[0]
    assert isinstance(body, ast.ClassDef)
    docs = {f.name: "" for f in dataclasses.fields(Options)}
    for this, following in zip(body.body, body.body[1:], strict=False):
        if (
            isinstance(this, ast.AnnAssign)
            and isinstance(this.target, ast.Name)
            and isinstance(following, ast.Expr)
            and isinstance(following.value, ast.Constant)
        ):
            docs[this.target.id] = str(following.value.value)
    return docs


option_docs = _field_docs
