"""What is written, and where: names are names of files, what is read is never replaced, nothing obeys a terminal."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import os
import re
import signal
import threading
import time
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from pydpend.analyse.folder import Digests
from pydpend.cli import main
from pydpend.errors import ArgumentError, FilmError, RigError, SourceError, TableError
from pydpend.kinematics import LinkAngles, read_angles, write_angles
from pydpend.output import keeping, whole, write_text
from pydpend.terminal import shown

from tests.end_to_end.test_cli_angles import META
from tests.support import two_links

NAMES = [
    *("12:30 x", "a:b", "tee:a|b", "s3:x", "C:\\x", "file:x", "http:", "%d", "100%", "x y", "#", "?", "a*b"),
    *("new\nline", "\U0001f600", "\x1b[31mred", os.fsdecode(b"f\xf6r\xff"), "n" * 240),
]
"""Names that some library would take for something else, without an ending."""


def nodes() -> dp.Nodes:
    t, phi = two_links.drop(1.0, 500.0, 70, rest_s=0.4)
    return dataclasses.replace(two_links.film(t, phi, 70), meta=META)


def angles() -> LinkAngles:
    t = np.linspace(0.0, 1.0, 50)
    return LinkAngles(t, np.column_stack([t, t]), np.full((50, 2), 1e-3), None, {"notes": []}, "made")


def refused(words: list[str], expected: str) -> None:
    """The program says one line and ends with 2."""
    error = io.StringIO()
    with contextlib.redirect_stderr(error), contextlib.redirect_stdout(io.StringIO()):
        status = main(words)
    assert status == 2, words
    assert expected in error.getvalue(), words
    assert len(error.getvalue().splitlines()) == 1


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_a_file_whatever_it_looks_like(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    nodes().write(f"{name}.parquet")
    made = {f"{name}.parquet"}
    words = ["--bodies", "upper,lower", "--zero", "reference_frame"]
    for ending in (".csv", ".angles.parquet"):
        assert main(["angles", f"{name}.parquet", "-o", f"{name}{ending}", *words]) == 0
        assert len(read_angles(f"{name}{ending}").t_s) == len(nodes())
        made.add(name + ending)
    made.add(f"{name}.csv.json")
    assert main(["export", f"{name}.parquet", "-o", f"{name}.mat"]) == 0
    assert main(["angles", f"{name}.parquet", "-o", "x.csv", "--figure", f"{name}.svg", *words]) == 0
    made |= {f"{name}.mat", f"{name}.svg", "x.csv", "x.csv.json"}
    assert {p.name for p in tmp_path.iterdir()} == made
    # Bytes, and anything with a name, are names too.
    assert len(dp.read_nodes(os.fsencode(f"{name}.parquet"))) == len(nodes())
    write_angles(angles(), os.fsencode(f"{name}.parquet"))
    assert len(read_angles(os.fsencode(f"{name}.parquet")).t_s) == 50
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err


def test_a_run_folder_may_have_any_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("run-12:30", "s3:run", os.fsdecode(b"r\xf6n")):
        write_angles(angles(), f"{name}.parquet")
        # A straight line is no decay, so that the fit is not done; everything else is.
        assert main(["analyse", f"{name}.parquet", "-o", name, "--quiet"]) == 1
        # No progress, but what is not done is said.
        (said,) = capsys.readouterr().err.splitlines()
        assert re.fullmatch("fit: not done: .{20,}", said)
        assert (tmp_path / name / "report.html").is_file()
        assert (tmp_path / name / "README.txt").is_file()


def test_what_is_read_is_never_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    nodes().write("nodes.parquet")
    write_angles(angles(), "angles.parquet")
    before = Path("nodes.parquet").read_bytes(), Path("angles.parquet").read_bytes()
    for source, link in (("nodes", "hard.csv"), ("nodes", "hard.mat"), ("nodes", "hard.svg")):
        os.link(f"{source}.parquet", link)
        os.symlink(f"{source}.parquet", f"soft_{link}")
    Path("out").mkdir()
    os.link("angles.parquet", "out/fit.json")
    os.link("angles.parquet", "out/compare.json")
    np.savetxt("encoder.csv", np.ones((50, 2)), delimiter=",", header="time_s,phi1_rad", comments="")
    zero = ["--zero", "reference_frame"]
    for prefix in ("", "soft_"):
        refused(["angles", "nodes.parquet", "-o", f"{prefix}hard.csv", *zero], "it is read, and writing it")
        refused(
            ["angles", "nodes.parquet", "-o", "x.csv", "--figure", f"{prefix}hard.svg", *zero], "it is read"
        )
        refused(["export", "nodes.parquet", "-o", f"{prefix}hard.mat", "--force"], "it is read")
    refused(["angles", "nodes.parquet", "-o", "nodes.parquet", *zero], "nodes.parquet: it is read")
    refused(["export", "nodes.parquet", "-o", "hard.csv"], "it is read")
    with keeping(["angles.parquet"]), pytest.raises(ArgumentError, match="it is read"):
        write_text("out/fit.json", "")
    assert before == (Path("nodes.parquet").read_bytes(), Path("angles.parquet").read_bytes())


def test_a_film_and_a_rig_are_replaced_only_if_asked(tmp_path: Path) -> None:
    scene = {**dp.Film("clean").scene, "image_px": [160, 120], "frames": 3}
    precious = tmp_path / "a.mkv"
    precious.write_text("mine")
    with pytest.raises(FilmError, match="there already"):
        dp.film(scene, precious)
    with pytest.raises(FilmError, match="there already"):
        dp.film(
            scene, tmp_path / "b.mkv", truth=precious.with_suffix(".csv").absolute() if False else precious
        )
    assert precious.read_text() == "mine"
    dp.film(scene, precious, force=True)
    assert precious.stat().st_size > 1000
    rig = tmp_path / "rig.toml"
    rig.write_text("mine")
    with pytest.raises(RigError, match="there already"):
        dp.setup(precious, rig, progress=False)
    with pytest.raises(RigError, match="destroy"):
        dp.setup(precious, precious, force=True, progress=False)
    os.link(precious, tmp_path / "t.csv")
    with pytest.raises(TableError, match="destroy"):
        dp.track(precious, output=tmp_path / "t.csv", force=True, progress=False)
    assert rig.read_text() == "mine"


def test_a_file_is_there_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / ("n" * 255)

    def stopped() -> None:
        with whole(target) as new:
            new.write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        stopped()
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "precious").write_text("precious")
    (tmp_path / "link").symlink_to("precious")
    for path in (target, tmp_path / "link"):
        write_text(path, "whole \udcf6")
        assert path.read_text() == "whole \\udcf6"
    assert (tmp_path / "precious").read_text() == "precious"
    with pytest.raises(OSError, match="directory"):
        write_text(tmp_path, "")


def test_names_are_shown_without_what_a_terminal_obeys() -> None:
    assert shown("a\x1b[31mb\n\x9b2J\u202e\u00fc") == "a\\x1b[31mb\\n\\u{9b}2J\\u{202e}\u00fc"
    assert shown(os.fsdecode(b"f\xf6r")) == "f\\xf6r"
    with pytest.raises(SourceError) as caught:
        dp.info(os.fsdecode(b"\x1b[31mno\xf6ne\x9b.mp4"))
    assert "\\x1b[31mno\\xf6ne\\x9b.mp4: no such file" in str(caught.value)
    refused(["\x1b[31m"], "\\x1b[31m")
    refused(["angles", "x.parquet", "-o", "y.csv", "--\x1b[31m"], "\\x1b")
    refused(["angles", "no\x1b[31m.parquet", "-o", "x.csv"], "no\\x1b[31m.parquet")


def test_cells_that_a_spreadsheet_would_calculate_are_marked_when_asked(tmp_path: Path) -> None:
    plain = nodes()
    names = ["=1+1", "+a", "-b", "@c"]
    made = [dataclasses.replace(n, name=name) for n, name in zip(plain.rig.nodes, names, strict=False)]
    rig = dataclasses.replace(plain.rig, nodes=(*made, *plain.rig.nodes[len(names) :]))
    table = dataclasses.replace(plain, rig=rig)
    path = tmp_path / "t.csv"
    for safe in (False, True):
        table.write(path, safe_csv=safe)
        assert (",=1+1," in path.read_text()) is not safe
        assert (",'=1+1," in path.read_text()) is safe
        assert dp.read_nodes(path).rig.names[:4] == tuple(names)
    scene = dp.Film("clean").scene | {"image_px": [160, 120], "frames": 2}
    scene["marker"][0]["name"] = "=cmd"
    for safe in (False, True):
        dp.film(scene, tmp_path / "a.mkv", tmp_path / "a.csv", safe_csv=safe, force=True)
        assert (",'=cmd," in (tmp_path / "a.csv").read_text()) is safe
        assert dp.filming.read_truth(tmp_path / "a.csv").nodes[0] == "=cmd"


def test_a_recording_is_known_again_by_both_its_files(tmp_path: Path) -> None:
    scene = {**dp.Film("clean").scene, "image_px": [160, 120], "frames": 3}
    dp.film(scene, tmp_path / "a.mraw")
    header, pixels = tmp_path / "a.cih", tmp_path / "a.mraw"
    digests = Digests()
    for given in (header, pixels):
        before = digests.of(given)
        assert Digests().of(given) == before
        state = pixels.stat()
        changed = bytearray(pixels.read_bytes())
        changed[len(changed) // 2] ^= 1
        pixels.write_bytes(changed)
        after = digests.of(given)
        assert after != before, given
        # The same length and time, and another beginning.
        changed[0] ^= 1
        pixels.write_bytes(changed)
        os.utime(pixels, ns=(state.st_atime_ns, state.st_mtime_ns))
        assert digests.of(given) != after, given


def clutter(path: Path) -> None:
    """Squares that wander each on a way of its own: nothing is rigid, and a rig is sought for long."""
    frames, points, height, width = 300, 100, 480, 640
    head = {
        "Record Rate(fps)": 1000,
        "Total Frame": frames,
        "Image Width": width,
        "Image Height": height,
        "Color Type": "Mono",
        "Color Bit": 8,
        "File Format": "MRaw",
        "EffectiveBit Depth": 8,
        "EffectiveBit Side": "Lower",
    }
    lines = ["#Camera Information Header", *(f"{k} : {v}" for k, v in head.items())]
    path.with_suffix(".cih").write_text("\n".join(lines) + "\n")
    rng = np.random.default_rng(4)
    phase, step = rng.integers(0, 900, (2, points)), rng.integers(3, 14, (2, points))
    film = np.full((frames, height, width), 10, dtype=np.uint8)
    for t in range(frames):
        for (x, y), (dx, dy) in zip(phase.T, step.T, strict=True):
            at = [
                6 + abs((p + t * d) % (2 * (n - 12)) - (n - 12))
                for p, d, n in ((x, dx, width), (y, dy, height))
            ]
            film[t, at[1] - 2 : at[1] + 3, at[0] - 2 : at[0] + 3] = 200
    film.tofile(path)


def test_ctrl_c_is_heard_while_the_rig_is_sought(tmp_path: Path) -> None:
    clutter(tmp_path / "a.mraw")
    stages: list[str] = []

    def interrupt() -> None:
        while stages[-1:] != ["finding the rig"]:
            time.sleep(0.01)
        time.sleep(0.3)
        asked.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    for work in (dp.track, dp.setup):
        stages.clear()
        asked: list[float] = []
        thread = threading.Thread(target=interrupt)
        thread.start()
        with pytest.raises(KeyboardInterrupt):
            work(tmp_path / "a.mraw", progress=lambda stage, done, total: stages.append(stage))
        # A second, and as much again for a machine that does other things too.
        assert time.monotonic() - asked[0] < 2.0
        thread.join()


def test_what_is_longer_than_any_name_is_cut_in_messages(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    long = "k" * 5000
    key, word = tmp_path / "key.toml", tmp_path / "word.toml"
    key.write_text(f'inputs = ["a.csv"]\n{long} = 1\n')
    word.write_text(f'inputs = ["a.csv"]\nmethod = "{long}"\n')
    (tmp_path / "c.json").write_text(f'{{"{long}": 1}}')
    (tmp_path / "a.csv").write_text(f"time_s,{long}\n0,1\n1,{long}\n")
    data = str(tmp_path / "a.csv")
    for words in (
        ["analyse", "--config", str(key)],
        ["analyse", "--config", str(word)],
        ["fit", data, "--laws", long],
        ["fit", data, f"--{long}"],
        ["fit", data, "--columns", long],
        ["fit", data, "--start", long],
        ["fit", data, "--method", long],
        ["fit", data],
        ["compare", data, data, "--column", long, "--calibration", str(tmp_path / "c.json")],
        [long],
    ):
        assert main([*words, "-o", str(tmp_path / "out")]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert len(said) < 1500, said
    # A path of many folders, each with the longest name, is as it is.
    path = "/".join(["n" * 255] * 3)
    assert path in str(dp.PydpendError(f"{path}: there is none"))
