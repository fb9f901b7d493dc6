"""An XML file with the place of each element in it, so that a change of the tree rewrites nothing else of the file."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final
from xml.etree.ElementTree import Element
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

_WIDTH: Final = 200
"""Longest line that is filled with elements [characters] (judgement: a formula of three terms fits, as the rows of a table)."""
_FILLED: Final = ("function", "fcs_function")
"""Elements that fill lines, for a diff of few lines; the description stays on the line of the start tag."""
_STEP: Final = "  "
"""Indentation of a child."""


@dataclass(frozen=True)
class _Place:
    """Byte offsets of an element: its start tag, behind it, its end tag, behind it; and the element as it was read."""

    element: Element
    start: int
    inner: int
    close: int
    end: int
    attrib: dict[str, str]
    text: str
    children: tuple[Element, ...]


@dataclass(frozen=True)
class Document:
    """A file as read, and its tree, which callers change.

    Elements of the tree may be inserted, removed or given another text or other attributes; those that were read keep
    their order.

    Attributes
    ----------
    content : the file's bytes.
    root : root element; comments are elements of the tree.
    """

    content: bytes
    root: Element
    _places: dict[int, _Place] = field(repr=False)
    _elsewhere: dict[int, Element] = field(default_factory=dict, repr=False)

    def stand_in(self, placeholder: Element, other: Element) -> None:
        """Put the root of another file's tree where an element refers to that file; this file keeps the reference."""
        index = list(self.root).index(placeholder)
        self.root[index] = other
        self._elsewhere[id(other)] = placeholder

    def patched(self) -> bytes:
        """The file with the changes of the tree; every other byte stays."""
        parts: list[bytes] = []
        last = 0
        for start, end, text in sorted(self._edits(self._places[id(self.root)]), key=lambda edit: edit[0]):
            parts += [self.content[last:start], text.encode()]
            last = max(last, end)  # what is inserted at the start of a replaced range follows it
        return b"".join([*parts, self.content[last:]])

    def _edits(self, place: _Place) -> Iterator[tuple[int, int, str]]:
        """Byte ranges and the text that replaces them."""
        element = place.element
        children = [self._elsewhere.get(id(child), child) for child in element]
        added = any(id(child) not in self._places for child in children)
        text = element.text or ""
        if place.inner == place.close == place.end and (
            added or text.strip() or element.attrib != place.attrib
        ):
            lines = [line for child in children for line in _lines(child, self._indent(place.start) + _STEP)]
            body = self._block(lines) + self._newline + self._indent(place.start) if lines else ""
            yield place.start, place.end, f"{_start_tag(element)}{escape(text)}{body}</{element.tag}>"
            return
        if element.attrib != place.attrib:
            yield place.start, place.inner, _start_tag(element)
        if text != place.text:
            yield place.inner, self._text_end(place), escape(text)
        kept = {id(child) for child in children}
        for child in place.children:
            if id(child) not in kept:
                yield self._whole_lines(self._places[id(child)])
        yield from self._insertions(place, children)
        for child in element:
            if id(child) in self._places and isinstance(child.tag, str):
                yield from self._edits(self._places[id(child)])

    def _insertions(self, place: _Place, children: Sequence[Element]) -> Iterator[tuple[int, int, str]]:
        before: list[_Place] = []
        group: list[Element] = []
        for child in (*children, None):
            known = None if child is None else self._places.get(id(child))
            if child is not None and known is None:
                group.append(child)
                continue
            if group:
                yield self._insertion(place, before, known, group)
                group = []
            if known is not None:
                before.append(known)

    def _insertion(
        self, place: _Place, before: list[_Place], following: _Place | None, group: Sequence[Element]
    ) -> tuple[int, int, str]:
        """Behind the elements before it; a comment on lines of its own stays with the element that follows it."""
        own = list(before)
        while following is not None and own and not isinstance(own[-1].element.tag, str):
            if not self.content[self._line(own[-1].start) : own[-1].start].isspace():
                break
            own.pop()
        beside = own[-1] if own else following
        indent = self._indent(place.start) + _STEP if beside is None else self._indent(beside.start)
        lines = [line for element in group for line in _lines(element, indent)]
        at = own[-1].end if own else self._text_end(place) if place.text.strip() else place.inner
        tail = "" if place.inner != place.close else self._newline + self._indent(place.start)
        return at, at, self._block(lines) + tail

    def _text_end(self, place: _Place) -> int:
        return self._places[id(place.children[0])].start if place.children else place.close

    def _block(self, lines: Sequence[str]) -> str:
        text = "\n".join(lines)
        return self._newline + (text if self._newline == "\n" else text.replace("\n", self._newline))

    def _whole_lines(self, place: _Place) -> tuple[int, int, str]:
        """An element, with its line where it is alone there."""
        first = self._line(place.start)
        end = self.content.find(b"\n", place.end)
        alone = not self.content[first : place.start].strip() and not self.content[place.end : end].strip()
        return (first, end + 1, "") if alone and end >= 0 else (place.start, place.end, "")

    def _line(self, offset: int) -> int:
        return self.content.rfind(b"\n", 0, offset) + 1

    def _indent(self, offset: int) -> str:
        line = self.content[self._line(offset) : offset]
        return line[: len(line) - len(line.lstrip())].decode()

    @property
    def _newline(self) -> str:
        return "\r\n" if b"\r\n" in self.content else "\n"


def parse(content: bytes) -> Document:
    """Read a file in UTF-8. One with a document type is first written without it, its entities replaced by their values.

    Raises
    ------
    expat.ExpatError
        If it is not well-formed XML.
    """
    if b"<!DOCTYPE" in content:
        content = ET.tostring(_parsed(content)[0], encoding="utf-8") + b"\n"
    root, offsets = _parsed(content)
    places = {id(e): _Place(e, *where, dict(e.attrib), e.text or "", tuple(e)) for e, where in offsets}
    return Document(content, root, places)


def _parsed(content: bytes) -> tuple[Element, list[tuple[Element, tuple[int, int, int, int]]]]:
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    builder: ET.TreeBuilder = ET.TreeBuilder(insert_comments=True)
    opened: list[tuple[Element, int]] = []
    found: list[tuple[Element, tuple[int, int, int, int]]] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        opened.append((builder.start(tag, attributes), parser.CurrentByteIndex))

    def end(tag: str) -> None:
        element, first = opened.pop()
        builder.end(tag)
        inner = _tag_end(content, first)
        if content[inner - 2 : inner] == b"/>":
            found.append((element, (first, inner, inner, inner)))
        else:
            close = parser.CurrentByteIndex
            found.append((element, (first, inner, close, _tag_end(content, close))))

    def comment(text: str) -> None:
        first = parser.CurrentByteIndex
        last = content.find(b"-->", first) + 3
        element = builder.comment(text)
        if opened:
            found.append((element, (first, last, last, last)))

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.CommentHandler = builder.data, comment
    parser.Parse(content, True)
    return builder.close(), found


def _tag_end(content: bytes, start: int) -> int:
    """Offset behind the ">" of a tag; one inside an attribute's value does not count."""
    quote = b""
    for offset in range(start, len(content)):
        character = content[offset : offset + 1]
        if quote:
            quote = b"" if character == quote else quote
        elif character in (b'"', b"'"):
            quote = character
        elif character == b">":
            return offset + 1
    return len(content)


def _start_tag(element: Element, end: str = ">") -> str:
    attributes = "".join(f" {name}={quoteattr(value)}" for name, value in element.attrib.items())
    return f"<{element.tag}{attributes}{end}"


def _inline(element: Element) -> str:
    text = escape(element.text or "")
    if not len(element):
        return f"{_start_tag(element)}{text}</{element.tag}>" if text else _start_tag(element, "/>")
    return f"{_start_tag(element)}{text}{''.join(map(_inline, element))}</{element.tag}>"


def _lines(element: Element, indent: str) -> list[str]:
    """A new element as lines."""
    whole = indent + _inline(element)
    if not len(element) or (len(whole) <= _WIDTH and "\n" not in whole):
        return [whole]
    if element.tag in _FILLED:
        return _filled(element, indent)
    inner = [line for child in element for line in _lines(child, indent + _STEP)]
    return [indent + _start_tag(element), *inner, f"{indent}</{element.tag}>"]


def _filled(element: Element, indent: str) -> list[str]:
    """As few lines as hold the element: its children follow one another as far as they fit."""
    lines, children = [indent + _start_tag(element)], list(element)
    if children[0].tag == "description":
        lines = [lines[0] + _inline(children.pop(0)), ""]
    for child in children:
        text = _inline(child)
        if lines[-1] and len(lines[-1]) + len(text) > _WIDTH:
            lines.append("")
        if len(text) + len(indent) > _WIDTH and len(child):
            lines += _filled(child, indent + _STEP)
        else:
            lines[-1] = (lines[-1] or indent + _STEP) + text
    lines = [line for line in lines if line]
    return [*lines[:-1], f"{lines[-1]}</{element.tag}>"]


__all__ = ["Document", "parse"]
