"""What the fuzzer feeds: each reader with its good files, and the errors that it documents."""

import contextlib
import functools
import io
import math
import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.foreign_files import write_columns, write_groups, write_mat73
from tests.manifests import PROBES, manifest, write_hdf5

ROOT = Path(__file__).resolve().parents[2]
RUN = {"id": "c-1", "file": "c-1.csv", "kind": "clearance"}
RATE = {"sample_rate": "10 Hz"}
CSV_MANIFEST = manifest(PROBES | {"Zeit": {"quantity": "time", "unit": "s"}}, RUN, acquisition=RATE)


@dataclass(frozen=True)
class Target:
    """One reader under test: good inputs, what takes an input, the errors that are an answer, late imports."""

    name: str
    seeds: tuple[bytes, ...]
    feed: Callable[[bytes], None]
    documented: tuple[type[BaseException], ...]
    preload: tuple[str, ...] = ()


def _text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


def manifest_target(folder: Path) -> Target:
    """`rigdata.manifest.manifest.parse_manifest`."""
    from rigdata.manifest.manifest import parse_manifest
    from rigdata.problem import RigDataError

    seeds = (CSV_MANIFEST.encode(), _shortened(_demo_manifest()))

    def feed(data: bytes) -> None:
        read = parse_manifest(_text(data))
        assert read.runs
        assert all(channel.gain > 0 for channel in read.channels.values())

    return Target("manifest", seeds, feed, (RigDataError,))


def _ignore(result: object) -> None:
    str(result)


def _demo_manifest() -> bytes:
    import h5py

    with h5py.File(ROOT / "rigdata" / "samples" / "demo.h5") as file:
        value = file.attrs["manifest"]
    return value if isinstance(value, bytes) else str(value).encode()


def _shortened(manifest: bytes) -> bytes:
    """The demo's manifest with one run of each kind: parsing the other dozens would only cost time."""
    head, *runs = manifest.split(b"[[runs]]\n")
    by_kind = {line: run for run in runs for line in run.splitlines() if line.startswith(b"kind")}
    return b"[[runs]]\n".join([head, *by_kind.values()])


def bearing_target(folder: Path) -> Target:
    """`model.bearing_file.parse_bearing`."""
    from model.bearing import BearingError
    from model.bearing_file import parse_bearing

    seeds = tuple(p.read_bytes() for p in sorted((ROOT / "model" / "bearings").glob("*.toml")))
    return Target("bearing", seeds, lambda d: _ignore(parse_bearing(_text(d), "b.toml")), (BearingError,))


def pivots_target(folder: Path) -> Target:
    """`model.pivots.load_pivots`, and the law at two loads."""
    from model.bearing import BearingError
    from model.pivots import load_pivots

    loads = np.r_[0.0, np.geomspace(2.0, 12000.0, 12)]
    pads = [
        f'[[pads]]\npad = {k}\nlaw = "hertz-line"\nvalid_from_N = 50.0\nvalid_to_N = 5000.0\n'
        f"force_N = {[float(w) for w in loads]}\ndeflection_m = {[float(2e-8 * w**0.7) for w in loads]}\n"
        for k in range(1, 4)
    ]
    text = 'schema = "tpjb-pivots/1"\nsource = "x"\nincludes_housing = true\n' + "\n".join(pads)

    def feed(data: bytes) -> None:
        path = folder / "pivots.toml"
        path.write_bytes(data)
        for law in load_pivots(path):
            law.deflection(1000.0), law.stiffness(1000.0)

    return Target("pivots.toml", (text.encode(), "\n".join([text[:70], *pads[:1]]).encode()), feed, (BearingError,))


def effects_target(folder: Path) -> Target:
    """`model.effects.load_effects`, and the effects applied to the rocker bearing."""
    from model.bearing import BearingError
    from model.effects import EffectError, load_effects

    text = (
        'schema = "tpjb-effects/1"\n[[effects]]\nname = "soft_pivot"\npad = 5\nstiffness_factor = 0.3\n'
        '[effects.stiffness_factor_interval]\nlo = 0.2\nhi = 0.4\n[[effects]]\nname = "probe_gain"\nfactor = 1.02\n'
        '[[effects]]\nname = "channel_delay"\ndelay = "0.2 ms"\n'
    )

    def feed(data: bytes) -> None:
        path = folder / "x.effects.toml"
        path.write_bytes(data)
        _ignore(load_effects(path))

    return Target("effects", (text.encode(),), feed, (EffectError, BearingError))


def csv_target(folder: Path) -> Target:
    """One CSV record: dialect, numbers, times."""
    from rigdata.manifest.manifest import parse_manifest
    from rigdata.problem import RigDataError
    from rigdata.readers.file_reader import FileReader

    manifest = parse_manifest(CSV_MANIFEST)
    record = folder / "c-1.csv"

    def feed(data: bytes) -> None:
        record.write_bytes(data)
        reader = FileReader(record, "c-1.csv", "c-1", manifest.channels, manifest.sample_rate, manifest.csv)
        length = reader.length()
        reader.read(["X1A", "X1B"], 0, length)
        reader.rate(), reader.time(0, length), reader.problems()

    preload = ("pyarrow.csv", "pyarrow.compute", "rigdata.readers.text.csv")
    return Target("csv", _csv_seeds(), feed, (RigDataError,), preload)


def _csv_seeds() -> tuple[bytes, ...]:
    rows = [(0.5 * i, 1.5 + math.sin(i), -2.25 * i) for i in range(12)]
    out = []
    for delimiter, decimal, end, codec in (
        (";", ",", "\r\n", "cp1252"),
        (",", ".", "\n", "utf-8-sig"),
        ("\t", ".", "\n", "utf-16"),
        (" ", ".", "\n", "ascii"),
    ):
        body = [delimiter.join(f"{v:.4f}".replace(".", decimal) for v in row) for row in rows]
        names = delimiter.join(("Zeit", "X1A", "X1B"))
        units = delimiter.join(("s", "um", "um"))
        head = [] if delimiter == " " else ["Pr\xfcfstand" if codec != "ascii" else "rig", "operator: A"]
        out.append(end.join([*head, names, units, *body, ""]).encode(codec, "replace"))
    return tuple(out)


def hdf5_target(folder: Path) -> Target:
    """A small HDF5 campaign, fuzzed as bytes: opened, every channel read."""
    import rigdata

    text = manifest(PROBES | {"T": {"quantity": "time", "unit": "s"}}, RUN, acquisition=RATE)
    columns = {name: np.sin(0.1 * np.arange(40) + k).astype("f4") for k, name in enumerate(PROBES)}
    seeds = []
    for storage in ({"compression": "gzip", "chunks": (16,)}, {}):
        libver = "earliest" if storage else "latest"
        seeds.append(write_hdf5(folder / "seed.h5", text, columns, 100.0, libver=libver, **storage).read_bytes())
    fuzzed = folder / "fuzzed.h5"

    def feed(data: bytes) -> None:
        fuzzed.write_bytes(data)
        run = rigdata.load_campaign(fuzzed).run("c-1")
        run.record("X1A")
        run.vector("displacement")
        run.reader.problems()

    return Target("hdf5", tuple(seeds), feed, (rigdata.RigDataError,), ("rigdata.readers.hdf5.reader",))


def foreign_target(folder: Path, suffix: str) -> Target:
    """One of the other loggers' formats."""
    from rigdata.problem import RigDataError
    from tests.foreign_files import read_series

    path = folder / ("fuzzed.mat" if suffix == ".mat73" else f"fuzzed{suffix}")
    seed = folder / f"seed{suffix}"
    time = np.arange(120) / 100.0
    values = np.sin(time)
    if suffix == ".mat73":
        write_mat73(seed, {"time": time, "s/X1A": values})
    elif suffix in (".mat", ".parquet"):
        write_columns(seed, {"time": time, "X1A": values, "X1B": 2 * values})
    elif suffix == ".asc":
        slow = {"Time  2 - slow [s]": np.arange(4.0), "T1 [degC]": 20.0 + np.arange(4)}
        write_columns(seed, {"Time  1 - fast [s]": time[:12], "X1A [um]": values[:12]} | slow)
    else:
        slow = [(time[:5], {"T1": ("degC", values[:5])})] * (suffix == ".mf4")
        write_groups(seed, (time[:20], {"X1A": ("um", values[:20])}), *slow)

    def feed(data: bytes) -> None:
        path.write_bytes(data)
        read_series(path, path.name)

    return Target(suffix.lstrip("."), (seed.read_bytes(),), feed, (RigDataError,))


def _coefficient_tables() -> tuple[bytes, ...]:
    """A table as `identify` writes it, and one as somebody reads it off a paper's figures."""
    from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_COLUMNS

    endings = ("", "_lo", "_hi", "_se")
    names = [*POINT_COLUMNS, *(name + end for name in COEFFICIENT_COLUMNS for end in endings), "quality", "converged"]
    rows = []
    for load in (2500.0, 5000.0):
        values = [load, -90.0, 22.0, 25.0]
        for index in range(len(COEFFICIENT_COLUMNS)):
            value = load * 2e4 * (1 + index)
            values += [value, 0.9 * value, 1.1 * value, 0.05 * value]
        rows.append(",".join([*map(repr, values), "ok", "True"]))
    ours = "\n".join([",".join(names), *rows, ""])
    theirs = (
        "# figure 7;;;;\nstatic_load_N;shaft_speed_Hz;kxx_N_per_m;kyy_N_per_m;kyy_N_per_m_se\n"
        "5000;22;;2e8;4e6\n8750;22;1.2e8;;\n"
    )
    return ours.encode(), theirs.encode()


def table_target(folder: Path) -> Target:
    """A table of coefficients that comes back: what is taken is finite, possible and within its intervals."""
    from tpjb_ident.compare.coefficient_table import ERRORS, VALUES, read_coefficients
    from tpjb_ident.errors import BadInputError
    from tpjb_ident.exports.formats import COLUMNS, ExportError, chosen_rows
    from tpjb_ident.runtime.table_reader import read_table

    path = folder / "coefficients.csv"

    def feed(data: bytes) -> None:
        path.write_bytes(data)
        frame = read_table(path)
        with contextlib.suppress(BadInputError):
            rows = read_coefficients(path, 0.05)
            assert rows[["static_load_N", "shaft_speed_Hz"]].gt(0.0).all(axis=None)
            values, errors = rows[VALUES].to_numpy(), rows[ERRORS].to_numpy()
            present = ~np.isnan(values)
            assert np.isfinite(rows[["static_load_N", "shaft_speed_Hz"]]).all(axis=None)
            assert (np.isfinite(values) & np.isfinite(errors) & (errors >= 0.0))[present].all()
        points = chosen_rows(frame).table
        assert (points["excitation_Hz"] >= 0).all()
        for name in COLUMNS.values():
            values, low, high = (points[name + end] for end in ("", "_lo", "_hi"))
            assert not ((values < low) | (values > high) | (low > high)).any()

    return Target("table", _coefficient_tables(), feed, (BadInputError, ExportError))


def record_target(folder: Path) -> Target:
    """run.json and check.json of a results folder, as `verify`, `rerun`, `export` and `view` read them."""
    from tpjb_ident.cli.commands.rerun import _typed
    from tpjb_ident.cli.commands.verify import files_of, recorded
    from tpjb_ident.errors import BadInputError, NotTrustedError
    from tpjb_ident.runtime.output_folder import contradiction
    from tpjb_ident.runtime.provenance import read_document

    older = Path(__file__).resolve().parents[1] / "runtime" / "older"
    (folder / "clearance.csv").write_bytes((older / "clearance.csv").read_bytes())
    seeds = tuple((older / name).read_bytes() for name in ("run.json", "check.json"))

    def feed(data: bytes) -> None:
        (folder / "run.json").write_bytes(data)
        (folder / "check.json").write_bytes(data)
        contradiction(folder / "clearance.csv")
        with contextlib.suppress(BadInputError):
            read_document(folder / "check.json", "tpjb-check")
        for name, entry in recorded(folder).items():
            list(files_of(folder, name, entry, ()))
            _typed([], entry, folder)

    return Target("record", seeds, feed, (BadInputError, NotTrustedError, OSError))


COMMAND_LINES = (
    'predict rocker.toml --pivots kirk --load "5 kN" --speed "22 Hz" --excitation "25 Hz" --thermal isothermal --out o',
    "check none.h5 --out o --json",
    "identify none.h5 --method rlm --norm huber --lines '20, 25 Hz' --delay force=0.2ms --out o",
    "pivot none.h5 --bearing rocker.toml --out o",
    "locus folder --out o -q",
    "compare none.h5 --bearing none.toml --out o",
    "diagnose none.h5 --bearing rocker.toml --out o",
    "simulate none.toml --out o",
    "export folder --to ross --out o",
    "show none.h5 run",
    "init folder --out o",
    "verify folder",
    "--version",
    "--help",
    "identify --workers 0 none.h5",
)


_LATE = """
    rich.console rich.table rich.progress rich.panel pyarrow.parquet pandas numba scipy.interpolate scipy.optimize
    scipy.sparse.linalg statsmodels.api h5py matplotlib.figure matplotlib.backends.backend_svg jinja2 model.predict
    tpjb_ident.clearance.sweep tpjb_ident.identification.identify tpjb_ident.pivot tpjb_ident.compare
    tpjb_ident.diagnosis tpjb_ident.runtime.executors tpjb_ident.clearance.locus tpjb_ident.exports
    rigdata.survey.draft
"""


def command_target(folder: Path) -> Target:
    """The command line: words spoilt; only the exit codes 0, 2 and 3 are an answer (1 is a bug)."""
    import os

    import typer

    from tpjb_ident.cli.commands.app import app

    command = typer.main.get_command(app)  # typer would build it again for every case, which costs three times the rest
    place = folder / "cli"
    (place / "folder").mkdir(parents=True, exist_ok=True)
    (place / "rocker.toml").write_bytes((ROOT / "model" / "bearings" / "rocker.toml").read_bytes())

    def feed(data: bytes) -> None:
        try:
            words = shlex.split(_text(data))[:40]
        except ValueError:
            return
        if words[:1] == ["demo"]:
            return  # a minute of work for no input
        here = Path.cwd()
        os.chdir(place)
        try:
            with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as told:
                command.main(words, prog_name="tpjb", standalone_mode=True)
        except SystemExit as end:
            if end.code not in (0, 2, 3, None):
                raise AssertionError(f"exit {end.code}: {told.getvalue()[-600:]}") from end
        finally:
            os.chdir(here)

    for thermal in ("isothermal", "adiabatic"):  # compiled here and not in the first case of every child
        feed(f"predict rocker.toml --thermal {thermal} --out o".encode())
    return Target("command line", tuple(c.encode() for c in COMMAND_LINES), feed, (), tuple(_LATE.split()))


FOREIGN = ("mat", "mat73", "parquet", "tdms", "uff", "mf4", "asc")
MAKERS: dict[str, Callable[[Path], Target]] = {
    "manifest": manifest_target, "bearing": bearing_target, "pivots": pivots_target, "effects": effects_target,
    "csv": csv_target, "hdf5": hdf5_target, "table": table_target, "record": record_target, "cli": command_target,
    **{name: functools.partial(foreign_target, suffix=f".{name}") for name in FOREIGN},
}  # fmt: skip
TARGETS = tuple(MAKERS)


def make_target(name: str, folder: Path) -> Target:
    """Target by name, working in `folder`."""
    if name not in MAKERS:
        sys.exit(f"no target {name!r}; there are {', '.join(TARGETS)}")
    return MAKERS[name](folder)
