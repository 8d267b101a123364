"""What the engine returns: effects, the decision record and the state kept for the next run."""
