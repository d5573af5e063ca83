"""Films of pixels that are not square: the same markers, links and angles as of square ones."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray

FRAMES = 400

H264 = ("-c:v", "libx264", "-crf", "8", "-preset", "veryfast", "-pix_fmt", "yuv420p")

VARIANTS = {
    "16:15": ("crop=352:360:4:0,scale=330:360,setsar=16/15", "a.mp4", H264),
    "12:11": ("scale=330:360,setsar=12/11", "a.mov", ("-c:v", "mjpeg", "-q:v", "2", "-pix_fmt", "yuvj420p")),
    "10:11": ("scale=396:360,setsar=10/11", "a.avi", ("-c:v", "mpeg4", "-q:v", "2")),
    "4:3": ("scale=270:360,setsar=4/3", "a.ts", H264),
    "32:27": ("crop=360:351:0:0,scale=360:416,setsar=32/27", "b.mp4", H264),
    "1:2": ("scale=360:180,setsar=1/2", "a.mkv", ("-c:v", "ffv1")),
    # A phone held upright: recorded on its side and turned by whoever shows it, pixels and all.
    "3:4": ("transpose=cclock,scale=270:360,setsar=4/3", "turned.mov", H264),
}


def scene() -> dict[str, Any]:
    """The preset "clean" at half its size, with four levels of noise."""
    made = dp.Film("clean", seed=731, frames=FRAMES).scene
    made["image_px"] = [v // 2 for v in made["image_px"]]
    for part in (*made["link"], *made["marker"]):
        for key in ("joint_px", "along_px", "at_px", "width_px", "radius_px"):
            if key in part:
                part[key] = (np.array(part[key]) / 2).tolist()
    made["camera"]["read_noise"] = 4.0
    return made


def ffmpeg(*arguments: str | Path) -> None:
    subprocess.run(("ffmpeg", "-v", "error", "-y", *arguments), check=True)


class Squeezed:
    """A film, its truth, and the same film in pixels that are not square."""

    def __init__(self, folder: Path) -> None:
        film = dp.Film(scene())
        self.folder, self.truth = folder, film.truth()
        self.square = folder / "square.mkv"
        film.write(self.square)

    def made(self, ratio: str) -> Path:
        filters, name, codec = VARIANTS[ratio]
        path = self.folder / name
        if path.exists():
            return path
        if name != "turned.mov":
            ffmpeg("-i", self.square, "-vf", filters, *codec, path)
            return path
        flat = self.folder / "flat.mov"
        ffmpeg("-i", self.square, "-vf", filters, *codec, flat)
        ffmpeg("-i", flat, "-c", "copy", "-metadata:s:v", "rotate=90", path)
        return path


@pytest.fixture(scope="module")
def squeezed(tmp_path_factory: pytest.TempPathFactory) -> Squeezed:
    return Squeezed(tmp_path_factory.mktemp("aspect"))


def errors(nodes: dp.Nodes, truth: dp.Truth) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Errors of the angles (T, 2), rad, and over their stated sigmas; the zero is the reference picture's truth."""
    reference = nodes.rig.reference_frame
    assert reference is not None
    found = dp.angles(nodes, zero=[float(v) for v in truth.phi_rad[reference]])
    off = np.angle(np.exp(1j * (found.phi_rad - truth.phi_rad[nodes.frame])))
    # That frame's own noise is common to all.
    off -= np.nanmedian(off, axis=0)
    return off, off / found.sigma_rad


@pytest.mark.parametrize("ratio", VARIANTS)
def test_markers_links_and_angles_are_those_of_the_square_film(squeezed: Squeezed, ratio: str) -> None:
    path = squeezed.made(ratio)
    assert dp.info(path)["pixel_aspect"] == ratio
    nodes = dp.track(path, progress=False)
    assert len(nodes.rig.nodes) == 9, "as of square pixels"
    assert f"{nodes.rig.pixel_aspect[0]}:{nodes.rig.pixel_aspect[1]}" == ratio
    assert any(f"wide ({ratio}), as the recording says" in str(w) for w in nodes.meta["warnings"])
    off, pulls = errors(nodes, squeezed.truth)
    # The markers of 8 px in noise of 4 levels give phi to about 1e-3 rad; a film that is not stretched is off by
    # (1 - ratio) / 2 of a radian, 0.03 for 16:15. Resampling and compression are in the stated sigma to a factor.
    assert np.nanmax(np.abs(off)) < 0.02
    rms = np.sqrt(np.nanmean(pulls**2, axis=0))
    assert (rms < 1.5).all(), f"stated sigmas are too small: {rms}"


def test_lengths_and_places_are_in_the_pixels_that_they_say(squeezed: Squeezed) -> None:
    plain = dp.track(squeezed.square, progress=False)
    nodes = dp.track(squeezed.made("12:11"), progress=False)
    one, other = dp.find_linkage(plain), dp.find_linkage(nodes)
    # Squeezed across only, square pixels are as high as those of the square film.
    assert abs(other.length_px / one.length_px - 1) < 3 * np.hypot(
        one.length_sigma_px / one.length_px, other.length_sigma_px / other.length_px
    )
    metas = [dp.angles(n, "linkage", zero="reference_frame").meta["linkage"] for n in (plain, nodes)]
    (x, y), (u, v) = (m["pivot_px"] for m in metas)
    # Pixel centres are at integers: (u + 1/2) 12/11 = x + 1/2.
    assert abs((u + 0.5) * 12 / 11 - (x + 0.5)) < 0.2
    assert abs(v - y) < 0.2
    assert "pixel_aspect" not in plain.meta["source"], "square pixels give the same table as ever"
    assert nodes.meta["source"]["pixel_aspect"] == "12:11"


def test_what_is_given_replaces_what_the_film_says(squeezed: Squeezed, tmp_path: Path) -> None:
    # The film says nothing of its pixels, as most that are wrong.
    silent = tmp_path / "silent.avi"
    ffmpeg("-i", squeezed.square, "-vf", "scale=270:360,setsar=0/1", "-c:v", "ffv1", silent)
    assert dp.info(silent)["pixel_aspect"] == "1:1"
    nodes = dp.track(silent, pixel_aspect=(4, 3), progress=False, output=tmp_path / "a.parquet")
    assert len(nodes.rig.nodes) == 9
    off, _ = errors(nodes, squeezed.truth)
    assert np.nanmax(np.abs(off)) < 0.02
    again = dp.read_nodes(tmp_path / "a.parquet")
    assert again.rig.pixel_aspect == (4, 3)
    source = again.meta["source"]
    assert (source["pixel_aspect"], source["pixel_aspect_origin"]) == ("4:3", "user")
    found = dp.setup(silent, tmp_path / "rig.toml", pixel_aspect="4:3", progress=False)
    assert 'pixel_aspect = "4:3"' in (tmp_path / "rig.toml").read_text()
    assert found.picture.shape == (360, 360, 3), "pictures have the scene's proportions"
    for wrong in ("4", "0:3", "1000:1", (4, 3, 2)):
        with pytest.raises((dp.ArgumentError, dp.WrongTypeError), match=r"pixel.aspect"):
            dp.info(silent, pixel_aspect=wrong)  # type: ignore[arg-type]


def test_a_rig_of_other_pixels_is_refused(squeezed: Squeezed) -> None:
    path = squeezed.made("4:3")
    rig = dp.track(path, progress=False).rig
    other = replace(rig, pixel_aspect=(1, 1))
    with pytest.raises(
        dp.RigError, match=r"for pixels of 1:1 .* the recording's are 4:3, as the recording says"
    ):
        dp.track(path, other, progress=False)
    # Containers round: 4:3 but for a thousandth.
    near = dp.track(path, replace(rig, pixel_aspect=(1333, 1000)), frames=(0, 50), progress=False)
    assert near.rig.pixel_aspect == (4, 3)


@pytest.mark.parametrize(("ratio", "scale"), [("1:2", (1.0, 0.5)), ("4:3", (0.75, 1.0))])
def test_stated_sigmas_are_those_of_the_less_sure_axis(
    squeezed: Squeezed, ratio: str, scale: tuple[float, float]
) -> None:
    path = squeezed.made(ratio)
    nodes = dp.track(path, progress=False)
    # Pixel centres are at integers.
    truth = (squeezed.truth.xy_px + 0.5) * scale - 0.5
    order = [int(np.argmin(np.hypot(*(truth[nodes.frame[0]] - p).T))) for p in nodes.xy_px[0]]
    off = nodes.xy_px - truth[nodes.frame][:, order]
    off -= np.nanmedian(off, axis=0)
    clear = nodes.sigma_px < 2 * np.nanmedian(nodes.sigma_px)
    width, height = nodes.rig.pixel_aspect
    pulls = (off * [width / height, 1.0] / nodes.sigma_px[..., None])[clear]
    # Of 3000 markers the root mean square of pulls is known to 1.3 %; H.264 adds its own errors to those of 4:3.
    worse = np.sqrt(np.nanmean(pulls**2, axis=0)).max()
    assert 0.8 < worse < 1.3
