"""Hooks of the site (mkdocs.yml): equations become MathML while the site is built, so that pages need no network.

Code hosts typeset the same ``math`` blocks themselves.
"""

from __future__ import annotations

import re
from typing import Any

_MATH = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Turn every ``math`` block of a page into MathML."""
    return _MATH.sub(lambda found: equation(found[1].strip()), markdown)


def equation(tex: str) -> str:
    """One displayed equation as HTML.

    Parameters
    ----------
    tex : str
        LaTeX.
    """
    from latex2mathml.converter import convert

    # on one line: a blank or indented one would end the block for the Markdown parser
    return f'<div class="equation">{" ".join(convert(tex, display="block").split())}</div>\n'
