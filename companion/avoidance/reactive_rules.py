"""The paper's two reactive rules for an emergency: where to turn (eq. 10-11), how fast to fly (eq. 12-13).

Both consider a single threat. In the strategy table they are rows, flown ahead and priced like all others.
"""

import math

from companion.avoidance.envelope import Pace
from companion.avoidance.geometry import Array
from companion.units import wrap_pi, wrap_two_pi

# Angles closer than this to the edge of a case count as on it, so that rounding does not decide the side.
_EDGE_RAD = 1e-6
_STILL_MPS = 0.1


def heading_rule_rad(
    course_rad: float, rel_position_m: Array, other_velocity_mps: Array, own_velocity_mps: Array
) -> float:
    """Eq. 11, figure 4: the course to turn to, in [0, 2 pi).

    alpha is the angle from our course to the threat's track, b the bearing of the threat from our course, phi
    the turn; all are positive to the left. With the threat on the right (b < 0) phi = alpha - pi/2
    sgn(alpha), across its track. On the left phi = alpha + pi/4 sgn(alpha). A stationary threat has a track
    only relative to us. `rel_position_m` is threat minus own, (2+,); velocities are over ground, (2+,).
    """
    still = math.hypot(other_velocity_mps[0], other_velocity_mps[1]) < _STILL_MPS
    track = -own_velocity_mps if still else other_velocity_mps
    alpha = _to_left_rad(course_rad, track)
    side = 1.0 if alpha > -_EDGE_RAD else -1.0
    b = _to_left_rad(course_rad, rel_position_m)
    phi = alpha - side * math.pi / 2.0 if b < -_EDGE_RAD else alpha + side * math.pi / 4.0
    return wrap_two_pi(course_rad - phi)


def _to_left_rad(course_rad: float, vector: Array) -> float:
    """The angle from a course to a vector, positive to the left; exactly behind counts as left."""
    angle_rad = wrap_pi(course_rad - math.atan2(vector[1], vector[0]))
    return math.pi if angle_rad < -math.pi + _EDGE_RAD else angle_rad


def speed_rule(rel_position_m: Array, other_velocity_mps: Array, own_velocity_mps: Array) -> Pace:
    """Eq. 13, figure 5: V_min if the threat is first where the two straight tracks cross, V_max if we are.

    The printed cases contradict the sentence before them; this follows the sentence. Without a crossing ahead
    of both aircraft the speed is kept. Arrays as in `heading_rule_rad`.
    """
    own, other = own_velocity_mps, other_velocity_mps
    cross = own[0] * other[1] - own[1] * other[0]
    if abs(cross) < 1e-6 * max(math.hypot(*own[:2]) * math.hypot(*other[:2]), _STILL_MPS**2):
        return Pace.KEEP
    own_s = (rel_position_m[0] * other[1] - rel_position_m[1] * other[0]) / cross
    other_s = (rel_position_m[0] * own[1] - rel_position_m[1] * own[0]) / cross
    if own_s < 0.0 or other_s < 0.0:
        return Pace.KEEP
    # On an exact collision course neither is first: the slower aircraft can still turn behind the other.
    return Pace.SLOWEST if other_s <= own_s + 1e-6 else Pace.FASTEST
