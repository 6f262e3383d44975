"""Settings that no instrument can have are refused when they are written, not when they are used."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.labjack_t7 import driver as labjack_t7
from drivers.manual_stage import driver as manual_stage
from drivers.omega_cn7500 import driver as omega_cn7500
from drivers.oriental_az import driver as oriental_az
from drivers.pi_e727 import driver as pi_e727


@pytest.mark.parametrize(
    ("driver", "settings", "words"),
    [
        (oriental_az, {"speed_deg_s": 0.0, "settle_deg": -1.0}, "speed_deg_s, settle_deg must be positive"),
        (oriental_az, {"steps_per_turn": 0}, "steps_per_turn must be positive"),
        (oriental_az, {"acceleration_deg_s2": float("nan")}, "acceleration_deg_s2 must be positive"),
        (oriental_az, {"limits_deg": (10.0, -10.0)}, "limits_deg must be the lower limit, then the upper one"),
        (manual_stage, {"resolution_deg": 0.0, "seconds_per_move": float("inf")}, "resolution_deg, seconds_per_move"),
        (manual_stage, {"tolerance_deg": 0.01}, "tolerance_deg must not be less than resolution_deg"),
        (manual_stage, {"limits_deg": (1.0, 1.0)}, "limits_deg must be the lower limit, then the upper one"),
        (omega_cn7500, {"limits_c": (50.0, 50.0)}, "limits_c must be the lower limit, then the upper one"),
        (omega_cn7500, {"overshoot_k": -1.0}, "overshoot_k must not be negative"),
        (omega_cn7500, {"stale_s": 0.0}, "stale_s must be positive"),
        (pi_e727, {"axes": {}}, "axes must name the controller's axes, each once, and at least one"),
        (pi_e727, {"axes": {"x": "1", "y": "1"}}, "each once"),
        (pi_e727, {"limits_um": (90.0, 10.0)}, "limits_um must be the lower limit, then the upper one"),
        (pi_e727, {"settle_um": 0.0, "record_hz": -1.0}, "settle_um, record_hz must be positive"),
        (labjack_t7, {"channels": {}}, "and at least one"),
        (labjack_t7, {"channels": {"vx": 14}}, "channels must name analog inputs, 0 to 13"),
        (labjack_t7, {"on_request": {"mx": 14}}, "channels must name analog inputs, 0 to 13"),
        (labjack_t7, {"on_request": {"vx": 4}}, "vx is a channel already; remove it from on_request"),
        (
            oriental_az,
            {"own_limits": True, "limits_deg": (-float("inf"), float("inf"))},
            "with own_limits, give both numbers of limits_deg",
        ),
        (labjack_t7, {"rate_hz": 40e3}, "at most 100000 samples a second"),
        (labjack_t7, {"rate_hz": 0.0}, "rate_hz"),
        (labjack_t7, {"range_v": 5.0}, "range_v must be one of 10, 1, 0.1, 0.01 V"),
        (labjack_t7, {"power_dio": 23}, "power_dio must be a digital line, 0 to 22"),
    ],
)
def test_refused_with_the_name_of_the_setting(driver: Any, settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        driver.Settings(**settings)
