"""Runs to look at: the tank, films, a view to turn."""
