"""Numbers, units and times as people read them, in a terminal and in a page."""

from __future__ import annotations

import re

import pytest

from calibrations.text import (
    concise_in_prefix,
    estimate_in_prefix,
    estimate_text,
    expand_uncertainty,
    few_digits,
    interval,
    join_words,
    milli_amount,
    parameter_words,
    positive_text,
    probability,
    rounded,
    typeset,
    unit,
    value_text,
    with_times,
)


def test_names_are_joined_by_commas_and_and() -> None:
    assert join_words(["a", "b", "c"]) == "a, b and c"


@pytest.mark.parametrize(
    ("key", "shown"),
    [
        ("axis-nonorthogonality.xy", "the nonorthogonality of x and y"),
        ("gyro-scale-factor.x", "the gyroscope scale factor of x"),
        ("field-strength", "the field strength"),
        ("soft-iron.xx", "the soft iron of x"),
        ("stage-eccentricity.sine", "the stage eccentricity sine"),
    ],
)
def test_a_parameter_has_words(key: str, shown: str) -> None:
    assert parameter_words(key) == shown


@pytest.mark.parametrize(
    ("value", "std", "shown"),
    [
        (2.500134567, 0.000241, "2.50013(24)"),
        (2.506215, 2.34e-6, "2.5062150(23)"),
        (-1.234e-8, 1.1e-9, "−1.23(11) × 10⁻⁸"),
        (1.0, 0.0996, "1.00(10)"),
        (33123.8, 123.4, "3.312(12) × 10⁴"),
        (0.0, 0.5, "0.00(50)"),
        (0.02, None, "0.02"),
    ],
)
def test_values_are_rounded_to_two_digits_of_their_uncertainty(value: float, std: float | None, shown: str) -> None:
    assert estimate_text(value, std) == shown


@pytest.mark.parametrize(
    ("value", "std", "shown"),
    [(2.86, 0.42, "2.86(42)"), (0.84, 0.42, "0.84(42)"), (0.83, 0.42, "at most 1.7"), (2.5, None, "2.5")],
)
def test_a_time_within_twice_its_uncertainty_has_an_upper_bound(value: float, std: float | None, shown: str) -> None:
    assert positive_text(value, std) == shown


@pytest.mark.parametrize(
    ("value", "std", "of", "shown"),
    [
        (7.855e-4, 7.3e-6, "V", "785.5(73) uV"),
        (0.0, 1.6e-4, "V", "0.00(16) mV"),
        (0.98510, 2.5e-4, "V/g", "0.98510(25) V/g"),
        (-0.0010, 0.0016, "V/g^2", "-1.0(16) mV/g^2"),
        (0.0023, None, "g", "2.3 mg"),
        (0.00234, 1e-5, "deg", "0.002340(10) deg"),
        (0.0, None, "V", "0 V"),
    ],
)
def test_outputs_are_in_the_prefix_that_reads_best(value: float, std: float | None, of: str, shown: str) -> None:
    assert concise_in_prefix(value, std, of) == shown
    typographic = shown.replace("-", "−").replace("uV", "µV").replace("^2", "²")
    assert estimate_in_prefix(value, std, of) == typographic


@pytest.mark.parametrize(
    ("value", "expanded", "shown"),
    [
        (2.500134567, 0.000482, "2.50013 ± 0.00048"),
        (-1.234e-8, 2.2e-9, "(−1.23 ± 0.22) × 10⁻⁸"),
        (33123.8, 123.4, "33120 ± 120"),
    ],
)
def test_a_sign_is_for_expanded_uncertainties(value: float, expanded: float, shown: str) -> None:
    assert expand_uncertainty(value, expanded) == shown
    assert value_text(value, expanded) == re.sub(r" ± [^)]*|[()]", "", shown)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"),
        (142.255, "142"),
        (1234.0, "1234"),
        (-1234.0, "−1234"),
        (12345678.0, "1.23 × 10⁷"),
        (0.0410672, "0.0411"),
        (-2.5e-6, "−2.50 × 10⁻⁶"),
    ],
)
def test_a_number_without_uncertainty_has_few_digits(value: float, shown: str) -> None:
    assert few_digits(value) == shown


def test_a_reference_value_has_the_digits_that_are_asked_for() -> None:
    assert few_digits(23.4567, 4) == "23.46"


@pytest.mark.parametrize(
    ("value", "shown"), [(0.0, "0"), (9.996, "10.0"), (0.05066, "0.0507"), (1234.0, "1230"), (1.5e-7, "1.50 × 10⁻⁷")]
)
def test_rounded_numbers_have_three_digits(value: float, shown: str) -> None:
    assert rounded(value) == shown


def test_probabilities_and_units_are_formatted() -> None:
    assert [probability(p) for p in (1.0, 0.0187, 9.7e-12, 0.0)] == ["1", "0.019", "1 × 10⁻¹¹", "below 10⁻³⁰⁰"]
    assert [unit(u) for u in ("V/g^2", "V*s", "1", "degC", "V")] == ["V/g²", "V·s", "", "°C", "V"]


@pytest.mark.parametrize(
    ("low", "high", "shown"),
    [
        (22.3153, 23.1252, "22.32 to 23.13"),
        (30.0, 150.0, "30 to 150"),
        (0.4995, 12.4995, "0.5 to 12.5"),
        (4.99981, 5.00012, "4.99981 to 5.00012"),
        (3.0, 3.0, "3 to 3"),
        (-0.001, 2.0, "0 to 2"),
    ],
)
def test_an_interval_has_a_hundredth_of_its_length(low: float, high: float, shown: str) -> None:
    assert interval(low, high) == shown


def test_an_error_below_a_tenth_of_a_milli_unit_is_written_in_micro_units() -> None:
    assert milli_amount(0.0497, "mV") == "49.7 µV"
    assert milli_amount(-0.026, "mg", 2) == "−26 µg"
    assert milli_amount(0.53, "mg", 2) == "0.53 mg"
    assert milli_amount(0.04, "‰ of the field") == "0.0400 ‰ of the field"


def test_signs_of_a_page_stand_in_place_of_those_of_a_terminal() -> None:
    texts = ("side -x", "-9.45 uV (-9.45 ug)", "785.5(73) uV", "2 +- 1", "36 degC", "rms 2 x the noise floor")
    assert [typeset(text) for text in texts] == [
        "side −x", "−9.45 µV (−9.45 µg)", "785.5(73) µV", "2 ± 1", "36 °C", "rms 2 × the noise floor",
    ]  # fmt: skip
    for kept in ("bias-x", "2024-05-06", "uV", "alpha-2", "x the noise"):
        assert typeset(kept) == kept


def test_times_are_written_with_a_space_and_whole_seconds() -> None:
    assert with_times("2026-11-29T21:07:36.123456+00:00") == "2026-11-29 21:07:36 UTC"
    assert with_times("2026-11-29, 30 days") == "2026-11-29, 30 days"
