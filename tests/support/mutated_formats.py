"""Every kind of file that pydpend reads, made small, with the commands that read it: for `tests.validation.mutate`."""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pydpend as dp
from nptdms import ChannelObject, RootObject, TdmsWriter
from pydpend.model import CONSTANTS

from tests.validation.mutate import TRACKER, Call, Format

FIXTURES = Path(__file__).parent.parent.parent / "fixtures"
PYDPEND = Path(sys.executable).with_name("pydpend")
SCENE = FIXTURES / "formats" / "scene_8bit.toml"
"""96 x 80 px, 12 frames, two markers."""


def _run(*words: str | Path) -> None:
    subprocess.run([str(w) for w in words], check=True, capture_output=True)


def _film(name: str, *options: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        (folder / name).parent.mkdir(exist_ok=True)
        _run(TRACKER, "film", SCENE, "-q", "-o", folder / name, "--rig", folder / "rig.toml", *options)

    return make


def _remuxed(name: str, *options: str) -> Callable[[Path], None]:
    """A film that FFmpeg writes."""

    def make(folder: Path) -> None:
        # Long enough for a stream whose first pictures lie some way in.
        _film("from.mkv", "--frame-count", "60")(folder)
        _run("ffmpeg", "-v", "error", "-r", "25", "-i", folder / "from.mkv", *options, folder / name)
        (folder / "from.mkv").unlink()

    return make


def _cihx(folder: Path) -> None:
    """The Photron recording with its header as newer cameras write it."""
    _film("film.mraw")(folder)
    said = {}
    for line in (folder / "film.cih").read_text().splitlines():
        key, _, value = line.partition(" : ")
        said[key] = value
    (folder / "film.cih").unlink()
    (folder / "film.cihx").write_text(
        f"""<cih><fileInfo><date>2024/5/1</date></fileInfo><deviceInfo><deviceName>made</deviceName></deviceInfo>
<recordInfo><recordRate>{said["Record Rate(fps)"]}</recordRate><shutterSpeedNsec>200000</shutterSpeedNsec></recordInfo>
<frameInfo><totalFrame>{said["Total Frame"]}</totalFrame><startFrame>0</startFrame><skipFrame>1</skipFrame></frameInfo>
<imageDataInfo><resolution><width>{said["Image Width"]}</width><height>{said["Image Height"]}</height></resolution>
<colorInfo><type>Mono</type><bit>8</bit></colorInfo><effectiveBit><depth>8</depth><side>Lower</side></effectiveBit>
</imageDataInfo><imageFileInfo><fileFormat>MRaw</fileFormat></imageFileInfo></cih>
"""
    )


def _cine(folder: Path) -> None:
    """A Phantom recording: header, bitmap header, setup, offsets, pictures from the bottom up."""
    _film("film.y4m")(folder)
    frames = (folder / "film.y4m").read_bytes().split(b"FRAME\n")[1:]
    width, height, rate = 96, 80, 1000
    pictures = [
        np.frombuffer(f[: width * height], np.uint8).reshape(height, width)[::-1].tobytes() for f in frames
    ]
    setup = bytearray(5700)
    struct.pack_into("<H", setup, 0, rate)
    struct.pack_into("<2sH", setup, 140, b"ST", len(setup))
    struct.pack_into("<II", setup, 768, rate, 200_000)
    struct.pack_into("<I", setup, 896, 8)
    at_offsets = 44 + 40 + len(setup)
    first = at_offsets + 8 * len(pictures)
    step = 8 + width * height
    head = struct.pack(
        "<2sHHHiIiIIIIQ", b"CI", 44, 0, 1, 0, len(pictures), 0, len(pictures), 44, 84, at_offsets, 0
    )
    bitmap = struct.pack("<IiiHHIIiiII", 40, width, height, 1, 8, 0, width * height, 0, 0, 0, 256)
    offsets = struct.pack(f"<{len(pictures)}Q", *(first + step * k for k in range(len(pictures))))
    body = b"".join(struct.pack("<II", 8, len(p)) + p for p in pictures)
    (folder / "film.cine").write_bytes(head + bitmap + bytes(setup) + offsets + body)
    (folder / "film.y4m").unlink()


def _reads(name: str, *options: str) -> tuple[Call, ...]:
    rig = ("--rig", "HERE/rig.toml")
    return (
        Call(("tracker", "info", f"HERE/{name}")),
        Call(
            ("tracker", "track", f"HERE/{name}", "-o", "OUT.parquet", "--quiet", *rig, *options), ".parquet"
        ),
    )


def _films() -> dict[str, Format]:
    def film(name: str, make: Callable[[Path], None], damaged: str = "", *options: str) -> Format:
        return Format(make, damaged or name, False, _reads(name, *options))

    fps = ("--fps", "1000")
    mpeg2 = ("-c:v", "mpeg2video", "-q:v", "2")
    return {
        "mp4": film("film.mp4", _film("film.mp4")),
        "mov": film("film.mov", _film("film.mov")),
        "mkv": film("film.mkv", _film("film.mkv")),
        "avi": film("film.avi", _film("film.avi", "--codec", "mjpeg")),
        "avi raw": film("film.avi", _film("film.avi")),
        "gif": film("film.gif", _remuxed("film.gif"), ""),
        "mpeg-ts": film("film.ts", _remuxed("film.ts", *mpeg2)),
        "mpeg-ps": film("film.mpg", _remuxed("film.mpg", *mpeg2)),
        "flv": film("film.flv", _remuxed("film.flv", "-c:v", "libx264", "-qp", "20", "-g", "12")),
        "asf": film("film.wmv", _remuxed("film.wmv", "-c:v", "wmv2", "-q:v", "2")),
        "ogg": film("film.ogv", _remuxed("film.ogv", "-c:v", "libtheora", "-q:v", "10")),
        "nut": film("film.nut", _remuxed("film.nut", "-c:v", "mpeg4", "-q:v", "2")),
        "mxf": film("film.mxf", _remuxed("film.mxf", *mpeg2, "-bf", "2")),
        "webm": film("film.webm", _remuxed("film.webm", "-c:v", "libvpx")),
        "y4m": film("film.y4m", _film("film.y4m")),
        "cine": film("film.cine", _cine),
        "mraw": film("film.cih", _film("film.mraw"), "film.mraw"),
        "cih": Format(_film("film.mraw"), "film.cih", True, _reads("film.cih")),
        "cihx": Format(_cihx, "film.cihx", True, _reads("film.cihx")),
        "png": film("p", _film("p/%05d.png"), "p/00005.png", *fps),
        "tiff": film("p", _film("p/%05d.tif"), "p/00005.tif", *fps),
        "bmp": film("p", _film("p/%05d.bmp"), "p/00005.bmp", *fps),
        "tiff stack": film("film.tif", _film("film.tif"), "", *fps),
    }


@cache
def _made() -> Path:
    """Tables and a run folder that many formats share."""
    folder = Path(mkdtemp(prefix="mutate-"))
    _film("film.mp4", "--frame-count", "40")(folder)
    for name in ("nodes.parquet", "nodes.csv"):
        dp.track(folder / "film.mp4", folder / "rig.toml", output=folder / name, progress=False)
    times = np.arange(0, 3, 2e-3)
    run = dp.simulate(dp.derived("A"), dp.Damping(mu_v1=3e-4, mu_v2=1e-4), [1.2, 0.4, 0, 0], times)
    rng = np.random.default_rng(1)
    sigma = np.full(run.phi_rad.shape, 1e-3)
    angles = dp.LinkAngles(
        times, run.phi_rad + 1e-3 * rng.standard_normal(sigma.shape), sigma, None, {}, "drop"
    )
    for name in ("drop.parquet", "drop.csv"):
        dp.write_angles(angles, folder / name)
    for k in (0, 1):
        pair = np.stack([times, np.degrees(angles.phi_rad[:, k])])
        (folder / "published").mkdir(exist_ok=True)
        np.save(folder / "published" / f"DPmean_data_RB{k}.npy", pair)
    volts = 5 + 0.65 * run.phi_rad[:, 0] / (2 * np.pi) + 2e-3 * rng.standard_normal(times.size)
    (folder / "encoder.csv").write_text(
        "time_s,voltage_v\n" + "".join(f"{t:.4f},{v:.5f}\n" for t, v in zip(times, volts, strict=True))
    )
    np.save(folder / "encoder.npy", np.column_stack([times, volts]))
    stamps = np.datetime64("2024-05-01T12:00:00", "us") + (times * 1e6).round().astype("timedelta64[us]")
    with TdmsWriter(folder / "encoder.tdms") as writer:
        channels = [ChannelObject("daq", "voltage_v", volts), ChannelObject("daq", "when", stamps)]
        writer.write_segment([RootObject(properties={"operator": "lab"}), *channels])
    (folder / "holds.csv").write_text(
        "angle_deg,voltage_v\n"
        + "".join(f"{360 * k},{5 + 0.65 * k + 1e-3 * (i % 3):.4f}\n" for k in range(-3, 4) for i in range(5))
    )
    dp.calibrate(dp.read_holds([folder / "holds.csv"])).write(folder / "encoder.json")
    shutil.copy(FIXTURES.parent / "docs" / "reference" / "model-a.toml", folder / "model.toml")
    constants = zip(CONSTANTS, dp.derived("A").constants().tolist(), strict=True)
    (folder / "constants.toml").write_text(
        "g_m_s2 = 9.81\n[constants]\n" + "".join(f"{name} = {value!r}\n" for name, value in constants)
    )
    _run(
        *(
            PYDPEND,
            "analyse",
            folder / "drop.parquet",
            "-o",
            folder / "run",
            "--angle-maps",
            "--start",
            "0.1",
        ),
        *("--no-comparison", "--no-prediction", "--quiet"),
    )
    (folder / "config.toml").write_text(dp_config(folder))
    return folder


def dp_config(folder: Path) -> str:
    """The options of a run as TOML."""
    from pydpend.analyse import Options, write_config

    return write_config(Options(inputs=(str(folder / "drop.parquet"),), unwrap=True, start_s=0.1))


def _copied(*names: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        for name in names:
            source = _made() / name
            if source.is_dir():
                shutil.copytree(source, folder / name)
            else:
                shutil.copy(source, folder / name)

    return make


def _tables() -> dict[str, Format]:
    fit = (
        "pydpend",
        "fit",
        "--method",
        "energy",
        "--laws",
        "mu_v1",
        "--no-figures",
        "--quiet",
        "-o",
        "OUT",
    )
    known = ("--calibration", "HERE/encoder.json", "-o", "OUT", "--clocks", "given", "--format", "svg")

    def table(
        name: str, calls: tuple[tuple[str, ...], ...], *beside: str, text: bool = False, damaged: str = ""
    ) -> Format:
        return Format(_copied(*beside, name), damaged or name, text, tuple(map(Call, calls)))

    def nodes(name: str) -> tuple[tuple[str, ...], ...]:
        angles = ("pydpend", "angles", f"HERE/{name}", "-o", "OUT.csv", "--zero", "0", "--gaps", "stop")
        return (("tracker", "check", f"HERE/{name}"), angles)

    def angles(name: str) -> tuple[tuple[str, ...], ...]:
        return (
            (*fit, f"HERE/{name}"),
            ("pydpend", "compare", f"HERE/{name}", "HERE/encoder.csv", *known),
        )

    def encoder(name: str, *more: str) -> tuple[tuple[str, ...], ...]:
        return (("pydpend", "compare", "HERE/drop.parquet", f"HERE/{name}", *known, *more),)

    beside = ("encoder.csv", "encoder.json")
    return {
        "node parquet": table("nodes.parquet", nodes("nodes.parquet")),
        "node csv": table("nodes.csv", nodes("nodes.csv"), "nodes.csv.json", text=True),
        "node json": table("nodes.csv.json", nodes("nodes.csv"), "nodes.csv", text=True),
        "angles parquet": table("drop.parquet", angles("drop.parquet"), *beside),
        "angles csv": table("drop.csv", angles("drop.csv"), "drop.csv.json", *beside, text=True),
        "angles npy": table(
            "published", angles("published"), *beside, damaged="published/DPmean_data_RB1.npy"
        ),
        "encoder csv": table(
            "encoder.csv", encoder("encoder.csv"), "drop.parquet", "encoder.json", text=True
        ),
        "encoder npy": table("encoder.npy", encoder("encoder.npy"), "drop.parquet", "encoder.json"),
        "encoder tdms": table(
            "encoder.tdms",
            encoder("encoder.tdms", "--time-column", "when"),
            "drop.parquet",
            "encoder.json",
        ),
        "holds": table(
            "holds.csv", (("pydpend", "calibrate", "HERE/holds.csv", "-o", "OUT.json"),), text=True
        ),
        "calibration": table(
            "encoder.json", encoder("encoder.csv"), "drop.parquet", "encoder.csv", text=True
        ),
    }


def _scene(folder: Path) -> None:
    shutil.copy(SCENE, folder / "scene.toml")


def _documents() -> dict[str, Format]:
    fit = (
        "pydpend",
        "fit",
        "HERE/drop.parquet",
        "--method",
        "energy",
        "--laws",
        "mu_v1",
        "--no-figures",
        "--quiet",
    )

    def document(damaged: str, calls: tuple[tuple[str, ...], ...], *names: str) -> Format:
        return Format(_copied(*names), damaged, True, tuple(map(Call, calls)))

    fitted = (*fit, "-o", "OUT", "--model")
    again = ("pydpend", "analyse", "HERE/drop.parquet", "-o", "HERE/run", "--angle-maps", "--start", "0.1")
    predict = (
        "pydpend",
        "predict",
        "HERE/drop.parquet",
        "--fit",
        "HERE/run/fit",
        "--windows",
        "1",
        "--quiet",
    )

    def plots(*figures: str) -> tuple[tuple[str, ...], ...]:
        return tuple(("pydpend", "plot", figure, "HERE/run", "-o", "OUT.svg") for figure in figures)

    film = ("tracker", "film", "HERE/scene.toml", "-q", "-o", "OUT.y4m", "--frame-count", "2")
    return {
        "rig": Format(_film("film.avi"), "rig.toml", True, _reads("film.avi")[1:]),
        "model": document("model.toml", ((*fitted, "HERE/model.toml"),), "model.toml", "drop.parquet"),
        "constants": document(
            "constants.toml",
            ((*fitted, "HERE/constants.toml"),),
            "constants.toml",
            "drop.parquet",
        ),
        "config": document(
            "config.toml",
            (("pydpend", "analyse", "--config", "HERE/config.toml", "-o", "OUT", "--dry-run"),),
            "config.toml",
            "drop.parquet",
        ),
        "fit json": document(
            "run/fit/fit.json",
            (
                *plots("shares", "coefficients", "maps"),
                (*predict, "-o", "OUT"),
            ),
            "run",
            "drop.parquet",
        ),
        "run json": document(
            "run/run.json",
            (
                *plots("angles"),
                (*again, "--dry-run"),
            ),
            "run",
            "drop.parquet",
        ),
        "energy csv": document("run/fit/energy.csv", plots("energy"), "run"),
        "scene": Format(_scene, "scene.toml", True, (Call(film),)),
    }


FORMATS: dict[str, Format] = {**_films(), **_tables(), **_documents()}
"""Every format by its name."""
