"""Execute every notebook from top to bottom, two at a time: one that no longer runs fails the build.

The executed copies go to ``build/notebooks``, where the site takes its outputs and pictures from.
"""

import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent / "notebooks"
EXECUTED = FOLDER.parent / "build" / "notebooks"


def executed(path: Path) -> list[str]:
    """Run one notebook; say how long it took and what is wrong with it (one line "ran" if nothing is)."""
    import nbformat
    from nbclient import NotebookClient
    from nbclient.exceptions import CellExecutionError

    began = time.perf_counter()
    notebook = nbformat.read(path, as_version=4)
    told = []
    if any(cell.get("outputs") for cell in notebook.cells):
        told.append("is stored with outputs; clear them before committing")
    place = {"metadata": {"path": FOLDER}}  # `.ci/run` gives notebooks what tests leave of the cores: patience
    client = NotebookClient(notebook, timeout=3600, startup_timeout=600, kernel_name="python3", resources=place)
    try:
        try:
            client.execute()
        except RuntimeError:  # no kernel: a port that was free when it was chosen is a test's when it is asked for
            client.execute()
    except CellExecutionError as error:
        told.append(f"failed\n{error}")
    EXECUTED.mkdir(parents=True, exist_ok=True)
    nbformat.write(notebook, EXECUTED / f"{path.stem}.part")
    (EXECUTED / f"{path.stem}.part").replace(EXECUTED / path.name)  # whole or not at all: tests build the site beside
    return told or [f"ran in {time.perf_counter() - began:.1f} s"]


def main() -> int:
    """Return the number of notebooks that failed."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # two kernels, a core each
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    failures = 0
    paths = sorted(FOLDER.glob("*.ipynb"), reverse=True)  # the last takes longest: nobody shall wait for it alone
    with ProcessPoolExecutor(2) as pool:
        for path, told in zip(paths, pool.map(executed, paths), strict=True):
            failures += not told[0].startswith("ran in")
            for line in told:
                print(f"{path.name}: {line}", flush=True)
    return failures


if __name__ == "__main__":
    sys.exit(min(main(), 1))
