"""Files of arrays, written by the formats' own libraries, are read as tables; damaged ones are refused."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat
from scipy.sparse import csc_array

from calibrations.errors import DataError
from calibrations.importing import topics
from calibrations.importing.binary import open_sheet
from calibrations.importing.topics import SeveralTopics
from calibrations.importing.units import ColumnMapping
from tests.foreign_files import read_foreign

N = 40
ACC = np.random.default_rng(1).normal(size=(N, 3))
TIME = np.arange(N) / 100
AXES = ("ax", "ay", "az")
OURS = dict(zip(AXES, ACC.T, strict=True)) | {"t_s": TIME}
MAPPED = [ColumnMapping("ax", "acc_x"), ColumnMapping("ay", "acc_y"), ColumnMapping("az", "acc_z")]


def hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, values in OURS.items():
            file.create_dataset(f"imu/{name}", data=values, compression="gzip")
        file["imu"].attrs["sensor"] = "mine"


def hdf5_table(path: Path) -> None:
    rows = np.rec.fromarrays(list(OURS.values()), names=list(OURS))
    with h5py.File(path, "w") as file:
        file.create_dataset("log", data=rows)


def parquet(path: Path) -> None:
    pq.write_table(pa.table(OURS), path)


def excel(path: Path) -> None:
    book = openpyxl.Workbook()
    book.active.append(["Bench 3, Monday"])
    book.active.append(["sensor", "mine"])
    book.active.append(list(OURS))
    for row in zip(*OURS.values(), strict=True):
        book.active.append([float(v) for v in row])
    book.save(path)


WRITERS: dict[str, Callable[[Path], None]] = {
    "a.h5": hdf5,
    "table.h5": hdf5_table,
    "a.parquet": parquet,
    "a.xlsx": excel,
    "a.npz": lambda path: np.savez_compressed(path, **OURS),
    "records.npy": lambda path: np.save(path, np.rec.fromarrays(list(OURS.values()), names=list(OURS))),
    "a.mat": lambda path: savemat(path, {name: v[:, None] for name, v in OURS.items()}, do_compression=True),
    "struct.mat": lambda path: savemat(path, {"log": {"imu": OURS}}),
}


@pytest.mark.parametrize("name", WRITERS)
def test_columns_with_our_names_are_read(name: str, tmp_path: Path) -> None:
    WRITERS[name](tmp_path / name)
    table = read_foreign(tmp_path / name, None)
    assert table.kind == "positions"
    digits = 1e-15 if name == "a.xlsx" else 0  # openpyxl writes 16 digits
    np.testing.assert_allclose(table.outputs, ACC, rtol=digits)
    np.testing.assert_allclose(table.column("t_s"), TIME, rtol=digits)
    if name in ("a.h5", "a.xlsx"):
        assert table.constants["sensor"] == "mine"


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_cut_file_is_refused_with_a_remedy(name: str, share: float, tmp_path: Path) -> None:
    path = tmp_path / name
    WRITERS[name](path)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(DataError, match=f"{name}.*copy it again"):
        read_foreign(path, None)


def matlab_73(path: Path) -> None:
    """As MATLAB's `save -v7.3` lays it out: HDF5 behind a block of 512 bytes, dimensions reversed, texts as numbers."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"acc": ACC, "time": TIME[:, None]}.items():
            file.create_dataset(name, data=values.T).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("who", data=np.array([[65], [66]], dtype=np.uint16)).attrs["MATLAB_class"] = np.bytes_(
            "char"
        )
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as file:
        file.write(head)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("7.3.mat", matlab_73),
        ("5.mat", lambda path: savemat(path, {"acc": ACC, "time": TIME, "who": "AB", "rate": 100.0})),
        ("lying.mat", lambda path: savemat(path, {"acc": ACC.T, "time": TIME})),
        ("a.npz", lambda path: np.savez(path, acc=ACC, time=TIME)),
        ("list.parquet", lambda path: pq.write_table(pa.table({"acc": ACC.tolist(), "time": TIME}), path)),
    ],
)
def test_an_array_of_three_columns_is_three_axes(name: str, write: Callable[[Path], None], tmp_path: Path) -> None:
    write(tmp_path / name)
    table = read_foreign(tmp_path / name, "positions", [*MAPPED, ColumnMapping("t_s", "time")])
    np.testing.assert_array_equal(table.outputs, ACC)
    np.testing.assert_array_equal(table.time_s, TIME)


def test_a_lone_array_has_numbered_columns(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([TIME, ACC]))
    sheet = open_sheet(tmp_path / "a.npy")
    assert (sheet.header, sheet.named) == (("1", "2", "3", "4"), False)
    numbered = [ColumnMapping(name, str(k)) for k, name in enumerate(AXES, start=2)]
    np.testing.assert_array_equal(read_foreign(tmp_path / "a.npy", None, numbered).outputs, ACC)


def test_units_of_datasets_and_times_of_parquet_are_used(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in OURS.items():
            file[name] = values if name == "t_s" else 9.81 * values / np.linalg.norm(ACC, axis=1)
            file[name].attrs["units"] = "ms" if name == "t_s" else "m/s^2"
    table = read_foreign(tmp_path / "a.h5", None)
    assert table.unit == "m/s2"
    np.testing.assert_allclose(table.time_s, TIME / 1000)
    stamps = pa.array((TIME * 1e6).astype("int64") + 10**15, pa.timestamp("us"))
    pq.write_table(pa.table({**OURS, "t_s": stamps}), tmp_path / "a.parquet")
    np.testing.assert_allclose(read_foreign(tmp_path / "a.parquet", None).time_s, TIME, atol=1e-9)


def test_the_accelerometer_is_proposed_and_the_others_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["magnetometer/mag"] = ACC[:30]
        file["inertial/acc"] = ACC
        file["battery/voltage"] = TIME
    sheet = open_sheet(path)
    assert sheet.topic == "inertial"
    assert "--topic: magnetometer, battery" in sheet.notes[0] or "--topic: battery, magnetometer" in sheet.notes[0]
    assert open_sheet(path, "magnetometer").header == ("mag_x", "mag_y", "mag_z")
    with pytest.raises(DataError, match='no topic "inertal"; did you mean "inertial"'):
        open_sheet(path, "inertal")
    with pytest.raises(DataError, match=r"rig import \S+ --topic inertial --kind positions --column"):
        read_foreign(path, None)


def test_two_sensors_in_one_file_have_to_be_chosen(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["imu0/acc"], file["imu1/acc"] = ACC, -ACC
    with pytest.raises(SeveralTopics, match="has 2 topics; choose one with --topic:") as error:
        open_sheet(tmp_path / "a.h5")
    assert (list(error.value.topics), error.value.proposed) == (["imu0", "imu1"], "imu0")
    np.testing.assert_array_equal(read_foreign(tmp_path / "a.h5", None, MAPPED, topic="imu1").outputs, -ACC)


def test_worksheets_of_a_workbook_are_topics(tmp_path: Path) -> None:
    excel(tmp_path / "a.xlsx")
    book = openpyxl.load_workbook(tmp_path / "a.xlsx")
    book.create_sheet("Notes").append(["nothing", "to", "see"])
    book.save(tmp_path / "a.xlsx")
    np.testing.assert_allclose(read_foreign(tmp_path / "a.xlsx", None).outputs, ACC, rtol=1e-15)
    with pytest.raises(DataError, match=r"header|numbers"):
        read_foreign(tmp_path / "a.xlsx", None, topic="Notes")


def test_a_value_that_is_missing_is_named_by_its_row(tmp_path: Path) -> None:
    holes = ACC[:, 0].copy()
    holes[16] = np.nan
    np.savez(tmp_path / "a.npz", **{**OURS, "ax": holes, "spare": np.full(N, np.nan), "humidity": holes})
    with pytest.raises(DataError, match=r'a\.npz, row 17, column "ax": nan is not a finite number'):
        read_foreign(tmp_path / "a.npz", None)
    np.savez(tmp_path / "a.npz", **OURS, spare=np.full(N, np.nan), humidity=holes)
    assert set(read_foreign(tmp_path / "a.npz", None).columns) == {*AXES, "t_s"}


@pytest.mark.parametrize("name", ["a.h5", "a.mat", "a.npz", "a.parquet"])
def test_values_beyond_the_limit_are_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    WRITERS[name](tmp_path / name)
    monkeypatch.setattr(topics, "LARGEST_BYTES", 100)
    with pytest.raises(DataError, match=f"{name}: holds .* GiB of values; the limit is"):
        read_foreign(tmp_path / name, None)


def test_zeros_that_unpack_beyond_measurements_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("acc", data=np.zeros((100_000, 3)), compression="gzip")
    monkeypatch.setattr(topics, "SMALL_BYTES", 1 << 16)
    with pytest.raises(DataError, match=r"a\.h5: the unpacked file is more than 50 times larger"):
        open_sheet(tmp_path / "a.h5")


@pytest.mark.parametrize(("name", "module"), [("a.h5", "h5py"), ("a.parquet", "pyarrow"), ("a.xlsx", "openpyxl")])
def test_a_missing_library_is_named_with_its_extra(
    name: str, module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    WRITERS[name](tmp_path / name)
    for each in (module, f"{module}.parquet"):
        monkeypatch.setitem(sys.modules, each, None)
    with pytest.raises(DataError, match=rf"the library {module} .* not installed.*\n\n +pip install 'inertial-rig\[fo"):
        read_foreign(tmp_path / name, None)


def test_what_no_library_reads_is_refused_with_a_remedy(tmp_path: Path) -> None:
    path = tmp_path / "a"
    for content, says in {
        b"PARE" + bytes(200): "encrypted Parquet",
        b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600): r"old Excel workbook \(.xls\), or one with a password",
        b"PK\x03\x04" + bytes(200): "cut zip archive",
        b"PK\x03\x04\x14\x00\x01\x00" + bytes(200): "is a zip archive with a password; unpack it",
        b"schema: rig.model/1\nname: mine\n": "is a model file and holds no data; give it with --model",
    }.items():
        path.write_bytes(content)
        with pytest.raises(DataError, match=says):
            open_sheet(path)
    np.save(tmp_path / "objects.npy", np.array([{}, None], dtype=object), allow_pickle=True)
    savemat(tmp_path / "old.mat", {"acc": ACC, "time": TIME}, format="4")
    with pytest.raises(DataError, match=r"old\.mat: is a MATLAB file of version 4; save it .* '-v7'"):
        open_sheet(tmp_path / "old.mat")
    with pytest.raises(DataError, match="holds Python objects, which are not read"):
        open_sheet(tmp_path / "objects.npy")
    np.save(tmp_path / "one.npy", np.float64(3))
    with pytest.raises(DataError, match="has no table of two or more rows"):
        open_sheet(tmp_path / "one.npy")
    (tmp_path / "a.csv").write_text("ax,ay,az\n1,2,3\n4,5,6\n")
    with pytest.raises(DataError, match='it is a text; leave out --topic "imu"'):
        open_sheet(tmp_path / "a.csv", "imu")


def test_the_csv_of_betaflight_decodes_to_an_import_of_the_accelerometer(tmp_path: Path) -> None:
    """The columns of `blackbox_decode`; its indices are axes."""
    names = ["loopIteration", "time (us)", *(f"{n}[{k}]" for n in ("axisP", "gyroADC", "accSmooth") for k in range(3))]
    rows = np.column_stack([np.arange(N), TIME * 1e6, ACC, ACC, np.round(2048 * ACC)])
    path = tmp_path / "btfl.csv"
    np.savetxt(path, rows, fmt="%.6g", delimiter=",", header=", ".join(names), comments="")
    with pytest.raises(DataError, match="--column t_s=time:us") as error:
        read_foreign(path, None)
    for axis, place in zip("xyz", range(3), strict=True):
        assert f"a{axis}=accSmooth[{place}]" in str(error.value)


def test_a_damaged_list_of_a_workbook_is_told(tmp_path: Path) -> None:
    """Of the files in the archive, at its end."""
    path = tmp_path / "a.xlsx"
    excel(path)
    path.write_bytes(path.read_bytes().replace(b"PK\x01\x02", b"PK\x01\x03", 1))
    with pytest.raises(DataError, match="is damaged or cut short"):
        open_sheet(path)


def element(kind: int, data: bytes) -> bytes:
    """An element of a MATLAB file."""
    return kind.to_bytes(4, "little") + len(data).to_bytes(4, "little") + data + bytes(-len(data) % 8)


def array(content: bytes, array_class: int = 6, dimensions: tuple[int, ...] = (1, 2)) -> bytes:
    lengths = b"".join(length.to_bytes(4, "little") for length in dimensions)
    return element(
        14, element(6, bytes([array_class, 0, 0, 0, 0, 0, 0, 0])) + element(5, lengths) + element(1, b"ax") + content
    )


TWO = element(9, np.ones(2).tobytes())
NAMED = element(5, (4).to_bytes(4, "little")) + element(1, b"ax\0\0")
SPOILT = {
    "a type that does not exist": (array(element(99, bytes(16))), "numbers of the unknown type 99"),
    "more numbers than there are": (array(TWO, dimensions=(1, 3)), "16 bytes for 3 numbers of the type 9"),
    "forty dimensions": (array(TWO, dimensions=(1,) * 40), "160 bytes of dimensions"),
    "a class that does not exist": (array(TWO, array_class=77), "an array of the unknown class 77"),
    "names without a length": (
        array(element(5, bytes(4)) + element(1, b"ax"), array_class=2), "2 bytes of field names of 0 bytes each"
    ),
    "structs without an end": (array(NAMED, array_class=2, dimensions=(9999, 9999)), "an array of 99980001 structs"),
    "a cut array": (array(TWO)[:-8], "it ends within an array"),
}  # fmt: skip


@pytest.mark.parametrize(("content", "reason"), SPOILT.values(), ids=SPOILT)
def test_a_matlab_file_that_would_end_the_process_is_refused(content: bytes, reason: str, tmp_path: Path) -> None:
    """SciPy takes what these files state as given, and reads other memory."""
    path = tmp_path / "log.mat"
    savemat(path, {"t_s": TIME})
    path.write_bytes(path.read_bytes() + content)
    with pytest.raises(DataError, match=f"log.mat: is damaged or cut short .*{reason}.*copy it again"):
        open_sheet(path)


def test_structs_cells_texts_and_sparse_matrices_of_matlab_are_sound(tmp_path: Path) -> None:
    others = {"who": "me", "list": np.array([1, "two"], dtype=object), "some": csc_array(np.eye(3)), "z": 1 + 2j}
    for compressed in (False, True):
        path = tmp_path / f"{compressed}.mat"
        savemat(path, {"imu": OURS | {"inner": others}, **others}, do_compression=compressed)
        assert {"ax", "ay", "az", "t_s"} <= set(open_sheet(path, "imu").header)
