"""Every option and argument that can be typed, by command and name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from typer import Argument, Option
from typer.models import ParameterInfo

from rigdata.near_names import hint
from rigdata.operating_point import ROTATIONS
from tpjb_ident.errors import BadInputError
from tpjb_ident.exports.formats import FORMATS

#: Bundled files that the examples use, from the folder of the sources.
DEMO, ROCKER = "rigdata/samples/demo.h5", "model/bearings/rocker.toml"
METHODS = ("mm-eiv", "mm", "rlm", "ols", "iv")
NORMS = ("huber", "tukey", "hampel", "andrew", "ramsay", "trimmed")
THERMAL = ("isothermal", "adiabatic", "tehd", "thd")
#: What `predict` can do beyond the paper's model; docs/model.md says what each does.
PHYSICS = ("conduction", "journal", "growth", "jfo", "perturbed-heat", "perturbed-bending", "axial-tilt", "turbulence")


def _one_of(names: Iterable[str]) -> Callable[[str], list[str]]:
    """Complete a half-typed value to the names it may become."""
    return lambda incomplete: [name for name in names if name.startswith(incomplete)]


_BEARING_FILE = Argument(metavar="BEARING.toml", help="Bearing file (tpjb-bearing/1).")
#: Options by the name of their parameter, those of one command alone behind its name: their text, or all about them.
_OPTIONS: dict[str, str | ParameterInfo] = {
    "campaign": Argument(metavar="CAMPAIGN", help="Campaign: a folder with campaign.toml, or one HDF5 file."),
    "compare other": Argument(metavar="[OTHER]", help="A second campaign, or a folder of results: what changed."),
    "export source": Argument(
        metavar="CAMPAIGN|DIR|BEARING.toml", help="A campaign (identified first), results, or a bearing."
    ),
    "show source": Argument(metavar="FILE", help="A campaign, or one record file (CSV, TDMS, UFF, MAT, ..)."),
    "view source": Argument(metavar="CAMPAIGN|DIR", help="A campaign, or an output folder of tpjb."),
    "init folder": Argument(metavar="FOLDER", help="Folder with the records of a logger."),
    "watch folder": Argument(metavar="FOLDER", help="Campaign folder, with campaign.toml: the plan."),
    "rerun record": Argument(metavar="RUN.json", help="run.json of an output folder, or that folder."),
    "verify results": Argument(metavar="DIR", help="Output folder of tpjb commands, with its run.json."),
    "plan bearing": _BEARING_FILE,
    "predict bearing": _BEARING_FILE,
    "simulate bearing": _BEARING_FILE,
    "bearing": Option(metavar="FILE", help="Bearing file [default: the one that the campaign names]."),
    "init bearing": Option(metavar="NAME", help="Bearing file in that folder [default: looked for]."),
    "coefficients": Option(metavar="TABLE.csv", help="Instead of a campaign: K, C as in coefficients.csv."),
    "reading_error": Option(metavar="SHARE", help="How far values of the table hold, such as 5%."),
    "prediction": Option(metavar="TABLE.csv", help="Another program's K and C as well; may be repeated."),
    "pivots": 'rigid, kirk, kirk-secant, a pivots.toml, or a stiffness ("5e8 N/m").',
    "compare pivots": 'Pivot models to compare: some of "rigid, kirk, kirk-secant, measured".',
    "diagnose pivots": "Where to start from: kirk, rigid, measured or a pivots.toml.",
    "thermal": Option(
        help="isothermal, adiabatic, tehd (pads bend) or thd (heat as it goes: what leaves a pad is there for the next "
        "one, lambda 1, unless the effect hot_oil_carryover says less; the file's clearances hold at 20 degC).",
        autocompletion=_one_of(THERMAL),
    ),
    "effects": Option(metavar="FILE", help="Effects file: what the baseline model lacks."),
    "physics": Option(metavar="NAMES", help=f'Beyond the paper\'s model: some of "{", ".join(PHYSICS)}".'),
    "housing_temperature": 'With growth: mean temperature of the housing, "48 degC" [default: the oil supply\'s].',
    "model_tolerance": Option(
        min=1e-4, max=0.5, help="What the model is trusted to, share of the direct coefficients [1.5 %]."
    ),
    "tolerance": Option(metavar="NAME=VALUE", help="How well something is known: viscosity=4%; repeatable."),
    "rerun tolerance": Option(min=0.0, help="Difference that is rounding: relative, or of half an interval's width."),
    "library": Option(metavar="FILE.py", help="Effects of your own; the file's code is run."),
    "load": 'Static loads per bearing: "2.5 kN, 5 kN" or "2.5..8.75:1.25 kN".',
    "simulate load": "Loads of the dynamic runs, instead of the plan's.",
    "load_direction": "Where the load pushes the shaft, from +X.",
    "speed": 'Shaft speeds: "22 Hz" or "1320 rpm".',
    "rotation": Option(
        help="Which way the shaft turns [default: the bearing file's, else counter-clockwise].",
        autocompletion=_one_of(ROTATIONS),
    ),
    "plan excitation": "Excitation frequencies, each at every load.",
    "predict excitation": 'Excitation frequencies: "10..50:10 Hz" [default: synchronous].',
    "simulate excitation": "Excitation frequencies, each at every --load [default: 25 Hz].",
    "method": Option(
        help="Estimator of coefficients.csv: mm-eiv, mm, rlm, ols or iv.", autocompletion=_one_of(METHODS)
    ),
    "norm": Option(help="Norm of --method rlm: huber, tukey, hampel, ...", autocompletion=_one_of(NORMS)),
    "lines": Option(metavar="LIST", help='Excitation lines that every record holds: "20, 25, 30 Hz".'),
    "delay": Option(metavar="QUANTITY=TIME", help="Known lateness of channels, as force=0.2ms; repeatable."),
    "workers": Option(metavar="N", min=1, help="Processes [default: one per core where it pays]."),
    "scheduler": Option(metavar="ADDRESS", help="Dask scheduler to work on, such as tcp://host:8786."),
    "plain": Option("--plain", help="Also write plain.csv: Eq. (15) by statsmodels' RLM, nothing corrected."),
    "keep_r": Option("--keep-r", help="Write the R matrices of Eq. (15) too: r_matrices.h5."),
    "window": Option(metavar="TIME", help="Window length of --plain and --keep-r."),
    "locus": Option(min=0, max=360, help="Load directions of the shaft locus; 0: none."),
    "dry": "Dry load-deflection tests on all pads.",
    "push": Option(min=0.0, help="Push load of the clearance sweep [N]; 0: none."),
    "temperatures": "A temperature sensor in every pad.",
    "data_sets": Option("--data-sets", help="Also: what parts of it could tell, A to E."),
    "plan": "paper (92 runs, as in the reference paper) or short (34 runs).",
    "repeats": Option(min=1, max=100, help="Records per point and direction."),
    "noise": Option(min=0.0, max=1000.0, help="Channel noise: 1 as on a real rig, 0 no disturbance at all."),
    "fault": 'A defect: "KIND run=PATTERN channel=NAME value=.. start=.. length=..". Repeatable.',
    "seed": Option(min=0, help="Same seed, same campaign, to the last bit."),
    "name": "Id of the campaign.",
    "layout": Option("--format", help="hdf5, csv, csv-german, csv-tabbed or csv-bare."),
    "to": Option(help=f"{', '.join(FORMATS)}.", autocompletion=_one_of(FORMATS)),
    "force": Option("--force", help="Also write points that are not to be trusted, marked; exit code 3 stays."),
    "ross": Option(metavar="2|3", help="Version of ROSS; default: the installed one, else 3."),
    "update": Option("--update", help="Carry on a campaign.toml that was edited: new records, guesses made anew."),
    "run": Option(metavar="ID", help="One run of a campaign, channel by channel."),
    "picture": Option("--picture", help="Draw channels and spectra to a PNG and an SVG in --out."),
    "given": Option("--input", metavar="PATH", help="Campaign or file the results came from, if moved; repeatable."),
    "port": Option(min=0, max=65535, help="Port on this machine; 0: any free one."),
    "browser": "Open the page in your browser.",
    "seconds": Option(min=0.1, help="Stop after this time [default: at Ctrl-C]."),
    "once": Option("--once", help="Look once and end: exit code 3 if a run must be repeated."),
    "every": Option(metavar="TIME", help="How often to look."),
    "settle": Option(metavar="TIME", help="A file that has not changed for so long is written."),
    "within": Option(metavar="SHARE", help='Interval that you want, such as "3 %": says how many records more.'),
    "out": Option(metavar="DIR", help="Folder for the results [default: tpjb-COMMAND-out here]."),
    "init out": Option(metavar="DIR", help="Folder for the draft [default: beside the records]."),
    "view out": Option(metavar="DIR", help="Not used: looking writes nothing."),
    "as_json": Option("--json", help="Print one JSON document with all results, for other programs."),
    "units": "Units of what is printed and drawn: si or us.",
    "quiet": Option("--quiet", "-q", help="Print warnings and errors only."),
}


def option(command: str, parameter: str) -> ParameterInfo:
    """What can be typed for a parameter of a command."""
    info = _OPTIONS.get(f"{command} {parameter}") or _OPTIONS[parameter]
    return Option(help=info) if isinstance(info, str) else info


def named(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options as a report shows them: files by their names."""
    return {name: getattr(value, "name", value) for name, value in options.items()}


def refuse_unknown(value: str, known: Iterable[str], option: str) -> None:
    """Let a known name pass; answer another with the nearest."""
    names = tuple(known)
    if value not in names:
        raise BadInputError(f"{option}: {value!r} is not known. {hint(value, names, 'Use one of')}")


def known_names(text: str, known: Iterable[str], option: str) -> tuple[str, ...]:
    """Names in a list with commas, each once; at least one."""
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip())) or ("",)
    for name in names:
        refuse_unknown(name, known, option)
    return names
