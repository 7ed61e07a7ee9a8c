"""What the housing stands on: the compliance of its cells and their loss, or whether it floats.

Standing on cells, a = -omega^2 C F_cell: swapped, inverted or late accelerometers break it, whatever the bearing does.
Floating, a = omega^2 (kappa d + C F_oil): the shaft gives way to the film's force, and kappa is not one where probes or
accelerometers have another gain, axis or delay than is stated. A shaft's lag grows with the film's damping.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.conditions import Condition, Conditions
from tpjb_ident.estimate.equation import Blocks, Rig, State, film_force, housing_rows, vector
from tpjb_ident.estimate.solve import Solution
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
#: Motion of a floating stator's shaft over that of the stator, before anything is known of it, one deviation; what its
#: accelerometers may differ from the probes by gains and pitch: more is a contradiction, and no lag hides behind it.
_SHAFT, _PITCH = 0.1, 0.02
#: Mass of what moves with a floating stator's shaft over the stator's, one deviation.
_HEAVY = 2.0
#: The difference from which one of them is wrong; from which it is no work of a delay or a corner.
_OTHERWISE, _GROSS = 0.05, 0.2
#: A sign is beyond doubt from so many standard errors on.
_CLEAR = 5.0
#: Standard errors, and phase [rad], from which cells or probes come late: where nobody says, and later than is stated.
_LATE, _LATE_AS_STATED = (3.0, 0.0), (4.5, 0.02)
#: Loss of a cell's mount, at most: bolted joints have 0.01. What goes beyond it is a delay.
_LOSS = 0.04
#: No housing stands on springs as stiff as this [m/N]: a steel bar of 1 m^2 and 2 m has it.
STIFFEST = 0.01 * _NANOMETRE
#: Ratio of the springs along X and Y that no rig has: a sensitivity is ten times off.
_ALIKE = 1 / 6
#: Share of the acceleration that the housing's equations leave where sensors are right, at most: rigs have 0.05. Of a
#: floating stator inertia is most of the force, and a pedestal under its shaft leaves 0.13.
_UNEXPLAINED = {"cells": 0.2, "floating": 0.1}
#: The same of a support with another compliance at every frequency; logarithm by which frequencies differ.
_LEFT, _ONE_LINE = 0.1, 0.01
#: Inertia's share of the force below which wrong accelerometers do no harm worth refusing a point for.
HARMLESS = 2e-3
#: A number of which nothing is stated: no record contradicts it.
_Found, _STEP = partial(Parameter, harmless=np.inf), 1e-3


class Housing(Term):
    """Compliance [nm/N] and loss of the cells; of a floating stator kappa, its lag, and the shaft's."""

    name = "housing"
    contradiction = "accelerometers-contradict-cells"

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        self._omega = blocks.usual_omega
        self._inertia = rig.mass * _usual_ratio(blocks.z[:, rig.pick("acceleration")], blocks.z[:, rig.pick("force")])
        self._blocks = blocks
        self._is_timed = any(sensor.delay_uncertainty for sensor in rig.channels)
        usual, across, loss = _CELLS
        if not rig.has_acceleration:
            usual = 0.0  # the inertia stays in F, as is said of the point
        if rig.out_of_step or not rig.static:
            loss = _LOSS / 2  # what is beyond a mount's is then a delay's or a corner's
        if rig.mount == "cells":
            self.sentence = "{p.name} of the cells {value:.3g} {p.unit} (standard error {error:.2g})"
            self.parameters = (
                _Found("c_xx", "nm/N", SOFT, usual),
                _Found("c_yy", "nm/N", SOFT, usual),
                _Found("c_xy", "nm/N", across),
                *[_Found(f"loss_{axis}", "1", loss) for axis in "xy"],
            )
            if rig.has_acceleration:
                force, shown = (np.nan_to_num(vector(rig, blocks, q)) for q in ("force", "acceleration"))
                pushes = -_NANOMETRE * (blocks.omega**2)[:, None] * force
                springs, _, rank, _ = np.linalg.lstsq(pushes, shown, rcond=None)
                if rank == 2:
                    (xx, xy), (yx, yy) = springs.real.tolist()
                    self.start = (xx, yy, (xy + yx) / 2, 0.0, 0.0)
        elif rig.mount == "unknown":
            self.parameters = (_Found("inertia not measured", "1", _UNKNOWN),)
        elif rig.has_acceleration:
            compliance, self.start = _shaft(rig, blocks)
            self.parameters = (
                *[Parameter(f"kappa_{axes}", "1", _PITCH) for axes in ("xx", "xy", "yx", "yy")],
                *[_Found(f"c_{axes}", "nm/N", compliance) for axes in ("xx", "yy")],
                _Found("shaft", "kg", _HEAVY * rig.mass),
                _Found("loss", "1", _LOSS),
                _Found("damping", "1", _LOSS),
                _Found("lag", "rad", _LOSS / 2 if self._is_timed else _SHAFT),
            )

    def apply(self, blocks: Blocks, state: State, value: FloatArray) -> None:
        """Compliance or kappa of the state."""
        if self.rig.mount == "cells":
            state.compliance = _compliance(value)
        elif self.rig.mount == "unknown":
            state.floating = value[0] * np.eye(2, dtype=complex)
        else:
            state.floating, state.compliance = self._hung(blocks, value)

    def _is_unexplained(self, fitted: Fitted) -> bool:
        return fitted.unexplained > _UNEXPLAINED[self.rig.mount]

    def is_on_foundation(self, fitted: Fitted) -> bool:
        """Whether no one spring, but a support all the same carries the housing."""
        is_doubtful = self.rig.mount == "cells" and self._is_unexplained(fitted)
        return is_doubtful and _is_on_foundation(self.rig, self._blocks)

    def acceleration(self, blocks: Blocks, fitted: Fitted) -> ComplexArray:
        """What every block's cells, or probes where the housing floats, let the accelerometers show, (n, 2) [m/s^2]."""
        square = (blocks.omega**2)[:, None]
        if self.rig.mount == "cells":
            return -square * vector(self.rig, blocks, "force") @ _compliance(fitted.value)
        kappa, compliance = self._hung(blocks, fitted.value)
        d, force = vector(self.rig, blocks, "displacement"), film_force(self.rig, blocks)
        return square * (kappa @ d[:, :, None] + compliance @ force[:, :, None])[:, :, 0]

    def _hung(self, blocks: Blocks, value: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Kappa and the shaft's compliance [m/N], (n, 2, 2): steel and bolts lose alike, oil with frequency."""
        *_, mass, loss, damping, lag = value.tolist()
        share, springs = blocks.omega / self._omega, _NANOMETRE * value[4:6]
        kappa = np.multiply.outer(np.exp(-1j * lag * share), np.eye(2)) + value[:4].reshape(2, 2)
        held = 1 + 1j * (loss + damping * share)[:, None] - mass * np.multiply.outer(blocks.omega**2, springs)
        return kappa, (springs / held)[:, :, None] * np.eye(2)

    def columns(self, blocks: Blocks, state: State) -> ComplexArray:
        """In the housing's own rows, by small steps of every parameter."""
        columns = self.no_columns(blocks)
        m, h, value = blocks.z.shape[1], state.at_run(blocks), state.parameters[self.name]
        rows = housing_rows(self.rig, blocks, state, h)
        for k, step in enumerate(_STEP * np.eye(len(value))):
            changed = replace(state)
            self.apply(blocks, changed, value + step)
            change = housing_rows(self.rig, blocks, changed, h) - rows
            columns[:, m:, k] = np.einsum("nij,nj->ni", change / _STEP, state.u)
        return columns

    def conditions(self, fitted: Fitted) -> Conditions:
        """Accelerometers that cannot be those of a housing on springs, or that are out of step with the cells."""
        if self.rig.mount == "unknown" or not self.rig.has_acceleration or self.is_on_foundation(fitted):
            return ()
        conditions = self._shown(fitted)
        if self.rig.out_of_step:  # the delay tells whether it stays that they lead
            return tuple(condition for condition in conditions if condition != OUT_OF_STEP)
        return conditions or self.rig.contradicted.get(self.name, ())

    def _shown(self, fitted: Fitted) -> Conditions:
        """What these numbers say of the accelerometers."""
        share = f"inertia is {100 * self._inertia:.2g} % of the force"
        if self._is_unexplained(fitted) and fitted.unexplained * self._inertia > HARMLESS:
            moves = "springs under it make of the cells' force" if self.rig.mount == "cells" else "the probes show"
            text = f"{min(100 * fitted.unexplained, 100):.0f} % of the housing's motion is not what {moves}; {share}"
            return (Condition("accelerometers-contradict-cells", text),)
        if self.rig.mount == "cells":
            return self._standing(fitted, share)
        lag, text = fitted.value[-1], _otherwise(fitted, _OTHERWISE)
        if text and np.linalg.norm(fitted.value[:4]) > abs(lag):
            return (Condition("accelerometers-contradict-cells", f"{text}; {share}"),)
        return self._out_of_step(lag, fitted.deviation[-1], "probes")

    def _standing(self, fitted: Fitted, share: str) -> Conditions:
        """Of accelerometers on a housing on springs; `share`: words for the inertia."""
        (xx, yy, xy, *losses), error = fitted.value, fitted.deviation
        faults = []
        if min(xx + _CLEAR * error[0], yy + _CLEAR * error[1]) < 0:
            faults.append("they move with the cells' force, and not against it")
        elif abs(xy) > max(_CLEAR * error[2], 0.5 * np.sqrt(abs(xx * yy))):
            faults.append("each answers the force along the other's axis")
        silent = [axis for axis, c, e in zip("XY", (xx, yy), error) if _NANOMETRE * (abs(c) + _CLEAR * e) < STIFFEST]
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
        k = int(np.argmax(np.abs(losses) / error[3:]))
        both = abs(losses[0] - losses[1]) < _LOSS + 3 * float(np.hypot(*error[3:]))
        return self._out_of_step(losses[k], error[3 + k], "cells" if both else f"cells along {'XY'[k]}")

    def _out_of_step(self, phase: float, error: float, sensors: str) -> Conditions:
        """Accelerometers against the sensors that tell the housing's motion: `phase` [rad] by which they lag.

        Late cells turn h, and so do early ones, behind less of a filter than is stated; late accelerometers, or springs
        that lose more than usual, the inertia alone.
        """
        if abs(phase) < _LOSS + 3 * error:
            return ()
        late = sensors if phase < 0 else f"accelerometers, against the {sensors},"
        text = (
            f"{np.degrees(abs(phase)):.1f} deg, as if the {late} were {1e3 * abs(phase) / self._omega:.2g} ms late or "
            "behind a filter"
        )
        is_plain = self.rig.static and not any(s.quantity == "force" and s.response for s in self.rig.channels)
        is_harmless = 0 < phase * self._inertia < HARMLESS and is_plain and self.rig.mount == "cells"
        return (Condition("accelerometers-doubtful" if is_harmless else OUT_OF_STEP, text),)

    def standing_on(self, fitted: Fitted) -> ComplexArray | None:
        """Compliance of the springs under the housing (2, 2) [m/N]; None where no accelerometer shows it."""
        if self.rig.mount != "cells" or not self.rig.has_acceleration or self.is_on_foundation(fitted):
            return None
        return _compliance(fitted.value)

    def learnt(self, rig: Rig, solution: Solution) -> Rig:
        """Cells, or probes of a floating stator, as uncertain in time as accelerometers lead them.

        A spring's loss is positive, late cells lower it. Accelerometers with which nothing else is wrong may have led
        by a corner of their own.
        """
        if rig.mount == "unknown" or not rig.has_acceleration:
            return rig
        fitted = solution.fitted[self.name]
        first = 3 if rig.mount == "cells" else -1
        times, least = _LATE_AS_STATED if self._is_timed else _LATE
        late = fitted.value[first:] < -np.maximum(times * fitted.deviation[first:], least)
        if not late.any() or self.is_on_foundation(fitted):
            return rig
        lag = float(fitted.value[first:][late].min())
        said = {**rig.contradicted, self.name: self.conditions(fitted)}
        if rig.mount == "cells":
            compared, sound = "force", all(condition == OUT_OF_STEP for condition in said[self.name])
        else:
            compared, sound = "displacement", not (self._is_unexplained(fitted) or _otherwise(fitted, _GROSS))
        late_by = -lag / self._omega
        sensors = tuple(replace(s, delay_uncertainty=late_by * (s.quantity == compared)) for s in rig.channels)
        return replace(rig, channels=sensors, out_of_step=sound, contradicted=said)


def _is_on_foundation(rig: Rig, blocks: Blocks) -> bool:
    """Whether one symmetric compliance at every frequency, another at each, makes the accelerations of the forces.

    A foundation with a resonance does, wrong accelerometers do not; at the lowest frequencies it is a spring still.
    Single lines of a band, which `check` looks at, cannot tell: there it may be one.
    """
    force, acceleration = (vector(rig, blocks, quantity) for quantity in ("force", "acceleration"))
    x, y = (-(blocks.omega**2)[:, None] * force).T
    none = np.zeros_like(x)
    design = np.stack([np.stack([x, none, y], axis=1), np.stack([none, y, x], axis=1)], axis=1)
    lines = np.round(np.log(blocks.omega) / _ONE_LINE)
    noise = np.sqrt(blocks.noise_power(rig.pick("acceleration")))
    lines[~(np.linalg.norm(acceleration, axis=1) > 2 * _CLEAR * noise)] = np.nan
    low, supports, left, judged = [], 0, 0.0, 0.0
    usable = np.unique(lines[np.isfinite(lines)])
    for place, line in enumerate(usable):
        pushes, shown = design[lines == line].reshape(-1, 3), acceleration[lines == line].ravel()
        support, _, rank, _ = np.linalg.lstsq(np.nan_to_num(pushes), shown, rcond=1e-3)
        if rank == 3 and len(pushes) > 3:
            supports += 1
            low += [support] if 4 * place <= len(usable) else []
            left += float(np.linalg.norm(shown - pushes @ support)) ** 2 * len(pushes) / (len(pushes) - 3)
            judged += float(np.linalg.norm(shown)) ** 2
    if supports < 2 or not judged > 0.5 * np.linalg.norm(np.nan_to_num(acceleration)) ** 2:
        return not (blocks.windows > 1).any()
    if not left < _LEFT**2 * judged:
        return False
    if not low:  # nothing tells what the support is below its resonance
        return True
    xx, yy, xy = np.mean(low[: (supports + 3) // 4], axis=0)
    springs = np.array([[xx, xy], [xy, yy]])
    has_loss = np.abs(springs.imag).max() >= 2 * _LOSS * np.abs(springs).max()
    return bool(np.linalg.eigvalsh(springs.real)[0] > 0 and not has_loss)


def _compliance(value: FloatArray) -> ComplexArray:
    """Of the cells, (2, 2) [m/N]."""
    xx, yy, xy, *losses = value.tolist()
    lag = np.add.outer(losses, losses) / 2  # across the axes, the mean of both
    return np.asarray(_NANOMETRE * np.array([[xx, xy], [xy, yy]]) * (1 - 1j * lag), complex)


def _shaft(rig: Rig, blocks: Blocks) -> tuple[float, tuple[float, ...]]:
    """Compliance [nm/N] that is plausible of a shaft, and where steps to kappa, compliances, mass and losses begin.

    Its usual share of the motion, more where it moves by more. A shaft goes where the film pushes it: no sensor that is
    inverted or exchanged looks like one that gives way. The start is x = C F + omega^2 C m x by least squares; none
    where much is left: of wrong sensors, or of a shaft that gives way by no more than sensors differ.
    """
    square, d = (blocks.omega**2)[:, None], vector(rig, blocks, "displacement")
    force, moved = film_force(rig, blocks), vector(rig, blocks, "acceleration") / square - d
    usable = np.isfinite(force + moved)
    pushes, x = np.stack([force, square * moved], axis=2)[usable], moved[usable]
    # one frequency tells no mass
    is_told = np.max(blocks.omega, initial=0.0) > (1 + _SHAFT) * np.min(blocks.omega, initial=np.inf)
    pushes = pushes[:, : 1 + is_told]
    numbers = np.linalg.lstsq(pushes, x, rcond=None)[0].real
    spring = float(numbers[0])
    compliance = max(_SHAFT * _usual_ratio(d, force), spring) / _NANOMETRE or 1.0
    is_explained = np.linalg.norm(x - pushes @ numbers) < _LEFT * np.linalg.norm(x)
    if not (is_told and spring > 0 and is_explained):
        return compliance, ()
    return compliance, (*[0.0] * 4, *[spring / _NANOMETRE] * 2, float(numbers[1]) / spring, *[0.0] * 3)


def _usual_ratio(first: ComplexArray, second: ComplexArray) -> float:
    """Median ratio of the sizes of two vectors, (n, k) and (n, m); zero where no block shows both."""
    above, below = (np.linalg.norm(vectors, axis=1) for vectors in (first, second))
    shown = (above > 0) & (below > 0)
    return float(np.median(above[shown] / below[shown])) if shown.any() else 0.0


def _otherwise(fitted: Fitted, least: float) -> str:
    """How accelerometers of a floating stator differ from its probes, if by more than `least` and chance."""
    kappa, error = fitted.value[:4].reshape(2, 2), fitted.deviation[:4].max()
    limit = least + 3 * error
    turn = (kappa[1, 0] - kappa[0, 1]) / 2
    if abs(turn) > limit:
        return f"they are turned by {np.degrees(np.arctan2(turn, 1 + np.trace(kappa) / 2)):.0f} deg against the probes"
    stretch, axes = np.linalg.eigh((kappa + kappa.T) / 2)
    k = np.abs(stretch).argmax()
    if abs(stretch[k]) <= limit:
        return ""
    along = np.degrees(np.arctan2(axes[1, k], axes[0, k])) % 180
    return f"they show {1 + stretch[k]:.2f} times the motion along {along:.0f} deg that the probes show"
