"""The campaign file: a flight test as TOML, validated with every problem at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BeforeValidator,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from airtruth import quantity as qt
from airtruth.aircraft import Sensor, sensor_tables
from airtruth.documents import read_toml
from airtruth.errors import ConfigurationError, choices
from airtruth.physics.gust_figures import FIGURES, LEVELS
from airtruth.quantity import Strict
from airtruth.simulation.campaign.effect_table import EffectTable
from airtruth.simulation.manoeuvres import KINDS, MOST_HARMONICS

Array = NDArray[np.float64]

NO_GUST: Final = "none"
"""Gust level of calm air."""


MOST_STEPS: Final = 4e6
"""Simulation steps of a run [-] (judgement: an hour at 1 kHz; planning it takes 3 s)."""


class Constant(Strict):
    """One value for every run."""

    value: float

    def draw(self, rng: np.random.Generator, runs: int) -> Array:
        """(runs,) values."""
        return np.full(runs, self.value)


class Normal(Strict):
    """Normal distribution."""

    mean: float
    std: float = Field(ge=0.0)

    def draw(self, rng: np.random.Generator, runs: int) -> Array:
        """(runs,) values."""
        return self.mean + self.std * rng.standard_normal(runs)


class Uniform(Strict):
    """Uniform distribution."""

    low: float
    high: float

    @model_validator(mode="after")
    def _ordered(self) -> Uniform:
        if self.low > self.high:
            raise ValueError(f"low = {self.low:g} is above high = {self.high:g}")
        return self

    def draw(self, rng: np.random.Generator, runs: int) -> Array:
        """(runs,) values."""
        return self.low + (self.high - self.low) * rng.random(runs)


class Choice(Strict):
    """One of a list, each equally likely."""

    choose: tuple[float, ...] = Field(min_length=1)

    def draw(self, rng: np.random.Generator, runs: int) -> Array:
        """(runs,) values."""
        picked = np.floor(rng.random(runs) * len(self.choose)).astype(np.int64)
        values: Array = np.array(self.choose, dtype=np.float64).take(picked)
        return values


Distribution = Constant | Normal | Uniform | Choice
"""A distribution from which each run draws a value."""

_DISTRIBUTIONS: Final[tuple[tuple[frozenset[str], type[Distribution]], ...]] = (
    (frozenset({"value"}), Constant),
    (frozenset({"mean", "std"}), Normal),
    (frozenset({"low", "high"}), Uniform),
    (frozenset({"choose"}), Choice),
)
"""Keys that a file states of a distribution, and its model."""


def distribution(raw: Any) -> Any:
    """Read a number or a table as a distribution.

    Raises
    ------
    ValueError
        If it is neither.
    """
    if isinstance(raw, bool):
        raise ValueError("write a number or a distribution, not true or false")
    if isinstance(raw, int | float):
        return Constant(value=raw)
    if isinstance(raw, Mapping):
        for keys, model in _DISTRIBUTIONS:
            if set(raw) == keys:
                return model.model_validate(raw)
    if isinstance(raw, Strict):
        return raw
    raise ValueError("write a number, { mean, std }, { low, high } or { choose = [...] }")


Draw = Annotated[Distribution, BeforeValidator(distribution)]
"""A field that a file states as a number or a distribution."""


def _one_of(names: Iterable[str]) -> Callable[[str], str]:
    def check(value: str) -> str:
        if value not in names:
            raise ValueError(f"{value!r} is not known; {choices(value, names)}")
        return value

    return check


class Table(Strict):
    """A table whose keys may end in a unit of their dimension in ``dimensions``."""

    dimensions: ClassVar[dict[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _to_si(cls, raw: Any) -> Any:
        return qt.keys_to_si(raw, cls.dimensions) if isinstance(raw, Mapping) else raw


class ConditionTable(Table):
    """Where runs start: level or steady climb, EAS [m/s], geometric altitude [m], flight path [rad]."""

    dimensions: ClassVar[dict[str, str]] = {"eas": "speed", "altitude": "length", "flight_path": "angle"}
    eas: Draw
    altitude: Draw
    flight_path: Draw = Constant(value=0.0)


class GustTable(Table):
    """Dryden gusts; ``factor`` multiplies the level's standard deviations."""

    figures: str = "gtm"
    level: str = NO_GUST
    factor: Draw = Constant(value=1.0)
    start: Literal["rest", "stationary"] = "stationary"
    rotary: bool = False

    _known_figures = field_validator("figures")(_one_of(FIGURES))
    _known_level = field_validator("level")(_one_of((NO_GUST, *LEVELS)))


class WindTable(Table):
    """Constant wind along the track, tailwind positive [m/s].

    keeps = "true_airspeed": the trim has the stated EAS whatever the wind, so on a flat, non-rotating
    planet the wind changes the ground speed alone (Galileo). keeps = "ground_speed": the stated EAS is
    that of calm air, the ground speed stays, and the airspeed of the trim is less by the wind.
    """

    dimensions: ClassVar[dict[str, str]] = {"along_track": "speed"}
    along_track: Draw = Constant(value=0.0)
    keeps: Literal["true_airspeed", "ground_speed"] = "true_airspeed"


class ManoeuvreTable(Table):
    """One manoeuvre; see `airtruth.simulation.manoeuvres.Manoeuvre`. file, run_id, channel: a log to replay."""

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
    channel: Literal["elevator_command_rad", "elevator_rad"] = "elevator_command_rad"
    saturate: bool = False

    _known_kind = field_validator("kind")(_one_of(KINDS))

    @model_validator(mode="after")
    def _complete(self) -> ManoeuvreTable:
        if (self.kind == "replay") != bool(self.file):
            raise ValueError("kind = 'replay' and file = '...' go together")
        if self.kind != "replay" and "amplitude" not in self.model_fields_set:
            raise ValueError(
                "amplitude is missing: without it the elevator stays at its trim; write amplitude_deg"
            )
        if self.highest <= self.lowest:
            raise ValueError("highest_hz must be above lowest_hz")
        if self.part >= self.parts:
            raise ValueError(f"part counts from 0 to parts - 1 = {self.parts - 1}")
        return self


class SensorTable(Table):
    """Sensors of the aircraft, or none (ideal), or with stated entries instead of the aircraft's."""

    ideal: bool = False
    channel: dict[str, dict[str, Any]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _valid(self) -> SensorTable:
        for name, raw in self.channel.items():
            try:
                Sensor.model_validate(sensor_tables(name, raw))
            except ValidationError as error:
                raise ValueError(f"channel.{name}: {'; '.join(qt.explain(error, Sensor))}") from None
        return self

    def apply(self, sensors: Mapping[str, Sensor]) -> dict[str, Sensor]:
        """Return the sensors to fly with: those of the aircraft with the stated entries replaced."""
        if self.ideal:
            return {}
        result = dict(sensors)
        for name, raw in self.channel.items():
            own = result.get(name, Sensor())
            result[name] = own.model_copy(update=dict(sensor_tables(name, raw)))
        return result


class AugmentationTable(Table):
    """Gains of the aircraft's pitch damper [s] and attitude hold [-]."""

    damper_gain_s: float = 0.0
    attitude_gain: float = 0.0


class Campaign(Table):
    """A campaign file, in SI."""

    dimensions: ClassVar[dict[str, str]] = {"duration": "time"}
    schema_: Literal[1] = Field(default=1, alias="schema")
    name: str = Field(pattern=r"^[A-Za-z0-9_.-]+$")
    title: str = ""
    aircraft: str
    runs: int = Field(ge=1, le=1_000_000)  # a plan of a million runs takes 3 s
    seed: int = Field(default=0, ge=0, lt=2**63)
    duration: float = Field(gt=0.0, le=3600.0)
    simulation_hz: float = Field(default=200.0, ge=50.0, le=10_000.0)
    log_hz: float = Field(default=50.0, gt=0.0)
    condition: ConditionTable
    manoeuvre: tuple[ManoeuvreTable, ...]
    gust: GustTable = GustTable()
    wind: WindTable = WindTable()
    sensors: SensorTable = SensorTable()
    augmentation: AugmentationTable = AugmentationTable()
    effect: tuple[EffectTable, ...] = ()

    def changed(self, changes: Mapping[str, int]) -> Campaign:
        """Return the campaign with another seed or number of runs.

        Raises
        ------
        ConfigurationError
            If a value is outside its range.
        """
        values = {field.alias or name: getattr(self, name) for name, field in type(self).model_fields.items()}
        values["duration_s"] = values.pop("duration")
        try:
            return Campaign.model_validate(values | dict(changes))
        except ValidationError as error:
            raise ConfigurationError(
                f"campaign {self.name}: {'; '.join(qt.explain(error, Campaign))}"
            ) from None

    @field_validator("manoeuvre", "effect", mode="before")
    @classmethod
    def _several(cls, raw: Any, info: ValidationInfo) -> Any:
        if isinstance(raw, Mapping):
            raise ValueError(f"write [[{info.field_name}]] with two brackets, because several may follow")
        return raw

    @field_validator("manoeuvre", mode="before")
    @classmethod
    def _at_least_one(cls, raw: Any) -> Any:
        if isinstance(raw, list | tuple) and not raw:
            raise ValueError("at least one [[manoeuvre]] is needed")
        return raw

    @model_validator(mode="after")
    def _rates(self) -> Campaign:
        ratio = self.simulation_hz / self.log_hz
        if ratio < 1.0 or abs(ratio - round(ratio)) > 1e-9:
            raise ValueError(f"log_hz = {self.log_hz:g} must divide simulation_hz = {self.simulation_hz:g}")
        steps = self.duration * self.log_hz
        if steps < 0.5:
            raise ValueError(
                f"duration = {self.duration:g} s is shorter than a log sample of {1 / self.log_hz:g} s"
            )
        if self.duration * self.simulation_hz > MOST_STEPS:
            raise ValueError(
                f"duration = {self.duration:g} s has {self.duration * self.simulation_hz:g} steps at simulation_hz = "
                f"{self.simulation_hz:g}; a run may have {MOST_STEPS:g}"
            )
        if abs(steps - round(steps)) > 1e-6:
            raise ValueError(
                f"duration = {self.duration:g} s must be a whole number of log samples of {1 / self.log_hz:g} s"
            )
        return self


def read(path: Path, changes: Mapping[str, Any] | None = None) -> Campaign:
    """Read and validate a campaign file, its top-level keys replaced by ``changes``.

    Raises
    ------
    ConfigurationError
        If the file cannot be read; or with every problem of it, each with its path, the allowed values and the nearest
        name.
    """
    raw = read_toml(
        path, ConfigurationError, "`airtruth new campaign --out FILE.toml` writes a campaign file"
    )
    try:
        return Campaign.model_validate(raw | dict(changes or {}))
    except ValidationError as error:
        problems = qt.explain(error, Campaign)
        raise ConfigurationError(f"{path}: {len(problems)} problem(s)\n  " + "\n  ".join(problems)) from None
