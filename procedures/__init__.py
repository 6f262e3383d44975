"""Procedures: one file each. A procedure is a plain script that calls the methods of a session."""
