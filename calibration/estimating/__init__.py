"""From paths to rates: exposure, estimates with intervals, diagnostics."""
