"""Effects that are noise, in the spectrum of a still record."""
