"""Runs: how one is made, stored, and shared among workers."""
