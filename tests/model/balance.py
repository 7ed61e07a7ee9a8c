"""Mass in the control volumes of a film, in plain numpy: what kernels make of a motion is held against it."""

import numpy as np

from model.film.mesh import FilmGrid, FilmWork
from tests.fillings import fluid_fraction


class Balance:
    """Half a film of one viscosity about what the kernel found, `start`; zones, full and ruptured, stay as they are.

    Unknown is the pressure where the film is full, the filling where it is not. A `compliance` [m/Pa] makes the pad
    give way to the pressure.
    """

    def __init__(
        self,
        film: tuple[FilmGrid, FilmWork],
        wedge: tuple[float, float, float],
        speed: float,
        filling: float = 1.0,
        compliance: np.ndarray | None = None,
    ) -> None:
        self.grid, work = film
        self.clearance, self.wedge = wedge[0], np.array(wedge[1:])
        self.speed, self.filling, self.compliance, self.still = speed, filling, compliance, work.extra.copy()
        self.viscosity, self.density = float(work.viscosity[1, 1]), float(work.density[1, 1])
        self.dry, self.lacking = work.ruptured[1:-1, :-1].copy(), work.ruptured[0].copy()
        theta = fluid_fraction(*film, wedge, speed, filling)
        self.start = np.where(self.dry, theta[1:-1, :-1], work.pressure[1:-1, :-1]).ravel()

    def __call__(self, unknown: np.ndarray, wedge: np.ndarray) -> np.ndarray:
        """Outflow less inflow [kg/s], and what the volumes hold [kg]; (2, n)."""
        grid, unknown = self.grid, unknown.reshape(self.dry.shape)
        p, theta = np.zeros((2, *grid.area.shape), np.result_type(unknown, wedge))
        p[1:-1, :-1], theta[1:-1, :-1] = np.where(self.dry, 0.0, unknown), np.where(self.dry, unknown, 1.0)
        give = self.still if self.compliance is None else (self.compliance @ p.ravel()).reshape(p.shape)
        even, ahead = (
            (self.clearance - wedge[0] * np.cos(at) - wedge[1] * np.sin(at))[:, None]
            for at in (grid.angle, 0.5 * (grid.angle[1:] + grid.angle[:-1]))
        )
        face, beside = ahead + 0.5 * (give[1:] + give[:-1]), even + 0.5 * (give[:, 1:] + give[:, :-1])
        carried = 0.5 * self.speed * face * np.vstack([np.ones_like(theta[:1]), theta[1:-1]])
        pushed = face**3 / (12 * self.viscosity) * np.diff(p, axis=0) / grid.dx
        fed = 0.5 * self.speed * self.filling * (even + give)[0]
        carried[0] = np.where(self.lacking, fed + pushed[0], carried[0])
        across = -grid.dx * beside**3 / (12 * self.viscosity) * np.diff(p, axis=1) / grid.dz
        out = np.diff(grid.height * (carried - pushed), axis=0)[:, :-1] + across[1:-1]
        out[:, 1:] -= across[1:-1, :-1]
        held = (np.where(self.dry, face[1:, :-1], (even + give)[1:-1, :-1])) * theta[1:-1, :-1]
        held[0] += np.where(self.lacking[:-1], 0.5 * self.filling * (even + give)[0, :-1], 0.0)
        return self.density * np.stack([out.ravel(), (grid.dx * grid.height[:-1] * held).ravel()])

    def impedance(self, omega: float) -> np.ndarray:
        """Force over a small vibration of (a, b) [N/m], (2, 2); derivatives by complex steps."""
        tiny, wedge = 1e-20j, self.wedge
        by_state = np.stack([self(self.start + tiny * e, wedge).imag for e in np.eye(self.start.size)], axis=2)
        by_wedge = np.stack([self(self.start, wedge + tiny * e).imag for e in np.eye(2)], axis=2)
        moved = -np.linalg.solve(*(out + 1j * omega * held for out, held in (by_state, by_wedge)))
        pressed = self.grid.area[1:-1, :-1] * ~self.dry
        return np.stack([(pressed * turn[1:-1, None]).ravel() @ moved for turn in (self.grid.cos, self.grid.sin)])
