"""Anybody's files as our tables: columns named, units converted, doubts told."""
