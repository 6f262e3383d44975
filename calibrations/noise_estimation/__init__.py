"""The noise of poses: of each mean from its samples, and of one pose after another from what a fit leaves."""
