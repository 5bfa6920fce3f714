"""The calibration pipeline: from planned mechanics runs to rates, diagnostics and validation."""
