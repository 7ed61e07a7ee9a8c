"""Bearings and operating points that no rig has: does the model end in a number, a named status or a named refusal?

    python tests/studies/stress_model.py [--cases 2000] [--seed 1] [--case N]

Up to four numbers of a good bearing are multiplied by up to 1e12, or become zero, negative, the smallest or a huge
float, infinite or NaN; load, speed, excitation, pivots, heat model, options and effects are as wild. Warnings
are errors. A case is at fault if anything else is raised than a refusal of this package, if a converged prediction is
not finite, if one that has not converged does not say so or gives numbers, or if it takes over a minute.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import random
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from model.bearing import Bearing
from model.bearing_file import load_bearing
from model.effects import Effect, known_effects
from model.growth import Growth
from model.options import CAVITATION, Options
from model.predict import predict
from model.prediction import Prediction

ROOT = Path(__file__).resolve().parents[2]
BEARINGS = sorted((ROOT / "model" / "bearings").glob("*.toml"))
HOSTILE = (0.0, -1.0, 5e-324, 1e-300, 1e300, math.inf, -math.inf, math.nan)
SLOWEST = 60.0


class TooSlowError(BaseException):
    """The case took more than its time; no `except Exception` may swallow it."""


def numbers(thing: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of all floats in nested dataclasses and tuples."""
    if isinstance(thing, float):
        yield path
    elif dataclasses.is_dataclass(thing):
        for field in dataclasses.fields(thing):
            yield from numbers(getattr(thing, field.name), (*path, field.name))
    elif isinstance(thing, tuple):
        for i, part in enumerate(thing):
            yield from numbers(part, (*path, i))


def changed(thing: Any, path: tuple[Any, ...], rng: random.Random) -> Any:
    """Return `thing` with the number at `path` spoilt."""
    if not path:
        return rng.choice(HOSTILE) if rng.random() < 0.15 else thing * 10 ** rng.gauss(0.0, rng.choice((0.1, 1.0, 4.0)))
    first, *rest = path
    if isinstance(thing, tuple):
        part = changed(thing[first], tuple(rest), rng)
        return (*thing[:first], part, *thing[first + 1 :])
    return dataclasses.replace(thing, **{first: changed(getattr(thing, first), tuple(rest), rng)})


def wild(rng: random.Random, middle: float, decades: float) -> float:
    """A number around `middle`, now and then an impossible one."""
    return rng.choice(HOSTILE) if rng.random() < 0.04 else middle * 10 ** rng.gauss(0.0, decades)


def case(number: int, seed: int, bearings: list[Bearing]) -> Prediction:
    """Predict the case of that number; whatever it raises comes through."""
    rng = random.Random(f"{seed}-{number}")
    bearing = rng.choice(bearings)
    places = list(numbers(bearing))
    for path in rng.sample(places, rng.choice((0, 1, 1, 2, 4))):
        bearing = changed(bearing, path, rng)
    effects = [_effect(rng, len(bearing.pads)) for _ in range(rng.choice((0, 0, 0, 1, 2)))]
    growth = Growth() if rng.random() < 0.1 else None
    options = Options(rng.random() < 0.1, rng.random() < 0.1, growth, rng.choice((*CAVITATION[:1] * 4, *CAVITATION)))
    excitation = wild(rng, 150.0, 3.0)
    return predict(
        bearing,
        wild(rng, 5e3, 2.0),
        rng.uniform(-4.0, 4.0),
        wild(rng, 150.0, 2.0),
        [excitation, 2 * excitation] if rng.random() < 0.5 else excitation,
        pivots=rng.choice(("rigid", "kirk", "kirk-secant", wild(rng, 1e9, 4.0))),
        thermal=rng.choice(("isothermal",) * 4 + ("adiabatic",) * 5 + ("tehd",)),
        mesh=(24, 4),
        effects=effects,
        options=options,
    )


def _effect(rng: random.Random, pads: int) -> Effect:
    """One effect of the library, its parameters within their bounds or far beyond."""
    kind = rng.choice([known_effects()[name] for name in sorted(known_effects())])
    values = {}
    for p in kind.parameters_of(pads):
        low, high = max(p.low, -1e12), min(p.high, 1e12)
        inside = low + rng.random() ** 3 * (high - low)
        values[p.name] = float(rng.randint(1, pads)) if p.unit == "pad" else wild(rng, inside, rng.choice((0, 0, 1)))
    return Effect(kind.name, **values)


def fault_of(prediction: Prediction) -> str:
    """What is wrong with an answer; empty if nothing."""
    if not prediction.converged:
        if all(condition.severity != "error" for condition in prediction.status):
            return "not converged, and no status says so"
        return "" if np.isnan(prediction.h).all() else "not converged, and it gives numbers"
    if not (np.isfinite(prediction.h).all() and np.isfinite(prediction.position).all()):
        return f"converged, and not finite; status {prediction.status}"
    return "" if prediction.min_film > 0.0 else "converged with no film"


def refused(error: ValueError) -> bool:
    """Whether the refusal is this package's own: its class, or the place that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = Path(frames[-1].filename).resolve().is_relative_to(ROOT)
    return type(error).__module__.startswith("model") or (type(error) is ValueError and ours)


def _expire(number: int, frame: Any) -> None:
    raise TooSlowError


def judged(number: int, seed: int, bearings: list[Bearing]) -> tuple[str, str]:
    """How a case came out, and what is wrong with it (nothing: empty)."""
    signal.setitimer(signal.ITIMER_VIRTUAL, SLOWEST)
    try:
        prediction = case(number, seed, bearings)
    except TooSlowError:
        return "too slow", f"took over {SLOWEST:g} s\n{traceback.format_exc(limit=-3)}"
    except ValueError as error:
        if refused(error):
            return "refused by name", ""
        return "raised", f"{type(error).__name__}: {error}\n{traceback.format_exc(limit=-3)}"
    except Exception as error:  # warnings are errors here, too
        return "raised", f"{type(error).__name__}: {error}\n{traceback.format_exc(limit=-3)}"
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
    return "converged" if prediction.converged else f"status: {prediction.status[0]}", fault_of(prediction)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--case", type=int, help="this case of the seed alone")
    given = parser.parse_args()
    warnings.simplefilter("error")
    signal.signal(signal.SIGVTALRM, _expire)
    bearings = [load_bearing(path) for path in BEARINGS]
    for options in (Options(), Options(conduction=True), Options(cavitation="jfo")):  # compiled here, not in a case
        predict(bearings[0], 5e3, -1.57, 138.0, 157.0, thermal="tehd", mesh=(24, 4), options=options)
    outcomes: Counter[str] = Counter()
    slowest, faults = 0.0, 0
    for number in range(given.cases) if given.case is None else (given.case,):
        began = time.process_time()
        outcome, fault = judged(number, given.seed, bearings)
        slowest = max(slowest, time.process_time() - began)
        outcomes[outcome] += 1
        if fault:
            faults += 1
            print(f"case {number}: {fault}", flush=True)
        if number % 100 == 99:
            print(f"{number + 1} cases, {faults} at fault", file=sys.stderr, flush=True)
    for outcome, count in outcomes.most_common():
        print(f"{count:6d}  {outcome}")
    print(f"slowest case {slowest:.1f} s of processor time; {faults} at fault")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
