"""Chosen poses beside the standard sweep: rig time by plan, and parameters' errors in truth, over simulated rigs.

In truth: the rms over rigs of what the fit misses, chosen poses over sweep, beside the ratio that the plan foretells;
how often the check on unseen poses fails a model that is right, and how often what is hidden is named.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence

import numpy as np

from calibrations.discovery.check_poses import MARK, judge_check_poses
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.loop import diagnose
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.catalogue import find
from procedures.session import Pose
from procedures.settings import parse
from rig.bench import read_bench
from rig.planning.optimal import Optimal, optimal
from rig.planning.sweep_range import JudgedPlan
from tests.hidden import rigs
from tests.hidden.defects import DEFECTS

STAGES = {"speed_deg_s": 30.0, "acceleration_deg_s2": 60.0}  # of the embedded bench
HIDDEN = {  # mechanism -> effects that describe it
    "plate mismatch": {"quadratic-nonlinearity", "adc-nonlinearity"},
    "hardening springs": {"cubic-nonlinearity"},
    "foreshortened beams": {"cross-axis-bias"},
    "foreshortened by sag": {"z-axis-bias"},
    "package turned": {"axis-misalignment"},
    "slipping contacts": {"hysteresis"},
    "gear play": {"stage-backlash"},
    "softening by heat": {"temperature-scale"},
}
TIMES_NOISE = 10


def chosen(model: Model, **given: str) -> Optimal:
    sweep = find("sweep")
    return optimal(read_bench(), sweep, parse(sweep, given), model)


def measured(config: WorldConfig, seed: int, poses: Sequence[Pose], dwell_s: float, noise_free: bool = False) -> Table:
    """The table of a run of `poses` on a simulated rig."""
    alpha, beta, direction = ([getattr(p, name) for p in poses] for name in ("alpha_deg", "beta_deg", "direction"))
    world = World(config.changed({"spread": {"imperfection_fraction": 0.0}}), seed)
    columns = world.dwell_mean(alpha, beta, direction=direction, noise_free=noise_free, dwell_s=dwell_s, **STAGES)
    constants = {"sample_rate_hz": 1000.0, "filter_corner_hz": 15.07}
    return Table.from_columns("poses", columns, constants, "simulated", {"path": tuple(p.path for p in poses)})


def misses(model: Model, judged: JudgedPlan, seeds: int) -> Array:
    """Rms error of each parameter over rigs, shape (p,); check poses are kept out of the fit."""
    every_third = np.arange(0, 518, 3)
    errors = []
    for seed in range(seeds):
        alpha, beta, direction = rigs.sweep()
        still = World(rigs.IDEAL.changed({"spread": {"imperfection_fraction": 0.0}}), seed)
        exact = still.dwell_mean(alpha, beta, direction=direction, noise_free=True)
        truth = fit(model, Table.from_columns("poses", exact).rows(every_third)).theta
        table = measured(rigs.IDEAL, seed, judged.poses, judged.dwell_s)
        seen = np.array([not path.startswith(MARK) for path in table.labels["path"]])
        errors.append(fit(model, table.rows(seen)).theta - truth)
    return np.asarray(np.sqrt(np.mean(np.square(errors), axis=0)))


def in_truth(found: Optimal, model: Model, seeds: int) -> float:
    """What chosen poses make of the errors in truth over what the plan foretells: geometric mean over parameters."""
    real = misses(model, found.equal, seeds) / misses(model, found.standard, seeds)
    return float(np.exp(np.mean(np.log(real / (found.equal.errors / found.standard.errors)))))


def false_alarms(found: Optimal, model: Model, seeds: int) -> int:
    """Rigs with nothing missing that the check poses fail."""
    tables = (measured(rigs.IDEAL, seed, found.equal.poses, found.equal.dwell_s) for seed in range(seeds))
    return sum(
        check is not None and not check.passed for check in (judge_check_poses(model, table) for table in tables)
    )


def named(found: Optimal, model: Model) -> dict[str, bool]:
    """Whether what is hidden is named first, by mechanism."""
    said = {}
    for mechanism, effects in HIDDEN.items():
        config = rigs.scaled(DEFECTS[mechanism], rigs.IDEAL, 1, TIMES_NOISE * rigs.noise_floor_v())
        table = measured(config, 1, found.equal.poses, found.equal.dwell_s)
        said[mechanism] = next(iter(diagnose(table, model, catalogue()).missing), None) in effects
    return said


def main(seeds: str) -> None:
    models = {name: read_model(name) for name in ("linear", "physical")}
    plans = {f"{name}, {paths}": chosen(models[name], paths=paths) for name in models for paths in ("grid", "ang")}
    linear = plans["linear, grid"]
    document = {
        "times_less_rig_time": {name: round(found.times_less, 2) for name, found in plans.items()},
        "no_parameter_worse": {name: round(found.times_less_for_all, 2) for name, found in plans.items()},
        "truth_over_plan": {
            name: round(in_truth(plans[f"{name}, grid"], model, int(seeds)), 3) for name, model in models.items()
        },
        "rigs": int(seeds),
        "false_alarms_of_the_check": false_alarms(linear, models["linear"], int(seeds)),
        "hidden_effects_named": named(linear, models["linear"]),
    }
    print(json.dumps(document))


if __name__ == "__main__":
    main(*sys.argv[1:])
