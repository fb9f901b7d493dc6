"""Damage to inputs of a report, and what a report may do with it: give a page or one error."""

import copy
import math

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.reporting import report

EXAMPLES = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
NUMBERS = st.one_of(
    st.sampled_from([0.0, -1.0, math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324]),
    st.floats(),
    st.integers(),
)
VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), NUMBERS, st.text(max_size=8)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=5,
)


def page_or_error(source, folder):
    """Whether there is a page; an error must be one of airtruth, in one line."""
    out = folder / "page.html"
    out.unlink(missing_ok=True)
    message = ""
    try:
        report(source, out)
    except (ConfigurationError, StoreError, LogError) as error:
        message = str(error)
    assert "\n" not in message
    if message:
        return False
    assert out.read_text().rstrip().endswith("</html>")
    return True


def flipped(content, damage):
    """Bytes with some of them replaced, or cut short."""
    content = bytearray(content)
    for position, value in damage:
        content[int(position * len(content))] = value
    return bytes(content)


BYTES = st.lists(
    st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=6
)


DELETE = object()
"""In place of a value: the entry is removed."""


def paths(document, at=()):
    """Paths of every entry of a JSON document."""
    entries = document.items() if isinstance(document, dict) else enumerate(document)
    for key, value in entries:
        yield (*at, key)
        if isinstance(value, dict | list):
            yield from paths(value, (*at, key))


def changed(document, at, value):
    """A copy with one entry replaced or deleted."""
    document = copy.deepcopy(document)
    parent = document
    for key in at[:-1]:
        parent = parent[key]
    if value is DELETE:
        del parent[at[-1]]
    else:
        parent[at[-1]] = value
    return document
