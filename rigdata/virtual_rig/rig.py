"""A virtual rig: truth, plan, instruments, noise and faults put together; runs are simulated one by one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

from rigdata.virtual_rig.faults import Fault, check_faults
from rigdata.virtual_rig.instruments import Instruments
from rigdata.virtual_rig.motion import Motion, clearance_motion, dry_motion, running_motion
from rigdata.virtual_rig.noise import Noise, stream
from rigdata.virtual_rig.plan import PlannedRun, RigPlan
from rigdata.virtual_rig.sensing import (
    Glitch,
    Readings,
    add_glitches,
    analogue_readings,
    converted,
    draw_glitches,
    faulty_instruments,
    spoil_record,
)
from rigdata.virtual_rig.truth import RigTruth, VirtualRigError


@dataclass(frozen=True)
class SimulatedRun:
    """One record, and what is in it."""

    run: PlannedRun
    readings: Readings = field(repr=False)
    motion: Motion = field(repr=False)
    glitches: tuple[Glitch, ...] = ()
    source: str = ""


@dataclass(frozen=True)
class VirtualRig:
    """Everything that determines a campaign, to the last bit."""

    truth: RigTruth
    plan: RigPlan = field(default_factory=RigPlan.like_paper)
    instruments: Instruments = field(default_factory=Instruments.like_paper)
    noise: Noise = field(default_factory=Noise.like_samples)
    faults: tuple[Fault, ...] = ()
    seed: int = 0
    campaign: str = "virtual"
    description: str = "computed data from a virtual rig"

    def __post_init__(self) -> None:
        pads = {s.pad for s in self.instruments.of("temperature")}
        if any(p is None or not 1 <= p <= len(self.truth.pivot_angles) for p in pads):
            listed, count = sorted(map(str, pads)), len(self.truth.pivot_angles)
            raise VirtualRigError(f"temperature sensors are in pads {listed}, but the bearing has pads 1 to {count}")
        if self.faults:
            check_faults(self.faults, [r.id for r in self.runs()], [s.name for s in self.instruments.sensors])

    def runs(self) -> tuple[PlannedRun, ...]:
        """All runs, in the order of the test."""
        return self._runs

    @cached_property
    def _runs(self) -> tuple[PlannedRun, ...]:
        return self.plan.runs(self.truth.pivot_angles)

    def records(self) -> tuple[PlannedRun, ...]:
        """The runs that have a record of their own, in order; others share one of these."""
        return tuple(run for run in self.runs() if run.record == run.id)

    def simulate(self, run_id: str) -> SimulatedRun:
        """Make the record of one run (or the one that it shares)."""
        runs = {run.id: run for run in self.runs()}
        if run_id not in runs:
            raise VirtualRigError(f"no run {run_id!r} in the plan")
        return self._recorded(runs[runs[run_id].record])

    def simulate_all(self) -> Iterator[SimulatedRun]:
        """Make every record, one after the other."""
        for run in self.records():
            yield self._recorded(run)

    def faults_of(self, record: str) -> tuple[Fault, ...]:
        """Faults that strike one of the runs of a record."""
        if not self.faults:
            return ()
        members = [run.id for run in self.runs() if run.record == record]
        return tuple(fault for fault in self.faults if any(map(fault.affects, members)))

    def _recorded(self, run: PlannedRun) -> SimulatedRun:
        """Simulate a run, or the one whose record was copied in its place."""
        for fault in self.faults_of(run.record):
            if fault.kind == "duplicate_run":
                copied = next(candidate for candidate in self.runs() if candidate.id == fault.other)
                return replace(self._simulate(copied), run=run)
        return self._simulate(run)

    def _simulate(self, run: PlannedRun) -> SimulatedRun:
        faults = self.faults_of(run.record)
        if any(fault.kind == "missing_excitation" for fault in faults):
            run = replace(run, lines=())
        instruments = faulty_instruments(self.instruments, faults)
        motion = self._motion(run, instruments)
        columns = analogue_readings(motion, instruments, self.noise, self.seed, run.id)
        glitches: tuple[Glitch, ...] = ()
        if run.kind in ("dynamic", "locus"):
            glitches = draw_glitches(instruments, self.noise, len(motion.time), self.seed, run.id)
        add_glitches(columns, instruments, glitches)
        columns = {s.name: converted(columns[s.name], s, self.noise.bits) for s in instruments.sensors}
        readings = Readings(motion.time, columns, run.rate)
        if faults:
            rng = stream(self.seed, run.id, "faults")
            readings = spoil_record(readings, instruments, faults, rng)
        return SimulatedRun(run, readings, motion, glitches, run.id)

    def _motion(self, run: PlannedRun, instruments: Instruments) -> Motion:
        if run.kind == "dry_pivot":
            return dry_motion(run, self.truth, self.noise, self.seed)
        if run.kind == "clearance":
            return clearance_motion(run, self.truth, self.noise, self.seed)
        return running_motion(run, self.truth, instruments, self.noise, self.seed)
