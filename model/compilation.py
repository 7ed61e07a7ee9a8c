"""How the inner loops are compiled, and kept on disk without going stale.

numba keeps machine code per source file. A loop that was inlined into another file's loop changes without that file
noticing: after an edit or an upgrade the old code would go on running, without a word. Here every compiled function is
stamped with the sources of all of them.

numba itself is imported at the first call of a loop: a process that only reads, draws or unpickles does without.
"""

import contextlib
import functools
import hashlib
import inspect
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

#: Sums may be reordered, but NaN and infinity keep their meaning.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "arcp", "nsz"},
    "nogil": True,
    "no_cfunc_wrapper": True,
}
#: Where nothing can be written: a read-only installation and a user without a home, as services and containers have.
_NO_PLACE = (
    "there is no folder to keep the model's machine code in, so every process compiles it again, which takes half a "
    "minute: set TPJB_CACHE to a folder that can be written"
)
#: Blocks of code: parts with fewer are optimised before they are taken in, else inner loops run 15 % slower. Larger
#: ones consist of such parts, and to optimise them at every level again is what made compilation long.
_SMALL_PART = 250
#: Loops that become part of others and that numba does not know yet.
_inner: list[Callable[..., Any]] = []


class _Kernel:
    """A loop that is compiled at its first call, or taken from the disk; inside other loops it is part of them."""

    def __init__(self, function: Callable[..., Any]) -> None:
        functools.update_wrapper(self, function)
        self._function = function

    def __call__(self, *values: Any) -> Any:
        """What the loop answers to these values."""
        return self.dispatcher(*values)

    def __reduce__(self) -> str:
        return self._function.__qualname__  # pickled as functions are, by name

    @functools.cached_property
    def dispatcher(self) -> Any:
        """Numba's."""
        return _dispatcher(_compiler(), self._function)


@functools.cache
def _compiler() -> Any:
    """numba, with its machine code where we want it."""
    import numba
    import numba.extending

    folder = os.environ.get("TPJB_CACHE", "").strip()
    if folder.lower() not in ("", "off") and "NUMBA_CACHE_DIR" not in os.environ:  # as pad solutions are
        numba.config.CACHE_DIR = str(Path(folder) / "compiled")  # type: ignore[attr-defined]

    return numba


def kernels() -> list[Path]:
    """Files with compiled functions: this one and those that import from it."""
    files = sorted(Path(__file__).parent.rglob("*.py"))
    return [path for path in files if path == Path(__file__) or b"\nfrom model.compilation" in path.read_bytes()]


@functools.cache
def stamp() -> str:
    """Of the sources of all kernels."""
    digest = hashlib.sha256()
    for path in kernels():
        digest.update(path.read_bytes())
    return digest.hexdigest()


@functools.cache  # once, not for every loop
def _warn_once(message: str) -> None:
    warnings.warn(message, RuntimeWarning, stacklevel=4)


#: Bytes of a digest.
_DIGEST = 32
#: What `_cache_type` relies on in numba.
_LOADING = ("_load_overload", "_guard_against_spurious_io_errors")


@functools.cache
def _cache_type() -> Any:
    from numba.core.caching import FunctionCache

    class Cache(FunctionCache):  # type: ignore[misc]  # numba has no types
        """Loads machine code without what only a compiler needs: half of numba, 0.6 s of a process that predicts."""

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            _name_allocation(target_context)
            loaded = None
            with self._guard_against_spurious_io_errors():
                loaded = self._load_overload(sig, target_context)
            if loaded is None:
                _register_inner_loops()
            return loaded

        def save_overload(self, sig: Any, data: Any) -> None:
            with contextlib.suppress(AttributeError, ImportError):  # a numba that is built otherwise keeps all
                data.library._shared_module = _names_of(data.library)
            super().save_overload(sig, data)

    return Cache


def _name_allocation(target_context: Any) -> None:
    """Let machine code find what allocates arrays.

    numba compiles something besides that only new code needs: half of LLVM, 22 MB of a process. It makes up for it
    where it compiles.
    """
    from numba.core.runtime import rtsys

    try:
        from numba.core.codegen import ll
        from numba.core.runtime._nrt_python import c_helpers
    except ImportError:  # a numba that is built otherwise
        rtsys.initialize(target_context)
        return
    for name, address in c_helpers.items():
        ll.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def _names_of(library: Any) -> Any:
    """A module with the names of a library's functions and nothing in them.

    numba keeps a function's code also as other functions would take it in, which none does: 23 MB of a process.
    """
    from numba.core.codegen import ll, llvmir

    module = library.codegen._create_empty_module(library.name)
    for function in library._final_module.functions:
        if not function.is_declaration:
            named = llvmir.Function(module, llvmir.FunctionType(llvmir.VoidType(), []), function.name)
            llvmir.IRBuilder(named.append_basic_block()).ret_void()
    return ll.parse_assembly(str(module))


@functools.cache
def _store_type() -> Any:
    from numba.core.caching import IndexDataCacheFile

    class Store(IndexDataCacheFile):  # type: ignore[misc]
        """Files of machine code that know whose they are: what is damaged, or was written by two at once, is no code.

        Two processes that compile at the same time may give one file's name to two signatures.
        """

        def load(self, key: Any) -> Any:
            with contextlib.suppress(Exception):  # what a damaged file raises is any error at all
                content = Path(self._data_path(self._load_index()[key])).read_bytes()
                if content[-_DIGEST:] == _digest(key, content[:-_DIGEST]):
                    return super().load(key)
            return None

        def save(self, key: Any, data: Any) -> None:
            self.key = key
            with contextlib.suppress(OSError):  # a full disk: the next process compiles again
                super().save(key, data)

        def _dump(self, obj: Any) -> bytes:
            code = super()._dump(obj)
            return code + _digest(self.key, code)  # who reads it does not read on to here

        def _load_index(self) -> Any:
            with contextlib.suppress(Exception):  # it may also name what an older version had
                return super()._load_index()
            return {}

    return Store


def _digest(key: Any, code: bytes) -> bytes:
    return hashlib.sha256(repr(key).encode() + code).digest()


def _register_inner_loops() -> None:
    overload = _compiler().extending.overload
    while _inner:
        loop = _inner.pop()
        body = inspect.unwrap(loop)
        overload(loop, jit_options=_part_options(), strict=False)(lambda *_, body=body: body)


@functools.cache
def _part_options() -> dict[str, Any]:
    """Of a loop that others take in: it is optimised and becomes machine code in them, once, not by itself before."""
    try:
        from numba.core.codegen import JITCodeLibrary
        from numba.core.compiler import CompilerBase, DefaultPassBuilder
        from numba.core.compiler_machinery import register_pass
        from numba.core.typed_passes import NativeLowering
    except ImportError:  # a numba that is built otherwise compiles them again and again: slower, and the same numbers
        return _OPTIONS

    class Part(JITCodeLibrary):  # type: ignore[misc]
        @property
        def codegen(self) -> Any:
            return self

        def set_env(self, *_: Any) -> None:
            """No machine code, nothing to set."""

        def _optimize_final_module(self) -> None:
            blocks = sum(len(list(function.blocks)) for function in self._final_module.functions)
            if blocks < _SMALL_PART:
                super()._optimize_final_module()

        def _finalize_final_module(self) -> None:
            self._finalized = True

    @register_pass(mutates_CFG=True, analysis_only=False)
    class PartLowering(NativeLowering):  # type: ignore[misc]
        _name = "part_lowering"

        def run_pass(self, state: Any) -> Any:
            state.library = Part(state.targetctx.codegen(), state.func_id.func_qualname)
            return super().run_pass(state)

    class PartCompiler(CompilerBase):  # type: ignore[misc]
        def define_pipelines(self) -> list[Any]:
            passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
            for place, (step, text) in enumerate(passes.passes):
                if step is NativeLowering:
                    passes.passes[place] = PartLowering, text
            passes.finalize()
            return [passes]

    return {**_OPTIONS, "no_cpython_wrapper": True, "pipeline_class": PartCompiler}


def _dispatcher(numba: Any, function: Callable[..., Any]) -> Any:
    try:
        dispatcher = numba.njit(cache=True, **_OPTIONS)(function)
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        _warn_once(_NO_PLACE)
        return _without_cache(numba, function)
    store: Any = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if not hasattr(store, "_source_stamp"):  # a cache that is built otherwise: compile in every process, trust nothing
        return _without_cache(numba, function)
    store._source_stamp = stamp()
    store.__class__ = _store_type()
    if all(hasattr(dispatcher._cache, name) for name in _LOADING):  # a numba that loads otherwise: its own way
        dispatcher._cache.__class__ = _cache_type()
    else:
        _register_inner_loops()
    return dispatcher


def _without_cache(numba: Any, function: Callable[..., Any]) -> Any:
    _register_inner_loops()
    return numba.njit(**_OPTIONS)(function)


def inner(function: Function) -> Function:
    """Leave a loop to the compiled functions that call it: it becomes part of each, and has no machine code of its own.

    Such a one costs nothing where a process starts, and neither a way in from Python nor a file is made for it.
    """
    _inner.append(function)
    return function


def compiled(function: Function) -> Function:
    """Compile with numba, cached on disk under the stamp of all kernels: a way in from Python."""
    kernel: Any = _Kernel(function)
    _inner.append(kernel)
    return kernel  # type: ignore[no-any-return]
