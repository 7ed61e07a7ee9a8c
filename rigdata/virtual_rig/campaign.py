"""Writing a whole virtual campaign: everything or nothing, and never over something else."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from rigdata.virtual_rig.faults import CSV_ONLY, HDF5_ONLY, NEEDS_TIME
from rigdata.virtual_rig.layout import CsvLayout, Hdf5Layout, Layout, layout_named
from rigdata.virtual_rig.ledger import CampaignTruth, campaign_truth, run_facts
from rigdata.virtual_rig.manifest_text import manifest_text
from rigdata.virtual_rig.rig import SimulatedRun, VirtualRig
from rigdata.virtual_rig.truth import VirtualRigError
from rigdata.virtual_rig.writer_csv import write_csv
from rigdata.virtual_rig.writer_hdf5 import write_hdf5

Progress = Callable[[int, int, str], None]


def write_campaign(
    out: str | os.PathLike[str],
    rig: VirtualRig,
    layout: str | Layout = "hdf5",
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> CampaignTruth:
    """Write a campaign in the `tpjb-rig/1` format.

    Parameters
    ----------
    out : path
        The HDF5 file, or the folder, to make. Its parent must exist.
    rig : VirtualRig
    layout : CsvLayout, Hdf5Layout or str
        Or a name out of `layout.LAYOUTS`: "hdf5", "csv", "csv-german", "csv-tabbed", "csv-bare".
    overwrite : bool
        Replace an existing campaign; anything else is never replaced.
    progress : callable(done, total, run id), optional

    Returns
    -------
    CampaignTruth
        What was really put in. It is not part of the campaign: write it elsewhere.

    Raises
    ------
    VirtualRigError
        The plan, the truth or the target cannot be used; then nothing has been written.
    """
    target = Path(out)
    chosen = layout_named(layout)
    _check_target(target, chosen, overwrite)
    _check_faults(rig, chosen)
    rig = replace(rig, truth=rig.truth.remembered())
    runs = rig.runs()
    header = {
        "id": rig.campaign,
        "bearing": rig.truth.bearing_name,
        "description": rig.description,
    }
    manifest = manifest_text(header, rig.instruments, runs, chosen, rig.faults)
    facts: dict[str, dict[str, object]] = {}
    records = _watched(rig, facts, progress)
    # the temporary sibling is on the same file system, so that the last step is one rename
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as spare:
        if isinstance(chosen, Hdf5Layout):
            made = Path(spare) / "campaign.h5"
            write_hdf5(made, rig, manifest, records, chosen)
        else:
            made = Path(spare) / "campaign"
            made.mkdir()
            write_csv(made, rig, manifest, records, chosen)
        truth = campaign_truth(rig, facts)
        _put_in_place(made, target, Path(spare))
    return truth


def _watched(rig: VirtualRig, facts: dict[str, dict[str, object]], progress: Progress | None) -> Iterator[SimulatedRun]:
    """Simulate every record, noting its facts and telling the watcher."""
    total = len(rig.records())
    for done, record in enumerate(rig.simulate_all(), 1):
        facts[record.run.id] = run_facts(record)
        yield record
        if progress is not None:
            progress(done, total, record.run.id)


def _check_target(target: Path, layout: Layout, overwrite: bool) -> None:
    if not target.parent.is_dir():
        raise VirtualRigError(f"{target.parent} is not a folder; make it first")
    if not os.path.lexists(target):
        return
    if not overwrite:
        raise VirtualRigError(f"{target} exists; choose another name, or allow it to be overwritten")
    if target.is_symlink():
        raise VirtualRigError(f"{target} is a symbolic link; it is not followed, choose another name")
    if isinstance(layout, CsvLayout):
        if not (target.is_dir() and (target / "campaign.toml").is_file()):
            raise VirtualRigError(f"{target} is not a campaign folder; it is not replaced")
    elif not (target.is_file() and _is_hdf5(target)):
        raise VirtualRigError(f"{target} is not an HDF5 file; it is not replaced")


def _check_faults(rig: VirtualRig, layout: Layout) -> None:
    """Refuse faults that this layout cannot show: a campaign must hold what was asked for."""
    impossible = HDF5_ONLY if isinstance(layout, CsvLayout) else CSV_ONLY
    for fault in rig.faults:
        if fault.kind in impossible:
            raise VirtualRigError(f"fault {fault.kind!r} does not exist in {type(layout).__name__}")
        if fault.kind in NEEDS_TIME and layout.time_name is None:
            raise VirtualRigError(f"fault {fault.kind!r} needs a time column; give the layout a time_name")


def _is_hdf5(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(8) == b"\x89HDF\r\n\x1a\n"


def _put_in_place(made: Path, target: Path, spare: Path) -> None:
    if not made.is_dir():
        os.replace(made, target)
        return
    # a folder cannot be renamed onto a full one: the old campaign steps aside first
    old = spare / "old"
    if target.exists():
        os.rename(target, old)
    try:
        os.rename(made, target)
    except OSError:
        if old.exists():
            os.rename(old, target)
        raise
    shutil.rmtree(old, ignore_errors=True)
