"""Numbers as a reader wants them."""

import math

import pytest

from tpjb_ident.rounding import fixed, percent, signed, with_interval


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((163.2841e6, 162.0e6, 164.6e6, 1e6), "163.3 ± 1.3"),
        ((-0.4849e6, -1.04e6, 0.07e6, 1e6), "−0.48 ± 0.56"),
        ((652.1e6, 640e6, 664e6, 1e6), "652 ± 12"),
        ((0.00001e6, -0.5e6, 0.5e6, 1e6), "0.00 ± 0.50"),
        ((66.4, 0.0, 294.7), "66 (0 to 295)"),
        ((5.0, math.nan, math.nan), "5"),
        ((math.nan, 1.0, 2.0), "no answer"),
    ],
)
def test_digits_follow_the_interval(arguments, expected):
    assert with_interval(*arguments) == expected


def test_signs():
    assert signed(0.04) == "0.0"
    assert signed(-0.04) == "0.0"
    assert signed(1.25) == "+1.2"
    assert signed(-1.26) == "−1.3"
    assert signed(math.nan) == "–"
    assert percent(-0.123) == "−12.3\N{NO-BREAK SPACE}%"
    assert fixed(math.inf) == "–"
