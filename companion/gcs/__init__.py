"""Requests from the operator and the ground station, and the messages to them."""
