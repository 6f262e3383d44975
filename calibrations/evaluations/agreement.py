"""Two calibrations of one quantity side by side: their difference, and whether it is more than both are uncertain by.

    E_n = (a - b) / sqrt(U_a^2 + U_b^2)        they agree where |E_n| <= 1

Source  ISO/IEC 17043:2023 and ISO 13528:2022, 9.7 (E_n).
"""

from __future__ import annotations

from dataclasses import dataclass

COVERAGE = 2.0


@dataclass(frozen=True)
class Agreement:
    """`difference` a - b, its expanded uncertainty (k = 2), and E_n."""

    a: float
    b: float
    difference: float
    expanded: float

    @property
    def e_n(self) -> float:
        return self.difference / self.expanded if self.expanded > 0 else 0.0

    @property
    def agrees(self) -> bool:
        return abs(self.e_n) <= 1


def agreement(a: tuple[float, float], b: tuple[float, float]) -> Agreement:
    """Of two values with standard uncertainties, taken as independent."""
    return Agreement(a[0], b[0], a[0] - b[0], COVERAGE * (a[1] ** 2 + b[1] ** 2) ** 0.5)
