"""What accuracy of the kinetics costs in time: every method's distance from the exact law against its CPU time."""
