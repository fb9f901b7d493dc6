"""A blind trial fitted with its true effect: the size is that of the truth, and nothing is left."""

import json

import pytest

from validation.blind import draw
from validation.blind.trials import frozen
from validation.known_effects import known

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder of the blind room with one trial, a late accelerometer behind a damper in calm air, and its name."""
    out = tmp_path_factory.mktemp("blind")
    (log,) = frozen(20261233, [2], "loop", out)
    (out / "truth").mkdir()
    truth = {"trial": draw.plain(draw.draw(20261233, 2, "loop"))}
    (out / "truth" / f"{log.name}.json").write_text(json.dumps(truth, default=lambda x: x.tolist()))
    return out, log.name


def test_the_true_size_is_within_its_error_and_no_anomaly_is_left(folder):
    """Normal and uniform by definition; the bounds leave one in 1000 and one in 100."""
    out, name = folder
    found = known(out, name)
    assert found.effects == ("accelerometer_lag",)
    assert found.p_value > 0.01
    assert list(found.z) == ["accelerometer_lag.tau_s"]
    assert abs(found.z["accelerometer_lag.tau_s"]) < 3.3


def test_an_effect_that_the_library_does_not_hold_is_left_out(folder):
    out, name = folder
    path = out / "truth" / f"{name}.json"
    truth = json.loads(path.read_text())
    truth["trial"]["effects"] = [{"key": "fuel_slosh", "values": {"gain": 1.0}}]
    (out / "truth" / "other.json").write_text(json.dumps(truth))
    assert known(out, "other") is None
