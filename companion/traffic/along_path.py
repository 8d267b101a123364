"""Motion along the path: nearly constant velocity."""

from companion.model import Vec2
from companion.traffic.covariance import Covariance, Moments


class AlongPath(Covariance):
    """Position [m] and velocity [m/s] along the path, relative to one that the owner carries along.

    A step is `predict`, the updates, and `end`.
    """

    __slots__ = ("_moved_m", "_moved_mps")

    def __init__(self, moments: Moments) -> None:
        self.pp, self.pv, self.vv = moments
        self._moved_m = self._moved_mps = 0.0

    def measure_position(self, measured_m: float, sigma_m: float) -> float:
        """Process a position; returns the variance of its innovation."""
        off_m, variance_m2 = measured_m - self._moved_m, self.pp + sigma_m * sigma_m
        k_p, k_v = self.update_position(sigma_m)
        self._moved_m += k_p * off_m
        self._moved_mps += k_v * off_m
        return variance_m2

    def measure_velocity(self, measured_mps: float, sigma_mps: float) -> float:
        """The same for a velocity."""
        off_mps, variance = measured_mps - self._moved_mps, self.vv + sigma_mps * sigma_mps
        k_p, k_v = self.update_velocity(sigma_mps)
        self._moved_m += k_p * off_mps
        self._moved_mps += k_v * off_mps
        return variance

    def end(self) -> Vec2:
        """The corrections of position and velocity, from which the next step starts."""
        moved = self._moved_m, self._moved_mps
        self._moved_m = self._moved_mps = 0.0
        return moved
