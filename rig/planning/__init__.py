"""Dry runs, and what to run next: every move counted before anything moves."""
