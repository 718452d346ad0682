"""Sphinx configuration. Mathematics becomes MathML at build time, so no page needs a network."""

import re
from importlib.metadata import version as version_of

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number
from sphinx.writers.html5 import HTML5Translator

project = "ocp-toolkit"
author = "the ocp-toolkit authors"
project_copyright = f"2026, {author}"
release = version = version_of(project)

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "groupwise"
autodoc_typehints_format = "short"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True  # an attribute that is both described and found is listed once

html_theme = "furo"
html_title = project
html_static_path = ["_static"]
html_css_files = ["math.css"]
html_math_renderer = "mathml"
html_show_sphinx = False

logger = logging.getLogger(__name__)


def to_mathml(latex: str, display: str, node: nodes.Node) -> str:
    """Turn LaTeX into a MathML element, and warn about what the converter does not know.

    The converter passes an unknown macro, and an alignment mark outside of an environment, on to
    the page as text. Here that is a warning, which the strict build turns into an error.
    """
    latex = re.sub(r"\\arg(?![a-z])", r"\\operatorname{arg}", latex)
    latex = re.sub(r"\b(begin|end)\{(aligned|split)\}", r"\1{align*}", latex)
    if display == "block" and r"\begin" not in latex and re.search(r"\\\\|(?<!\\)&", latex):
        latex = rf"\begin{{align*}}{latex}\end{{align*}}"
    mathml = convert(latex, display=display)
    for left_over in re.findall(r">(\\[^<]*|&)<", mathml):
        logger.warning("no MathML for %r in %r", left_over, latex, location=node)
    return mathml


def visit_inline(self: HTML5Translator, node: nodes.math) -> None:
    """Write a formula within a line."""
    self.body.append(to_mathml(node.astext(), "inline", node))
    raise nodes.SkipNode


def visit_display(self: HTML5Translator, node: nodes.math_block) -> None:
    """Write a displayed formula, with its number where it has a label."""
    self.body.append(self.starttag(node, "div", CLASS="math"))
    self.body.append(to_mathml(node.astext(), "block", node))
    if node["number"]:
        self.body.append(f'<span class="eqno">({get_node_equation_number(self, node)})')
        self.add_permalink_ref(node, "Link to this equation")
        self.body.append("</span>")
    self.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Register the renderer that `html_math_renderer` names."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_display, None))
