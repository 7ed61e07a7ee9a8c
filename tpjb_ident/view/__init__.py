"""A local page to look into a campaign and its results; needs the extra ``view`` (Bokeh). Started by `tpjb view`."""
