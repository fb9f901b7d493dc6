"""Pages as text: complete, self-contained, small, legible; what the plots hold is what was measured."""

import base64
import hashlib
import json
import re
from contextlib import nullcontext
from dataclasses import replace
from itertools import product

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from report_html import parsed, read_page
from report_records import GTM, METHODS, histories, log, loop_folder, record, trace_folder
from report_synthetic import ESTIMATED, TABLE_1, TRUTH, paper_campaign, truth_columns

from airtruth.aircraft import load
from airtruth.errors import ConfigurationError, StoreError
from airtruth.identification import identify, write_estimates
from airtruth.logs.histories import FILE, KEY, Histories
from airtruth.logs.store import write_log
from airtruth.logs.tables import KEY as METADATA
from airtruth.reporting import read_campaign, report, stored_campaign
from airtruth.reporting.pages import campaign_page, scatter_page
from airtruth.reporting.pages.assets import DIGESTS, own, uplot
from airtruth.reporting.pages.declared import declared_at, shifts_table
from airtruth.reporting.pages.page import data_table, page_of
from airtruth.reporting.pages.records import (
    BUDGET,
    MOST,
    conditions_table,
    extract,
    record_errors,
    records_section,
)
from airtruth.table import Group, Table, flat
from scripts.vendor_uplot import unpacked


def data_of(page):
    return json.loads(re.search(r'id="records-data">(.*?)</script>', page, re.S).group(1))


def numbers(text):
    return np.frombuffer(base64.b64decode(text), dtype="<f4")


@pytest.fixture
def identified(tmp_path):
    folder = tmp_path / "flown"
    (folder / "logs").mkdir(parents=True)
    write_log(folder / "logs" / "a.parquet", log(), dtype="float64")
    write_estimates(folder / "estimates.parquet", identify(folder, GTM, METHODS))
    return folder


def pages(tmp_path):
    """Every kind of page, by name."""
    trace = trace_folder(tmp_path / "trace")
    loop = loop_folder(tmp_path / "loop")
    campaign = paper_campaign(tmp_path / "campaign", "light", "table1", TABLE_1, 40, 1)
    sources = {
        "trace": trace,
        "loop": loop,
        "campaign": campaign,
        "identification": identify(log(), GTM, METHODS),
    }
    return {name: report(source, tmp_path / f"{name}.html")[0] for name, source in sources.items()}


def test_every_page_is_whole_and_needs_nothing_else(tmp_path):
    made = pages(tmp_path)
    assert made
    for name, path in made.items():
        page = read_page(path)
        assert page.links == [], name
        assert page.anchors == page.targets, name
        text = path.read_text()
        body = text.split("</style>", 1)[1]
        assert body.index('class="verdict"') < body.index('<figure class="chart"') < body.index("<nav>"), name
        assert "Copyright (c) 2022 Leon Sorokin" in text
        assert not re.search(r'(?:src|href)="(?:https?:)?//|@import|url\(', text), name


def test_six_records_stay_below_a_megabyte_and_a_half(tmp_path):
    """Also records of two minutes at 100 Hz, which are thinned, and the page states it."""
    for samples, told in ((301, False), (12_000, True)):
        folder = trace_folder(tmp_path / str(samples), samples=samples)
        path = report(folder, tmp_path / f"{samples}.html")[0]
        assert path.stat().st_size < 1.5e6
        assert ("The plots show one sample in" in path.read_text()) is told


def test_plots_hold_the_records_in_the_units_of_their_labels():
    shown = histories()
    data = data_of(records_section(shown).body)
    assert data["channels"] == ["alpha [deg]", "q [deg/s]", "az [m/s2]"]
    assert [m["name"] for m in data["models"]] == list(shown.models)
    assert data["first"] == len(shown.records) - 1
    for stated, mine in zip(data["records"], shown.records, strict=True):
        np.testing.assert_allclose(numbers(stated["t"]), mine.t_s, rtol=1e-6)
        np.testing.assert_allclose(
            numbers(stated["controls"][0]), np.rad2deg(mine.controls_rad["elevator_rad"]), rtol=1e-6
        )
        for i, (channel, unit) in enumerate(
            (("alpha_rad", np.pi / 180), ("q_rad_s", np.pi / 180), ("az_m_s2", 1.0))
        ):
            np.testing.assert_allclose(
                numbers(stated["measured"][i]) * unit, mine.measured[channel], rtol=1e-6
            )
            for k, model in enumerate(shown.models):
                np.testing.assert_allclose(
                    numbers(stated["models"][k][i]) * unit, mine.models[model][channel], rtol=1e-6
                )
            assert stated["floor"][i] * unit == pytest.approx(mine.floor[channel], rel=1e-12)
        assert stated["words"].startswith(f"{mine.group}, true airspeed 42.85 m/s")


def test_many_records_are_chosen_and_the_page_states_it():
    many = Histories(
        tuple(record(f"r{k}") for k in range(3 * MOST)), ("declared", "before", "after"), "r7", 3 * MOST
    )
    chosen = extract(many)
    assert MOST <= len(chosen.records) <= MOST + 1
    assert "r7" in [r.run_id for r in chosen.records]
    assert chosen.notes[0] == f"{len(chosen.records)} of {3 * MOST} records are shown, evenly spaced."
    size = len(records_section(many).body)
    assert size < 1.3 * BUDGET


def test_a_model_without_numbers_leaves_a_gap():
    nothing = {m: {c: np.full(301, np.nan) for c in x} for m, x in record().models.items()}
    own = Histories((replace(record(), models=nothing),), ("declared", "before", "after"), "r1", 1)
    data = data_of(records_section(own).body)
    assert np.isnan(numbers(data["records"][0]["models"][0][0])).all()
    assert {str(row[3]) for row in record_errors(own).rows} == {"-"}


def test_groups_are_shown_where_a_record_has_one():
    for groups, heading in ((("", ""), ()), (("", "fitted"), ("group",))):
        records = tuple(replace(record(f"r{k}"), group=group) for k, group in enumerate(groups))
        own = Histories(records, ("declared", "before", "after"), "r0", 2)
        errors = record_errors(own)
        assert errors.columns[: errors.keys] == ("record", *heading, "channel")
        assert conditions_table(own).columns[: 1 + len(heading)] == ("record", *heading)
        assert {len(row) for row in errors.rows} == {len(errors.columns)}


def test_names_cannot_end_a_script():
    wild = '</script><script>alert("x")</script>'
    own = Histories((replace(record(), run_id=wild),), ("declared", "before", "after"), wild, 1)
    body = records_section(own).body + data_table(flat(wild, ("a",), [(wild,)]), wild)
    assert "<script>alert" not in body
    assert parsed(body).open == []
    assert data_of(body)["records"][0]["name"] == wild


def test_tables_sort_where_each_row_stands_alone():
    loose = data_table(flat("t", ("name", "x"), [("a", 1.5), ("b", 2.5)]), "t")
    assert 'class="tablebox sorts"' in loose
    assert '<td data-v="1.5">1.500</td>' in loose
    assert (
        json.loads(re.search(r'class="csv"[^>]*>(.*?)</script>', loose).group(1)) == "name,x\na,1.5\nb,2.5\n"
    )
    bound = Table(
        "t", ("name", "x"), (Group("", (("a", 1.0), ("std. error", 0.1), ("b", 2.0), ("std. error", 0.1))),)
    )
    assert 'class="tablebox"' in data_table(bound, "t")


def test_estimates_find_their_logs_or_state_why_not(identified, tmp_path):
    estimates = identified / "estimates.parquet"
    page = report(identified, tmp_path / "page.html")[0].read_text()
    assert "<h1>Identification of Constants</h1>" in page
    assert [r["name"] for r in data_of(page)["records"]] == list(log().run_ids)
    assert "SHA-256 of the logs" in page
    (identified / "logs" / "a.parquet").rename(tmp_path / "elsewhere.parquet")
    page = report(estimates, tmp_path / "page.html")[0].read_text()
    assert "The log a.parquet is not beside the estimates" in page
    page = report(estimates, tmp_path / "page.html", logs=tmp_path / "elsewhere.parquet")[0].read_text()
    assert len(data_of(page)["records"]) == 3
    write_log(identified / "logs" / "a.parquet", log(runs=3), dtype="float32")
    page = report(estimates, tmp_path / "page.html")[0].read_text()
    assert "The log a.parquet has changed since the estimates were made" in page


def test_an_identification_in_memory_gives_the_page_of_its_file(identified, tmp_path):
    result = identify(identified, GTM, METHODS)
    memory, file = (
        report(s, tmp_path / f"{k}.html")[0].read_text() for k, s in enumerate((result, identified))
    )
    assert '<section id="correlation">' in file
    assert "Correlation by the covariance that the method states" in file
    assert memory == file


LINEAR = """
schema = 1
name = "declared"
description = "the GTM's figures, Cmalpha wrong by a fifth"
[geometry]
wing_area = { value = 0.5483, unit = "m2" }
chord = { value = 0.27898, unit = "m" }
span = { value = 2.09, unit = "m" }
[mass]
mass = { value = 26.195, unit = "kg" }
inertia_yy = { value = 6.314, unit = "kg_m2" }
[derivatives]
CLalpha = { value = 4.793, std = 0.24 }
CLq = { value = 30.79, std = 9.0 }
CLde = { value = 0.48, std = 0.05 }
Cmalpha = { value = -1.4312, std = 0.07 }
Cmq = { value = -41.41, std = 6.0 }
Cmde = { value = -1.787, std = 0.09 }
"""


@pytest.mark.slow
def test_the_declared_aircraft_stands_beside_the_estimates(identified, tmp_path):
    (tmp_path / "aircraft.toml").write_text(LINEAR)
    aircraft = load(tmp_path / "aircraft.toml")
    page = report(identified, tmp_path / "page.html", aircraft=aircraft)[0].read_text()
    data = data_of(page)
    assert [m["name"] for m in data["models"]] == ["declared", *METHODS]
    residual = [
        np.sqrt(np.mean((numbers(data["records"][0]["measured"][1]) - numbers(model[1])) ** 2))
        for model in data["records"][0]["models"]
    ]
    assert residual[0] > 1.5 * residual[2]
    result = identify(identified, GTM, METHODS)
    memory = report(result, tmp_path / "memory.html", aircraft=aircraft)[0].read_text()
    assert data_of(memory) == data
    mean = result.to_frame().query("method == 'iv-f1'")["Cmalpha"].mean()
    table = shifts_table(declared_at(aircraft, result.histories()), result.to_frame())
    row = dict(zip(table.columns, next(r for r in table.rows if r[0] == "Cmalpha"), strict=True))
    assert float(row["iv-f1"]) == pytest.approx(mean, rel=1e-12)
    assert float(row["declared std"]) == pytest.approx(0.07, rel=1e-12)
    assert float(row["iv-f1 shift [declared std]"]) == pytest.approx((mean + 1.4312) / 0.07, rel=1e-9)
    files = report(identified, tmp_path / "paper.svg", aircraft=aircraft)
    assert [p.name for p in files] == [
        f"paper-{name}.svg" for name in ("intervals", "shifts", "runs", "correlation", "frequency")
    ]


@pytest.mark.slow
def test_a_campaign_in_parts_has_the_page_of_the_whole(tmp_path, monkeypatch):
    """Parts of two runs; the first eleven of 13 runs in the table of runs, twelve among the records."""
    monkeypatch.setattr(stored_campaign, "RUNS_PER_PART", 2)
    for module in (scatter_page, campaign_page):
        monkeypatch.setattr(module, "MOST_RUNS", 11)
    flown = log(runs=13)
    folder = tmp_path / "flown"
    (folder / "logs").mkdir(parents=True)
    write_log(folder / "logs" / "a.parquet", flown, dtype="float64")
    write_estimates(folder / "estimates.parquet", identify(folder, GTM, METHODS))
    truth = truth_columns(14, failed=(5,)) | {"run_id": sorted((*flown.run_ids, "r105"))}
    truth["status"] = ["failed" if run == "r105" else "ok" for run in truth["run_id"]]
    failed = truth["status"].index("failed")
    for name in ESTIMATED:
        truth[name] = [np.nan if i == failed else TRUTH[ESTIMATED.index(name)] for i in range(14)]
    pq.write_table(pa.table(truth), folder / "truth.parquet")
    (tmp_path / "aircraft.toml").write_text(LINEAR)
    aircraft = load(tmp_path / "aircraft.toml")
    sources = {"parts": folder, "whole": read_campaign(folder)}
    assert isinstance(stored_campaign.open_campaign(folder), stored_campaign.StoredCampaign)
    parts, whole = (
        report(source, tmp_path / f"{name}.html", aircraft=aircraft)[0].read_text()
        for name, source in sources.items()
    )
    assert "The first 11 of 13 runs" in parts
    assert "12 of 13 records are shown" in parts
    assert data_of(parts) == data_of(whole)
    assert without_last_digits(parts) == without_last_digits(whole)


def without_last_digits(page):
    """A page without what depends on the order of a sum: digits beyond the twelfth, and tenths of a pixel beside a tie."""
    page = re.sub(r' cx="[\d.]+"', "", page)
    return re.sub(r"-?\d+\.\d{6,}(e-?\d+)?", lambda number: f"{float(number.group()):.12g}", page)


def test_a_trace_has_its_own_aircraft(tmp_path):
    (tmp_path / "aircraft.toml").write_text(LINEAR)
    folder = trace_folder(tmp_path / "trace")
    with pytest.raises(ConfigurationError, match="--aircraft is for estimates"):
        report(folder, tmp_path / "page.html", aircraft=load(tmp_path / "aircraft.toml"))
    with pytest.raises(ConfigurationError, match="--log is for estimates"):
        report(folder, tmp_path / "page.html", logs=tmp_path)


def test_a_trace_without_records_states_how_to_get_them(tmp_path):
    folder = trace_folder(tmp_path / "old")
    (folder / FILE).unlink()
    page = report(folder, tmp_path / "page.html")[0].read_text()
    assert f"The folder of this trace holds no {FILE}; run `airtruth trace` again" in page
    with pytest.raises(StoreError, match="--format 'gif': allowed: html, pdf, png, svg"):
        report(folder, tmp_path / "page.html", "gif")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"facts": {"effect": 3, "provenance": [1]}}, ""),
        ({"shown": "another"}, ""),
        ({"channels": []}, "channels: list should have at least 1 item"),
        ({"channels": ["alpha_rad"]}, "does not hold the channels alpha_rad, q_rad_s, az_m_s2"),
        ({"models": []}, "models: list should have at least 1 item"),
    ],
)
def test_damaged_records_are_a_page_or_one_sentence(tmp_path, change, words):
    folder = trace_folder(tmp_path / "trace")
    table = pq.read_table(folder / FILE)
    document = json.loads(table.schema.metadata[METADATA])
    changed = {**document, KEY: {**document[KEY], **change}}
    pq.write_table(table.replace_schema_metadata({METADATA: json.dumps(changed)}), folder / FILE)
    with pytest.raises(StoreError, match=words) if words else nullcontext():
        report(folder, tmp_path / "page.html")


def test_uplot_is_the_published_file(monkeypatch):
    for name, digest in DIGESTS.items():
        assert hashlib.sha256(uplot(name).encode()).hexdigest() == digest
    monkeypatch.setitem(DIGESTS, "LICENSE", "0" * 64)
    uplot.cache_clear()
    with pytest.raises(StoreError, match=r"LICENSE of uPlot 1\.6\.32 in this installation is damaged"):
        uplot("LICENSE")
    monkeypatch.undo()
    uplot.cache_clear()


def test_another_archive_is_not_copied():
    with pytest.raises(SystemExit, match=r"uplot-1\.6\.32\.tgz has the digest sha512-"):
        unpacked(b"another archive")


def themes():
    """Name of a theme -> its colours, from the style sheet."""
    blocks = re.findall(r"(:root[^{]*)\{([^}]*--page[^}]*)\}", own("page.css"))
    for selector, block in blocks:
        colours = dict(re.findall(r"--([a-z]+):\s*(#[0-9a-f]{3,6})\s*[;}]", block + ";"))
        yield re.sub(r"\s+", " ", selector.strip()), colours


def luminance(colour):
    """Relative luminance of WCAG 2.2."""
    digits = colour.lstrip("#")
    digits = "".join(2 * d for d in digits) if len(digits) == 3 else digits
    channels = [int(digits[i : i + 2], 16) / 255.0 for i in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return float(np.dot((0.2126, 0.7152, 0.0722), linear))


def contrast(one, other):
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_contrast_of_black_and_white_is_21():
    assert contrast("#000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.005)  # published example of WCAG


def test_words_and_curves_stand_out_in_every_theme():
    """WCAG 2.2: 4.5 for text, 3 for graphics."""
    found = dict(themes())
    assert len(found) == 4  # light, dark by the system, dark by choice, print
    text, curves = ("ink", "quiet"), ("blue", "vermillion", "green", "purple", "orange", "sky", "grey")
    for name, colours in found.items():
        for word, ground in product(text, ("page", "panel")):
            assert contrast(colours[word], colours[ground]) >= 4.5, (name, word, ground)
        for curve in curves:
            assert contrast(colours[curve], colours["page"]) >= 3.0, (name, curve)
        assert contrast(colours["blue"], colours["page"]) >= 4.5  # links
        for bar in ("blue", "vermillion", "orange"):
            assert contrast(colours["onbar"], colours[bar]) >= 4.5, (name, bar)


def test_both_dark_themes_are_one():
    found = dict(themes())
    dark = [
        colours for name, colours in found.items() if "dark" in name or 'not([data-theme="light"])' in name
    ]
    assert len(dark) == 2
    assert dark[0] == dark[1]


def test_a_language_without_a_valid_tag_is_replaced_before_plots_are_drawn():
    """uPlot formats numbers when it is read, and `en-US@posix` raises a RangeError there."""
    page = page_of("A page", "<p>answer</p>", None, [])
    assert page.index("Intl.NumberFormat(navigator.language)") < page.index("var uPlot=")
