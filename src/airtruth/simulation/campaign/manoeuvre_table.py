"""The [[manoeuvre]] table of a campaign file: one control input, or several of one run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Final, Self

from pydantic import Field, field_validator, model_validator

from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.campaign.tables import Constant, Draw, UnitTable, one_of
from airtruth.simulation.manoeuvres import CONTROLS, KINDS, MOST_HARMONICS

MOST_INPUTS: Final = 8
"""Control inputs of a run [-] (judgement: three controls, two or three inputs each)."""


class InputTable(UnitTable):
    """One control input; see `airtruth.simulation.manoeuvres.Manoeuvre`. file, run_id, channel: a log to replay."""

    dimensions: ClassVar[dict[str, str]] = {
        "amplitude": "angle",
        "start": "time",
        "step": "time",
        "length": "time",
        "lowest": "frequency",
        "highest": "frequency",
        "segments": "time",
        "rise": "time",
        "phases": "angle",
    }
    kind: str
    control: str = ELEVATOR
    amplitude: Draw = Constant(value=0.0)
    start: float = Field(default=1.0, ge=0.0)
    step: float = Field(default=0.5, gt=0.0)
    length: float = Field(default=10.0, gt=0.0)
    lowest: float = Field(default=0.2, gt=0.0)
    highest: float = Field(default=3.0, gt=0.0)
    part: int = Field(default=0, ge=0)
    parts: int = Field(default=1, ge=1, le=MOST_HARMONICS)
    segments: tuple[float, ...] = ()
    levels: tuple[float, ...] = ()
    rise: float = Field(default=0.0, ge=0.0)
    harmonics: tuple[int, ...] = ()
    weights: tuple[float, ...] = ()
    phases: tuple[float, ...] = ()
    file: str = ""
    run_id: str = ""
    channel: str = f"{ELEVATOR}_command_rad"
    saturate: bool = False

    _known_kind = field_validator("kind")(one_of(KINDS))
    _known_control = field_validator("control")(one_of(CONTROLS))

    @model_validator(mode="before")
    @classmethod
    def _channel_of_control(cls, raw: Any) -> Any:
        if isinstance(raw, Mapping) and isinstance(raw.get("control"), str):
            return {"channel": f"{raw['control']}_command_rad"} | dict(raw)
        return raw

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (self.kind == "replay") != bool(self.file):
            raise ValueError("kind = 'replay' and file = '...' go together")
        replayed = (f"{self.control}_command_rad", f"{self.control}_rad")
        if self.channel not in replayed:
            raise ValueError(
                f"channel = {self.channel!r} does not move the {self.control}; allowed: {', '.join(replayed)}"
            )
        if self.kind != "replay" and "amplitude" not in self.model_fields_set:
            raise ValueError(
                f"amplitude is missing: without it the {self.control} stays at its trim; write amplitude_deg"
            )
        if self.highest <= self.lowest:
            raise ValueError("highest_hz must be above lowest_hz")
        if self.part >= self.parts:
            raise ValueError(f"part counts from 0 to parts - 1 = {self.parts - 1}")
        return self

    @property
    def on_surface(self) -> bool:
        """Whether it drives the surface itself, past the actuator."""
        return self.kind == "replay" and self.channel == f"{self.control}_rad"


class ManoeuvreTable(InputTable):
    """The inputs of one run: its own, and those in ``also`` [[manoeuvre.also]], each with its own control and start."""

    also: tuple[InputTable, ...] = Field(default=(), max_length=MOST_INPUTS - 1)

    @property
    def inputs(self) -> tuple[InputTable, ...]:
        """All inputs of the run, in their order."""
        return (self, *self.also)

    @model_validator(mode="after")
    def _same_path(self) -> Self:
        if len({table.on_surface for table in self.inputs}) > 1:
            raise ValueError(
                "a replay of a surface goes past all actuators, so it cannot be flown beside a command; replay the commands, or "
                "the surfaces of every input"
            )
        return self


__all__ = ["MOST_INPUTS", "InputTable", "ManoeuvreTable"]
