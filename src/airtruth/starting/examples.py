"""The examples that come with airtruth, and their copies in a folder of the user."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from airtruth.errors import ConfigurationError, StoreError, choices
from airtruth.logs.atomic import atomic_file, make_folder
from airtruth.logs.outputs import writing


@dataclass(frozen=True)
class Example:
    """An example: files, and the commands that use them.

    Attributes
    ----------
    name : argument of `airtruth example`.
    title : one line for the list.
    files : files relative to the root of the data, as they appear in the folder of the user.
    commands : command lines to try next, in the folder that holds the copies.
    """

    name: str
    title: str
    files: tuple[str, ...]
    commands: tuple[str, ...]


_METHODS: Final = "".join(
    f" --method {name}"
    for name in (
        *("ls", "iv-lowpass", "iv-reference", "iv-reference-regressor"),
        *("iv-actuator", "iv-actuator-regressor", "iv-f1", "iv-f2"),
    )
)
"""Options for the estimators in Tables 1 and 2 of the paper."""

_ALL: Final = (
    Example(
        "paper",
        "doublets in light turbulence: 300 runs of 15 s that reproduce Tables 1 and 2 of M. Brunot's paper",
        ("data/campaigns/light-fit.toml", "data/campaigns/light.toml"),
        (
            "airtruth fly data/campaigns/light-fit.toml --out out/light-fit",
            f"airtruth identify out/light-fit --aircraft gtm --airspeed-m-s 42.852{_METHODS}",
            "airtruth tables out/light-fit --out out/tables",
        ),
    ),
    Example(
        "campaigns",
        "all campaign files of the project, also those of a Cessna 172, an F-16 and a T-38",
        tuple(
            f"data/campaigns/{name}.toml"
            for name in (
                *("light", "light-fit", "moderate", "moderate-fit"),
                *("lateral", "lateral_multisine", "combined"),
                *("lateral_lost_fin", "lateral_nose_boom", "lateral_late_rudder", "lateral_out_of_rig"),
                *("foreign-c172x", "foreign-f16", "foreign-T38"),
            )
        ),
        ("airtruth fly data/campaigns/foreign-c172x.toml --out out/c172x",),
    ),
    Example(
        "lateral",
        "ailerons and rudder of the GTM in light turbulence: steps in both signs, and orthogonal multisines",
        ("data/campaigns/lateral.toml", "data/campaigns/lateral_multisine.toml"),
        (
            "airtruth plan data/campaigns/lateral.toml",
            "airtruth fly data/campaigns/lateral.toml --out out/lateral",
            "airtruth identify out/lateral --aircraft gtm",
        ),
    ),
    Example(
        "damaged",
        "four lateral flights of a GTM that is not as declared: fin lost, nose boom, late rudder, out of rig",
        tuple(
            f"data/campaigns/lateral_{name}.toml"
            for name in ("lost_fin", "nose_boom", "late_rudder", "out_of_rig")
        ),
        (
            "airtruth fly data/campaigns/lateral_late_rudder.toml --out out/late_rudder",
            "airtruth trace out/late_rudder --aircraft gtm --motion lateral --out out/traced",
            "airtruth report out/traced --out out/traced.html",
        ),
    ),
    Example(
        "vane",
        "six records of the GTM whose angle-of-attack vane is not at its declared location",
        ("data/undeclared/b.parquet",),
        (
            "airtruth check data/undeclared/b.parquet --aircraft gtm",
            "airtruth loop data/undeclared/b.parquet --aircraft gtm --out out/b",
            "airtruth report out/b --out out/b.html",
        ),
    ),
    Example(
        "undeclared",
        "eight flight tests of the GTM; some have an effect that the declared aircraft lacks",
        tuple(f"data/undeclared/{letter}.parquet" for letter in "abcdefgh"),
        ("airtruth trace data/undeclared/a.parquet --aircraft gtm --out out/a",),
    ),
    Example(
        "csv",
        "a record as a CSV file with foreign names, units and signs, and its mapping",
        ("data/foreign/flight7.csv", "data/foreign/flight7.toml"),
        (
            "airtruth import data/foreign/flight7.csv --guess",
            "airtruth import data/foreign/flight7.csv --mapping data/foreign/flight7.toml --out flight7.parquet",
            "airtruth check flight7.parquet --aircraft gtm",
            "airtruth identify flight7.parquet --aircraft gtm --method ls --method iv-f1",
        ),
    ),
    Example(
        "mappings",
        "mappings for a PX4 log and for a SIDPAC data file",
        ("data/mappings/px4.toml", "data/mappings/sidpac.toml"),
        ("airtruth import FILE --mapping data/mappings/px4.toml --out LOG.parquet",),
    ),
)
"""The examples in the order of the list."""
EXAMPLES: Final[dict[str, Example]] = {example.name: example for example in _ALL}
"""Every example by its name."""

SHIPPED: Final = "shipped_data"
"""Folder of the package that holds the data in a wheel; in a checkout it is `data` beside `src`."""


def data_root() -> Path:
    """Folder of the files of the examples, in a wheel or in a checkout.

    Raises
    ------
    StoreError
        If the installation is incomplete.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / SHIPPED, package.parents[1] / "data"):
        if (folder / "campaigns").is_dir():
            return folder
    raise StoreError(f"{package}: the examples are missing from this installation; install airtruth again")


def copy_example(name: str, folder: Path, *, force: bool = False) -> list[Path]:
    """Copy the files of an example and return the copies.

    Parameters
    ----------
    name : key of `EXAMPLES`.
    folder : the copies appear in it under the names in `Example.files`; an identical copy is kept.
    force : replace files that differ.

    Raises
    ------
    ConfigurationError
        If there is no such example.
    StoreError
        If a file cannot be written, or a file of the user has its name.
    """
    if name not in EXAMPLES:
        raise ConfigurationError(f"example {name!r} does not exist; {choices(name, EXAMPLES)}")
    root = data_root()
    with writing("example", force=force) as outputs:
        pairs = [(root / Path(file).relative_to("data"), folder / file) for file in EXAMPLES[name].files]
        missing = [(source, target) for source, target in pairs if not _same(source, target)]
        outputs.require(*(target for _, target in missing))
        for source, target in missing:
            make_folder(target.parent)
            with atomic_file(target) as file:
                file.write(source.read_bytes())
    return [target for _, target in pairs]


def _same(source: Path, target: Path) -> bool:
    try:
        return target.read_bytes() == source.read_bytes()
    except OSError:
        return False


__all__ = ["EXAMPLES", "Example", "copy_example", "data_root"]
