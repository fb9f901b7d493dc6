"""The numbers of the paper's Tables 1-3, with their number of digits.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", Tables 1-3.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from importlib import resources
from typing import Any, Final

from airtruth.physics.motion import LONGITUDINAL

ESTIMATED: Final = (*LONGITUDINAL.parameters, *LONGITUDINAL.modal)
"""The eight parameters of a column: six derivatives [-], wn [rad/s] and zeta [-]."""

DECIMALS: Final[Mapping[str, int]] = dict(zip(ESTIMATED, (3, 2, 3, 3, 2, 3, 3, 3), strict=True))
"""Decimals of the paper's true values [-]."""

_SUBSCRIPTS: Final = (r"\alpha", "q", r"\delta_e")
"""Symbols of the signals, for LaTeX."""
SYMBOLS: Final[Mapping[str, str]] = dict(
    zip(
        ESTIMATED,
        (
            *(rf"$C_{{{c}{x}}}$" for c in "Lm" for x in _SUBSCRIPTS),
            r"$\omega_n$ [rad/s]",
            r"$\zeta$",
        ),
        strict=True,
    )
)
"""Symbols of the parameters, for LaTeX and matplotlib; that of wn has its unit."""


@dataclass(frozen=True)
class Printed:
    """A published number.

    Attributes
    ----------
    value : the number.
    unit : one unit of its last digit (0.01 for "30.79").
    """

    value: float
    unit: float

    @property
    def rounding_std(self) -> float:
        """Standard deviation of the rounding error, uniform over one unit."""
        return self.unit / math.sqrt(12.0)


@dataclass(frozen=True)
class PublishedColumn:
    """One method of a published table.

    Attributes
    ----------
    label : heading of the column in the paper.
    methods : methods of airtruth to compare with the column.
    mean, std : parameter of `ESTIMATED` -> mean and standard deviation over the runs.
    relerr_pct : relative error of the six derivatives [%].
    relerr_modal_pct : relative error of wn_rad_s and of zeta [%].
    iterations : mean number of iterations, None for least squares.
    """

    label: str
    methods: tuple[str, ...]
    mean: Mapping[str, Printed]
    std: Mapping[str, Printed]
    relerr_pct: Printed
    relerr_modal_pct: Mapping[str, Printed]
    iterations: Printed | None


@dataclass(frozen=True)
class PublishedTable:
    """One table of the paper.

    Attributes
    ----------
    name : table1, table2 or table3.
    caption : caption in the paper.
    runs : number of Monte Carlo runs of each column.
    columns : the methods, in the paper's order.
    """

    name: str
    caption: str
    runs: int
    columns: tuple[PublishedColumn, ...]

    def column(self, method: str) -> PublishedColumn | None:
        """Return the column to compare ``method`` with, None if there is none."""
        return next((c for c in self.columns if method in c.methods), None)


@dataclass(frozen=True)
class Published:
    """The paper's tables and the true values that it states.

    Attributes
    ----------
    source : citation of the paper.
    truth : parameter of `ESTIMATED` -> true value.
    tables : table name -> table.
    """

    source: str
    truth: Mapping[str, Printed]
    tables: Mapping[str, PublishedTable]


@cache
def load() -> Published:
    """Return the paper's tables, transcribed in ``published.toml``."""
    text = resources.files("airtruth.reporting.paper").joinpath("published.toml").read_text(encoding="utf-8")
    raw = tomllib.loads(text, parse_float=Decimal)  # Decimal keeps the trailing zeros
    return Published(
        source=raw["source"],
        truth={name: _printed(raw["truth"][name]) for name in ESTIMATED},
        tables={
            name: PublishedTable(
                name=name,
                caption=table["caption"],
                runs=table["runs"],
                columns=tuple(_column(c) for c in table["columns"]),
            )
            for name, table in raw.items()
            if name.startswith("table")
        },
    )


def _printed(figure: Decimal | int) -> Printed:
    exponent = Decimal(figure).as_tuple().exponent
    assert isinstance(exponent, int)  # NaN and infinity are not among the numbers
    return Printed(float(figure), 10.0**exponent)


def _column(raw: Mapping[str, Any]) -> PublishedColumn:
    return PublishedColumn(
        label=raw["label"],
        methods=tuple(raw["methods"]),
        mean={name: _printed(raw[name][0]) for name in ESTIMATED},
        std={name: _printed(raw[name][1]) for name in ESTIMATED},
        relerr_pct=_printed(raw["relerr"]),
        relerr_modal_pct={"wn_rad_s": _printed(raw["relerr_wn"]), "zeta": _printed(raw["relerr_zeta"])},
        iterations=_printed(raw["iterations"]) if "iterations" in raw else None,
    )
