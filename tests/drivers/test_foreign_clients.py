"""The twins answer clients that are not ours: mbpoll, minimalmodbus, and PI's pipython. In real time."""

from __future__ import annotations

import re
import shutil
import subprocess
import threading
from collections.abc import Callable, Iterator
from typing import Any

import minimalmodbus
import numpy as np
import pytest
from pipython import GCSDevice, GCSError, datarectools, pitools
from pipython.pidevice.interfaces.pisocket import PISocket

from drivers.clock import serve_forever
from drivers.labjack_t7 import driver as labjack_t7
from drivers.labjack_t7 import twin as labjack_t7_twin
from drivers.labjack_t7.stream import RangeCalibration
from drivers.omega_cn7500 import driver as omega_cn7500
from drivers.omega_cn7500 import twin as omega_cn7500_twin
from drivers.oriental_az import driver as oriental_az
from drivers.oriental_az import twin as oriental_az_twin
from drivers.pi_e727 import driver as pi_e727
from drivers.pi_e727 import twin as pi_e727_twin
from drivers.transport.address import Url
from drivers.transport.server import Server

MBPOLL = shutil.which("mbpoll")
needs_mbpoll = pytest.mark.skipif(MBPOLL is None, reason="mbpoll is not installed (Debian: apt install mbpoll)")
Serve = Callable[[Server], str]


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Serve in real time until the test ends; gives the url."""
    ended, threads, servers = threading.Event(), [], []

    def start(server: Server) -> str:
        servers.append(server)
        threads.append(threading.Thread(target=serve_forever, args=([server], ended.is_set)))
        threads[-1].start()
        return server.url

    yield start
    ended.set()
    for thread in threads:
        thread.join()
    for server in servers:
        server.close()


def bus(world: Any, listen: str) -> Server:
    stage = oriental_az.Settings(steps_per_turn=36000)
    return oriental_az_twin.serve(world, {"alpha": (1, stage), "beta": (2, stage)}, listen)


def mbpoll(url: str, *options: str) -> str:
    """Ask once; registers are given by their address on the wire. The numbers it prints, or what it says."""
    wire = Url.parse(url)
    if wire.rtu:
        place = ["-m", "rtu", "-b", str(wire.baud), "-P", "none", wire.path]
    else:
        place = ["-m", "tcp", "-p", str(wire.port), wire.host]
    command = [str(MBPOLL), "-0", "-1", "-q", "-o", "0.5", *options, *place]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    values = re.findall(r"^\[\d+\]:\s+(\S+)", done.stdout, re.MULTILINE)
    return " ".join(values) if values else done.stdout + done.stderr


@needs_mbpoll
@pytest.mark.parametrize("listen", ["tcp://127.0.0.1:0", "pty:"])
def test_mbpoll_reads_a_stage(serve: Serve, small_world: Any, listen: str) -> None:
    url = serve(bus(small_world, listen))
    position = ["-a", "1", "-t", "4:int", "-B", "-r", str(0x00CC)]
    assert mbpoll(url, *position) == "700"  # 7 deg
    assert mbpoll(url, "-a", "1", "-t", "4:hex", "-r", str(0x007F)) == "0x4020"


@needs_mbpoll
def test_mbpoll_finds_an_absent_unit_silent(serve: Serve, small_world: Any) -> None:
    url = serve(bus(small_world, "pty:"))
    assert "timed out" in mbpoll(url, "-a", "9", "-t", "4:hex", "-r", str(0x007F)).lower()


@needs_mbpoll
def test_mbpoll_reads_a_converter(serve: Serve, small_world: Any) -> None:
    settings = labjack_t7.Settings(channels={"supply": 5})
    calibration = RangeCalibration(3.2e-4, -3.2e-4, 33523.0, -10.6)
    labjack_t7_twin.codes_of_volts(np.zeros((1, 1)), [calibration])  # loads what is compiled: mbpoll waits for a second
    url = serve(labjack_t7_twin.serve(small_world, {"adc": (1, settings)}))
    assert mbpoll(url, "-a", "1", "-t", "4:hex", "-c", "2", "-r", "55100") == "0x0011 0x2233"
    assert mbpoll(url, "-a", "1", "-t", "4:float", "-B", "-r", "60000") == "7"
    assert float(mbpoll(url, "-a", "1", "-t", "4:float", "-B", "-r", "10")) == pytest.approx(5.0, abs=1e-3)


@needs_mbpoll
@pytest.mark.parametrize("listen", ["tcp://127.0.0.1:0", "pty:?baud=9600"])
def test_mbpoll_reads_an_oven(serve: Serve, small_world: Any, listen: str) -> None:
    url = serve(omega_cn7500_twin.serve(small_world, {"oven": (1, omega_cn7500.Settings())}, listen))
    assert mbpoll(url, "-a", "1", "-t", "4", "-r", str(0x1000)) == "215"
    assert mbpoll(url, "-a", "1", "-t", "1", "-r", str(0x0814)) == "0"


def test_minimalmodbus_homes_and_turns_a_stage(serve: Serve, small_world: Any) -> None:
    path = Url.parse(serve(bus(small_world, "pty:"))).path
    stage = minimalmodbus.Instrument(path, 2, close_port_after_each_call=True)
    stage.serial.baudrate, stage.serial.timeout = 115200, 0.5
    stage.write_register(0x007D, 1 << 4, functioncode=6)
    stage.write_register(0x007D, 0, functioncode=6)
    direct = [0, 0, 0, 3, 0, 100, 0, 30000, 7, 0xA120, 7, 0xA120, 0, 1000, 0, 1]  # relative, 100 steps
    stage.write_registers(0x0058, direct)
    for _ in range(200):
        if not stage.read_register(0x007F) & 1 << 13:
            break
    assert stage.read_long(0x00CC, signed=True) == 100
    assert stage.read_long(0x0080) == 0


def test_minimalmodbus_runs_an_oven(serve: Serve, small_world: Any) -> None:
    server = omega_cn7500_twin.serve(small_world, {"oven": (1, omega_cn7500.Settings())}, "pty:?baud=9600")
    oven = minimalmodbus.Instrument(Url.parse(serve(server)).path, 1, close_port_after_each_call=True)
    oven.serial.baudrate, oven.serial.timeout = 9600, 0.5
    assert oven.read_register(0x1000, 1) == pytest.approx(21.5)
    oven.write_register(0x1001, 45.5, 1, functioncode=6)
    oven.write_bit(0x0814, 1)
    assert oven.read_bit(0x0814) == 1
    assert small_world.oven == (45.5, True)


def test_minimalmodbus_is_told_what_is_declined(serve: Serve, small_world: Any) -> None:
    path = Url.parse(serve(bus(small_world, "pty:"))).path
    stage = minimalmodbus.Instrument(path, 1, close_port_after_each_call=True)
    stage.serial.baudrate, stage.serial.timeout = 115200, 0.5
    with pytest.raises(minimalmodbus.IllegalRequestError):
        stage.read_register(0x007F, functioncode=4)


@pytest.fixture
def nanocube(serve: Serve, small_world: Any) -> Iterator[Any]:
    """The positioner as PI's own client sees it, servos on."""
    url = Url.parse(serve(pi_e727_twin.serve(small_world, {"positioner": (1, pi_e727.Settings())})))
    with GCSDevice(gateway=PISocket(url.host, url.port)) as device:
        pitools.startup(device)
        yield device


def test_pipython_connects_and_moves(nanocube: Any) -> None:
    assert (nanocube.devname, nanocube.axes) == ("E-727", ["1", "2", "3"])
    assert nanocube.qTMX() == {"1": 100.0, "2": 100.0, "3": 100.0}
    assert nanocube.getparam(0x0E000200) == pytest.approx(50e-6)
    pitools.moveandwait(nanocube, "1", 30.0)
    assert nanocube.qPOS("1")["1"] == pytest.approx(30.0, abs=0.01)


def test_pipython_runs_a_sine_records_it_and_stops(nanocube: Any) -> None:
    pitools.moveandwait(nanocube, "2", 10.0)
    nanocube.WTR(2, 1, 0)
    nanocube.WAV_SIN_P(
        table=2, firstpoint=0, numpoints=2000, append="X", center=1000, amplitude=20, offset=10, seglength=2000
    )
    nanocube.WSL(2, 2)
    nanocube.WGC(2, 0)
    with datarectools.Datarecorder(nanocube) as recorder:
        recorder.samplefreq, recorder.numvalues = 1000, 150
        recorder.sources, recorder.options, recorder.trigsources = "2", 2, 0
        recorder.arm()
        nanocube.WGO(2, 1)
        header, (places,) = recorder.getdata(timeout=5)
    assert (header["NDATA"], header["SAMPLE_TIME"]) == (150, pytest.approx(1e-3))
    assert (min(places), max(places)) == (pytest.approx(10.0, abs=0.1), pytest.approx(30.0, abs=0.3))
    assert places.index(max(places)) == pytest.approx(52, abs=2)  # half a period, and the loop's lag

    with pytest.raises(GCSError, match="wave generator"):
        nanocube.MOV("2", 50)
    pitools.stopall(nanocube)
    pitools.waitontarget(nanocube)
    assert nanocube.IsGeneratorRunning(2) == {2: False}
    stopped = nanocube.qPOS("2")["2"]
    assert nanocube.qPOS("2")["2"] == pytest.approx(stopped, abs=0.02)


def test_pipython_is_told_what_is_wrong(nanocube: Any) -> None:
    for command, number in ((lambda: nanocube.MOV("1", 101), 7), (lambda: nanocube.WGO(3, 1), 75)):
        with pytest.raises(GCSError) as raised:
            command()
        assert raised.value.val == number
