"""Documents in plain English whose commands, modules, files, links and make targets exist.

The rules are data: words that readers outside the project do not share, and sentences without a subject. Code is
exempt from both.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.main import get_command

import airtruth
from airtruth.checks.fault import CODES
from airtruth.cli import app
from airtruth.effects.registry import EFFECTS

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *sorted((ROOT / "aircraft").glob("*/README.md")),
]
LEDGERS = sorted((ROOT / "validation" / "blind" / "results").glob("*.md"))
"""Results of every run, whose words are those of their time."""
README_LINES = 120
"""Two screens."""

PRIVATE_WORDS = {
    "anew": "again, re-estimated, rewritten",
    "begun": "started",
    "found": "identified, estimated, located, measured",
    "judge": "assess, accept",
    "judged": "assessed, accepted",
    "nobody": "name the subject",
    "place": "location, index, column; 'instead of' for 'in place of'",
    "places": "locations",
    "said": "stated",
    "say": "state",
    "says": "states",
    "stand": "is, are listed, are stored",
    "stands": "is, is listed, is stored",
    "told": "distinguished, given",
}
"""Words with a meaning of their own in older texts of the project, and better ones."""

HEADLESS = re.compile(r"(?:What|Of (?:the|these|those|what|a|an|its|which|\d+))\b[^?]*\Z")
"""A sentence, heading or cell that begins with a clause instead of a subject. A question is a sentence."""


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


each_page = pytest.mark.parametrize("page", PAGES, ids=name_of)


def split(page: Path) -> tuple[str, list[str]]:
    """Prose of a page, with every code span as `x`, and its lines and spans of code."""
    prose: list[str] = []
    code: list[str] = []
    fenced = False
    text = re.sub(r"\A---\n.*?\n---\n", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    text = re.sub(r"<!-- generated: begin -->.*?<!-- generated: end -->", "", text, flags=re.DOTALL)
    for line in text.splitlines():
        if line.startswith((":::", ":link", ":gutter")):  # a layout of the site
            prose.append("")
        elif line.startswith("```"):
            fenced = not fenced
            prose.append("")
        elif fenced or line.startswith("    "):
            code.append(line.strip())
        elif not line.startswith("<!--"):
            prose.append(line)
    text = "\n".join(prose)
    spans = re.findall(r"`([^`]+)`", text)
    return re.sub(r"`[^`]+`", "`x`", text), code + [" ".join(span.split()) for span in spans]


def sentences(prose: str) -> Iterator[str]:
    """Sentences of paragraphs, list items, headings and table cells, without marks of emphasis."""
    blocks = re.split(r"\n\s*\n|\n(?=\s*(?:[-#|]|\d+\.) ?)|\|", prose)
    for block in blocks:
        text = re.sub(r"^[\s#>*-]*(?:\d+\. )?", "", " ".join(block.split())).replace("*", "")
        yield from (s.strip() for s in re.split(r"(?<=[.!?:;])\s+(?=[A-Z])", text) if s.strip())


def commands(code: list[str]) -> Iterator[list[str]]:
    """Words of each command line that begins with airtruth."""
    for line in code:
        words = line.removeprefix("$ ").removeprefix("!").split("#")[0].split()
        if words[:1] == ["airtruth"] and len(words) > 1 and re.match(r"[a-z-]", words[1]):
            yield [re.sub(r"[\[\].,]", "", word) for word in words[1:]]


def anchors(page: Path) -> set[str]:
    """Anchors of the headings, by GitHub's rule."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.strip().lower()).replace(" ", "-") for h in headings}


@pytest.mark.parametrize("name", ["plan", "foreign_aircraft", "measured"])
def test_results_are_stated_without_seeds_commits_and_hands(name):
    """Those belong to the ledgers of the results."""
    prose = split(ROOT / "docs" / f"{name}.md")[0]
    assert not re.findall(
        r"\bseeds? \d+|\bby hand\b(?! with)|\b(?=[0-9a-f]*[a-f])(?=[0-9a-f]*\d)[0-9a-f]{7}\b", prose
    )


@each_page
def test_no_private_words(page):
    prose = split(page)[0]
    used = {w: PRIVATE_WORDS[w] for w in re.findall(r"[a-z]+", prose.lower()) if w in PRIVATE_WORDS}
    assert not used


@each_page
def test_every_sentence_has_a_subject(page):
    assert not [s for s in sentences(split(page)[0]) if HEADLESS.match(s)]


@pytest.mark.parametrize("page", [*PAGES, *LEDGERS], ids=name_of)
def test_links_and_anchors_resolve(page):
    broken = []
    for target in re.findall(r"\]\(([^)]+)\)", split(page)[0]):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        path = page.parent / file if file else page
        if not path.exists() or (anchor and anchor not in anchors(path)):
            broken.append(target)
    assert not broken


@each_page
def test_commands_and_options_exist(page):
    wrong = []
    for words in commands(split(page)[1]):
        command = get_command(app)
        while words and hasattr(command, "commands") and not words[0].startswith("-"):
            name = words.pop(0)
            if name not in command.commands:
                wrong.append(name)
                break
            command = command.commands[name]
        else:
            options = {o for p in command.params for o in (*p.opts, *p.secondary_opts)} | {"--help"}
            wrong += [f"{command.name} {w}" for w in words if w.startswith("--") and w not in options]
    assert not wrong


@each_page
def test_modules_scripts_and_files_exist(page):
    code = split(page)[1]
    text = "\n".join(code)
    modules = re.findall(r"python -m ([\w.]+)", text)
    missing = [
        module
        for module in modules
        if not any(
            (base / module.replace(".", "/")).with_suffix(".py").is_file()
            or (base / module.replace(".", "/") / "__main__.py").is_file()
            for base in (ROOT, ROOT / "src")
        )
    ]
    known = r"(?:src|tests|scripts|studies|validation|benchmarks|docs|data|aircraft)/[\w./*{}-]+"
    for path in re.findall(rf"(?<![\w/]){known}", text):
        stem = path.rstrip(".,")
        if "NAME" not in stem and not any(ROOT.glob(stem)):
            missing.append(stem)
    assert not missing


@each_page
def test_names_in_the_package_exist(page):
    """A dotted name is a module of the package, or a word of that module."""
    missing = []
    for name in re.findall(r"(?<![\w/.-])(airtruth(?:\.\w+)+)", "\n".join(split(page)[1])):
        parts = name.split(".")
        path = ROOT / "src"
        while parts and (path / parts[0]).is_dir():
            path = path / parts.pop(0)
        if parts and (path / f"{parts[0]}.py").is_file():
            path = path / f"{parts.pop(0)}.py"
        source = path if path.is_file() else path / "__init__.py"
        if parts and not re.search(rf"\b{parts[0]}\b", source.read_text(encoding="utf-8")):
            missing.append(name)
    assert not missing


@each_page
def test_public_names_exist(page):
    names = set(re.findall(r"\bat\.(\w+)", "\n".join(split(page)[1])))
    assert names <= set(airtruth.__all__)


@each_page
def test_make_targets_exist(page):
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    shown = {line.split()[1] for line in split(page)[1] if re.match(r"make [a-z]", line)}
    assert shown <= targets


def test_readme_fits_on_two_screens():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= README_LINES


def test_glossary_defines_each_term_once():
    rows = re.findall(
        r"^\| (?!-)([^|]+) \|", (ROOT / "docs/glossary.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    heads = {"symbol, channel", "term", "symbol"}
    terms = [t.strip() for row in rows if row not in heads for t in re.sub(r" \(.*?\)", "", row).split(",")]
    assert not [t for t in terms if terms.count(t) > 1]


def test_the_rules_see_what_they_name():
    assert HEADLESS.match("What the simulator does")
    assert HEADLESS.match("Of the 300 runs all converged.")
    assert not HEADLESS.match("What remains?")
    assert list(sentences("- One. Of the two.\n# What is\n| a | Of these b |")) == [
        *("One.", "Of the two.", "What is", "a", "Of these b"),
    ]
    assert list(commands(["$ airtruth trace LOG --out DIR [--json]", "airtruth: an error"])) == [
        ["trace", "LOG", "--out", "DIR", "--json"]
    ]


def texts_of(command: object) -> Iterator[str]:
    """Help of a command, its options and its subcommands."""
    yield getattr(command, "help", None) or ""
    yield from (getattr(p, "help", None) or "" for p in getattr(command, "params", ()))
    for child in getattr(command, "commands", {}).values():
        yield from texts_of(child)


def test_help_and_effects_are_plain():
    """The rules of the documents hold for the help of every command and the text of every effect."""
    texts = list(texts_of(get_command(app)))
    for effect in EFFECTS.values():
        texts += [
            effect.explanation,
            effect.source,
            effect.distinguished_by,
            *(p.meaning for p in effect.parameters),
        ]
    wrong = [t for t in texts if set(re.findall(r"[a-z]+", t.lower())) & set(PRIVATE_WORDS)]
    wrong += [t for t in texts if any(HEADLESS.match(s) for s in sentences(t))]
    assert not wrong


def test_the_effect_of_the_page_is_one():
    page = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    exec(re.search(r"```python\n(.*?)```", page, re.DOTALL)[1], names)
    change = names["TIP_STALL"].change({"dCLalpha": -0.5, "at_alpha_rad": 0.1})
    assert change.aero[0].coefficient == "CL"


def test_every_physical_fault_is_on_the_page_of_the_log():
    page = (ROOT / "docs" / "logs.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|", page.split("## Physical checks")[1], re.MULTILINE)
    assert set(CODES) <= set(rows)
