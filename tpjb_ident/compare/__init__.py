"""Prediction beside measurement; the only package besides `diagnose` and the command line that knows the model."""

from tpjb_ident.model_guard import check_model

check_model()  # before any file of this package imports the model
