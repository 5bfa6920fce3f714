"""Estimation of rates from jump paths: exposure, likelihood, models of rates, intervals, diagnostics."""
