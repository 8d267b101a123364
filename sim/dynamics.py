"""A fixed wing as a point mass: turns, lags and limits, moved by the wind.

One encounter of a campaign takes more than a thousand steps of 0.1 s, so `FixedWing` is compiled
(`sim/compiled/airframe_step.py`). The compiled module imports `Airframe`, so that class has its own file.
"""

from sim.airframe import AIRFRAMES, ARDUPLANE, PX4, Airframe, heading_for_course_rad
from sim.compiled.airframe_step import FixedWing

__all__ = ["AIRFRAMES", "ARDUPLANE", "PX4", "Airframe", "FixedWing", "heading_for_course_rad"]
