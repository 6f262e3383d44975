"""Many sensors at once: what a batch has in common, what its rigs add, and what each sensor gains from its siblings."""
