"""The accuracy diagram: every method's distance from the exact distribution, against its CPU time."""
