"""All terms of the measurement equation, in the order of the budget: a new term is one file and its name here."""

from __future__ import annotations

from tpjb_ident.estimate.term import Term
from tpjb_ident.terms.amplitude import Amplitude
from tpjb_ident.terms.axis import Axis
from tpjb_ident.terms.baseline import Baseline
from tpjb_ident.terms.clock import Clock
from tpjb_ident.terms.corner import Corner
from tpjb_ident.terms.delay import Delay
from tpjb_ident.terms.distortion import Distortion
from tpjb_ident.terms.gain import Gain
from tpjb_ident.terms.housing import Housing
from tpjb_ident.terms.load import Load
from tpjb_ident.terms.load_turn import LoadTurn
from tpjb_ident.terms.mass import Mass
from tpjb_ident.terms.run_gain import RunGain
from tpjb_ident.terms.shaft import Shaft
from tpjb_ident.terms.temperature import Temperature
from tpjb_ident.terms.tilt import Tilt

TERMS: tuple[type[Term], ...] = (
    Gain,
    RunGain,
    Temperature,
    Axis,
    Delay,
    Corner,
    Clock,
    Mass,
    Housing,
    Baseline,
    Shaft,
    Tilt,
    LoadTurn,
    Load,
    Amplitude,
    Distortion,
)
