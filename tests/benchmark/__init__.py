"""How fast and how small: `make bench`. One file a subject; nothing here is a test, and no test is timed by the wall.

The one test of speed (tests/rig/test_soak.py) sets processor time against that of a plain pipeline.
"""
