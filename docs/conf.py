"""How Sphinx builds the site: `make docs`."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError, latex2mathml
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util import logging

import keystab

ROOT = Path(__file__).parents[1]
LOG = logging.getLogger("keystab")

project = "keystab"
version = release = keystab.__version__
author = "The keystab authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
exclude_patterns = ["findings/templates"]
highlight_language = "none"  # blocks of code say their language

# Pages are Markdown as code forges show it: anchors of headings, and $formulas$.
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
myst_fence_as_directive = ["math"]

default_role = "py:obj"  # `keystab.scale_space` in a docstring is a link
autodoc_typehints = "none"  # numpydoc shows the types that the docstrings say
numpydoc_show_class_members = False
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = f"keystab {version}"
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_copyright = False
html_show_sphinx = False
html_math_renderer = "mathml"


def as_mathml(formula: str, block: bool, place: nodes.Node) -> str:
    """A formula as browsers show it by themselves: pages need no network and no script."""
    # \dots is not known, and of \frac12 one number would be made.
    known = re.sub(r"\\dots\b", r"\\ldots", formula)
    known = re.sub(r"(\\[td]?frac)(\d)(\d)", r"\1{\2}{\3}", known)
    try:
        return str(latex2mathml.tex2mathml(known, as_block=block))
    except MathError as error:
        raise ExtensionError(f"{place.source}:{place.line}: {formula}: {error}") from error


def inline_math(writer: Any, node: nodes.math) -> None:
    """Write a formula within a line."""
    writer.body.append(as_mathml(node.astext(), False, node))
    raise nodes.SkipNode


def block_math(writer: Any, node: nodes.math_block) -> None:
    """Write a formula of its own."""
    writer.body.append(f'<div class="math">{as_mathml(node.astext(), True, node)}</div>')
    raise nodes.SkipNode


def link_files(app: Sphinx, document: nodes.document) -> None:
    """Make links to pages outside of docs downloads, and links to folders plain text."""
    page = app.env.docname
    here = Path(app.env.doc2path(page)).parent
    for link in list(document.findall(addnodes.pending_xref)):
        target = Path(os.path.normpath(here / link.get("reftarget", "").partition("#")[0]))
        if link.get("reftype") != "myst" or app.srcdir in target.parents:
            continue
        file = target.with_name(f"{target.name}.md")
        if link["refdomain"] == "doc" and file.is_file():
            named = {"reftarget": os.path.relpath(file, here), "refdoc": page}
            download = addnodes.download_reference("", "", *link.children, **named)
            download["filename"] = str(app.env.dlfiles.add_file(page, str(file)))
            link.replace_self(download)
        elif target.is_dir() and ROOT in (target, *target.parents):
            link.replace_self(nodes.inline("", "", *link.children))


def setup(app: Sphinx) -> None:
    """Add what is of this site."""
    app.add_html_math_renderer("mathml", (inline_math, None), (block_math, None))
    app.connect("doctree-read", link_files)
