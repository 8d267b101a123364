"""Simulated receivers of traffic: what an aircraft transmits, in the formats that receivers send."""

from sim.receivers.encoder import ReceiverEncoder, Reception, Transmission

__all__ = ["ReceiverEncoder", "Reception", "Transmission"]
