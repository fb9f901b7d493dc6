"""The exported model: its matrices, names, units, uncertainty, and the files for other programs."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat

import airtruth as at
from airtruth.errors import ConfigurationError, StoreError
from airtruth.exporting.model import SYSTEMS, FlightPoint, LinearModel
from airtruth.identification import identify
from airtruth.identification.record_constants import values_of
from airtruth.identification.store import write_estimates
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.short_period import modal, scale
from airtruth.units import DEG
from validation.linear_flight import GTM, as_log, fly

THETA = np.array([4.8, 31.7, 0.48, -1.785, -41.2, -1.787])
STD = np.array([0.24, 9.5, 0.048, 0.089, 6.2, 0.089])
POINT = FlightPoint(43.0, 1.0, values_of(GTM))
LOG = as_log(fly(runs=3, gust=1.0, noise=1.0, seed=71))
MODEL = LinearModel(LONGITUDINAL, POINT, THETA, np.diag(STD**2), "a test")


def test_entries_are_those_of_the_equations():
    """M. Brunot, eqs (2) and (3), written out: alpha' = q - q_bar S/(m V) CL, q' = q_bar S c/Iyy Cm, az = -q_bar S/m CL."""
    force = 0.5 * 1.0 * 43.0**2 * GTM.wing_area_m2
    lift, moment, normal = (
        force / (GTM.mass_kg * 43.0),
        force * GTM.chord_m / GTM.inertia_yy_kg_m2,
        force / GTM.mass_kg,
    )
    h = GTM.chord_m / 86.0
    m = MODEL.matrices
    a = [[-lift * 4.8, 1.0 - lift * h * 31.7], [moment * -1.785, moment * h * -41.2]]
    np.testing.assert_allclose(m["A"], a, rtol=1e-12)
    np.testing.assert_allclose(m["B"], [[-lift * 0.48], [moment * -1.787]], rtol=1e-12)
    np.testing.assert_allclose(m["C"], [[1, 0], [0, 1], [-normal * 4.8, -normal * h * 31.7]], rtol=1e-12)
    np.testing.assert_allclose(m["D"], [[0], [0], [-normal * 0.48]], rtol=1e-12)
    wn, zeta = modal(THETA, scale(*GTM.__dict__.values(), 43.0, 1.0))
    poles = np.linalg.eigvals(m["A"])
    np.testing.assert_allclose(np.abs(poles), wn, rtol=1e-12)
    np.testing.assert_allclose(-poles.real / wn, zeta, rtol=1e-12)


def test_the_covariance_is_that_of_drawn_derivatives():
    """Ten thousand draws; a variance of n draws scatters by sqrt(2/n), 1.4 %."""
    draws = np.random.default_rng(1).normal(THETA, STD, (10_000, 6))
    entries = np.array(
        [np.concatenate([m.ravel() for m in SYSTEMS["longitudinal"](d, POINT)]) for d in draws]
    )
    drawn = np.cov(entries, rowvar=False)
    sigma = np.sqrt(np.diag(MODEL.covariance))
    moves = sigma > 0.0
    assert [name for name, own in zip(MODEL.entries, moves, strict=True) if own] == [
        *("A(1,1)", "A(1,2)", "A(2,1)", "A(2,2)", "B(1,1)", "B(2,1)", "C(3,1)", "C(3,2)", "D(3,1)")
    ]
    scaled = (drawn - MODEL.covariance)[np.ix_(moves, moves)] / np.outer(sigma[moves], sigma[moves])
    assert np.abs(scaled).max() < 0.06
    frame = MODEL.to_frame().set_index("entry")
    np.testing.assert_allclose(frame.loc["A(1,1)", "std"], sigma[0])


@pytest.fixture(scope="module")
def estimates(tmp_path_factory):
    path = tmp_path_factory.mktemp("export") / "estimates.parquet"
    write_estimates(path, identify(LOG, GTM, ["ls", "iv-f1"]))
    return path


def test_a_run_of_a_file_gives_its_own_matrices(estimates):
    model = at.export(estimates, method="iv-f1", run_id=LOG.run_ids[0])
    own = identify(LOG, GTM, ["iv-f1"]).of("iv-f1")
    np.testing.assert_array_equal(model.derivatives, own.theta[0])
    np.testing.assert_allclose(model.derivative_covariance, own.covariance[0], rtol=1e-10)
    s = own.scale
    assert model.matrices["A"][0, 0] == pytest.approx(-s.lift[0] * own.theta[0, 0], rel=1e-12)
    assert model.matrices["B"][1, 0] == pytest.approx(s.moment[0] * own.theta[0, 5], rel=1e-12)


def test_the_mean_of_runs_is_at_least_as_uncertain_as_their_scatter(estimates):
    model = at.export(estimates.parent, method="ls")
    theta = identify(LOG, GTM, ["ls"]).of("ls").theta
    np.testing.assert_allclose(model.derivatives, theta.mean(axis=0), rtol=1e-12)
    std = np.sqrt(np.diag(model.derivative_covariance))
    assert (std >= theta.std(axis=0, ddof=1) / np.sqrt(len(theta)) * (1.0 - 1e-12)).all()


def test_matlab_reads_names_units_and_uncertainty(estimates):
    path = estimates.parent / "m.mat"
    model = at.export(estimates, path, method="ls")
    content = loadmat(path, squeeze_me=True, struct_as_record=False)
    for name, matrix in model.matrices.items():
        np.testing.assert_array_equal(content[name].reshape(matrix.shape), matrix)
    assert content["state_names"].tolist() == ["alpha_rad", "q_rad_s"]
    assert content["state_units"].tolist() == ["rad", "rad/s"]
    assert content["output_units"].tolist() == ["rad", "rad/s", "m/s2"]
    assert content["input_names"] == "elevator_rad"
    assert content["operating_point"].airspeed_m_s == model.point.airspeed_m_s
    assert content["entries"].names.tolist() == list(model.entries)
    np.testing.assert_array_equal(content["entries"].covariance, model.covariance)


def test_json_holds_what_is_not_known_as_null(tmp_path):
    from airtruth.exporting.write import write

    write(replace(MODEL, derivative_covariance=np.full((6, 6), np.nan)), tmp_path / "m.json")
    content = json.loads((tmp_path / "m.json").read_text())
    assert content["A"] == MODEL.matrices["A"].tolist()
    assert content["entries"]["covariance"][0][0] is None
    assert content["outputs"][2] == {
        "name": "az_m_s2",
        "unit": "m/s2",
        "description": "specific force along body z (down); level flight about -9.8",
    }
    assert content["operating_point"]["dynamic_pressure_pa"] == pytest.approx(0.5 * 43.0**2)


def test_the_script_gives_the_object_of_python_control(tmp_path, monkeypatch):
    """A stand-in for python-control that prints its arguments."""
    from airtruth.exporting.write import write

    (tmp_path / "control.py").write_text(
        "def ss(a, b, c, d, **names):\n    print(a.tolist(), d.shape, names['outputs'])\n    return a, names\n"
    )
    write(MODEL, tmp_path / "m.py")
    ran = subprocess.run([sys.executable, "m.py"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert ran.stdout == f"{MODEL.matrices['A'].tolist()} (3, 1) ['alpha_rad', 'q_rad_s', 'az_m_s2']\n"
    monkeypatch.syspath_prepend(str(tmp_path))
    a, names = MODEL.to_control()
    np.testing.assert_array_equal(a, MODEL.matrices["A"])
    assert names["states"] == ["alpha_rad", "q_rad_s"]


def test_without_python_control_the_error_names_the_cure(monkeypatch):
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(ConfigurationError, match="pip install control"):
        MODEL.to_control()


def test_an_aircraft_is_linear_at_its_trim():
    """The derivatives of gtm/aircraft.toml, which are central differences about 75 kt at 7000 ft."""
    gtm = at.load_aircraft("gtm")
    model = at.export("gtm", airspeed_m_s=42.85, altitude_m=2133.6)
    stated = [gtm.file.derivatives[name].value for name in model.motion.parameters]
    np.testing.assert_allclose(model.derivatives, stated, rtol=0.01)
    assert model.point.trim["alpha_rad"] == pytest.approx(5.6 * DEG, abs=0.5 * DEG)
    assert (np.diag(model.derivative_covariance) > 0.0).all()


def test_one_error_states_the_cure(estimates, tmp_path):
    for source, options, words in (
        (estimates, {}, "choose one by --method: ls, iv-f1"),
        (estimates, {"method": "iv-f2"}, "did you mean 'iv-f1'"),
        (estimates, {"method": "ls", "run_id": "x"}, "run 'x'"),
        (estimates, {"method": "ls", "altitude_m": 0.0}, "state their flight condition"),
        ("gtm", {}, "--airspeed-m-s and --altitude-m"),
        ("gtm", {"method": "ls"}, "is an aircraft"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            at.export(source, **options)
    with pytest.raises(ConfigurationError, match=r"\.mat, \.json, \.py"):
        at.export(estimates, tmp_path / "m.xls", method="ls")
    (tmp_path / "m.json").write_text("mine")
    with pytest.raises(StoreError, match="--force"):
        at.export(estimates, tmp_path / "m.json", method="ls")
    assert (tmp_path / "m.json").read_text() == "mine"


def command(*arguments):
    ran = subprocess.run(
        [sys.executable, "-m", "airtruth", *map(str, arguments)], capture_output=True, text=True, check=False
    )
    return ran.returncode, ran.stdout, ran.stderr


def test_the_command_prints_the_model_and_the_file(estimates):
    out = estimates.parent / "c.json"
    code, text, errors = command("export", estimates, "--method", "ls", "--out", out, "--quiet")
    assert (code, errors) == (0, "")
    assert "states alpha_rad, q_rad_s; inputs elevator_rad" in text
    assert text.endswith(f"{out}\n")
    assert command("export", "nothing", "--out", out)[0] == 2
