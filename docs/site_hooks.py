"""Hooks of the site (mkdocs.yml): equations become MathML, notebooks become pages, while the site is built.

Pages need no network. Notebooks are stored without outputs; `.ci/notebooks.py` executes them and stores the executed
copies in ``build/notebooks``. A page shows the copy where there is one of the same cells, the bare notebook otherwise.
"""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SOURCE, EXECUTED = ROOT / "notebooks", ROOT / "build" / "notebooks"
MOST_LINES = 60
_MATH = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Turn every ``math`` block of a page into MathML; code hosts typeset the same blocks themselves."""
    return _MATH.sub(lambda block: equation(block[1].strip()), markdown)


def equation(tex: str) -> str:
    """One displayed equation as HTML, from LaTeX."""
    from latex2mathml.converter import convert

    # on one line: a blank or indented one would end the block for the Markdown parser
    return f'<div class="equation">{" ".join(convert(tex, display="block").split())}</div>\n'


def on_files(files: Any, config: Any, **_: Any) -> Any:
    """Add a page, and its pictures, for each notebook."""
    from mkdocs.structure.files import File

    for path in sorted(SOURCE.glob("*.ipynb")):
        text, pictures = page(path, EXECUTED / path.name)
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=text))
        for name, data in pictures.items():
            files.append(File.generated(config, f"notebooks/{name}", content=data))
    return files


def page(path: Path, executed: Path) -> tuple[str, dict[str, bytes]]:
    """Markdown of a notebook, with outputs if the executed copy has the same cells; its pictures by name."""
    cells = _cells(path)
    if executed.exists() and [_source(c) for c in _cells(executed)] == [_source(c) for c in cells]:
        cells = _cells(executed)
    lines: list[str] = []
    pictures: dict[str, bytes] = {}
    for cell in cells:
        if cell["cell_type"] == "markdown":
            lines += [_links(_source(cell)), ""]
            continue
        lines += ["```python", _source(cell), "```", ""]
        for output in cell.get("outputs", []):
            image, text = _shown(output)
            if image:
                name = f"{path.stem}-{len(pictures) + 1}.png"
                pictures[name] = image
                lines += [f"![Figure {len(pictures)}]({name})", ""]
            elif text:
                lines += ["```text", text, "```", ""]
    return "\n".join(lines).rstrip() + "\n", pictures


def _cells(path: Path) -> list[dict[str, Any]]:
    cells: list[dict[str, Any]] = json.loads(path.read_text("utf-8"))["cells"]
    return cells


def _source(cell: dict[str, Any]) -> str:
    return "".join(cell["source"])


def _shown(output: dict[str, Any]) -> tuple[bytes, str]:
    """Picture or text of one output."""
    if output["output_type"] == "stream":
        return b"", _short("".join(output["text"])) if output["name"] == "stdout" else ""
    data = output.get("data", {})
    if "image/png" in data:
        return base64.b64decode(data["image/png"]), ""
    return b"", _short("".join(data.get("text/plain", "")))


def _short(text: str) -> str:
    """Without what steers a terminal, and not longer than a screen or so."""
    lines = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", text).replace(str(ROOT), "..").rstrip().splitlines()
    if len(lines) > MOST_LINES:
        lines = [*lines[:MOST_LINES], f".. {len(lines) - MOST_LINES} more lines"]
    return "\n".join(lines)


def _links(text: str) -> str:
    """Links of a notebook, which counts from its own folder, as seen from its page."""
    text = re.sub(r"\]\(\.\./docs/", "](../", text)
    return re.sub(r"\]\((\d\d_\w+)\.ipynb\)", r"](\1.md)", text)
