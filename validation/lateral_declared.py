"""Aircraft files of the planes of `validation.lateral_truth`, for traces of its records."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from validation.lateral_truth import GTM, LATERAL, SENSORS, Plane

_SURE = ("CLalpha", "Cmalpha", "Cmde", "CYbeta", "Clbeta", "Cnbeta", "Clp", "Clda", "Cndr")
SHARE = {**dict.fromkeys(_SURE, 0.05), "CYdr": 0.1}
"""Declared standard deviation over the derivative [-]; the others have 30 %."""
PITCH = tuple(c + s for c in ("CL", "Cm") for s in ("alpha", "q", "de"))
LEAST = 0.01
"""Least declared standard deviation [-]."""


def lateral_aircraft(folder: Path, plane: Plane = GTM, wrong: Mapping[str, float] | None = None) -> Path:
    """Folder with the aircraft.toml of a plane, without a JSBSim model.

    Parameters
    ----------
    wrong : derivative -> factor on its true value that is declared.
    """
    ixx, iyy, izz, ixz = plane.inertia
    values = dict(
        zip((*LATERAL, *PITCH), [*plane.lateral.ravel().tolist(), *plane.pitch.ravel().tolist()], strict=True)
    )
    rows = []
    for name, true in values.items():
        declared = true * (wrong or {}).get(name, 1.0)
        std = max(SHARE.get(name, 0.3) * abs(declared), LEAST)
        rows.append(f'{name} = {{ value = {declared!r}, std = {std!r}, source = "test" }}')
    sensors = [
        f'[sensors.{channel}]\nnoise_std = {{ value = {own.noise!r}, unit = "{unit}", source = "test" }}'
        for channel, own in SENSORS.items()
        if (unit := _unit(channel)) and own.noise
    ]
    text = f"""schema = 1
name = "{plane.name}"
description = "a test"
[geometry]
wing_area = {{ value = {plane.area!r}, unit = "m2", source = "test" }}
chord = {{ value = {plane.chord!r}, unit = "m", source = "test" }}
span = {{ value = {plane.span!r}, unit = "m", source = "test" }}
[mass]
mass = {{ value = {plane.mass!r}, unit = "kg", std = {0.01 * plane.mass!r}, source = "test" }}
inertia_xx = {{ value = {ixx!r}, unit = "kg_m2", std = {0.03 * ixx!r}, source = "test" }}
inertia_yy = {{ value = {iyy!r}, unit = "kg_m2", std = {0.03 * iyy!r}, source = "test" }}
inertia_zz = {{ value = {izz!r}, unit = "kg_m2", std = {0.03 * izz!r}, source = "test" }}
inertia_xz = {{ value = {ixz!r}, unit = "kg_m2", std = {0.01 * izz!r}, source = "test" }}
cg = {{ value = 0.25, std = 0.005, source = "test" }}
[derivatives]
{chr(10).join(rows)}
{chr(10).join(sensors)}
"""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "aircraft.toml").write_text(text)
    return folder


def _unit(channel: str) -> str:
    for unit in ("rad_s", "m_s2", "rad"):
        if channel.endswith(f"_{unit}"):
            return unit
    return ""
