"""Decisions of people about single rows: made by `track`, refused where they cannot be, undone without the file."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from numpy.typing import NDArray
from pydpend import marker_status
from pydpend.analyse import Options, analyse
from pydpend.nodes import AMBIGUOUS, MANUAL, MISSING, REACQUIRED, SEEN

ROOT = Path(__file__).parent.parent.parent
FRAMES = 120


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("films") / "drop.mp4"
    dp.film("clean", path, frames=FRAMES)
    return path


@pytest.fixture(scope="module")
def plain(film: Path) -> dp.Nodes:
    return dp.track(film, progress=False)


def written(folder: Path, nodes: dp.Nodes, *edits: str, name: str = "drop.edits.toml") -> Path:
    head = f'schema = 1\n[film]\nname = "drop.mp4"\nsha256 = "{nodes.meta["source"]["sha256_ends"]}"\n'
    said = 'by = "ann"\nwhen = 2026-12-01T15:20:00Z\n'
    path = folder / name
    path.write_text(head + "".join(f"\n[[edit]]\n{edit}\n{said}" for edit in edits), "utf-8")
    return path


def at(nodes: dp.Nodes, frame: int, name: str) -> tuple[float, float]:
    x, y = nodes.xy_px[frame, nodes.rig.names.index(name)]
    return float(x), float(y)


def changed(a: dp.Nodes, b: dp.Nodes) -> NDArray[np.bool_]:
    """Rows that differ, (T, N)."""
    same: NDArray[np.bool_] = (a.status == b.status) & np.all(
        (a.xy_px == b.xy_px) | np.isnan(a.xy_px) & np.isnan(b.xy_px), axis=2
    )
    return ~same


def test_the_words_of_both_halves_are_one_list(plain: dp.Nodes) -> None:
    assert dp.nodes.STATUS_WORDS[MANUAL] == "manual"
    assert plain.to_arrow()["status"].chunk(0).dictionary.to_pylist() == list(marker_status.STATUS_WORDS)


def test_a_place_is_that_row_and_no_other(film: Path, plain: dp.Nodes, tmp_path: Path) -> None:
    edits = written(
        tmp_path, plain, 'what = "place"\nnode = "n2"\nframe = 60\nat_px = [100.25, 50.5]\nsigma_px = 0.75'
    )
    nodes = dp.track(film, edits=edits, progress=False)
    assert np.argwhere(changed(nodes, plain)).tolist() == [[60, 2]]
    assert nodes.status[60, 2] == MANUAL
    assert nodes.xy_px[60, 2].tolist() == [100.25, 50.5]
    assert nodes.sigma_px[60, 2] == 0.75
    assert np.isnan(nodes.area_px[60, 2])
    assert nodes.seen[60, 2]
    assert nodes.edits == "1 row was decided by a person: 1 of n2 in frame 60"
    # Written and read, it is the same; and so it is from the same edits once more.
    for name in ("a.parquet", "b.parquet", "a.csv"):
        dp.track(film, edits=edits, output=tmp_path / name, progress=False)
        assert not changed(dp.read_nodes(tmp_path / name), nodes).any()
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()
    assert plain.edits is None


def test_what_is_no_marker_is_missing_and_back_afterwards(
    film: Path, plain: dp.Nodes, tmp_path: Path
) -> None:
    edits = written(tmp_path, plain, 'what = "no_marker"\nnode = "n1"\nframes = "40..50"')
    nodes = dp.track(film, edits=edits, progress=False)
    assert set(np.argwhere(changed(nodes, plain))[:, 1]) == {1}
    assert (nodes.status[40:50, 1] == MISSING).all()
    assert plain.status[50, 1] == SEEN
    assert nodes.status[50, 1] == REACQUIRED
    assert (nodes.status[51:, 1] == plain.status[51:, 1]).all()
    assert nodes.edits == "10 rows were decided by a person: 10 of n1 in frames 40 to 49"


def test_a_detection_is_named_and_who_had_it_loses_it(film: Path, plain: dp.Nodes, tmp_path: Path) -> None:
    x, y = at(plain, 60, "n3")
    edits = written(
        tmp_path,
        plain,
        f'what = "name"\nnode = "n4"\nframe = 60\nat_px = [{x + 0.7}, {y - 0.4}]\nframes = "58..63"',
    )
    nodes = dp.track(film, edits=edits, progress=False)
    assert np.array_equal(nodes.xy_px[58:63, 4], plain.xy_px[58:63, 3])
    assert (nodes.status[58:63, 4] == MANUAL).all()
    assert np.isfinite(nodes.area_px[58:63, 4]).all()
    assert (nodes.status[58:63, 3] == MISSING).all()
    rows = np.argwhere(changed(nodes, plain))
    # After the gap that this makes in n3 it is back.
    assert {tuple(row) for row in rows.tolist()} == {(t, n) for t in range(58, 63) for n in (3, 4)} | {
        (63, 3)
    }
    assert nodes.status[63, 3] == REACQUIRED


def test_names_are_exchanged_and_a_second_time_back(film: Path, plain: dp.Nodes, tmp_path: Path) -> None:
    once = 'what = "exchange"\nnode = "n3"\nwith = "n4"\nframes = "100.."'
    nodes = dp.track(film, edits=written(tmp_path, plain, once), progress=False)
    assert np.array_equal(nodes.xy_px[100:, [3, 4]], plain.xy_px[100:, [4, 3]], equal_nan=True)
    seen = plain.seen[100:, [4, 3]]
    assert (nodes.status[100:, [3, 4]][seen] == MANUAL).all()
    assert (nodes.status[100:, [3, 4]][~seen] != AMBIGUOUS).all()
    back = dp.track(film, edits=written(tmp_path, plain, once, once), progress=False)
    assert np.array_equal(back.xy_px, plain.xy_px, equal_nan=True)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ('what = "no_marker"\nnode = "n99"\nframes = "4..9"', "line 6: n99 is no node; its nodes are n0, n1"),
        ('what = "no_marker"\nnode = "n1"\nframes = "9..4"', 'line 6: frames: "9..4" holds no frame'),
        ('what = "no_marker"\nnode = "n1"', "line 6: frames: a no_marker needs it"),
        ('what = "no_marker"\nnode = "n1"\nframes = "4..9"\nframe = 3', "frame: a no_marker has none"),
        ('what = "hide"\nnode = "n1"', "unknown variant `hide`"),
        (
            'what = "place"\nnode = "n1"\nframe = 3\nat_px = [1, 2]\nsigma_px = 0.0',
            "sigma_px: 0 is no standard",
        ),
        (
            'what = "place"\nnode = "n1"\nframe = 3\nat_px = [9000, 2]\nsigma_px = 1.0',
            "at_px: (9000, 2) is not in the picture",
        ),
        (
            'what = "name"\nnode = "n1"\nframe = 3\nat_px = [2, 2]\nframes = "3..9"',
            "nothing is detected at (2, 2) px of frame 3",
        ),
        (
            'what = "name"\nnode = "n1"\nframe = 3\nat_px = [2, 2]\nframes = "4..9"',
            "3 is not among the frames",
        ),
        ('what = "exchange"\nnode = "n1"\nwith = "n1"\nframes = "4..9"', "with: n1 is itself"),
    ],
)
def test_what_cannot_be_is_refused_by_its_line(
    film: Path, plain: dp.Nodes, tmp_path: Path, edit: str, said: str
) -> None:
    path = written(tmp_path, plain, edit)
    with pytest.raises(dp.ArgumentError) as caught:
        dp.track(film, edits=path, progress=False, output=tmp_path / "n.parquet")
    assert str(path) in str(caught.value)
    assert said in str(caught.value)
    assert not (tmp_path / "n.parquet").exists()


def test_frames_beyond_the_end_and_other_films_are_refused(film: Path, tmp_path: Path) -> None:
    short = tmp_path / "short.mp4"
    dp.film("clean", short, frames=30)
    nodes = dp.track(short, progress=False)
    for frames, wrong in (("10..31", 30), ("40..", 40)):
        late = written(tmp_path, nodes, f'what = "no_marker"\nnode = "n1"\nframes = "{frames}"')
        with pytest.raises(dp.ArgumentError, match=f"frames 0 to 29, and no frame {wrong}"):
            dp.track(short, edits=late, progress=False)
    # What is about frames that are not asked for is left out.
    late = written(tmp_path, nodes, 'what = "no_marker"\nnode = "n1"\nframes = "25..30"')
    assert dp.track(short, frames="0..20", edits=late, progress=False).edits == (
        "no row was decided by a person: no decision is about these frames"
    )
    with pytest.raises(dp.ArgumentError, match=r"about drop\.mp4, and drop\.mp4 is another film"):
        dp.track(film, edits=late, progress=False)
    rig = tmp_path / "rig.toml"
    nodes.rig.write(rig)
    with pytest.raises(dp.ArgumentError, match="it is a rig file, not a file of edits"):
        dp.track(short, edits=rig, progress=False)


def test_what_moves_without_markers_can_be_edited_too(film: Path, plain: dp.Nodes, tmp_path: Path) -> None:
    x, y = at(plain, 0, "n2")
    nodes = dp.track(film, marker=(x, y, 0), progress=False)
    assert len(nodes.rig.nodes) == 1
    assert nodes.seen[:, 0].all()
    edits = written(tmp_path, nodes, 'what = "no_marker"\nnode = "n0"\nframes = "20..30"')
    edited = dp.track(film, marker=(x, y, 0), edits=edits, progress=False)
    assert np.flatnonzero(changed(edited, nodes)[:, 0]).tolist() == [*range(20, 31)]
    assert edited.status[30, 0] == REACQUIRED


def test_the_program_says_what_people_decided_and_does_not_go_on_with_others(
    film: Path, plain: dp.Nodes, tmp_path: Path
) -> None:
    tracker = str(ROOT / "target" / "release" / "tracker")
    edits = written(tmp_path, plain, 'what = "no_marker"\nnode = "n1"\nframes = "40..50"')

    def track(*words: str) -> subprocess.CompletedProcess[str]:
        command = [
            tracker,
            "track",
            str(film),
            "-o",
            str(tmp_path / "n.parquet"),
            "--frames",
            "0..60",
            *words,
        ]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    made = track("--edits", str(edits))
    assert "note: 10 rows were decided by a person: 10 of n1 in frames 40 to 49" in made.stderr
    again = track("--resume", "--edits", str(edits))
    assert "complete already" in again.stderr
    other = track("--resume")
    assert other.returncode == 2
    assert "its run is complete and had other edits. Give --edits as it was then" in other.stderr
    over = tmp_path / "over.csv"
    over.write_bytes(edits.read_bytes())
    refused = subprocess.run(
        [tracker, "track", str(film), "-o", str(over), "--edits", str(over), "--force"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert refused.returncode == 2
    assert over.read_bytes() == edits.read_bytes()


def test_a_run_follows_its_edits_and_its_page_says_so(film: Path, plain: dp.Nodes, tmp_path: Path) -> None:
    edits = written(tmp_path, plain, 'what = "no_marker"\nnode = "n1"\nframes = "40..50"')
    options = Options(inputs=(str(film),), model="ratios", zero="vertical", overlay=False)
    folder = tmp_path / "run"
    analyse(options, folder)
    before = dp.read_nodes(folder / "drop" / "nodes.parquet")
    with_edits = Options(**{**vars(options), "edits": str(edits)})
    outcome = analyse(with_edits, folder)
    after = dp.read_nodes(folder / "drop" / "nodes.parquet")
    assert np.flatnonzero(changed(before, after).any(axis=1)).tolist() == [*range(40, 51)]
    page = (folder / "report.html").read_text("utf-8")
    assert "10 rows were decided by a person: 10 of n1 in frames 40 to 49" in page
    assert outcome.stages["drop/track"] == "done"
    analyse(options, folder)
    assert not changed(before, dp.read_nodes(folder / "drop" / "nodes.parquet")).any()
