"""Arrows go right only (docs/explanation/architecture.md): read from the imports, not from what anyone says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.support.module_graph import (
    CRATES,
    PACKAGE,
    ROOT,
    Crate,
    Graph,
    circles,
    layers,
    python_graph,
    rooms,
)

# From left to right. A module may import from its own group and from those to its left.
GROUPS: tuple[tuple[str, ...], ...] = (
    (
        "terminal",
        "output",
        "number_words",
        "option_fields",
        "worded",
        "errors",
        "crossing",
        "_typing",
        "_native",
        "plain_text",
        "track_forms",
        "kinds",
        "argument_types",
        "typed",
        "json_text",
        "datasets",
        "tabular",
        "table_exports",
        "documents",
        "instants",
        "units",
        "delimited",
        "columns",
        "arrays",
        "series",
        "marker_status",
        "raw_tracks",
        "long_table",
    ),
    (
        "reading_options",
        "rig",
        "node_arrays",
        "bare_nodes",
        "nodes",
        "tracks",
        "live",
        "progress",
        "wanted",
        "tracking",
        "filming",
        "scoring",
        "exporting",
        "components",
        "bearings",
    ),
    ("coefficients", "model", "fit_options", "fit_status", "information"),
    ("kinematics",),
    ("encoder",),
    ("simulation", "linear", "link_states"),
    ("free_swing", "decay", "energy", "damping", "trials"),
    ("fit_folder", "recording_folder", "run_folder"),
    ("plots",),
    ("citing", "report"),
    ("analyse",),
    ("batching",),
    ("page",),
    ("cli",),
)


def top_modules() -> list[str]:
    names = {p.stem if p.is_file() else p.name for p in PACKAGE.iterdir()}
    return sorted(n for n in names if re.fullmatch(r"[a-z_]+", n) and n not in ("__init__", "__pycache__"))


# The same for the crates. A crate that is not listed has no rooms but files beside each other.
RUST_GROUPS: dict[str, tuple[tuple[str, ...], ...]] = {
    "tracker": (
        ("message", "name", "csv_text", "error", "setting_words", "stop", "output", "packed", "kind"),
        (
            *(
                "pixel_aspect",
                "pixel_damage",
                "gaps",
                "frame",
                "gray",
                "camera",
                "observation",
                "timing",
                "peak_level",
            ),
            *("rig", "wanted"),
        ),
        ("source",),
        ("detect",),
        ("table", "store"),
        ("rigid", "link", "calibrate"),
        ("edits",),
        ("discover", "moving", "track"),
        ("synth",),
        ("residual", "score"),
        ("pipeline",),
        ("overlay",),
        ("setup",),
        ("cli",),
    ),
    "dynamics": (
        ("scalar", "state"),
        ("parameters", "terms", "fixture"),
        ("balance",),
        ("motion",),
        ("friction",),
        ("smoother",),
        ("integrate",),
        ("analysis",),
        ("shooting",),
    ),
}


def assert_right(graph: Graph, groups: tuple[tuple[str, ...], ...]) -> None:
    """Each room has a place, and needs only its own group and those to its left."""
    rank = {name: i for i, group in enumerate(groups) for name in group}
    for (room, *_), needed in rooms(graph).items():
        assert room in rank, f"{room} has no place in the flow: give it one"
        for other, *_ in needed:
            assert rank.get(other, -1) <= rank[room], f"{room} may not use {other}, to its right"
    gone = set(rank) - {room for (room, *_) in rooms(graph)} - {"_native"}
    assert not gone, f"{sorted(gone)} have a place and are not there"


def test_python_arrows_go_right() -> None:
    graph = python_graph()
    assert {n for n in top_modules() if n not in ("_native", "py", "__main__")} == {
        m[0] for m in graph if m
    } - {"__main__"}
    graph.pop(("__main__",), None)
    assert_right(graph, GROUPS)


@pytest.mark.parametrize("crate", RUST_GROUPS)
def test_rust_arrows_go_right(crate: str) -> None:
    assert_right(Crate(CRATES[crate]).graph(), RUST_GROUPS[crate])


@pytest.mark.parametrize("part", [*CRATES, "python"])
def test_no_file_needs_one_that_needs_it(part: str) -> None:
    graph = python_graph() if part == "python" else Crate(CRATES[part]).graph()
    found = [["::".join(module) for module in circle] for circle in circles(graph)]
    assert not found, f"circles between files: {found}. Move what both need to a file of its own"
    if not circles(graph):
        print(
            f"\n{part}: "
            + " | ".join(" ".join("::".join(m) for m in layer) for layer in layers(rooms(graph)))
        )


@pytest.mark.parametrize("crate", CRATES)
def test_the_front_of_a_folder_defines_nothing(crate: str) -> None:
    read = Crate(CRATES[crate])
    for module, file in read.files.items():
        if file.name == "mod.rs":
            assert not read.defined(module), f"{file.relative_to(ROOT)} defines {read.defined(module)}"
        inner = {other for other in read.files if other[:-1] == module and module}
        assert file.stem in ("mod", "lib", "main") or not inner, (
            f"{file.relative_to(ROOT)} stands beside its folder: make it mod.rs, and let it define nothing"
        )


def test_what_holds_the_arrows_sees_them(tmp_path: Path) -> None:
    """A crate with one of each fault: paths of every form are found, tests and other crates are left out."""
    files = {
        "lib.rs": "pub mod a;\nmod b;\nmod room;\n",
        "a.rs": "use crate::room::Shown as S;\nfn f() { S::new() }\n#[cfg(test)]\nmod tests { use crate::b::B; }\n",
        "b.rs": "use std::fmt;\nuse super::{a::f, room};\nfn g() { room::deep::h() }\n",
        "room/mod.rs": "mod deep;\npub use deep::{h, Shown};\npub struct Here;\n",
        "room/deep.rs": "pub struct Shown;\n// crate::a::f\npub fn h() { crate::b::g() }\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, "utf-8")
    crate = Crate(tmp_path)
    graph = crate.graph()
    assert graph[("a",)] == {("room", "deep")}
    assert graph[("b",)] == {("a",), ("room", "deep")}
    assert graph[("room", "deep")] == {("b",)}
    assert circles(graph) == [[("a",), ("b",), ("room", "deep")]]
    assert crate.defined(("room",)) == ["struct Here;"]
    assert not crate.defined(())
    with pytest.raises(AssertionError, match="may not use room"):
        assert_right(graph, (("a", "b"), ("room",)))
    with pytest.raises(AssertionError, match="room has no place"):
        assert_right(graph, (("a", "b"),))
    graph[("room", "deep")] = set()
    assert not circles(graph)
    assert layers(graph) == [[(), ("room",), ("room", "deep")], [("a",)], [("b",)]]


def test_the_tracker_knows_no_pendulum_physics() -> None:
    words = re.compile(r"\b(dynamics::|gravity|mu_v|torque)\b")
    for file in sorted((ROOT / "crates" / "tracker" / "src").rglob("*.rs")):
        code = re.sub(r"//.*", "", file.read_text("utf-8"))
        assert not words.search(code), f"{file.name}: {words.search(code)}"


def test_the_crates_below_know_no_python() -> None:
    for crate in ("tracker", "dynamics"):
        manifest = (ROOT / "crates" / crate / "Cargo.toml").read_text("utf-8")
        assert "pyo3" not in manifest
        assert "numpy" not in manifest
