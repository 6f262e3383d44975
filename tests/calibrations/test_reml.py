"""Sizes of components by restricted likelihood, and the components that it selects."""

import numpy as np
import pytest

from calibrations.free_forms.components import Component
from calibrations.free_forms.reml import estimate, gains, gram, scale_components
from calibrations.free_forms.selection import pools_of, select


@pytest.mark.parametrize("beyond", [-50.0, -0.1, 0.1, 50.0])
def test_sizes_that_end_early_decide_as_those_that_do_not(beyond: float) -> None:
    rng = np.random.default_rng(4)
    X = rng.standard_normal((200, 13))
    X[:, 12] += X[:, 2:12] @ np.repeat([1.0, 0.03], 5)
    g = gram(X, {"large": slice(0, 5), "small": slice(5, 10)}, {"large": 1.0, "small": 1.0}, 2)
    variances = {"large": 1e-3, "small": 1e-1}
    whole = estimate(g, variances, {})
    early = estimate(g, variances, {}, target=whole.deviance + beyond)
    assert (early.deviance <= whole.deviance + beyond) is (beyond > 0)


def test_gains_are_the_greatest_falls_of_the_deviance() -> None:
    rng = np.random.default_rng(5)
    X = rng.standard_normal((120, 16))
    X[:, 15] += X[:, 2:15] @ np.repeat([1.0, 0.4, 0.02], [5, 5, 3])
    blocks = {"acting": slice(0, 5), "strong": slice(5, 10), "weak": slice(10, 13)}
    g = gram(X, blocks, dict.fromkeys(blocks, 1.0), 2)
    acting = estimate(g, {"acting": 1.0}, {})
    for name, (gained, variance) in gains(g, acting, ["strong", "weak"]).items():
        falls = [
            acting.deviance - estimate(g, dict(acting.variances) | {name: v}, {}, rounds=0).deviance
            for v in variance * np.geomspace(0.5, 2.0, 9)
        ]
        assert gained == pytest.approx(falls[4], abs=1e-9)
        assert gained > max(falls) - 0.05


def test_a_component_that_is_in_the_base_gains_nothing() -> None:
    X = np.random.default_rng(7).standard_normal((50, 7))
    X[:, 2:4] = X[:, :2]
    g = gram(X, {"in the base": slice(0, 2), "acting": slice(2, 4)}, {"in the base": 1.0, "acting": 1.0}, 2)
    gained, _ = gains(g, estimate(g, {"acting": 1.0}, {}), ["in the base"])["in the base"]
    assert gained == 0.0


def test_the_inverse_of_many_products_is_their_inverse() -> None:
    rng = np.random.default_rng(6)
    X = rng.standard_normal((300, 203))
    g = gram(X, {"first": slice(0, 120), "second": slice(120, 200)}, {"first": 1.0, "second": 1.0}, 2)
    variances = {"first": 0.01, "second": 2.0}
    fitted = estimate(g, variances, {}, rounds=0)
    H = g.products + np.diag(1 / np.repeat([0.01, 2.0], [120, 80]))
    np.testing.assert_allclose(fitted.inverse, np.linalg.inv(H), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(fitted.coefficients, np.linalg.solve(H, g.with_data), rtol=1e-9, atol=1e-12)


def test_a_base_column_of_rounding_takes_up_nothing() -> None:
    rng = np.random.default_rng(1)
    X = rng.standard_normal((50, 4))  # two columns of the base, one of a component, the data
    X[:, 1] *= 1e-14
    g = gram(X, {"curve": slice(0, 1)}, {"curve": 1.0}, 2)
    alone = gram(X[:, [0, 2, 3]], {"curve": slice(0, 1)}, {"curve": 1.0}, 1)
    assert (g.base_rank, g.base_inverse[1, 1]) == (1, 0.0)
    assert g.squares == pytest.approx(alone.squares)


def test_products_by_channel_are_those_of_all_rows() -> None:
    X = np.random.default_rng(8).standard_normal((80, 9))
    X[:40, 3:5], X[40:, 5:7] = 0.0, 0.0  # columns of one channel each
    blocks = {"second": slice(0, 3), "first": slice(3, 6)}
    by_channel, at_once = (gram(X, blocks, dict.fromkeys(blocks, 1.0), 2, channels) for channels in (2, 1))
    np.testing.assert_allclose(by_channel.products, at_once.products, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(by_channel.with_data, at_once.with_data, rtol=1e-12, atol=1e-12)


def test_scaled_components_keep_their_squares_beside_the_base() -> None:
    X = np.random.default_rng(9).standard_normal((60, 8)) * np.geomspace(1e-3, 1e3, 8)
    blocks = {"small": slice(0, 2), "large": slice(2, 5)}
    scaled_X, scaled = scale_components(X, gram(X, blocks, {"small": 2.0, "large": 1.0}, 2))
    again = gram(scaled_X, blocks, scaled.scales, 2)
    np.testing.assert_allclose(scaled.products, again.products, rtol=1e-9)
    np.testing.assert_allclose(scaled.with_data, again.with_data, rtol=1e-9)
    for block in blocks.values():
        squares = float(np.sum(X[:, 2:][:, block] ** 2))
        assert np.trace(scaled.products[block, block]) == pytest.approx(squares)


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
