"""A run's still record as a stream, straight from the samples that were kept: no block is read twice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrations.noise.samples import hidden_step
from calibrations.table import Array
from procedures.noise_floor import STILL
from procedures.soak import HOLD
from rig.errors import RecordError
from rig.record.measured import Measured
from rig.record.values import Kept
from rig.services.data import FOLLOWED
from rig.services.stream import LATE, Stream, agreed, channel_of

UPRIGHT = 0.999  # g: a pose that is as good as along gravity


def of_run(measured: Measured, channel: str | None, rate_hz: float | None) -> Stream:
    first = next((kept for kept in measured.kept() if _is_still(kept)), None)
    if first is None:
        raise RecordError(
            f"run {measured.name} holds no still record; `rig run noise-floor` or `rig run soak` makes one"
        )
    names = first.samples.channels
    chosen = channel_of(tuple(names), (channel or "").removesuffix("_v") or None, f"run {measured.name}")
    rate = agreed(first.samples.rate_hz, rate_hz or 0.0, f"run {measured.name}")
    corner = float(measured.constants.get("filter_corner_hz", np.inf))
    outputs = tuple(name for name in names if name in ("vx", "vy", "vz") and name != chosen)
    found = Stream(
        measured.name, chosen, rate, "V", iter(()), corner if chosen in ("vx", "vy", "vz") else np.inf, outputs
    )
    found.blocks, found.constants = _still_blocks(measured, found), measured.constants
    return found


def _is_still(kept: Kept) -> bool:
    return kept.pose.path.split(" ")[0] in (STILL, HOLD)


def _still_blocks(measured: Measured, into: Stream) -> Iterator[NDArray[Any]]:
    """Blocks of the still record one after the other; what else is met on the way is noted in `into`."""
    next_s = None
    for kept in measured.kept():
        samples = kept.samples
        if into.channel not in samples.channels:
            continue
        volts = samples.volts[:, samples.channels.index(into.channel)]
        if not _is_still(kept):
            _note_upright(kept, volts, into)
            continue
        if next_s is not None and abs(samples.start_s - next_s) > LATE / into.rate_hz:
            into.closed.append((next_s, samples.start_s - next_s))
        next_s = samples.start_s + len(volts) / into.rate_hz
        if not into.logged:
            into.coarse |= coarse(kept)
        for name, values in _beside(kept):
            into.logged.setdefault(name, []).extend(values)
        yield volts


def _beside(kept: Kept) -> Iterator[tuple[str, list[Array]]]:
    """Temperature of a block, and supply, as means of a second each: in blocks that take no room."""
    samples, n = kept.samples, len(kept.samples.volts)
    temperature, supply = FOLLOWED
    if kept.temperature_c is not None:
        yield temperature, [np.broadcast_to(kept.temperature_c, n)]
    if (channel := supply.removesuffix("_v")) in samples.channels:
        volts = samples.volts[:, samples.channels.index(channel)]
        pieces = np.array_split(volts, max(1, round(n / samples.rate_hz)))
        yield supply, [np.broadcast_to(piece.mean(), len(piece)) for piece in pieces]


def coarse(kept: Kept) -> dict[str, float]:
    """The steps of the supply's readings, where its noise does not smooth them in means."""
    channel = FOLLOWED[1].removesuffix("_v")
    if channel not in kept.samples.channels:
        return {}
    step = hidden_step(kept.samples.volts[:, kept.samples.channels.index(channel)])
    return {} if step is None else {FOLLOWED[1]: step}


def _note_upright(kept: Kept, volts: Array, into: Stream) -> None:
    """The mean output of the channel's axis along gravity."""
    alpha, beta = np.radians(kept.pose.alpha_deg), np.radians(kept.pose.beta_deg)
    along: Mapping[str, float] = {"vx": np.sin(alpha) * np.cos(beta), "vy": np.sin(alpha) * np.sin(beta)}
    g = along.get(into.channel, 0.0)
    if abs(g) > UPRIGHT and kept.pose.flip == 0 and kept.pose.mount_deg == 0:
        into.upright_v.setdefault(round(g), float(volts.mean()))
