"""The flight test: flies any autopilot at a link through scripted encounters, and judges Companion."""
