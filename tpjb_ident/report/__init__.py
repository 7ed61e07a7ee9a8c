"""Reports: one self-contained HTML page with its figures; the only place that knows matplotlib."""
