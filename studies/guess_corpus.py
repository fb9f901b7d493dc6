"""Score of `airtruth import --guess` on the corpus of `validation.guess_corpus`: guess, then import without an edit.

    python -m studies.guess_corpus [--only NAME] [--show]

A layout is right if every channel that its file determines is mapped and equals the truth within noise and resolution, and if
each channel that the file does not determine is named with a cure. It is wrong if a mapped channel differs from the truth.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import AirtruthError
from airtruth.importers import convert, guess_mapping, import_log, open_source, read_mapping
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LONGITUDINAL
from validation.guess_corpus import HELD_OUT, LAYOUTS, Layout
from validation.guess_flights import CRAFT, NOISE, flown

Array = NDArray[np.float64]

LEVEL: Final = {"airspeed_m_s": 0.012, "altitude_m": 0.004, "density_kg_m3": 0.01}
"""Channel -> relative error of its level that is allowed [-]."""
CHANGE: Final = 0.12
"""Error of a channel's change that is allowed, as a share of its standard deviation [-] (interpolation at the file's rate)."""


@dataclass(frozen=True)
class Score:
    """Ending of one layout.

    wrong : channels that are mapped and differ from the truth. lost : channels that the file determines and the mapping lacks.
    imported : whether the import passes; verdict : whether it ends as the file deserves; text : the guess; error : its refusal.
    """

    layout: Layout
    wrong: tuple[str, ...]
    lost: tuple[str, ...]
    imported: bool
    verdict: bool
    text: str
    error: str

    @property
    def right(self) -> bool:
        """Whether nothing is wrong and nothing is lost."""
        return not self.wrong and not self.lost and self.verdict


def scored(layout: Layout, folder: Path, seed: int = 1) -> Score:
    """Write a layout's file, guess and import."""
    path = folder / f"{layout.name.replace(' ', '_')}{layout.suffix}"
    layout.write(path, layout.craft, seed)
    expected = {c for c in (*LONGITUDINAL.required, "theta_rad", "ax_m_s2") if c not in layout.missing}
    try:
        text = guess_mapping(path)
    except AirtruthError as error:
        return Score(layout, (), tuple(sorted(expected)), False, False, "", str(error))
    (folder / "m.toml").write_text(text, encoding="utf-8")
    wrong: tuple[str, ...] = ()
    mapped: set[str] = set()
    error_text = ""
    try:
        mapping = read_mapping(folder / "m.toml")
        log = convert(open_source(path, mapping.source), mapping)
        mapped, wrong = set(log.channels), _differing(log, layout)
    except AirtruthError as error:
        error_text = str(error)
    try:
        import_log(path, folder / "m.toml")
        imported = True
    except AirtruthError as error:
        imported, error_text = False, str(error)
    lost = tuple(sorted(expected - mapped))
    needs = (layout.missing & set(LONGITUDINAL.required)) - {"alpha_rad"}
    named = all(
        any(c in line for line in text.splitlines() if line.startswith("# Not mapped")) for c in needs
    )
    return Score(
        layout, wrong, lost, imported, named and not imported if needs else imported, text, error_text
    )


def _differing(log: FlightLog, layout: Layout) -> tuple[str, ...]:
    """Channels of a log that differ from the truth, the start of the log being the one that fits best."""
    truth = flown(layout.craft)
    usual = [c for c in ("q_rad_s", "theta_rad", "az_m_s2", "altitude_m") if c in log.channels]
    starts = np.arange(0.0, 1.0, 0.0025)

    def at(channel: str, start: float) -> Array:
        return np.asarray(np.interp(log.t_s + start, truth["t_s"], truth[channel]))

    def off(start: float) -> float:
        return sum(1.0 - float(np.corrcoef(log.channels[c], at(c, start))[0, 1]) ** 2 for c in usual)

    start = min(starts, key=off) if usual else 0.0
    inner = slice(3, -3)
    wrong = []
    for channel, values in log.channels.items():
        if channel not in truth:
            continue
        exact = at(channel, float(start))
        deviation = (values - exact)[inner]
        noise = NOISE[channel] * (CRAFT[layout.craft].speed if channel == "airspeed_m_s" else 1.0)
        reconstructed = channel == "alpha_rad" and channel in layout.missing
        level = LEVEL.get(channel, 0.0) * abs(float(exact.mean())) + 0.02 * float(exact.std()) + noise
        level += 0.05 if reconstructed else 0.0
        change = CHANGE * float(exact.std()) + 1.3 * noise + (0.02 if reconstructed else 0.0)
        if abs(float(deviation.mean())) > level or float(deviation.std()) > change:
            wrong.append(channel)
    return tuple(wrong)


def table(scores: Sequence[Score]) -> str:
    """One line for each layout, and the sums."""
    lines = [f"{'layout':<30}{'aircraft':<10}{'right':<7}{'import':<9}detail"]
    for s in scores:
        detail = "; ".join(
            part
            for part in (
                f"wrong: {', '.join(s.wrong)}" if s.wrong else "",
                f"not mapped: {', '.join(s.lost)}" if s.lost else "",
                ""
                if s.verdict
                else s.error.splitlines()[0][-120:]
                if s.error
                else "imported, though it should not",
            )
            if part
        )
        held = " (held out)" if s.layout.name in HELD_OUT else ""
        ending = "passes" if s.imported else "refused"
        lines.append(
            f"{s.layout.name:<30}{s.layout.craft:<10}{'yes' if s.right else 'no':<7}{ending:<9}{detail}{held}"
        )
    for name, some in (
        ("all", scores),
        ("written first", [s for s in scores if s.layout.name not in HELD_OUT]),
        ("held out", [s for s in scores if s.layout.name in HELD_OUT]),
    ):
        if some:
            lines.append(
                f"{name}: {sum(s.right for s in some)} of {len(some)} right, {sum(bool(s.wrong) for s in some)} wrong, "
                f"{sum(s.verdict for s in some)} with the right verdict, {sum(s.imported for s in some)} imported without an edit"
            )
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", action="append", help="a layout")
    parser.add_argument("--show", action="store_true", help="print the guesses too")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scores = [
            scored(one, Path(folder)) for one in LAYOUTS if not arguments.only or one.name in arguments.only
        ]
    for s in scores if arguments.show else ():
        print(f"=== {s.layout.name}\n{s.text}{s.error}\n")
    print(table(scores))


if __name__ == "__main__":
    main()
