"""The page's server: who is let in, what is never served, and decisions that outlive it."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pydpend as dp
import pytest
from PIL import Image
from pydpend.page.frames import Frames
from pydpend.reading_options import OpenOptions

from tests.support.pages import Client

FRAMES = 40


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("films") / "short.mp4"
    dp.film("clean", path, frames=FRAMES)
    return path


@pytest.fixture
def page(film: Path, tmp_path: Path) -> Iterator[Client]:
    with dp.edit(film, run=tmp_path / "run") as served:
        yield Client(served.url)


PLACE = {"what": "place", "node": "n1", "frame": 7, "at_px": [20.5, 30.25], "sigma_px": 0.5}


def test_only_who_knows_the_token_gets_in(page: Client) -> None:
    assert page.ask("/api/state").status == 401
    assert page.ask("/api/frame/0").status == 401
    for token in ("", page.token[:-1], page.token + "x", None, 5):
        refused = page.ask("/api/session", {"token": token})
        assert refused.status == 403
        assert "set-cookie" not in refused.headers
    given = page.ask("/api/session", {"token": page.token}).headers["set-cookie"].lower()
    assert "httponly" in given
    assert "samesite=strict" in given
    assert page.token.lower() not in given
    assert page.enter().ask("/api/state").status == 200
    for other in (f"pydpend_{page.host.rpartition(':')[2]}=x", "a=b; c", 'pydpend="'):
        assert Client(page.url, other).ask("/api/state").status == 401


def test_another_name_for_this_machine_is_refused(page: Client) -> None:
    """As after DNS rebinding: the user's browser asks with the attacker's name as host."""
    page.enter()
    port = page.host.rpartition(":")[2]
    for host in (
        f"evil.example:{port}",
        "127.0.0.1",
        f"127.0.0.1.evil.example:{port}",
        f"localhost.evil:{port}",
    ):
        assert page.ask("/api/state", host=host).status == 421, host
        assert page.ask("/", host=host).status == 421, host
    assert page.ask("/api/state", host=f"localhost:{port}").status == 200


def test_another_site_changes_and_reads_nothing(page: Client) -> None:
    page.enter().settled()
    for origin in ("http://evil.example", "null", "http://127.0.0.1:1", f"https://{page.host}"):
        assert page.ask("/api/state", origin=origin).status == 403
        assert page.ask("/api/decide", PLACE, origin=origin).status == 403
    assert page.ask("/api/decide", PLACE, origin=None).status == 403
    # A form of another site can send text without asking first.
    assert page.ask("/api/decide", PLACE, kind="text/plain").status == 415
    assert page.ask("/api/decide", {**PLACE, "node": "n" * 70_000}).status == 413
    assert page.state()["edits"] == []
    assert page.ask("/api/decide", PLACE).status == 200


def test_no_file_is_served_but_the_page_s_own(page: Client) -> None:
    page.enter()
    for path in (
        "/static/../session.py",
        "/static/%2e%2e%2fsession.py",
        "/static/..%5csession.py",
        "/static//etc/passwd",
        "/static/%00",
        "/etc/passwd",
        "/static/index.html/../../guard.py",
    ):
        assert page.ask(path).status in (400, 404), path
    for name in ("index.html", "page.js", "page.css", "uPlot.iife.min.js"):
        answer = page.ask(f"/static/{name}")
        assert answer.status == 200
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert answer.headers["x-content-type-options"] == "nosniff"


def test_what_is_asked_wrongly_is_told_and_changes_nothing(page: Client) -> None:
    before = page.enter().settled()
    for said, why in (
        ({**PLACE, "node": "n77"}, "n77 is no node"),
        ({**PLACE, "frame": FRAMES}, f"frames 0 to {FRAMES - 1}, and no frame {FRAMES}"),
        ({**PLACE, "at_px": [1e6, 0]}, "is not in the picture"),
        ({**PLACE, "at_px": "x"}, "it cannot be"),
        ({**PLACE, "path": "/etc/passwd"}, "it has"),
        ({"what": "no_marker", "node": "n1", "frames": "5..400"}, "no frame 399"),
        ({"what": "hide", "node": "n1", "frames": "5..6"}, "unknown variant `hide`"),
    ):
        answer = page.ask("/api/decide", said)
        assert answer.status == 400, said
        assert why in answer.json["error"], answer.json
    assert page.ask("/api/choose", {"threads": 9}).status == 400
    assert page.ask("/api/choose", {"fps": -1}).status == 400
    assert page.ask(f"/api/frame/{FRAMES}").status == 400
    assert page.ask("/api/frame/x").status == 404
    assert page.state() == before


def test_a_decision_is_on_the_disk_and_in_the_table_and_can_be_undone(
    page: Client, film: Path, tmp_path: Path
) -> None:
    before = page.enter().settled()
    files = {name: Path(path) for name, path in before["files"].items()}
    assert {path.parent for path in files.values()} == {tmp_path / "run"}
    plain = files["table"].read_bytes()
    shown = page.ask("/api/decide", PLACE).json
    # At once, before the film is tracked again.
    assert page.ask("/api/rows?first=7&last=8").json["rows"][0][1] == [20.5, 30.25, 0.5, 5]
    (entry,) = tomllib.loads(files["edits"].read_text())["edit"]
    assert {key: entry[key] for key in PLACE} == PLACE
    assert shown["edits"][0]["what"] == "place"
    after = page.settled()
    assert after["table"]["decided"] == "1 row was decided by a person: 1 of n1 in frame 7"
    nodes = dp.read_nodes(files["table"])
    assert nodes.xy_px[7, 1].tolist() == [20.5, 30.25]
    # The command that the page names gives the same.
    again = dp.track(film, files["rig"], edits=files["edits"], progress=False)
    np.testing.assert_array_equal(again.xy_px, nodes.xy_px)
    page.ask("/api/undo", {})
    assert page.settled()["edits"] == []
    assert files["table"].read_bytes() == plain


def test_doubts_are_what_nobody_decided(page: Client) -> None:
    before = page.enter().settled()["table"]["doubts"]
    assert before[0]["why"] == "it is not seen"
    node, first, last = before[0]["node"], before[0]["first"], before[0]["last"]
    page.ask("/api/decide", {"what": "no_marker", "node": node, "frames": f"{first}..{last + 1}"})
    assert page.settled()["table"]["doubts"] == before[1:]
    page.ask("/api/undo", {})
    assert page.settled()["table"]["doubts"] == before


def test_two_pages_on_one_film_do_not_write_over_each_other(film: Path, tmp_path: Path) -> None:
    with dp.edit(film, run=tmp_path) as first, dp.edit(film, run=tmp_path) as second:
        one, two = Client(first.url).enter(), Client(second.url).enter()
        one.settled()
        two.settled()
        assert one.ask("/api/decide", PLACE).status == 200
        told = two.ask("/api/decide", {**PLACE, "node": "n2"})
        assert told.status == 409
        assert "another page or program has changed it since" in told.json["error"]
        # It shows now what is there, and can go on.
        assert [e["node"] for e in two.state()["edits"]] == ["n1"]
        assert two.ask("/api/decide", {**PLACE, "node": "n2"}).status == 200
        assert one.ask("/api/undo", {}).status == 409
        assert len(tomllib.loads((tmp_path / "short.edits.toml").read_text())["edit"]) == 2


def test_what_a_person_wrote_into_the_file_stays(film: Path, tmp_path: Path) -> None:
    with dp.edit(film, run=tmp_path) as served:
        Client(served.url).enter().settled()
        Client(served.url).enter().ask("/api/decide", PLACE)
    path = tmp_path / "short.edits.toml"
    path.write_text(path.read_text() + "# The cable hides n1 here.\n")
    with dp.edit(film, run=tmp_path) as served:
        page = Client(served.url).enter()
        assert page.settled()["table"]["decided"] is not None
        page.ask("/api/decide", {**PLACE, "frame": 8})
        page.ask("/api/undo", {})
    assert "# The cable hides n1 here.\n" in path.read_text()
    path.write_text("schema = ")
    with pytest.raises(dp.ArgumentError, match="it is no TOML"):
        dp.edit(film, run=tmp_path)


def test_a_program_that_is_killed_has_lost_nothing(film: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pydpend", "edit", str(film), "--run", str(tmp_path), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        page = Client(running.stdout.readline().strip()).enter()
        page.settled()
        page.ask("/api/decide", PLACE)
        os.kill(running.pid, signal.SIGKILL)
    (entry,) = tomllib.loads((tmp_path / "short.edits.toml").read_text())["edit"]
    assert entry["node"] == "n1"
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".edits-")] == []


def test_the_program_ends_with_ctrl_c_and_says_where_decisions_are(film: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "pydpend", "edit", str(film), "--run", str(tmp_path), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        assert running.stdout is not None
        assert running.stdout.readline().startswith("http://127.0.0.1:")
        running.send_signal(signal.SIGINT)
        _, said = running.communicate(timeout=30)
    assert running.returncode == 130
    assert said == "pydpend: interrupted\n"


def test_what_is_no_film_is_refused_in_one_line(tmp_path: Path) -> None:
    text = tmp_path / "a.csv"
    text.write_text("time_s,phi1_rad\n0,1\n")
    for name, why in (
        (str(text), "it is an angles table, not a film"),
        (str(tmp_path / "no.mp4"), "no such file"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "pydpend", "edit", name, "--no-browser"],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 2
        assert why in done.stderr
        assert done.stderr.count("\n") == 1


def test_a_frame_in_a_notebook_is_of_this_machine(film: Path, tmp_path: Path) -> None:
    with dp.edit(film, run=tmp_path) as served:
        shown = served._repr_html_()
        assert 'src="http://localhost:' in shown
        policy = Client(served.url).ask("/").headers["content-security-policy"]
        assert "frame-ancestors http://127.0.0.1:* http://localhost:*" in policy


def test_frames_are_the_film_s_own_by_their_index(tmp_path: Path) -> None:
    deep = tmp_path / "deep.mraw"
    made = dp.film("clean", deep, frames=12, bits=12)
    frames = Frames(deep, OpenOptions())
    # Forwards, back and again: the very samples.
    for index in (5, 0, 11, 5):
        samples, bits = frames.samples(index)
        assert bits == 12
        assert samples is not None
        np.testing.assert_array_equal(samples, made.image(index))
    with pytest.raises(dp.ArgumentError, match="there is no frame 12: frames 0 to 11 were read"):
        frames.samples(12)
    with dp.edit(deep, run=tmp_path / "run") as served:
        page = Client(served.url).enter()
        whole = page.ask("/api/frame/3").body
        stretched = page.ask("/api/frame/3?low=0&high=400").body
        small = Image.open(io.BytesIO(page.ask("/api/frame/3?width=80").body))
        assert small.width == 80
        assert (
            np.asarray(Image.open(io.BytesIO(stretched))).mean()
            > np.asarray(Image.open(io.BytesIO(whole))).mean()
        )
