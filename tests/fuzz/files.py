"""Readers of files: tables, arrays, bench, model and curve, expressions, and the record itself."""

from __future__ import annotations

import gzip
import shutil
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

from calibrations.effects.expression_effect import own_effect
from calibrations.errors import CalibrationError
from calibrations.files import load_yaml, open_text_file, text_source
from calibrations.geometry.error_table import ErrorTable, read_error_table
from calibrations.importing.foreign import import_sheet, parse_csv
from calibrations.importing.proposal import propose_mapping
from calibrations.importing.sheet import read_sheet
from calibrations.model.file import SHIPPED, parse_model
from drivers.philtec_d63 import CalibrationCurve
from procedures.session import Pose
from rig.bench import DEFAULT, read_bench
from rig.errors import RigError
from rig.record import KeptPose, Record, codec
from rig.record.recover import recover
from rig.services.still import axes
from tests.fuzz.target import Target
from tests.rig.test_store import begin, block


@cache
def kept_folder() -> tempfile.TemporaryDirectory[str]:
    """In memory where there is such a place; `remove` removes it."""
    memory = Path("/dev/shm")  # noqa: S108 - a folder of our own is made in it
    return tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None, ignore_cleanup_errors=True)


def folder() -> Path:
    return Path(kept_folder().name)


def remove() -> None:
    """Files of inputs are gone; called when there are no more."""
    kept_folder().cleanup()
    kept_folder.cache_clear()


def csv_text(data: bytes) -> object:
    with suppress(CalibrationError):
        parse_csv(data.decode("latin-1"), "data.csv")
    laid = read_sheet(text_source(data.decode("latin-1"), "data.csv"))
    return import_sheet(laid, None, propose_mapping(laid))


def file(name: str, data: bytes) -> Path:
    path = folder() / name
    path.write_bytes(data)
    return path


def csv_file(data: bytes) -> object:
    with open_text_file(file("data.csv", data)).lines() as lines:
        return sum(map(len, lines))


def compressed(data: bytes) -> object:
    with open_text_file(file("data.csv.gz", data)).lines() as lines:
        return sum(map(len, lines))


def error_table(data: bytes) -> object:
    return ErrorTable(read_error_table(file("beta.csv", data))).points


def array(data: bytes) -> object:
    (still,) = axes(None, str(file("still.npy", data)), None, 1000.0).values()
    return [len(block) for block in still.blocks]


def record(data: bytes) -> object:
    home = folder() / "record"
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir()
    (home / "record.db").write_bytes(data)
    try:
        with Record(home) as opened:
            return [(list(opened.kept(run.run)), opened.events(run.run)) for run in opened.runs()]
    finally:
        shutil.rmtree(folder() / "copy", ignore_errors=True)
        with suppress(RigError):
            recover(home / "record.db", folder() / "copy")


def record_seed() -> bytes:
    with Record(folder() / "seed") as made:
        run = begin(made)
        for number in range(3):
            made.keep(run, number, KeptPose(Pose(90, number), block([[2.0, 1.0], [1.0, 2.0]]), number, 21.5), None)
    data = (folder() / "seed" / "record.db").read_bytes()
    shutil.rmtree(folder() / "seed")
    return data


def curve(data: bytes) -> object:
    document = load_yaml(data.decode("latin-1"))
    return CalibrationCurve.from_mapping(document) if isinstance(document, dict) else None


def bench(data: bytes) -> object:
    return read_bench(file("bench.yaml", data))


def expression(data: bytes) -> object:
    return own_effect.__wrapped__("mine", data.decode("latin-1")).needs


def array_seed() -> bytes:
    path = folder() / "seed.npy"
    np.save(path, np.arange(8.0))
    return path.read_bytes()


POSES = (
    b"# sensor: x\nalpha_deg,beta_deg,vx_v,vx_std_v,n\n90,0,2.5,0.001,100\n90,10,2.6,0.001,100\n90,20,2.7,0.001,100\n"
)
FOREIGN = "t[s];Winkel[°];beta;U_x [mV];Temp °C\n0,0;10,5;0,5;2500,1;21,5\n1,0;20,5;1,5;2501,1;21,5\n".encode("latin-1")
ERRORS = b"angle_deg,error_deg,std_deg\n0,0.01,0.001\n30,0.02,0.001\n"
CURVE = b"serial: D63-1\ndate: 2024-05-02\nnear: [[0, 0.1], [10, 0.9], [20, 1.7], [30, 2.4]]\nfar: []\n"
EXPRESSIONS = [
    b"v += a*sin(5*beta) + b*cos(5*beta)", b"vx += where(t > 3120, a, b)*exp(-t/c)", b"a*step(t - 3120)",
    b"beta_deg += a*min(beta, 1)**2", b"az*ax*p - q/(1 + temperature)",
]  # fmt: skip
FAULTY = b"instruments:\n  alpha: {driver: oriental_az, url: simulated, faults: [{what: delay, at_s: 3, size: 0.5}]}\n"
BLOCKS = [codec.encode(np.array([[1.0, 2.0], [1.5, 2.0]])), codec.encode(np.zeros((0, 3)))]
MODELS = [path.read_bytes() for path in sorted(SHIPPED.glob("*.yaml"))]
TABLES = (CalibrationError,)
FILES: dict[str, Target] = {
    "csv": Target(csv_text, TABLES, [POSES, FOREIGN], 2),
    "csv-file": Target(csv_file, TABLES, [POSES, FOREIGN, POSES.decode().encode("utf-16")], 2),
    "compressed": Target(compressed, TABLES, [gzip.compress(POSES, mtime=0)]),
    "error-table": Target(error_table, TABLES, [ERRORS], 2),
    "array": Target(array, TABLES, [array_seed()], 2),
    "expression": Target(expression, TABLES, EXPRESSIONS, 40),
    "model-yaml": Target(lambda data: parse_model(data.decode("latin-1"), "m.yaml"), TABLES, MODELS, 2),
    "bench-yaml": Target(
        lambda data: read_bench(file("bench.yaml", data)), (RigError,), [DEFAULT.read_bytes(), FAULTY]
    ),
    "curve-yaml": Target(curve, (ValueError,), [CURVE]),
    "sample-block": Target(codec.decode, (ValueError,), BLOCKS, 40),
    "record": Target(record, (RigError,), [record_seed()]),
}
remove()
