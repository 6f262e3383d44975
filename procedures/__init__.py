"""Procedures: one file each, a plain script over the session that it is given."""
