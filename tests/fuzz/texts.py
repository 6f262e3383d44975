"""Texts of people and programs: logs of other forms, lists, settings, addresses, web requests; and messages of sensors.

Logs here become tables of means: the search for still positions, dwells and turns is reached.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.io import savemat

from calibrations.errors import CalibrationError
from calibrations.files import read_mapping, text_source
from calibrations.importing.foreign import import_sheet
from calibrations.importing.raw_logs import average_raw_log
from calibrations.importing.sheet import read_sheet
from calibrations.importing.units import ColumnMapping
from drivers.errors import DriverError
from drivers.imu_lines.proposal import propose_settings
from drivers.mavlink_imu import driver as mavlink
from drivers.mavlink_imu import messages as mav
from drivers.xsens_mti import driver as xsens
from drivers.xsens_mti import messages as xbus
from procedures.catalogue import find, paths, summary
from procedures.errors import BadAnswer, ProcedureError
from procedures.pose_list import parse_poses
from procedures.settings import parse
from rig.errors import RigError
from rig.fleet.members import fleet_of
from rig.lab_url import lab_url, mask_url
from rig.web.guard import Guard
from tests.fuzz.files import file, folder
from tests.fuzz.logs import target, written
from tests.fuzz.target import Target
from tests.fuzz.wires import Said

__all__ = ["TEXTS"]

RATE_HZ = 20.0


def averaged(kind: str) -> Callable[[bytes], object]:
    """A log of samples, and the means of its still parts."""

    def take(data: bytes) -> object:
        laid = read_sheet(text_source(data.decode("latin-1"), "log.csv"))
        with np.errstate(all="ignore"):
            return average_raw_log(import_sheet(laid, kind).table).n

    return take


def log(names: Sequence[str], levels: np.ndarray, samples: int, words: Sequence[str] = ()) -> bytes:
    """Samples at these levels, one after another, with noise; `words` name them in a column `path`."""
    random = np.random.default_rng(1)
    lines = [f"# sample_rate_hz: {RATE_HZ:g}", ",".join([*names, *["path"][: len(words)]])]
    for k, level in enumerate(levels):
        rows = level + 1e-3 * random.standard_normal((samples, len(level)))
        end = [f",{words[k]}"] if words else [""]
        lines += [",".join(f"{value:.4f}" for value in row) + end[0] for row in rows]
    return "\n".join(lines).encode()


def by_lines(use: Callable[[list[str]], object]) -> Callable[[bytes], object]:
    return lambda data: use(data.decode("latin-1").splitlines())


def settings(lines: list[str]) -> object:
    """Settings of a procedure, `name=value` in each line."""
    return parse(find("sweep"), dict(line.partition("=")[::2] for line in lines))


def answers(data: bytes) -> object:
    return read_mapping(file("answers.yaml", data), "file of answers", BadAnswer, "write one")


def fleet(data: bytes) -> object:
    """An index of sensors; a file that it names is not there."""
    return fleet_of([str(file("fleet.csv", data))])


def own_procedure(data: bytes) -> object:
    """Read a file in the folder of procedures: whether it is a procedure, and its description. It is not run."""
    with TemporaryDirectory(dir=folder()) as place:
        (Path(place) / "mine.py").write_bytes(data)
        found = paths(Path(place)).get("mine")
        return summary(found) if found else None


TOKEN_SENT = re.compile(rb"rig-8473\s*=\s*secret")  # spaces about a name belong to no cookie


def web_request(data: bytes) -> object:
    """Headers `name: value` in lines after the address: in without the token nobody comes."""
    address, *lines = data.split(b"\n")
    path, _, query = address.partition(b"?")
    headers = [(name.strip().lower(), value.strip()) for name, _, value in (line.partition(b":") for line in lines)]
    sent: list[Any] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        assert TOKEN_SENT.search(data)
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {"type": "http", "path": path.decode("latin-1"), "query_string": query, "headers": headers}
    guard = Guard(app, "secret", frozenset({"127.0.0.1:8473"}))
    with suppress(StopIteration):
        guard(scope, None, send).send(None)
    assert sent[0]["status"] in (200, 303, 401, 403)
    return sent[0]["status"]


class Dialogue(Said):
    """A wire on which each message gets the next piece as its answer; pieces have these lengths."""

    def __init__(self, data: bytes, lengths: Sequence[int]) -> None:
        super().__init__("tcp://h:1", b"")
        ends = np.cumsum(lengths)[:-1].tolist()
        self._pieces = [data[a:b] for a, b in zip([0, *ends], [*ends, len(data)], strict=True)]

    def write(self, data: bytes) -> None:
        self._data = [self._pieces.pop(0)] if self._pieces else []


def asked(make: Callable[[Any], Any], lengths: Sequence[int]) -> Callable[[bytes], object]:
    """What a sensor answers while it says who it is, and while it is set up."""

    def take(data: bytes) -> object:
        sensor = make(Dialogue(data, lengths))
        identity = sensor.identify()
        with suppress(DriverError):
            sensor._begin()
        return identity

    return take


def proposed(lines: list[str]) -> object:
    with np.errstate(all="ignore"):
        return propose_settings(lines, 1.0)


FACES = np.vstack([np.eye(3), -np.eye(3)])
AXES = dict(zip(("ax", "ay", "az"), FACES.T, strict=True))
RAW = log(("ax", "ay", "az"), FACES, 60)
DWELLS = log(("alpha_deg", "beta_deg", "vx_v", "vy_v"), np.array([[90, b, 2.5, 2.5] for b in (0, 60, 120.0)]), 60)
SECTIONS = b"# turn_deg: 360\n" + log(
    ("gx", "gy", "gz"), np.vstack([0 * FACES[:1], 50 * FACES[:2]]), 40, ("rest", "+x", "+y")
)
REST, TURN = np.array([0, 0, 1, 0, 0, 0.0]), np.array([0, 0.7, 0.7, 45, 0, 0])
TURNED = log(("ax", "ay", "az", "gx", "gy", "gz"), np.array([REST, TURN] * 8 + [REST]), 40)
JSON = [
    b'{"acc": [[0, 0, 1], [0, 1, 0]], "t_s": [0, 1], "unit": "g"}',
    b'[{"ax": 0, "ay": 0, "az": 1}, {"ax": 0, "ay": 1, "az": 0}]',
    b'{"ax": 0, "ay": 0, "az": 1}\n{"ax": 0, "ay": 1, "az": 0}\n',
]
NAMED = [b"ax:0.1,ay:0.2,az:9.8\nax:0.1,ay:0.3,az:9.7\n", b"ax=1 ay=2 az=.5 t=3\n"]
POSES = [b"alpha_deg,beta_deg,direction,path,mount_deg,flip\n90,0,1,up,0,0\n90,30,-1,down,90,1\n"]
INDEX = [b"sensor,batch,rig,file\nA1,L7,north,a1.csv\nA2,L7,south,a2.csv\n"]
OWN = [b'"""mine: a procedure.\n"""\n\ndef mine(rig, *, times=3):\n    rig.wait(times)\n', b"x = [1, 2]\n"]
REQUESTS = [
    b"/runs?token=secret&a=1\nhost: 127.0.0.1:8473\n",
    b"/\nhost: 127.0.0.1:8473\norigin: http://127.0.0.1:8473\ncookie: a=b; rig-8473=secret\n",
]
BEAT = mav.frames(
    mav.HEARTBEAT, mav.fields(mav.HEARTBEAT, type=2, autopilot=12, status=3, version=3), np.array([0]), 1, 1, mav.V2
)[0]
DONE = mav.frames(
    mav.COMMAND_ACK,
    mav.fields(mav.COMMAND_ACK, command=mav.SET_MESSAGE_INTERVAL, result=0),
    np.array([1]),
    1,
    1,
    mav.V2,
)[0]
XSENS = [
    xbus.message(number + 1, data)
    for number, data in (
        (xbus.GO_TO_CONFIG, b""), (xbus.DEVICE_ID, b"\3\7\0\1"), (xbus.PRODUCT_CODE, b"MTi-30"),
        (xbus.FIRMWARE, b"\1\2\3"), (xbus.GO_TO_CONFIG, b""),
        (xbus.OUTPUT_CONFIGURATION, xbus.configuration({xbus.ACCELERATION: 100})), (xbus.GO_TO_MEASUREMENT, b""),
    )
]  # fmt: skip
SAID = (DriverError,)
TEXTS: dict[str, Target] = {
    "json": target("log.json", *JSON, weight=4),
    "named-lines": target("log.txt", *NAMED, weight=4),
    "npy": target(
        "log.npy", written("log.npy", lambda path: np.save(path, np.rec.fromarrays(FACES.T, names=list(AXES))))
    ),
    "npz": target("log.npz", written("log.npz", lambda path: np.savez(path, **AXES))),
    "matlab": target(
        "log.mat",
        written("log.mat", lambda path: savemat(path, AXES)),
        written("log.mat", lambda path: savemat(path, {"imu": AXES | {"who": "me"}}, do_compression=True)),
        weight=4,
    ),
    "raw-log": Target(averaged("positions"), (CalibrationError,), [RAW]),
    "dwell-log": Target(averaged("poses"), (CalibrationError,), [DWELLS]),
    "section-log": Target(averaged("rates"), (CalibrationError,), [SECTIONS]),
    "turn-log": Target(averaged("turns"), (CalibrationError,), [TURNED]),
    "column": Target(
        lambda data: ColumnMapping.parse(data.decode("latin-1")), (CalibrationError,), [b"vx_v=Vout:mV", b"t_s=a:b"], 8
    ),
    "pose-list": Target(by_lines(parse_poses), (ProcedureError,), POSES, 8),
    "settings": Target(by_lines(settings), (ProcedureError,), [b"step_deg=30\ninclinations_deg=90,30\n"], 2),
    "answers": Target(answers, (BadAnswer,), [b"mounting: yes\nalpha-dial: 90.1\n"], 2),
    "fleet-index": Target(fleet, (RigError, CalibrationError), INDEX, 2),
    "lab-url": Target(
        lambda data: mask_url(lab_url(data.decode("latin-1"))),
        (RigError,),
        [b"postgresql://me:x%40y@h:5432/lab?a=b"],
        4,
    ),
    "own-procedure": Target(own_procedure, (), OWN, 2),
    "web-request": Target(web_request, (), REQUESTS, 8),
    "imu-proposal": Target(by_lines(proposed), (), [b"1,0.01,-0.004,1.0\n2,0.02,-0.004,1.0\n", *NAMED], 2),
    "mavlink-answer": Target(
        asked(lambda link: mavlink.FlightController(link, mavlink.Settings(), "adc"), [len(BEAT), len(DONE)]),
        SAID,
        [BEAT + DONE],
        4,
    ),
    "xbus-answer": Target(
        asked(lambda link: xsens.Tracker(link, xsens.Settings(), "adc"), [len(answer) for answer in XSENS]),
        SAID,
        [b"".join(XSENS)],
        8,
    ),
}
