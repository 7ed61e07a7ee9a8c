"""Search: explanations are fitted in the order of what they promise, until none comes near the leader.

Scores of one more fault beside a fitted model, and of one less, propose the next explanations. The likeliest proposal
is fitted, and proposes further ones where it comes near the leader: the same step for the first fault and the third.
"""

import functools
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from tpjb_ident.diagnosis.comparison.evidence import Linear, posterior
from tpjb_ident.diagnosis.comparison.fit import Fit, Start, fitted, refined
from tpjb_ident.diagnosis.comparison.paths import Path, lay_paths, lengthened
from tpjb_ident.diagnosis.comparison.problem import Fault, Problem
from tpjb_ident.diagnosis.comparison.scores import Score, Strain, scores
from tpjb_ident.diagnosis.comparison.unknowns import Unknowns
from tpjb_ident.diagnosis.forward.workers import Map
from tpjb_ident.diagnosis.observations.constants import Deciding

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Comparison:
    """All explanations, with their probabilities: a search that was cut short is not sure of what it found."""

    probabilities: Mapping[Fit, float]  #: the most probable first; those that are not tenable last
    waiting: tuple[tuple[Set[str], float], ...]  #: names of what was not fitted: as it promises
    tenable: frozenset[Fit]  #: those that no tolerance, no bound and no size that is none speaks against
    paths: tuple[Path, ...] = field(repr=False)

    @property
    def fits(self) -> tuple[Fit, ...]:
        """The explanations, the most probable first."""
        return tuple(self.probabilities)

    @property
    def nothing(self) -> Fit:
        """The explanation without a fault."""
        return next(fit for fit in self.fits if not fit.faults)

    @property
    def best(self) -> Fit:
        """The most probable explanation."""
        return self.fits[0]

    @property
    def shares(self) -> dict[str, float]:
        """Inclusion probability of every name, on whichever pad or direction."""
        shares: dict[str, float] = {}
        for fit in self.fits:
            shares |= {name: self.holding(name) for name in fit.names - shares.keys()}
        return shares

    def holding(self, *names: str) -> float:
        """Probability that one or another of some names takes part."""
        fitted = [(fit.names, p) for fit, p in self.probabilities.items()]
        return sum(p for listed, p in (*fitted, *self.waiting) if not listed.isdisjoint(names))


def compare(run: Map, problem: Problem, progress: Progress | None = None) -> Comparison:
    """Compare explanations with no fault and with up to three; without any where the baseline is good enough."""
    return _Search(run, problem, progress or (lambda text, share: None)).result()


class _Search:
    """Fits and proposals of one campaign."""

    def __init__(self, run: Map, problem: Problem, report: Progress) -> None:
        self.run, self.problem, self.report = run, problem, report
        self.fits: dict[frozenset[str], Fit] = {}
        self.tried = 0
        self.estimates: dict[frozenset[str], float] = {}
        self.proposals: dict[frozenset[str], Start] = {}
        self.begun: dict[frozenset[str], float] = {}  #: estimates of coarse starts that were fitted
        self.paths: tuple[Path, ...] = ()
        self.moved: set[frozenset[str]] = set()  #: single faults beside which paths were asked
        self.whole = True  #: whether paths are known as far as jumps of K and C ask for
        self.clear = -math.inf  #: coarse estimate from which a start comes before all others [nats]
        faults = {(fault.name, fault.label) for fault in problem.faults}
        self.places = Counter(name for name, _ in faults)

    def result(self) -> Comparison:
        """Search, and weigh what was fitted."""
        self._fit(Start((), self._stated.theta, self._stated.jacobian))
        self.report("every effect of the library", 0.1)
        self._propose_singles()
        self._propose_neighbours(self.fits[frozenset()])  # from where its tolerances have gone
        while (proposal := self._next()) is not None:
            self.report(f"fits, {len(self.fits)}", min(0.9, 0.2 + 0.7 * len(self.fits) / Deciding.most_fits))
            self._fit(proposal)
        return self._weighed()

    def _next(self) -> Start | None:
        """The likeliest proposal; None where none comes near the leader."""
        if self.tried >= Deciding.most_fits:
            return None
        if not (self._passed or any(map(self._comes_first, self.proposals.values()))):
            self._ask_further_paths()
        if promising := self._waiting():
            return self.proposals.pop(max(promising, key=lambda p: (self._comes_first(p), p.estimate)).labels)
        return None

    def _waiting(self) -> list[Start]:
        """Proposals that may change the answer."""
        leader = self._leader()
        return [p for p in self.proposals.values() if leader is None or self._promising(p, leader)]

    @property
    def _passed(self) -> bool:
        """Whether a fit, tenable or not, has found its way past the jumps of K and C."""
        return any(fit.posterior.scale <= Deciding.suspect for fit in self.fits.values())

    def _comes_first(self, proposal: Start) -> bool:
        """Whether a start is coarse, and has no clearly better ones: once a fit is past the jumps these have been."""
        return proposal.coarse and (proposal.estimate >= self.clear or (self.whole and not self._passed))

    def _ask_further_paths(self) -> None:
        """Ask for paths beside one fault that leads; for every path to both of its ends, where no fit gets past jumps.

        From the baseline they say little of what a second fault does beside a large one.
        """
        best = self._best_of_all
        if best and len(best.faults) == 1 and best.labels not in self.moved:
            self.moved.add(best.labels)
            # tolerances have derivatives there
            sizes = [0.0 if path.fault.own >= 0 else float(path.fault.width[0]) for path in self.paths]
            place = best.faults, best.linear.theta
            self._propose_neighbours(best, lengthened(self.run, place, self.paths, sizes))
        if not self.whole:
            self.whole = True
            for end in (-1.0, 1.0):
                self._lengthen([end * float(path.fault.width[0]) for path in self.paths])
            self._propose_alone()

    def _promising(self, proposal: Start, leader: Fit) -> bool:
        """Whether a proposal may change the answer: as a rival of a leader, or by a fault beside a right one."""
        total, near, mistaken = self._log_probability(leader), Deciding.near, Deciding.mistaken
        if leader.posterior.scale > Deciding.right:
            return proposal.coarse or proposal.estimate > total - near - mistaken
        plain = leader.has_terms and not any(fault.is_term for fault in proposal.faults)
        if proposal.coarse:
            return plain
        spare = math.log(1.0 - Deciding.included)
        for fit in self.fits.values():  # the leader too: what cannot take a simpler one's certainty changes nothing
            is_simpler = fit.labels < proposal.labels and self._is_tenable(fit)
            if is_simpler and proposal.estimate < self._log_probability(fit) + spare:
                return False
        if leader.labels & proposal.labels and not plain:
            return proposal.estimate > total + spare
        rise = mistaken if plain else float(np.clip(total - self.estimates[leader.labels], 0.0, mistaken))
        if proposal.risen or (len(proposal.faults) != len(leader.faults) and not plain):
            rise = 0.0
        return proposal.estimate > total - near - rise

    def _renewed(self, fit: Fit) -> Fit:
        """A fit with derivatives of its own, where these do not make it worse."""
        again = refined(self.run, fit)
        return again if again.posterior.total > fit.posterior.total - Deciding.better else fit

    def _reached(self, start: Start) -> Fit | None:
        """Where a start leads; steps that fail on derivatives from elsewhere say nothing: what they promise counts."""
        fit, leader = fitted(self.run, self.problem, start), self._leader()
        if fit is None:
            return None
        if start.coarse:  # derivatives from before a jump led here, and say little of what lies behind it
            before, fit = fit, self._renewed(fit)
            if fit is before:  # refused once, they would be refused again
                return fit
        is_right = min(f.posterior.scale for f in (leader or fit, fit)) <= Deciding.right
        nats = Deciding.mistaken if start.coarse else Deciding.worth_derivatives if is_right else 0.0
        tenable_first = is_right and leader is None  # whether it is tenable tells none that has not arrived
        return self._renewed(fit) if tenable_first or self._near(fit, fit.posterior.promised, nats) else fit

    def _fit(self, proposal: Start) -> None:
        """Fit a proposal; one that should lead and stopped far from its promise once more with a coarse start."""
        fit = self._reached(proposal)
        self.tried += 1
        if proposal.coarse:
            self.begun[proposal.labels] = proposal.estimate
        if fit is None:
            return
        promised = max(fit.posterior.promised, proposal.estimate - self._log_prior(fit.faults))
        stopped = promised > fit.posterior.total + Deciding.mistaken and self._near(fit, promised, Deciding.near)
        if stopped and fit.faults and proposal.labels not in self.begun:  # its end lies astray
            self.begun[proposal.labels] = -math.inf
            coarse = self._reached(replace(proposal, coarse=True))
            if coarse is not None and coarse.posterior.total > fit.posterior.total:
                fit = coarse
        earlier = self.fits.get(proposal.labels)
        if earlier is not None and earlier.posterior.total >= fit.posterior.total:
            return
        self.fits[proposal.labels] = fit
        self.estimates[proposal.labels] = math.inf if proposal.coarse else proposal.estimate
        # one cause that does most of it is far behind until what stands beside it is there too
        if proposal.coarse or self._near(fit, fit.posterior.total, Deciding.near):
            self._propose_neighbours(fit)

    def _near(self, fit: Fit, total: float, nats: float) -> bool:
        """Whether a fit with some evidence comes near the leader, or near the best of all where none is tenable.

        The first of all, a baseline that is wrong, is far from what is to come.
        """
        best = self._leader() or self._best_of_all
        return best is not None and total + self._log_prior(fit.faults) > self._log_probability(best) - nats

    @property
    def _best_of_all(self) -> Fit | None:
        """The most probable fit so far, tenable or not."""
        return max(self.fits.values(), key=self._log_probability, default=None)

    def _leader(self) -> Fit | None:
        """The most probable tenable fit so far."""
        return max(filter(self._is_tenable, self.fits.values()), key=self._log_probability, default=None)

    def _is_tenable(self, fit: Fit) -> bool:
        """Whether nothing speaks against a fit; what makes K and C jump can be needed, and of any size."""
        if fit.p < Deciding.untenable or fit.on_bound:
            return False
        without = [self.fits.get(fit.labels - {label}) for label in fit.unsized]
        most = fit.posterior.total - Deciding.near
        return all(simpler is not None and simpler.posterior.total < most for simpler in without)

    def _log_probability(self, fit: Fit) -> float:
        return fit.posterior.total + self._log_prior(fit.faults)

    def _log_prior(self, faults: Sequence[Fault]) -> float:
        """Log prior of an explanation: by its number of faults, spread over names, then over a name's places."""
        sets = max(1, math.comb(len(self.places), len(faults)))
        spread = sets * math.prod(self.places[fault.name] for fault in faults) / Deciding.prior[len(faults)]
        return sum(fault.is_term for fault in faults) * math.log(Deciding.term) - math.log(spread)

    def _propose_singles(self) -> None:
        """Every fault by itself, from the baseline as stated; the paths of those that lead are asked for further on."""
        self.paths = lay_paths(self.run, self.problem)
        self._follow(self._singles())
        if self._propose_alone() > Deciding.suspect:  # a jump hides what lies behind it
            self.whole = False
            self._follow(self._singles(coarse=True))
            self._propose_alone()

    def _lengthen(self, sizes: Sequence[float]) -> None:
        self.paths = lengthened(self.run, ((), self._stated.theta), self.paths, sizes)

    def _follow(self, leading: Sequence[Score]) -> None:
        """Ask for more of the paths that lead, towards where they lead."""
        labels = list(dict.fromkeys(score.path.fault.label for score in leading))[: Deciding.followed]
        sizes = {id(score.path): float(score.amplitudes[0]) for score in leading if score.path.fault.label in labels}
        self._lengthen([sizes.get(id(path), 0.0) for path in self.paths])

    @functools.cached_property
    def _stated(self) -> Linear:
        problem, count = self.problem, len(self.problem.nuisances)
        residual = problem.measured - problem.scaled(problem.base)
        return Linear(residual, np.zeros(count), problem.scaled(problem.columns), np.ones(count))

    def _singles(self, coarse: bool = False) -> list[Score]:
        """Scores of every fault beside the baseline as stated; coarse: every element off by itself, tolerances held."""
        errors, linear = self.problem.errors, self._stated
        if coarse:
            errors, linear = errors.coarse, replace(linear, width=Deciding.held * linear.width)
        return scores(errors, linear, self.paths, self.fits[frozenset()].strain)

    def _propose_alone(self) -> float:
        """Propose every fault by itself, with coarse starts where the likeliest is surely wrong; its scale."""
        singles = self._singles()
        scale = singles[0].scale if singles else 0.0
        for score in singles:
            self._propose(score, (), self._stated)
        if scale > Deciding.suspect:
            # a path that was never followed shows no jump
            rough = [score for score in self._singles(coarse=True) if score.path.nodes is not None]
            for score in rough[: Deciding.coarse]:
                self._propose(score, (), self._stated, coarse=True)
            self.clear = max((score.total for score in rough), default=-math.inf) - Deciding.mistaken
        return scale

    def _propose_neighbours(self, fit: Fit, paths: Sequence[Path] = ()) -> None:
        """One fault more, by paths from where it is if these are known, one less, and another in one's place."""
        if len(fit.faults) < len(Deciding.prior) - 1:
            further = [self._beside(path, fit) for path in paths or self.paths if path.fault.label not in fit.labels]
            self._propose_scored(fit, further, fit.strain, (fit.faults, fit.linear))
        # what tolerances say: what looks alike lies past the same jumps of K and C, with tolerances where they are
        rivals = []
        for path in self.paths if fit.faults else ():
            if path.fault.label not in fit.labels and self.problem.said_by(path.fault):
                rivals.append(self._beside(path, fit))
        for fault in fit.faults:
            faults, linear = self._without(fit, fault)
            state = posterior(self.problem.errors, linear)
            estimate = state.promised - fit.posterior.refused + self._log_prior(faults)
            self._offer(Start(faults, state.mean, linear.jacobian, estimate=estimate))
            if rivals:
                rows = fit.strain.rows if fault.own >= 0 else np.delete(fit.strain.rows, fit.place_of(fault), axis=1)
                self._propose_scored(fit, rivals, replace(fit.strain, rows=rows), (faults, linear), risen=True)

    def _propose_scored(
        self,
        fit: Fit,
        paths: Sequence[Path],
        strain: Strain,
        model: tuple[tuple[Fault, ...], Linear],
        risen: bool = False,
    ) -> None:
        """Score one fault more beside a model that a fit led to; what that one promised and did not keep counts not."""
        for score in scores(self.problem.errors, model[1], paths, strain):
            self._propose(replace(score, total=score.total - fit.posterior.refused), *model, risen=risen)

    def _beside(self, path: Path, fit: Fit) -> Path:
        """A path beside a fit: what tolerances say has their derivatives there, which large faults change."""
        members = self.problem.said_by(path.fault)
        if not members:
            return path
        columns = fit.linear.jacobian[:, fit.unknowns.amplitudes :]
        return Path(path.fault, np.sum([share * columns[:, i] for i, share in members.items()], axis=0)[:, None])

    def _propose(
        self, score: Score, faults: tuple[Fault, ...], linear: Linear, coarse: bool = False, risen: bool = False
    ) -> None:
        """Add a fault to a model."""
        if np.any(score.amplitudes):
            self._offer(replace(self._with(score, faults, linear, coarse), risen=risen))

    def _with(self, score: Score, faults: tuple[Fault, ...], linear: Linear, coarse: bool = False) -> Start:
        """A model with one fault more."""
        fault = score.path.fault.turned()
        faults = (*faults, fault)
        estimate = score.total + self._log_prior(faults)
        if score.p < Deciding.untenable:  # it would have to be a step on the way
            estimate -= Deciding.near
        theta, jacobian = linear.theta, linear.jacobian
        if fault.own < 0:
            first = len(theta) - len(self.problem.nuisances)
            theta = np.insert(theta, [first] * len(fault.width), 0.0)
            jacobian = np.insert(jacobian, [first] * len(fault.width), 0.0, axis=1)
        start = Unknowns(self.problem, faults).slices[-1].start
        at = slice(start, start + len(score.amplitudes))
        jacobian = jacobian.copy()
        jacobian[:, at] = score.path.columns @ score.path.slopes(score.amplitudes[None, :])[0]
        wanted = theta.copy()
        wanted[at] = score.amplitudes  # counted from where nothing happens: what its tolerance had found is in it
        return Start(faults, wanted, jacobian, coarse, estimate)

    def _without(self, fit: Fit, fault: Fault) -> tuple[tuple[Fault, ...], Linear]:
        """A model without one of its faults, whose tolerance has its stated prior again, and is as stated."""
        faults = tuple(f for f in fit.faults if f is not fault)
        linear, at = fit.linear, fit.place_of(fault)
        theta, jacobian = linear.theta.copy(), linear.jacobian
        residual, theta[at] = linear.residual + jacobian[:, at] @ theta[at], 0.0
        if fault.own < 0:
            theta, jacobian = np.delete(theta, at), np.delete(jacobian, at, axis=1)
        return faults, Linear(residual, theta, jacobian, Unknowns(self.problem, faults).width)

    def _offer(self, proposal: Start) -> None:
        """Keep the likeliest start of every explanation that was not fitted yet, or less well than from there."""
        queued, fit = self.proposals.get(proposal.labels), self.fits.get(proposal.labels)
        if proposal.coarse:
            better = proposal.estimate > self.begun.get(proposal.labels, -math.inf)
        else:
            better = fit is None or proposal.estimate > self._log_probability(fit) + Deciding.better
        if queued is not None and queued.coarse and not proposal.coarse:  # a start that would lead is past the jumps
            best = self._leader() or (self._best_of_all if self._passed else None)
            better &= best is not None and proposal.estimate > self._log_probability(best)
        elif queued is not None:
            better &= (queued.coarse, queued.estimate) < (proposal.coarse, proposal.estimate)
        if better:
            self.proposals[proposal.labels] = proposal

    def _weighed(self) -> Comparison:
        """Probabilities among the tenable fits; among all where none is."""
        rows = list(self.fits.values())
        tenable = frozenset(fit for fit in rows if self._is_tenable(fit))
        logs = np.array([self._log_probability(fit) for fit in rows])
        counted = np.where([fit in tenable for fit in rows], logs, -np.inf) if tenable else logs
        waiting = [start for start in self._waiting() if not start.coarse]  # coarse evidence is another's unit
        total = logsumexp([*counted, *(start.estimate for start in waiting)])
        probabilities = np.exp(counted - total)
        order = np.lexsort((-logs, -probabilities))
        promised = []
        for start in waiting:
            promised.append(({fault.name for fault in start.faults}, math.exp(start.estimate - total)))
        return Comparison({rows[i]: float(probabilities[i]) for i in order}, tuple(promised), tenable, self.paths)
