"""The calibration pipeline: the runs it asks for, and what it makes of them."""
