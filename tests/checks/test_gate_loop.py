"""The gate and a pitch damper: the surface follows the command and the pitch rate."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.checks import evidence, gate
from airtruth.checks.together import Runs
from airtruth.logs.flight_log import batches
from airtruth.logs.store import log_paths, read_log
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign

CAMPAIGN = """
schema = 1
name = "loop"
aircraft = "gtm"
runs = 4
seed = 3
duration_s = 6.0
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
[[manoeuvre]]
kind = "3211"
amplitude_deg = -1.0
start_s = 1.0
step_s = 0.3
[gust]
figures = "gtm"
level = "{level}"
[augmentation]
damper_gain_s = 0.6
"""


@pytest.fixture(scope="module", params=["none", "light"], ids=["calm", "light"])
def log(request, tmp_path_factory):
    """The log of a campaign with a damper; the command is the pilot's."""
    folder = tmp_path_factory.mktemp("loop")
    (folder / "loop.toml").write_text(CAMPAIGN.format(level=request.param))
    campaign.fly(plan.make(folder / "loop.toml"), folder / "flown", 1)
    return read_log(log_paths(folder / "flown")[0])


@pytest.mark.slow
def test_a_damped_log_passes(log):
    """Without the feedback in the relation, the surface leads the command and some runs are refused."""
    assert [fault.sentence for fault in gate.inspect(log, aircraft.load("gtm")) if fault.certain] == []
    for batch in batches(log):
        command = next(t for t in evidence.relations(Runs((batch,))) if t.name == "command")
        assert (command.distance < 4.0).all()


@pytest.mark.slow
def test_a_command_of_the_other_sign_is_refused(log):
    turned = {"elevator_command_rad": -np.asarray(log.channels["elevator_command_rad"])}
    faults = gate.inspect(replace(log, channels={**log.channels, **turned}), aircraft.load("gtm"))
    assert any(fault.certain and fault.channel == "elevator_command_rad" for fault in faults)
