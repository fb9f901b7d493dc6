"""Run every command and the Python example of a document in an empty folder, and compare the output with what it shows.

    python -m scripts.readme [DOCUMENT] [--wheel] [--update]

`--wheel` builds the wheel and the sdist, builds a wheel from the sdist, installs it with pip into an environment of
its own, and runs the document from there. A line `...` in a block stands for any lines.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""
NUMBER: Final = re.compile(r" *[-+]?[\d.]+(?:e[-+]?\d+)?")
"""A number and the blanks before it, which align a table."""
ELISION: Final = "..."
"""Line that stands for any lines."""


@dataclass(frozen=True)
class Step:
    """A command or a Python example of a document.

    Attributes
    ----------
    words : words of the command after the program; empty for Python.
    code : Python source; empty for a command.
    shown : lines that the document shows below the command.
    """

    words: tuple[str, ...] = ()
    code: str = ""
    shown: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """The command, or the first line of the code."""
        return "airtruth " + " ".join(self.words) if self.words else self.code.splitlines()[0]


def steps(text: str) -> Iterator[Step]:
    """The commands of the console blocks and the Python blocks of a document, in their order.

    Parameters
    ----------
    text : the document.
    """
    for kind, block in re.findall(r"```(console|python)\n(.*?)```", text, re.DOTALL):
        if kind == "python":
            yield Step(code=block)
            continue
        for part in re.split(r"^\$ airtruth ", block, flags=re.MULTILINE)[1:]:
            command, *shown = part.splitlines()
            yield Step(words=tuple(command.split()), shown=tuple(shown))


def differs(shown: Sequence[str], printed: Sequence[str]) -> str:
    """The first shown line that was not printed in its order; empty if all were.

    Parameters
    ----------
    shown : lines of the document; `ELISION` stands for any lines.
    printed : lines of the command.
    """
    rest = [line.rstrip() for line in printed]
    free = False
    for line in (line.rstrip() for line in shown):
        if line == ELISION:
            free = True
            continue
        if free and line in rest:
            rest = rest[rest.index(line) :]
        if not rest or rest[0] != line:
            return line
        rest, free = rest[1:], False
    return "" if free or not any(rest) else f"(not shown) {next(line for line in rest if line)}"


def updated(shown: Sequence[str], printed: Sequence[str]) -> list[str]:
    """The shown lines with the numbers that were printed; a line whose words were not printed stays as it is.

    Parameters
    ----------
    shown, printed : as in `differs`.
    """
    rest = [line.rstrip() for line in printed]
    lines = []
    for line in shown:
        words = [NUMBER.sub("", other) for other in rest]
        if line.strip() and line != ELISION and NUMBER.sub("", line.rstrip()) in words:
            index = words.index(NUMBER.sub("", line.rstrip()))
            line, rest = rest[index], rest[index + 1 :]
        lines.append(line)
    return lines


def run(
    document: Path, python: Path, folder: Path, environment: dict[str, str], update: bool = False
) -> list[str]:
    """Run a document in a folder and return what differs from it.

    Parameters
    ----------
    document : Markdown file.
    python : interpreter of the environment with airtruth.
    folder : working folder of the commands.
    environment : environment of the commands.
    update : write the printed numbers into the document.
    """
    wrong = []
    for step in steps(document.read_text(encoding="utf-8")):
        arguments = ["-m", "airtruth", *step.words] if step.words else ["-W", "error", "-c", step.code]
        started, before = time.monotonic(), cpu_s()
        done = subprocess.run(
            [str(python), *arguments],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        difference = differs(step.shown, done.stdout.splitlines()) if step.words else ""
        if update and difference:
            text = document.read_text(encoding="utf-8")
            now = updated(step.shown, done.stdout.splitlines())
            document.write_text(text.replace("\n".join(step.shown), "\n".join(now)), encoding="utf-8")
            difference = differs(now, done.stdout.splitlines())
        fault = f"exit code {done.returncode}: {done.stderr[-500:]}" if done.returncode else difference
        times = f"{time.monotonic() - started:7.1f} s ({cpu_s() - before:.1f} s of CPU)"
        print(f"{times}  {step.title}  {fault or 'as shown'}", flush=True)
        if fault:
            wrong.append(f"{step.title}: {fault}")
    return wrong


def cpu_s() -> float:
    """CPU time of all child processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def installed(folder: Path) -> Path:
    """Build wheel and sdist, install the wheel of the sdist with pip, and return the interpreter.

    Parameters
    ----------
    folder : folder of the builds and of the environment.
    """
    pip = ["-m", "pip", "install", "--quiet", "--no-compile"]
    subprocess.run([sys.executable, "-m", "hatchling", "build", "-d", str(folder)], cwd=ROOT, check=True)
    (sdist,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
    again = folder / "again"
    building = [
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "-w",
        str(again),
        str(sdist),
    ]
    subprocess.run([sys.executable, *building], check=True)
    (made,) = again.glob("*.whl")
    assert made.name == wheel.name
    subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
    python = folder / "venv" / "bin" / "python"
    started, before = time.monotonic(), cpu_s()
    subprocess.run([str(python), *pip, str(made)], check=True)
    print(
        f"{time.monotonic() - started:7.1f} s ({cpu_s() - before:.1f} s of CPU)  pip install {made.name}",
        flush=True,
    )
    return python


def main() -> int:
    """Run the document; exit code 1 if something differs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("document", nargs="?", type=Path, default=ROOT / "README.md")
    parser.add_argument(
        "--wheel", action="store_true", help="from an installed wheel, in an environment of its own"
    )
    parser.add_argument("--update", action="store_true", help="write the printed numbers into the document")
    options = parser.parse_args()
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "empty").mkdir()
        if options.wheel:
            python = installed(folder)
        else:
            python = Path(sys.executable)
            environment["PYTHONPATH"] = str(ROOT / "src")
        started = time.monotonic()
        wrong = run(options.document.resolve(), python, folder / "empty", environment, options.update)
        print(f"{time.monotonic() - started:7.1f} s  in all; {len(wrong)} differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
