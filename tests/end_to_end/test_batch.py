"""A batch on this machine: equal to serial runs, nothing lost, nothing twice, whatever stops it.

Films are small and made from seeds. One that crashes its process and one that never ends are stood in for by
`tests.support.spoilt_helpers`.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import polars as pl
import pydpend as dp
import pytest
from pydpend.analyse import Options, analyse
from pydpend.batching import Advance, BatchError
from pydpend.batching.lock import about_me, holding
from pydpend.batching.status import status
from pydpend.cli import main

from tests.support.small_cluster import SPOILT, alive, contents, until
from tests.support.small_films import small_film, small_films

PLAIN = Options(zero="vertical", overlay=False)
PLAIN_FLAGS = ("--zero", "vertical", "--no-overlay")


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("batch") / "films"
    small_films(folder, 3)
    return folder


@pytest.fixture
def spoilt(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SPOILT))
    monkeypatch.setenv("PYTHONPATH", str(SPOILT))


def table(results: Path) -> pl.DataFrame:
    return pl.read_parquet(results / "batch.parquet")


def test_a_batch_is_what_serial_runs_are_and_is_done_once(films: Path, tmp_path: Path) -> None:
    mine, results = tmp_path / "films", tmp_path / "results"
    shutil.copytree(films, mine)
    steps: list[Advance | str] = []
    first = dp.batch(str(mine / "*.mp4"), results, PLAIN, progress=steps.append, workers=2)
    assert sum(first.counts.values()) == 3
    assert [s.done for s in steps if isinstance(s, Advance)] == [1, 2, 3]
    for film in sorted(mine.iterdir()):
        alone = tmp_path / "alone" / film.stem
        analyse(Options(inputs=(str(film),), zero="vertical", overlay=False), alone)
        there, here = contents(results / "runs" / film.stem), contents(alone)
        assert there == here
        assert f"{film.stem}/angles.parquet" in here
    rows = table(results)
    assert rows["name"].to_list() == ["f000", "f001", "f002"]
    assert rows["frames"].to_list() == [40] * 3
    assert rows["noise1_deg"].is_between(0.001, 1).all()
    assert (results / rows["report"][0]).is_file()

    # Again: nothing is done. Then a film, an option of all, and a run folder: what depends on it is done.
    def done(options: Options = PLAIN) -> set[str]:
        said: list[Advance | str] = []
        dp.batch(str(mine / "*.mp4"), results, options, progress=said.append, workers=1)
        return {s.ended.row["name"] for s in said if isinstance(s, Advance) and not s.ended.kept}

    assert done() == set()
    small_film(mine / "f001.mp4", 77)
    assert done() == {"f001"}
    shutil.rmtree(results / "runs/f002")
    assert done() == {"f002"}
    other = Options(zero="vertical=2", overlay=False)
    assert done(other) == {"f000", "f001", "f002"}
    assert done(other) == set()
    (results / "journal.jsonl").unlink()
    assert done(other) == set()
    assert table(results)["options"].str.contains("vertical=2").all()


def test_what_fails_is_listed_and_stops_nobody(films: Path, tmp_path: Path, spoilt: None) -> None:
    for name in ("crash", "endless", "f000"):
        shutil.copy(films / "f000.mp4", tmp_path / f"{name}.mp4")
    (tmp_path / "text.mp4").write_text("no film at all\n" * 50, "utf-8")
    os.mkfifo(tmp_path / "pipe.mp4")
    sheet = tmp_path / "trials.csv"
    names = ("crash", "endless", "missing", "text", "pipe", "f000")
    sheet.write_text("path,day\n" + "".join(f"{name}.mp4,{name[0]}\n" for name in names), "utf-8")
    flags = ["--sheet", str(sheet), "--keep", "day", "--time-limit", "3", "--retries", "1"]
    assert main(["batch", *flags, *PLAIN_FLAGS, "-o", str(tmp_path / "results")]) == 1
    rows = {row["name"]: row for row in table(tmp_path / "results").to_dicts()}
    assert list(rows) == list(names)
    said = {name: row["reason"] for name, row in rows.items() if row["state"] == "failed"}
    assert set(said) == {"crash", "endless", "missing", "text", "pipe"}
    assert "SIGABRT" in said["crash"]
    assert rows["crash"]["tries"] == 2
    assert said["endless"] == "it took longer than the time limit, 3 s"
    assert rows["endless"]["tries"] == rows["text"]["tries"] == 1
    assert "there is no such file" in said["missing"]
    assert "it is no file" in said["pipe"]
    assert rows["text"]["command"].startswith(f"pydpend analyse {tmp_path}/text.mp4 -o ")
    assert rows["f000"]["sheet_day"] == "f"
    assert rows["f000"]["state"] == "partly"
    # The command repeats it, as it says.
    assert main(rows["text"]["command"].split()[1:]) == 2
    # What hangs is told from what is there.
    assert not list((tmp_path / "results/running").iterdir())


def started(*words: str, folder: Path) -> subprocess.Popen[bytes]:
    program = [sys.executable, "-m", "pydpend", "batch", *words, *PLAIN_FLAGS]
    with (folder / "words.txt").open("ab") as said:
        return subprocess.Popen(program, cwd=folder, stdout=said, stderr=said)


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_whatever_ends_a_batch_the_next_call_goes_on(
    films: Path, tmp_path: Path, spoilt: None, by: signal.Signals
) -> None:
    shutil.copy(films / "f000.mp4", tmp_path / "f000.mp4")
    shutil.copy(films / "f001.mp4", tmp_path / "endless.mp4")
    results = tmp_path / "results"
    going = started("f000.mp4", "endless.mp4", "-o", "results", "--workers", "1", folder=tmp_path)
    under_way = results / "running" / "endless.json"

    def waits() -> bool:
        if not under_way.exists():
            return False
        told = status(results)
        return told.counts["partly"] == 1 and list(told.running) == ["endless"]

    until(waits)
    told = status(results)
    assert f"process {going.pid}, since " in told.works
    pid = json.loads(under_way.read_text("utf-8"))["pid"]
    with pytest.raises(BatchError, match=f"another batch works in this folder .* process {going.pid}"):
        dp.batch(tmp_path / "f000.mp4", results, PLAIN)
    going.send_signal(by)
    assert going.wait(60) == {signal.SIGKILL: -9}.get(by, 130)
    until(lambda: not alive(pid))
    told = status(results)
    assert told.message.endswith("nobody works at it: give the same command again") or by is signal.SIGKILL
    (tmp_path / "endless.mp4").rename(tmp_path / "other.mp4")
    steps: list[Advance | str] = []
    dp.batch(
        [tmp_path / "f000.mp4", tmp_path / "other.mp4"], results, PLAIN, workers=1, progress=steps.append
    )
    assert [s.ended.row["name"] for s in steps if isinstance(s, Advance) and not s.ended.kept] == ["other"]
    assert len(table(results)) == 2


def test_one_rig_for_many_films(films: Path, tmp_path: Path) -> None:
    dp.film("clean", tmp_path / "other.mp4", seed=1, frames=40)
    inputs = [*sorted(films.glob("*.mp4")), tmp_path / "other.mp4"]
    steps: list[Advance | str] = []
    found = dp.batch(inputs, tmp_path / "results", PLAIN, one_rig=True, workers=1, progress=steps.append)
    assert [s.done for s in steps if isinstance(s, Advance)] == [1, 2, 3, 4]
    rows = table(tmp_path / "results")
    assert rows["rig"].to_list() == ["found", "common", "common", "own"]
    assert rows["rig_file"].drop_nulls().unique().to_list() == [str(tmp_path / "results/rig.toml")]
    (said,) = [w for w in rows["warnings"][3] if "rig" in w and "does not fit" in w]
    assert "markers have names of their own here" in said
    places = [
        dp.read_nodes(next((tmp_path / "results/runs" / n).glob("*/nodes.parquet"))) for n in rows["name"]
    ]
    common = dp.Rig.read(tmp_path / "results/rig.toml")
    assert [node.name for node in common.nodes] == [node.name for node in places[1].rig.nodes]
    assert found.counts["failed"] == 0
    again = dp.batch(inputs, tmp_path / "results", PLAIN, one_rig=True)
    assert again.kept == 4


def test_a_folder_of_other_things_is_refused(
    tmp_path: Path, films: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.txt").write_text("x", "utf-8")
    film = str(films / "f000.mp4")
    for words, said in (
        ([film, "-o", str(tmp_path)], "is not empty and not of a batch. Give a new folder with -o"),
        ([film, "-o", str(tmp_path / "mine.txt")], "it is a file, and the results need a folder"),
        ([film], "-o: the folder of the results is not named. Give -o DIR"),
        (["-o", str(tmp_path / "r")], "there is nothing to analyse. Name films, or give --sheet"),
        (["nix*.mp4", "-o", str(tmp_path / "r")], "nix*.mp4: no file has such a name"),
        ([str(films), "-o", str(tmp_path / "r")], "a folder is no recording"),
        ([film, "--workers", "0", "-o", str(tmp_path / "r")], "--workers: 0 makes no sense"),
        ([film, "--keep", "a", "-o", str(tmp_path / "r")], "Name the sheet with --sheet"),
        (["--status", str(tmp_path)], "is no folder of a batch"),
        (
            [film, "--scheduler", "tcp://127.0.0.1:9", "--reconnect", "1", "-o", str(tmp_path / "s")],
            "127.0.0.1:9",
        ),
    ):
        assert main(["batch", *words]) == 2, words
        err = capsys.readouterr().err
        assert said in err, err
        assert err.count("\n") == 1
    assert (tmp_path / "mine.txt").read_text("utf-8") == "x"


def test_a_lock_is_one_processs_and_ends_with_it(tmp_path: Path) -> None:
    lock = tmp_path / "batch.lock"
    with holding(lock, about_me()), pytest.raises(Exception, match=str(os.getpid())), holding(lock, {}):
        pass
    assert not lock.exists()
    lock.write_text("{}", "utf-8")  # left behind by a killed process
    with holding(lock, about_me()):
        pass
