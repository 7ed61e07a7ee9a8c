"""Set up the checkout's own virtual environment and run the project inside it (standard library only).

Used by ``python3 tpjb_ident``, ``python3 tests`` and ``.ci/run``. The environment is ``.venv`` in the
checkout; it is keyed on pyproject.toml, the Python version and the checkout's place, so that a second
call only reads one small file. Debian's "externally managed" Python is never touched.

    python3 .ci/bootstrap.py [EXTRA ...]     set up with these extras, print the environment's Python
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
MARKER = VENV / "tpjb-bootstrap.json"
LOG = VENV / "bootstrap.log"
BIN = VENV / ("Scripts" if os.name == "nt" else "bin")
PYTHON = BIN / ("python.exe" if os.name == "nt" else "python")
#: Settings of the caller's shell that would send the installation, or an import, somewhere else.
FOREIGN = ("PYTHONHOME", "PYTHONPATH", "PIP_USER", "PIP_TARGET", "PIP_PREFIX", "PIP_REQUIRE_VIRTUALENV",
           "PIP_PYTHON", "__PYVENV_LAUNCHER__")  # fmt: skip
#: Python compiles what is used when it is used; all of it at once took half of the time and a fifth of the disk.
NO_BYTECODE = "--no-compile"
NETWORK_SIGNS = ("resolution", "NewConnectionError", "ConnectTimeout", "ReadTimeout", "ProxyError", "SSLError",
                 "Connection refused", "dns error", "Failed to fetch", "Network is unreachable")  # fmt: skip
#: What of pip's or uv's talk the person who waits sees.
SHOWN = ("Collecting", "Installing", "Building", "Downloading", "Resolved", "WARNING: Retrying")


class SetupError(Exception):
    """The environment cannot be made; the message says why and what to do."""


def run(module: str, arguments: Iterable[str] = (), extras: Iterable[str] = ("test",)) -> None:
    """Replace this process by ``python -m module arguments`` inside the environment."""
    try:
        ensure(extras)
    except SetupError as error:
        sys.exit(f"tpjb-ident set-up: {error}")
    except KeyboardInterrupt:
        sys.exit("tpjb-ident set-up: interrupted; run the same command again to finish it.")
    # -P: neither the checkout's folders nor the user's may shadow an installed module
    command = [str(PYTHON), "-P", "-m", module, *arguments]
    sys.stdout.flush()
    if os.name == "nt":  # execv there returns to the prompt before the work is done
        sys.exit(subprocess.call(command, env=_environment()))
    os.execve(command[0], command, _environment())


def ensure(extras: Iterable[str] = ("test",)) -> Path:
    """Make or complete `.venv`; return its Python."""
    wanted = set(extras)
    if _ready(wanted):
        return PYTHON
    with _lock():
        if not _ready(wanted):  # another process may have done it while this one waited
            _make(wanted)
    return PYTHON


def _key() -> str:
    version = f"{sys.version_info[0]}.{sys.version_info[1]}"
    parts = (b"1", (ROOT / "pyproject.toml").read_bytes(), str(ROOT).encode(), version.encode())
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


def _marker() -> dict[str, object]:
    try:
        found = json.loads(MARKER.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _ready(wanted: set[str]) -> bool:
    marker = _marker()
    return PYTHON.exists() and marker.get("key") == _key() and wanted <= set(marker.get("extras", ()))


def _make(wanted: set[str]) -> None:
    marker = _marker()
    if marker.get("key") == _key():
        wanted = wanted | set(marker["extras"])
    print(f"Setting up {VENV} (once; it downloads about 200 MB from PyPI) ...", flush=True)
    try:
        _make_venv(ours=bool(marker))
        MARKER.unlink(missing_ok=True)
        installer = _installer()
        _install([*installer, "--editable", f"{ROOT}[{','.join(sorted(wanted))}]"])
        MARKER.write_text(json.dumps({"key": _key(), "extras": sorted(wanted)}), encoding="utf-8")
    except OSError as error:
        raise SetupError(
            f"cannot write the environment in {VENV}: {error.strerror or error}. "
            "Use a checkout on a disk with room that you may write to."
        ) from error
    print("Set-up done.", flush=True)


def _make_venv(ours: bool) -> None:
    if importlib.util.find_spec("venv") is None:
        raise SetupError(f"this Python has no 'venv' module. {_advice()}")
    version = _version_of(PYTHON)
    clear = ["--clear"] if ours and version != sys.version_info[:2] else []
    if version is not None and version < (3, 11) and not clear:
        raise SetupError(
            f"{VENV} exists and holds Python {version[0]}.{version[1]}, 3.11 is needed. Remove it and run again."
        )
    command = [sys.executable, "-m", "venv", "--without-pip", *clear, str(VENV)]
    done = subprocess.run(command, capture_output=True, text=True, env=_environment())
    if done.returncode != 0 or not PYTHON.exists():
        raise SetupError(f"'{' '.join(command)}' failed: {(done.stderr or done.stdout).strip()[-600:]}")


def _version_of(python: Path) -> tuple[int, int] | None:
    if not python.exists():
        return None
    code = "import sys; print(sys.version_info[0], sys.version_info[1])"
    done = subprocess.run([str(python), "-c", code], capture_output=True, text=True)
    if done.returncode != 0:
        return None
    major, minor = done.stdout.split()
    return int(major), int(minor)


def _works(*command: str) -> bool:
    return subprocess.run(command, capture_output=True, env=_environment()).returncode == 0


def _installer() -> list[str]:
    """Return the command that installs into `.venv`, by whatever this machine has."""
    own = [str(PYTHON), "-m", "pip", "install", NO_BYTECODE]
    if _works(str(PYTHON), "-m", "pip", "--version") or _works(str(PYTHON), "-m", "ensurepip", "--default-pip"):
        return own
    # Debian without python3-venv: ensurepip is missing, but a pip outside can install into the environment
    if _works(sys.executable, "-m", "pip", "--python", str(PYTHON), "--version"):
        return [sys.executable, "-m", "pip", "--python", str(PYTHON), "install", NO_BYTECODE]
    uv = shutil.which("uv")
    if uv:
        return [uv, "pip", "install", "--python", str(PYTHON)]
    if _works(sys.executable, "-m", "virtualenv", "--version"):
        subprocess.run([sys.executable, "-m", "virtualenv", "--quiet", str(VENV)], check=False, env=_environment())
        if _works(str(PYTHON), "-m", "pip", "--version"):
            return own
    raise SetupError(f"no pip, ensurepip, uv or virtualenv found for {sys.executable}. {_advice()}")


def _advice() -> str:
    return (
        "On Debian or Ubuntu: sudo apt install python3-venv; elsewhere install Python 3.11 or newer from python.org. "
        "Then run the same command again."
    )


def _install(command: list[str]) -> None:
    """Run the installer with its output in a log, one changing line for the person who waits."""
    show = sys.stdout.isatty()
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with LOG.open("w", encoding="utf-8") as log, subprocess.Popen(command, **pipes, env=_environment()) as process:
        for line in process.stdout or ():
            log.write(line)
            if show and line.startswith(SHOWN):
                print(f"\r  {line.strip()[:76]:<76}", end="", flush=True)
    code = process.returncode
    if show:
        print(f"\r{'':<78}\r", end="", flush=True)
    if code != 0:
        text = LOG.read_text(encoding="utf-8")
        raise SetupError(f"{_cause(text)}\n  Full log: {LOG}\n  Run the same command again when it is mended.")


def _cause(log: str) -> str:
    if any(sign in log for sign in NETWORK_SIGNS):
        return "PyPI cannot be reached. Is there a network, or a proxy to set (HTTPS_PROXY)?"
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    errors = [line for line in lines if line.lower().startswith("error:")] or lines
    return "\n  ".join(["the installation failed:", *(line[:300] for line in errors[-3:])])


def _environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name not in FOREIGN}


@contextlib.contextmanager
def _lock() -> Iterator[None]:
    """Let one process at a time set up: this file itself is what they lock."""
    with Path(__file__).open("rb") as handle:
        if os.name == "nt":
            import msvcrt

            handle.seek(1 << 30)  # Windows locks are mandatory: a byte that nobody reads
            while True:
                with contextlib.suppress(OSError):  # LK_LOCK gives up after ten seconds
                    msvcrt.locking(handle.fileno(), msvcrt.LK_LOCK, 1)
                    break
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX)
        yield  # closing the file lets go


if __name__ == "__main__":
    try:
        print(ensure(sys.argv[1:] or ["test"]))
    except SetupError as error:
        sys.exit(f"tpjb-ident set-up: {error}")
