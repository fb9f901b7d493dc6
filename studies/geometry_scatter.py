"""Derivatives by handbook formulas beside those of JSBSim's own models: the scatter that a proposal states.

    python -m studies.geometry_scatter [NAME...]

Wing and tail of a model are those of its <metrics>; its reference point of the forces counts as the quarter chord. What
the metrics do not state is assumed: a tail with an aspect ratio of 4.5, and an elevator of 0.38 of its chord. The reference
are the central differences of JSBSim's accelerations at the condition of the model's first campaign. A model without CLq is
a generic one whose other terms are defaults: it is printed and does not count.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import jsbsim
import numpy as np
from numpy.typing import NDArray

from airtruth.errors import AircraftError, AirtruthError
from airtruth.physics import handbook
from airtruth.physics.handbook import Planform
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.short_period import CL_Q
from airtruth.simulation.campaign import file as campaign_file
from airtruth.simulation.foreign_aircraft import CAMPAIGN, new_from_jsbsim
from airtruth.simulation.resolution import trimmed_and_linear
from airtruth.simulation.simulator import Condition
from airtruth.units import FT

Array = NDArray[np.float64]

NAMES: Final = (
    *("c172p", "c182", "c310", "pa28", "J3Cub", "pc7", "t6texan2", "p51d", "OV10", "DHC6", "L410", "T37"),
    *("C130", "737", "A320", "B747", "MD11", "sgs233"),
)
"""Models of JSBSim's package with a tail behind a wing of little sweep or a transport's, whose metrics state the tail."""
TAIL_ASPECT: Final = 4.5
ELEVATOR: Final = 0.38
_SHARE: Final = 0.68
_NO_TERM: Final = 1e-3


def planform_of(name: str) -> Planform:
    """The planform of a model of JSBSim's package."""
    fdm = jsbsim.FGFDMExec(None)
    fdm.set_debug_level(0)
    fdm.load_model(name)
    fdm.run_ic()
    feet = {key: float(fdm[f"metrics/{key}-ft"]) * FT for key in ("bw", "cbarw", "lh")}
    areas = {key: float(fdm[f"metrics/{key}-sqft"]) * FT**2 for key in ("Sw", "Sh")}
    aft = (fdm["inertia/cg-x-in"] - fdm["metrics/aero-rp-x-in"]) / 12.0 * FT / feet["cbarw"]
    return Planform(
        span_m=feet["bw"],
        wing_area_m2=areas["Sw"],
        chord_m=feet["cbarw"],
        tail_span_m=float(np.sqrt(TAIL_ASPECT * areas["Sh"])),
        tail_area_m2=areas["Sh"],
        tail_arm_m=feet["lh"],
        elevator_share=ELEVATOR,
        cg=0.25 + float(aft),
    )


def reference(name: str, folder: Path) -> Array:
    """(6,) derivatives of the model at the condition of its first campaign.

    Raises
    ------
    AirtruthError
        If the model cannot be flown.
    """
    made = new_from_jsbsim(name, folder / name)
    if not (folder / name / CAMPAIGN).is_file():
        raise AircraftError(f"{name}: cannot be flown")
    at = campaign_file.read(folder / name / CAMPAIGN).condition
    condition = Condition(at.eas.value, at.altitude.value, 0.0)
    return np.asarray(trimmed_and_linear(made.aircraft, condition)[1].central)


def main(argv: Sequence[str] | None = None) -> None:
    """Print each model and the statistics of all."""
    names = list(sys.argv[1:] if argv is None else argv) or NAMES
    errors = []
    sys.stdout.write("flown/proposed " + " ".join(LONGITUDINAL.parameters) + "\n")
    for name in names:
        try:
            with tempfile.TemporaryDirectory() as folder:
                flown = reference(name, Path(folder))
        except AirtruthError as error:  # the study goes on without a model that cannot be flown
            sys.stdout.write(f"{name}: {str(error).splitlines()[0][:100]}\n")
            continue
        proposed = handbook.derivatives(planform_of(name))
        value = np.array([proposed[key] for key in LONGITUDINAL.parameters])
        margin = value[3] / value[0] - flown[3] / flown[0]  # flown less proposed [chords]
        is_complete = abs(flown[CL_Q]) > _NO_TERM
        if is_complete:
            errors.append([*np.abs(flown / value - 1.0), abs(margin)])
        pairs = " ".join(f"{f:.3g}/{v:.3g}" for f, v in zip(flown, value, strict=True))
        sys.stdout.write(
            f"{name:10s} {pairs} margin {margin:+.3f}{'' if is_complete else ' (not counted)'}\n"
        )
        sys.stdout.flush()
    if errors:
        scatter = " ".join(f"{x:.2f}" for x in np.quantile(errors, _SHARE, axis=0))
        sys.stdout.write(
            f"relative errors that 68 % of {len(errors)} models do not exceed, and margin: {scatter}\n"
        )


if __name__ == "__main__":
    main()
