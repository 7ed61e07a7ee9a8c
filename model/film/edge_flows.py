"""What passes the edges of a solved film."""

from __future__ import annotations

from model.compilation import compiled
from model.film.mesh import FilmGrid, FilmWork


@compiled
def edge_flows(grid: FilmGrid, work: FilmWork, supplied: float) -> tuple[float, float]:
    """What enters at the leading edge, no more than is supplied there [kg/s/m], and what leaves over both sides [kg/s].

    The difference leaves at the trailing edge, in streaks where the film is ruptured: by balance, because the rupture
    line of a mesh moves by whole nodes and what is found behind it jumps.
    """
    rows, last = work.flow_x.shape[0], work.flow_z.shape[1]
    entering, corners, leaving_corners, inside, leaving = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(last + 1):
        flow = min(work.flow_x[0, j], supplied * grid.height[j])
        entering += flow
        if j == last or j < grid.first:
            corners += flow
            leaving_corners += work.flow_x[rows - 1, j]
        else:
            inside += flow
            leaving += work.flow_x[rows - 1, j]
    over = 0.0
    for i in range(rows + 1):
        over += work.flow_z[i, last - 1]
        if grid.first == 1:
            over -= work.flow_z[i, 0]
    # the half cells at the edges have no pressure: they run as full at the trailing edge as the lines beside them
    filled = min(1.0, max(0.0, (inside - over) / leaving)) if leaving > 0.0 else 1.0
    # the mesh holds one half of a symmetric film
    both = 2.0 if grid.first == 0 else 1.0
    return both * entering, both * (over + corners - filled * leaving_corners)
