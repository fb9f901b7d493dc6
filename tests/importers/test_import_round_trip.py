"""A flown log, exported with other names, units and signs, comes back as it was."""

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
from import_flight import flown, foreign, mapping_by_name, mapping_by_number, write_csv
from tiers import sampled

from airtruth.identification import identify
from airtruth.importers import import_log
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import read_log, write_log
from airtruth.logs.validate import validate


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("flown"), runs=1)


def export(kind, folder, log):
    columns = foreign(log)
    matrix = np.column_stack(list(columns.values()))
    if kind == "csv":
        write_csv(folder / "f.csv", columns)
        return folder / "f.csv", mapping_by_name()
    if kind == "semicolon":
        write_csv(folder / "f.csv", columns, ";")
        text = (folder / "f.csv").read_text()
        (folder / "f.csv").write_text("% exported\n% by hand\n" + text.replace(".", ","))
        return folder / "f.csv", mapping_by_name('delimiter = ";"\ndecimal = ","')
    if kind == "table":
        np.savetxt(folder / "f.txt", matrix, fmt="%.17g", header="no names that could be read")
        return folder / "f.txt", mapping_by_number("x").replace('variable = "x"', "")
    if kind == "parquet":
        pd.DataFrame(columns).to_parquet(folder / "f.parquet")
        return folder / "f.parquet", mapping_by_name()
    if kind == "mat":
        scipy.io.savemat(folder / "f.mat", {"fdata": matrix, "note": "text"})
        return folder / "f.mat", mapping_by_number("fdata")
    if kind == "mat struct":
        names = {n: n.split()[0].replace("Clock", "Clock_ms") for n in columns}
        inner = {names[n]: v for n, v in columns.items()}
        scipy.io.savemat(folder / "f.mat", {"rec": {"imu": inner}})
        text = mapping_by_name()
        for name, plain in names.items():
            text = text.replace(f'"{name}"', f'"rec.imu.{plain}"')
        return folder / "f.mat", text
    with h5py.File(folder / "f.mat", "w", userblock_size=512) as file:
        file.create_dataset("fdata", data=matrix.T)  # MATLAB writes columns first
        file["fdata"].attrs["MATLAB_class"] = np.bytes_("double")
    return folder / "f.mat", mapping_by_number("fdata")


@pytest.mark.grid
@pytest.mark.parametrize(
    "kind", sampled(["csv", "semicolon", "table", "parquet", "mat", "mat struct", "mat 7.3"], 4)
)
def test_every_format_gives_the_same_log_and_estimates(kind, log, gtm, tmp_path):
    path, text = export(kind, tmp_path, log)
    (tmp_path / "map.toml").write_text(text)
    imported = import_log(path, tmp_path / "map.toml")
    assert imported.faults == ()
    write_log(tmp_path / "log.parquet", imported.log, dtype="float64")
    back = read_log(tmp_path / "log.parquet")
    validate(back)
    assert back.run_ids == ("flight",)
    np.testing.assert_allclose(back.t_s, log.t_s - log.t_s[0], atol=1e-9)
    for name, values in back.channels.items():
        np.testing.assert_allclose(values, log.channels[name], rtol=1e-12, atol=1e-13, err_msg=name)
    kept = FlightLog(
        log.metadata, ("flight",), log.offsets, log.t_s, {n: log.channels[n] for n in back.channels}
    )
    methods = ("ls", "iv-f1")
    before, after = (identify(log, gtm, methods).to_frame() for log in (kept, back))
    for name in before.columns[4:].drop("status"):
        np.testing.assert_allclose(after[name], before[name], rtol=1e-9, err_msg=name)


@pytest.mark.slow
def test_a_campaign_in_one_table_divides_by_the_run_column(tmp_path):
    log = flown(tmp_path, runs=3, duration_s=5.0)
    parts = [foreign(log, run) for run in range(3)]
    frame = pd.concat([pd.DataFrame(p).assign(Flight=f"F{i}") for i, p in enumerate(parts)])
    frame.to_csv(tmp_path / "all.csv", index=False, float_format="%.17g")
    text = mapping_by_name().replace('unit = "ms"', 'unit = "ms"\nrun = "Flight"', 1)
    (tmp_path / "map.toml").write_text(text)
    back = import_log(tmp_path / "all.csv", tmp_path / "map.toml").log
    assert back.run_ids == ("F0", "F1", "F2")
    np.testing.assert_array_equal(back.offsets, log.offsets)
    np.testing.assert_allclose(back.channels["alpha_rad"], log.channels["alpha_rad"], rtol=1e-12, atol=1e-13)
