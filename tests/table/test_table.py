"""The table and its writers: the same cells in every format, by hand."""

import csv
import io
import json
import math
import re
from html.parser import HTMLParser

import pytest

from airtruth.errors import StoreError
from airtruth.table import (
    MISSING,
    Group,
    Interval,
    Number,
    Pair,
    Table,
    Uncertain,
    as_csv,
    as_html,
    as_json,
    as_latex,
    as_markdown,
    as_text,
    fixed,
    flat,
    significant,
    to_frame,
    write_table,
)

PLAIN = flat(
    "Two | estimates",
    ("name", "unit", "value", "runs"),
    (("Cm_q", "-", -41.4123, 3), ("a*b", "rad/s", math.nan, 12)),
    ("one note", "R&D: 5 % of $x$"),
)
GROUPED = Table(
    "Grouped",
    ("", "true", "iv-f1"),
    (
        Group(
            "Mean (std)", (("Cmq", Number(-41.4, 2), Pair(Number(-40.123456, 2, mark="*"), Number(2.5, 1))),)
        ),
        Group("Further", (("  six", "", MISSING),), supplement=True),
    ),
    keys=2,
)


@pytest.mark.parametrize(
    ("value", "decimals", "expected"),
    [
        (1.23456, 3, "1.235"),
        (-41.41, 2, "-41.41"),
        (math.nan, 2, "-"),
        (math.inf, 2, "-"),
        (99999.4, 0, "99999"),
        (1234567.0, 2, "1.23e+06"),
    ],
)
def test_fixed_decimals(value, decimals, expected):
    assert fixed(value, decimals) == str(Number(value, decimals)) == expected


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.020522, "0.0205"),
        (1606.3, "1606"),
        (2.45e-109, "2.45e-109"),
        (0.0, "0.00"),
        (math.inf, "-"),
        (-1.786, "-1.79"),
    ],
)
def test_significant_digits(value, expected):
    assert significant(value) == str(Number(value, digits=3)) == expected


def test_text_aligns_words_to_the_left_and_numbers_to_the_right():
    assert as_text(PLAIN).splitlines() == [
        "Two | estimates",
        "===============",
        "",
        "name  unit    value  runs",
        "-" * 25,
        "Cm_q  -      -41.41     3",
        "a*b   rad/s       -    12",
        "-" * 25,
        "- one note",
        "- R&D: 5 % of $x$",
    ]


def test_text_repeats_the_keys_where_columns_continue_below():
    wide = flat("wide", ("name", *(f"column-{i}" for i in range(9))), [("x", *range(9))])
    lines = as_text(wide, width=40).splitlines()
    assert max(map(len, lines)) <= 40
    assert sum(line.startswith("x ") for line in lines) == 3
    assert " ".join(lines).count("column-8") == 1


def test_a_table_of_keys_alone_has_one_block():
    assert as_text(flat("keys", ("name",), [("x",)])).splitlines()[3:6] == ["name", "----", "x"]


def test_markdown():
    assert as_markdown(GROUPED).splitlines() == [
        "### Grouped",
        "",
        "|  | true | iv-f1 |",
        "| :--- | ---: | ---: |",
        "| **Mean (std)** |  |  |",
        r"| Cmq | -41.40 | -40.12\* (2.5) |",
        "| **Further** |  |  |",
        "| &emsp;six |  | - |",
    ]
    assert as_markdown(PLAIN).splitlines()[0] == r"### Two \| estimates"


def test_latex_puts_supplements_into_a_second_table():
    tex = as_latex(GROUPED, "g", {"Cmq": "$C_{mq}$"})
    assert tex.count(r"\begin{table}") == 2
    assert r"$C_{mq}$ & $-$41.40 & $-$40.12$^{*}$ (2.5) \\" in tex
    assert r"\label{tab:g-further}" in tex
    assert r"\quad six &  & - \\" in tex
    plain = as_latex(PLAIN, "p")
    assert r"\begin{tabular}{llrr}" in plain
    assert r"R\&D: 5 \% of \$x\$\par" in plain
    assert r"a$^{*}$b & rad/s & - & 12 \\" in plain


def test_csv_and_json_and_pandas_keep_every_digit():
    rows = list(csv.reader(io.StringIO(as_csv(PLAIN))))
    assert rows == [
        ["name", "unit", "value", "runs"],
        ["Cm_q", "-", "-41.4123", "3"],
        ["a*b", "rad/s", "", "12"],
    ]
    facts = json.loads(as_json(PLAIN))
    assert facts["rows"][1] == {"name": "a*b", "unit": "rad/s", "value": None, "runs": 12}
    assert facts["notes"][0] == "one note"
    frame = to_frame(GROUPED)
    assert list(frame.columns) == ["group", "label", "true", "iv-f1", "iv-f1 (in brackets)"]
    assert frame.loc[0, "iv-f1"] == -40.123456
    assert frame.loc[0, "iv-f1 (in brackets)"] == 2.5
    assert PLAIN.to_frame()["runs"].tolist() == [3, 12]


def test_an_interval_is_one_cell_for_people_and_three_columns_for_programs():
    table = flat(
        "t",
        ("name", "ls"),
        [("Cmq", Interval(Number(-41.4), Number(-42.0), Number(-40.8))), ("zeta", MISSING)],
    )
    assert str(table.rows[0][1]) == "-41.40 [-42.00, -40.80]"
    assert as_csv(table) == "name,ls,ls (lower),ls (upper)\nCmq,-41.4,-42.0,-40.8\nzeta,-,,\n"


class Tags(HTMLParser):
    """Tags that are opened and closed, and the words between them."""

    def __init__(self):
        super().__init__()
        self.open, self.words, self.count = [], [], {}

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.count[tag] = self.count.get(tag, 0) + 1

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


@pytest.mark.parametrize("table", [PLAIN, GROUPED])
def test_html_is_well_formed_and_escaped(table):
    page = Tags()
    page.feed(as_html(table))
    assert page.open == []
    assert page.count["td"] == len(table.rows) * len(table.columns)
    assert page.words[0] == table.title
    assert as_html(flat("<b>", ("<i>",), [("<u>",)], ["<s>"])).count("&lt;") == 4
    assert table._repr_html_() == as_html(table)


def test_wrong_tables_are_refused():
    with pytest.raises(ValueError, match="does not have 2 cells"):
        flat("t", ("a", "b"), [("x",)])
    with pytest.raises(ValueError, match="two columns have the same name"):
        flat("t", ("a", "a"), [("x", "y")])


def test_files(tmp_path):
    long = flat("long", ("name", "value"), [("Cmq", -40.123456)])
    paths = write_table(GROUPED, tmp_path / "new", "mine", long)
    assert [p.name for p in paths] == ["mine.md", "mine.csv", "mine.tex"]
    assert paths[0].read_text() == as_markdown(GROUPED)
    assert paths[1].read_text() == "name,value\nCmq,-40.123456\n"
    assert re.search(r"\\label\{tab:mine\}", paths[2].read_text())
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="not written"):
        write_table(GROUPED, tmp_path / "file", "mine")


def test_an_estimate_has_its_standard_error_in_every_format():
    cell = Uncertain(Number(4.5259), Number(0.02201, digits=2))
    table = flat(
        "t", ("name", "x"), [("CLalpha", cell), ("CLq", Uncertain(Number(31.8), Number(float("nan"))))]
    )
    assert [str(row[1]) for row in table.rows] == ["4.526 +- 0.022", "31.80"]
    assert "4.526 \u00b1 0.022" in as_html(table)
    assert r"4.526 $\pm$ 0.022" in as_latex(table, "t")
    frame = table.to_frame()
    assert list(frame.columns) == ["name", "x", "x (standard error)"]
    assert frame["x (standard error)"].iloc[0] == 0.02201
    assert math.isnan(frame["x (standard error)"].iloc[1])
