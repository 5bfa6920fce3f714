"""Runs: making, storing and sharing them among workers."""
