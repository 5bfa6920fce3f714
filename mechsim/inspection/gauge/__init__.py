"""A gauge for rare breaks, from the loads that runs have logged."""
