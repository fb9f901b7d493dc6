"""An aircraft of lateral derivatives alone is written with a JSBSim model that has them in six axes."""

import re

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.aircraft.corrected import write_corrected
from airtruth.aircraft.create import write_new
from airtruth.aircraft.jsbsim.short_period import TrimPoint
from airtruth.errors import ConfigurationError
from airtruth.physics.atmosphere import altitude_of_density_m, equivalent_airspeed_m_s
from airtruth.physics.motion import LATERAL
from airtruth.physics.terms import Change, SensorTerm, SurfaceTerm
from airtruth.simulation.linearise import linearise, truth_of
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.units import DEG, G0
from validation.lateral_declared import lateral_aircraft
from validation.lateral_truth import GTM

ALPHA = 4.0 * DEG
AT = TrimPoint(42.85, 0.99, ALPHA, 0.0, -G0 * np.cos(ALPHA))
LATE = Change(
    surface=(SurfaceTerm("delay", 0.08, control="rudder"),),
    sensors=(SensorTerm("beta_rad", "arm", 0.6),),
)


@pytest.fixture(scope="module")
def declared(tmp_path_factory):
    return aircraft.load(lateral_aircraft(tmp_path_factory.mktemp("declared") / "gtm"))


def at_trim(plane):
    eas = float(equivalent_airspeed_m_s(AT.airspeed_m_s, AT.density_kg_m3))
    condition = Condition(eas, float(altitude_of_density_m(AT.density_kg_m3)), straight="wings-level")
    return trim(plane, condition)


def test_linearised_in_six_axes_it_gives_its_derivatives_back(declared, tmp_path):
    alone = {name: declared.file.derivatives[name] for name in LATERAL.parameters}
    new = write_new(declared, alone, AT, tmp_path / "new" / "gtm")
    found = at_trim(new)
    assert sum(abs(found.surfaces_rad[name]) for name in ("aileron", "rudder")) < 1e-6
    true = truth_of(LATERAL, linearise(new, found, motion=LATERAL), found)
    wanted = dict(zip(LATERAL.parameters, GTM.lateral.ravel().tolist(), strict=True))
    assert {k: true[k] for k in wanted} == pytest.approx(wanted, rel=2e-3, abs=2e-4)
    assert set(new.file.derivatives) == set(LATERAL.parameters)
    assert "placeholder" in (new.folder / "aircraft.toml").read_text(encoding="utf-8")


def test_a_late_rudder_and_a_boom_are_in_its_files(declared, tmp_path):
    new = write_corrected(declared, declared.file.derivatives, AT, LATE, tmp_path / "new" / "gtm")
    assert at_trim(new).condition.six_axes
    assert new.file.sensors["beta_rad"].x.value == pytest.approx(0.6)
    text = (new.folder / "gtm.xml").read_text(encoding="utf-8")
    # the forces take the surface behind the delay, the yawing moment of it included
    assert re.search(r"fcs/[a-z0-9-]+/rudder</property>", text.partition('axis name="YAW"')[2])


def test_a_part_of_the_lateral_derivatives_is_refused(declared, tmp_path):
    some = {name: declared.file.derivatives[name] for name in LATERAL.parameters if name != "Cnr"}
    with pytest.raises(ConfigurationError, match="lack CLalpha"):
        write_new(declared, some, AT, tmp_path / "new")
