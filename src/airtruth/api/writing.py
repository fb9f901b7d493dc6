"""The rule for outputs (`airtruth.logs.outputs`) with the inputs and outputs of each command that writes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from airtruth.aircraft import Aircraft
    from airtruth.api.arguments import AircraftSource
    from airtruth.logs.sources import Logs


def aircraft_files(aircraft: Aircraft) -> list[Path]:
    """Return the files of an aircraft's folder that may describe it."""
    return [path for suffix in ("toml", "xml") for path in aircraft.folder.rglob(f"*.{suffix}")]


@contextmanager
def trace_outputs(
    command: str, logs: Logs, aircraft: AircraftSource, out: Path | None, *, force: bool
) -> Iterator[Aircraft]:
    """Apply the rule for outputs to a trace or a loop, and yield its aircraft.

    Parameters
    ----------
    command : "trace" or "loop".
    logs, aircraft : inputs.
    out : folder of the outputs; None if nothing is written.
    force : see `airtruth.logs.outputs.Outputs`.

    Raises
    ------
    StoreError
        If the command would write a file that it may not write.
    AirtruthError
        If an input cannot be read.
    """
    from airtruth.api.campaigns import load_aircraft
    from airtruth.errors import StoreError
    from airtruth.logs.outputs import writing
    from airtruth.logs.remote import RemotePath, location
    from airtruth.logs.sources import log_files

    if out is not None and isinstance(location(out), RemotePath):
        raise StoreError(
            f"{location(out)}: {command} writes the folder of an aircraft, which a store cannot replace as a whole; choose a "
            "local --out and copy it"
        )
    declared = load_aircraft(aircraft)
    if out is None:
        yield declared
        return
    from airtruth.physics.motion import FOLDERS
    from airtruth.reporting import TRACE_PAGE
    from airtruth.tracing.answer import ANSWER
    from airtruth.tracing.presentation.files import EVIDENCE

    with writing(command, [*log_files(logs), *aircraft_files(declared)], force=force) as outputs:
        for name in FOLDERS:
            own = out / name if name else out
            folder = own / "trace" if command == "loop" else own
            outputs.require(*(folder / file for file in (ANSWER, TRACE_PAGE, *EVIDENCE)))
            if command == "loop":
                from airtruth.loop import OUTPUTS

                outputs.require(*(own / file for file in OUTPUTS))
            outputs.require_folder(folder / "aircraft" / declared.name)
        yield declared
