"""An aircraft: aircraft.toml, its JSBSim model, and the writers of both."""

from airtruth.aircraft.file import (
    FILE,
    Actuator,
    Aircraft,
    AircraftFile,
    Dynamics,
    Sensor,
    sensor_tables,
)
from airtruth.aircraft.loading import find, load, read_file, shipped_roots
from airtruth.aircraft.model import ElevatorProperties, JsbsimModel, ThrottleProperties

__all__ = [
    "FILE",
    "Actuator",
    "Aircraft",
    "AircraftFile",
    "Dynamics",
    "ElevatorProperties",
    "JsbsimModel",
    "Sensor",
    "ThrottleProperties",
    "find",
    "load",
    "read_file",
    "sensor_tables",
    "shipped_roots",
]
