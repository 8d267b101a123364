"""The radio signal of Mode S messages, as samples of a receiver at 1090 MHz.

Source: ICAO Annex 10 volume IV 3.1.2.2 (preamble of four pulses, pulse position modulation of 1 Mbit/s).
"""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

SAMPLES_PER_S = 2_400_000
_STEPS_PER_US = 12  # fine enough for pulses of half a microsecond and for samples of 5/12 of one
_STEPS_PER_SAMPLE = 5
_PULSE = _STEPS_PER_US // 2
_PREAMBLE_US = (0.0, 1.0, 3.5, 4.5)
_DATA_US = 8
_ZERO, _AMPLITUDE, _NOISE = 127.5, 100.0, 1.0


def samples(messages: Iterable[tuple[float, bytes]], duration_s: float) -> bytes:
    """Unsigned bytes, in phase and quadrature in turn, with each message at its time [s]."""
    count = round(duration_s * SAMPLES_PER_S)
    steps = np.zeros(count * _STEPS_PER_SAMPLE, dtype=np.float32)
    for time_s, message in messages:
        pulses = _pulses(message)
        begin = round(time_s * _STEPS_PER_US * 1e6)
        steps[begin : begin + len(pulses)] = pulses
    envelope = steps.reshape(count, _STEPS_PER_SAMPLE).mean(axis=1)
    noise = np.random.default_rng(1).normal(0.0, _NOISE, (count, 2))
    signal = _ZERO + _AMPLITUDE * envelope[:, np.newaxis] * np.array([0.8, 0.6]) + noise
    return signal.clip(0, 255).astype(np.uint8).tobytes()


def _pulses(message: bytes) -> npt.NDArray[np.float32]:
    """The signal of a message: a pulse in the first half of a microsecond for 1, in the second for 0."""
    bits = np.unpackbits(np.frombuffer(message, dtype=np.uint8))
    signal = np.zeros((_DATA_US + len(bits)) * _STEPS_PER_US, dtype=np.float32)
    begins = [round(_STEPS_PER_US * time_us) for time_us in _PREAMBLE_US]
    begins += [(_DATA_US + at) * _STEPS_PER_US + (0 if bit else _PULSE) for at, bit in enumerate(bits)]
    for begin in begins:
        signal[begin : begin + _PULSE] = 1.0
    return signal
