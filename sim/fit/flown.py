"""The fake vehicle in the place of the real one: started in its state, it receives what that one received."""

import copy
from dataclasses import dataclass

import numpy as np

from companion.mavlink.dialect import Message
from sim.dynamics import Airframe
from sim.fit.recording import Recording, Steps, Track
from sim.fit.segments import Segment
from sim.vehicle import FakeVehicle
from sim.world import kind_of

_CHANNEL = 0


@dataclass(frozen=True, slots=True)
class Flown:
    """The fake's flight at the times of the recorded positions of one segment."""

    track: Track
    modes: Steps
    sequences: Steps


def fly(recording: Recording, segment: Segment, airframe: Airframe | None = None) -> Flown:
    """Fly a segment; the fake knows the recording's mission, parameters and state at its begin."""
    track = recording.track
    first, last = track.index(segment.begin_s), track.index(segment.end_s)
    vehicle = _vehicle_at(recording, first, airframe)
    commands = [row for row in recording.commands if track.time_s[first] <= row[0] <= segment.end_s]
    modes: list[tuple[float, int]] = []
    rows, sequences = [], []
    for time_s in track.time_s[first : last + 1]:
        while commands and commands[0][0] <= time_s:
            received_s, message = commands.pop(0)
            modes += _heartbeats(vehicle, received_s)
            vehicle.receive(_moved(message, recording, received_s, vehicle), received_s, _CHANNEL)
        modes += _heartbeats(vehicle, float(time_s))
        rows.append(_state(vehicle))
        sequences.append((float(time_s), vehicle.flight.mission.current))
    states = np.array(rows).T
    return Flown(Track(track.time_s[first : last + 1], *states), Steps.of(modes), Steps.of(sequences))


def _vehicle_at(recording: Recording, row: int, airframe: Airframe | None) -> FakeVehicle:
    """The fake in the recorded state of a row; its line to the mission item begins there."""
    track, time_s = recording.track, float(recording.track.time_s[row])
    kind, options = kind_of(recording.autopilot)
    known = kind(recording.home, time_s, **options).parameters
    sequence = recording.sequences.at(time_s)
    vehicle = kind.airborne(
        recording.home,
        time_s,
        position=track.place(row),
        course_rad=float(track.course_rad[row]),
        sequence=sequence,
        mission=recording.items[kind.first_item :],
        parameters={name: value for name, value in recording.parameters.items() if name in known},
        airframe=airframe,
        **options,
    )
    aircraft = vehicle.flight.aircraft
    aircraft.airspeed_mps = float(track.airspeed_mps[row])
    aircraft.climb_mps = float(track.climb_mps[row])
    aircraft.bank_rad = float(track.bank_rad[row])
    vehicle.flight.resume_line()
    vehicle.add_channel(_CHANNEL, stream_rate_hz=0.0)
    return vehicle


def _moved(message: Message, recording: Recording, time_s: float, vehicle: FakeVehicle) -> Message:
    """The message, with a position setpoint as far from the fake as it was from the real aircraft.

    A companion computes these from where the aircraft is; the lines through them are flown.
    """
    if message.get_type() != "SET_POSITION_TARGET_GLOBAL_INT":
        return message
    track, here = recording.track, vehicle.flight.place
    moved = copy.copy(message)
    moved.lat_int += round((here.lat_deg - np.interp(time_s, track.time_s, track.lat_deg)) * 1e7)
    moved.lon_int += round((here.lon_deg - np.interp(time_s, track.time_s, track.lon_deg)) * 1e7)
    return moved


def _heartbeats(vehicle: FakeVehicle, until_s: float) -> list[tuple[float, int]]:
    """Fly until a time; the mode in each heartbeat on the way."""
    sent = vehicle.step(until_s)
    return [(until_s, out.message.custom_mode) for out in sent if out.message.get_type() == "HEARTBEAT"]


def _state(vehicle: FakeVehicle) -> tuple[float, ...]:
    """A row of `Track` without its time."""
    flight = vehicle.flight
    north_mps, east_mps, down_mps = flight.velocity_mps
    aircraft = flight.aircraft
    return (
        *flight.place,
        north_mps,
        east_mps,
        -down_mps,
        aircraft.airspeed_mps,
        aircraft.bank_rad,
    )
