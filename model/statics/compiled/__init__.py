"""The search for an equilibrium in one compiled call, for rigid pads whose films exchange no heat."""
