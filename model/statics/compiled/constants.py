"""Constants of the search for an equilibrium."""

from __future__ import annotations

#: Largest step of the journal, as a share of the least clearance: the films' slopes are those of where it stands.
#: Half and twice of it change nothing.
LONGEST_STEP = 0.3

MAX_ITERATIONS = 80
#: Below this residual, and this change of temperature [K], the iteration is accelerated and the temperature no longer
#: relaxed.
NEAR, NEAR_HEAT = 0.3, 25.0
#: Steps that leave more than this share of what was left are accelerated; the others need no help.
SLOW = 0.4
#: The same where temperatures across films, pads, journal and clearances settle together: Fillon's bearing takes 8 to
#: 11 steps, 9 to 14 with 0.4.
SLOW_ACROSS = 0.12
#: A film may shrink to this share of itself in one step.
SHRINK = 0.4
#: A residual that has not fallen by this factor for so many steps has the steps halved.
PROGRESS, PATIENCE = 0.7, 12

#: Unit of lengths in the state vector [m]: a micrometre weighs as much as a kelvin.
MICROMETRE = 1e-6
#: Share of a change of temperature that is made far from the equilibrium: a much hotter film carries less and heats
#: less, and undamped the two would swing.
RELAXATION = 0.6
#: Largest change of a film temperature in one step [K]: a turbine oil (0.034 1/K) loses 40 % of its viscosity.
HEATING_STEP = 15.0
#: Weight of a temperature change against a share of the load [K]: film temperatures count as settled when one more step
#: would change them by this times `Setup.accuracy`, 3e-5 K as a rule. That is 1e-6 of the viscosity, and of that the
#: step leaves a tenth.
HEAT_PER_FORCE = 300.0
#: With temperatures across the films it ends at so many times `Setup.accuracy`: less than 1e-3 K asked for in the last
#: step. That leaves 2e-5 K and 6e-7 of K and C (rocker; two steps fewer), where a mesh twice as fine moves 0.1 K.
ACROSS_ACCURACY = 30.0
#: Kelvins beyond which a film is no film: squares would overflow.
BOUNDLESS = 1e30
