"""Find where simulation and measurement disagree, name the missing effect, show that the gap shrinks."""

from tpjb_ident.model_guard import check_model

check_model()  # before any file of this package imports the model
