"""Exports as six laboratories write them, each from file to report by the README and the guide alone.

    python -m tests.rigs.laboratories [FOLDER] [--docs]

One campaign of the virtual rig (rocker bearing, short plan, seed 1) is written as a German catman ASCII with two rates,
as TDMS in volts, as UFF data set 58, as a MATLAB matrix with ChannelNames, as CSV with ISO 8601 stamps and as LabVIEW
.lvm. Every folder holds records and the bearing's file, nothing else. What a person types is here: commands, and lines
of the drafted manifest. Printed: commands typed, lines edited by hand, processor minutes of the commands, largest
difference of a direct stiffness from what the campaign gives as it was simulated; ``--docs`` puts the table into the
tutorial.
"""

from __future__ import annotations

import difflib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rigdata.campaign import Campaign, load_campaign
from rigdata.run import Run

ROOT = Path(__file__).resolve().parents[2]
BEARING = ROOT / "model" / "bearings" / "rocker.toml"
SLOW = 20  # samples of the fast clock per temperature
MOST_LINES = 10
PAGE = ROOT / "docs" / "guide" / "tutorial.md"
BEGIN, END = "<!-- laboratories: begin -->\n", "<!-- laboratories: end -->"
HEAD = "| export | commands | lines edited | processor minutes | K against the simulation |\n|---|---|---|---|---|\n"
Table = dict[str, np.ndarray]
#: What a person fills in: (channel or table, key) -> value, "" deletes the mark of comment before the key.
Edits = Mapping[tuple[str, str], str]


@dataclass(frozen=True)
class Laboratory:
    """How one laboratory writes, and what its people fill in."""

    name: str
    write: Callable[[Path, Run], None]
    edits: Edits


def raw(run: Run) -> tuple[np.ndarray, Table]:
    """Times and readings in volts, as the logger has them."""
    names = [n for n, c in run.channels.items() if c.quantity != "time"]
    return run.time(), dict(zip(names, run.reader.read(names, 0, run.length), strict=True))


def scaled(run: Run) -> Table:
    """Readings in SI, temperatures in degC, speed in Hz."""
    found = {n: run.record(n).values for n, c in run.channels.items() if c.quantity != "time"}
    for name, channel in run.channels.items():
        if channel.quantity == "temperature":
            found[name] = found[name] - 273.15
        elif channel.quantity == "speed":
            found[name] = found[name] / (2 * np.pi)
    return found


def title(run: Run, between: str = "_") -> str:
    """A file's name as people give it."""
    p, number = run.point, re.sub(r".*-", "", run.id)
    if run.kind == "dynamic":
        words = ["dyn", f"{p.static_load / 1e3:g}kN", f"{p.excitation_hz:g}Hz", number]
    elif run.kind == "locus":
        words = ["locus", f"{p.static_load / 1e3:g}kN", number]
    else:
        words = ["clearance", number] if run.kind == "clearance" else [f"pad{run.pad}", "steps"]
    return between.join(words)


def german(folder: Path, run: Run) -> None:
    """Catman ASCII: two time columns, decimal comma, cp1252, engineering units."""
    t, v = run.time(), scaled(run)
    fast = {"Weg S1 [µm]": 1e6 * v["X1A"], "Weg S2 [µm]": 1e6 * v["X1B"], "Kraft H [kN]": 1e-3 * v["L1H"],
            "Kraft V [kN]": 1e-3 * v["L1V"], "Beschl H [m/s²]": v["A1H"], "Beschl V [m/s²]": v["A1V"],
            "Drehzahl [U/min]": 60 * v["K1"]}  # fmt: skip
    slow = {f"Temperatur Pad {i} [°C]": v[f"T{i}"][::SLOW] for i in range(1, 6)}
    columns = [
        ("Zeit  1 - Standardmessrate [s]", t),
        *fast.items(),
        ("Zeit  2 - langsam [s]", t[::SLOW]),
        *slow.items(),
    ]
    lines = ["CATMAN;V5.4", "Prüfstand 3;Dr. Weiß", ";".join(n for n, _ in columns)]
    lines += [
        ";".join(f"{c[i]:.6g}".replace(".", ",") if i < len(c) else "" for _, c in columns) for i in range(len(t))
    ]
    (folder / f"{title(run)}.asc").write_text("\r\n".join(lines) + "\r\n", "cp1252", newline="")


def tdms(folder: Path, run: Run) -> None:
    """Waveforms in volts by the names of the terminal strip."""
    import nptdms

    t, v = raw(run)
    names = {"X1A": "Prox 1", "X1B": "Prox 2", "L1H": "Cell H", "L1V": "Cell V", "A1H": "Acc H", "A1V": "Acc V",
             "K1": "Tacho", **{f"T{i}": f"TC{i}" for i in range(1, 6)}}  # fmt: skip
    with nptdms.TdmsWriter(folder / f"{title(run)}.tdms") as writer:
        wave = {"wf_increment": float(t[1] - t[0]), "wf_start_offset": 0.0}
        writer.write_segment([
            nptdms.ChannelObject("Log", label, v[name], properties={
                **wave, "unit_string": "mV" if name.startswith("L") else "V"})
            for name, label in names.items()
        ])  # fmt: skip


def uff(folder: Path, run: Run) -> None:
    """Data sets 58 in SI units, named by ID line 1."""
    import pyuff

    t, v = run.time(), scaled(run)
    file = pyuff.UFF(str(folder / f"{title(run)}.uff"))
    units = {"X": "um", "L": "N", "A": "m/s^2", "T": "degC", "K": "Hz"}
    labels = {"X1A": "disp 45", "X1B": "disp 135", "L1H": "force X", "L1V": "force Y", "A1H": "acc X", "A1V": "acc Y"}
    for number, (name, values) in enumerate(v.items(), 1):
        label = labels.get(name, f"temp {name[1:]}" if name.startswith("T") else "speed")
        data = pyuff.prepare_58(
            binary=1, func_type=1, rsp_node=number, rsp_dir=1, ref_node=1, ref_dir=1, id1=label,
            data=1e6 * values if name.startswith("X") else values, x=t, abscissa_inc=float(t[1] - t[0]),
            abscissa_spacing=1, ord_data_type=4, n_bytes=8 * len(t), ordinate_axis_units_lab=units[name[0]],
            abscissa_spec_data_type=17, ordinate_spec_data_type=0, orddenom_spec_data_type=0,
        )  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # pyuff leaves the file that it writes to the collector
            file.write_sets(data, "add")


def matlab(folder: Path, run: Run) -> None:
    """A matrix in volts, ChannelNames and ChannelUnits beside it, a scalar Fs."""
    from scipy.io import savemat

    t, v = raw(run)
    labels = {"X1A": "ProbeA", "X1B": "ProbeB", "L1H": "Fx", "L1V": "Fy", "A1H": "ax", "A1V": "ay", "K1": "tach"}
    names = [labels.get(n, n) for n in v]
    units = ["mV" if n.startswith("L") else "V" for n in v]
    savemat(folder / f"{title(run, '-')}.mat", {
        "Data": np.stack(list(v.values()), axis=1), "ChannelNames": np.array(names, dtype=object),
        "ChannelUnits": np.array(units, dtype=object), "Fs": 1.0 / float(t[1] - t[0])})  # fmt: skip


def iso(folder: Path, run: Run) -> None:
    """Comma-separated with ISO 8601 stamps and engineering units in brackets."""
    t, v = run.time(), scaled(run)
    columns = {"gap A (um)": 1e6 * v["X1A"], "gap B (um)": 1e6 * v["X1B"], "Fx (N)": v["L1H"], "Fy (N)": v["L1V"],
               "ax (m/s^2)": v["A1H"], "ay (m/s^2)": v["A1V"], **{f"T{i} (degC)": v[f"T{i}"] for i in range(1, 6)},
               "speed (rpm)": 60 * v["K1"]}  # fmt: skip
    start = np.datetime64("2019-07-22T11:31:22.000000")
    stamps = np.datetime_as_string(start + np.round(1e6 * t).astype("timedelta64[us]"))
    frame = pd.DataFrame({"timestamp": stamps, **columns})
    frame.to_csv(folder / f"{title(run)}.csv", index=False, float_format="%.7g")


def lvm(folder: Path, run: Run) -> None:
    """LabVIEW measurement file without X columns, engineering units."""
    t, v = run.time(), scaled(run)
    columns = {
        "S1": ("um", 1e6 * v["X1A"]), "S2": ("um", 1e6 * v["X1B"]), "F_x": ("N", v["L1H"]), "F_y": ("N", v["L1V"]),
        "A_x": ("m/s^2", v["A1H"]), "A_y": ("m/s^2", v["A1V"]), "n": ("Hz", v["K1"]),
        **{f"Temp{i}": ("degC", v[f"T{i}"]) for i in range(1, 6)},
    }  # fmt: skip
    count = len(columns)
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", "Decimal_Separator\t.", "X_Columns\tNo",
            "***End_of_Header***\t", "", f"Channels\t{count}"]  # fmt: skip
    heading = {"Samples": str(len(t)), "X_Dimension": "Time", "X0": "0", "Delta_X": f"{t[1] - t[0]:.9f}"}
    head += ["\t".join([key, *[cell] * count]) for key, cell in heading.items()]
    head.append("\t".join(["Y_Unit_Label", *(u for u, _ in columns.values())]))
    head += ["***End_of_Header***", "\t".join(["X_Value", *columns, "Comment"])]
    rows = zip(*(c for _, c in columns.values()), strict=True)
    body = ["\t".join(["", *(f"{x:.7g}" for x in row)]) for row in rows]
    (folder / f"{title(run)}.lvm").write_text("\r\n".join([*head, *body]) + "\r\n", newline="")


MASS = {("housing", "mass"): "30 kg"}


def probes(first: str, second: str) -> dict[tuple[str, str], str]:
    """Where the two probes look."""
    return {(first, "axis"): "45 deg", (second, "axis"): "135 deg"}


def calibrated(probe: str, cell: str, accelerometer: str, thermometer: str) -> Edits:
    """What the certificates say, once per type of sensor."""
    return {
        (probe, "sensitivity"): "7.78 mV/um",
        (probe, "polarity"): "-1",
        (cell, "sensitivity"): "2.0 mV/V",
        (cell, "full_scale"): "20 kN",
        (cell, "excitation"): "5 V",
        (accelerometer, "sensitivity"): "10 mV/g",
        (thermometer, "sensitivity"): "15 K/V",
    }


LABORATORIES = (
    Laboratory("German ASCII, two rates", german, MASS | probes("Weg S1", "Weg S2")),
    Laboratory("TDMS, volts", tdms, MASS | probes("Prox 1", "Prox 2")
               | calibrated("Prox 1", "Cell H", "Acc H", "TC1")),
    Laboratory("UFF 58", uff, MASS | probes("disp 45", "disp 135")),
    Laboratory("MATLAB matrix, volts", matlab, MASS | probes("ProbeA", "ProbeB")
               | calibrated("ProbeA", "Fx", "ax", "T1")),
    Laboratory("CSV, ISO stamps", iso, MASS | probes("gap A", "gap B")),
    Laboratory("LabVIEW .lvm", lvm, MASS | probes("S1", "S2")),
)  # fmt: skip


def fill_in(text: str, edits: Edits) -> str:
    """The manifest as a person leaves it: values at the marks, a comment sign taken off, lines added."""
    for (table, key), value in edits.items():
        header = re.compile(rf'^\[(?:channels\.)?"?{re.escape(table)}"?\]$', re.MULTILINE)
        start = header.search(text)
        assert start, f"no table {table} in the draft"
        end = text.find("\n[", start.end())
        block = text[start.start() : end]
        line = f"{key} = {value}" if value == "-1" else f'{key} = "{value}"'
        new, count = re.subn(rf"^(?:# )?{key} = .*$", lambda _, put=line: put, block, flags=re.MULTILINE)
        new = new if count else f"{block.rstrip()}\n{line}\n"
        text = text[: start.start()] + new + text[end:]
    return text


def edited_lines(before: str, after: str) -> int:
    """Lines that were typed: new ones and changed ones."""
    lines = difflib.ndiff(before.splitlines(), after.splitlines())
    return sum(line.startswith("+ ") for line in lines)


def type_in(*words: str) -> tuple[float, str, int]:
    """Run `tpjb words`; seconds of processor time, what it printed, exit code."""
    began = os.times()
    done = subprocess.run([sys.executable, "-m", "tpjb_ident", *words], capture_output=True, text=True, cwd=ROOT)
    ended = os.times()
    seconds = ended.children_user + ended.children_system - began.children_user - began.children_system
    return seconds, done.stdout + done.stderr, done.returncode


def through(laboratory: Laboratory, campaign: Campaign, folder: Path) -> dict[str, object]:
    """One laboratory's way from its records to the report, and how it went; ends at the first command that fails."""
    records, out = folder / "records", folder / "out"
    records.mkdir(parents=True)
    for run in campaign.runs:
        laboratory.write(records, run)
    shutil.copy(BEARING, records)
    commands = [("init", str(records)), ("check", str(records), "--out", str(out))]
    commands.append(("compare", str(records), "--out", str(out)))
    seconds, lines = 0.0, 0
    for command in commands:
        took, said, code = type_in(*command)
        seconds += took
        assert code == 0, f"{laboratory.name}: tpjb {command[0]} ended with {code}\n{said}"
        if command[0] == "init":
            manifest = records / "campaign.toml"
            before = manifest.read_text("utf-8")
            manifest.write_text(fill_in(before, laboratory.edits), "utf-8")
            lines = edited_lines(before, manifest.read_text("utf-8"))
    return {"laboratory": laboratory.name, "commands": len(commands), "lines": lines, "minutes": seconds / 60.0,
            "report": (out / "report.html").exists(), "worst": _worst(out / "comparison.csv", campaign)}  # fmt: skip


def _worst(table: Path, campaign: Campaign) -> float:
    """Largest difference of a direct stiffness from the campaign as it was simulated, in per cent."""
    import tpjb_ident as ti

    truth = {(p.point.static_load, p.point.excitation_hz): p.stiffness.k for p in ti.identify(campaign).points}
    found = pd.read_csv(table)
    worst = 0.0
    for (load, line), k in truth.items():
        near = np.isclose(found["static_load_N"], load, rtol=0.02)
        row = found[near & np.isclose(found["excitation_Hz"], line, rtol=0.01)].iloc[0]
        for entry, value in (("kxx", k[0, 0]), ("kyy", k[1, 1])):
            worst = max(worst, abs(float(row[f"{entry}_N_per_m"]) / value - 1.0))
    return 100.0 * worst


def main(folder: Path, docs: bool) -> None:
    """Print the table of all laboratories, and put it into the tutorial with `docs`."""
    source = folder / "simulated"
    if not (source / "campaign.h5").exists():
        type_in("simulate", str(BEARING), "--plan", "short", "--seed", "1", "--out", str(source))
    campaign = load_campaign(source / "campaign.h5")
    rows = []
    for laboratory in LABORATORIES:
        place = folder / laboratory.write.__name__
        shutil.rmtree(place, ignore_errors=True)
        found = through(laboratory, campaign, place)
        assert found["report"], f"{laboratory.name}: no report.html"
        rows.append("| {laboratory} | {commands} | {lines} | {minutes:.1f} | {worst:.2f} % |".format(**found))
        print(rows[-1], flush=True)
    if docs:
        before, rest = PAGE.read_text("utf-8").split(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}{HEAD}" + "\n".join(rows) + f"\n{END}{rest.split(END)[1]}", "utf-8")


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if word != "--docs"]
    if words:
        main(Path(words[0]), "--docs" in sys.argv)
    else:
        with tempfile.TemporaryDirectory() as scratch:
            main(Path(scratch), "--docs" in sys.argv)
