"""A simulated rig that carries experiments out without wires: dwell means of a world that goes on from run to run."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np

from calibrations.design.experiment import Experiment
from calibrations.joined import join_tables
from calibrations.table import Table
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.catalogue import find
from procedures.session import Pose
from procedures.settings import parse
from rig.bench import Bench
from rig.planning.plan import plan

CONSTANTS = {"sample_rate_hz": 1000.0, "filter_corner_hz": 15.07}
OFF_C = 0.0  # an oven that only heats does nothing


class QuickRig:
    """`measure` runs the poses that the plan of an experiment holds, on the world itself."""

    def __init__(self, config: WorldConfig, seed: int, bench: Bench) -> None:
        # No scatter of the defect itself: its size is the one that was chosen.
        self._world = World(config.changed({"spread": {"imperfection_fraction": 0.0}}), seed)
        self._bench = bench
        self.tables: list[Table] = []

    def measure(self, experiment: Experiment) -> tuple[str, Table]:
        """The run's name, and all data so far."""
        procedure = find(experiment.procedure)
        settings = parse(procedure, experiment.settings)
        held = [held.pose for held in plan(self._bench, procedure, settings).held]
        parts = [self._held(list(poses), path, settings) for path, poses in groupby(held, key=lambda pose: pose.path)]
        self._world.oven_set(OFF_C, False)
        name = f"run {len(self.tables) + 1}"
        columns = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        self.tables.append(Table.from_columns("poses", columns, CONSTANTS, name))
        return name, join_tables(self.tables)

    def _held(self, poses: list[Pose], path: str, settings: dict[str, Any]) -> dict[str, Any]:
        """Dwell means of poses of one path, after the soak that begins a step of temperature."""
        if "temperatures_c" in settings:
            self._world.oven_set(float(path.split()[1]), True)
            self._world.advance(self._world.now_s + settings["soak_s"])
        elif settings.get("oven_c"):
            self._world.oven_set(settings["oven_c"], True)
        angles = {
            name: np.array([getattr(pose, name) for pose in poses]) for name in ("direction", "mount_deg", "flip")
        }
        alpha, beta = (np.array([getattr(pose, name) for pose in poses]) for name in ("alpha_deg", "beta_deg"))
        dwell_s = settings["block_s" if path.startswith("hold") else "dwell_s"]
        return self._world.dwell_mean(alpha, beta, **angles, dwell_s=dwell_s, settle_s=settings["settle_s"])
