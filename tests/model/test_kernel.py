"""Compiled loops: one stamp over all their sources, so that no stale machine code survives an edit or an upgrade."""

import math
import pickle
import subprocess
import sys
from pathlib import Path

import numba
import numba.core.caching
import pytest

import model.film.energy
import model.film.reynolds
import model.statics.compiled.iteration
from model import compilation
from model.compilation import inner

FOLDER = Path(compilation.__file__).parent


def test_list_of_kernels_is_complete():
    sources = {path: path.read_text(encoding="utf-8") for path in FOLDER.rglob("*.py")}
    using = {path for path, text in sources.items() if "\n@compiled\n" in text or "\n@inner\n" in text}
    assert using | {FOLDER / "compilation.py"} == set(compilation.kernels())
    assert not [path for path, text in sources.items() if "njit" in text and path.name != "compilation.py"]


def test_stamp_follows_every_source(tmp_path, monkeypatch):
    names = [path.relative_to(FOLDER) for path in compilation.kernels()]
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((FOLDER / name).read_bytes())
    known = compilation.stamp()
    monkeypatch.setattr(compilation, "__file__", str(tmp_path / "compilation.py"))
    assert compilation.stamp.__wrapped__() == known
    for name in names:
        source = tmp_path / name
        kept = source.read_bytes()
        source.write_bytes(kept + b"\n")
        assert compilation.stamp.__wrapped__() != known
        source.write_bytes(kept)


def test_cached_code_carries_the_stamp():
    for function in (model.film.reynolds.solve_film, model.film.energy.march, model.statics.compiled.iteration.iterate):
        assert function.dispatcher._cache._cache_file._source_stamp == compilation.stamp()


def _twice(x):
    return 2.0 * x


def test_a_compiled_loop_is_pickled_by_its_name():
    found = pickle.loads(pickle.dumps(model.film.reynolds.solve_film))
    assert found is model.film.reynolds.solve_film


@pytest.mark.slow
def test_code_on_the_disk_allocates_without_a_compiler():
    asked = (  # of a loop whose code there is already where anything has been predicted
        "import numpy as np; from numba.core.runtime import rtsys; from model.film.attitudes import points_between\n"
        "points, warm = points_between(np.arange(1.0, 13.0).reshape(4, 3), np.ones((4, 2)))\n"
        "print(points.shape, np.allclose(warm, 1.0), rtsys._init)"
    )
    told = [subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True) for _ in range(2)]
    assert told[1].stdout.strip() == "(3, 25) True False"


def test_without_numbas_cache_the_code_is_compiled_anew(monkeypatch):
    def other(*args, **options):
        return lambda function: (function.__name__, options.get("cache", False))

    monkeypatch.setattr(numba, "njit", other)
    assert compilation.compiled(_twice).dispatcher == ("_twice", False)


@pytest.mark.slow
def test_where_nothing_can_be_written_the_code_is_compiled_and_the_cure_is_told(monkeypatch):
    monkeypatch.setattr(numba.core.caching.CacheImpl, "_locator_classes", [])
    compilation._warn_once.cache_clear()
    twice, thrice = compilation.compiled(lambda x: 2.0 * x), compilation.compiled(lambda x: 3.0 * x)
    with pytest.warns(RuntimeWarning, match="TPJB_CACHE"):
        assert twice(3.0) == 6.0
    assert thrice(3.0) == 9.0  # and is not told again: warnings are errors here


def test_other_troubles_of_the_compiler_are_not_taken_for_that(monkeypatch):
    def broken(**options):
        raise RuntimeError("another")

    monkeypatch.setattr(numba, "njit", broken)
    with pytest.raises(RuntimeError, match="another"):
        _ = compilation.compiled(_twice).dispatcher


@pytest.fixture
def store(tmp_path):
    kept = compilation._store_type()(str(tmp_path), "loop", "stamp")
    assert type(model.film.reynolds.solve_film.dispatcher._cache._cache_file) is type(kept)
    kept.save("one signature", "code")
    assert kept.load("one signature") == "code"
    return kept


@pytest.mark.parametrize("kind", ["*.nbi", "*.nbc"])
@pytest.mark.parametrize(
    "damage", [lambda b: b[:-9], lambda b: b"", lambda b: b.replace(b"code", b"c0de"), bytes.swapcase]
)
def test_damaged_machine_code_is_no_code_and_is_written_anew(store, tmp_path, kind, damage):
    (path,) = tmp_path.glob(kind)
    path.write_bytes(damage(path.read_bytes()))
    assert store.load("one signature") in (None, "code" if kind == "*.nbi" else None)
    store.save("one signature", "new code")
    assert store.load("one signature") == "new code"


def test_a_file_that_two_processes_wrote_is_the_code_of_one(store):
    index = store._load_index()
    index["another"] = index["one signature"]
    store._save_index(index)
    assert store.load("another") is None
    assert store.load("one signature") == "code"


def test_a_full_disk_is_no_reason_to_fail(store, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store, "_save_data", full)
    store.save("another", "code")
    assert store.load("another") is None


@pytest.mark.parametrize(
    ("chosen", "numbas", "under"), [("own", None, "own/compiled"), ("own", "other", None), ("off", None, None)]
)
def test_one_variable_moves_the_machine_code_too(monkeypatch, tmp_path, chosen, numbas, under):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("TPJB_CACHE", "off" if chosen == "off" else str(tmp_path / chosen))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    if numbas:
        monkeypatch.setenv("NUMBA_CACHE_DIR", numbas)
    compilation._compiler.__wrapped__()
    assert (numba.config.CACHE_DIR or None) == (under and str(tmp_path / under))


def _checked(x):
    if x < 0.0:
        raise ValueError("below zero")
    return math.sqrt(x)


def _root(x):
    return _checked(x)


def test_an_error_in_a_part_comes_out_of_the_loop_that_took_it_in():
    inner(_checked)
    root = compilation._without_cache(numba, _root)
    assert root(4.0) == 2.0
    with pytest.raises(ValueError, match="below zero"):
        root(-4.0)


def test_a_numba_that_is_built_otherwise_compiles_parts_its_own_way(monkeypatch):
    assert "pipeline_class" in compilation._part_options()
    monkeypatch.setitem(sys.modules, "numba.core.codegen", None)
    assert compilation._part_options.__wrapped__() == compilation._OPTIONS
