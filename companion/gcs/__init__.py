"""What the operator and the ground station request, and what they are told."""
