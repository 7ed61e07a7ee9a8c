"""Broadband excitation beside the sine's result of the same bearing, and beside pyFRF on the same records.

``python -m tests.studies.field.broadband_beside [--seeds 20] [--pyfrf PYTHON]``: an interpreter that has pyFRF, where
this one has not. It gives receptance, displacement over force: its H1 inverted is our H2, and the other way round.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from rigdata import load_campaign
from tests.studies.field.band_campaign import write_band_campaign
from tests.studies.field.band_rig import BandRig, band_plans, stiffness
from tests.studies.field.broadband import LOUD
from tests.studies.field.campaign_file import plans_of, write_campaign
from tests.studies.field.rig import Rig
from tpjb_ident.dynamic.broadband.band_result import BandResult
from tpjb_ident.dynamic.identify import identify

SINES = (25.0, 40.0, 60.0, 80.0)
LOAD = 5000.0
#: Runs in the other interpreter: arrays in, FRF out.
PYFRF = """
import sys, warnings
import numpy as np, pyFRF
given = np.load(sys.argv[1])
segment, rate = int(given["segment"]), int(given["rate"])
frf = pyFRF.FRF(sampling_freq=rate, exc=given["force"], resp=given["displacement"], exc_type="f", resp_type="d",
                window=str(given["window"]), fft_len=segment, nperseg=segment, noverlap=int(given["overlap"]))
np.savez(sys.argv[2], f=frf.get_f_axis(), h1=frf.get_H1(), h2=frf.get_H2())
"""


def one_campaign(rig: BandRig, seed: int, folder: Path) -> tuple[Path, BandResult]:
    """A campaign at one load and what is identified from it."""
    path = folder / "band.h5"
    write_band_campaign(path, rig, band_plans((LOAD,)), seed)
    (result,) = identify(load_campaign(path)).bands
    return path, result


def beside_sines(kinds: Iterable[str], seeds: int) -> None:
    """How often the two intervals of an entry allow for the difference."""
    print(
        "\n| excitation | sines, Hz | entries | difference within both intervals % | h of the band +- % | sine +- % |"
    )
    print("|---|---|---|---|---|---|")
    for kind in kinds:
        inside, total, band_width, sine_width = 0, 0, [], []
        with tempfile.TemporaryDirectory() as folder:
            for seed in range(8000, 8000 + seeds):
                _, band = one_campaign(BandRig(kind=kind), seed, Path(folder))
                path = Path(folder) / "sine.h5"
                sine_rig = Rig(miss=(0.0, 0.0), shaft=22.3)
                write_campaign(path, sine_rig, plans_of((LOAD,), SINES, directions=4), seed)
                size = 2e8
                for point in identify(load_campaign(path)).points:
                    k = int(np.argmin(np.abs(band.frequencies - point.point.excitation_hz)))
                    line = band.lines[k].stiffness
                    # the line may stand beside the sine: the model between them is the truth's own, K-C-M
                    at = 2 * np.pi * np.array([band.frequencies[k], point.point.excitation_hz])
                    moved = np.diff(stiffness(sine_rig.bearing, at, LOAD), axis=0)[0]
                    away = (
                        point.stiffness.vector - line.vector - np.concatenate([moved.real.ravel(), moved.imag.ravel()])
                    )
                    room = np.hypot(point.stiffness.half_width(), line.half_width())
                    inside += int((np.abs(away) <= room).sum())
                    total += 8
                    band_width.append(line.half_width()[0] / size)
                    sine_width.append(point.stiffness.half_width()[0] / size)
        listed = ", ".join(f"{f:g}" for f in SINES)
        print(f"| {kind} | {listed} | {total} | {100 * inside / total:.1f} | {100 * np.median(band_width):.1f} | "
              f"{100 * np.median(sine_width):.2f} |", flush=True)  # fmt: skip


def beside_pyfrf(python: str, seeds: int) -> None:
    """Ratios of pyFRF's H1 and H2 to ours, and both against the truth."""
    print("\n| records | pyFRF over ours: H1, median (95 % of lines within) | H2 | kyy off %: pyFRF H1 | H2 | "
          "ours H1 | H2 | ours |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|")
    for kind in ("multisine", "random"):
        rig = replace(BandRig(kind=kind, noise=LOUD), shaft=0.0)  # lines of the shaft are taken off here, not there
        ratios: dict[str, list[float]] = {"h1": [], "h2": []}
        off: dict[str, list[float]] = {name: [] for name in ("theirs h1", "theirs h2", "h1", "h2", "best")}
        with tempfile.TemporaryDirectory() as folder:
            for seed in range(9000, 9000 + seeds):
                path, band = one_campaign(rig, seed, Path(folder))
                theirs = ask_pyfrf(python, path, rig, Path(folder))
                truth = stiffness(rig.bearing, 2 * np.pi * band.frequencies, LOAD)[:, 1, 1].real
                for name in ("h1", "h2"):
                    other = at_lines(theirs["f"], theirs[name], band)
                    own = np.array([line.by_method[name].h for line in band.lines])
                    ratios[name] += list((other[:, 1, 1] / own[:, 1, 1]).real)
                    off[f"theirs {name}"].append(float(np.mean(other[:, 1, 1].real / truth)) - 1)
                    off[name].append(float(np.mean(own[:, 1, 1].real / truth)) - 1)
                off["best"].append(float(np.mean(band.h[:, 1, 1].real / truth)) - 1)
        told = [f"{np.median(r):.4f} ({np.quantile(np.abs(np.array(r) - 1), 0.95):.2g})" for r in ratios.values()]
        shares = [f"{100 * np.mean(values):+.1f}" for values in off.values()]
        print(f"| {kind} | {' | '.join([*told, *shares])} |", flush=True)


def ask_pyfrf(python: str, path: Path, rig: BandRig, folder: Path) -> dict[str, np.ndarray]:
    """PyFRF's H1 and H2 of a campaign's runs, as stiffness (n, 2, 2)."""
    campaign = load_campaign(path)
    periodic = rig.kind == "multisine"
    segment = round(rig.rate * (rig.period if periodic else 1.0))
    runs = [(run.vector("displacement"), run.vector("force"), run.vector("acceleration")) for run in campaign.runs]
    force = np.array([f.values.T + rig.housing_mass * a.values.T for _, f, a in runs])
    moved = np.array([d.values.T for d, _, _ in runs])
    given, answer, script = folder / "given.npz", folder / "answer.npz", folder / "ask.py"
    window, overlap = ("none", 0) if periodic else ("hann", segment // 2)
    np.savez(
        given,
        force=force - force.mean(axis=2, keepdims=True),
        displacement=moved - moved.mean(axis=2, keepdims=True),
        segment=segment,
        rate=round(rig.rate),
        window=window,
        overlap=overlap,
    )
    script.write_text(PYFRF, encoding="utf-8")
    subprocess.run([python, str(script), str(given), str(answer)], check=True, capture_output=True)
    found = np.load(answer)
    inverse = {name: np.linalg.inv(found[name][:, :, 1:].transpose(2, 0, 1)) for name in ("h1", "h2")}
    return {"f": found["f"][1:], "h1": inverse["h2"], "h2": inverse["h1"]}


def at_lines(f: np.ndarray, h: np.ndarray, band: BandResult) -> np.ndarray:
    """Mean of h over the width of every line."""
    half = 0.5 * band.resolution
    near = [np.abs(f - line.frequency) <= max(half, 0.51 * (f[1] - f[0])) for line in band.lines]
    return np.array([h[np.argmin(np.abs(f - line.frequency))] if band.period else h[mask].mean(axis=0)
                     for line, mask in zip(band.lines, near)])  # fmt: skip


def main() -> None:
    """Command line."""
    options = argparse.ArgumentParser()
    options.add_argument("--seeds", type=int, default=20)
    options.add_argument("--pyfrf", default=sys.executable)
    given = options.parse_args()
    beside_sines(("multisine", "periodic random", "random", "sweep", "impact"), given.seeds)
    has = subprocess.run([given.pyfrf, "-c", "import pyFRF"], capture_output=True).returncode == 0
    if has:
        beside_pyfrf(given.pyfrf, given.seeds)
    else:
        print(f"\npyFRF is not installed in {given.pyfrf}")


if __name__ == "__main__":
    main()
