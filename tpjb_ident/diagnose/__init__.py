"""Find where simulation and measurement disagree, name the missing effect, show that the gap shrinks.

`ti.diagnose(campaign)` calls `tpjb_ident.diagnose.from_python.diagnose`.
"""

from __future__ import annotations

from tpjb_ident.callable_package import make_callable

make_callable(__name__, "tpjb_ident.diagnose.from_python:diagnose")
