"""How the inner loops are compiled, and kept on disk without going stale.

numba keeps machine code per source file. A loop that was inlined into another file's loop changes without that file
noticing: after an edit or an upgrade the old code would go on running, without a word. Here every compiled function is
stamped with the sources of all of them.
"""

from __future__ import annotations

import functools
import hashlib
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from numba import config, njit

Function = TypeVar("Function", bound=Callable[..., Any])

#: Files with compiled functions, relative to the package; a test holds the list complete.
KERNELS = (
    "compilation.py",
    "film/cavitation.py",
    "film/cavitation_matrix.py",
    "film/cavitation_slopes.py",
    "film/cross_energy.py",
    "film/cross_film.py",
    "film/cross_march.py",
    "film/energy.py",
    "film/following_heat.py",
    "film/matrix.py",
    "film/oil_state.py",
    "film/reynolds.py",
    "film/slopes.py",
    "film/turbulence.py",
    "statics/compiled/anderson.py",
    "statics/compiled/bending.py",
    "statics/compiled/carrying.py",
    "statics/compiled/constants.py",
    "statics/compiled/elimination.py",
    "statics/compiled/first_position.py",
    "statics/compiled/iteration.py",
    "statics/compiled/laws.py",
    "statics/compiled/stack.py",
    "statics/compiled/step.py",
)
#: Sums may be reordered, but NaN and infinity keep their meaning.
OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "arcp", "nsz"},
    "nogil": True,
}
#: Where nothing can be written: a read-only installation and a user without a home, as services and containers have.
_NO_PLACE = (
    "there is no folder to keep the model's machine code in, so every process compiles it again, which takes half a "
    "minute: set TPJB_CACHE to a folder that can be written"
)


def _place() -> None:
    """Keep machine code under TPJB_CACHE where that is set, as pad solutions are, and NUMBA_CACHE_DIR is not."""
    folder = os.environ.get("TPJB_CACHE", "").strip()
    if folder.lower() not in ("", "off") and "NUMBA_CACHE_DIR" not in os.environ:
        config.CACHE_DIR = str(Path(folder) / "compiled")  # type: ignore[attr-defined]


_place()


def _stamp() -> str:
    digest = hashlib.sha256()
    for name in KERNELS:
        digest.update((Path(__file__).parent / name).read_bytes())
    return digest.hexdigest()


STAMP = _stamp()


@functools.cache  # once, not for every loop
def _tell(what: str) -> None:
    warnings.warn(what, RuntimeWarning, stacklevel=3)


def compiled(function: Function) -> Function:
    """Compile with numba, cached on disk under the stamp of all kernels.

    Parameters
    ----------
    function : callable
        A loop that numba understands.

    Returns
    -------
    callable
        The same, compiled at its first call.

    Warns
    -----
    RuntimeWarning
        Neither the sources' folder nor the user's own can be written: every process compiles anew.
    """
    dispatcher: Any
    try:
        dispatcher = njit(cache=True, **OPTIONS)(function)
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        _tell(_NO_PLACE)
        dispatcher = njit(**OPTIONS)(function)
    store = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if store is not None and hasattr(store, "_source_stamp"):
        store._source_stamp = STAMP
    else:  # a numba whose cache is built otherwise: compile in every process rather than trust it
        dispatcher = njit(**OPTIONS)(function)
    kept: Function = dispatcher
    return kept
