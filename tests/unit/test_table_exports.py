"""Angles, states and nodes in the forms of other programs: read back to the last bit that each form holds."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pydpend as dp
import pytest
from numpy.testing import assert_array_equal
from pydpend.cli import main
from pydpend.nodes import Nodes
from pydpend.table_exports import TABLE_WRITERS
from pydpend.tabular import TableResult

from tests.support.drawn_nodes import RIG, some_nodes
from tests.support.made_results import fit, motion


def gapped() -> dp.LinkAngles:
    """Angles of which some are not seen."""
    angles = motion()
    phi, sigma = angles.phi_rad.copy(), angles.sigma_rad.copy()
    phi[10:13, 1] = sigma[10:13, 1] = np.nan
    return dp.LinkAngles(angles.t_s, phi, sigma, np.arange(angles.t_s.size))


RESULTS: dict[str, Callable[[], TableResult]] = {"angles": gapped, "states": lambda: dp.states(gapped())}


def of_mat(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    return {k: v for k, v in loadmat(path, squeeze_me=True).items() if not k.startswith("__")}


def of_netcdf(path: Path) -> dict[str, Any]:
    import xarray as xr

    with xr.open_dataset(path, engine="h5netcdf") as dataset:
        assert set(dataset.dims) == {"time"}
        return {"time_s": dataset["time"].values, **{str(k): v.values for k, v in dataset.data_vars.items()}}


def of_storage(path: Path) -> dict[str, Any]:
    """OpenSim's storage by its own rules: a header to ``endheader``, then names and rows by tabs."""
    head, _, body = path.read_text("utf-8").partition("endheader\n")
    said = dict(line.split("=") for line in head.splitlines()[1:])
    table = pd.read_csv(path, sep="\t", skiprows=len(head.splitlines()) + 1)
    assert said == {
        "version": "1",
        "nRows": str(len(table)),
        "nColumns": str(table.shape[1]),
        "inDegrees": "no",
    }
    assert body.startswith("time\t")
    return dict(table.rename(columns={"time": "time_s"}))


READERS: dict[str, Callable[[Path], dict[str, Any]]] = {
    ".csv": lambda path: dict(pd.read_csv(path)),
    ".mat": of_mat,
    ".nc": of_netcdf,
    ".xlsx": lambda path: dict(pd.read_excel(path)),
    ".mot": of_storage,
    ".sto": of_storage,
    ".parquet": lambda path: dict(pd.read_parquet(path)),
}


@pytest.mark.parametrize("ending", TABLE_WRITERS)
@pytest.mark.parametrize("kind", RESULTS)
def test_a_table_is_read_back_to_the_last_bit(kind: str, ending: str, tmp_path: Path) -> None:
    result = RESULTS[kind]()
    dp.export(result, tmp_path / f"t{ending}")
    found, expected = READERS[ending](tmp_path / f"t{ending}"), result.to_columns()
    assert set(found) == set(expected)
    # A sheet of Excel has 16 digits of each number: half of the last is 5e-16 of it at most, and reading rounds by
    # 1.1e-16.
    rtol = 6.2e-16 if ending == ".xlsx" else 0
    for name, values in expected.items():
        read = np.asarray(found[name], dtype=np.float64)
        np.testing.assert_allclose(read, values, rtol=rtol, atol=0, err_msg=name)


def test_exported_angles_are_angles_again(tmp_path: Path) -> None:
    angles = gapped()
    for name in ("a.csv", "a.parquet"):
        dp.export(angles, tmp_path / name)
        back = dp.read_angles(tmp_path / name)
        assert_array_equal(back.phi_rad, angles.phi_rad)
        assert_array_equal(back.sigma_rad, angles.sigma_rad)


def same(back: Nodes, nodes: Nodes) -> None:
    for name in ("frame", "t_s", "xy_px", "sigma_px", "area_px", "status"):
        assert_array_equal(getattr(back, name), getattr(nodes, name), err_msg=name)
        assert getattr(back, name).dtype == getattr(nodes, name).dtype
    assert back.rig == nodes.rig
    assert back.meta == nodes.meta


def test_nodes_go_to_a_dataset_as_movement_has_it_and_back(tmp_path: Path) -> None:
    nodes = replace(some_nodes(), rig=replace(RIG, pixel_aspect=(16, 15)))
    dataset = nodes.to_xarray()
    assert dataset["position"].dims == ("time", "space", "keypoints", "individuals")
    assert_array_equal(dataset["position"].values[:, 1, :, 0], nodes.xy_px[..., 1])
    assert np.isnan(dataset["confidence"]).all()
    same(dp.read_tracks(dataset), nodes)
    dp.export(nodes, tmp_path / "n.nc")
    same(dp.read_tracks(tmp_path / "n.nc"), nodes)
    with pytest.raises(dp.PydpendError, match="it is nodes with all that is known of them"):
        dp.read_tracks(tmp_path / "n.nc", fps=3.0)


def test_movement_takes_the_dataset(tmp_path: Path) -> None:
    save_poses = pytest.importorskip(
        "movement.io.save_poses", reason="movement is not installed: pip install --group fixtures"
    )
    nodes = some_nodes()
    save_poses.to_dlc_file(nodes.to_xarray(), tmp_path / "n.csv", split_individuals=False)
    back = dp.read_tracks(tmp_path / "n.csv", fps=500, min_confidence=0.0)
    assert_array_equal(back.xy_px, nodes.xy_px)


def test_nodes_in_a_sheet(tmp_path: Path) -> None:
    nodes = some_nodes()
    dp.export(nodes, tmp_path / "n.xlsx")
    table = pd.read_excel(tmp_path / "n.xlsx")
    assert list(table.columns) == list(nodes.to_dataframe().columns)
    x_px = np.asarray(table["x_px"], dtype=np.float64).reshape(50, 3)
    np.testing.assert_allclose(x_px, nodes.xy_px[..., 0], rtol=6.2e-16)
    assert table["status"].iloc[0] == dp.nodes.STATUS_WORDS[nodes.status[0, 0]]


@pytest.mark.filterwarnings("ignore:No analog data")
@pytest.mark.parametrize(("name", "atol"), [("n.trc", 1.2e-13), ("n.csv", 1.2e-13), ("n.c3d", 1.6e-5)])
def test_nodes_come_back_from_forms_with_y_up(name: str, atol: float, tmp_path: Path) -> None:
    """Up and down again costs two roundings at 480, of 2^-44 each; C3D holds 24 bits, 480 to within 1.6e-5."""
    nodes = some_nodes()
    dp.export(nodes, tmp_path / name, px_per_m=1000 if name.endswith("3d") else None)
    settings: dict[str, Any] = {"fps": 500} if name.endswith("csv") else {}
    back = dp.read_tracks(tmp_path / name, image_px=(640, 480), **settings)
    # DLTdv has a row for each frame of the film, from the first.
    begin = len(back) - len(nodes)
    assert_array_equal(back.frame[begin:], nodes.frame)
    np.testing.assert_allclose(back.xy_px[begin:], nodes.xy_px, rtol=0, atol=atol)
    np.testing.assert_allclose(back.t_s[begin:], nodes.t_s, rtol=0, atol=1e-15)
    if name == "n.c3d":
        # Residuals are there in 127 steps, to the largest.
        np.testing.assert_allclose(
            back.sigma_px, nodes.sigma_px, atol=0.51 * float(np.nanmax(nodes.sigma_px)) / 127
        )


def test_what_a_form_cannot_hold_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(dp.TableError, match=r"t\.mot: it has no times, and OpenSim's files need them"):
        dp.export(fit(), tmp_path / "t.mot")
    with pytest.raises(
        dp.ArgumentError, match=r"the ending is none of \.csv, \.mat, \.nc, \.xlsx, \.mot, \.sto"
    ):
        dp.export(gapped(), tmp_path / "t.c3d")
    monkeypatch.setattr("pydpend.table_exports.EXCEL_ROWS", 100)
    with pytest.raises(
        dp.TableError, match=r"t\.xlsx: it has 1001 rows, and a sheet of Excel has 100 with the header"
    ):
        dp.export(gapped(), tmp_path / "t.xlsx")
    assert not list(tmp_path.iterdir())

    class Named(TableResult):
        def to_columns(self) -> dict[str, Any]:
            return {"time_s": np.arange(2.0), "phi_a-b_rad": np.zeros(2), "phi_a_b_rad": np.ones(2)}

    with pytest.raises(dp.TableError, match="have one name, phi_a_b_rad, in MATLAB"):
        dp.export(Named(), tmp_path / "t.mat")


def test_the_command_writes_angles_and_states(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    angles = tmp_path / "a.parquet"
    dp.write_angles(gapped(), angles)
    assert main(["export", str(angles), "-o", str(tmp_path / "a.mat")]) == 0
    assert_array_equal(of_mat(tmp_path / "a.mat")["phi1_rad"], gapped().phi_rad[:, 0])
    command = ["export", str(angles), "--states", "-o", str(tmp_path / "s.mot"), "--json"]
    assert main(command) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 1001
    assert "w1_rad_s" in of_storage(tmp_path / "s.mot")
    # A table of states or points is written with all its columns.
    for name, states in (("st.parquet", dp.states(gapped())), ("pt.csv", dp.states(gapped()))):
        dp.export(states, tmp_path / name)
        if name == "pt.csv":
            text = (tmp_path / name).read_text("utf-8")
            (tmp_path / name).write_text(text.replace("phi", "x_n").replace("_rad", "_m"), "utf-8")
        assert main(["export", str(tmp_path / name), "-o", str(tmp_path / f"{name}.mot")]) == 0
        assert len(of_storage(tmp_path / f"{name}.mot")) == len(states.to_columns())
    some_nodes().write(tmp_path / "n.parquet")
    assert main(["export", str(tmp_path / "n.parquet"), "--states", "-o", str(tmp_path / "n.mat")]) == 2
    assert "n.parquet is no angles table" in capsys.readouterr().err
    assert main(["export", str(angles), "--px-per-m", "9", "-o", str(tmp_path / "b.mot")]) == 2
    assert "--px-per-m: a table has no scale" in capsys.readouterr().err
