"""Load-deflection laws of a pivot, their fit and the choice among them."""
