"""Operating points one after another, each started from the one before."""

from collections.abc import Sequence

from model.predict import predict_setup
from model.prediction import Prediction
from model.setup import Setup
from rigdata.arrays import FloatArray


def sweep(setup: Setup, points: Sequence[tuple[float, float, float, FloatArray]]) -> list[Prediction]:
    """Predict points: load, direction, speed, excitation."""
    out: list[Prediction] = []
    start = None
    for load, direction, speed, excitation in points:
        out.append(predict_setup(setup, load, direction, speed, excitation, start))
        start = out[-1].equilibrium if out[-1].converged else None
    return out
