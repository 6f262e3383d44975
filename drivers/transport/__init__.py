"""What the drivers share: wires, Modbus, register tables, and the servers of the simulated instruments."""

from drivers.transport.address import Address
from drivers.transport.links import Links

__all__ = ["Address", "Links"]
