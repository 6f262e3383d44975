"""The bench file: the instrument in each role, its address, and the limits.

If the url of an instrument is `simulated`, the twin of its driver is served in this process, in the simulated world of
the file. `simulated:ADDRESS` gives the address of the twin.

parts.py  the parts: instruments, sensors, displacement sensor, certificates, folders
bench.py  the whole bench
file.py   reads the file, with the files that it names
check.py  checks values and the relations between the parts
result_names.py  the results that limits may be set on, and their meanings
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
