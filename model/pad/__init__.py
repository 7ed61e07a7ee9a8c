"""The pad as an elastic, heat-conducting solid, seen from the oil film."""
