"""The cost of accuracy: every method's distance from the exact distribution against its CPU time."""
