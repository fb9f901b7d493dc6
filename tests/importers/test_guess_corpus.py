"""The guess on files of many sources, written from flights with known truth: right, or refused with the cure."""

import tomllib
from itertools import product

import numpy as np
import pytest
from tiers import sampled

from airtruth.errors import ConfigurationError
from airtruth.importers import guess_mapping, read_dictionary
from airtruth.importers.dictionary import DIMENSIONS, lexicon
from airtruth.importers.guessing.evidence import MOST, compared, near
from studies.guess_corpus import scored
from validation.guess_corpus import HELD_OUT, LAYOUTS, PLAIN, Layout, table

QUICK = ("px4 new", "ardupilot aetr aoa", "uvw", "centidegrees", "no vane")


@pytest.mark.parametrize("name", QUICK)
def test_a_layout_is_right(name, tmp_path):
    (layout,) = [one for one in LAYOUTS if one.name == name]
    score = scored(layout, tmp_path)
    assert score.wrong == ()
    assert score.right, score.text


@pytest.mark.slow
def test_the_corpus(tmp_path):
    """Nothing wrong; nine tenths right."""
    scores = [scored(one, tmp_path) for one in LAYOUTS]
    assert [s.layout.name for s in scores if s.wrong] == []
    assert sum(s.right for s in scores) >= 0.9 * len(scores)
    assert sum(s.verdict for s in scores) >= 0.8 * len(scores)
    assert len(HELD_OUT) >= 14


@pytest.mark.parametrize(
    ("craft", "unit", "dropped"),
    sampled(
        list(
            product(
                ("model", "single", "jet"), ("kt", "km/h", "ft/s"), (("alpha",), ("alpha", "ax"), ("ax",))
            )
        ),
        9,
    ),
)
def test_an_airspeed_whose_unit_physics_cannot_decide_is_in_doubt(craft, unit, dropped, tmp_path):
    """Without a vane the elevator's effect was evidence of the airspeed from which the angle of attack was integrated."""
    columns = [
        (name, channel, unit if name == "tas" else stated)
        for name, channel, stated in PLAIN
        if name not in dropped
    ]
    missing = frozenset({"alpha_rad"}) if "alpha" in dropped else frozenset()
    score = scored(Layout("plain", craft, ".csv", table(columns), missing), tmp_path)
    assert score.wrong == ()
    if "airspeed_m_s" in score.lost:
        assert (
            "# [channels.airspeed_m_s] # in doubt: neither header nor physics decides its unit" in score.text
        )


def test_a_relation_moves_with_unit_sign_and_axis():
    """y = x is certain; a factor of 57.3, the opposite sign and noise are not."""
    t = np.arange(600) / 25.0
    x = np.sin(2.0 * t) + 0.3 * np.sin(5.0 * t)
    right, factor, share = compared(x, x, 0.04, 2)
    assert (factor, share) == pytest.approx((1.0, 1.0))
    assert right > 5.0
    assert compared(x, -x, 0.04, 2)[0] == -MOST
    assert compared(57.3 * x, x, 0.04, 2)[0] < 0.0
    assert abs(compared(np.random.default_rng(1).standard_normal(600), x, 0.04, 2)[0]) < 5.0


def test_an_absurd_size_is_as_unlikely_as_evidence_can_be():
    assert near(1e200, 0.05, 2.0, "").log_ratio == -MOST


def test_shipped_sources_are_recognised_by_their_columns():
    titles = {part.title for part in lexicon(["vehicle_attitude.q[0]"]).parts}
    assert "PX4" in titles
    assert "ArduPilot" not in titles
    assert "airspeed_m_s" in DIMENSIONS


def test_a_users_file_of_a_source(tmp_path):
    (tmp_path / "w.toml").write_text(
        'title = "ours"\nmarks = ["ADC1_*"]\n[[column]]\nmatch = ["ADC1_SPEED"]\nchannel = "airspeed_m_s"\nunit = "kt"\n'
        '[[column]]\nmatch = ["ADC1_AOA"]\nrefuse = "a pressure ratio"\n'
    )
    t = np.arange(300) / 50.0
    rows = "".join(f"{a:.2f},{80.0 + np.sin(a):.4f},{0.1 * np.sin(a):.4f}\n" for a in t)
    (tmp_path / "f.csv").write_text(f"time,ADC1_SPEED,ADC1_AOA\n{rows}")
    text = guess_mapping(tmp_path / "f.csv", words=read_dictionary(tmp_path / "w.toml"))
    assert tomllib.loads(text)["channels"]["airspeed_m_s"] == {"column": "ADC1_SPEED", "unit": "kt"}
    assert "format ours" in text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('[[column]]\nmatch = ["x"]\nchannel = "alfa_rad"\nunit = "deg"', "alfa_rad"),
        ('[[column]]\nmatch = ["x"]\nchannel = "alpha_rad"\nunit = "m"', "is not a unit of alpha_rad"),
        ('[[column]]\nmatch = ["x"]', "state channel and unit, or refuse"),
        ('[[column]]\nchannel = "alpha_rad"', "state match"),
        ("column = 3", "must be a list of tables"),
    ],
)
def test_a_source_that_cannot_be_used(content, message, tmp_path):
    (tmp_path / "w.toml").write_text(content)
    with pytest.raises(ConfigurationError, match=message):
        read_dictionary(tmp_path / "w.toml")
