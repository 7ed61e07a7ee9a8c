"""Packages that can be called: `ti.diagnose(...)` and `tpjb_ident.diagnose.search` are one name for two things.

Importing a submodule sets its package as an attribute of the parent; a function of the same name there would be hidden
or not, depending on what was imported first. A package that can be called is the same either way.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from types import ModuleType
from typing import Any


class CallablePackage(ModuleType):
    """A package whose call is one of its functions, imported then."""

    _called: str

    def _function(self) -> Any:
        module, _, name = self._called.partition(":")
        return getattr(importlib.import_module(module), name)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the function that the package stands for."""
        return self._function()(*args, **kwargs)

    @property
    def __signature__(self) -> inspect.Signature:
        """Of the function that a call runs: what `help` and completion show."""
        return inspect.signature(self._function())


def make_callable(package: str, function: str) -> None:
    """Let a package be called."""
    module = sys.modules[package]
    module.__class__ = CallablePackage
    module._called = function  # type: ignore[attr-defined]
