"""Inspection of runs: cost of a step, poses, pictures, replay."""
