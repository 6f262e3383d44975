from __future__ import annotations

import numpy as np
import pytest

from drivers.world.config import WorldConfig

SILENT = {"white_v": 0.0, "flicker_v": 0.0}


@pytest.fixture
def silent() -> WorldConfig:
    """The sensor of Ang without any noise."""
    return WorldConfig.adxl203().changed({"noise": SILENT, "converter": {"noise_v": 0.0}})


@pytest.fixture
def turn_deg() -> np.ndarray:
    """Beta once round and back."""
    up = np.arange(0.0, 361.0, 10.0)
    return np.concatenate([up, up[::-1]])
