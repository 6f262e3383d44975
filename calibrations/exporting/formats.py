"""All formats of other programs by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from calibrations.exporting import autopilots, noise_files, robotics
from calibrations.exporting.noise_files import ExportSettings
from calibrations.exporting.simulated import ExportedFile, simulate
from calibrations.model import Model

AUTOPILOTS = {"px4": autopilots.px4, "ardupilot": autopilots.ardupilot}
MATRICES = {"imu_calib": robotics.imu_calib, "imu_tk": robotics.imu_tk, "imucal": robotics.imucal}
NOISES = {"kalibr": noise_files.kalibr, "openvins": noise_files.openvins}


def export_model(
    models: Sequence[Model],
    form: str,
    comment: str,
    slot: autopilots.Slot,
    settings: ExportSettings,
    reach: float | None = None,
    spans: Mapping[str, tuple[float, float]] | None = None,
) -> ExportedFile:
    """The models of one unit's sensors as a file of `form`, a name in AUTOPILOTS, MATRICES or NOISES.

    `reach` and `spans`: ranges of the input, and of temperature and others, over which errors are computed. Raises
    ModelError if the format cannot hold such a sensor.
    """
    if form in NOISES:
        return NOISES[form](models, settings, comment)
    sensors = [simulate(model, reach, spans) for model in models]
    if form in AUTOPILOTS:
        return AUTOPILOTS[form](sensors, slot)
    return MATRICES[form](sensors, comment)
