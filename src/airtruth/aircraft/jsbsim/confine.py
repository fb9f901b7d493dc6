"""Inspect a JSBSim model before JSBSim reads it: which files it refers to, and whether it may be loaded at all.

JSBSim opens the files and sockets of `<output>` and `<input>` while it loads a model, and it follows every ``file``
attribute wherever that leads. A model of a stranger is therefore read here first, by Python's own XML parser.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from airtruth.errors import AircraftError

LARGEST_BYTES: Final = 20_000_000
"""Size of all files of a model together [byte]; the largest model of the JSBSim wheel has 0.3 MB."""
MOST_FILES: Final = 200
"""Number of files of a model [-]; the wheel's model with the most engines and systems has fewer than 30."""
DEEPEST: Final = 200
"""Nesting of XML elements [-]; JSBSim's functions need about 20, and its reader recurses without a limit."""
_CHANNELS: Final = ("output", "input")
"""Children of the root element that make JSBSim open files or sockets."""
_SUBFOLDERS: Final = ("", "Engines", "Engine", "engine", "Systems", "systems")
"""Folders below the model's in which JSBSim looks for a file, and the model's own."""


def model_files(xml: Path, wheel: Path | None = None) -> tuple[Path, ...]:
    """Files that a model consists of, the model's own XML first.

    Parameters
    ----------
    xml : XML file of the model.
    wheel : root folder of the JSBSim package, whose engines and systems a model may use; None for none.

    Raises
    ------
    AircraftError
        If the model has `<output>` or `<input>`, declares XML entities, refers to a file outside its own folder and
        the wheel or through a link, refers to a file that does not exist, or exceeds a limit of size, number or depth.
        Files inside the wheel may have `<output>`, `<input>` and entities: they are part of the installation.
    """
    found: dict[Path, None] = {}
    waiting = [xml]
    size = 0
    while waiting:
        path = waiting.pop()
        if path in found:
            continue
        found[path] = None
        size += _size(path)
        if size > LARGEST_BYTES or len(found) > MOST_FILES:
            raise AircraftError(
                f"{xml}: the model refers to more than {MOST_FILES} files or {LARGEST_BYTES / 1e6:.0f} MB; "
                "an aircraft has a few files of some kB each"
            )
        trusted = wheel is not None and _inside(path.resolve(), wheel)
        root = _parsed(path, trusted)
        if not trusted:
            _refuse_channels(root, path)
            _refuse_control(root, path)
        waiting += [_resolved(path, name, tag, xml.parent, wheel) for tag, name in _references(root)]
    return tuple(found)


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError as error:
        raise AircraftError(f"{path}: cannot be read ({error.strerror}); make it readable") from None


def _parsed(path: Path, trusted: bool) -> ET.Element:
    if not path.is_file():
        raise AircraftError(f"{path}: is not a regular file")
    if _size(path) > LARGEST_BYTES:
        raise AircraftError(
            f"{path}: has more than {LARGEST_BYTES / 1e6:.0f} MB; a JSBSim model has some kB; is it the right file?"
        )
    content = path.read_bytes()
    entities = b"<!DOCTYPE" in content or b"<!ENTITY" in content
    if not trusted and (entities or content[:2] in (b"\xff\xfe", b"\xfe\xff")):
        raise AircraftError(
            f"{path}: declares XML entities (<!DOCTYPE> or <!ENTITY>) or is not UTF-8; "
            "write the values in place and save the file as UTF-8"
        )
    try:
        root = ET.fromstring(content)
    except ET.ParseError as error:
        raise AircraftError(
            f"{path}: this JSBSim model is not valid XML: {error}; correct it, or restore the original"
        ) from None
    if _depth(root) > DEEPEST:
        raise AircraftError(f"{path}: elements are nested more than {DEEPEST} deep; flatten them")
    return root


def _depth(root: ET.Element) -> int:
    level, depth = [root], 0
    while level:
        level, depth = [child for element in level for child in element], depth + 1
        if depth > DEEPEST:
            break
    return depth


def _refuse_channels(root: ET.Element, path: Path) -> None:
    if root.tag != "fdm_config":
        return
    for child in root:
        if child.tag in _CHANNELS:
            named = child.get("name") or child.get("type") or child.get("port") or child.get("file") or ""
            raise AircraftError(
                f"{path}: <{child.tag}{' ' + named if named else ''}> lets JSBSim open files or sockets by itself; "
                f"remove this element (airtruth writes its own logs)"
            )


def controls_simulation(name: str) -> bool:
    """Whether writing a property stops, trims, rewinds or re-times the simulation.

    JSBSim resolves "..", ".", indices and absolute paths in names, so every component before the last counts.
    """
    components = [part.partition("[")[0].strip(" -") for part in name.strip().split("/")]
    return "simulation" in components[:-1]


def _refuse_control(root: ET.Element, path: Path) -> None:
    for element in root.iter():
        written = [element.get("name", "")]
        if element.tag in ("output", "property"):
            written.append(element.text or "")
        for name in written:
            if element.tag != "value" and controls_simulation(name) and not _is_read(element):
                raise AircraftError(
                    f"{path}: <{element.tag}> writes {name.strip()}: a model must not stop, trim, rewind or re-time "
                    "the simulation; remove this element"
                )


def _is_read(element: ET.Element) -> bool:
    """Whether a <property> only reads: inside a function it is an argument, elsewhere it declares or sets a value."""
    return element.tag == "property" and "value" not in element.attrib and "name" not in element.attrib


def _references(root: ET.Element) -> Iterator[tuple[str, str]]:
    for element in root.iter():
        name = element.get("file")
        if name is not None:
            yield str(element.tag), name


def _resolved(source: Path, name: str, tag: str, folder: Path, wheel: Path | None) -> Path:
    """The file that a reference means; the first one that exists where JSBSim looks for it."""
    file = name if name.lower().endswith(".xml") else f"{name}.xml"
    own = folder.resolve()
    candidates = [own / sub / file for sub in _SUBFOLDERS]
    if wheel is not None:
        candidates += [wheel / sub / file for sub in ("engine", "systems")]
    allowed = [own] if wheel is None else [own, wheel.resolve()]
    for candidate in candidates:
        if not candidate.exists() and not candidate.is_symlink():
            continue
        target = candidate.resolve()
        if Path(file).is_absolute() or not any(_inside(target, root) for root in allowed):
            break
        return target
    else:
        if not Path(file).is_absolute() and ".." not in Path(file).parts:
            raise AircraftError(
                f'{source}: <{tag} file="{name}"> does not exist in {folder}, its Engines or Systems folder, '
                "or in the engines and systems of JSBSim"
            )
    raise AircraftError(
        f'{source}: <{tag} file="{name}"> leads out of the folder of the aircraft; '
        f"copy the file into {folder} and refer to it by its name"
    )


def _inside(path: Path, folder: Path) -> bool:
    return path.is_relative_to(folder.resolve())
