"""What the channels' electronics did to the phasors, taken out: filters, delays, slower sampling.

Responses belong to channels, phasors to X and Y. With P the matrix from readings to X, Y, U that from X, Y to readings
and g the channels' complex gains at a line, P diag(1/g) U undoes them; exact for two channels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rigdata.problem import Problem, RigDataError
from rigdata.vector import inverse_directions
from tpjb_ident.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.records.measured_run import MeasuredRun
from tpjb_ident.dynamic.records.phasors import PhasorBlock
from tpjb_ident.dynamic.records.run_data import RunPhasors
from tpjb_ident.dynamic.records.slower_channels import SlowerChannel


def compensated(result: RunPhasors, run: MeasuredRun, slower: Mapping[str, SlowerChannel]) -> RunPhasors:
    """The run's phasors as channels without filters and delays would have given them.

    Parameters
    ----------
    result : RunPhasors
    run : rigdata.run.Run
    slower : mapping of str to SlowerChannel

    Raises
    ------
    RigDataError
        A table of a channel's response does not reach the excitation.
    """
    frequencies, driven = result.lines.frequencies, len(result.lines.excitation)
    blocks: dict[str, PhasorBlock | None] = {
        "displacement": result.displacement,
        "force": result.cell_force,
        "acceleration": result.acceleration,
    }
    for quantity, block in blocks.items():
        undo = None if block is None else _undoing(run, quantity, slower, frequencies, driven)
        if block is not None and undo is not None:
            blocks[quantity] = replace(block, phasors=np.einsum("lab,nlb->nla", undo, block.phasors))
    displacement, force = blocks["displacement"], blocks["force"]
    assert displacement is not None
    assert force is not None
    return replace(result, displacement=displacement, cell_force=force, acceleration=blocks["acceleration"])


def _undoing(
    run: MeasuredRun, quantity: str, slower: Mapping[str, SlowerChannel], frequencies: FloatArray, driven: int
) -> ComplexArray | None:
    """(n_lines, 2, 2) matrices on X, Y; None where no channel of the quantity has a response."""
    chosen = [c for c in run.channels.values() if c.quantity == quantity and getattr(c, "axis", None) is not None]
    if not any(getattr(c, "response", None) or c.name in slower for c in chosen):
        return None
    gains = np.ones((len(frequencies), len(chosen)), dtype=complex)
    for k, channel in enumerate(chosen):
        response = getattr(channel, "response", None)
        if response:
            gains[:, k] *= _reached(response.at(frequencies), frequencies, driven, run, channel.name)
        if channel.name in slower:
            gains[:, k] *= slower[channel.name].at(frequencies)
    axes = tuple(float(c.axis or 0.0) for c in chosen)
    readings = np.stack([np.cos(axes), np.sin(axes)], axis=1)
    return np.einsum("ac,lc,cb->lab", inverse_directions(axes), 1 / gains, readings)


def _reached(gain: ComplexArray, frequencies: FloatArray, driven: int, run: MeasuredRun, name: str) -> ComplexArray:
    """The gain, 1 at disturbing lines that a table does not reach."""
    known = np.isfinite(gain) & (np.abs(gain) > 1e-6)
    if not known[:driven].all():
        what = f"its response at the excitation of {frequencies[~known][0]:g} Hz is not known, or nothing comes through"
        cure = "Extend filter_table, or check filter"
        raise RigDataError(Problem("error", getattr(run, "file", ""), f"channel {name}", what, cure, run.id))
    return np.where(known, gain, 1.0)
