"""The lateral-directional motion in reports and tables."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
from report_html import parsed

import airtruth as at
from airtruth.errors import ConfigurationError
from airtruth.identification import identify, write_estimates
from airtruth.physics.motion import LATERAL
from airtruth.reporting import report
from validation.affine_lateral import GTM, NAMES, fly, log_of, pitching

LOG = log_of(fly(q=pitching, runs=3, gust=0.4, seed=2))


@pytest.fixture(scope="module")
def result():
    return identify(LOG, GTM, ["ls", "iv-lowpass"], motion=LATERAL)


@pytest.fixture(scope="module")
def folder(result, tmp_path_factory):
    made = tmp_path_factory.mktemp("lateral")
    write_estimates(made / "estimates-lateral.parquet", result)
    return made


def test_the_page_of_a_folder_shows_the_lateral_estimates(result, folder, tmp_path):
    of_folder = report(folder, tmp_path / "a.html")
    of_file = report(folder / "estimates-lateral.parquet", tmp_path / "b.html")
    in_memory = at.report(replace(result, logs=None), tmp_path / "c.html")
    text = of_folder[0].read_text()
    assert parsed(text)
    for paths in (of_file, in_memory):
        assert [p.read_bytes() for p in paths[1:]] == [p.read_bytes() for p in of_folder[1:]]
    assert of_file[0].read_text() == text
    for words in (
        "iv-lowpass estimates wn of the Dutch roll = ",
        "Clbeta [1/rad]",
        "Correlation by the covariance",
        "rates as p b/(2V)",
        "Ixz [kg m2]",
    ):
        assert words in text
    assert "elevator trailing edge" not in text
    rows = {row["parameter"]: row for row in csv.DictReader(io.StringIO(of_folder[1].read_text()))}
    theta = result.of("ls").theta
    shown = [float(rows[name]["ls"]) for name in NAMES]
    np.testing.assert_allclose(shown, theta.mean(axis=0), rtol=1e-13)
    error = theta.std(axis=0, ddof=1) / np.sqrt(3)
    np.testing.assert_allclose([float(rows[n]["ls (standard error)"]) for n in NAMES], error, rtol=1e-12)
    latex = of_folder[2].read_text()
    assert r"$C_{n\delta_r}$" in latex
    assert r"$\omega_n$, Dutch roll" in latex


def test_the_page_simulates_the_records_of_its_logs(result, folder, tmp_path):
    text = report(folder, tmp_path / "a.html", logs=LOG)[0].read_text()
    assert "Agreement of the simulations over 3 records" in text
    assert "from the measured controls, airspeed and pitching motion" in text
    histories = result.histories()
    assert histories.models == ("ls", "iv-lowpass")
    assert all(r.rms("ls", "p_rad_s") < 0.5 * r.measured["p_rad_s"].std() for r in histories.records)


def test_the_declared_aircraft_is_refused(folder, tmp_path):
    with pytest.raises(ConfigurationError, match="page of estimates of the lateral motion"):
        report(folder, tmp_path / "a.html", aircraft=at.load_aircraft("gtm"))
    assert not (tmp_path / "a.html").exists()
