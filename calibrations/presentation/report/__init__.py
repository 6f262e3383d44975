"""Results as pages that need no network."""
