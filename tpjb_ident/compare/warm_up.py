"""Compile the film solver beside other work: on a fresh machine that takes half a minute, which a second core has.

numba keeps what it compiled on disk. `warming_up` lets another process do it, so that whoever asks for a
prediction a little later finds it done.
"""

from __future__ import annotations

import contextlib
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

#: What numba keeps of the search for an equilibrium, the last that is compiled; beside its source.
COMPILED = "statics/compiled/__pycache__/iteration.iterate-*.nbi"


@contextlib.contextmanager
def warming_up(bearing_text: str) -> Iterator[Callable[[], object]]:
    """Predict one point of a bearing in another process while the block runs, unless that was done before.

    Parameters
    ----------
    bearing_text : str
        Content of the bearing file.

    Yields
    ------
    callable
        Call it before predicting: it waits for the compiler. The process is ended with the block.
    """
    if _compiled_before():
        yield lambda: None
        return
    with tempfile.TemporaryDirectory(prefix="tpjb-") as folder:
        path = Path(folder) / "bearing.toml"
        path.write_text(bearing_text, encoding="utf-8")
        command = [sys.executable, "-P", "-m", "tpjb_ident.compare.warm_up", str(path)]
        null = subprocess.DEVNULL
        with subprocess.Popen(command, stdin=null, stdout=null, stderr=null) as process:
            try:
                yield process.wait
            finally:
                process.kill()


def _compiled_before() -> bool:
    """Whether numba's files lie beside the model's; where they cannot, they are looked for in vain and made again."""
    import model

    return any(Path(model.__path__[0]).glob(COMPILED))


def main(path: str) -> None:
    """Predict one point with yielding pivots, which runs through all compiled code of the adiabatic model.

    Parameters
    ----------
    path : str
        A bearing file.
    """
    from model.bearing_file import load_bearing
    from model.predict import predict

    predict(load_bearing(path), 5000.0, speed=2 * math.pi * 22, excitation=2 * math.pi * 25, pivots="kirk")


if __name__ == "__main__":
    main(sys.argv[1])
