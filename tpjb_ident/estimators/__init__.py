"""Estimators of the dynamic stiffness: R matrices, Eq. (13)-(15), OLS, RLM, MM, errors in variables."""
