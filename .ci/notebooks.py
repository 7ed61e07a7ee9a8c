"""Execute every notebook from top to bottom, in memory: a notebook that no longer runs fails the build."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

FOLDER = Path(__file__).resolve().parent.parent / "notebooks"


def main() -> int:
    """Return the number of notebooks that failed."""
    failures = 0
    for path in sorted(FOLDER.glob("*.ipynb")):
        began = time.perf_counter()
        notebook = nbformat.read(path, as_version=4)
        client = NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": FOLDER}})
        try:
            client.execute()
        except CellExecutionError as error:
            failures += 1
            print(f"{path.name}: failed\n{error}")
        else:
            print(f"{path.name}: ran in {time.perf_counter() - began:.1f} s")
        if any(cell.get("outputs") for cell in nbformat.read(path, as_version=4).cells):
            failures += 1
            print(f"{path.name}: is stored with outputs; clear them before committing")
    return failures


if __name__ == "__main__":
    sys.exit(min(main(), 1))
