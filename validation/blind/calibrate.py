"""Prints the table of `blind.sizes`: the sizes of every effect at which its noncentrality is 16 in a nominal trial.

    python -m validation.blind.calibrate  # two minutes of one core

One row of `blind.sizes` is set by hand: a rate limit acts from a threshold on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from validation.blind.aircraft_xml import Body
from validation.blind.draw import AIRS, Trial, draw
from validation.blind.information import Directions, Whitener, difference, directions, noise_model
from validation.blind.truths import EFFECTS, FURTHER, LIBRARY, OFF_LIBRARY, Added

_HEAD = '''"""Sizes with a noncentrality of 16 in calm, light and moderate air; printed by `blind.calibrate`.

Capped at the largest size of the effect, so that some cannot be seen in some air.
"""

from typing import Final

SIZE16: Final[dict[str, tuple[float, float, float]]] = {'''


def sizes(key: str, trial: Trial, tools: Sequence[tuple[Whitener, Directions]]) -> list[float]:
    """Size of an effect for each noise model."""
    kind = EFFECTS[key]
    result = []
    size = kind.largest / 8.0
    for whiten, along in tools:
        for _ in range(5):
            d = whiten(difference(trial, Added(key, kind.values(size, 0.5)))).ravel()
            value = along.projection.rest(d)
            ratio = 4.0 / max(value, 1e-6) ** 0.5
            size = min(size * float(np.clip(ratio, 0.1, 4.0)), kind.largest)
            if abs(np.log(ratio)) < 0.1 or size == kind.largest:
                break
        result.append(size)
    return result


def main() -> None:
    """Print the module."""
    trial = replace(
        draw(0, 0, "null"), body=Body(), spectrum="dryden", rotary=False, noise="white", duration_s=6.0
    )
    tools = []
    for air in AIRS:
        whiten = noise_model(trial, air)
        tools.append((whiten, directions(trial, whiten)))
    print(_HEAD)
    for key in (*LIBRARY, *OFF_LIBRARY, *FURTHER):
        print(f'    "{key}": ({", ".join(f"{s:.3g}" for s in sizes(key, trial, tools))}),', flush=True)
    print("}")


if __name__ == "__main__":
    main()
