"""Runs: execute a procedure on a bench, record it, observe it, stop and resume it; here or in the background."""
