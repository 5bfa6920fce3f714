"""The tank as it moves: bodies, the engine, and one step at a time."""
