"""The simulated world: fake autopilots that speak MAVLink, traffic, scenarios, campaigns, demonstrations."""
