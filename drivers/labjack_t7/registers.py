"""LabJack T7: the part of its register map that the rig uses. Source: T-series datasheet, Modbus map.

Big-endian, high word first. Addresses are the map's own, in decimal as LabJack prints them.
"""

from __future__ import annotations

from drivers.transport.modbus import Register

STREAM_PORT = 702


# Inputs and outputs.
def ain(number: int) -> Register:
    """Voltage of one analog input."""
    return Register(2 * number, "float32", f"AIN{number}", "V")


def ain_range(number: int) -> Register:
    """Range of one analog input: 10, 1, 0.1 or 0.01 V."""
    return Register(40000 + 2 * number, "float32", f"AIN{number}_RANGE", "V")


def ain_negative(number: int) -> Register:
    """The negative channel of the input; SINGLE_ENDED is ground."""
    return Register(41000 + number, "uint16", f"AIN{number}_NEGATIVE_CH")


def dio(number: int) -> Register:
    """State of one digital line; writing makes it an output."""
    return Register(2000 + number, "uint16", f"DIO{number}")


LINES_STATE = Register(2800, "uint32", "DIO_STATE")  # bit n is DIOn; reading it makes no line an input or output
INPUTS, LINES = 14, 23
SINGLE_ENDED = 199

# Who it is.
TEST = Register(55100, "uint32", "TEST")
TEST_VALUE = 0x00112233
LAST_ERROR = Register(55000, "uint32", "LAST_ERR_DETAIL")
PRODUCT_ID = Register(60000, "float32", "PRODUCT_ID")
FIRMWARE = Register(60004, "float32", "FIRMWARE_VERSION")
SERIAL_NUMBER = Register(60028, "uint32", "SERIAL_NUMBER")
CORE_TIMER = Register(61520, "uint32", "CORE_TIMER")
CORE_HZ, CORE_NS = 40e6, 25

# Internal flash: write an address, then read words from it; here the factory's calibration.
FLASH_POINTER = Register(61810, "uint32", "INTERNAL_FLASH_READ_POINTER")
FLASH = 61812
CALIBRATION_ADDRESS = 0x3C4000
CALIBRATION_WORDS = 82  # 41 FLOAT32: four sets for the fast converter, four for the slow one, DACs, temperature
RANGES_V = (10.0, 1.0, 0.1, 0.01)  # of the four sets, in this order

# Stream. The first ten are neighbours, written in one go; ENABLE is written last.
SCAN_RATE = Register(4002, "float32", "STREAM_SCANRATE_HZ", "Hz")
NUM_ADDRESSES = Register(4004, "uint32", "STREAM_NUM_ADDRESSES")
SAMPLES_PER_PACKET = Register(4006, "uint32", "STREAM_SAMPLES_PER_PACKET")
SETTLING = Register(4008, "float32", "STREAM_SETTLING_US", "us")
RESOLUTION = Register(4010, "uint32", "STREAM_RESOLUTION_INDEX")
BUFFER_SIZE = Register(4012, "uint32", "STREAM_BUFFER_SIZE_BYTES", "byte")
CLOCK_SOURCE = Register(4014, "uint32", "STREAM_CLOCK_SOURCE")  # [M] between the listed ones; 0 is internal
AUTO_TARGET = Register(4016, "uint32", "STREAM_AUTO_TARGET")
DATATYPE = Register(4018, "uint32", "STREAM_DATATYPE")
NUM_SCANS = Register(4020, "uint32", "STREAM_NUM_SCANS")  # 0: until it is stopped
ACTUAL_RATE = Register(4494, "float32", "STREAM_ACTUAL_SCANRATE_HZ", "Hz")
ENABLE = Register(4990, "uint32", "STREAM_ENABLE")
TO_ETHERNET = 1  # of AUTO_TARGET: packets go to the stream port
MOST_SAMPLES_PER_PACKET = 512
HIGHEST_CODE = 65535  # like 0, for all voltages beyond the range
LARGEST_BUFFER = 32768
MOST_SAMPLES_PER_S = 100_000
MOST_ADDRESSES = 128
INTERCHANNEL_S = 15e-6  # at resolution index 1 and automatic settling [M]


def scan_list(index: int) -> Register:
    """Address of the `index`-th channel of a scan."""
    return Register(4100 + 2 * index, "uint32", f"STREAM_SCANLIST_ADDRESS{index}")


ERRORS = {
    2605: "a stream is running already",
    2608: "the scan rate is not possible",
    2615: "the stream's buffer size is not a power of two, or too large",
    2618: "the number of samples per packet is not possible",
    2620: "no stream is running",
}
STREAM_ACTIVE, BAD_RATE, BAD_BUFFER, BAD_PACKET, NOT_RUNNING = ERRORS
