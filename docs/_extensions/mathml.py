"""Formulas as MathML, which browsers draw themselves: no script, no font, no network."""

from __future__ import annotations

from typing import TYPE_CHECKING

from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.errors import ExtensionError

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator


def inline(translator: HTML5Translator, node: nodes.math) -> None:
    """A formula in a line."""
    translator.body.append(converted(node))


def display(translator: HTML5Translator, node: nodes.math_block) -> None:
    """A formula of its own line, which scrolls where a screen is narrower than it."""
    translator.body.append(f'<div class="math">{converted(node, as_block=True)}</div>')


def converted(node: nodes.math | nodes.math_block, *, as_block: bool = False) -> str:
    """The formula's MathML.

    Raises:
        ExtensionError: It is not the LaTeX that docutils converts.
    """
    formula = node.astext().strip()
    try:
        return tex2mathml(formula, as_block=as_block)
    except MathError as error:
        raise ExtensionError(
            f"{node.source}:{node.line}: no MathML for the formula '{formula}': {error}"
        ) from error


def skip(_translator: HTML5Translator, _node: nodes.Node) -> None:
    """Nothing is left to close."""


def visit(function):
    """What Sphinx calls: the node's children are done with."""
    from docutils.nodes import SkipNode

    def visit_node(translator, node):
        function(translator, node)
        raise SkipNode

    return visit_node


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer and choose it."""
    app.add_html_math_renderer("mathml", (visit(inline), skip), (visit(display), skip))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True, "parallel_write_safe": True}
