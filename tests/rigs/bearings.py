"""Bearings that differ from a bundled one."""

from dataclasses import replace
from typing import Any

from model.bearing import Bearing


def changed_pads(bearing: Bearing, **changes: Any) -> Bearing:
    """Copy of a bearing whose pads have other values, all alike."""
    return bearing.with_pads(tuple(replace(pad, **changes) for pad in bearing.pads))
