"""Equations as MathML, which browsers show without a script: the site works offline."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx


def inline(self: Any, node: Any) -> None:
    """Write an equation within a line."""
    self.body.append(tex2mathml(node.astext(), as_block=False))
    raise nodes.SkipNode


def display(self: Any, node: Any) -> None:
    """Write an equation of its own, with its number."""
    number = f'<span class="eqno">({node["number"]})</span>' if node["number"] else ""
    self.body.append(self.starttag(node, "div", CLASS="math-display"))
    self.body.append(tex2mathml(node.astext().strip(), as_block=True) + number + "</div>")
    raise nodes.SkipNode


def leave(self: Any, node: Any) -> None:
    """Do nothing: the equation is complete."""


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (inline, leave), (display, leave))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
