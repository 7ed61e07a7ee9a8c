"""Examples that stand under every command's help; a test runs each of them as far as its options are read."""

from __future__ import annotations

DEMO = "rigdata/samples/demo.h5"
ROCKER = "model/bearings/rocker.toml"

EXAMPLES: dict[str, tuple[str, ...]] = {
    "check": (f"tpjb check {DEMO}", f"tpjb check {DEMO} --json > findings.json"),
    "compare": (f"tpjb compare {DEMO}", f'tpjb compare {DEMO} --pivots "kirk, measured" --thermal tehd'),
    "demo": ("tpjb demo", "tpjb demo --out /tmp/look"),
    "diagnose": (f"tpjb diagnose {DEMO}", f"tpjb diagnose {DEMO} --pivots measured --out found"),
    "export": (
        "tpjb export tpjb-identify-out --to ross",
        "tpjb export tpjb-predict-out --to excel",
        f"tpjb export {DEMO} --to mat",
    ),
    "identify": (f"tpjb identify {DEMO}", f"tpjb identify {DEMO} --method rlm --norm tukey --out rlm"),
    "init": ("tpjb init exports", "tpjb init exports --bearing rocker.toml"),
    "locus": (f"tpjb locus {DEMO}",),
    "pivot": (f"tpjb pivot {DEMO}",),
    "plan": (
        f"tpjb plan {ROCKER}",
        f'tpjb plan {ROCKER} --load "5, 10 kN" --excitation "20..60:10 Hz" --locus 0',
    ),
    "predict": (
        f'tpjb predict {ROCKER} --load "2.5..8.75:1.25 kN" --excitation "25 Hz"',
        f'tpjb predict {ROCKER} --pivots rigid --speed "1000, 2000, 3000 rpm"',
        f"tpjb predict {ROCKER} --pivots tpjb-pivot-out/pivots.toml --thermal tehd",
    ),
    "show": (
        f"tpjb show {DEMO}",
        f"tpjb show {DEMO} --run d-05000-25-01 --picture",
        "tpjb show exports/run1.csv",
    ),
    "simulate": (
        f"tpjb simulate {ROCKER} --plan short --seed 1",
        f'tpjb simulate {ROCKER} --load "5 kN" --excitation "10..50:10 Hz" --fault "dead run=d-* channel=X1A"',
    ),
    "verify": ("tpjb verify tpjb-identify-out", "tpjb verify tpjb-identify-out --input campaigns/rocker-A"),
    "watch": ("tpjb watch records", 'tpjb watch records --once --within "3 %"'),
    "view": (f"tpjb view {DEMO}", "tpjb view tpjb-compare-out"),
}
