"""Everything ``pydpend analyse`` can be told, and its TOML form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, fields, replace
from pathlib import Path
from typing import Any

from pydpend.documents import read_toml
from pydpend.errors import OptionError, Setting, Step, fault, one_of
from pydpend.fit_options import FitOptions
from pydpend.kinds import Kind, expect
from pydpend.kinematics import parse_zero, roll_sigma
from pydpend.kinematics.setting_words import axes_in_words, pivots_in_words, scales_in_words
from pydpend.model import check_model_called
from pydpend.option_fields import choices_of, kind_of_value, meanings, option
from pydpend.reading_options import ReadingOptions

ESTIMATORS = ("rigid", "linkage", "pairwise")
"""How angles come from nodes."""


@dataclass(frozen=True, kw_only=True)
class Options(FitOptions, ReadingOptions):
    """Recordings to analyse and how; the defaults need no thought.

    Every parameter is a flag of the same name, those of the fit (`FitOptions`) and of reading films (`ReadingOptions`)
    too.

    Parameters
    ----------
    inputs : tuple of str
        Films, node tables or angles tables; several are trials of one pendulum.
    rig : str, optional
        Rig file for films; found in the film if not given.
    marker : tuple of str
        Place of a marker in a film, ``X,Y`` or ``X,Y@FRAME`` in px; once for each that is to be followed.
    markers : int, optional
        How many markers a film shows.
    also : str, optional
        Numbers of the picture of ``pydpend setup`` that are to be followed too, with commas.
    same : tuple of str
        Two nodes of a film that are one marker, ``n1=n2``; once for each pair.
    edits : str, optional
        File of people's decisions on the markers of a film (docs/reference/edits.md), made before angles are taken.
    encoder : str, optional
        Encoder file of the first recording: time_s and voltage_v (or an angle) as CSV, TDMS or NumPy.
    column : str, optional
        Column or TDMS channel of the encoder file that holds the signal, where its name does not say.
    time_column : str, optional
        Column or channel of the encoder file that holds the time, where its name does not say.
    rate_hz : float, optional
        Samples per second of the encoder file, where it has no time.
    unit : str, optional
        Unit of the encoder's column, ``v``, ``rad`` or ``deg``, where its name does not say.
    calibration : str, optional
        Folder of hold recordings, or an encoder.json made by ``pydpend calibrate``.
    model : str
        ``derived``, ``published``, a pendulum.toml, or ``ratios`` (no masses are known: all is over psi).
    zero : str
        Where the links hang: ``rest`` (found in the recording), ``vertical`` (the picture's, uncertain by the
        camera's roll: 1 deg, or ``vertical=0.5``), ``reference_frame``, degrees of each link in the rig's
        reference picture (``180,180``), or a film or node table of the same rig hanging still.
    bodies : str, optional
        Names of the links in node tables from the pivot outwards, with a comma; the rig's order if not given.
    mirrored : bool
        The film is mirror-inverted or taken from behind.
    link_length_m : float, optional
        Pivot to elbow in m, for the scale.
    estimator : str
        How angles come from nodes: ``rigid``, ``linkage`` or ``pairwise``.
    axis : tuple of str
        The line of a link that is vertical or horizontal at 0, from marker or joint A to B, ``upper=pivot-elbow``;
        once for each link.
    pivot : tuple of str
        Where a link of one marker hangs, ``X,Y`` or ``X,Y,SIGMA`` in px in the picture, ``bob=X,Y`` where there are
        several; once for each link.
    scale : tuple of str
        A distance that is known, in m, ``n0-n3=0.1719`` or ``n0-n3=0.1719,0.0002`` with its uncertainty, between
        markers or joints of one link or of the ground, or places in the picture (``10,20-410,22=0.5``); several are
        averaged and compared.
    origin : str, optional
        Where places are counted from: a joint of the ground, or a place ``X,Y`` in px; the pivot if not given.
    points : str, optional
        Markers and joints whose speeds are told, with commas; the joints that move and each link's last marker if
        not given.
    columns : str, optional
        Which columns of angles tables are which, e.g. ``time_s=t_s,phi1_rad=theta1_rad,phi2_rad=theta2_rad``.
    hanging_deg : float
        Angle in degrees that angles tables have when the links hang straight down.
    clockwise : bool
        Angles tables count clockwise positive.
    unwrap : bool
        Angles tables keep their angles within one turn; rows are then taken to be less than half a turn
        apart.
    overlay : bool
        Draw what was found into the film, for the page. It takes about as long as tracking.

    Raises
    ------
    OptionError
        For a value that is not known or makes no sense.
    """

    inputs: tuple[str, ...] = ()
    rig: str | None = None
    marker: tuple[str, ...] = ()
    markers: int | None = None
    also: str | None = None
    same: tuple[str, ...] = ()
    edits: str | None = None
    encoder: str | None = None
    column: str | None = None
    time_column: str | None = None
    rate_hz: float | None = None
    unit: str | None = option(None, choices=("v", "rad", "deg"))
    calibration: str | None = None
    model: str = "derived"
    zero: str = "rest"
    bodies: str | None = None
    mirrored: bool = False
    link_length_m: float | None = None
    estimator: str = option("rigid", choices=ESTIMATORS)
    axis: tuple[str, ...] = ()
    pivot: tuple[str, ...] = ()
    scale: tuple[str, ...] = ()
    origin: str | None = None
    points: str | None = None
    columns: str | None = None
    hanging_deg: float = 0.0
    clockwise: bool = False
    unwrap: bool = False
    overlay: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in fields(self):
            value, known = getattr(self, field.name), choices_of(field)
            if known and value is not None and value not in known:
                raise OptionError(one_of(field.name, value, known))
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
        axes_in_words(self.axis)
        pivots_in_words(self.pivot)
        scales_in_words(self.scale)
        for reads in (self.opened, self.detected, self.span):
            reads()
        for name in ("calibration", "column", "time_column", "rate_hz", "unit"):
            if getattr(self, name) is not None and self.encoder is None:
                raise OptionError(
                    fault(
                        Setting(name),
                        "is of the encoder's file",
                        "Name the file with " + Setting("encoder"),
                    )
                )

    def of_markers(self) -> dict[str, Any]:
        """The options of markers in films, as `pydpend.track` takes them.

        Returns
        -------
        dict of str to object
            Keywords and their values; nothing where nothing was said.
        """
        names = ("marker", "markers", "also", "same")
        plain = Options()
        said = {name: getattr(self, name) for name in names}
        return {name: value for name, value in said.items() if value != getattr(plain, name)}

    def joint_fit(self, several: bool) -> FitOptions:
        """The options of the fit to all recordings.

        Where there are ``several``, each is predicted from the others in a stage of its own.
        """
        chosen = self.fit.as_programs_do()
        return replace(chosen, prediction=False) if several else chosen


WANTED: Mapping[str, tuple[Kind, ...]] = {
    "rig": ("rig",),
    "edits": ("edits",),
    "encoder": ("encoder", "angles"),
    "calibration": ("calibration", "tables", "encoder"),
    "model": ("model",),
    "zero": ("film", "pictures", "nodes"),
}
"""Kinds of file that an option may name."""


def check_files(options: Options) -> None:
    """Whether the files that options name are there and what they are to be.

    Raises OptionError, naming the option, before anything is done.
    """
    for field, kinds in WANTED.items():
        name = getattr(options, field)
        if name is None or (field == "zero" and parse_zero(name) is not None):
            continue
        expect(name, kinds, OptionError, field)
        if field in ("rig", "edits", "encoder", "calibration") and not Path(name).exists():
            raise OptionError(fault(Setting(field), f"there is no file {name}", "Check the name"))
    check_model_called(options.model)
    zero = options.zero
    said = parse_zero(zero)
    if said is None and not Path(zero).exists():
        raise OptionError(
            fault(
                Setting("zero"),
                f"{zero} is no file and no degrees",
                "Give rest, vertical, horizontal, reference_frame, 180,180, or a film or node table",
            )
        )
    if isinstance(said, str) and said.startswith(("vertical", "horizontal")):
        roll_sigma(said)


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
    known = {f.name: f for f in all_options()}
    values: dict[str, Any] = {}
    for key in raw:
        if key in OLD_NAMES:
            raw.refuse(key, f"the option is called {OLD_NAMES[key]} now", "Rename the key")
        if key not in known:
            raw.refuse(key, f"{key} is not an option", f"Known are {', '.join(known)}")
        match kind_of_value(known[key]):
            case "texts":
                values[key] = raw.texts(key)
            case "flag":
                values[key] = raw.flag(key)
            case "whole":
                values[key] = raw.whole(key, -(2**31), 2**31 - 1)
            case "number":
                values[key] = raw.number(key)
            case "text":
                values[key] = raw.text(key)
    return Options(**values)


def all_options() -> list[Field[Any]]:
    """Every option: what is analysed and how films are read first, how the damping is fitted last."""
    part = dict.fromkeys((f.name for f in fields(ReadingOptions)), 1)
    part |= dict.fromkeys((f.name for f in fields(FitOptions)), 2)
    return sorted(fields(Options), key=lambda f: part.get(f.name, 0))


def write_config(options: Options) -> str:
    """The options as TOML, each with what it means; what is not set is commented out."""
    docs = meanings(Options)
    lines = [f"# {READ_CONFIG}", ""]
    for f in all_options():
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
