"""What the housing stands on: the compliance of its cells and their loss, or whether it floats.

Standing on cells, a = -omega^2 C F_cell: swapped, inverted or late accelerometers break it, whatever the bearing does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition
from tpjb_ident.estimate.blocks import Blocks, Rig, Sensor, vector
from tpjb_ident.estimate.equation import State
from tpjb_ident.estimate.term import OUT_OF_STEP, Fitted, Parameter, Term

_NANOMETRE = 1e-9
#: What is plausible of the springs under a housing, one standard deviation [nm/N]: no fewer rigs stand on 5e7 N/m
#: where nobody measures it.
SOFT = 20.0
#: Compliance of usual cells [nm/N]: 5e8 N/m; what is plausible of it across the axes [nm/N]; loss.
_CELLS = (2.0, 5.0, 0.3)
#: What accelerometers that show nothing may have missed [nm/N].
_STIFF = 3.3
#: Nothing is known of a housing that neither manifest nor accelerometer tells of: it stands still, or it floats.
_UNKNOWN = 1.0
#: Motion of a floating stator's shaft over that of the stator, and lag of the accelerometers [rad], one deviation.
_SHAFT = 0.1
#: Difference of the two from which one of them is wrong.
_OTHERWISE = 0.5
#: A sign is beyond doubt from so many standard errors on.
_CLEAR = 5.0
#: Loss of a cell's mount, at most: bolted joints have 0.01. What goes beyond it is a delay.
_LOSS = 0.04
#: No housing stands on springs as stiff as this [nm/N]: a steel bar of 1 m^2 and 2 m has it.
_STIFFEST = 0.01
#: Ratio of the springs along X and Y that no rig has: a sensitivity is ten times off.
_ALIKE = 1 / 6
#: Share of the acceleration that the housing's equations leave where sensors are right, at most: rigs have 0.05.
_UNEXPLAINED = 0.2
#: Inertia's share of the force below which wrong accelerometers do no harm worth refusing a point for.
HARMLESS = 2e-3


class Housing(Term):
    """Compliance [nm/N] and loss of the cells; kappa where it is not known whether the housing floats."""

    name = "housing"

    def __init__(self, rig: Rig, blocks: Blocks) -> None:
        super().__init__(rig, blocks)
        self._omega = float(np.median(blocks.omega)) if len(blocks) else 1.0
        self._inertia = _inertia_share(rig, blocks)
        usual, across, loss = _CELLS
        if len(rig.of("acceleration")) < 2:
            usual = 0.0  # the inertia stays in F, as is said of the point
        if rig.mount == "cells":
            self.sentence = "{p.name} of the cells {value:.3g} {p.unit} (standard error {error:.2g})"
            self.parameters = (
                Parameter("c_xx", "nm/N", SOFT, usual),
                Parameter("c_yy", "nm/N", SOFT, usual),
                Parameter("c_xy", "nm/N", across),
                # what is beyond a mount's loss is then a delay's or a corner's
                Parameter("loss", "1", _LOSS / 2 if rig.out_of_step or not rig.static else loss),
            )
        elif rig.mount == "unknown":
            self.parameters = (Parameter("inertia not measured", "1", _UNKNOWN),)
        elif len(rig.of("acceleration")) > 1:
            self.parameters = (Parameter("motion of the shaft", "1", _SHAFT), Parameter("lag", "rad", _SHAFT))

    def apply(self, blocks: Blocks, state: State, value: FloatArray) -> None:
        """Compliance or kappa of the state."""
        if self.rig.mount == "cells":
            state.compliance = _compliance(value)
        elif self.rig.mount == "unknown":
            state.floating = complex(value[0])
        else:
            state.floating = complex(1 + value[0], -value[1])

    def acceleration(self, blocks: Blocks, fitted: Fitted) -> ComplexArray:
        """What every block's cells, or probes where the housing floats, let the accelerometers show, (n, 2) [m/s^2]."""
        square = (blocks.omega**2)[:, None]
        if self.rig.mount == "cells":
            return np.asarray(-square * vector(self.rig, blocks, "force") @ _compliance(fitted.value))
        follows = complex(1 + fitted.value[0], -fitted.value[1])
        return np.asarray(follows * square * vector(self.rig, blocks, "displacement"))

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """In the housing's own rows."""
        columns = self.no_columns(blocks)
        m, square = blocks.z.shape[1], blocks.omega**2
        if self.rig.mount != "cells":
            columns[:, m:, 0] = -square[:, None] * state.u[:, :2]
            columns[:, m:, 1:] = -1j * columns[:, m:, :1]
            return columns
        force = state.cell_force(self.rig, blocks)
        loss = complex(1 - 1j * state.parameters[self.name][3])
        scaled = square[:, None] * _NANOMETRE * loss * force
        columns[:, m, 0], columns[:, m + 1, 1] = scaled[:, 0], scaled[:, 1]
        columns[:, m, 2], columns[:, m + 1, 2] = scaled[:, 1], scaled[:, 0]
        columns[:, m:, 3] = -1j * square[:, None] * np.einsum("ij,nj->ni", state.compliance / loss, force)
        return columns

    def conditions(self, fitted: Fitted) -> tuple[Condition, ...]:
        """Accelerometers that cannot be those of a housing on springs, or that are out of step with the cells."""
        if self.rig.mount == "unknown" or len(self.rig.of("acceleration")) < 2:
            return ()
        if self.rig.out_of_step:  # nothing else is wrong with them; the delay of the cells tells whether that stays
            return ()
        if self.rig.contradicted.get(self.name):
            return self.rig.contradicted[self.name]
        share = f"inertia is {100 * self._inertia:.2g} % of the force"
        if fitted.unexplained > _UNEXPLAINED and fitted.unexplained * self._inertia > HARMLESS:
            moves = "springs under it make of the cells' force" if self.rig.mount == "cells" else "the probes show"
            text = f"{min(100 * fitted.unexplained, 100):.0f} % of the housing's motion is not what {moves}; {share}"
            return (Condition("accelerometers-contradict-cells", text),)
        if self.rig.mount != "cells" and abs(fitted.value[0]) > _OTHERWISE:
            text = f"they show {1 + fitted.value[0]:.2g} times the motion that the probes show; {share}"
            return (Condition("accelerometers-contradict-cells", text),)
        if self.rig.mount != "cells":
            return _out_of_step(fitted.value[1], fitted.deviation[1], "probes", self._omega)
        (xx, yy, xy, loss), error = fitted.value, fitted.deviation
        faults = []
        if min(xx + _CLEAR * error[0], yy + _CLEAR * error[1]) < 0:
            faults.append("they move with the cells' force, and not against it")
        elif abs(xy) > max(_CLEAR * error[2], 0.5 * np.sqrt(abs(xx * yy))):
            faults.append("each answers the force along the other's axis")
        silent = [axis for axis, c, e in zip("XY", (xx, yy), error) if abs(c) + _CLEAR * e < _STIFFEST]
        if silent:
            faults.append(f"they show nothing along {' and '.join(silent)}: are they connected?")
        if faults:
            text = f"{'; '.join(faults)}; {share}"
            springs = max((abs(c) for axis, c in zip("XY", (xx, yy)) if axis not in silent), default=_STIFF)
            missing = self.rig.mass * self._omega**2 * springs * _NANOMETRE if silent else 0.0
            grave = max(self._inertia, missing) > HARMLESS
            name = "accelerometers-contradict-cells" if grave else "accelerometers-doubtful"
            return (Condition(name, text),)
        weak, strong = sorted((abs(xx), abs(yy)))
        if weak + _CLEAR * max(error[:2]) < _ALIKE * strong:
            text = f"they differ {strong / weak:.0f} times per force: one sensitivity may be off; {share}"
            return (Condition("accelerometers-doubtful", text),)
        return _out_of_step(loss, error[3], "cells", self._omega)

    def springs(self, fitted: Fitted) -> tuple[float, float] | None:
        """Stiffness under the housing along X and Y [N/m]; None where no accelerometer shows it."""
        if self.rig.mount != "cells" or len(self.rig.of("acceleration")) < 2:
            return None
        x, y = (1 / (_NANOMETRE * max(float(c), _STIFFEST)) for c in fitted.value[:2])
        return x, y

    def widened(self, sensors: tuple[Sensor, ...], fitted: Fitted) -> tuple[Sensor, ...] | None:
        """Cells as uncertain in time as accelerometers lead them: a spring's loss is positive, late cells lower it.

        Accelerometers with which nothing else is wrong may have led by a corner of their own. A floating stator tells
        nothing of the kind: the film's damping lets a shaft that gives lag behind its stator.
        """
        stated = any(sensor.delay_uncertainty for sensor in sensors)
        if stated or self.rig.mount != "cells" or len(self.rig.of("acceleration")) < 2:
            return None
        loss, error = float(fitted.value[3]), float(fitted.deviation[3])
        if not loss < -2 * error:
            return None
        sound = all(condition == OUT_OF_STEP for condition in self.conditions(fitted))
        widened = []
        for s in sensors:
            late = -loss / self._omega if s.quantity == "force" else 0.0
            widened.append(replace(s, delay_uncertainty=late, out_of_step=sound and s.quantity == "acceleration"))
        return tuple(widened)


def _compliance(value: FloatArray) -> ComplexArray:
    """Of the cells, (2, 2) [m/N]."""
    xx, yy, xy, loss = (float(v) for v in value)
    return np.asarray(_NANOMETRE * np.array([[xx, xy], [xy, yy]]) * (1 - 1j * loss), complex)


def _out_of_step(phase: float, error: float, sensors: str, omega: float) -> tuple[Condition, ...]:
    """Accelerometers against the sensors that tell the housing's motion: `phase` [rad] by which they lag."""
    if abs(phase) < _LOSS + 3 * error:
        return ()
    late = sensors if phase < 0 else "accelerometers"
    text = (
        f"{np.degrees(abs(phase)):.1f} deg, as if the {late} were {1e3 * abs(phase) / omega:.2g} ms late or behind a "
        f"filter; between the {sensors} and the housing there is none. State `delay` or `filter` of the channels"
    )
    return (Condition(OUT_OF_STEP, text),)


def _inertia_share(rig: Rig, blocks: Blocks) -> float:
    """Median share of the housing's inertia in the force."""
    if len(rig.of("acceleration")) < 2:
        return 0.0
    inertia = rig.mass * np.linalg.norm(blocks.z[:, rig.of("acceleration")], axis=1)
    force = np.linalg.norm(blocks.z[:, rig.of("force")], axis=1)
    told = force > 0
    return float(np.median(inertia[told] / force[told])) if told.any() else 0.0
