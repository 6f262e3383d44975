"""A digital sensor that sends lines of text."""
