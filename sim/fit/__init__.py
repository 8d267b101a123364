"""Holds the fake vehicles to recordings of real autopilots: same commands, same times, compared states."""
