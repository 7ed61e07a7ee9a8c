"""How the fuzzer spoils a good file: bytes, tokens, numbers and lines, by a seed.

The tokens are what real and hostile exports hold: infinities, units of the wrong kind, huge exponents, marks that turn
the writing round, words that mean something to TOML, CSV and HDF5.
"""

from __future__ import annotations

import random
import re
from collections.abc import Sequence

NUMBERS = (
    "nan",
    "inf",
    "-inf",
    "0",
    "-0.0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "9" * 400,
    "1e" + "9" * 40,
    "0x10",
    "1_000",
    "1,5",
    "1.5.2",
    "+",
    "--1",
    "1e",
    "",
    " ",
    "\N{ARABIC-INDIC DIGIT FIVE}",
    "4294967296",
    "1e9",
    "-2147483649",
)
WORDS = (
    '"0 V"',
    '"1e308 N"',
    '"-5 kN"',
    '"5 parsec"',
    '"nan Hz"',
    '"1 m/m"',
    '"1 N^99999"',
    '"90 deg"',
    '"%s"',
    "true",
    "[]",
    "{}",
    "[[]]",
    "[{}]",
    '"../../etc/passwd"',
    '"C:\\\\x"',
    '"\\\\\\\\host\\\\share"',
    "1979-05-27",
    '"""',
    "'''",
    "=",
    "#",
    '"\\u202e"',
    "\u202e",
    "\u2066",
    "\x00",
    "\x1b[31m",
    "\ufeff",
    "\ud7ff",
    "NaN",
    "#N/A",
    "-",
    ";",
    ",",
    "\t",
    "\r",
    "|",
    '"',
    "'",
    "=1+1",
    "<script>",
    "[a.b.c.d]",
    "[[runs]]",
    "a.b.c.d.e.f = 1",
    "{a={a={a=1}}}",
    "dynamic",
    "dry_pivot",
    "9" * 5000,
    "[" * 300,
    "a." * 60 + "a = 1",
)
_NUMBER = re.compile(rb"-?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?")


def mutated(seeds: Sequence[bytes], rng: random.Random, largest: int = 65536) -> bytes:
    """One of `seeds`, spoilt in one to eight ways."""
    data = bytearray(rng.choice(seeds))
    for _ in range(1 + min(7, int(rng.expovariate(0.7)))):
        data = rng.choice(_WAYS)(data, rng, seeds)
    return bytes(data[:largest])


def _place(data: bytearray, rng: random.Random) -> int:
    return rng.randrange(len(data)) if data else 0


def _flip(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    if data:
        data[_place(data, rng)] ^= 1 << rng.randrange(8)
    return data


def _byte(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    if data:
        data[_place(data, rng)] = rng.choice((0, 255, 127, 128, 10, 13, 9, 32, rng.randrange(256)))
    return data


def _cut(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    at = _place(data, rng)
    del data[at : at + 1 + int(rng.expovariate(0.02))]
    return data


def _end(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    return data[: _place(data, rng)]


def _double(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    at = _place(data, rng)
    piece = bytes(data[at : at + 1 + int(rng.expovariate(0.02))])
    data[at:at] = piece * rng.choice((1, 1, 2, 50))
    return data


def _splice(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    other = rng.choice(seeds)
    start = rng.randrange(len(other)) if other else 0
    at = _place(data, rng)
    data[at : at + rng.randrange(64)] = other[start : start + rng.randrange(1, 400)]
    return data


def _token(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    at = _place(data, rng)
    data[at : at + rng.choice((0, 0, 1, 8))] = rng.choice(WORDS).encode("utf-8")
    return data


def _number(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    found = _NUMBER.search(data, _place(data, rng))
    if found:
        data[found.start() : found.end()] = rng.choice(NUMBERS).encode("utf-8")
    return data


def _value(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
    """Replace what stands right of an equals sign."""
    at = data.find(b"=", _place(data, rng))
    end = data.find(b"\n", at)
    if 0 <= at < end:
        data[at + 1 : end] = b" " + rng.choice(WORDS + NUMBERS).encode("utf-8")
    return data


def _lines(data: bytearray, rng: random.Random, seeds: Sequence[bytes]) -> bytearray:
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


_WAYS = (_flip, _byte, _cut, _end, _double, _splice, _token, _token, _number, _number, _value, _value, _lines, _lines)
