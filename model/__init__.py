"""Bundled thermo-elasto-hydrodynamic model of tilting-pad journal bearings."""

#: Marks this `model` as the one of tpjb-ident; another package of the same name on the path lacks it.
DISTRIBUTION = "tpjb-ident"
