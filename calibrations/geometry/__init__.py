"""Geometry: stage angles, orientations, the specific force in them, and the path from one pose to the next."""
