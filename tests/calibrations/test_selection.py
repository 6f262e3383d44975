"""The selection of components that act."""

import numpy as np

from calibrations.free_forms.components import Component
from calibrations.free_forms.reml import estimate, gram
from calibrations.free_forms.selection import pools_of, select


def test_two_components_that_cancel_each_other_do_not_keep_a_third_one_out() -> None:
    """Two of nearly the same columns have coefficients far larger than the signal; the third one still acts."""
    random = np.random.default_rng(5)
    shared, difference, third = np.linalg.qr(random.standard_normal((300, 3)))[0].T * np.sqrt(300)
    data = 20 * difference + 30 * third + random.standard_normal(300)
    X = np.column_stack([np.ones(300), shared, shared + 0.05 * difference, third, data])
    names = ("first", "second", "third")
    blocks = {name: slice(k, k + 1) for k, name in enumerate(names)}
    g = gram(X, blocks, dict.fromkeys(names, 1.0), 1)
    components = [Component(name, name, "output") for name in names]
    most = dict.fromkeys(names, 1e9)
    cancelled = estimate(g, {"first": 1e5, "second": 1e5}, most)
    assert abs(cancelled.of(g, "first")[0]) > 100
    selected = select(g, cancelled, components, pools_of(components, catalogue_first=False), most, 16.0, last=True)
    assert set(selected.variances) == set(names)
