"""Effects on the signal: from the pose to the output."""
