"""The output of the engine: effects, the decision record and the state saved for the next run."""
