"""What is left when a process dies: a stage that stops by itself, a bench that is free again, a run that goes on."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml

from drivers.clock import WallClock
from drivers.oriental_az import driver as oriental_az
from drivers.transport import Address, Links
from rig.bench import DEFAULT
from rig.errors import Busy
from rig.lease import is_held, lease

pytestmark = pytest.mark.sockets
STALLED_S = 1.5  # of a controller that is stopped and not dead
HOLDS = """
import sys
from pathlib import Path
from rig.lease import lease
folder = Path(sys.argv[1])
with lease(folder, "wire-x", "serial:/dev/ttyUSB0"), lease(folder, "r1", "run r1"), lease(folder, "wire-y", "tcp:b"):
    print("holding", flush=True)
    sys.stdin.read()
"""
MOVES = """
import sys
from drivers.oriental_az import driver as oriental_az
from drivers.clock import WallClock
from drivers.transport import Address, Links
stage = oriental_az.connect(
    Address(sys.argv[1]), Links(WallClock()), oriental_az.Settings(communication_timeout_s=0.5), "alpha"
)
stage.home()
stage.start(300.0)
print("turning", flush=True)
stage.wait()
"""


@contextmanager
def process(*command: str) -> Iterator[subprocess.Popen[str]]:
    """A Python process; killed at the end."""
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, *command], text=True, **pipes) as child:
        try:
            yield child
        finally:
            child.kill()


def said(child: subprocess.Popen[str]) -> str:
    """The next line that a process prints."""
    assert child.stdout
    assert child.stderr
    line = child.stdout.readline().strip()
    assert line, child.stderr.read()
    return line


def test_a_lock_makes_its_folder(tmp_path: Path) -> None:
    with lease(tmp_path / "new" / "home", "r1", "run r1"):
        assert is_held(tmp_path / "new" / "home", "r1")


def test_a_refused_process_learns_the_owner_of_the_lock_and_a_kill_releases_it(tmp_path: Path) -> None:
    with process("-c", HOLDS, str(tmp_path)) as child:
        assert said(child) == "holding"
        holder = rf"another process \({child.pid}, since \d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d, with run r1\) uses serial:"
        for _ in range(2):  # whoever is refused does not wipe out who holds it
            with pytest.raises(Busy, match=holder), lease(tmp_path, "wire-x", "serial:/dev/ttyUSB0"):
                pass
        child.send_signal(signal.SIGKILL)
        child.wait()
        with lease(tmp_path, "wire-x", "serial:/dev/ttyUSB0"):
            told = json.loads((tmp_path / "locks" / "wire-x.lock").read_text())
            assert told["pid"] == os.getpid()


@pytest.mark.slow
def test_a_second_controller_is_refused_before_anything_is_sent(
    tmp_path: Path, bench_file: Callable[..., Path]
) -> None:
    """Two commands on one bench with a real wire: the second names the first, its run, and what to do."""
    with ExitStack() as stack:
        served = stack.enter_context(process("-m", "rig", "simulate", "--json"))
        addresses = json.loads(said(served))["instruments"]
        instruments = yaml.safe_load(DEFAULT.read_text())["instruments"]
        instruments["oven"]["url"] = addresses["oven"]["url"]  # elsewhere, so real for this bench
        path = bench_file({"instruments": instruments})
        path.with_name("answers.yaml").write_text("mounting: yes")
        command = ("-m", "rig", "run", "sweep", "--bench", str(path), "--answers", str(path.with_name("answers.yaml")))
        first = stack.enter_context(process(*command, "--unattended"))
        assert first.stderr
        run = first.stderr.readline().split()[-1]
        second = subprocess.run(
            [sys.executable, *command, "--unattended"], capture_output=True, text=True, timeout=60, check=False
        )
        assert second.returncode == 2
        assert re.search(rf"another process \({first.pid}, since .*, with run {run}\) uses serial:", second.stderr)
        first.send_signal(signal.SIGTERM)
        assert first.wait(timeout=30) == 4


@pytest.mark.slow
@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP], ids=["dies", "stalls"])
def test_a_stage_stops_when_its_controller_is_killed_in_mid_move(blow: signal.Signals) -> None:
    """In real time: the drive hears nothing for half a second, and brakes."""
    with process("-m", "rig", "simulate", "--json") as served:
        url = json.loads(said(served))["instruments"]["alpha"]["url"]
        with process("-c", MOVES, url) as controller:
            assert said(controller) == "turning"
            controller.send_signal(blow)
            if blow == signal.SIGKILL:
                controller.wait()
            else:
                time.sleep(STALLED_S)
            killed_s = time.monotonic()
        clock = WallClock()
        links = Links(clock)
        stage = oriental_az.connect(Address(url), links, oriental_az.Settings(), "alpha")
        alarm = stage.alarm()
        while alarm is None and time.monotonic() - killed_s < 3.0:
            clock.sleep(0.6)  # asking, one would be the controller that it waits for
            alarm = stage.alarm()
        assert alarm
        assert alarm.code == 0x85
        clock.sleep(0.6)
        stood = stage.angle_deg()
        clock.sleep(0.1)
        assert stage.angle_deg() == stood < 45.0  # at 30 deg/s; while it stalled it would have come further
        links.close()
