"""Recruitment curves and their exact inverses."""

import copy
import pickle
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fes_pin.data.errors import InputError
from fes_pin.muscles.recruitment import (
    LEAST_US,
    LONGEST_US,
    RANGES,
    ChannelRecruitment,
    GompertzRecruitment,
    HillRecruitment,
    Hysteresis,
    LinearRecruitment,
    MeasuredRecruitment,
    SaturatingRecruitment,
    SigmoidRecruitment,
)

CURVES = [
    LinearRecruitment(),
    LinearRecruitment(0.0, 300.0),
    SaturatingRecruitment(150.0, 500.0, 4.0),
    SaturatingRecruitment(150.0, 500.0, -2.0),
    SigmoidRecruitment(100.0, 400.0, 12.0, 0.4),
    GompertzRecruitment(180.0, 1000.0, 4.0, 5.0),
    HillRecruitment(180.0, 1000.0, 0.8, 1.5),
    HillRecruitment(180.0, 1000.0, -0.7, -1.0),
    MeasuredRecruitment([120, 200, 260, 500], [0, 0.2, 0.8, 1]),
]
MIXED = ChannelRecruitment(CURVES, len(CURVES))


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: type(c).__name__)
def test_inverse_is_exact_and_within_threshold_and_saturation(curve):
    r = np.concatenate([np.linspace(0, 1, 20_001), 10.0 ** np.linspace(-15, -1, 50)])
    width = curve.pulse_width_us(r)
    np.testing.assert_allclose(curve.recruitment(width), r, atol=3e-13)
    assert (width[r == 0] == 0).all()
    assert ((width[r > 0] >= curve.threshold_us) & (width <= curve.saturation_us)[r > 0]).all()
    assert curve.pulse_width_us(1.0) == curve.saturation_us and curve.pulse_width_us(-0.1) == 0.0


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: type(c).__name__)
def test_curves_rise_from_threshold_to_saturation_and_stay(curve):
    w = np.linspace(float(curve.threshold_us), float(curve.saturation_us), 1001)
    assert (np.diff(curve.recruitment(w)) > 0).all()
    assert curve.recruitment(float(curve.threshold_us)) == 0.0 and curve.recruitment(float(curve.saturation_us)) == 1.0
    assert curve.recruitment(0.0) == 0.0 and curve.recruitment(1e6) == 1.0


@settings(max_examples=200, deadline=None)
@given(
    st.floats(0, 400),
    st.floats(1, 2000),
    st.floats(0.5, 15),
    st.floats(0.1, 0.9),
    st.floats(0, 1),
)
def test_sigmoid_inverse_for_any_parameters(threshold, span, steepness, middle, r):
    span = max(threshold + span, LEAST_US) - threshold
    curve = SigmoidRecruitment(threshold, threshold + span, steepness, middle)
    width = float(curve.pulse_width_us(r))
    assert width == 0.0 if r == 0 else threshold <= width <= threshold + span
    # the slope of the curve turns the rounding of a pulse width into one of recruitment
    rounding = 4 * np.spacing(threshold + span) / span * steepness
    assert curve.recruitment(width) == pytest.approx(r, abs=1e-12 + rounding)


def test_mixed_channels_equal_each_curve_alone():
    r = np.random.default_rng(0).uniform(-0.1, 1.1, (100, len(CURVES)))
    widths = MIXED.pulse_width_us(r)
    for i, curve in enumerate(CURVES):
        np.testing.assert_array_equal(widths[:, i], curve.pulse_width_us(np.minimum(r[:, i], 1.0)))
        np.testing.assert_allclose(curve.recruitment(widths[:, i]), np.clip(r[:, i], 0, 1), atol=1e-12)


def test_one_curve_with_arrays_of_thresholds():
    curve = ChannelRecruitment(LinearRecruitment(np.array([100.0, 200.0]), np.array([300.0, 500.0])), 2)
    np.testing.assert_allclose(curve.pulse_width_us(np.array([0.5, 0.5])), [200.0, 350.0])


@pytest.mark.parametrize(
    "make",
    [
        lambda: LinearRecruitment(500.0, 500.0),
        lambda: LinearRecruitment(-1.0, 500.0),
        lambda: LinearRecruitment(float("nan"), 500.0),
        lambda: SaturatingRecruitment(100.0, 500.0, 0.0),
        lambda: SigmoidRecruitment(100.0, 500.0, -1.0),
        lambda: GompertzRecruitment(100.0, 500.0, 0.0),
        lambda: Hysteresis(LinearRecruitment(), -1.0),
        lambda: MeasuredRecruitment([100, 200], [0, 0.9]),
        lambda: MeasuredRecruitment([100, 200, 150], [0, 0.5, 1]),
        lambda: MeasuredRecruitment([100], [0]),
        lambda: ChannelRecruitment([LinearRecruitment()], 2),
    ],
)
def test_bad_curves_are_refused(make):
    with pytest.raises(InputError):
        make()


def test_hill_curve_is_the_models_formula():
    x, n, e = np.linspace(0.01, 1, 50), np.exp(0.8), np.exp(1.5) - 1
    got = HillRecruitment(100.0, 200.0, 0.8, 1.5).recruitment(100.0 + 100.0 * x)
    np.testing.assert_allclose(got, (1 + e) * x**n / (1 + e * x**n), atol=1e-13)


@pytest.mark.parametrize("curve", [LinearRecruitment(180.0, 1000.0), SigmoidRecruitment(180.0, 600.0)])
def test_hysteresis_is_undone_wherever_it_can_be(curve):
    rng, exact, cut = np.random.default_rng(0), 0, 0
    for half_width in (0.0, 15.0, 80.0):
        play = Hysteresis(curve, half_width, acting_us=300.0)
        wanted = np.clip(0.5 + 0.6 * np.sin(np.cumsum(rng.normal(size=2000)) * 0.3), 0, 1)
        for r in wanted:
            low, high = play.reach()
            width = play.pulse_width_us(r)
            assert width == 0.0 if r == 0 else curve.threshold_us <= width <= curve.saturation_us
            got = play.recruitment(width)
            if r == 0.0 or low <= r <= high:
                assert got == pytest.approx(r, abs=1e-12)
                exact += 1
            else:
                assert got == pytest.approx(low if r < low else high, abs=1e-12)
                cut += 1
    assert exact > 3000 and cut > 100


@pytest.mark.parametrize(
    "make",
    [
        lambda: LinearRecruitment([180.0, 190.0], [900.0, 1000.0, 1100.0]),
        lambda: MeasuredRecruitment("a", "b"),
        lambda: MeasuredRecruitment([100.0, 200.0], [0.0, "x"]),
        lambda: Hysteresis(LinearRecruitment(), "wide"),
        lambda: Hysteresis("steep", 10.0),
        lambda: Hysteresis(LinearRecruitment(np.array([100.0, 120.0])), 10.0),
        lambda: Hysteresis(LinearRecruitment(), 20.0, acting_us=float("nan")),
    ],
)
def test_what_is_no_number_is_one_line(make):
    with pytest.raises(InputError) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: MeasuredRecruitment([100, 200, np.inf], [0, 0.5, 1]), "5000 us, got inf"),
        (lambda: MeasuredRecruitment([100, 200, 1e6], [0, 0.5, 1]), "5000 us"),
        (lambda: HillRecruitment(log_bend=800.0), "log_bend .* between -3 and 5, got 800"),
        (lambda: HillRecruitment(log_exponent=9.0), "log_exponent"),
        (lambda: SigmoidRecruitment(middle=50.0), "middle .* between 0 and 1, got 50"),
        (lambda: SigmoidRecruitment(steepness=1e3), "steepness"),
        (lambda: GompertzRecruitment(growth=1e3), "growth"),
        (lambda: GompertzRecruitment(delay=np.array([5.0, 1e-9])), "delay"),
        (lambda: SaturatingRecruitment(curvature=800.0), "curvature"),
        (lambda: SaturatingRecruitment(curvature=1e-9), "straight line"),
        (lambda: LinearRecruitment(180, 1e9), "saturation_us .* between 10 and 5000, got 1e\\+09"),
        (lambda: LinearRecruitment(0.18, 1.0), "saturation_us .* between 10 and 5000, got 1"),
        (lambda: MeasuredRecruitment([0.18, 1.0], [0.0, 1.0]), "end at 10 to 5000 us, got 1"),
        (lambda: LinearRecruitment(np.array([180.0, np.inf]), 1000.0), "threshold_us"),
        (lambda: Hysteresis(LinearRecruitment(), 1e9), "half_width_us"),
        (lambda: Hysteresis(LinearRecruitment(), 1.0, acting_us=1e9), "acting_us"),
    ],
)
def test_widths_and_shapes_have_ranges_of_sanity(make, words):
    with pytest.raises(InputError, match=words):
        make()


def within(name):
    low, high = RANGES[name]
    return st.floats(low, high)


@settings(max_examples=1000, deadline=None)
@given(
    st.sampled_from(
        [LinearRecruitment, SaturatingRecruitment, SigmoidRecruitment, GompertzRecruitment, HillRecruitment]
    ),
    st.data(),
)
def test_every_curve_that_can_be_built_gives_finite_widths_between_threshold_and_saturation(kind, data):
    """Also one with arrays of parameters, and at recruitments next to 0 and to 1."""
    shaped = {f.name: data.draw(within(f.name), label=f.name) for f in fields(kind)[2:]}
    threshold, saturation = sorted(data.draw(st.tuples(within("threshold_us"), within("saturation_us"))))
    try:
        curve = kind(threshold, saturation, **shaped)
        both = kind([threshold, 0.0], [saturation, LONGEST_US], **{n: [v, v] for n, v in shaped.items()})
    except InputError:
        assert threshold == saturation or abs(shaped.get("curvature", 1.0)) < 1e-3
        return
    ends = np.array([0.0, 5e-324, 1e-300, 1e-16, 1e-9, 0.5, 1.0 - 1e-9, np.nextafter(1.0, 0.0), 1.0])
    r = np.concatenate([ends, data.draw(st.lists(st.floats(0, 1), min_size=1, max_size=5))])
    width = curve.pulse_width_us(r)
    assert ((width == 0.0) == (r == 0.0)).all() or threshold == 0.0
    assert np.isfinite(width).all() and ((width == 0.0) | (width >= threshold)).all() and (width <= saturation).all()
    made = curve.recruitment(width)
    assert ((made >= 0.0) & (made <= 1.0)).all()
    np.testing.assert_allclose(both.pulse_width_us(np.column_stack([r, r]))[:, 0], width, rtol=1e-14)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.floats(0, LONGEST_US), min_size=2, max_size=6, unique=True), st.floats(-1, 2))
def test_a_measured_curve_that_can_be_built_gives_finite_widths(widths, r):
    assume(max(widths) >= LEAST_US)
    curve = MeasuredRecruitment(sorted(widths), np.linspace(0, 1, len(widths)))
    width = float(curve.pulse_width_us(r))
    assert width == 0.0 if r <= 0.0 else min(widths) <= width <= max(widths)


def test_curves_are_equal_by_value_and_cannot_be_changed():
    for make in (
        lambda: MeasuredRecruitment([120, 200, 500], [0, 0.2, 1]),
        lambda: LinearRecruitment(np.array([100.0, 120.0]), 500.0),
        lambda: HillRecruitment(log_bend=0.5),
    ):
        one, other = make(), make()
        assert (
            one == other and hash(one) == hash(other) and one == copy.deepcopy(one) == pickle.loads(pickle.dumps(one))
        )
        assert one != LinearRecruitment()
    arrays = LinearRecruitment(np.array([100.0, 120.0]), 500.0)
    for curve in (arrays, copy.deepcopy(arrays), pickle.loads(pickle.dumps(arrays))):
        with pytest.raises(ValueError, match="read-only"):
            curve.threshold_us[0] = 7.0
    with pytest.raises(ValueError, match="read-only"):
        MeasuredRecruitment([120, 500], [0, 1]).pulse_widths_us[1] = np.inf
    given = np.array([100.0, 120.0])
    curve = LinearRecruitment(given, 500.0)
    given[0] = -7.0
    assert curve.threshold_us[0] == 100.0
