"""Public function that hands an identified motion to other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from airtruth.api.arguments import FilePath
    from airtruth.exporting import LinearModel


def export(
    source: FilePath,
    out: FilePath | None = None,
    *,
    method: str | None = None,
    run_id: str | None = None,
    airspeed_m_s: float | None = None,
    altitude_m: float | None = None,
    force: bool = False,
) -> LinearModel:
    """Return the identified motion as a state-space model, and write it for MATLAB or python-control.

    Parameters
    ----------
    source : file of estimates or a folder that holds one; or an aircraft: folder, aircraft.toml or shipped name.
    out : file whose suffix states the format, .mat, .json or .py (python-control); None to write nothing.
    method : method of the estimates; None if they hold one.
    run_id : run of the estimates; None for the mean over the converged runs.
    airspeed_m_s, altitude_m : true airspeed [m/s] and altitude [m] of an aircraft; estimates state their own.
    force : replace a file that no export wrote or that changed since.

    Returns
    -------
    LinearModel
        Its ``matrices`` are A, B, C, D; ``covariance`` is that of their entries; ``to_control()`` gives an object of
        python-control.

    Raises
    ------
    ConfigurationError
        If the choice is ambiguous or does not exist, or an option does not fit the source.
    StoreError, LogError, AircraftError, TrimError
        If a file cannot be read or written, or the aircraft cannot fly there.

    Examples
    --------
    >>> model = at.export("gtm", airspeed_m_s=43.0, altitude_m=2133.6)
    >>> model.states, model.inputs, model.matrices["A"].shape
    (('alpha_rad', 'q_rad_s'), ('elevator_rad',), (2, 2))
    """
    from airtruth.arguments import as_path
    from airtruth.exporting.sources import estimates_file, linear_model
    from airtruth.exporting.write import require_suffix, write
    from airtruth.logs.outputs import writing

    given = as_path("source", source)
    choice = (method, run_id, airspeed_m_s, altitude_m)
    if out is None:
        return linear_model(given, *choice)
    path = as_path("out", out)
    require_suffix(path)
    file: Path | None = estimates_file(given)
    with writing("export", [] if file is None else [file], force=force) as outputs:
        outputs.require(path)
        model = linear_model(given, *choice)
        path.parent.mkdir(parents=True, exist_ok=True)
        write(model, path)
    return model
