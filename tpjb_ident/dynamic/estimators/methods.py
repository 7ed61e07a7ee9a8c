"""Names of the estimators, apart from their code: what a command line offers before anything heavy is imported."""

from __future__ import annotations

#: Every method of `estimate_dynamic_stiffness`; `tpjb_ident.dynamic.estimators.estimate.SOLVERS` has a solver for each.
METHODS = ("ols", "rlm", "mm", "mm-eiv", "iv")
#: Those of ``estimators.csv``; ``"rlm:tukey"`` names a norm.
TABLED = ("ols", "rlm:huber", "rlm:tukey", "mm", "mm-eiv", "iv")
