"""Execute the notebooks and write them as pages with their figures: ``python docs/render_notebooks.py [NAME ..]``.

The pages in ``docs/notebooks`` can be read on a code host and are part of the site; the notebooks themselves stay
without outputs. A test says which pages are older than their notebooks.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
SOURCE, TARGET = ROOT / "notebooks", ROOT / "docs" / "notebooks"
MOST_LINES = 60


def stamp(path: Path) -> str:
    """SHA-256 of what a notebook says, its cells alone.

    Parameters
    ----------
    path : Path
    """
    cells = json.loads(path.read_text("utf-8"))["cells"]
    text = json.dumps([[c["cell_type"], "".join(c["source"])] for c in cells], ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def rendered(path: Path) -> str:
    """Execute a notebook; its page, whose figures are written beside it.

    Parameters
    ----------
    path : Path
        The notebook.
    """
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    NotebookClient(notebook, timeout=900, kernel_name="python3", resources={"metadata": {"path": SOURCE}}).execute()
    for old in TARGET.glob(f"{path.stem}-*.png"):
        old.unlink()
    lines = [f"<!-- made by docs/render_notebooks.py from notebooks/{path.name}, {stamp(path)} -->", ""]
    figures = 0
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            lines += [_links(cell.source), ""]
            continue
        lines += ["```python", cell.source, "```", ""]
        for output in cell.outputs:
            image, text = _shown(output)
            if image:
                figures += 1
                name = f"{path.stem}-{figures}.png"
                (TARGET / name).write_bytes(image)
                lines += [f"![Figure {figures}]({name})", ""]
            elif text:
                lines += ["```text", text, "```", ""]
    return "\n".join(lines).rstrip() + "\n"


def _shown(output: Any) -> tuple[bytes, str]:
    """Picture or text of one output."""
    if output.output_type == "stream":
        return b"", _short(output.text) if output.name == "stdout" else ""
    data = output.get("data", {})
    if "image/png" in data:
        return base64.b64decode(data["image/png"]), ""
    return b"", _short(data.get("text/plain", ""))


def _short(text: str) -> str:
    """Without what steers a terminal, and not longer than a screen or so."""
    text = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", text).replace(str(ROOT), "..").rstrip()
    lines = text.splitlines()
    return "\n".join(
        lines if len(lines) <= MOST_LINES else [*lines[:MOST_LINES], f".. {len(lines) - MOST_LINES} more lines"]
    )


def _links(text: str) -> str:
    """Links of a notebook as seen from its page."""
    text = re.sub(r"\]\(\.\./docs/", "](../", text)
    return re.sub(r"\]\((\d\d_\w+)\.ipynb\)", r"](\1.md)", text)


def main(names: list[str]) -> None:
    """Render the notebooks named, or all."""
    TARGET.mkdir(exist_ok=True)
    for path in sorted(SOURCE.glob("*.ipynb")):
        if not names or path.stem in names:
            (TARGET / f"{path.stem}.md").write_text(rendered(path), "utf-8", newline="\n")
            print(path.stem, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
