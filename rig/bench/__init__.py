"""The bench file: which instrument plays which role, where it is, and what must not be exceeded.

An instrument whose url is `simulated` is served in this process by the twin of its driver, in the world that the file
describes; `simulated:ADDRESS` says where it listens.

parts.py   its parts: instruments, sensors, displacement sensor, certificates, folders
bench.py   the whole
file.py    reading it, with the files that it names
check.py   what its parts must be to each other
values.py  values that cannot be
faults.py  what is wrong with it, in words
"""

from rig.bench.bench import Bench
from rig.bench.check import drivers
from rig.bench.file import DEFAULT, read_bench
from rig.bench.parts import D63, ROLES, SIMULATED, TURNING, Certificate, Instrument, Lab, Sensor

__all__ = [
    "D63",
    "DEFAULT",
    "ROLES",
    "SIMULATED",
    "TURNING",
    "Bench",
    "Certificate",
    "Instrument",
    "Lab",
    "Sensor",
    "drivers",
    "read_bench",
]
