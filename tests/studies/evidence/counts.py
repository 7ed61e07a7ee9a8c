"""Counts of outcomes: per kind and size, per effect, per plan, and what was named while the truth was not known."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from tests.studies.evidence.outcome import KINDS, NOT_RUN, OUTCOMES, RIGHT, SMALL, Row, outcome, run, rung
from tests.studies.evidence.shares import share_interval, upper_bound

if TYPE_CHECKING:
    import pandas as pd

#: Columns of a confusion matrix beside the names of effects.
HELD, LARGE, OTHER_PLACE, SEVERAL = "group holds it", "large group", "other pad or direction", "several effects"
WRONG_GROUP = "group without it"
SPECIAL = (HELD, LARGE, WRONG_GROUP, OTHER_PLACE, SEVERAL, "consistent", "unexplained")


def summary_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Count outcomes per kind, size and noise, with the share of right answers and the 95 % bounds of errors."""
    import pandas as pd

    groups: dict[tuple[Any, ...], Counter[str]] = {}
    for row in rows:
        if row["kind"] not in KINDS:
            continue
        groups.setdefault((rung(row), row["kind"], row["size"], row["noise"]), Counter())[outcome(row)] += 1
    out = []
    for (where, kind, size, noise), counts in sorted(groups.items(), key=lambda item: _order(*item[0])):
        total = sum(counts[name] for name in OUTCOMES)
        if not total:
            continue
        right = sum(counts[name] for name in RIGHT)
        abstained = counts["unexplained"] + sum(counts[k] for k in ("group right", "large group", "group wrong"))
        alarms = total - counts["consistent"] if kind == "none" else counts["named wrong"]
        out.append(
            {
                "rung": where, "kind": kind, "size_sigma": size, "noise_factor": noise, "trials": total,
                "right_share": right / total if kind in {"hidden", "two"} else math.nan,
                "abstained_share": abstained / total if kind == "left out" else math.nan,
                "errors": alarms, "error_share_upper_95": upper_bound(alarms, total),
                **{name.replace(" ", "_"): counts[name] for name in OUTCOMES},
                "unreachable": sum(counts[name] for name in NOT_RUN),
            }
        )  # fmt: skip
    return pd.DataFrame(out)


def _order(where: str, kind: str, size: float, noise: float) -> tuple[Any, ...]:
    """Surrogates first, then raw volts; hidden effects by size, then what else was tried."""
    return (where != "surrogate", where, KINDS.index(kind), size, noise)


def confusion_table(rows: Sequence[Row], kind: str = "hidden") -> pd.DataFrame:
    """Hidden effect, pad and direction spelt out, against what came out; one line per effect, size, noise, answer."""
    import pandas as pd

    cells: dict[tuple[str, str, float, float], Counter[str]] = {}
    for row in run(rows, kind):
        key = (rung(row), " + ".join(row["truth"]), row["size"], row["noise"])
        cells.setdefault(key, Counter())[_text(row)] += 1
    columns = ["rung", "hidden", "size_sigma", "noise_factor", "said", "count"]
    out = [(*key, said, count) for key, counts in sorted(cells.items()) for said, count in counts.most_common()]
    return pd.DataFrame(out, columns=columns)


def _text(row: Row) -> str:
    if row["verdict"] == "named":
        return " + ".join(row["labels"])
    if row["verdict"] == "ambiguous":
        return " / ".join(name for group in row.get("alternatives") or row["groups"] for name in group)
    return str(row["verdict"])


def confusion_matrix(rows: Sequence[Row], kind: str = "hidden", size: float | None = None) -> pd.DataFrame:
    """Name of the hidden effect against the verdict, counts.

    Parameters
    ----------
    rows : sequence of Row
    kind : str
        ``"hidden"`` or ``"left out"``.
    size : float, optional
        Only effects of this d'.

    Returns
    -------
    DataFrame
        One row per name; a column per name that was hidden or said, then `SPECIAL`.
    """
    import pandas as pd

    chosen = [r for r in run(rows, kind) if size is None or r["size"] == size]
    cells = Counter((_name(row["truth"][0]), _column(row)) for row in chosen)
    hidden = sorted({name for name, _ in cells})
    said = sorted({column for _, column in cells} - set(SPECIAL) | set(hidden))
    names = [*said, *SPECIAL]
    frame = pd.DataFrame([[cells[h, s] for s in names] for h in hidden], columns=names)
    frame.insert(0, "hidden", hidden)
    return frame


def _name(label: str) -> str:
    return label.split(" ", 1)[0]


def _column(row: Row) -> str:
    """Column of a confusion matrix in which a trial counts."""
    came = outcome(row)
    if row["verdict"] == "named":
        names = [_name(label) for label in row["labels"]]
        if len(names) > 1:
            return SEVERAL
        return OTHER_PLACE if came == "named wrong" and names[0] == _name(row["truth"][0]) and (
            row["kind"] == "hidden") else names[0]  # fmt: skip
    return {"group right": HELD, "large group": LARGE, "group wrong": WRONG_GROUP}.get(came, came)


def impostors_table(rows: Sequence[Row]) -> pd.DataFrame:
    """What was named, or headed a group, while the true effect was missing from the library; most frequent first."""
    import pandas as pd

    cells: dict[tuple[str, str, str], list[Row]] = {}
    for row in run(rows, "left out"):
        if row["verdict"] in {"named", "ambiguous"}:
            cells.setdefault((row["truth"][0], row["verdict"], " + ".join(sorted(row["labels"]))), []).append(row)
    out: list[dict[str, Any]] = [
        {
            "left_out": truth, "verdict": verdict, "impostor": said, "count": len(mine),
            "sizes_sigma": ", ".join(f"{size:g}" for size in sorted({r["size"] for r in mine})),
            "rungs": ", ".join(sorted({rung(r) for r in mine})),
        }
        for (truth, verdict, said), mine in cells.items()
    ]  # fmt: skip
    columns = ["left_out", "verdict", "impostor", "count", "sizes_sigma", "rungs"]
    out.sort(key=lambda line: (line["verdict"] != "named", -int(line["count"]), line["left_out"], line["impostor"]))
    return pd.DataFrame(out, columns=columns)


def abstention_table(rows: Sequence[Row]) -> pd.DataFrame:
    """With the true effect left out: share that abstains, with its 95 % interval, per rung and size."""
    import pandas as pd

    out = []
    cells = sorted({(rung(r), r["size"]) for r in run(rows, "left out")}, key=lambda c: (c[0] != "surrogate", *c))
    for where, size in cells:
        mine = [r for r in run(rows, "left out") if (rung(r), r["size"]) == (where, size)]
        counts = Counter(str(r["verdict"]) for r in mine)
        shy = counts["unexplained"] + counts["ambiguous"]
        share, low, high = share_interval(shy, len(mine))
        out.append(
            {
                "rung": where, "size_sigma": size, "trials": len(mine), "unexplained": counts["unexplained"],
                "ambiguous": counts["ambiguous"], "consistent": counts["consistent"], "named": counts["named"],
                "abstained_share": share, "abstained_lo": low, "abstained_hi": high,
            }
        )  # fmt: skip
    return pd.DataFrame(out)


def plans_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Raw volts per plan: what was consistent with nothing hidden, what was right with something hidden."""
    import pandas as pd

    raw = [r for r in rows if rung(r).startswith("raw volts")]
    out = []
    for plan in dict.fromkeys(str(r.get("plan", "paper")) for r in sorted(raw, key=rung)):
        mine = [r for r in raw if r.get("plan", "paper") == plan]
        none, hidden, missing = (run(mine, kind) for kind in ("none", "hidden", "left out"))
        came = Counter(outcome(r) for r in hidden)
        out.append(
            {
                "plan": plan, "nothing_hidden": len(none),
                "consistent": sum(r["verdict"] == "consistent" for r in none),
                "hidden": len(hidden), "named_right": came["named right"],
                f"in_group_of_{SMALL}_or_fewer": came["group right"], "named_wrong": came["named wrong"],
                "other": len(hidden) - came["named right"] - came["group right"] - came["named wrong"],
                "left_out": len(missing),
                "left_out_abstained": sum(r["verdict"] in {"unexplained", "ambiguous"} for r in missing),
            }
        )  # fmt: skip
    return pd.DataFrame(out)
