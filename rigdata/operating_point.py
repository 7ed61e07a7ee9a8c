"""The operating point of a run: the key under which results are grouped."""

import math
from dataclasses import dataclass

#: Senses in which a shaft turns, with X to the right and Y up; the first is the default.
ROTATIONS = ("counter-clockwise", "clockwise")


@dataclass(frozen=True, order=True)
class OperatingPoint:
    """Set points of a test, SI, angles in radians.

    Attributes
    ----------
    static_load : float
        Per bearing [N].
    static_load_direction : float
        Direction in which the load pushes the shaft [rad, counter-clockwise from +X].
    shaft_speed : float
        [rad/s]; zero in dry tests.
    excitation : float
        Excitation frequency [rad/s]; zero where nothing is excited.
    rotation : {"counter-clockwise", "clockwise"}
        Which way the shaft turns.

    Examples
    --------
    >>> print(OperatingPoint(5000.0, shaft_speed=2 * np.pi * 22))
    5000 N at -90 deg, shaft 22 Hz
    """

    static_load: float
    static_load_direction: float = -math.pi / 2
    shaft_speed: float = 0.0
    excitation: float = 0.0
    rotation: str = ROTATIONS[0]

    def __repr__(self) -> str:
        return f"<OperatingPoint: {self}>"

    def __str__(self) -> str:
        parts = [f"{self.static_load:g} N at {self.static_load_direction_deg:g} deg"]
        parts.append(f"shaft {self.speed_words}" if self.shaft_speed else "shaft at rest")
        parts += [f"excited at {self.excitation_hz:g} Hz"] if self.excitation else []
        return ", ".join(parts)

    @property
    def speed_words(self) -> str:
        """Shaft speed with its sense, where that is not the usual one."""
        sense = f" {self.rotation}" if self.rotation != ROTATIONS[0] else ""
        return f"{self.shaft_speed_hz:g} Hz{sense}"

    @property
    def spin(self) -> float:
        """Shaft speed about +z [rad/s]: negative where the shaft turns clockwise."""
        return -self.shaft_speed if self.rotation == ROTATIONS[1] else self.shaft_speed

    @property
    def static_key(self) -> tuple[float, float, float, str]:
        """What tells static points apart: load [N], its direction [deg], shaft speed [Hz], sense of turning."""
        return self.static_load, self.static_load_direction_deg, self.shaft_speed_hz, self.rotation

    @property
    def key(self) -> tuple[float, float, float, float, str]:
        """What tells operating points apart: load [N], direction [deg], speed and excitation [Hz], sense of turning."""
        return *self.static_key[:3], self.excitation_hz, self.rotation

    @property
    def shaft_speed_hz(self) -> float:
        """Shaft speed in Hz, free of the rounding noise of 2 pi."""
        return round(self.shaft_speed / (2 * math.pi), 9)

    @property
    def excitation_hz(self) -> float:
        """Excitation frequency in Hz."""
        return round(self.excitation / (2 * math.pi), 9)

    @property
    def static_load_direction_deg(self) -> float:
        """Load direction in degrees."""
        return round(math.degrees(self.static_load_direction), 9)
