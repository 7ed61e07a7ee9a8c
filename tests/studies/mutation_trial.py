"""A pytest run that tries mutants instead of running the tests once: collect, survey, then a fork for every mutant.

The survey (in a fork, under coverage) tells which lines each test reaches, fixtures included, and how long it takes. A
mutant then runs the tests that reach its statement, the quickest first, in a fork of the process that has the libraries
loaded and the tests collected; the first failure ends it. The mutant's code is put into the function objects that
exist, so that every module that has imported them has it. Tests are taken as they are, except that hypothesis draws
without chance and does not shrink, and that a mutant may not take much more processor time than its tests did.
"""

from __future__ import annotations

import ast
import contextlib
import gc
import hashlib
import os
import pickle
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import mutation_operators
import pytest

ROOT = Path(__file__).resolve().parents[2]
#: Seconds of tests that a mutant gets; tests that alone take longer than `LONGEST_TEST` are left out.
BUDGET, LONGEST_TEST = 12.0, 4.0
MEMORY = 12 << 30


@dataclass
class Verdict:
    """What became of the mutants of a file."""

    file: str
    #: hash of the source: numbers of mutants mean nothing elsewhere
    source: str
    killed: list[str] = field(default_factory=list)
    survived: list[str] = field(default_factory=list)
    #: of the survivors, those whose statement no quick test reaches
    unreached: int = 0
    equal: list[str] = field(default_factory=list)
    seconds: float = 0.0


@dataclass
class Trial:
    """The pytest plugin.

    Attributes
    ----------
    files : list of str
        Sources, relative to the checkout.
    equal : dict
        (file, line of source, what) of mutants that are the same program, with the reason.
    chosen : callable
        From all mutants of a file to those that are tried.
    say : callable
        Where a finished file is reported.
    budget : float
        Seconds of tests that a mutant gets.
    """

    files: list[str]
    equal: dict[tuple[str, str, str], str]
    chosen: Callable[[str, list[mutation_operators.Mutant]], list[mutation_operators.Mutant]]
    say: Callable[[Verdict], None]
    budget: float = BUDGET

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run mutants in place of the tests."""
        for item in session.items:
            _without_chance(item)
        survey = _in_a_fork(lambda: _survey(session, self.files), None)
        if not isinstance(survey, Survey):
            raise pytest.UsageError(f"the survey failed: {survey}")
        if survey.failed:
            raise pytest.UsageError(f"tests fail without any mutant: {', '.join(survey.failed)}")
        gc.collect()
        gc.freeze()  # a fork that need not copy what is never changed
        for file in self.files:
            self.say(self._file(session, file, survey))
        return True

    def _file(self, session: pytest.Session, file: str, survey: Survey) -> Verdict:
        source = (ROOT / file).read_text(encoding="utf-8")
        tree, lines = ast.parse(source), source.splitlines()
        verdict, begun = Verdict(file, hashlib.sha256(source.encode()).hexdigest()), time.time()
        for mutant in self.chosen(file, mutation_operators.mutants(tree)):
            told = f"#{mutant.number} {mutant.line}: {mutant.what} | {lines[mutant.line - 1].strip()}"
            if (file, lines[mutant.line - 1].strip(), mutant.what) in self.equal:
                verdict.equal.append(told)
                continue
            tests = survey.reaching(file, mutant.first, mutant.last, self.budget)
            mutant.make()
            try:
                code = compile(ast.fix_missing_locations(tree), str(ROOT / file), "exec")
            finally:
                mutant.undo()
            items = [session.items[i] for i in tests]
            allowed = 4 * sum(survey.seconds[i] for i in tests) + 5.0
            run = _runner(session, file, code, items)
            failed = bool(items) and _in_a_fork(run, allowed) is not True
            (verdict.killed if failed else verdict.survived).append(told)
            verdict.unreached += not items
        verdict.seconds = time.time() - begun
        return verdict


@dataclass
class Survey:
    """What each test reaches and takes: per test, file -> lines, and seconds."""

    lines: list[dict[str, set[int]]]
    modules: list[str]
    seconds: list[float]
    failed: list[str]

    def reaching(self, file: str, first: int, last: int, budget: float) -> list[int]:
        """Tests that run a line in this range, as far as the budget goes: quick modules and quick tests first.

        Tests of one module stay together, since they share fixtures.
        """
        span = set(range(first, last + 1))
        hits = [i for i, own in enumerate(self.lines) if span & own.get(file, set())]
        hits.sort(key=lambda i: self.seconds[i])
        kept, total = [], 0.0
        for i in hits:
            total += self.seconds[i]
            if self.seconds[i] <= LONGEST_TEST and total <= budget:
                kept.append(i)
        rank = {module: place for place, module in enumerate(dict.fromkeys(self.modules[i] for i in kept))}
        return sorted(kept, key=lambda i: rank[self.modules[i]])


def _survey(session: pytest.Session, files: list[str]) -> Survey:
    """Run every test once under coverage, one context per test and per shared fixture."""
    import coverage

    cover = coverage.Coverage(data_file=None, include=[str(ROOT / f) for f in files], config_file=False)
    watch = _Watch(cover)
    session.config.pluginmanager.register(watch)
    seconds, failed = [], []
    cover.start()
    for item, then in zip(session.items, [*session.items[1:], None]):
        for value in vars(getattr(item, "module", ModuleType("none"))).values():
            if callable(getattr(value, "cache_clear", None)):
                value.cache_clear()
        watch.enter(item.nodeid)
        begun = time.process_time()
        if not _passes(session, item, then):
            failed.append(item.nodeid)
        seconds.append(time.process_time() - begun)
    cover.stop()
    reached: dict[str, dict[str, set[int]]] = {}
    data = cover.get_data()
    for file in files:
        for line, contexts in data.contexts_by_lineno(str(ROOT / file)).items():
            for context in contexts:
                reached.setdefault(context, {}).setdefault(file, set()).add(line)
    modules = [item.nodeid.split("::")[0] for item in session.items]
    return Survey([_of_test(item, reached) for item in session.items], modules, seconds, failed)


def _of_test(item: pytest.Item, reached: dict[str, dict[str, set[int]]]) -> dict[str, set[int]]:
    """Lines of a test and of the shared fixtures that it uses."""
    names = [item.nodeid, *(_shared(item.nodeid.split("::")[0], f) for f in getattr(item, "fixturenames", []))]
    names += [_shared("", f) for f in getattr(item, "fixturenames", [])]
    merged: dict[str, set[int]] = {}
    for name in names:
        for file, lines in reached.get(name, {}).items():
            merged.setdefault(file, set()).update(lines)
    return merged


def _shared(place: str, fixture: str) -> str:
    return f"fixture {place} {fixture}"


class _Watch:
    """Switches the context of coverage with tests and shared fixtures."""

    def __init__(self, cover: Any) -> None:
        self.cover, self.now = cover, ""

    def enter(self, name: str) -> None:
        self.now = name
        self.cover.switch_context(name)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any, request: Any) -> Iterator[None]:
        if fixturedef.scope == "function":
            return (yield)
        outer = self.now
        place = "" if fixturedef.scope == "session" else request.node.nodeid.split("::")[0]
        self.enter(_shared(place, fixturedef.argname))
        try:
            return (yield)
        finally:
            self.enter(outer)


def _passes(session: pytest.Session, item: pytest.Item, then: pytest.Item | None) -> bool:
    before = session.testsfailed
    session.config.hook.pytest_runtest_protocol(item=item, nextitem=then)
    return session.testsfailed == before


def _runner(session: pytest.Session, file: str, code: Any, items: list[pytest.Item]) -> Callable[[], bool]:
    """Put the mutant in place and run its tests until one fails."""

    def run() -> bool:
        session.config.pluginmanager.unregister(name="terminalreporter")
        _put_in_place(file.removesuffix(".py").replace("/", "."), code)
        return all(_passes(session, item, then) for item, then in zip(items, [*items[1:], None]))

    return run


def _put_in_place(name: str, code: Any) -> None:
    """Give the functions of a loaded module the code and plain defaults of the mutant's."""
    old = sys.modules[name]
    new = ModuleType(name)
    new.__file__ = old.__file__
    sys.modules[name] = new  # dataclasses look their module up
    exec(code, new.__dict__)
    sys.modules[name] = old
    _exchange(vars(old), vars(new), name)


def _exchange(old: Any, new: Any, module: str) -> None:
    for key, fresh in list(new.items()):
        was = old.get(key)
        if isinstance(fresh, type) and isinstance(was, type):
            if fresh.__module__ == module:
                _exchange(vars(was), vars(fresh), module)
            continue
        for a, b in zip(_inner(was), _inner(fresh)):
            if b.__module__ == module or "<string>" in b.__code__.co_filename:
                a.__code__ = b.__code__ if len(a.__code__.co_freevars) == len(b.__code__.co_freevars) else a.__code__
                a.__defaults__ = _plain(a.__defaults__, b.__defaults__)
        if callable(getattr(was, "cache_clear", None)):
            was.cache_clear()


def _inner(value: Any) -> list[FunctionType]:
    """The function under properties, class methods and caches."""
    if isinstance(value, property):
        return [f for f in (value.fget, value.fset) if isinstance(f, FunctionType)]
    for name in ("__func__", "__wrapped__", "func"):
        value = getattr(value, name, value) if not isinstance(value, (FunctionType, ModuleType)) else value
    if isinstance(value, FunctionType) and hasattr(value, "__wrapped__"):
        value = value.__wrapped__
    return [value] if isinstance(value, FunctionType) else []


def _plain(old: tuple[Any, ...] | None, new: tuple[Any, ...] | None) -> tuple[Any, ...] | None:
    """New defaults where they are numbers and truth values; objects stay the module's own."""
    if old is None or new is None or len(old) != len(new):
        return old
    return tuple(b if isinstance(b, (int, float, complex)) else a for a, b in zip(old, new))


def _without_chance(item: pytest.Item) -> None:
    """Let hypothesis draw the same examples every time and stop at the first that fails."""
    test = getattr(item, "obj", None)
    if not hasattr(test, "hypothesis"):
        return
    from hypothesis import Phase, settings

    own = getattr(test, "_hypothesis_internal_use_settings", None) or settings.default
    calm = settings(own, phases=(Phase.explicit, Phase.generate), derandomize=True, database=None)
    getattr(test, "__func__", test)._hypothesis_internal_use_settings = calm


def _in_a_fork(work: Callable[[], Any], seconds: float | None) -> Any:
    """Result of `work` in a child process; None where it died or took too long (of processor or clock)."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        _be_the_child(work, seconds, write)
    os.close(write)
    begun, taken = time.time(), b""
    os.set_blocking(read, False)
    try:
        while True:
            with contextlib.suppress(BlockingIOError):
                part = os.read(read, 1 << 20)
                if not part:
                    break
                taken += part
                continue
            if seconds is not None and time.time() - begun > 20 * seconds + 60:
                os.killpg(child, signal.SIGKILL)
                taken = b""
                break
            time.sleep(0.004)
    finally:
        os.close(read)
        os.waitpid(child, 0)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
    return pickle.loads(taken) if taken else None


def _be_the_child(work: Callable[[], Any], seconds: float | None, write: int) -> None:
    """Do the work, send its result, end."""
    os.setpgid(0, 0)
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(null, stream)
    try:
        if seconds is not None:
            limit = int(seconds) + 1
            resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        answer = pickle.dumps(work())
    except BaseException as error:
        answer = pickle.dumps(f"{type(error).__name__}: {error}")
    while answer:
        answer = answer[os.write(write, answer) :]
    os._exit(0)
