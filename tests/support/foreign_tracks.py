"""Files of other programs' tracks: the bundled ones, and, of programs that do not run here, ones after their documents.

Each writer's docstring names what it follows. All hold the places of ``fixtures/tracks/truth.csv``: 60 frames at 250 Hz
of four points in pictures of 640 x 480 px.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

TRACKS = Path(__file__).parents[2] / "fixtures" / "tracks"
RATE_HZ = 250.0
IMAGE_PX = (640, 480)
NAMES = ("pin", "mid", "elbow", "tip")
BODIES = {"upper": NAMES[:2], "lower": NAMES[2:]}

Floats = NDArray[np.float64]


def truth() -> Floats:
    """Places in px, x right, y down, (60, 4, 2); NaN where not seen."""
    table = pd.read_csv(TRACKS / "truth.csv")
    out = np.full((60, 4, 2), np.nan)
    out[table.frame, [NAMES.index(n) for n in table.node]] = table[["x_px", "y_px"]]
    return out


def upwards(xy: Floats) -> Floats:
    """The same from the middle of the lowest row of pixels, y up."""
    return np.stack([xy[..., 0], IMAGE_PX[1] - 1 - xy[..., 1]], axis=-1)


def _cell(value: float) -> str:
    return "" if np.isnan(value) else repr(float(value))


def dltdv(path: Path, xy: Floats) -> None:
    """DLTdv8's ``xypts.csv`` (https://biomech.web.unc.edu/dltdv/): pixels from 1, y from the lowest row, NaN."""
    header = ",".join(f"pt{i}_cam1_{a}" for i in range(1, 5) for a in "XY")
    rows = (upwards(xy) + 1).reshape(len(xy), -1)
    lines = [",".join("NaN" if np.isnan(v) else repr(float(v)) for v in row) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n", "utf-8")


def osp_text(path: Path, xy: Floats, point: int = 0) -> None:
    """Tracker 6's exported data: the track's name, then names and rows of a table, by tabs.

    As `ExportDataDialog.saveAsAction` and `TrackerIO.getData` write it (github OpenSourcePhysics/tracker).
    """
    seen = [i for i in range(len(xy)) if np.isfinite(xy[i, point, 0])]
    up = upwards(xy)
    lines = [f"{i / RATE_HZ!r}\t{float(up[i, point, 0])!r}\t{float(up[i, point, 1])!r}" for i in seen]
    path.write_text("\n".join([f"mass_{NAMES[point]}", "t\tx\ty", *lines]) + "\n", "utf-8")


def osp_trk(path: Path, xy: Floats) -> None:
    """Tracker's tab, after ``src2/test/osp/car.trk`` of github OpenSourcePhysics/tracker; px from the corner."""
    masses = []
    for n, name in enumerate(NAMES):
        steps = "".join(
            f'<property name="[{i}]" type="object"><object class="{_OSP}PointMass$FrameData">'
            f'<property name="x" type="double">{float(xy[i, n, 0]) + 0.5!r}</property>'
            f'<property name="y" type="double">{float(xy[i, n, 1]) + 0.5!r}</property></object></property>\n'
            for i in range(len(xy))
            if np.isfinite(xy[i, n, 0])
        )
        masses.append(
            f'<property name="item" type="object"><object class="{_OSP}PointMass"><property name="mass" type="double">'
            f'1.0</property><property name="name" type="string">{name}</property><property name="framedata" '
            f'type="array" class="[L{_OSP}PointMass$FrameData;">\n{steps}</property></object></property>\n'
        )
    path.write_text(_TRK.format(osp=_OSP, masses="".join(masses)), "utf-8")


_OSP = "org.opensourcephysics.cabrillo.tracker."
_TRK = """<?xml version="1.0" encoding="UTF-8"?>
<object class="{osp}TrackerPanel">
    <property name="semantic_version" type="string">5.0.7</property>
    <property name="width" type="double">640.0</property>
    <property name="height" type="double">480.0</property>
    <property name="videoclip" type="object"><object class="org.opensourcephysics.media.core.VideoClip">
        <property name="startframe" type="int">0</property>
        <property name="starttime" type="double">0.0</property>
    </object></property>
    <property name="clipcontrol" type="object"><object class="org.opensourcephysics.media.core.StepperClipControl">
        <property name="delta_t" type="double">4.0</property>
    </object></property>
    <property name="coords" type="object"><object class="org.opensourcephysics.media.core.ImageCoordSystem">
        <property name="framedata" type="array"><property name="[0]" type="object"><object>
            <property name="xscale" type="double">930.5</property></object></property></property>
    </object></property>
    <property name="length_unit" type="string">m</property>
    <property name="tracks" type="collection" class="java.util.ArrayList">
    <property name="item" type="object"><object class="{osp}CoordAxes"></object></property>
    <property name="item" type="object"><object class="{osp}TapeMeasure"></object></property>
{masses}    </property>
</object>
"""


def kinovea_csv(path: Path, xy: Floats, comma: bool = False) -> None:
    """Kinovea's CSV, as `ExporterCSV` writes it (github Kinovea/Kinovea); with the decimal comma of some systems."""
    up = upwards(xy)
    parter = ";" if comma else ","

    def cell(value: float) -> str:
        text = _cell(value)
        return f'"{text.replace(".", ",") if comma else text}"' if text else ""

    header = parter.join(['"Time"', *(f'"{n}/0/{a}"' for n in NAMES for a in "XY")])
    rows = [parter.join(cell(v) for v in (i / RATE_HZ, *up[i].ravel())) for i in range(len(up))]
    path.write_text("\r\n".join([header, *rows]) + "\r\n", "utf-8")


def kinovea_text(path: Path, xy: Floats) -> None:
    """Kinovea's trajectory text, as `ExporterTXTTrajectory` writes it (github Kinovea/Kinovea), with decimal commas."""
    lines = ["#Kinovea Trajectory data export", "#T X Y", ""]
    for n, name in enumerate(NAMES):
        lines.append(f"# {name}")
        for i, (x, y) in enumerate(upwards(xy)[:, n]):
            if np.isfinite(x):
                lines.append(f"{i / RATE_HZ!r} {float(x)!r} {float(y)!r}".replace(".", ","))
        lines.append("")
    path.write_text("\n".join(lines), "utf-8")


def kinovea_kva(path: Path, xy: Floats) -> None:
    """Kinovea's annotations, as `MetadataSerializer` and `AbstractTrackPoint` write them (github Kinovea/Kinovea)."""
    tracks = []
    for n, name in enumerate(NAMES):
        points = "".join(
            f"<TrackPoint>{float(x) + 0.5!r};{float(y) + 0.5!r};{1000 + 512 * i}</TrackPoint>"
            for i, (x, y) in enumerate(xy[:, n])
            if np.isfinite(x)
        )
        tracks.append(
            f'<Track id="{n}" name="{name}"><TrackPointList Count="60">{points}</TrackPointList></Track>'
        )
    path.write_text(
        '<?xml version="1.0" encoding="utf-8"?>\n<KinoveaVideoAnalysis><FormatVersion>2.0</FormatVersion>'
        "<ImageSize>640;480</ImageSize><AverageTimeStampsPerFrame>512</AverageTimeStampsPerFrame>"
        "<CaptureFramerate>250</CaptureFramerate><FirstTimeStamp>1000</FirstTimeStamp>"
        f"<Tracks>{''.join(tracks)}</Tracks></KinoveaVideoAnalysis>\n",
        "utf-8",
    )


def trackmate_csv(path: Path, xy: Floats) -> None:
    """TrackMate 7's table of spots: four lines of names and units (https://imagej.net/plugins/trackmate/)."""
    lines = [
        "LABEL,ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,POSITION_Z,POSITION_T,FRAME,RADIUS",
        "Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,Radius",
        "Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,R",
        ",,,(quality),(pixel),(pixel),(pixel),(sec),,(pixel)",
        "ID900,900,,1.0,1.5,2.5,0.0,0.0,0,3.0",
    ]
    for i, n in np.argwhere(np.isfinite(xy[..., 0])).tolist():
        x, y = map(float, xy[i, n])
        lines.append(f"ID{4 * i + n},{4 * i + n},{n},1.0,{x!r},{y!r},0.0,{i / RATE_HZ!r},{i},3.0")
    path.write_text("\n".join(lines) + "\n", "utf-8")


def trackmate_xml(path: Path, xy: Floats) -> None:
    """TrackMate's own file, after https://imagej.net/plugins/trackmate/developers and `TmXmlWriter`."""
    spots, tracks = [], []
    for n in range(4):
        seen = np.flatnonzero(np.isfinite(xy[:, n, 0])).tolist()
        for i in seen:
            x, y = map(float, xy[i, n])
            spots.append(
                f'<Spot ID="{4 * i + n}" POSITION_X="{x!r}" POSITION_Y="{y!r}" POSITION_Z="0.0" '
                f'POSITION_T="{i / RATE_HZ!r}" FRAME="{i}" />'
            )
        edges = "".join(
            f'<Edge SPOT_SOURCE_ID="{4 * a + n}" SPOT_TARGET_ID="{4 * b + n}" />' for a, b in pairwise(seen)
        )
        tracks.append(f'<Track name="Track_{n}" TRACK_ID="{n}">{edges}</Track>')
    kept = "".join(f'<TrackID TRACK_ID="{n}" />' for n in range(4))
    stray = '<Track name="stray" TRACK_ID="9"><Edge SPOT_SOURCE_ID="0" SPOT_TARGET_ID="1" /></Track>'
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<TrackMate version="7.11.1">'
        '<Model spatialunits="pixel" timeunits="sec">'
        f"<AllSpots><SpotsInFrame frame='0'>{''.join(spots)}</SpotsInFrame></AllSpots>"
        f"<AllTracks>{''.join(tracks)}{stray}</AllTracks><FilteredTracks>{kept}</FilteredTracks></Model></TrackMate>\n",
        "utf-8",
    )


def trackmate_tracks(path: Path, xy: Floats) -> None:
    """TrackMate's exported tracks, as `ExportTracksToXML` writes them (github trackmate-sc/TrackMate)."""
    particles = []
    for n in range(4):
        seen = np.flatnonzero(np.isfinite(xy[:, n, 0])).tolist()
        spots = "".join(
            f'<detection t="{i}" x="{xy[i, n, 0]!r}" y="{xy[i, n, 1]!r}" z="0.0" />' for i in seen
        )
        particles.append(
            f'<particle nSpots="{len(seen)}">{spots.replace("np.float64(", "").replace(")", "")}</particle>'
        )
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<Tracks nTracks="4" spaceUnits="pixel" frameInterval="0.004" '
        f'timeUnits="sec" generationDateTime="now" from="TrackMate v7.11.1">{"".join(particles)}</Tracks>\n',
        "utf-8",
    )


def qualisys(path: Path, xy: Floats, titles: bool = False) -> None:
    """Qualisys's TSV (https://docs.qualisys.com/qtm, "Motion data (.tsv)"): mm, the plane is X and Z, gaps are zero."""
    head = [
        "NO_OF_FRAMES\t60",
        "NO_OF_CAMERAS\t8",
        "NO_OF_MARKERS\t4",
        "FREQUENCY\t250",
        "NO_OF_ANALOG\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2024-05-01, 12:00:00.000\t912.5",
        "DATA_INCLUDED\t3D",
        "MARKER_NAMES\t" + "\t".join(NAMES),
        "TRAJECTORY_TYPES\t" + "\t".join(["Measured"] * 4),
    ]
    if titles:
        head.append("Frame\tTime\t" + "\t".join(f"{n} {a}" for n in NAMES for a in "XYZ"))
    up = upwards(xy)
    lines = []
    for i in range(len(up)):
        cells = [str(i + 1), repr(i / RATE_HZ)] if titles else []
        for x, z in up[i]:
            cells += ["0.000"] * 3 if np.isnan(x) else [repr(float(x)), "12.5", repr(float(z))]
        lines.append("\t".join(cells))
    path.write_text("\n".join([*head, *lines]) + "\n", "utf-8")


def trc(path: Path, xy: Floats, unit: str = "mm") -> None:
    """A TRC by the library trc-data-reader: five decimals, gaps are empty."""
    from trc import TRCData

    data = TRCData()
    data["PathFileType"], data["DataFormat"] = "4", "(X/Y/Z)"
    data["FileName"] = path.name
    data["DataRate"] = data["CameraRate"] = data["OrigDataRate"] = RATE_HZ
    data["NumFrames"] = data["OrigNumFrames"] = len(xy)
    data["NumMarkers"], data["Units"], data["OrigDataStartFrame"] = 4, unit, 1
    data["Markers"] = list(NAMES)
    up = upwards(xy)
    data["Frame#"], data["Time"] = list(range(1, len(xy) + 1)), [i / RATE_HZ for i in range(len(xy))]
    for i in range(len(xy)):
        points = [[float(x), float(y), 0.0] for x, y in up[i]]
        data[i + 1] = (i / RATE_HZ, points)
    for n, name in enumerate(NAMES):
        data[name] = [[float(x), float(y), 0.0] for x, y in up[:, n]]
    data.save(str(path))


def c3d(path: Path, xy: Floats, unit: str = "mm") -> None:
    """A C3D by the library c3d, which has no part in reading it; -1 is its word for a gap."""
    import c3d as library

    writer = library.Writer(point_rate=RATE_HZ, analog_rate=0, point_units=unit)
    writer.set_point_labels(list(NAMES))
    up = upwards(xy)
    frames: list[Any] = []
    for i in range(len(up)):
        points = np.zeros((4, 5), dtype=np.float32)
        seen = np.isfinite(up[i, :, 0])
        points[:, :2] = np.nan_to_num(up[i])
        points[:, 3] = np.where(seen, 0.25, -1)
        frames.append((points, np.zeros((0, 0), dtype=np.float32)))
    writer.add_frames(frames)
    with path.open("wb") as file:
        writer.write(file)


WRITERS: dict[str, tuple[Callable[[Path, Floats], None], dict[str, Any]]] = {
    "xypts.csv": (dltdv, {"fps": RATE_HZ}),
    "tab.trk": (osp_trk, {}),
    "kinovea.csv": (kinovea_csv, {"unit": "px"}),
    "kinovea.txt": (kinovea_text, {"unit": "px"}),
    "kinovea.kva": (kinovea_kva, {}),
    "spots.csv": (trackmate_csv, {}),
    "model.xml": (trackmate_xml, {}),
    "tracks.xml": (trackmate_tracks, {}),
    "qualisys.tsv": (qualisys, {}),
    "walk.trc": (trc, {}),
    "walk.c3d": (c3d, {}),
}
"""Name, writer and settings of each form that a test can write."""

BUNDLED: dict[str, dict[str, Any]] = {
    "truth.csv": {},
    "deeplabcut.csv": {"fps": RATE_HZ},
    "deeplabcut.h5": {"fps": RATE_HZ},
    "sleap.analysis.h5": {"fps": RATE_HZ},
    "sleap.analysis.csv": {"fps": RATE_HZ},
    "movement.nc": {},
    "trackpy.csv": {"fps": RATE_HZ},
    "laptrack.csv": {"fps": RATE_HZ},
}
"""The bundled files, each written by a library of another program, and the settings that they need."""
