"""Everything ``pydpend analyse`` can be told, and its TOML form."""

from __future__ import annotations

import dataclasses
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from pydpend.coefficients import PAPER, coefficients
from pydpend.errors import FitError, PydpendError, fault

CHOICES = {
    "method": ("trajectory", "energy"),
    "ratios": ("free", "fixed"),
    "intervals": ("covariance", "profile"),
    "estimator": ("rigid", "linkage", "pairwise"),
}
"""Options that are one of a few words."""

FREE = ("added_inertia", "tilt", "offset1", "offset2")
"""What ``free`` may name."""


class OptionsError(PydpendError):
    """An option that is not known or makes no sense."""


@dataclass(frozen=True)
class Options:
    """What to analyse and how. The defaults need no thought; every field is a flag of the same name."""

    inputs: tuple[str, ...] = ()
    """Films, node tables or angles tables; several are trials of one pendulum."""
    rig: str | None = None
    """Rig file for films; found in the film if not given."""
    fps: float | None = None
    """Frames per second of recorded time, where a film does not know."""
    encoder: str | None = None
    """Encoder file of the first recording: time_s and voltage_v (or an angle) as CSV, TDMS or NumPy."""
    encoder_column: str | None = None
    """Column of the encoder file that holds the signal, where its name does not say."""
    calibration: str | None = None
    """Folder of hold recordings, or an encoder.json made by ``pydpend calibrate``."""
    model: str = "derived"
    """``derived``, ``published`` or a pendulum.toml."""
    method: str = "trajectory"
    """``trajectory`` or ``energy``."""
    laws: str = "full"
    """``full``, ``paper`` or a list of coefficients with commas."""
    ratios: str = "free"
    """``free``: the inertial ratios are fitted too; ``fixed``: the model's are believed (trajectory only)."""
    free: str = ""
    """Further parameters to fit, with commas: added_inertia, tilt, offset1, offset2."""
    pinned: bool = False
    """The elbow is pinned: a single pendulum. A recording of one link needs a one-link model instead."""
    ten_coefficients: bool = False
    """Also the paper's ten, with a warning; needs ``--method energy --laws paper``."""
    intervals: str = "covariance"
    """``covariance``: standard errors; ``profile``: 95 % intervals by profile likelihood too (takes much longer)."""
    comparison: bool = True
    """Leave each term out in turn, to say which the data ask for (trajectory only)."""
    prediction: bool = True
    """Predict each recording from the others, or the last part of a single one from the rest (trajectory only)."""
    start_s: float | None = None
    """Start of the free decay; found if not given."""
    stop_s: float | None = None
    """End of the free decay; found if not given."""
    angle_maps: bool = False
    """Learn angle-dependent tracking bias with the fit."""
    zero: str = "rest"
    """Where the links hang: ``rest`` (found in the recording), ``reference_frame``, degrees of each link in the
    rig's reference frame (``180,180``), or a film or node table of the same rig hanging still."""
    link_length_m: float | None = None
    """Pivot to elbow in m, for the scale."""
    estimator: str = "rigid"
    """How angles come from nodes: ``rigid``, ``linkage`` or ``pairwise``."""
    columns: str | None = None
    """Which columns of angles tables are which, e.g. ``time_s=t_s,phi1_rad=theta1_rad,phi2_rad=theta2_rad``."""
    hanging_deg: float = 0.0
    """What angles tables call hanging down."""
    overlay: bool = True
    """Draw what was found into the film, for the page. It takes about as long as tracking."""
    threads: int | None = None
    """Threads for tracking; all cores if not given. Changes no result."""

    def __post_init__(self) -> None:
        for field, known in CHOICES.items():
            value = getattr(self, field)
            if value not in known:
                words = f"{', '.join(known[:-1])} or {known[-1]}"
                raise OptionsError(fault(flag_of(field), f"{value!r} is not known", f"Give {words}"))
        unknown = [name for name in self.free.split(",") if name and name not in FREE]
        if unknown:
            raise OptionsError(
                fault("--free", f"{unknown[0]!r} is not known", f"Known are {', '.join(FREE)}")
            )
        try:
            laws = coefficients(self.laws)
        except FitError as error:
            raise OptionsError(f"--{error}") from None
        if self.ten_coefficients and not (self.method == "energy" and laws == PAPER):
            raise OptionsError(
                fault(
                    "--ten-coefficients",
                    "they are of the energy method with the paper's laws",
                    "Add --method energy --laws paper",
                )
            )
        if self.method == "energy":
            for field, plain in (("intervals", "covariance"), ("free", ""), ("angle_maps", False)):
                if getattr(self, field) != plain:
                    raise OptionsError(
                        fault(flag_of(field), "is of the trajectory fit", "Leave it or --method energy out")
                    )
        if self.columns is not None and any(
            not (ours.strip() and theirs.strip())
            for ours, _, theirs in (word.partition("=") for word in self.columns.split(","))
        ):
            raise OptionsError(
                fault(
                    "--columns", f"{self.columns!r} is not OURS=THEIRS,...", "Write time_s=t,phi1_rad=theta1"
                )
            )
        if self.fps is not None and not self.fps > 0:
            raise OptionsError(fault("--fps", f"{self.fps} is not above 0"))
        if self.threads is not None and self.threads < 1:
            raise OptionsError(fault("--threads", f"{self.threads} is below 1"))
        if self.start_s is not None and self.stop_s is not None and not self.start_s < self.stop_s:
            raise OptionsError(fault("--start", f"{self.start_s} s is not before --stop, {self.stop_s} s"))


def check_files(options: Options) -> None:
    """Whether the files that options name are there. Raises OptionsError, naming the flag, before anything is done."""
    for field in ("rig", "encoder", "calibration"):
        name = getattr(options, field)
        if name is not None and not Path(name).exists():
            raise OptionsError(fault(f"{flag_of(field)} {name}", "there is no such file", "Check the name"))
    if options.model not in ("derived", "published") and not Path(options.model).is_file():
        raise OptionsError(
            fault(
                f"--model {options.model}", "there is no such file", "Give derived, published or a TOML file"
            )
        )
    zero = options.zero
    if zero not in ("rest", "reference_frame") and not Path(zero).exists():
        try:
            [float(word) for word in zero.split(",")]
        except ValueError:
            raise OptionsError(
                fault(
                    f"--zero {zero}",
                    "is no file and no degrees",
                    "Give rest, reference_frame, 180,180, or a film or node table",
                )
            ) from None


def flag_of(field: str) -> str:
    """The flag of ``pydpend analyse`` for a field: ``start_s`` is ``--start``."""
    return "--" + field.removesuffix("_s").removesuffix("_deg").replace("_", "-")


def read_config(path: str | Path) -> Options:
    """Options from a TOML file as ``--write-config`` writes it. Unknown keys are errors."""
    name = str(path)
    try:
        with open(path, "rb") as f:
            raw = tomllib.load(f)
    except OSError as error:
        raise OptionsError(fault(name, f"cannot be read ({error.strerror})")) from None
    except tomllib.TOMLDecodeError as error:
        raise OptionsError(fault(name, f"is not TOML ({error})", "Start from --write-config")) from None
    known = {f.name: f for f in fields(Options)}
    values: dict[str, Any] = {}
    for key, value in raw.items():
        if key not in known:
            raise OptionsError(
                fault(name, f"{key} is not an option", f"Known are {', '.join(known)}", place=f"key {key}")
            )
        wanted = str(known[key].type)
        if key == "inputs":
            if not (isinstance(value, list) and all(isinstance(v, str) for v in value)):
                raise OptionsError(fault(name, "a list of file names is expected", place="key inputs"))
            value = tuple(value)
        elif wanted.startswith("bool"):
            if not isinstance(value, bool):
                raise OptionsError(
                    fault(name, f"true or false is expected, not {value!r}", place=f"key {key}")
                )
        elif wanted.startswith(("float", "int")):
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise OptionsError(fault(name, f"a number is expected, not {value!r}", place=f"key {key}"))
        elif not isinstance(value, str):
            raise OptionsError(fault(name, f"text is expected, not {value!r}", place=f"key {key}"))
        values[key] = value
    return Options(**values)


def write_config(options: Options) -> str:
    """The options as TOML, each with what it means; what is not set is commented out."""
    docs = _field_docs()
    lines = ["# pydpend analyse --config THIS_FILE", ""]
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
