"""What the size of a band's motion does to the film where no line of its own tells: the same in every repeat.

Over a band there are no harmonics apart from the excitation, so a width is stated. Of a film that is not linear all
lines together change H by about 20 (rms / c)^2, c the clearance, two tones by 10; hammer blows in one sense by
1.5 peak / c, in both senses by their square. A multi-sine of three tones or more, of one phase set, puts besides a
distortion on every line that repeats with it, about 3 rms / c of it; runs of several phase sets differ by it, and are
judged. Held against loaded films integrated in time at 1 to 6 % of the clearance (two tones: at 5 to 15 %, eccentricity
up to 0.6, they change H by 0.13 to 0.62 times as much as a random band of one direction does).
"""

import numpy as np

from rigdata.arrays import ComplexArray
from tpjb_ident.estimate.arrowhead import NUMBERS
from tpjb_ident.estimate.equation import Blocks, Rig, State, entry_changes, entry_sizes, film_force_rows
from tpjb_ident.estimate.noise import scatter_patterns
from tpjb_ident.estimate.term import CHANGE_AS_DEVIATION, FilmTerm, numbered, worth_stating

#: Change of H over the squared motion of a band and of two tones, over a blow's peak in one sense, in both its square.
_BAND, _PAIR, _BLOW, _BLOWS = 20.0, 10.0, 1.5, 5.0
#: Scatter of a line over the motion of a multi-sine of one phase set.
_LINE = 3.0


def band_change(kind: str, rms: float, peak: float, one_sided: float) -> float:
    """Share by which a band's motion may change H; `rms`, `peak` over the clearance, `one_sided` 0 to 1."""
    share = (_PAIR if kind == "pair" else _BAND) * rms**2
    if kind == "impact":
        share = _BLOW * peak * one_sided + _BLOWS * peak**2
    return worth_stating(share)


def line_scatter(rms: float) -> float:
    """Relative scatter of a line's film force in a multi-sine of one phase set; `rms` over the clearance."""
    return _LINE * rms if worth_stating(_BAND * rms**2) else 0.0


class Distortion(FilmTerm):
    """Real and imaginary parts of H of every band, each changed by its own share, which no run tells; lines scatter."""

    name = "distortion"
    never_estimated = True

    def prepare(self, rig: Rig, blocks: Blocks) -> None:
        """Parameters and what goes with them."""
        bands, first = np.unique(np.where(blocks.bent > 0, blocks.band, -1), return_index=True)
        self.group = np.full(len(blocks.points), -1)
        for k, b in enumerate(bands[bands >= 0]):
            self.group[blocks.band == b] = k
            share = float(blocks.bent[first[bands == b][0]])
            self.parameters += numbered(f"band {b + 1}", "1", [CHANGE_AS_DEVIATION * share] * NUMBERS)

    def changes(self, blocks: Blocks, state: State) -> ComplexArray:
        """A share of every entry of H."""
        return entry_changes(entry_sizes(state.h[blocks.point]))

    def random_effects(self, blocks: Blocks, state: State) -> ComplexArray | None:
        """The film's force at every line of one phase set, along X and Y: cells and housing answer to it alike."""
        if not blocks.uneven.any():
            return None
        patterns = np.stack(scatter_patterns(blocks, state, blocks.uneven), axis=2)
        return film_force_rows(self.rig, blocks, state, patterns)
