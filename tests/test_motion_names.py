"""A ratchet: derivatives, channels and axes are named where a motion is described, and ever less elsewhere.

No room may exceed its cap. Lower the cap of a room whose count has fallen; the test prints the total.

Two words of an axis have other meanings, and the modules of `HOMONYMS` use them in these alone. A moment is also a moment of
statistics: a sum of products whose roots are estimates. In two modules it is the kind of every coefficient with a reference
length, whatever its motion. A chord is also a step of Newton's method with the derivatives of an earlier one.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from airtruth.physics.motion import MOTIONS

SOURCE = Path(__file__).resolve().parents[1] / "src" / "airtruth"
HOME = (
    "aircraft/parts.py",
    "physics/motion.py",
    "physics/composition.py",
    "physics/expected.py",
    "physics/composition_lateral.py",
    "effects/",
    "identification/regression/",
)
"""Modules that describe an axis or hold its algebra: motions, parts of the aircraft, effects and estimators."""
EQUATIONS = (
    "physics/short_period.py",
    "physics/lateral.py",
    "tracing/model/longitudinal",
    "tracing/model/lateral",
)
"""Modules and rooms with the equations of one motion, which name its axes; another motion adds rooms of its own."""
HOMONYMS = {
    "moment": (
        "checks/kinematics_fit.py",
        "checks/kinematics_search.py",
        "checks/spectra.py",
        "identification/lateral/problems.py",
        "identification/lateral/solve.py",
        "identification/likelihood/cramer_rao.py",
        "tracing/inference/posterior.py",
        "tracing/model/declared.py",
        "tracing/model/surface_noise.py",
    ),
    "chord": (
        "numerics/levenberg_marquardt.py",
        "numerics/levenberg_marquardt_options.py",
        "tracing/inference/optimise.py",
    ),
    "size": (
        "charts/ticks.py",
        "design/waveforms.py",
        "identification/lateral/frequency.py",
        "identification/lateral/observation.py",
        "identification/lateral/problems.py",
        "identification/likelihood/filter_slopes.py",
        "identification/likelihood/kalman.py",
        "importers/held.py",
        "loop/result.py",
        "numerics/intersample.py",
        "numerics/prefilter.py",
        "physics/dryden.py",
        "physics/reconstruction.py",
        "reporting/campaign.py",
        "reporting/partial.py",
        "simulation/survey/controls.py",
        "tracing/model/ahead.py",
        "tracing/model/compile.py",
        "tracing/model/response_slopes.py",
        "tracing/model/surface_path.py",
    ),
}
"""Word, or "size" of three or six -> modules in which it is not that of an axis."""
CAPS: dict[str, int] = {
    "aircraft": 123,
    "airtruth": 13,
    "api": 2,
    "checks": 37,
    "cli": 16,
    "design": 34,
    "identification": 53,
    "importers": 52,
    "logs": 1,
    "physics": 62,
    "physics/lateral.py": 16,
    "physics/short_period.py": 42,
    "reporting": 15,
    "simulation": 85,
    "starting": 19,
    "tracing": 35,
    "tracing/model": 33,
    "tracing/model/lateral": 81,
    "tracing/model/longitudinal": 92,
    "tracing/presentation": 4,
    "tracing/selection": 5,
}
"""Room -> occurrences in its code."""


def pattern() -> re.Pattern[str]:
    """Names of derivatives, coefficients, channels and controls of every motion, and words of one axis."""
    derivatives = {name for m in MOTIONS.values() for name in m.parameters}
    numbers = {
        f"{c.name}_{s.symbol}".upper() for m in MOTIONS.values() for c in m.coefficients for s in m.signals
    }
    channels = {name for m in MOTIONS.values() for name in (*m.channels, *(c.command for c in m.controls))}
    controls = {c.name for m in MOTIONS.values() for c in m.controls}
    axes = {"PARAMETERS", "lift", "moment", "chord", "span_m", "inertia_yy"}
    exact = sorted(derivatives | numbers | channels, key=len, reverse=True)
    return re.compile("|".join((*exact, *sorted(controls | axes))))


NAMES = pattern()
COEFFICIENTS = {c.name for m in MOTIONS.values() for c in m.coefficients} | {"CX"}
"""Symbols that count as whole names and strings."""
SIZED = {"eye", "zeros", "ones", "empty", "full", "range"}
"""Functions whose argument 3 or 6 is the size of an axis."""


def words(tree: ast.AST) -> Iterator[str]:
    """Names and strings of the code, docstrings left out."""
    docstrings = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=text) | ast.Attribute(attr=text) | ast.arg(arg=text) | ast.alias(name=text):
                yield text
            case ast.keyword(arg=str(text)) | ast.FunctionDef(name=text) | ast.ClassDef(name=text):
                yield text
            case ast.Constant(value=str(text)) if id(node) not in docstrings:
                yield text
            case _:
                pass


def sizes(tree: ast.AST) -> int:
    """Slices that end or begin at 3 or 6, and arrays and ranges of these sizes."""
    count = 0
    for node in ast.walk(tree):
        match node:
            case ast.Slice():
                count += sum(is_size(bound) for bound in (node.lower, node.upper))
            case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)) if name in SIZED:
                for argument in node.args[:1]:
                    entries = argument.elts if isinstance(argument, ast.Tuple) else [argument]
                    count += sum(map(is_size, entries))
            case _:
                pass
    return count


def is_size(node: ast.expr | None) -> bool:
    return isinstance(node, ast.Constant) and node.value in (3, 6)


def count(path: Path) -> int:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    other = {word for word, modules in HOMONYMS.items() if path.as_posix().endswith(modules)}
    found = (name for w in words(tree) for name in (*NAMES.findall(w), *COEFFICIENTS.intersection({w})))
    return ("size" not in other) * sizes(tree) + sum(name not in other for name in found)


def counts() -> Counter[str]:
    """Room -> occurrences; the rooms of the tracer and the equations of a motion count each by itself."""
    found: Counter[str] = Counter()
    for path in sorted(SOURCE.rglob("*.py")):
        name = path.relative_to(SOURCE).as_posix()
        if not name.startswith(HOME):
            *rooms, _ = name.split("/")
            depth = 2 if rooms[:1] == ["tracing"] else 1
            own = next((room for room in EQUATIONS if name.startswith(room)), "/".join(rooms[:depth]))
            found[own or "airtruth"] += count(path)
    return +found


def test_the_names_of_a_motion_spread_to_no_room():
    found = counts()
    outside = sum(number for room, number in found.items() if room not in EQUATIONS)
    print(
        f"{outside} names of derivatives, channels and axes; {sum(found.values()) - outside} in equations of one motion"
    )
    risen = {
        room: (number, CAPS.get(room, 0)) for room, number in found.items() if number > CAPS.get(room, 0)
    }
    assert not risen, "room: (names, cap)"


def test_code_counts_and_docstrings_do_not():
    tree = ast.parse('def f(x):\n    """CLalpha."""\n    return x["CLalpha"] + y.elevator_rad[:3] + eye(6)\n')
    assert [w for w in words(tree) if NAMES.search(w)] == ["CLalpha", "elevator_rad"]
    assert sizes(tree) == 2
