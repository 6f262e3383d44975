"""Whether slow noise is flicker of any size: then random walks and curves over time follow it, and no cause.

A search starts with little slow noise, because more of it takes up parts of causes. Flicker beyond that limit is then
followed by what can follow anything over time. Its spectrum tells it from a random walk: flicker has more power at high
frequencies for the same power at low ones, so that all frequencies are compared, and a straight drift stands beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from calibrations.free_forms.places_in_time import slow_noise
from calibrations.free_forms.reml import estimate, gram

if TYPE_CHECKING:
    from calibrations.free_forms.search import SearchResult

LINE = "time-bias/line"
LIKELIER = 8.0  # of -2 log likelihood: flicker so strong is rare
BEGIN = 0.1  # noise floors: standard deviation from which the estimate of the flicker starts
ANY = 1e8  # a variance that is no limit


def is_flicker(result: SearchResult, limit: float) -> bool:
    """Whether flicker of any size and a straight drift are clearly likelier than the random walks and curves that act.

    limit  of the variance of slow noise in the search
    """
    following = {name for name in result.active if _follows_time(result, name)}
    if not following:
        return False
    data, floor = result.data, float(np.sqrt(np.mean(result.white**2)))
    noise = slow_noise(data, all_frequencies=True)
    columns, blocks = [result.columns[:, :-1]], {n: b for n, b in result.gram.blocks.items() if n not in _noise(result)}
    start = len(result.gram.with_data)
    for component in noise:
        extra_columns = component.jacobian(result.state) / result.white[:, :, None]
        blocks[component.name] = slice(start, start + extra_columns.shape[2])
        start += extra_columns.shape[2]
        columns.append(extra_columns.reshape(-1, extra_columns.shape[2]))
    scales = dict(result.gram.scales) | {component.name: 1.0 for component in noise}
    base = result.columns.shape[1] - 1 - len(result.gram.with_data)
    g = gram(np.hstack([*columns, result.columns[:, -1:]]), blocks, scales, base)
    begin = {component.name: (BEGIN * floor) ** 2 for component in noise}
    acting_variances = {name: v for name, v in result.sizes.variances.items() if name not in begin}
    drift = {LINE: acting_variances.get(LINE, 1.0)} if LINE in blocks else {}
    other_variances: Mapping[str, float] = (
        {n: v for n, v in acting_variances.items() if n not in following} | drift | begin
    )
    limited = estimate(g, acting_variances | begin, dict.fromkeys(begin, limit))
    return estimate(g, other_variances, dict.fromkeys(other_variances, ANY)).deviance < limited.deviance - LIKELIER


def _noise(result: SearchResult) -> set[str]:
    return {component.name for component in result.components if component.noise}


def _follows_time(result: SearchResult, name: str) -> bool:
    """Whether a component is a bias over time that can have almost any form."""
    component = result.component(name)
    return component.place == "time-bias" and component.form is not None and name != LINE
