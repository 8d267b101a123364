"""A fixed wing as a point mass: coordinated turns, lags and limits, carried by the wind.

It is flown on in steps of a tenth of a second, a thousand times and more in an encounter of a campaign, so
that `FixedWing` is compiled (`sim/compiled/airframe_step.py`).
"""

from sim.airframe import Airframe, heading_for_course_rad
from sim.compiled.airframe_step import FixedWing

__all__ = ["Airframe", "FixedWing", "heading_for_course_rad"]
