"""Evidence: what many trials of the diagnosis add up to. Rows in, tables out; no model and no pictures in here."""
