"""Fly data/undeclared, eight small flight tests of a GTM that differs from the declared one, and write their key.

    python -m validation.undeclared [--data DIR] [--key FILE]

The logs do not state the effects; tests/tracing/undeclared_key.toml does, for tests alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import write_log, write_text
from validation.blind import draw, information, refit
from validation.blind.draw import Trial
from validation.blind.figures import CHANNELS, DEG, ROOT
from validation.blind.truths import Added

Array = NDArray[np.float64]

SEED: Final = 16
"""Seed of the eight trials [-]."""

FLOWN: Final[dict[str, tuple[str, str, tuple[Added, ...]]]] = {
    "a": ("single", "light", (Added("elevator_delay", {"delay_s": 0.0085}),)),
    "b": ("single", "light", (Added("vane_arm", {"x_m": 1.6}),)),
    "c": ("single", "calm", (Added("downwash_lag", {"Cmalphadot": -34.0}),)),
    "d": (
        "single",
        "light",
        (Added("cm_alpha_nonlinear:break", {"dCmalpha": -0.5, "at_alpha_rad": 6.1 * DEG}),),
    ),
    "e": ("single", "moderate", (Added("accelerometer_arm", {"x_m": 0.45}),)),
    "f": ("null", "light", ()),
    "g": ("off-library", "light", (Added("separation_switch", {"dCm": -0.010}),)),
    "h": (
        "pair",
        "light",
        (Added("gyro_lag", {"tau_s": 0.009}), Added("elevator_asymmetry", {"dCmde": 0.45})),
    ),
}
"""Log -> composition and air of its trial, and its effects."""

_HEAD: Final = """# Effects that validation/undeclared.py flew into data/undeclared; for tests alone.
# lambda: noncentrality of each effect in the fitted records (docs/blind.md).
# oracle: rms of the error of the true model's free run on the held-out records, with free biases and initial
# state: the contribution of gusts and sensors.
"""
"""Comment at the head of the key."""


def trial(name: str) -> Trial:
    """Return the trial of one log."""
    composition, air, effects = FLOWN[name]
    number = sorted(FLOWN).index(name)
    return replace(
        draw.draw(SEED, number, "null"), composition=composition, air=air, effects=effects, duration_s=6.0
    )


def _values(values: Mapping[str, float]) -> str:
    return "{ " + ", ".join(f"{name} = {value!r}" for name, value in values.items()) + " }"


def records(log: FlightLog) -> list[Array]:
    """Return alpha, q and az of each run, (samples, 3) [rad, rad/s, m/s2]."""
    return [
        np.column_stack([log.channels[name][log.rows(run)] for name in CHANNELS])
        for run in range(len(log.run_ids))
    ]


def entry(name: str, log: FlightLog) -> str:
    """Return the truth of one log as TOML."""
    t = trial(name)
    strength = refit.lambdas(t)
    oracle = information.oracle(t, records(log))["free_run"]
    lines = [
        f"[{name}]",
        f'composition = "{t.composition}"',
        f'air = "{t.air}"',
        f'spectrum = "{t.spectrum}"',
    ]
    lines += [f'noise = "{t.noise}"', f"rotary = {str(t.rotary).lower()}"]
    lines += [f"oracle = {_values({channel: float(f'{rms:.4g}') for channel, rms in oracle.items()})}"]
    for effect in t.effects:
        lines += ["", f"[[{name}.effects]]", f'name = "{effect.key}"', f"lambda = {strength[effect.key]:.0f}"]
        lines += [f"parameters = {_values(effect.values)}"]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write the logs and their key."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, default=ROOT / "data" / "undeclared")
    parser.add_argument("--key", type=Path, default=ROOT / "tests" / "tracing" / "undeclared_key.toml")
    arguments = parser.parse_args()
    for folder in (arguments.data, arguments.key.parent):
        folder.mkdir(parents=True, exist_ok=True)
    logs = {name: draw.fly(trial(name)) for name in FLOWN}
    for name, log in logs.items():
        write_log(arguments.data / f"{name}.parquet", log)
    write_text(arguments.key, _HEAD + "\n" + "\n".join(entry(name, log) for name, log in logs.items()))


if __name__ == "__main__":
    main()
