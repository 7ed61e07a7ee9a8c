"""Rows of trials made by hand, as an evaluation would write them."""

from __future__ import annotations

import itertools

NAMES = ("soft_pivot", "oil_viscosity", "channel_delay")


def row(kind="hidden", said="soft_pivot pad 5", **other):
    """One trial of a soft pivot; `said` is a verdict, a label or a group of labels."""
    full = {
        "kind": kind, "truth": () if kind == "none" else ("soft_pivot pad 5",), "size": 0.0 if kind == "none" else 6.0,
        "noise": 1.0, "number": 0, "names": () if kind == "none" else ("soft_pivot",), "groups": (),
        "alternatives": (), "labels": (), "found": (), "p_before": 0.5 if kind == "none" else 1e-6,
    }  # fmt: skip
    if said in {"consistent", "unexplained", "unreachable"}:
        full["verdict"] = said
    elif isinstance(said, tuple):
        names = tuple(label.split(" ")[0] for label in said)
        full |= {"verdict": "ambiguous", "labels": said[:1], "found": names[:1], "groups": (names,),
                 "alternatives": (said,)}  # fmt: skip
    else:
        full |= {"verdict": "named", "labels": (said,), "found": (said.split(" ")[0],)}
    return {**full, **other}


def followed():
    """Ambiguous campaigns of two data sets with the tests after them, and one that needed none."""
    pair, out = ("soft_pivot pad 5", "channel_delay"), []
    for k, (data_set, settled, blind) in enumerate((("A", True, False), ("A", True, True), ("D", False, False))):
        then = {
            "then_tests": ("a locus", "a dry test"), "then_verdict": "named" if settled else "ambiguous",
            "then_settled": settled, "then_expected": 8.0 + k, "then_achieved": 7.5 + k, "then_chance": 0.97,
            "random_tests": ("a polygon", "a balance"), "random_verdict": "ambiguous", "random_settled": blind,
            "random_expected": 2.0, "random_achieved": -1.0 + k, "random_chance": 0.01,
            "model": pair[0], "rival": pair[1], "apart_now": 1.5,
        }  # fmt: skip
        out.append(row("next test", pair, number=k, data_set=data_set, **then))
    return [*out, row("next test", "consistent", number=9, data_set="D")]


def case():
    """One case with its gaps and residuals."""
    gaps = {
        name: {"baseline": before, "named": 1.1, "gaussian process": 1.5, "wrong effect": 0.7 * before,
               "placebo before": 0.9, "placebo after": 0.92}
        for name, before in (("kxx", 4.0), ("kyy", 9.0), ("locus_x", 3.0))
    }  # fmt: skip
    residuals = tuple(
        (model, entry, load, 25.0, z * load / 5000.0)
        for model, z in (("before", 6.0), ("after", 0.8)) for entry in ("kxx", "kyy") for load in (2500.0, 5000.0)
    )  # fmt: skip
    return row("case", gaps=gaps, residuals=residuals, wrong_name="oil_viscosity")


def rows():
    """Some of everything: both rungs, three sizes, nothing hidden, left out, simple rules."""
    numbers, out = itertools.count(), []

    def add(count, *arguments, **other):
        out.extend(row(*arguments, number=next(numbers), **other) for _ in range(count))

    naive = {"largest score": "soft_pivot", "training chi-square": "soft_pivot", "BIC": "", "random": "oil_viscosity"}
    known = {"true_value": 0.5, "value": 0.52, "lo": 0.4, "hi": 0.6}
    closed = {"closed": 1.05, "closed_wrong": 0.3, "closed_ceiling": 0.9}
    for size, right, shy in ((3.0, 1, 6), (6.0, 6, 2), (12.0, 8, 0)):
        add(right, size=size, naive=naive, **known, **closed)
        add(1, size=size, **{**known, "lo": 0.6, "hi": 0.7}, closed=0.8, closed_wrong=0.5, closed_ceiling=0.6)
        add(shy, said="consistent", size=size)
        add(1, said=("soft_pivot pad 5", "channel_delay"), size=size, noise=2.0)
    add(1, said="soft_pivot pad 4", size=6.0)
    add(3, said="oil_viscosity", size=12.0, truth=("oil_viscosity",), names=("oil_viscosity",), **known, **closed)
    add(4, said="soft_pivot pad 5", size=12.0, rung="raw volts", plan="paper", **known, **closed)
    add(2, said="unexplained", size=24.0, rung="raw volts, no locus", plan="no locus")
    for k in range(20):
        add(1, "none", "consistent", p_before=(k + 0.5) / 20, placebo_fall=0.02 * (k - 9), naive=naive)
    add(1, "none", "oil_viscosity", p_before=0.001, placebo_fall=0.2, naive=naive)
    add(3, "none", "consistent", p_before=0.4, rung="raw volts", plan="paper")
    out.extend(followed())
    out.append(case())
    add(5, "left out", "unexplained", size=12.0, naive=naive)
    add(2, "left out", "channel_delay", size=12.0, naive=naive)
    add(1, "left out", ("channel_delay", "oil_viscosity"), size=12.0)
    return out
