"""Surveillance presets by name, with the figures that they stand for, and presets with changed fields.

A sigma is that of one axis. A horizontal accuracy that 95 % of the positions keep is 2.45 sigma, a vertical
one 1.96 sigma (RTCA DO-260B: NACp 9 is 30 m, 8 is 93 m, 7 is 185 m; NACv 2 is 3 m/s, 1 is 10 m/s). In all
presets the altitude is a pressure altitude. "Assumed": there is no public figure.
"""

from dataclasses import fields, replace

from companion.errors import ConfigError
from sim.encounters.surveillance import Surveillance

SURVEILLANCE_PRESETS: dict[str, Surveillance] = {
    # One second old, as in the comparison of the peers, without errors.
    "perfect": Surveillance(latency_s=1.0),
    # ADS-B of NACp 8 (15 m: 95 % within 37 m) and NACv 1 (1.5 m/s: 95 % within 3.7 m/s, nearly NACv 2), as
    # in the noisy comparison of the peers. Heights in steps of 25 ft. A latency of one second is usual, and
    # receivers do not report it. 5 % are lost (assumed).
    "adsb-out": Surveillance(
        latency_s=1.0,
        age_reported=False,
        position_sigma_m=15.0,
        height_sigma_m=8.0,
        velocity_sigma_mps=1.5,
        climb_sigma_mps=0.8,
        height_bias_sigma_m=7.0,
        loss=0.05,
        burst_reports=2.0,
        first_heard_m=10_000.0,
    ),
    # ADS-B of NACp 7 (50 m: 95 % within 122 m) and NACv 1 (4 m/s: 95 % within 9.8 m/s), two seconds old, an
    # altimeter at its tolerance, 30 % lost in bursts and a short range (both assumed).
    "poor": Surveillance(
        latency_s=2.0,
        age_reported=False,
        position_sigma_m=50.0,
        height_sigma_m=15.0,
        velocity_sigma_mps=4.0,
        climb_sigma_mps=2.0,
        height_bias_sigma_m=20.0,
        loss=0.3,
        burst_reports=4.0,
        first_heard_m=4_000.0,
    ),
    # A burst a second, heights from a pressure sensor (PowerFLARM manual); "a range of 5 km is required (and
    # sufficient)" (FTD-078, 6.6). PFLAA has no accuracy; speeds in m/s, courses in degrees, climbs in 0.1 m/s
    # (FTD-012). Assumed: the errors of GPS in the open (NACp 10), a second of latency, 10 % lost ("graceful
    # degradation" with many aircraft, PowerFLARM manual).
    "flarm": Surveillance(
        latency_s=1.0,
        age_reported=False,
        position_sigma_m=4.0,
        height_sigma_m=3.0,
        velocity_sigma_mps=0.5,
        climb_sigma_mps=0.5,
        height_bias_sigma_m=5.0,
        loss=0.1,
        burst_reports=2.0,
        first_heard_m=5_000.0,
    ),
    # A report of each target every second, valid at the second's beginning, with NACp, heights in 25 ft,
    # climbs in 64 ft/min, courses in 1.4 degrees (GDL 90 Data Interface Specification, Garmin 560-1058-00
    # Rev A, 3.5). NACp 9 and NACv 2. Where no message came, the receiver extrapolates a report, so that
    # few are lost. Assumed: losses, range, and that the clock on board does not know the second's beginning.
    "gdl90-1hz": Surveillance(
        latency_s=1.0,
        age_reported=False,
        position_sigma_m=12.3,
        height_sigma_m=3.0,
        velocity_sigma_mps=1.2,
        climb_sigma_mps=0.8,
        height_bias_sigma_m=7.0,
        loss=0.02,
        burst_reports=2.0,
        first_heard_m=10_000.0,
        accuracy_stated=True,
    ),
    # 14 CFR 89.310 (g): 95 % of the positions within 100 ft, of the heights within 150 ft, broadcast within a
    # second of the measurement, at least once a second. ASTM F3411-22a states the accuracy as a class: here
    # below 30 m and 3 m/s; climbs in 0.5 m/s. About 1 km over Bluetooth 5 (Open Drone ID). Assumed: losses,
    # and that most of an error of height is constant.
    "remote-id": Surveillance(
        latency_s=1.0,
        age_reported=False,
        position_sigma_m=12.4,
        height_sigma_m=7.0,
        velocity_sigma_mps=1.2,
        climb_sigma_mps=0.5,
        height_bias_sigma_m=22.0,
        loss=0.2,
        burst_reports=2.0,
        first_heard_m=1_000.0,
        accuracy_stated=True,
    ),
}

_FLAGS = {"true": True, "false": False}
# Lowest and highest value of a field; the others are sigmas, from 0.
_BOUNDS = {
    "period_s": (0.1, 60.0),
    "latency_s": (0.0, 60.0),
    "loss": (0.0, 0.95),
    "burst_reports": (1.0, 100.0),
    "first_heard_m": (1.0, 1e6),
}
_LARGEST_SIGMA = 10_000.0


def surveillance_of(name: str) -> Surveillance:
    """The preset of a name, or a changed one: `adsb-out,latency_s=3,loss=0.4`; `ConfigError` otherwise."""
    preset, *changes = name.split(",")
    if preset not in SURVEILLANCE_PRESETS:
        raise ConfigError(f"--surveillance {name}: there are {', '.join(SURVEILLANCE_PRESETS)}")
    changed: dict[str, float | bool] = {}
    for change in changes:
        field, _, text = change.partition("=")
        if field in changed:
            raise ConfigError(f"--surveillance {name}: {field} twice")
        changed[field] = _value(name, field, text)
    how = replace(SURVEILLANCE_PRESETS[preset], **changed)  # type: ignore[arg-type]
    # Gilbert's model of bursts reaches no more, as a burst begins at most after every report that arrived.
    most = how.burst_reports / (1.0 + how.burst_reports)
    if how.loss > most:
        raise ConfigError(f"--surveillance {name}: loss {how.loss:g} needs longer bursts (burst_reports)")
    return how


def _value(name: str, field: str, text: str) -> float | bool:
    defaults = {one.name: one.default for one in fields(Surveillance)}
    if field not in defaults:
        raise ConfigError(f"--surveillance {name}: no field {field!r}; there are {', '.join(defaults)}")
    if isinstance(defaults[field], bool):
        if text not in _FLAGS:
            raise ConfigError(f"--surveillance {name}: {field} is true or false")
        return _FLAGS[text]
    low, high = _BOUNDS.get(field, (0.0, _LARGEST_SIGMA))
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not low <= value <= high:
        raise ConfigError(f"--surveillance {name}: {field} is a number from {low:g} to {high:g}")
    return value
