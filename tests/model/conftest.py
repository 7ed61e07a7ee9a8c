"""The two bundled bearings, read once: they are frozen, every change is a copy."""

import pytest

from model.bearing import Bearing
from model.bearing_file import load_bearing


@pytest.fixture(scope="session")
def rocker(rocker_file) -> Bearing:
    return load_bearing(rocker_file)


@pytest.fixture(scope="session")
def spherical(rocker_file) -> Bearing:
    return load_bearing(rocker_file.with_name("spherical.toml"))
