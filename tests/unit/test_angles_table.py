"""The angles table: what is valid, files there and back, the authors' folder, bad files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pydpend.errors import AnglesError
from pydpend.kinematics import LinkAngles, LinkJoint, read_angles, write_angles

SHARED = Path(__file__).parents[2] / ".." / "shared" / "data"


def sample(links: int = 2, rows: int = 50) -> LinkAngles:
    rng = np.random.default_rng(1)
    t = np.arange(rows) / 500.0
    phi = np.cumsum(rng.normal(0, 0.3, (rows, links)), axis=0)
    phi[10:13, links - 1] = np.nan
    return LinkAngles(
        t, phi, np.full((rows, links), 1e-3), np.arange(rows) + 7, {"method": "rigid", "n": 3}, "drop"
    )


@pytest.mark.parametrize("ending", ["parquet", "csv"])
@pytest.mark.parametrize("links", [1, 2])
def test_there_and_back_is_bit_for_bit(tmp_path: Path, ending: str, links: int) -> None:
    a = sample(links)
    write_angles(a, tmp_path / f"drop.{ending}")
    b = read_angles(tmp_path / f"drop.{ending}")
    for x, y in ((a.t_s, b.t_s), (a.phi_rad, b.phi_rad), (a.sigma_rad, b.sigma_rad), (a.frame, b.frame)):
        np.testing.assert_array_equal(x, y)
    assert b.name == "drop"
    assert b.meta["method"] == "rigid"
    assert math.isnan(b.sigma_rad[11, links - 1]), "a sigma without an angle says nothing"


def test_degrees_notes_above_the_header_decimal_commas_and_other_names(tmp_path: Path) -> None:
    file = tmp_path / "lab.csv"
    file.write_text("Logger 3000;;\n\nzeit;winkel\n0,0;180,0\n0,5;181,0\n1,0;\n1,5;183\n")
    a = read_angles(
        file, columns={"time_s": "zeit", "phi1_deg": "winkel"}, hanging_rad=math.pi, clockwise=True
    )
    np.testing.assert_allclose(np.degrees(a.phi_rad[[0, 1, 3], 0]), [0, -1, -3], atol=1e-12)
    assert np.isnan(a.phi_rad[2, 0])
    assert np.isnan(a.sigma_rad).all()
    assert a.frame is None


def test_wrapped_angles_are_refused_and_unwrapped_on_request(tmp_path: Path) -> None:
    t = np.arange(200) / 100
    true = 7.0 * t
    rows = "".join(
        f"{a!r},{(b + math.pi) % (2 * math.pi) - math.pi!r}\n"
        for a, b in zip(t.tolist(), true.tolist(), strict=True)
    )
    file = tmp_path / "wrapped.csv"
    file.write_text("time_s,phi1_rad\n" + rows)
    with pytest.raises(AnglesError, match=r"wrapped.csv, line 47, column phi1_rad.*not unwrapped"):
        read_angles(file)
    np.testing.assert_allclose(read_angles(file, unwrap=True).phi_rad[:, 0], true, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("time_s,phi1_rad\n", "no rows"),
        ("time_s,angle\n0,1\n", "no column phi1_rad"),
        ("seconds,phi1_rad\n0,1\n", "no column time_s.*The columns are seconds, phi1_rad"),
        ("time_s,phi1_rad\n0,1\n1,oops\n", "line 3, column phi1_rad: 'oops' is not a number"),
        ("time_s,phi1_rad\n0,1\n1\n", "line 3: 1 fields parted by commas, the header in line 1 has 2"),
        ("time_s,phi1_rad\n0,1\n2,1\n1,1\n", "line 4, column time_s.*does not come after"),
        ("time_s,phi1_rad\n0,1\n,1\n", "line 3, column time_s.*not a number"),
        ("time_s,phi1_rad\n0,inf\n", "line 2, column phi1_rad.*infinite"),
        ("time_s,phi1_rad,sigma1_rad\n0,1,-1\n", "line 2, column sigma1_rad.*cannot be"),
        ("frame,time_s,phi1_rad\n1,0,1\n1,1,1\n", "line 3, column frame"),
        ("frame,time_s,phi1_rad\n1.5,0,1\n", "line 2, column frame.*index"),
        ("time_s,phi1_rad,phi1_rad\n0,1,1\n", "2 times"),
        ("time_s,phi1_rad,phi1_deg\n0,1,1\n", "both phi1_rad and phi1_deg"),
    ],
)
def test_bad_tables_are_refused_with_file_line_and_column(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(AnglesError, match=message) as caught:
        read_angles(file)
    assert "bad.csv" in str(caught.value)


def test_files_that_are_something_else(tmp_path: Path) -> None:
    (tmp_path / "x.parquet").write_bytes(b"PAR1 and then nothing good PAR1")
    (tmp_path / "y.csv").write_bytes(bytes(range(256)))
    for name, message in (("x.parquet", "damaged"), ("y.csv", "neither"), ("absent.csv", "cannot be read")):
        with pytest.raises(AnglesError, match=message):
            read_angles(tmp_path / name)
    with pytest.raises(AnglesError, match=r"a folder of tables, not an angles table.*dp\.read_holds"):
        read_angles(tmp_path)
    folder = tmp_path / "trial"
    folder.mkdir()
    with pytest.raises(AnglesError, match="no DPmean_data_RB0"):
        read_angles(folder)
    np.save(folder / "DPmean_data_RB0.npy", np.zeros((3, 4)))
    with pytest.raises(AnglesError, match=r"shape \(2, T\)"):
        read_angles(folder)
    with pytest.raises(AnglesError, match="ending"):
        write_angles(sample(), tmp_path / "a.txt")
    with pytest.raises(AnglesError, match="cannot be written"):
        write_angles(sample(), tmp_path / "none" / "a.csv")


def test_the_class_refuses_shapes_that_cannot_be() -> None:
    t = np.arange(4.0)
    for phi in (np.zeros((4, 0)), np.zeros((3, 1)), np.zeros(4)):
        with pytest.raises(AnglesError, match="shape"):
            LinkAngles(t, phi, phi)
    with pytest.raises(AnglesError, match="Give each link a name of its own"):
        LinkAngles(t, np.zeros((4, 2)), np.zeros((4, 2)), link_names=("a", "a"))
    with pytest.raises(AnglesError, match="the joint knee is of a link 'c' that is not there"):
        LinkAngles(
            t, np.zeros((4, 1)), np.zeros((4, 1)), link_names=("a",), joints=(LinkJoint("knee", ("a", "c")),)
        )
    with pytest.raises(AnglesError, match="frames"):
        LinkAngles(t, np.zeros((4, 1)), np.zeros((4, 1)), np.arange(3))


def test_between_keeps_the_rows_inside() -> None:
    a = sample().between(0.02, 0.04)
    assert a.t_s[0] == 0.02
    assert a.t_s[-1] == 0.04
    assert a.frame is not None
    assert a.frame[0] == 17
    with pytest.raises(AnglesError, match="nothing between"):
        a.between(5, 6)


@pytest.mark.skipif(not (SHARED / "myers_trials").is_dir(), reason="the real recordings are not here")
@pytest.mark.parametrize("trial", ["trial1", "trial2"])
def test_the_authors_trials(trial: str) -> None:
    a = read_angles(SHARED / "myers_trials" / trial)
    assert a.phi_rad.shape == (38827, 2)
    assert a.name == trial
    assert a.step_s == pytest.approx(0.002)
    # Hanging at both ends, the end whole turns from the start: within the bias its README allows, 0.25 deg.
    ends = np.degrees(a.phi_rad[-1])
    np.testing.assert_allclose(ends, 360 * np.rint(ends / 360), atol=0.25)
    # The medians that its README states, to its two decimals.
    median = np.degrees(np.nanmedian(a.sigma_rad, axis=0))
    assert 0.155 <= median[0] < 0.195
    assert 0.345 <= median[1] < 0.425


@pytest.mark.skipif(not (SHARED / "multiarm").is_dir(), reason="the real recordings are not here")
def test_multiarm_is_read_with_its_names_and_its_zero() -> None:
    a = read_angles(
        SHARED / "multiarm" / "double_freeswing_1kHz.csv",
        columns={"time_s": "t_s", "phi1_rad": "theta1_rad", "phi2_rad": "theta2_rad"},
        hanging_rad=math.pi,
    )
    assert a.phi_rad[0] == pytest.approx([2.615775 - math.pi, 3.541416 - math.pi])
    turns = a.phi_rad[-1] / (2 * math.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=0.05)
