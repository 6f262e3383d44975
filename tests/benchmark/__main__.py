"""`python -m tests.benchmark`: every figure, measured now on this machine, as one JSON document beside its target."""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from tests.benchmark.child import Ended, rig, subject

MOST_MB = 500
TARGET_S = {
    "sweep": 30.0,  # 518 poses x 5000 samples x 3 channels through the sockets
    "demo": 60.0,
    "help": 0.3,
    "effects": 0.3,
    "models": 0.3,
    "runs": 0.3,
    "compare, command: one defect": 1.0,
    "compare, command: the default rig": 1.0,
    "diagnose, command: one defect": 1.5,
    "diagnose, command: the default rig": 1.5,
    "fit of 20,000 poses": 3.0,
    "discover, command: the night": 15.0,
    "an hour at 1 kHz: mavlink_imu": 20.0,
    "an hour at 1 kHz: xsens_mti": 20.0,
    "diagnose, warm: one defect": 2.0,
    "diagnose, warm: the default rig": 2.0,
    "night": 60.0,  # the soak's procedure as a command: reversals, every check, results
    "soak": 60.0,  # 12 h x 4 channels x 1 kHz through the sockets into a record
}
LEAST_TIMES_FASTER = 4.0  # samples of the simulated rig, against the same content out of numpy and scipy
LEAST_TIMES_LESS = 1.8  # rig time of chosen poses, at equal worst standard error
NEAR_PLAN = 1.2  # factor within which the parameters' real errors are those of the plan
ALLAN_TARGETS = "10 and 4 times faster, 50 MB, variance 1.05 x that of every overlap, 1e-9 under a mean of 20000"
FORECAST_HELD = (0.90, 0.98)  # of 95 % bounds of a soak's final value, at each of eight times
MOST_READING = 2.0  # times the processor time of the library alone, for an import into the record
MOST_COPIES = 2.0  # times the file's size, in memory
MOST_OVERHEAD = 0.02  # of dwells and moves, in real time

Figure = dict[str, Any]


def main() -> None:
    machine = {"cores": os.cpu_count(), "python": platform.python_version(), "load_before": os.getloadavg()[0]}
    with TemporaryDirectory() as folder:
        document = {"schema": "rig.benchmark/1", "machine": machine, "figures": dict(_figures(Path(folder)))}
    json.dump(document, sys.stdout, indent=1)
    print()


def _figures(folder: Path) -> Iterator[tuple[str, Figure]]:
    """(name, figure), one after another; later ones use the run and the file of earlier ones."""
    yield "help", _commands("help", folder, 9, "--help")
    yield "sweep", _commands("sweep", folder, 2, "run", "sweep", "--unattended", "--json")
    run = json.loads(rig(folder, "runs", "--json").out)["runs"][0]["run"]
    file = str(folder / "one-defect.csv")
    subject(folder, "one_defect", file)
    for name, data in (("one defect", file), ("the default rig", run)):
        for word in ("compare", "diagnose"):
            whole = f"{word}, command: {name}"
            yield whole, _commands(whole, folder, 2, word, data)
        warm = f"diagnose, warm: {name}"
        yield warm, _inside(warm, subject(folder, "diagnosis", data))
    for word in ("effects", "models", "runs"):
        yield word, _commands(word, folder, 9, word)
    yield "fit of 20,000 poses", _inside("fit of 20,000 poses", subject(folder, "many_poses", run))
    yield "demo", _commands("demo", folder, 1, "demo")
    yield "samples of one dwell", _inside("", subject(folder, "samples"))
    yield "dwell means of 518 poses", _inside("", subject(folder, "dwells"))
    for driver in ("mavlink_imu", "xsens_mti"):
        name = f"an hour at 1 kHz: {driver}"
        yield name, _inside(name, subject(folder, "streams", driver))
    for form in ("csv", "ulg"):
        yield f"import of 200 MB: {form}", _import(folder, form)
    for threads in (1, os.cpu_count() or 1):
        yield f"linear algebra, {threads} threads", json.loads(subject(folder, "screening", threads=threads).out)
    yield "coverage of 95 % intervals", json.loads(subject(folder, "coverage", "200").out)
    yield "soak", _inside("soak", subject(folder, "soak", "12"))
    yield "night", _commands("night", folder, 1, "run", "soak", "--off-s", "0", "--unattended", "--json")
    yield "discover, command: the night", _commands("discover, command: the night", folder, 1, "discover", "last soak")
    yield "forecast of a soak", _forecast(folder)
    yield "generation", _generation(folder)
    yield "poses in real time", _overhead(folder)
    yield "chosen poses", _chosen_poses(folder)
    yield "live discovery", _live(folder)
    yield "Allan deviation", _allan(folder)
    yield "noise coefficients", _noise(folder)
    yield "positions by hand", json.loads(subject(folder, "hands", "100").out)
    yield "compensation in C", json.loads(subject(folder, "compensation").out)
    yield "100 kills", _inside("", subject(folder, "kills", "100"))
    yield "1,000 pushes from 8 rigs", json.loads(subject(folder, "push").out)
    yield "stops in real time", json.loads(subject(folder, "stops").out)
    yield "10 million inputs", json.loads(subject(folder, "fuzz").out)
    yield "every fault in every procedure", json.loads(subject(folder, "faults").out)


def _generation(folder: Path) -> Figure:
    said = json.loads(subject(folder, "generation").out)
    met = said["outputs"]["times_faster"] >= LEAST_TIMES_FASTER
    return {**said, "target_times_faster": LEAST_TIMES_FASTER, "met": met}


def _forecast(folder: Path) -> Figure:
    """Two kinds of fresh soaks, neither by the filters' own laws."""
    said = {
        kind: json.loads(subject(folder, "soak_forecast", kind, "2000", "2060").out) for kind in ("laws", "physics")
    }
    shares = [
        (laws["held"] + physics["held"]) / 2
        for laws, physics in zip(*(each["at"] for each in said.values()), strict=True)
    ]
    low, high = FORECAST_HELD
    return {**said, "held": shares, "target_held": FORECAST_HELD, "met": low <= min(shares) and max(shares) <= high}


def _overhead(folder: Path) -> Figure:
    said = json.loads(subject(folder, "poses", "20", "5").out)
    return {**said, "target_overhead": MOST_OVERHEAD, "met": said["overhead"] <= MOST_OVERHEAD}


def _chosen_poses(folder: Path) -> Figure:
    said = json.loads(subject(folder, "optimal", "30").out)
    real = said["truth_over_plan"].values()
    near = all(1 / NEAR_PLAN <= ratio <= NEAR_PLAN for ratio in real) and all(said["hidden_effects_named"].values())
    met = min(said["times_less_rig_time"].values()) >= LEAST_TIMES_LESS and near
    return {**said, "target_times_less": LEAST_TIMES_LESS, "target_truth": NEAR_PLAN, "met": met}


def _live(folder: Path) -> Figure:
    said = json.loads(subject(folder, "live", "2").out)
    met = said["live_right"] >= said["standard_right"] and said["times_less_rig_time"]["least"] > 1
    return {**said, "target": "as often right as the standard sweep, in less rig time", "met": met}


def _allan(folder: Path) -> Figure:
    """Twelve hours at 1 kHz, each program in a process of its own."""
    file = str(folder / "still.npy")
    subject(folder, "allan", "record", file)
    said = {how: json.loads(subject(folder, "allan", how, file).out) for how in ("octaves", "exact", "allantools")}
    said |= json.loads(subject(folder, "allan", "truth").out)
    ours, exact, theirs = (said[how]["processor_s"] for how in ("octaves", "exact", "allantools"))
    met = theirs >= 10 * ours and theirs >= 4 * exact and said["octaves"]["extra_mb"] <= 50
    met = met and said["variance_ratio"] <= 1.05 and said["error_under_mean"] <= 1e-9
    times = {"times_faster": theirs / ours, "exact_times_faster": theirs / exact}
    return {**said, **times, "targets": ALLAN_TARGETS, "met": met}


def _import(folder: Path, form: str) -> Figure:
    """A large file into the record, beside the library that reads it; processor time, each in a process of its own."""
    file = folder / f"rest.{form}"
    subject(folder, "reading", "write", str(file), "200")
    library = subject(folder, "reading", "read", str(file))
    ours = rig(folder, "import", str(file), "--kind", "still", "--json")
    rows = json.loads(ours.out)["rows"]
    times, peak_mb = ours.processor_s / library.processor_s, ours.peak_mb
    target_mb = MOST_COPIES * file.stat().st_size / 1e6 + MOST_MB
    file.unlink()
    met = times <= MOST_READING and peak_mb <= target_mb
    seconds = {"seconds": ours.seconds, "library_s": library.seconds, "processor_times": times}
    rounded = {key: float(f"{value:.4g}") for key, value in seconds.items()}
    return {
        **rounded,
        "rows": rows,
        "peak_mb": peak_mb,
        "target_times": MOST_READING,
        "target_mb": target_mb,
        "met": met,
    }


def _noise(folder: Path) -> Figure:
    said = json.loads(subject(folder, "noise", "100").out)
    most = {"white-noise": 1.15, "flicker-noise": 1.15, "rate-random-walk": 1.25}
    each = said["coefficients"]
    near = all(each[name]["rms_over_bound"] <= most[name] and 0.9 <= each[name]["coverage"] <= 0.98 for name in most)
    better = each["white-noise"]["times_better"] >= 4 and each["flicker-noise"]["times_better"] >= 2
    return {**said, "target_rms_over_bound": most, "target_ms": 20, "met": near and better and said["median_ms"] <= 20}


def _commands(name: str, folder: Path, repeats: int, *words: str) -> Figure:
    """A whole command, each time in a process of its own."""
    ended = [rig(folder, *words) for _ in range(repeats)]
    processor_s = float(f"{median(e.processor_s for e in ended):.4g}")
    return {**_figure(name, [e.seconds for e in ended], max(e.peak_mb for e in ended)), "processor_s": processor_s}


def _inside(name: str, ended: Ended) -> Figure:
    """What a subject measured inside its own warm process, and that process's memory."""
    said = json.loads(ended.out)
    return {**_figure(name, said.pop("seconds"), ended.peak_mb), **said}


def _figure(name: str, seconds: list[float], peak_mb: float) -> Figure:
    figure = {"min_s": min(seconds), "median_s": median(seconds), "repeats": len(seconds), "peak_mb": peak_mb}
    rounded = {key: float(f"{value:.4g}") for key, value in figure.items()}
    target_s = TARGET_S.get(name)
    met = peak_mb <= MOST_MB and (target_s is None or median(seconds) <= target_s)
    return {**rounded, "target_s": target_s, "target_mb": MOST_MB, "met": met}


if __name__ == "__main__":
    main()
