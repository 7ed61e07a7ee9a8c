"""The second process that compiles: only where nothing is compiled yet."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import model
import model.statics.compiled.iteration
from model.bearing_file import load_bearing
from model.predict import predict
from tpjb_ident.compare.warm_up import COMPILED, _compiled_before, warming_up


def test_what_was_compiled_is_found_where_numba_keeps_it(rocker_file):
    predict(load_bearing(rocker_file), 5000.0, speed=100.0, excitation=np.array([100.0]), mesh=(24, 4))
    cache = model.statics.compiled.iteration.iterate._cache._cache_path
    kept = [path for folder in model.__path__ for path in Path(folder).glob(COMPILED)]
    assert {str(path.parent) for path in kept} == {cache} or not cache.startswith(model.__path__[0])


def test_nothing_is_compiled_twice(tmp_path, monkeypatch):
    monkeypatch.setattr(model, "__path__", [str(tmp_path)])
    assert not _compiled_before()
    kept = tmp_path / COMPILED.replace("*", "1")
    kept.parent.mkdir(parents=True)
    kept.touch()
    assert _compiled_before()
    with warming_up("no bearing") as wait:
        assert wait() is None
