"""Tables and pages of campaigns with lateral estimates, beside numpy's figures; a folder with both motions."""

import csv
import io

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import report_synthetic as synthetic
from report_html import read_page

import airtruth as at
from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.identification import identify
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.reporting import (
    TABLES,
    FlownCampaign,
    evaluate,
    read_campaign,
    report,
    stored_campaign,
    write_tables,
)
from airtruth.reporting.pages.motions import stacked
from airtruth.reporting.paper.tables import all_methods
from airtruth.table import flat
from validation.affine_lateral import GTM, NAMES, THETA, fly, log_of, pitching

TRUTH = np.array([*THETA, 5.985, 0.12, -5.435, -0.0367])
UNDETERMINED = {"CYp", "CYda", "Cnda"}
RUNS, FAILED = 30, (4, 11)
METHODS = ("ls", "iv-lowpass")


def draw(seed, wide=1.0):
    """Method -> (runs, 19) estimates about the truth; the undetermined three scatter by ``wide`` times their size."""
    rng = np.random.default_rng(seed)
    spread = 0.03 * np.abs(TRUTH)
    spread[[NAMES.index(name) for name in UNDETERMINED]] *= 30.0 * wide
    return {
        m: TRUTH * (1.01 + 0.02 * k) + spread * rng.standard_normal((RUNS, 19)) for k, m in enumerate(METHODS)
    }


def truth_columns():
    rows = {
        "run_id": synthetic.run_names(RUNS),
        "status": ["failed" if i in FAILED else "ok" for i in range(RUNS)],
    }
    for name, value in zip(LATERAL.estimated, TRUTH, strict=True):
        rows[name] = [np.nan if i in FAILED else value for i in range(RUNS)]
    return rows


def estimate_columns(values, half_width=0.05):
    rows = [(m, i) for i in range(RUNS) for m in values if i not in FAILED]
    columns = {
        "run_id": [synthetic.run_names(RUNS)[i] for _, i in rows],
        "method": [m for m, _ in rows],
        "converged": [(m, i) != ("iv-lowpass", 7) for m, i in rows],
        "iterations": [0 if m == "ls" else 2 + i % 2 for m, i in rows],
        "status": ["maximum iterations" if (m, i) == ("iv-lowpass", 7) else "converged" for m, i in rows],
    }
    for j, name in enumerate(LATERAL.estimated):
        x = np.array([values[m][i, j] for m, i in rows])
        half = np.full(len(x), half_width * abs(TRUTH[j]))
        columns |= {name: x, f"{name}_std": half / 1.96, f"{name}_lower": x - half, f"{name}_upper": x + half}
    return columns


def lateral_campaign(folder, values, name="side", truth=None):
    folder.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(truth or truth_columns()), folder / "truth.parquet")
    pq.write_table(pa.table(estimate_columns(values)), folder / "estimates-lateral.parquet")
    (folder / "campaign.json").write_text(f'{{"name": "{name}", "title": "Doublets", "runs": {RUNS}}}')
    return folder


@pytest.fixture(scope="module")
def values():
    return draw(3)


@pytest.fixture
def folder(values, tmp_path):
    return lateral_campaign(tmp_path / "side", values)


@pytest.fixture
def both(tmp_path):
    """A folder with the estimates of both motions."""
    made = synthetic.paper_campaign(tmp_path / "both", "both", "table1", METHODS, RUNS, seed=1, failed=FAILED)
    shown = synthetic.truth_columns(RUNS, FAILED) | truth_columns()
    pq.write_table(pa.table(shown), made / "truth.parquet")
    pq.write_table(pa.table(estimate_columns(draw(4))), made / "estimates-lateral.parquet")
    return made


def used(values, method):
    kept = [i for i in range(RUNS) if i not in FAILED and (method, i) != ("iv-lowpass", 7)]
    return values[method][kept]


def test_the_figures_are_those_of_numpy_and_relerr_leaves_out_the_undetermined(folder, values):
    campaign = read_campaign(folder, LATERAL)
    table = evaluate(all_methods(campaign), campaign)
    assert table.name == "lateral-side"
    scored = [j for j, name in enumerate(NAMES) if name not in UNDETERMINED]
    for method in METHODS:
        own = used(values, method)
        for j, name in enumerate(LATERAL.estimated):
            for statistic, expected in (
                ("mean", own[:, j].mean()),
                ("std", own[:, j].std(ddof=1)),
                ("rmse", np.sqrt(np.mean((own[:, j] - TRUTH[j]) ** 2))),
                ("coverage_pct", 100.0 * np.mean(np.abs(own[:, j] - TRUTH[j]) <= 0.05 * abs(TRUTH[j]))),
            ):
                assert table.entries[method, name, statistic].value == pytest.approx(expected, rel=1e-10)
        bias = own.mean(axis=0) - TRUTH
        relerr = np.linalg.norm(bias[scored]) / np.linalg.norm(TRUTH[scored])
        assert table.entries[method, "twelve", "relerr_pct"].value == pytest.approx(100.0 * relerr, rel=1e-9)
        for j, name in enumerate(LATERAL.modal, start=15):
            expected = 100.0 * abs(bias[j] / TRUTH[j])
            assert table.entries[method, name, "relerr_pct"].value == pytest.approx(expected, rel=1e-8)
        counts = table.statistics[method].counts
        assert (counts.failed_to_fly, counts.used) == (2, 28 if method == "ls" else 27)
        assert table.statistics[method].correlation.shape == (15, 15)
    assert table.statistics["iv-lowpass"].counts.reasons == {"maximum iterations": 1}


def test_undetermined_derivatives_change_no_score(tmp_path):
    made = []
    for wide in (1.0, 50.0):
        campaign = read_campaign(lateral_campaign(tmp_path / str(wide), draw(3, wide)), LATERAL)
        made.append(evaluate(all_methods(campaign), campaign))
    for key in (
        ("ls", "twelve", "relerr_pct"),
        ("ls", "twelve", "relerr_floor_pct"),
        ("ls", "twelve", "relerr_ratio"),
    ):
        assert made[0].entries[key].value == pytest.approx(made[1].entries[key].value, rel=1e-9)
        assert made[0].entries[key].se == pytest.approx(made[1].entries[key].se, rel=1e-6, nan_ok=True)


def test_parts_are_the_whole(folder, monkeypatch):
    monkeypatch.setattr(stored_campaign, "RUNS_PER_PART", 7)
    (opened,) = stored_campaign.open_campaigns(folder)
    whole = read_campaign(folder, LATERAL)
    assert isinstance(opened, stored_campaign.StoredCampaign)
    assert opened.motion is whole.motion is LATERAL
    for method in METHODS:
        for name in ("truth", "values", "lower", "upper", "converged", "iterations"):
            joined = np.concatenate([getattr(part.sample(method), name) for part in opened.parts()])
            np.testing.assert_array_equal(joined, getattr(whole.sample(method), name))


def test_the_files_of_a_lateral_campaign(folder, tmp_path):
    written = write_tables([folder], tmp_path / "out")
    assert [path.name for path in written.paths] == [
        "lateral-side.md",
        "lateral-side.csv",
        "lateral-side.tex",
    ]
    assert "Skipped" not in written.text
    assert "Lateral-directional motion, all methods - campaign 'side', 30 runs" in written.text
    words = " ".join(written.text.split())
    assert "RelErr = ||mean - truth||/||truth|| over the twelve derivatives" in words
    assert "RelErr leaves out CYp, CYda and Cnda, which a record does not determine" in words
    rows = list(csv.DictReader(io.StringIO(written.paths[1].read_text())))
    assert {row["parameter"] for row in rows} == {*LATERAL.estimated, "twelve", ""}
    true = {row["parameter"]: float(row["value"]) for row in rows if row["statistic"] == "true"}
    np.testing.assert_allclose([true[name] for name in LATERAL.estimated], TRUTH, rtol=1e-12)
    latex = written.paths[2].read_text()
    for symbol in (r"$C_{n\delta_r}$", r"$\omega_n$, Dutch roll [rad/s]", r"$\lambda$, spiral [1/s]"):
        assert symbol in latex


def test_decimals_follow_the_truth(folder, tmp_path):
    shown = write_tables([folder], tmp_path / "out").text
    for words in ("-1.016", "-0.003500", "-0.03670", "5.985"):
        assert words in shown


def test_a_folder_with_both_motions_gives_both_tables(both, tmp_path):
    written = write_tables([both], tmp_path / "out")
    names = [path.stem for path in written.paths[::3]]
    assert names == ["methods-both", "lateral-both"]
    (both / "estimates-lateral.parquet").unlink()
    alone = write_tables([both], tmp_path / "alone")
    assert [path.read_bytes() for path in alone.paths] == [path.read_bytes() for path in written.paths[:3]]


def test_a_table_of_the_paper_shows_no_lateral_estimates(values, tmp_path):
    folder = lateral_campaign(tmp_path / "light", values, name="light")
    written = write_tables([folder], tmp_path / "out")
    assert [path.stem for path in written.paths[::3]] == ["lateral-light"]
    with pytest.raises(ConfigurationError, match="both campaign 'light'"):
        write_tables([folder, folder], tmp_path / "out")
    assert all(spec.motion is LONGITUDINAL for spec in TABLES.values())


def test_a_truth_without_the_lateral_derivatives_is_one_error(values, tmp_path):
    folder = lateral_campaign(tmp_path / "a", values, truth=synthetic.truth_columns(RUNS, FAILED))
    with pytest.raises(LogError, match=r"truth\.parquet: column 'CYbeta' is missing"):
        write_tables([folder], tmp_path / "out")
    (folder / "truth.parquet").unlink()
    with pytest.raises(StoreError, match=r"truth\.parquet: missing; `airtruth fly"):
        write_tables([folder], tmp_path / "out")
    folder = lateral_campaign(tmp_path / "b", values)
    few = {name: column[:20] for name, column in estimate_columns(values).items()}
    pq.write_table(pa.table(few), folder / "estimates-lateral.parquet")
    with pytest.raises(LogError, match=r"has no estimate; .*--motion lateral`"):
        read_campaign(folder, LATERAL)


def test_the_page_of_a_lateral_campaign(folder, tmp_path):
    paths = report(folder, tmp_path / "page.html")
    page = paths[0].read_text()
    assert read_page(paths[0])
    for words in (
        "lateral-side",
        "Estimates against the truth",
        "norm of the mean error of the twelve derivatives",
        "A record does not determine CYp, CYda and Cnda",
        "rates as p b/(2V)",
    ):
        assert words in page
    assert "elevator trailing edge" not in page
    rows = list(csv.DictReader(io.StringIO(paths[1].read_text())))
    assert {row["table"] for row in rows} == {"lateral-side"}


def test_the_page_of_both_motions_has_the_parts_of_each(both, tmp_path):
    together = report(both, tmp_path / "both.html")
    page = together[0].read_text()
    read = read_page(together[0])
    assert len(set(read.ids)) == len(read.ids)
    assert page.index("<h2>Longitudinal motion</h2>") < page.index("<h2>Lateral-directional motion</h2>")
    rows = list(csv.DictReader(io.StringIO(together[1].read_text())))
    assert {(row["group"], row["table"]) for row in rows} == {
        ("Longitudinal motion", "methods-both"),
        ("Lateral-directional motion", "lateral-both"),
    }
    figures = report(both, tmp_path / "f.svg")
    assert {"f-longitudinal-intervals.svg", "f-lateral-intervals.svg"} <= {path.name for path in figures}
    (both / "estimates-lateral.parquet").unlink()
    alone = report(both, tmp_path / "alone.html")
    assert together[2].read_text().startswith(alone[2].read_text())


def test_a_result_in_memory_shows_both_motions(tmp_path):
    log = log_of(fly(q=pitching, runs=2, gust=0.4, seed=2), elevator_degrees=2.0)
    result = at.identify(log, at.load_aircraft("gtm"), ["ls"], force=True)
    assert list(result.motions) == ["longitudinal", "lateral"]
    paths = at.report(result, tmp_path / "a.html")
    page = paths[0].read_text()
    assert "<h2>Lateral-directional motion</h2>" in page
    rows = {row["parameter"]: row for row in csv.DictReader(io.StringIO(paths[1].read_text()))}
    for motion, own in result.motions.items():
        mean = own.of("ls").theta.mean(axis=0)
        names = own.settings.motion.parameters
        np.testing.assert_allclose(
            [float(rows[name]["ls"]) for name in names], mean, rtol=1e-12, err_msg=motion
        )


def test_stacked_tables_keep_their_cells():
    one = flat("one", ("name", "ls"), [("a", 1.0)])
    two = flat("two", ("name", "iv"), [("b", 2.0)])
    table = stacked("both", {"First": one, "Second": two})
    assert table.columns == ("name", "ls", "iv")
    assert [(group.heading, group.rows) for group in table.groups] == [
        ("First", (("a", 1.0, ""),)),
        ("Second", (("b", "", 2.0),)),
    ]


def test_a_campaign_is_longitudinal_by_default(tmp_path):
    made = synthetic.paper_campaign(tmp_path / "c", "c", "table1", ("ls",), 5, seed=1)
    assert isinstance(read_campaign(made), FlownCampaign)
    assert read_campaign(made).motion is LONGITUDINAL


def test_lateral_identification_of_a_log_gives_rows_that_tables_read(tmp_path):
    """Estimates as `airtruth identify` writes them, beside a truth of the flown aircraft."""
    from airtruth.identification import write_estimates

    result = identify(log_of(fly(q=pitching, runs=4, gust=0.2, seed=9)), GTM, ["ls"], motion=LATERAL)
    write_estimates(tmp_path / "estimates-lateral.parquet", result)
    truth = {"run_id": [f"r{k}" for k in range(4)], "status": ["ok"] * 4}
    truth |= {name: [value] * 4 for name, value in zip(LATERAL.estimated, TRUTH, strict=True)}
    pq.write_table(pa.table(truth), tmp_path / "truth.parquet")
    (opened,) = stored_campaign.open_campaigns(tmp_path)
    table = evaluate(all_methods(opened), opened)
    theta = result.of("ls").theta
    for j, name in enumerate(NAMES):
        assert table.entries["ls", name, "mean"].value == pytest.approx(theta[:, j].mean(), rel=1e-12)
