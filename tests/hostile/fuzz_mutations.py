"""How the fuzzer spoils a good file: bytes, tokens, numbers and lines, by a seed.

The tokens are what real and hostile exports hold: infinities, units of the wrong kind, huge exponents, marks that turn
the writing round, words that mean something to TOML, CSV and HDF5.
"""

import random
import re
from collections.abc import Sequence

_NUMBERS = """
    nan inf -inf 0 -0.0 -1 1e308 -1e308 1e-320 1e999 0x10 1_000 1,5 1.5.2 + --1 1e 4294967296 1e9 -2147483649
"""
NUMBERS = [*_NUMBERS.split(), "9" * 400, "1e" + "9" * 40, "", " ", "\N{ARABIC-INDIC DIGIT FIVE}"]
_WORDS = r"""
    "%s" true [] {} [[]] [{}] "../../etc/passwd" "C:\\x" "\\\\host\\share" 1979-05-27 {a={a={a=1}}} ''' "\u202e"
    = # NaN #N/A - ; , | " ' =1+1 <script> [a.b.c.d] [[runs]] dynamic dry_pivot
"""
WORDS = [*_WORDS.split(), *"\u202e\u2066\x00\ufeff\ud7ff\t\r", "\x1b[31m", "9" * 5000, "[" * 300, "a." * 60 + "a = 1"]
WORDS += ['"0 V"', '"1e308 N"', '"-5 kN"', '"5 parsec"', '"nan Hz"', '"1 m/m"', '"1 N^99999"', '"90 deg"', '"""']
WORDS += ["a.b.c.d.e.f = 1"]
_NUMBER = re.compile(rb"-?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?")


def mutated(seeds: Sequence[bytes], rng: random.Random, largest: int = 65536) -> bytes:
    """One of `seeds`, spoilt in one to eight ways."""
    data = bytearray(rng.choice(seeds))
    for _ in range(1 + min(7, int(rng.expovariate(0.7)))):
        data = rng.choice(_WAYS)(data, rng.randrange(len(data)) if data else 0, rng, seeds)
    return bytes(data[:largest])


def _byte(data: bytearray, at: int, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    """Change a bit of a byte, or all of it."""
    if data:
        whole = (0, 255, 127, 128, 10, 13, 9, 32, rng.randrange(256))
        data[at] = rng.choice((data[at] ^ 1 << rng.randrange(8), rng.choice(whole)))
    return data


def _piece(data: bytearray, at: int, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    """Cut a piece out, or all behind it, or have it there several times, or put one of another seed in its place."""
    end = at + 1 + int(rng.expovariate(0.02))
    way = rng.choice(("cut", "end", "double", "splice"))
    if way == "cut":
        del data[at:end]
    elif way == "end":
        del data[at:]
    elif way == "double":
        data[at:at] = bytes(data[at:end]) * rng.choice((1, 1, 2, 50))
    else:
        other = rng.choice(seeds)
        start = rng.randrange(len(other)) if other else 0
        data[at : at + rng.randrange(64)] = other[start : start + rng.randrange(1, 400)]
    return data


def _token(data: bytearray, at: int, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    data[at : at + rng.choice((0, 0, 1, 8))] = rng.choice(WORDS).encode("utf-8")
    return data


def _number(data: bytearray, at: int, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    found = _NUMBER.search(data, at)
    if found:
        data[found.start() : found.end()] = rng.choice(NUMBERS).encode("utf-8")
    return data


def _value(data: bytearray, at: int, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    """Replace what stands right of an equals sign."""
    at = data.find(b"=", at)
    end = data.find(b"\n", at)
    if 0 <= at < end:
        data[at + 1 : end] = b" " + rng.choice(WORDS + NUMBERS).encode("utf-8")
    return data


def _lines(data: bytearray, at: int, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    """Exchange two lines, or drop one, or double it, or put others before it."""
    lines = bytes(data).split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    way = rng.randrange(4)
    if way == 0:
        lines[i], lines[j] = lines[j], lines[i]
    elif way == 1:
        del lines[i]
    elif way == 2:
        lines.insert(j, lines[i])
    else:
        lines[i:i] = [rng.choice(WORDS).encode("utf-8")] * rng.choice((1, 3, 200))
    return bytearray(b"\n".join(lines))


_WAYS = (*2 * (_byte, _token, _number, _value, _lines), *4 * (_piece,))
