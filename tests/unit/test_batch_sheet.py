"""The sheet of a batch: what laboratories write is read, what could be meant in two ways is refused by its line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pydpend.analyse import Options
from pydpend.batching.jobs import Found, find_recordings, named
from pydpend.batching.options import BatchOptions
from pydpend.batching.sheet import read_sheet
from pydpend.errors import PydpendError


def written(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    sheet = folder / "trials.csv"
    sheet.write_bytes(text.encode(encoding))
    return sheet


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("parter", [",", ";", "\t"])
def test_what_a_spreadsheet_writes_is_read(tmp_path: Path, encoding: str, parter: str) -> None:
    lines = (
        ["Path", "FPS", "start", "link length m", "laws", "pinned", "marker", ""],
        ["a.mp4", "2000", "0.25", "", "paper", "yes", "10,20 30,40@5", ""],
        [str(tmp_path / "b c.mp4"), "", "", "0.172", "", "", "", ""],
        [""] * 8,
    )
    quoted = ([f'"{cell}"' if "," in cell else cell for cell in line] for line in lines)
    text = "# trials of March\r\n" + "".join(parter.join(line) + "\r\n" for line in quoted)
    first, second = read_sheet(written(tmp_path, text, encoding))
    assert first.path == tmp_path / "a.mp4"
    assert dict(first.options) == {
        "fps": 2000.0,
        "start_s": 0.25,
        "laws": "paper",
        "pinned": True,
        "marker": ("10,20", "30,40@5"),
    }
    assert first.line == 3
    assert (second.path, dict(second.options)) == (tmp_path / "b c.mp4", {"link_length_m": 0.172})


def test_a_decimal_comma_is_read_where_commas_part_nothing(tmp_path: Path) -> None:
    (row,) = read_sheet(written(tmp_path, "path;fps\na.mp4;1000,5\n"))
    assert row.options["fps"] == 1000.5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the sheet is empty"),
        ("path,fps\n", "there is no recording below"),
        ("name,fps\na.mp4,2\n", "line 1: the column name is no option"),
        ("fps\n2\n", "there is no column path"),
        ("path,fsp\na.mp4,2\n", "Did you mean fps"),
        ("path,frame_rate\na.mp4,2\n", "take it into the table as it is with keep='frame_rate'"),
        ("path,scale\na.mp4,2\n", "Call the column link_length_m"),
        ("path,fps,FPS\na.mp4,2,3\n", "the column fps is there twice"),
        ("path,start,start_s\na.mp4,2,3\n", "the column start_s is there twice"),
        ("path,fps\na.mp4,2\n./a.mp4,3\n", "a.mp4 is in lines 2 and 3"),
        ("path,fps\na.mp4,2,3\n", "line 2: 3 fields, and the header has 2"),
        ("path,fps\na.mp4,fast\n", "line 2, column fps: 'fast' is not a number"),
        ("path,markers\na.mp4,2.5\n", "line 2, column markers: 2.5 is not a whole number"),
        ("path;fps\na.mp4;1.000\n", "1.000 may be 1000 or 1.000"),
        ("path;fps\na.mp4;1,000\n", "1,000 may be 1000 or 1.000"),
        ("path,pinned\na.mp4,maybe\n", "'maybe' is not yes or no"),
        ("path,fps\n,2\n", "line 2: the path is empty"),
        ("path,,fps\na.mp4,,2\n", "a column has no name"),
    ],
)
def test_what_could_be_meant_in_two_ways_is_refused(tmp_path: Path, text: str, said: str) -> None:
    sheet = written(tmp_path, text)
    with pytest.raises(PydpendError, match=re.escape(said)) as caught:
        read_sheet(sheet)
    assert str(caught.value).startswith(str(sheet))
    assert "\n" not in str(caught.value)


def test_a_workbook_and_a_missing_sheet_say_what_to_do(tmp_path: Path) -> None:
    import openpyxl

    openpyxl.Workbook().save(tmp_path / "trials.xlsx")
    with pytest.raises(PydpendError, match="Save the sheet as CSV"):
        read_sheet(tmp_path / "trials.xlsx")
    with pytest.raises(PydpendError, match="cannot be read"):
        read_sheet(tmp_path / "none.csv")


def test_columns_that_are_kept(tmp_path: Path) -> None:
    sheet = written(tmp_path, "path,date,operator\na.mp4,2026-03-01,Jo\n")
    (row,) = read_sheet(sheet, ("date", "operator"))
    assert (
        dict(row.kept)
        == {"date": "2026-03-01", "operator": "Jo"}
        == dict(read_sheet(sheet, ("all",))[0].kept)
    )
    with pytest.raises(PydpendError, match="there is no column dat"):
        read_sheet(sheet, ("dat", "date", "operator"))


def found(
    inputs: list[str], sheet: Path | None = None, base: Options | None = None
) -> tuple[list[Found], list[str]]:
    notes: list[str] = []
    how = BatchOptions(sheet=None if sheet is None else str(sheet))
    return find_recordings(inputs, base or Options(), how, notes.append), notes


def test_names_and_the_sheet_together(tmp_path: Path) -> None:
    for name in "abc":
        (tmp_path / f"{name}.mp4").write_bytes(b"")
    sheet = written(tmp_path, "path,fps\na.mp4,2000\nz.mp4,3000\n")
    some, notes = found([str(tmp_path / "*.mp4"), str(tmp_path / "a.mp4")], sheet, Options(fps=10.0))
    assert [(one.path.name, one.options.fps) for one in some] == [
        ("a.mp4", 2000.0),
        ("b.mp4", 10.0),
        ("c.mp4", 10.0),
    ]
    assert notes == [
        f"1 of 2 rows of {sheet} are of no recording given (line 3)",
        f"2 of 3 recordings have no row in {sheet}",
    ]
    # The sheet alone says which recordings there are; one that is not there is listed later, and stops nobody.
    assert [one.path.name for one in found([], sheet)[0]] == ["a.mp4", "z.mp4"]


def test_a_file_that_a_row_names_is_looked_for_beside_the_sheet(tmp_path: Path) -> None:
    (tmp_path / "pendulum.toml").write_text("x", "utf-8")
    (row,) = read_sheet(written(tmp_path, "path,model,zero\na.mp4,pendulum.toml,rest\n"))
    assert dict(row.options) == {"model": str(tmp_path / "pendulum.toml"), "zero": "rest"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("path,rig\na.mp4,none.toml\n", "line 2: rig: there is no file none.toml"),
        ("path,laws\na.mp4,all\n", "line 2: laws: 'all' is not a coefficient"),
        ("path,fps\na.mp4,-3\n", "line 2: fps: -3 is not above 0"),
    ],
)
def test_options_that_make_no_sense_are_refused_before_anything_is_done(
    tmp_path: Path, text: str, said: str
) -> None:
    with pytest.raises(PydpendError, match=re.escape(said)):
        found([], written(tmp_path, text))


def test_a_name_stays_the_recordings(tmp_path: Path) -> None:
    films = [
        tmp_path / name for name in ("mon/drop.mp4", "tue/drop.mp4", "tue/DROP.mp4", "tue/fall down.mp4")
    ]
    some = [Found(path, Options()) for path in films]
    first = [name for name, _ in named(some, {})]
    assert first == ["drop", "tue_drop", "tue_DROP_2", "fall_down"]
    known = dict(zip(map(str, films), first, strict=True))
    assert [name for name, _ in named(some[::-1], known)] == first[::-1]
