"""One hypothesis of one aircraft, vehicle or obstacle: reports that fit together, as a motion."""

import math
from typing import Final, NamedTuple

from companion.geodesy import LocalFrame
from companion.model import TrafficKind, TrafficSource, Vec2
from companion.traffic.altitudes import ReportedAltitude, SeaLevelAltitude, TargetAltitudes
from companion.traffic.evidence import KindEvidence, Surroundings
from companion.traffic.measurement import (
    NOISE_SHARE,
    RANK,
    DropReason,
    Measurement,
    StatedRate,
    position_sigma_m,
    velocity_sigma_mps,
)
from companion.traffic.motion_models import Moments, grown_sigmas
from companion.traffic.params import TrafficParams
from companion.traffic.track_filter import HorizontalFilter, HorizontalFix

# Errors of stated velocities below this are of no importance.
_SPEED_ERROR_MPS: Final = 6.0
# A track is coasted after a silence of so many of its usual intervals, and of this time.
_SILENT_INTERVALS, _SILENT_S = 3.0, 5.0
# Reports that arrive within this time are one scan: they may have waited somewhere, and agree by chance.
_SCAN_S: Final = 0.15
# The usual interval is averaged over so many reports.
_AVERAGED_INTERVALS: Final = 4.0
# M of N initiation (Blackman and Popoli 1999, 6.2): confirmed by 2 consistent reports of the last 3 scans.
CONFIRMED_REPORTS: Final = 2
# A hypothesis of one report is confirmed by a second one this near to its prediction, more by a turn.
_TENTATIVE_M, _TENTATIVE_MPS2 = 90.0, 5.0
# An age that is cut off to whole steps is too small by 0 to 1 step, evenly: the mean square of that error is
# a third of a step's square (Widrow and Kollar, Quantization Noise, 2008, 3.5: q^2 / 12, and the square of
# the mean q / 2). Along the path only, so that the mean of both axes has half of it.
_CUT_OFF: Final = 1.0 / 6.0
# Gates by which the nearest neighbour is measured [m].
_GATE_M, _VERTICAL_GATE_M = 60.0, 40.0


class Motion(NamedTuple):
    """Estimated motion, from which the present position follows: velocities in m/s, times in s.

    `turn_radps` is positive to the right; `sigma_m` is the accuracy of the position. There is one altitude
    for each reference that the target reports.
    """

    lat_deg: float
    lon_deg: float
    position_s: float
    north_mps: float
    east_mps: float
    turn_radps: float
    sigma_m: float
    altitudes: tuple[ReportedAltitude, ...]


def stale_after_s(kind: TrafficKind, params: TrafficParams) -> float:
    """Time without a new measurement after which a track of this kind is dropped [s]."""
    return params.obstacle_stale_s if kind is TrafficKind.OBSTACLE else params.stale_s


class Target:
    """A hypothesis of the aircraft with one key, or of one without identifier.

    Its times are those of the tracker's monotonic clock. `reach_s` is how soon it could be near us. It is
    `shown` to the avoidance if it is the first of its key, confirmed, near soon, or if a receiver alarms.
    """

    __slots__ = (
        "_altitudes",
        "_frame",
        "_horizontal",
        "_moments",
        "_params",
        "_velocity",
        "alarm",
        "anonymous",
        "born_s",
        "callsign",
        "evidence",
        "expires_s",
        "first",
        "heard_before",
        "icao",
        "interval_s",
        "key",
        "kind",
        "last",
        "measured_s",
        "motion",
        "number",
        "reach_s",
        "reports",
        "scans",
        "seen_far",
        "sigma_m",
        "source",
        "threat",
        "track_id",
        "urgent",
    )

    def __init__(
        self,
        measurement: Measurement,
        key: str,
        number: int,
        params: TrafficParams,
        *,
        anonymous: bool = False,
    ) -> None:
        report = measurement.report
        self.key, self.number = key, number
        self.track_id = key if number == 1 else f"{key}/{number}"
        self.anonymous = anonymous
        self.icao = None if anonymous else report.icao
        self.source: TrafficSource = report.source
        self.callsign: str | None = None
        self.evidence = KindEvidence(report.kind)
        self.kind = report.kind
        self.born_s = measurement.time_s
        self.measured_s = -math.inf
        self.expires_s = math.inf
        self.interval_s = 1.0
        self.reports = 0
        self.scans = 0  # reports at different times; those of a burst are one
        self.first = False
        self.heard_before = False  # its key was, by a target that made room
        self.seen_far = False  # too far from us for an echo: only when it comes near it may become one
        self.urgent = measurement.urgent
        self.alarm = 0
        self.threat = False  # in conflict with us, as decided last
        self.reach_s = math.inf
        self.sigma_m = position_sigma_m(report)
        self._moments: Moments = (self.sigma_m**2, 0.0, velocity_sigma_mps(report) ** 2)
        self.motion: Motion | None = None
        self.last = measurement
        self._params = params
        self._frame = LocalFrame(measurement.lat_deg, measurement.lon_deg)
        self._horizontal: HorizontalFilter | None = None
        self._restart_rates()
        self._altitudes = TargetAltitudes(params)

    def _restart_rates(self) -> None:
        self._velocity = StatedRate(NOISE_SHARE * self._params.estimate.position_sigma_m, _SPEED_ERROR_MPS, 2)

    @property
    def shown(self) -> bool:
        """Whether the avoidance gets its track."""
        return self.first or self.urgent or self.is_confirmed or self.alarm > 0

    @property
    def is_confirmed(self) -> bool:
        """Whether several reports agree."""
        return self.scans >= CONFIRMED_REPORTS

    @property
    def rank(self) -> int:
        """The order of sources; an aircraft without identifier is after one with it."""
        return 2 * RANK[self.source] + self.anonymous

    def is_silent(
        self, now_s: float, intervals: float = _SILENT_INTERVALS, least_s: float = _SILENT_S
    ) -> bool:
        """Whether it was not reported for several of its usual intervals."""
        return now_s - self.measured_s > max(least_s, intervals * self.interval_s)

    @property
    def velocity_sigma_mps(self) -> float:
        """The standard deviation of each horizontal axis of the estimated velocity [m/s]."""
        return math.sqrt(self._moments[2])

    def position_sigma_m(self, now_s: float) -> float:
        """The standard deviation of each horizontal axis of the extrapolated position [m]."""
        age_s = max(now_s - self.measured_s, 0.0)
        return grown_sigmas(self._moments, age_s, self._params.estimate.manoeuvre_mps)[0]

    # --- gates

    def explains_place(self, measurement: Measurement) -> bool:
        """Whether the aircraft can be at this place by then."""
        here = self._horizontal
        if here is None or self.kind is TrafficKind.OBSTACLE:
            return True
        if not here.is_elsewhere(measurement.fix):
            return self.shown or self._is_near_prediction(measurement)
        # A wrong stated velocity has led the prediction astray.
        return self._velocity.continues(measurement.time_s, (measurement.lat_deg, measurement.lon_deg))

    def _is_near_prediction(self, measurement: Measurement) -> bool:
        """The gate before the second report: two outliers far apart in time must not confirm each other."""
        if self.last.velocity_mps is None:
            return True
        elapsed_s = measurement.time_s - self.measured_s
        speed_mps = math.hypot(*self.velocity_mps)
        gate_m = _TENTATIVE_M + speed_mps + 0.5 * _TENTATIVE_MPS2 * elapsed_s**2
        return math.hypot(*self.offset_m(measurement)) <= gate_m

    def explains_altitude(self, measurement: Measurement) -> bool:
        """Whether one of its altitudes fits, or there is none to compare with."""
        return self.kind is TrafficKind.OBSTACLE or self._altitudes.explain(measurement)

    def explains(self, measurement: Measurement) -> bool:
        """The gate in three dimensions: whether place and altitude are those of this aircraft."""
        return self.explains_place(measurement) and self.explains_altitude(measurement)

    def explains_velocity(self, measurement: Measurement) -> bool:
        """Whether the stated velocity fits, if there is one to trust."""
        here, stated = self._horizontal, measurement.velocity_mps
        if here is None or stated is None or not self._velocity.trusted:
            return True
        return not here.is_outlier(measurement.fix)

    def distance(self, measurement: Measurement) -> float:
        """How far a measurement is from the prediction, in gates: for the nearest neighbour."""
        north_m, east_m = self.offset_m(measurement)
        up_m = self._altitudes.offset_m(measurement)
        return math.hypot(north_m / _GATE_M, east_m / _GATE_M, up_m / _VERTICAL_GATE_M)

    def offset_m(self, measurement: Measurement) -> Vec2:
        """A measured place relative to the predicted one: north, east."""
        here = self._horizontal
        if here is None:
            return 0.0, 0.0
        elapsed_s = measurement.time_s - here.time_s
        frame = LocalFrame(here.lat_deg, here.lon_deg)
        north_m, east_m = frame.to_north_east_m(measurement.lat_deg, measurement.lon_deg)
        return north_m - here.north_mps * elapsed_s, east_m - here.east_mps * elapsed_s

    def count_as_older(self, late_s: float) -> None:
        """Count the estimated place as older: all reports until now were late without saying so."""
        if self._horizontal is not None:
            self._horizontal.time_s -= late_s
            self.measured_s -= late_s

    def flown_on(self, measurement: Measurement) -> Measurement:
        """A measurement from before the estimate as one at its time, along the estimated path.

        Measurements out of sequence: Bar-Shalom, Willett and Tian, "Tracking and Data Fusion" (2011), 7.
        Theirs is the exact solution; this one neglects how the path and the measurement correlate.
        """
        here = self._horizontal
        if here is None:
            return measurement
        fix, late_s = here.flown_on(measurement.fix), here.time_s - measurement.time_s
        return measurement._replace(
            time_s=here.time_s,
            lat_deg=fix.lat_deg,
            lon_deg=fix.lon_deg,
            velocity_mps=fix.velocity_mps,
            altitudes=self._altitudes.flown_on(measurement, late_s),
            fix=fix,
            late_s=late_s,
        )

    @property
    def velocity_mps(self) -> Vec2:
        """The estimated velocity: north, east."""
        here = self._horizontal
        return (0.0, 0.0) if here is None else (here.north_mps, here.east_mps)

    # --- update

    def receive(self, measurement: Measurement) -> list[DropReason]:
        """Process a measurement that the gate let through; returns which parts of it were not used."""
        report, time_s = measurement.report, measurement.time_s
        self._note(measurement)
        dropped: list[DropReason] = []
        before = self.evidence.stated
        if (before is TrafficKind.OBSTACLE) is not (
            report.kind is TrafficKind.OBSTACLE
        ) and not self.evidence.moves:
            # An obstacle became an aircraft or the reverse: the estimates do not apply to it. Its places do:
            # what moves flies, whichever of both it says by turns.
            self._horizontal = None
            self._restart_rates()
            self._altitudes = TargetAltitudes(self._params)
        self.evidence.stated, self.evidence.stated_airborne = report.kind, report.airborne
        self._receive_place(measurement, dropped)
        self._altitudes.receive(measurement, dropped, stands=self.kind is TrafficKind.OBSTACLE)
        self.measured_s = max(time_s, self.measured_s)
        self.motion = self._motion()
        stated_mps = None if measurement.velocity_mps is None else math.hypot(*measurement.velocity_mps)
        self.evidence.observe(
            measurement.received_s,
            (measurement.lat_deg, measurement.lon_deg),
            stated_mps,
            math.hypot(*self.velocity_mps),
        )
        return dropped

    def restart(self, measurements: list[Measurement]) -> None:
        """Start again from these, without their stated velocities: their positions contradict them."""
        self._restart_rates()
        self._velocity.trusted = False
        self._horizontal = None
        for one in measurements:
            self._update_place(one.fix._replace(velocity_mps=None))
        newest = measurements[-1]
        self._note(newest)
        self._altitudes.receive(newest, [], stands=False)
        self.measured_s = newest.time_s
        self.motion = self._motion()

    def _note(self, measurement: Measurement) -> None:
        """What the report says of itself and of its accuracy."""
        report = measurement.report
        self.scans += not self.reports or measurement.received_s - self.last.received_s >= _SCAN_S
        self.reports += 1
        if self.reports > 1:
            passed_s = min(max(measurement.time_s - self.measured_s, 0.0), 30.0)
            share = max(1.0 / _AVERAGED_INTERVALS, 1.0 / (self.reports - 1))
            self.interval_s += share * (passed_s - self.interval_s)
        self.last = measurement
        self.callsign = report.callsign or self.callsign
        self.alarm = report.alarm
        if RANK[report.source] < RANK[self.source]:
            self.source = report.source
        self.sigma_m = position_sigma_m(report)

    def _receive_place(self, measurement: Measurement, dropped: list[DropReason]) -> None:
        time_s, lat_deg, lon_deg = measurement.time_s, measurement.lat_deg, measurement.lon_deg
        velocity_mps, here = measurement.velocity_mps, self._horizontal
        if velocity_mps is not None:
            trusted = self._velocity.trusted
            position_m = complex(*self._frame.to_north_east_m(lat_deg, lon_deg))
            stated = complex(*velocity_mps)
            used = self._velocity.receive(time_s, position_m, stated, (lat_deg, lon_deg))
            if not used:
                dropped.append(DropReason.VELOCITY_WRONG)
                velocity_mps = None
                if trusted:
                    self._horizontal = None
                    now = measurement.fix._replace(velocity_mps=None)
                    for place_s, *place_deg in self._velocity.places:
                        lat_deg, lon_deg = place_deg
                        self._update_place(now._replace(time_s=place_s, lat_deg=lat_deg, lon_deg=lon_deg))
                    return
            elif here is not None and here.is_outlier(measurement.fix):
                dropped.append(DropReason.VELOCITY_WRONG)
                velocity_mps = None
        fix = measurement.fix
        self._update_place(fix if velocity_mps is not None else fix._replace(velocity_mps=None))

    def _update_place(self, fix: HorizontalFix) -> None:
        if self._horizontal is None:
            self._horizontal = HorizontalFilter(fix, self._params.estimate)
        else:
            self._horizontal.update(fix)

    def _motion(self) -> Motion:
        here = self._horizontal
        assert here is not None
        # Stated accuracies include errors that reports have in common, which no filter sees.
        pp, pv, vv = here.moments
        speed2 = here.north_mps * here.north_mps + here.east_mps * here.east_mps
        late_m2 = _CUT_OFF * self.last.report.age_step_s**2 * speed2
        self._moments = max(pp, self.sigma_m * self.sigma_m) + late_m2, pv, vv
        return Motion(
            here.lat_deg,
            here.lon_deg,
            here.time_s,
            here.north_mps,
            here.east_mps,
            here.turn_radps,
            self.sigma_m,
            self._altitudes.estimates(),
        )

    def judge_kind(self, now_s: float, altitude: SeaLevelAltitude | None, around: Surroundings) -> None:
        """Decide what it is, from all that was reported; an obstacle stands where it was reported last."""
        self.kind = self.evidence.judge(now_s, altitude, around)
        self.expires_s = self.measured_s + stale_after_s(self.kind, self._params)
        if self.kind is TrafficKind.OBSTACLE and self.motion is not None:
            still = [one._replace(climb_mps=0.0, valid_until_s=math.inf) for one in self.motion.altitudes]
            newest = self.last
            self.motion = Motion(
                newest.lat_deg, newest.lon_deg, self.measured_s, 0.0, 0.0, 0.0, self.sigma_m, tuple(still)
            )
