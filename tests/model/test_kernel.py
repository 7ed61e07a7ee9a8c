"""Compiled loops: one stamp over all their sources, so that no stale machine code survives an edit or an upgrade."""

from __future__ import annotations

from pathlib import Path

import numba.core.caching
import pytest

import model.film.energy
import model.film.reynolds
import model.statics.compiled.elimination
from model import compilation

FOLDER = Path(compilation.__file__).parent


def test_list_of_kernels_is_complete():
    sources = {path.relative_to(FOLDER).as_posix(): path.read_text(encoding="utf-8") for path in FOLDER.rglob("*.py")}
    using = {name for name, text in sources.items() if "\n@compiled\n" in text}
    assert using | {"compilation.py", "statics/compiled/constants.py"} == set(compilation.KERNELS)
    assert not [name for name, text in sources.items() if "njit" in text and name != "compilation.py"]


def test_stamp_follows_every_source(tmp_path, monkeypatch):
    for name in compilation.KERNELS:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((FOLDER / name).read_bytes())
    monkeypatch.setattr(compilation, "__file__", str(tmp_path / "compilation.py"))
    assert compilation._stamp() == compilation.STAMP
    for name in compilation.KERNELS:
        source = tmp_path / name
        kept = source.read_bytes()
        source.write_bytes(kept + b"\n")
        assert compilation._stamp() != compilation.STAMP
        source.write_bytes(kept)


def test_cached_code_carries_the_stamp():
    for function in (
        model.film.reynolds.solve_film,
        model.film.energy.march,
        model.statics.compiled.elimination.eliminate,
    ):
        assert function._cache._cache_file._source_stamp == compilation.STAMP


def test_without_numbas_cache_the_code_is_compiled_anew(monkeypatch):
    def other(*args, **options):
        return lambda function: (function.__name__, options.get("cache", False))

    monkeypatch.setattr(compilation, "njit", other)
    assert compilation.compiled(compilation._stamp) == ("_stamp", False)


def test_where_nothing_can_be_written_the_code_is_compiled_and_the_cure_is_told(monkeypatch):
    monkeypatch.setattr(numba.core.caching.CacheImpl, "_locator_classes", [])
    compilation._tell.cache_clear()
    with pytest.warns(RuntimeWarning, match="TPJB_CACHE") as told:
        twice, thrice = compilation.compiled(lambda x: 2.0 * x), compilation.compiled(lambda x: 3.0 * x)
    assert (twice(3.0), thrice(3.0)) == (6.0, 9.0)
    assert len(told) == 1


def test_other_troubles_of_the_compiler_are_not_taken_for_that(monkeypatch):
    def broken(**options):
        raise RuntimeError("another")

    monkeypatch.setattr(compilation, "njit", broken)
    with pytest.raises(RuntimeError, match="another"):
        compilation.compiled(compilation._stamp)


@pytest.mark.parametrize(
    ("chosen", "numbas", "under"), [("own", None, "own/compiled"), ("own", "other", None), ("off", None, None)]
)
def test_one_variable_moves_the_machine_code_too(monkeypatch, tmp_path, chosen, numbas, under):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("TPJB_CACHE", "off" if chosen == "off" else str(tmp_path / chosen))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    if numbas:
        monkeypatch.setenv("NUMBA_CACHE_DIR", numbas)
    compilation._place()
    assert (numba.config.CACHE_DIR or None) == (under and str(tmp_path / under))
