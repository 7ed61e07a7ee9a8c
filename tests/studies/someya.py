"""Every printed row of two four-pad bearings of the Journal-Bearing Databook (T. Someya, ed., Springer 1989), and here.

    python -m tests.studies.someya [--write]

The bearing and what its numbers mean are those of `tests/literature/test_model_someya.py`; the rows are read from the
references beside the checkout (`../shared/references`), where they have been transcribed.
"""

import csv
from pathlib import Path

from tests.literature.test_model_someya import BETWEEN_PADS, ON_PAD, numbers
from tests.studies.results import report, study_parser, table

PRINTED = Path(__file__).resolve().parents[3] / "shared" / "references" / "someya_4pad_tpjb.csv"


def compared(row: dict[str, str]) -> list[str]:
    """E, K and B along and across the load: printed, and what this model has more."""
    slenderness, direction, _ = BETWEEN_PADS if row["load"] == "between pads" else ON_PAD
    eccentricity, k, b = numbers(slenderness, float(row["S"]), direction)
    cells = [row["load"], row["S"]]
    for name, here in zip(("E", "Kxx", "Kyy", "Bxx", "Byy"), (eccentricity, *k, *b), strict=True):
        printed = float(row[name])
        nothing = abs(here) < 1e-6 * max(k)
        cells.append(f"{printed:.3g}: " + ("none here" if nothing else f"{here / printed - 1.0:+.1%}"))
    return cells


def main() -> None:
    asked = study_parser(__doc__).parse_args()
    with PRINTED.open(encoding="utf-8", newline="") as file:
        rows = [compared(row) for row in csv.DictReader(file)]
    report(asked, "someya", table(("load", "S", "E", "Kxx", "Kyy", "Bxx", "Byy"), rows))


if __name__ == "__main__":
    main()
