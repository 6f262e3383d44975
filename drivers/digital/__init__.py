"""Shared parts of drivers of digital sensors: settings, records, counts of samples, frames, base of the twins."""
