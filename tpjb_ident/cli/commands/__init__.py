"""One file per command of `tpjb`."""
