"""Compiled loops: one stamp over all their sources, so that no stale machine code survives an edit or an upgrade."""

from __future__ import annotations

from pathlib import Path

import numba.core.caching
import pytest

import model.energy
import model.film
import model.newton_step
from model import kernel

FOLDER = Path(kernel.__file__).parent


def test_list_of_kernels_is_complete():
    using = {path.stem for path in FOLDER.rglob("*.py") if "\n@compiled\n" in path.read_text(encoding="utf-8")}
    assert using | {"kernel"} == set(kernel.KERNELS)
    assert not [path for path in FOLDER.rglob("*.py") if "njit" in path.read_text("utf-8") and path.stem != "kernel"]


def test_stamp_follows_every_source(tmp_path, monkeypatch):
    for name in kernel.KERNELS:
        (tmp_path / f"{name}.py").write_bytes((FOLDER / f"{name}.py").read_bytes())
    monkeypatch.setattr(kernel, "__file__", str(tmp_path / "kernel.py"))
    assert kernel._stamp() == kernel.STAMP
    for name in kernel.KERNELS:
        source = tmp_path / f"{name}.py"
        kept = source.read_bytes()
        source.write_bytes(kept + b"\n")
        assert kernel._stamp() != kernel.STAMP
        source.write_bytes(kept)


def test_cached_code_carries_the_stamp():
    for function in (model.film.solve_film, model.energy.march, model.newton_step.eliminate):
        assert function._cache._cache_file._source_stamp == kernel.STAMP


def test_without_numbas_cache_the_code_is_compiled_anew(monkeypatch):
    def other(*args, **options):
        return lambda function: (function.__name__, options.get("cache", False))

    monkeypatch.setattr(kernel, "njit", other)
    assert kernel.compiled(kernel._stamp) == ("_stamp", False)


def test_where_nothing_can_be_written_the_code_is_compiled_and_the_cure_is_told(monkeypatch):
    monkeypatch.setattr(numba.core.caching.CacheImpl, "_locator_classes", [])
    kernel._tell.cache_clear()
    with pytest.warns(RuntimeWarning, match="NUMBA_CACHE_DIR") as told:
        twice, thrice = kernel.compiled(lambda x: 2.0 * x), kernel.compiled(lambda x: 3.0 * x)
    assert (twice(3.0), thrice(3.0)) == (6.0, 9.0)
    assert len(told) == 1


def test_other_troubles_of_the_compiler_are_not_taken_for_that(monkeypatch):
    def broken(**options):
        raise RuntimeError("another")

    monkeypatch.setattr(kernel, "njit", broken)
    with pytest.raises(RuntimeError, match="another"):
        kernel.compiled(kernel._stamp)
