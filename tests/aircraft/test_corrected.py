"""An aircraft without a JSBSim model, written with a change, flies it from the trim of the records."""

import numpy as np
import pytest

from airtruth.aircraft.corrected import reference_point, write_corrected
from airtruth.aircraft.file import Dynamics
from airtruth.aircraft.jsbsim.short_period import TrimPoint
from airtruth.physics.atmosphere import altitude_of_density_m, equivalent_airspeed_m_s
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import AeroTerm, Change, DeclaredTerm, SensorTerm, StateTerm, SurfaceTerm
from airtruth.simulation.linearise import linearise
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.units import DEG, FT, G0, KT
from tests.simulation.fly_campaigns import channel, fly
from validation import small_aircraft as small

ALPHA, ELEVATOR = 3.0 * DEG, -2.0 * DEG
AT = TrimPoint(small.AIRSPEED_M_S, small.DENSITY_KG_M3, ALPHA, ELEVATOR, -G0 * np.cos(ALPHA))
LAG = (StateTerm("wake", "lag", "alpha", time_s=0.1),)
CHANGES = {
    "none": Change(),
    "delay and sensors": Change(
        surface=(SurfaceTerm("delay", 0.06), SurfaceTerm("lag", 0.02)),
        sensors=(SensorTerm("alpha_rad", "arm", 0.3), SensorTerm("q_rad_s", "scale", 0.9)),
    ),
    "declared quantities": Change(
        declared=(
            DeclaredTerm("elevator", 0.8),
            DeclaredTerm("mass", 1.05),
            DeclaredTerm("inertia", 1.1),
            DeclaredTerm("cg", 0.02),
        )
    ),
    "an increment": Change(
        states=LAG,
        aero=(
            AeroTerm("Cm", "alpha", "above", 0.4, at=0.02),
            AeroTerm("CL", "alpha", "below", 0.4, at=0.1),
            AeroTerm("Cm", "wake", "linear", -0.3),
            AeroTerm("Cm", "elevator", "quadratic", 0.5),
        ),
    ),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_it_trims_where_the_records_do(tmp_path, change):
    plane = small.declared(tmp_path)
    new = write_corrected(plane, plane.file.derivatives, AT, change, tmp_path / "new" / "small")
    eas = float(equivalent_airspeed_m_s(AT.airspeed_m_s, AT.density_kg_m3))
    found = trim(new, Condition(eas, float(altitude_of_density_m(AT.density_kg_m3)), 0.0))
    # thrust along body x takes a tenth of the weight times sin(alpha) of the lift, and gravity falls with height
    assert found.alpha_rad == pytest.approx(ALPHA, abs=0.1 * DEG)
    assert found.elevator_rad == pytest.approx(ELEVATOR, abs=0.1 * DEG)


def test_every_term_is_in_the_files(tmp_path):
    plane = small.declared(tmp_path)
    change = CHANGES["delay and sensors"]
    new = write_corrected(plane, plane.file.derivatives, AT, change, tmp_path / "new" / "small")
    assert new.file.dynamics == Dynamics(surface=change.surface)
    assert new.file.sensors["alpha_rad"].x.value == 0.3
    assert new.file.sensors["q_rad_s"].scale.value == 0.9
    assert new.file.derivatives == plane.file.derivatives
    heavy = write_corrected(
        plane, plane.file.derivatives, AT, CHANGES["declared quantities"], tmp_path / "heavy" / "small"
    )
    assert heavy.mass_kg == pytest.approx(1.05 * small.MASS_KG, rel=1e-12)
    assert heavy.inertia_yy_kg_m2 == pytest.approx(1.1 * small.INERTIA_KG_M2, rel=1e-12)
    assert heavy.file.mass.cg.value == pytest.approx(0.27, abs=1e-12)


def test_declared_dynamics_count_once(tmp_path):
    """A lag of the lift over alpha leaves the steady derivatives as they are declared."""
    plane = small.declared(tmp_path)
    dynamics = Dynamics(states=LAG, aero=(AeroTerm("Cm", "wake", "linear", -0.3),))
    late = plane.model_copy(update={"file": plane.file.model_copy(update={"dynamics": dynamics})})
    new = write_corrected(late, plane.file.derivatives, AT, Change(), tmp_path / "new" / "small")
    assert new.file.dynamics == dynamics
    eas = float(equivalent_airspeed_m_s(AT.airspeed_m_s, AT.density_kg_m3))
    found = trim(new, Condition(eas, float(altitude_of_density_m(AT.density_kg_m3)), 0.0))
    declared = [plane.file.derivatives[name].value for name in LONGITUDINAL.parameters]
    np.testing.assert_allclose(linearise(new, found).central, declared, rtol=1e-3, atol=1e-3)


def test_the_reference_of_an_elevator_that_is_less_effective(tmp_path):
    """Cm = Cmde (k de_t - de_r) = 0."""
    plane = small.declared(tmp_path)
    values = {name: plane.file.derivatives[name].value for name in LONGITUDINAL.parameters}
    at = reference_point(plane, values, AT, Change(declared=(DeclaredTerm("elevator", 0.8),)))
    assert at.elevator_rad == pytest.approx(0.8 * ELEVATOR, rel=1e-12)
    assert at.az_m_s2 == pytest.approx(AT.az_m_s2, rel=1e-12)


def test_a_campaign_flies_it(tmp_path):
    """Trim, gust and log of a campaign; the surface repeats the command 60 ms later, at 50 Hz three samples."""
    plane = small.declared(tmp_path)
    delay = Change(surface=(SurfaceTerm("delay", 0.06),))
    bare = plane.model_copy(update={"file": plane.file.model_copy(update={"elevator_actuator": None})})
    new = write_corrected(bare, plane.file.derivatives, AT, delay, tmp_path / "new" / "small")
    eas = float(equivalent_airspeed_m_s(AT.airspeed_m_s, AT.density_kg_m3)) / KT
    altitude = float(altitude_of_density_m(AT.density_kg_m3)) / FT
    flown = fly(
        tmp_path / "flown",
        aircraft=new.folder,
        runs=1,
        condition={"eas_kt": eas, "altitude_ft": altitude},
        gust={"level": "light", "figures": "mil-f-8785c"},
        sensors={"ideal": True},
    )
    command, surface = channel(flown, "elevator_command_rad"), channel(flown, "elevator_rad")
    assert np.ptp(command) == pytest.approx(4.0 * DEG, rel=0.01)  # a doublet of 2 deg
    np.testing.assert_allclose(surface[3:], command[:-3], rtol=0.0, atol=1e-9)
