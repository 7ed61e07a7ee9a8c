"""What this package raises when it must refuse: one base, so that a caller needs to know one name."""

from __future__ import annotations


class RigError(ValueError):
    """Something that this package was given cannot be used; the message says what, where and what to do."""
