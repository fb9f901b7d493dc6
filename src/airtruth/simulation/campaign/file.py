"""The campaign file: a flight test as TOML, validated with every problem at once."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

from pydantic import Field, ValidationError, ValidationInfo, field_validator, model_validator

from airtruth import quantity as qt
from airtruth.aircraft import Sensor, sensor_tables
from airtruth.documents import read_toml
from airtruth.errors import ConfigurationError
from airtruth.physics.gust_figures import FIGURES, LEVELS
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.campaign.effect_table import EffectTable
from airtruth.simulation.campaign.manoeuvre_table import ManoeuvreTable
from airtruth.simulation.campaign.tables import Constant, Draw, UnitTable, one_of

NO_GUST: Final = "none"
"""Gust level of calm air."""


MOST_STEPS: Final = 4e6
"""Simulation steps of a run [-] (judgement: an hour at 1 kHz; planning it takes 3 s)."""


class ConditionTable(UnitTable):
    """Where runs start: level or steady climb, EAS [m/s], geometric altitude [m], flight path [rad].

    straight: a lateral campaign trims with the wings level, or without sideslip and with a bank.
    """

    dimensions: ClassVar[dict[str, str]] = {"eas": "speed", "altitude": "length", "flight_path": "angle"}
    eas: Draw
    altitude: Draw
    flight_path: Draw = Constant(value=0.0)
    straight: Literal["wings-level", "no-sideslip"] = "wings-level"


class GustTable(UnitTable):
    """Dryden gusts; ``factor`` multiplies the level's standard deviations.

    lateral: side gusts, with ``rotary`` those in roll and yaw; where it is not stated, the lateral campaigns have them.
    """

    figures: str = "gtm"
    level: str = NO_GUST
    factor: Draw = Constant(value=1.0)
    start: Literal["rest", "stationary"] = "stationary"
    rotary: bool = False
    lateral: bool | None = None

    _known_figures = field_validator("figures")(one_of(FIGURES))
    _known_level = field_validator("level")(one_of((NO_GUST, *LEVELS)))


class WindTable(UnitTable):
    """Constant wind along the track, tailwind positive [m/s].

    keeps = "true_airspeed": the trim has the stated EAS whatever the wind, so on a flat, non-rotating
    planet the wind changes the ground speed alone (Galileo). keeps = "ground_speed": the stated EAS is
    that of calm air, the ground speed stays, and the airspeed of the trim is less by the wind.
    """

    dimensions: ClassVar[dict[str, str]] = {"along_track": "speed"}
    along_track: Draw = Constant(value=0.0)
    keeps: Literal["true_airspeed", "ground_speed"] = "true_airspeed"


class SensorTable(UnitTable):
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


class AugmentationTable(UnitTable):
    """Gains of the aircraft's pitch damper [s] and attitude hold [-], and of a yaw damper and a bank hold.

    The latter two are flown beside the aircraft's model, see `airtruth.simulation.lateral_feedback`: yaw_damper_gain_s of the
    yaw rate to the rudder [s], yaw_damper_washout_s the time constant of its high pass [s] or 0 for none, bank_gain of the
    bank [-] and roll_damper_gain_s of the roll rate [s] to the aileron.
    """

    damper_gain_s: float = 0.0
    attitude_gain: float = 0.0
    yaw_damper_gain_s: float = 0.0
    yaw_damper_washout_s: float = Field(default=0.0, ge=0.0)
    bank_gain: float = 0.0
    roll_damper_gain_s: float = 0.0

    @property
    def lateral(self) -> bool:
        """Whether it moves aileron or rudder."""
        return bool(self.yaw_damper_gain_s or self.bank_gain or self.roll_damper_gain_s)


class Campaign(UnitTable):
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

    @property
    def lateral(self) -> bool:
        """Whether its flights roll and yaw: a manoeuvre, a feedback, side gusts or an effect of the lateral motion."""
        return (
            bool(self.moved - {ELEVATOR})
            or self.augmentation.lateral
            or (self.gust.lateral is True and self.in_gusts)
            or any(effect.lateral for effect in self.effect)
        )

    @property
    def moved(self) -> frozenset[str]:
        """Controls that a manoeuvre moves."""
        return frozenset(table.control for row in self.manoeuvre for table in row.inputs)

    @property
    def in_gusts(self) -> bool:
        """Whether the air is not calm."""
        return self.gust.level != NO_GUST

    @property
    def side_gusts(self) -> bool:
        """Whether there are side gusts."""
        return self.in_gusts and self.lateral and self.gust.lateral is not False

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
