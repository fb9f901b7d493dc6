"""Tables from synthetic campaigns: figures, comparison with the printed ones, and every format."""

import csv
import io
import json
import math
import re

import numpy as np
import pytest
import report_synthetic as synthetic

from airtruth.errors import ConfigurationError, StoreError
from airtruth.reporting import TABLES, TableSpec, evaluate, read_campaign
from airtruth.reporting import statistics as mc
from airtruth.reporting.paper import comparison, layout, published
from airtruth.reporting.paper.tables import LONG_COLUMNS, PaperEntry, all_methods, long_form, methods_of
from airtruth.reporting.partial import Sample, method_statistics
from airtruth.reporting.write import write_tables
from airtruth.table import MISSING, WIDTH, as_csv, as_latex, as_markdown, as_text

BAD = {("iv-f2", 7): "diverged", ("iv-f2", 9): "maximum iterations", ("iv-f2", 19): "maximum iterations"}


@pytest.fixture(scope="module")
def light(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaigns") / "light"
    return synthetic.paper_campaign(folder, "light", "table1", synthetic.TABLE_1, 300, seed=1)


@pytest.fixture(scope="module")
def moderate(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaigns") / "moderate"
    return synthetic.paper_campaign(
        folder, "moderate", "table3", synthetic.TABLE_3, 600, seed=2, failed=(3,), status=BAD
    )


@pytest.fixture(scope="module")
def table1(light):
    return evaluate(TABLES["table1"], read_campaign(light))


@pytest.fixture(scope="module")
def table3(moderate):
    return evaluate(TABLES["table3"], read_campaign(moderate))


def test_figures_are_those_of_the_estimates(light, table1):
    campaign = read_campaign(light)
    x = campaign.estimates["iv-lowpass"].values
    error = x[:, :6].mean(axis=0) - synthetic.TRUTH[:6]
    expected = 100.0 * np.linalg.norm(error) / np.linalg.norm(synthetic.TRUTH[:6])
    figure = table1.entries["iv-lowpass", "six", "relerr_pct"]
    assert figure.value == pytest.approx(expected, rel=1e-12)
    assert figure.published.value == 11.7
    assert table1.entries["iv-lowpass", "CLq", "mean"].value == pytest.approx(x[:, 1].mean(), rel=1e-12)
    assert table1.entries["iv-lowpass", "CLq", "std"].value == pytest.approx(x[:, 1].std(ddof=1), rel=1e-12)
    assert table1.entries["truth", "Cmq", "true"].value == -41.41
    assert table1.entries["iv-lowpass", "", "runs_used"].value == 300.0


def test_the_papers_own_figures_do_not_differ_from_the_paper(table1, table3):
    """Estimates drawn from the paper's figures: |z| > 3 is expected in 0.27 % of the comparisons."""
    zs = [e.z for t in (table1, table3) for e in t.entries.values() if e.statistic in ("mean", "std")]
    zs = np.array([z for z in zs if math.isfinite(z)])
    assert len(zs) == 2 * 8 * (6 + 4)
    assert np.sum(np.abs(zs) > 3.0) <= 3
    # the paper's figures are the exact means here, so only our half of the variance is present
    assert np.std(zs) == pytest.approx(np.sqrt(0.5), abs=0.15)


def test_differences_have_unit_variance_under_the_null():
    """Printed and own figures from two draws of one distribution: z has mean 0 and variance 1.

    300 replications of 6 + 8 + 8 figures (correlated within a replication): the standard deviation is
    known to about 4 % per statistic, 10 % allowed.
    """
    rng = np.random.default_rng(3)
    mean, std = (
        synthetic.TRUTH * np.array([0.9, 2.5, 1.5, 0.9, 0.85, 0.95, 0.9, 0.95]),
        np.abs(synthetic.TRUTH) / 5,
    )
    zs = {"mean": [], "std": [], "relerr_pct": []}
    for _ in range(300):
        paper = mean + std * rng.standard_normal((300, 8))
        ours = mean + std * rng.standard_normal((200, 8))
        printed = {
            "mean": dict(zip(published.ESTIMATED, paper.mean(axis=0), strict=True)),
            "std": dict(zip(published.ESTIMATED, paper.std(axis=0, ddof=1), strict=True)),
        }
        six = paper[:, :6].mean(axis=0) - synthetic.TRUTH[:6]
        relerr = 100.0 * np.linalg.norm(six) / np.linalg.norm(synthetic.TRUTH[:6])
        exact = {k: {n: published.Printed(v, 1e-9) for n, v in d.items()} for k, d in printed.items()}
        column = published.PublishedColumn(
            "x", ("x",), exact["mean"], exact["std"], published.Printed(relerr, 1e-9), {}, None
        )
        sample = Sample(
            np.tile(synthetic.TRUTH, (200, 1)),
            np.ones(200, dtype=bool),
            ours,
            ours,
            ours,
            np.ones(200, dtype=bool),
            np.zeros(200),
            ("",) * 200,
        )
        s = method_statistics(lambda one=sample: [{"": one}])[""]
        beside = comparison.published_figures(column, 300, s)
        for j, name in enumerate(published.ESTIMATED):
            zs["mean"].append(
                PaperEntry("x", name, "mean", s.mean.value[j], s.mean.se[j], *beside[name, "mean"]).z
            )
            zs["std"].append(
                PaperEntry("x", name, "std", s.std.value[j], s.std.se[j], *beside[name, "std"]).z
            )
        own = 100.0 * s.relerr.value, 100.0 * s.relerr.se
        zs["relerr_pct"].append(PaperEntry("x", "six", "relerr_pct", *own, *beside["six", "relerr_pct"]).z)
    for statistic, values in zs.items():
        tolerance = 0.15 if statistic == "relerr_pct" else 0.1
        assert np.mean(values) == pytest.approx(0.0, abs=0.2), statistic
        assert np.std(values) == pytest.approx(1.0, abs=tolerance), statistic


def test_standard_errors_of_the_printed_figures_by_hand(table1):
    mean = table1.entries["ls", "CLalpha", "mean"]
    assert mean.published_se == pytest.approx(0.418 / math.sqrt(300.0), rel=1e-12)
    assert table1.entries["ls", "CLalpha", "std"].published_se == pytest.approx(
        0.418 / math.sqrt(598.0), rel=1e-12
    )
    spread = math.sqrt(mean.se**2 + mean.published_se**2 + 1e-6 / 12.0)  # printed to 0.001
    assert mean.z == pytest.approx((mean.value - 4.101) / spread, rel=1e-12)
    # RMSE from mean 4.101, truth 4.793, s = 0.418 with n - 1
    rmse = table1.entries["ls", "CLalpha", "rmse"].published.value
    assert rmse == pytest.approx(math.sqrt(0.692**2 + 0.418**2 * 299 / 300), rel=1e-12)
    ratio = table1.entries["ls", "six", "relerr_ratio"]
    assert ratio.published.value == pytest.approx(111 / 11.7, rel=1e-12)
    a, b = (table1.entries[m, "six", "relerr_pct"] for m in ("ls", "iv-lowpass"))
    products = table1.statistics["ls"].products  # the influences have mean zero
    common = products["iv-lowpass"] / math.sqrt(
        products["ls"] * table1.statistics["iv-lowpass"].products["iv-lowpass"]
    )
    terms = np.array([a.published_se / 111, -b.published_se / 11.7])
    relative = math.sqrt(terms @ np.array([[1.0, common], [common, 1.0]]) @ terms)
    assert ratio.published_se == pytest.approx(111 / 11.7 * relative, rel=1e-9)


def test_relerr_standard_error_of_the_paper_without_correlation(table1):
    stats = table1.statistics["ls"]
    column = published.load().tables["table1"].column("ls")
    independent = mc.MethodStatistics(**{**stats.__dict__, "correlation": np.eye(6)})
    _, se = comparison.published_figures(column, 300, independent)["six", "relerr_pct"]
    bias = np.array([-0.692, 57.67, 0.58, 0.22, 3.292, 0.029])
    std = np.array([0.418, 45.04, 0.702, 0.066, 3.465, 0.087])
    size = np.linalg.norm([4.793, 30.79, 0.48, -1.789, -41.41, -1.787])
    expected = 100.0 * np.linalg.norm(bias / np.linalg.norm(bias) * std) / math.sqrt(300.0) / size
    assert se == pytest.approx(expected, rel=1e-12)


def test_a_shifted_method_is_marked(tmp_path):
    values = synthetic.draw_paper("table1", synthetic.TABLE_1, 300, seed=4)
    values["iv-lowpass"][:, 4] += 2.0  # Cmq; two standard deviations are 24 standard errors of the difference
    folder = synthetic.write_campaign(
        tmp_path / "light", synthetic.truth_columns(300), synthetic.estimate_columns(values)
    )
    table = evaluate(TABLES["table1"], read_campaign(folder))
    assert table.entries["iv-lowpass", "Cmq", "mean"].differs
    assert not table.entries["iv-lowpass", "Cmq", "std"].differs
    row = next(r for r in layout.lay_out(table).groups[0].rows if r[0] == "Cmq")
    assert re.fullmatch(r"-34\.\d\d\* \(\d\.\d\d\)", str(row[3]))
    assert not any("*" in str(cell) for cell in row[2:3] + row[4:])


def test_runs_are_accounted_for(table3):
    counts = {k: table3.entries["iv-f2", "", f"runs{k}"].value for k in ("", "_used", "_diverged")}
    assert counts == {"": 600.0, "_used": 596.0, "_diverged": 1.0}
    text = as_text(layout.lay_out(table3))
    assert re.search(r"^not converged +0 +0 +0 +2$", text, re.MULTILINE)
    assert re.search(r"^failed to fly +1 +1 +1 +1$", text, re.MULTILINE)
    assert "Not used of iv-f2: 2 'maximum iterations', 1 'diverged'." in text
    assert "Median (scaled median absolute deviation)" in text


def test_medians_are_left_out_where_nothing_needs_them(table1):
    assert "Median" not in as_text(layout.lay_out(table1))


def test_only_methods_in_the_estimates_are_shown(moderate, light):
    spec = TableSpec("t", "T", "moderate", "table3", ("filter-error", "iv-f1"), "iv-lowpass")
    table = evaluate(spec, read_campaign(moderate))
    assert table.methods == ("iv-f1",)
    assert "Not among the estimates of this campaign: filter-error." in as_text(layout.lay_out(table))


def test_a_method_without_a_printed_column_stands_beside_the_others(light):
    spec = TableSpec("t", "T", "light", "table3", ("ls", "iv-reference"), "ls")  # Table 3 has no IV (de_r)
    table = evaluate(spec, read_campaign(light))
    assert table.entries["iv-reference", "CLq", "mean"].published is None
    assert math.isnan(table.entries["iv-reference", "CLq", "mean"].z)
    row = next(r for r in layout.lay_out(table).groups[0].rows if r[0] == layout.PUBLISHED)
    assert row[-1] == MISSING


def test_a_table_without_a_paper_has_no_published_rows(light):
    campaign = read_campaign(light)
    text = as_text(layout.lay_out(evaluate(all_methods(campaign), campaign)))
    assert "published" not in text
    assert "*" not in text


def test_notes_state_the_gust_settings_as_fly_writes_them(tmp_path):
    folder = synthetic.paper_campaign(tmp_path / "light", "light", "table1", ("ls",), 20, seed=1)
    gust = {"level": "light", "factor": {"value": 1.75}, "start": {"normal": [0, 2], "unit": None}}
    (folder / "campaign.json").write_text(json.dumps({"name": "light", "gust": gust}))
    table = evaluate(TABLES["table1"], read_campaign(folder))
    assert "gust: level light, factor 1.75, start normal [0, 2]." in as_text(layout.lay_out(table))


@pytest.mark.parametrize("which", ["table1", "table3"])
def test_formats_hold_every_row(which, request):
    grid = layout.lay_out(request.getfixturevalue(which))
    rows = sum(len(group.rows) for group in grid.groups)
    columns = len(grid.columns)

    plain = as_text(grid).splitlines()
    assert max(map(len, plain)) <= WIDTH
    for method in grid.columns[2:]:
        assert any(method.split("-")[-1] in line for line in plain)

    table = [line for line in as_markdown(grid).splitlines() if line.startswith("|")]
    assert len(table) == 2 + len(grid.groups) + rows
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in table} == {columns + 1}

    tex = as_latex(grid, "x")
    body = [line for line in tex.splitlines() if line.endswith(r"\\") and "multicolumn" not in line]
    assert {len(re.findall(r"(?<!\\)&", line)) for line in body} == {columns - 1}
    assert len(body) == rows + 2  # a header for each of the two LaTeX tables
    assert tex.count(r"\begin{") == tex.count(r"\end{")
    depth = np.cumsum([{"{": 1, "}": -1}[c] for c in re.findall(r"(?<!\\)[{}]", tex)])
    assert depth.min() >= 0
    assert depth[-1] == 0
    assert not re.search(r"(?<!\\)[%#]", tex)


def test_text_splits_methods_that_do_not_fit(table1):
    text = as_text(layout.lay_out(table1))
    assert text.count("RelErr [%] (standard error)") == 2
    assert text.index("iv-reference") < text.index("iv-actuator")


def test_csv_gives_back_every_figure(table3):
    rows = list(csv.DictReader(io.StringIO(as_csv(long_form(table3)))))
    assert tuple(rows[0]) == LONG_COLUMNS
    assert len(rows) == len(table3.entries)
    for row, entry in zip(rows, table3.entries.values(), strict=True):
        key = (row["method"], row["parameter"], row["statistic"])
        assert key == (entry.method, entry.parameter, entry.statistic)
        for name, expected in (
            ("value", entry.value),
            ("standard_error", entry.se),
            ("published", entry.published.value if entry.published else math.nan),
            ("difference_in_standard_errors", entry.z),
        ):
            assert (float(row[name]) if row[name] else math.nan) == pytest.approx(
                expected, nan_ok=True, rel=1e-15
            )


def test_write_tables(light, moderate, tmp_path):
    written = write_tables([light, moderate], tmp_path / "deep" / "out")
    names = [f"{t}.{s}" for t in ("table1", "table2", "table3") for s in ("md", "csv", "tex")]
    assert [p.name for p in written.paths] == names
    assert sorted(p.name for p in (tmp_path / "deep" / "out").iterdir()) == sorted(names)
    assert "Skipped" not in written.text
    before = [p.read_bytes() for p in written.paths]
    again = write_tables([light, moderate], tmp_path / "deep" / "out")
    assert [p.read_bytes() for p in again.paths] == before


def test_a_table_without_its_campaign_is_skipped_and_said(moderate, tmp_path):
    written = write_tables([moderate], tmp_path)
    assert [p.name for p in written.paths] == ["table3.md", "table3.csv", "table3.tex"]
    assert (
        f"Skipped table1: no campaign 'light' or 'light-...' among 'moderate' ({moderate})." in written.text
    )


def test_a_table_without_any_of_its_methods_is_skipped_and_said(tmp_path):
    values = {"filter-error": synthetic.draw_paper("table1", ("ls",), 20, seed=1)["ls"]}
    folder = synthetic.write_campaign(
        tmp_path / "light", synthetic.truth_columns(20), synthetic.estimate_columns(values)
    )
    written = write_tables([folder], tmp_path / "out")
    assert [p.name for p in written.paths] == [f"methods-light.{s}" for s in ("md", "csv", "tex")]
    assert f"Skipped table1: no estimate by ls, iv-lowpass, {'iv-reference'}" in written.text


def test_a_variant_gives_the_tables_under_its_own_name(tmp_path):
    folder = synthetic.paper_campaign(tmp_path / "x", "light-2x", "table1", ("ls", "iv-lowpass"), 30, seed=5)
    written = write_tables([folder], tmp_path / "out")
    assert [p.name for p in written.paths if p.suffix == ".md"] == ["table1-2x.md", "table2-2x.md"]


def test_further_tables_are_added_by_describing_them(light, tmp_path):
    spec = TableSpec("mine", "Mine", "light", "table1", ("iv-lowpass", "ls"), "ls")
    written = write_tables([light], tmp_path, [spec])
    assert "mine.csv" in {p.name for p in written.paths}
    assert "methods-light.csv" in {p.name for p in written.paths}  # its other methods are in no table


def test_methods_of_a_campaign_are_those_of_its_tables_each_once():
    both = (
        "ls",
        "iv-lowpass",
        "iv-reference",
        "iv-reference-regressor",
        "iv-actuator",
        "iv-actuator-regressor",
    )
    assert methods_of("light") == methods_of("light-fit") == (*both, "iv-f1", "iv-f2")
    assert methods_of("moderate-fit") == ("ls", "iv-lowpass", "iv-f1", "iv-f2")
    assert methods_of("mine") == ()


def test_wrong_use_is_refused(light, tmp_path):
    with pytest.raises(ConfigurationError, match="no campaign folder is given"):
        write_tables([], tmp_path)
    with pytest.raises(ConfigurationError, match="are both campaign 'light'"):
        write_tables([light, light], tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="a file of that name is in the way"):
        write_tables([light], tmp_path / "file")


def test_methods_beyond_the_paper_are_further_columns_with_ratios(tmp_path):
    """Errors of filter-error are half those of iv-f1, run by run: so is the RMSE, and no printed figure beside."""
    values = synthetic.draw_paper("table3", synthetic.TABLE_3, 40, seed=9)
    values["filter-error"] = synthetic.TRUTH + 0.5 * (values["iv-f1"] - synthetic.TRUTH)
    folder = synthetic.write_campaign(
        tmp_path / "moderate", synthetic.truth_columns(40), synthetic.estimate_columns(values)
    )
    table = evaluate(TABLES["table3"], read_campaign(folder))
    assert table.methods == (*synthetic.TABLE_3, "filter-error")
    assert table.absent == ()
    assert table.entries["filter-error", "Cmq", "mean"].published is None
    grid = layout.lay_out(table)
    ratios = next(g for g in grid.groups if g.heading == "The same / iv-f1")
    assert {str(row[-1]) for row in ratios.rows} == {"0.50"}
