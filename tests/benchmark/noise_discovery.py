"""Discovery of hidden noise processes, record by record: `python -m tests.benchmark.noise_discovery 40`.

Every process and pairs of them, from mechanisms that share nothing with the fit; clean records, for false alarms, also
beside a complete model; and what is no noise process. `right`: the processes are named and no other; `named`: they are
among those named or their alternatives; `false`: records in which another process is named.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.loop import discover
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.noise.record import Samples, reduce_record
from tests.calibrations.hidden_noise import OTHERS, RATE_HZ, RECORDS, Array

CLEAN = 10  # times as many clean records


def found(samples: Array, model: Model) -> Discovery:
    return discover(reduce_record([Samples("x", [samples], RATE_HZ, "V")], "made"), model)


def figures(seeds: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """(kind of record, figures), one after another."""
    for name, (make, truth) in RECORDS.items():
        began = time.process_time()
        count = seeds if truth else CLEAN * seeds
        answers = [found(make(np.random.default_rng(seed)), read_model("still")) for seed in range(count)]
        yield name, {**_score(answers, truth), "seconds": (time.process_time() - began) / count}
    for name in ("traps", "walk", "telegraph", "hum"):
        make, truth = RECORDS[name]
        model = read_model("still")
        for effect in truth:
            model = model.with_effect(catalogue()[effect])
        answers = [found(make(np.random.default_rng(1000 + seed)), model) for seed in range(seeds)]
        yield f"{name}, complete model", _score(answers, frozenset())
    for name, (make, told) in OTHERS.items():
        answers = [found(make(np.random.default_rng(seed)), read_model("still")) for seed in range(seeds)]
        right = sum(a.verdict == "unexplained" and told in (a.residual_structure or "") for a in answers)
        yield name, {"records": seeds, "told": right / seeds}


def _score(answers: list[Discovery], truth: frozenset[str]) -> dict[str, Any]:
    right = sum(set(a.causes) == truth and a.verdict in ("adequate", "ambiguous") for a in answers)
    named = sum(all(_is_named(cause, a) for cause in truth) for a in answers)
    return {
        "records": len(answers),
        "right": right / len(answers),
        "named": named / len(answers),
        "false": sum(bool(set(a.causes) - truth) for a in answers),
        "unexplained": sum(a.verdict == "unexplained" for a in answers),
        "ambiguous": sum(a.verdict == "ambiguous" for a in answers),
    }


def _is_named(cause: str, answer: Discovery) -> bool:
    return cause in answer.causes or any(cause in rivals for rivals in answer.alternatives.values())


def main() -> None:
    said = {}
    for name, figure in figures(int(sys.argv[1]) if len(sys.argv) > 1 else 40):
        print(name, figure, file=sys.stderr, flush=True)
        said[name] = figure
    print(json.dumps({"schema": "rig.noise-discovery/1", "records": said}, indent=1))


if __name__ == "__main__":
    main()
