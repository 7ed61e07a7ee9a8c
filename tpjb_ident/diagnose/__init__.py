"""Find where simulation and measurement disagree, name the missing effect, show that the gap shrinks.

`ti.diagnose(campaign)` calls `tpjb_ident.diagnose.from_python.diagnose`.
"""

from __future__ import annotations

from tpjb_ident.callable_package import make_callable
from tpjb_ident.model_guard import check_model

check_model()  # before any file of this package imports the model
make_callable(__name__, "tpjb_ident.diagnose.from_python:diagnose")
