"""What the drivers share: wires, Modbus, register tables, and the servers of the simulated instruments."""

from drivers.links.address import Address
from drivers.links.links import Links

__all__ = ["Address", "Links"]
