"""Constants: every number that decides what a diagnosis says, in one table with what set it."""

import math

#: Stated model tolerances of `outputs.md` by family, one standard deviation: of K and omega C where none is stated. How
#: much of them a campaign really needs is summed over (`comparison.evidence`).
TRUSTED = {
    "h": 0.015, "temperature": 0.5, "locus": 0.5e-6, "load": 0.003, "dry": 0.02, "clearance": 0.5e-6,
    "side_angle": 0.003,
}  # fmt: skip


class Deciding:
    """How a diagnosis decides; the method is in `docs/diagnosis.md`, its studies in `tests/studies/diagnosis`."""

    #: Prior of no fault, of one, two and three, the most that are sought: with 30 names a second fault needs 3.5 nats
    #: beyond its Occam factor.
    prior = 0.5, 0.35, 0.15, 0.064
    #: What a generic term counts beside an effect: one with three numbers lies 1 to 2 nats behind the effect in it.
    term = 0.05
    #: Probability below which a tolerance is too far out for its model to stay. Clean faults that a tolerance does the
    #: work of are at 7e-8 to 6e-3, right models at 0.04 and more. The one constant that decides.
    untenable = 0.01
    #: Probability from which a name is listed, alone or as a family; right names reach 0.976 and more.
    included = 0.95
    #: Probability of no fault at all from which none is sought.
    nothing = 0.05
    #: Names in a family of look-alikes: a longer list says nothing.
    family = 3
    #: Scale of the model's error up to which effects are listed, or none is needed: what the model is trusted to. With
    #: errors of 0.3 to 0.7 of what is stated, 92 % of 85 faults are listed so (9 % with a limit of 0.2, 61 % with 0.5).
    trusted = 1.0
    #: The same that a name takes, and from which a search ends: programs that solve the same equations reach 0.1. With
    #: `trusted` in its place 12 of 50 causes outside the library are explained by a wrong effect, with it 8.
    right = 0.2
    #: Gap above noise along what an effect moves, after over before, that its name takes; right ones reach 0 to 0.45.
    halved = 0.5
    #: Squared held-out gap above noise with tolerances free, after over before: effects explain the larger part.
    rest = 0.2
    #: Rise of the log evidence from which an effect's size drifts [nats]: odds of 150.
    drifting = 5.0
    #: Log evidence behind the leader at which explanations are no longer fitted [nats].
    near = 10.0
    #: Explanations that are fitted at the most: right ones come among the first ten.
    most_fits = 24

    # Priors and errors.
    #: Prior of an amplitude in the library's typical sizes: three of them are no surprise in a bearing that has the
    #: fault at all. Half and twice of it move every log evidence by 0.7 and no answer.
    width = 3.0
    #: The same of a direction that is refined beside its grid [rad]: about half a step of the grid.
    turn = math.pi / 8
    #: No tolerance goes beyond this, in stated deviations.
    reach = 30.0
    #: Scales of the model's error: the lowest, the step, how many. Programs that solve the same equations differ by 0.1
    #: of what is stated, a floor and no finding.
    scales = 0.1, 1.4, 17
    #: The scale to expect before any campaign is there: with models that solve the same equations 0.1 to 0.2.
    usual = 0.2
    #: Parts of the model error's variance: the same at all points, smooth over the range that was measured, each point
    #: by itself (a tenth of the standard deviation: programs that solve the same equations differ like that).
    parts = 0.5, 0.49, 0.01
    #: Share of the static load below which a pad hardly carries: its attitude, and so its temperature, is not unique.
    idle = 0.10
    #: Of a tolerance of which the data say less than this share of its variance nothing is asked.
    silent = 0.05

    # Search.
    #: Faults that lead by straight paths and of which the whole path is asked: right ones are among the first five.
    followed = 12
    #: Nats that a fit rises above its score at the most, and so may its rivals: derivatives from elsewhere miss that.
    mistaken = 25.0
    #: Nats by which a fit is better than another of the same explanation.
    better = 1.0
    #: Nats behind the leader within which a fit gets derivatives of its own.
    worth_derivatives = 15.0
    #: Chi-square by which derivatives may miss a step along the posterior: differences of one side miss as much.
    surprise = 1.0
    #: Scale of the likeliest single fault above which it is taken for wrong, and faults that begin with a coarse start.
    suspect, coarse = 0.4, 5
    #: Stated deviations of a tolerance while a coarse start passes the jumps of pads that empty.
    held = 0.2

    # Observations.
    #: Of the temperature of a pad that hardly carries [K].
    idle_temperature = 1.0
    #: By which a load misses its set point: share and angle [rad].
    missed = 0.003, 0.0035
    #: Frequencies at one load from which each is a block of its own; sectors of load directions that a locus is split
    #: into, and the one that is held out: the middle one.
    sweep, sectors, sector = 4, 5, 3
    #: Loads at which dry curves are compared, as shares of the range in which contact is complete.
    dry_shares = 0.15, 0.5, 0.95
    #: Error of a dry curve at each load by itself, as a share of its standard error: no law is quite the pivot's own.
    #: From 110 simulated curves: with less, pads that all were given the same wrong law raise false alarms.
    dry_shape = 0.7
    #: Standard error of a mean pad temperature [K]: sensors drift and self-heat far more than their noise.
    temperature = 0.05
    #: What runs in other directions would differ by where only two were excited, as a share of the direct coefficients.
    unseen = 0.005
    #: A small coefficient is read off the same axis as the large ones: its error is no smaller than that of a value of
    #: this share of the direct ones.
    axis = 0.1

    # What is said.
    #: Likeliest names that are said where none can be named; probability of an effect that is said beside *consistent*.
    likeliest, not_excluded = 5, 0.2
    #: Times that an interval by derivatives becomes at the most, where the likelihood's profile does not end before.
    stretched = 4.0
    #: Standard deviations from which a size would have been seen, a tolerance is beyond what is stated, two effects are
    #: told apart and a test tells: a chance of 1 in 370 each.
    visible = 3.0
    #: A smaller principal value below this share of the larger one makes a term one of one direction.
    one_way = 0.2
    #: What an amplitude could change over, with the number of levels it takes to tell.
    over = (("static_load", "load", 3), ("shaft_speed", "speed", 2), ("excitation", "excitation", 4))
    #: Relative change over the range below which an amplitude is the same for all practical ends.
    same = 0.1
    #: Size at which a plan asks what an effect would be mistaken for [standard deviations].
    seen = 6.0
    #: Separation from which one test is enough: with 5 the wrong explanation's chi-square exceeds the right one's by 9,
    #: from which it counts as wrong, in 95 of 100 cases.
    enough = 5.0
    #: Other explanations that a confirming test is chosen against.
    impostors = 2
