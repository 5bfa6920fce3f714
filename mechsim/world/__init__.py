"""The simulated tank: bodies, the engine, and the time step."""
