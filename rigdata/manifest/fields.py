"""The keys of a manifest: one line each, from which it is read, drafted by `tpjb init` and documented."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rigdata.calibration import DIMENSIONS, UNCALIBRATED

#: Frequencies of the mains in any country [Hz].
MAINS_FREQUENCIES = (50.0, 60.0)
QUANTITIES = (*DIMENSIONS, *UNCALIBRATED, "ignore")
KINDS = ("dynamic", "dry_pivot", "locus", "clearance", "baseline")
#: How a dynamic run is excited.
EXCITATIONS = ("sine", "multisine", "sweep", "random", "impact")
BRANCHES = ("up", "down", "cycle")

#: Kinds that are not read key by key: what they mean hangs on the quantity, or they hold more than one value.
RAW = ("table", "list", "sign", "calibration")


@dataclass(frozen=True)
class Field:
    """One key of a table: what it holds, what it means, and what stands where it is not stated."""

    key: str
    #: a dimension of `rigdata.units`, "text", "choice" (of `known`), "whole" (number), or one of `RAW`
    kind: str
    meaning: str
    example: str
    default: Any = None
    required: bool = False
    known: tuple[str, ...] = ()
    #: bounds in SI: from, to; `above` and `below` exclude their ends
    low: float | None = None
    high: float | None = None
    above: float | None = None
    below: float | None = None
    #: what to do about a value out of bounds, where the bounds alone do not say it
    remedy: str = ""

    def holds(self, value: float) -> bool:
        """Whether a number is within the bounds."""
        return (
            (self.low is None or value >= self.low)
            and (self.high is None or value <= self.high)
            and (self.above is None or value > self.above)
            and (self.below is None or value < self.below)
        )

    def advice(self) -> str:
        """What to do about a value out of bounds."""
        bound = f"not below {self.low:g}" if self.low is not None else f"above {self.above:g}"
        return self.remedy or f"It must be {bound}"


TOP = (
    Field("schema", "text", "name of the format", '"tpjb-rig/1"', required=True),
    Field("id", "text", "name of the campaign", '"rocker-A"', required=True),
    Field("bearing", "text", "bearing file in the folder; HDF5: root attribute", '"rocker.toml"', required=True),
    Field("description", "text", "free text", '"after overhaul"', default=""),
    Field("housing", "table", "", ""),
    Field("acquisition", "table", "", ""),
    Field("csv", "table", "", ""),
    Field("channels", "table", "", ""),
    Field("runs", "table", "", ""),
)
HOUSING = (
    Field("mass", "mass", "stator mass between oil film and load cells", '"30 kg"', default=math.nan, low=0.0),
    Field("mass_uncertainty", "mass", "of the mass", '"0.5 kg"', default=0.0, low=0.0),
)
ACQUISITION = (
    Field("sample_rate", "frequency", "where the records hold no times", '"2 kHz"', above=0.0),
    Field("mains", "frequency", "50 or 60 Hz; else found in the records", '"60 Hz"', low=0.0),
)
CSV = (
    Field("delimiter", "text", 'one character, or "tab"', '";"'),
    Field("decimal", "text", ". or ,", '","'),
    Field("encoding", "text", "of the text", '"cp1252"'),
    Field("header_line", "whole", "line of the column names, from 1", "7", low=1, high=1e7),
    Field("units_line", "whole", "line of the units", "8", low=1, high=1e7),
    Field("names", "list", "of the columns, where the files name none", '["time", "X1A"]'),
)
CHANNEL = (
    Field("like", "text", "a sensor of the same type: its entries but axis, pad and position", '"L1H"'),
    Field("quantity", "choice", "what the column holds", '"displacement"', required=True, known=QUANTITIES),
    Field("axis", "angle", "direction of the positive quantity, counter-clockwise from +X", '"45 deg"'),
    Field("unit", "text", "of the readings; V, mA, mV/V, or an engineering unit if already converted", '"V"'),
    Field("sensitivity", "calibration", "reading per quantity; of a bridge: mV/V at full scale", '"7.78 mV/um"'),
    Field("full_scale", "calibration", "of a bridge", '"20 kN"'),
    Field("excitation", "calibration", "supply of a bridge", '"5 V"'),
    Field("polarity", "sign", "-1: the reading falls as the quantity grows (eddy-current probes)", "-1", default=1),
    Field("zero", "calibration", "value at reading zero", '"0 degC"'),
    Field("pad", "whole", "number of the pad with the sensor", "1", low=1, high=100),
    Field(
        "position", "ratio", "fraction of the arc from the leading edge", "0.75",
        low=0.0, high=1.0, remedy="It is the fraction of the arc, 0 to 1",
    ),
    Field(
        "uncertainty", "ratio", "of the calibration", '"1 %"',
        low=0.0, below=1.0, remedy='Give e.g. "1 %", below 100 %',
    ),
    Field("axis_uncertainty", "angle", "of the axis", '"0.5 deg"', default=0.0, low=0.0),
    Field("zero_uncertainty", "calibration", "of the zero", '"50 N"', default=0.0, low=0.0),
    Field(
        "delay", "time", "recorded later than the others by this; taken out", '"0.2 ms"', default=0.0,
        low=-10.0, high=10.0, remedy="It must be below 10 s",
    ),
    Field("delay_uncertainty", "time", "shared by channels of a clock or quantity", '"0.02 ms"', default=0.0, low=0.0),
    Field("filter", "text", "bessel or butterworth, order, low or high, corner; taken out", '"bessel 4 low 800 Hz"'),
    Field("filter_table", "text", "file of the measured response: frequency_Hz, gain, phase_deg", '"l1h.csv"'),
    Field("clock", "text", "channels recorded by one device share a letter", '"B"', default=""),
)  # fmt: skip
RUN = (
    Field("id", "text", "name of the run", '"d-05000-25-03"', required=True),
    Field("file", "text", "record in the folder; HDF5: the group /runs/ID", '"runs/d-05000-25-03.csv"', default=""),
    Field("kind", "choice", "what was done", '"dynamic"', required=True, known=KINDS),
    Field("shaft_speed", "speed", "of the shaft, set point", '"22 Hz"', default=0.0, low=0.0),
    Field("static_load", "force", "set point, per bearing", '"5 kN"', default=0.0, low=0.0),
    Field("static_load_direction", "angle", "where it pushes the shaft; down is -90 deg", '"-90 deg"', -math.pi / 2),
    Field("excitation_frequency", "speed", "of a sine", '"25 Hz"', default=0.0, above=0.0),
    Field("excitation_direction", "angle", "of the force", '"54 deg"'),
    Field("excitation", "choice", "its course in time", '"sweep"', default="sine", known=EXCITATIONS),
    Field("excitation_band", "text", "in place of the frequency, where it is no sine", '"5..120 Hz"'),
    Field("pad", "whole", "number of the pad that a dry test loads, without quotes", "1", low=1, high=100),
    Field("branch", "choice", "of a dry test's load", '"cycle"', default="up", known=BRANCHES),
    Field("sample_rate", "frequency", "of this run", '"500 Hz"', above=0.0),
)
TABLES = {
    "": TOP, "[housing]": HOUSING, "[acquisition]": ACQUISITION, "[csv]": CSV,
    "[channels.NAME]": CHANNEL, "[[runs]]": RUN,
}  # fmt: skip


def draft_line(fields: tuple[Field, ...], key: str, value: str) -> str:
    """A line of a draft: the key, its value as TOML, and what it means."""
    field = next(field for field in fields if field.key == key)
    return f"{key} = {value}   # {field.meaning}"


def markdown() -> str:
    """The tables of all keys, as docs/campaigns.md shows them."""
    lines = []
    for title, fields in TABLES.items():
        lines += [f"**`{title or 'top of the file'}`**", "", "| key | holds | example | meaning |", "|---|---|---|---|"]
        for field in fields:
            if field.meaning:
                lines.append(f"| `{field.key}` | {_holds(field)} | `{field.example}` | {field.meaning} |")
        lines.append("")
    return "\n".join(lines)


_HOLDS = {
    "whole": "whole number",
    "list": "list of texts",
    "sign": "1 or -1",
    "calibration": "with its unit",
    "ratio": "number or %",
}


def _holds(field: Field) -> str:
    text = ", ".join(field.known) or _HOLDS.get(field.kind, field.kind)
    if field.kind == "whole":
        text += f" from {field.low:g}"
    if field.required:
        return f"{text}; needed"
    if field.kind == "choice":
        return f"{text}; default {field.default}"
    return text
