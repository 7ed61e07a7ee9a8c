"""What one spectral line is estimated from: rows of displacement and force phasors, and what excited them.

A row is one period of a periodic excitation, or one bin of a whole record's transform next to the line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tpjb_ident.arrays import ComplexArray, FloatArray, IntArray


@dataclass(frozen=True)
class LineRows:
    """Rows of all runs at one line.

    Attributes
    ----------
    omega : float
        [rad/s]
    D, F : (n, 2) complex ndarray
        Displacement [m] and oil force [N].
    A : (n, 2) complex ndarray
        Housing acceleration [m/s^2]; zero where not measured.
    command : (n, 2) complex ndarray or None
        What the actuators were told, along X and Y, in units of its own.
    run : (n,) ndarray of int
        Place of the run that a row belongs to.
    place : (n,) ndarray
        Distance of the row's frequency from the line, -1 to 1 over the bins that count as one line; 0 for periods.
    repeated : bool
        Whether the rows of a run are repeats of one excitation.
    ends : bool
        Whether a record may begin and end in motion: what that leaks into the bins is then fitted along.
    step : float
        Of angular frequency to a row whose place is 1 [rad/s].
    """

    omega: float
    D: ComplexArray
    F: ComplexArray
    A: ComplexArray
    command: ComplexArray | None
    run: IntArray
    place: FloatArray
    repeated: bool
    ends: bool
    step: float = 0.0

    @property
    def n_runs(self) -> int:
        """Runs behind the line."""
        return int(self.run.max()) + 1 if len(self.run) else 0

    def with_force(self, F: ComplexArray) -> LineRows:
        """The same rows with another force (n, 2) [N].

        Parameters
        ----------
        F : (n, 2) complex ndarray
        """
        return replace(self, F=F)

    def one_run(self, r: int) -> LineRows:
        """Rows of one run alone.

        Parameters
        ----------
        r : int
            Its place.
        """
        mine = self.run == r
        command = None if self.command is None else self.command[mine]
        zero = np.zeros(int(mine.sum()), dtype=int)
        return replace(
            self,
            D=self.D[mine],
            F=self.F[mine],
            A=self.A[mine],
            command=command,
            run=zero,
            place=self.place[mine],
        )
