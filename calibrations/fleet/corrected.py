"""A table with its stage's errors taken out: where the sensor truly stood, as far as the fleet knows it.

The direction of gravity is all that an orientation is to a still sensor, so any error of pose, a tilted base too, is a
change of alpha and beta.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from calibrations.chain import nominal_pose, specific_force
from calibrations.effect import Effect
from calibrations.table import Table

Values = Mapping[str, Mapping[str, float]]  # effect -> parameter -> value


def corrected(table: Table, errors: Values, effects: Mapping[str, Effect]) -> Table:
    """`table` at the poses that its stages truly took, given the parameters of effects on the pose; any other as is."""
    if not errors or table.kind != "poses":
        return table
    table = table.in_order()
    pose = nominal_pose(table)
    for name, values in errors.items():
        effect = effects[name]
        if effect.pose is not None:
            given = {p.name: np.asarray(values.get(p.name, 0.0)) for p in effect.parameters}
            pose = effect.pose(pose, table, given)
    down = specific_force(replace(pose, mount=np.zeros(table.n), flip=np.zeros(table.n)))
    columns = dict(table.columns)
    columns["alpha_deg"] = np.degrees(np.arctan2(np.hypot(down[:, 0], down[:, 1]), down[:, 2]))
    columns["beta_deg"] = np.degrees(np.arctan2(down[:, 1], down[:, 0]))
    return replace(table, columns=MappingProxyType(columns))
