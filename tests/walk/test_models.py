"""Sets of forms of a walk as the search of `infer` sees them."""

import itertools
import math

import numpy as np
import pinocchio as pin
import pytest

from fes_pin.data.study import read_study
from fes_pin.infer.levels import POSSIBLE_SIZES, WALK_LEVEL
from fes_pin.infer.text import plain_name
from fes_pin.walk.designs import Designs
from fes_pin.walk.effect import Segment, changed_segment, is_of_a_body
from fes_pin.walk.models import WalkModels, WalkSearch
from fes_pin.walk.recording import recordings_of
from fes_pin.walk.verdict import WalkVerdict, as_fitted, marker_noise
from fes_pin.workers import OutOfTime, noting_stops, time_limit

pytestmark = pytest.mark.shared


def models_of(gait, folder, seed, *args, **more):
    from walks.synthetic import Wrong, make

    make(gait, folder, Wrong(*args, **{"strides": 2, "tissue": 0.4, **more}), seed)
    recordings = recordings_of(read_study(folder))
    return WalkModels(Designs(recordings))


@pytest.fixture(scope="module")
def models(gait, tmp_path_factory):
    made = models_of(gait, tmp_path_factory.mktemp("pushed"), 3, "external_force", "trunk", 40.0,
                     extra={"axis": (0, 0, 1), "at": (0, 0, 0.2)})  # fmt: skip
    made.nominal()
    made.extend(())
    return made


def test_a_set_has_no_two_forms_of_one_cause_at_one_site(models):
    forms = models.designs.forms
    base = models.fits[("segment_com@trunk, forward",)]
    further = models.candidates(base)
    assert not any(forms[n].cause == "segment_com" and forms[n].site.startswith("trunk") for n in further)
    assert "segment_com@pelvis, forward" in further and "segment_mass@trunk" in further


def test_sizes_that_cannot_be_are_no_explanation(models):
    for names, fitted in models.fits.items():
        possible = np.abs(fitted.fitted.believed) <= POSSIBLE_SIZES * models.designs.plausible(names)
        assert math.isfinite(fitted.criterion) <= possible.all()
    shown = [n for n, f in models.fits.items() if not models.is_possible(f)]
    assert not set(shown) & set(models.near(1))


def test_fits_at_once_are_the_fits_one_by_one(models):
    names = models.ranked(1)[0]
    (alone,) = models._fit_alike([names])
    assert alone.criterion == pytest.approx(models.fits[names].criterion, rel=1e-12)


def test_evidence_decides_until_the_noise_is_known(models):
    assert [models.noise_p_value(gain, 1) for gain in (-1.0, 1e-6)] == [1.0, 0.0]
    best = models.fits[models.ranked(1)[0]]
    known = models.with_noise_of(best)
    assert models.null is None and known.null is not None
    assert known.most_candidates > models.most_candidates
    p_values = [known.noise_p_value(gain, 1) for gain in (-1.0, 1.0, 10.0, 100.0)]
    assert p_values == sorted(p_values, reverse=True)
    assert p_values[0] == 1.0 and p_values[-1] < WALK_LEVEL


def test_a_limit_of_time_ends_the_fits_and_is_noted(models):
    with noting_stops() as stops, time_limit(0.0), pytest.raises(OutOfTime):
        models.extend(models.ranked(1)[0])
    assert stops


def test_what_strides_held_out_do_not_bear_out_is_refused(models):
    """One form of the truth is supported; of a set with a form more, that one is not."""
    known = models.with_noise_of(models.fits[models.ranked(1)[0]])
    search = WalkSearch(known, lambda share, words: None)
    found = search.run()
    verdict = WalkVerdict(search)
    state = verdict.of(found)
    assert state.found.best.names == found.best.names and not state.rejected
    assert all(e.low > 0.0 for e in state.weighed.evidence.values())
    further = tuple(sorted((*found.best.names, "plate_gain@left plate, sideways")))
    known.fit(further)
    state = verdict.of(search.result(further))
    assert set(state.rejected) == {"plate_gain@left plate, sideways"}
    assert verdict.lack_of_fit(state).unexplained


def test_marker_noise_has_no_gain_where_none_is_computed(gait, tmp_path):
    fault, loud = marker_noise(models_of(gait, tmp_path, 5, "marker_noise", "", 0.008, strides=4).designs)
    assert fault.is_named and fault.p_value == loud.p_value < fault.level
    assert loud.gain_held_out.is_none and loud.evidence.low > 0.0
    assert loud.record()["gain_percent"] == {"fit": None, "held_out": None, "ci95": None, "other_leg": None}
    found = loud.parameters["markers_m"]
    assert found.unit == "m" and found.value == pytest.approx(0.008, abs=3.0 * found.std)


def test_ordinary_marker_noise_is_no_fault_and_its_test_is_listed(models):
    fault, _ = marker_noise(models.designs)
    assert not fault.is_named and fault.p_value > fault.level


def test_a_single_stride_shows_no_marker_noise(gait, tmp_path):
    assert marker_noise(models_of(gait, tmp_path, 5, strides=1).designs) is None


def test_a_segment_of_every_possible_size_is_that_of_a_body(models):
    """A trunk whose centre lay 7 cm off had moments that no body has, and its answer could not be written."""
    believed = models.designs.as_read.trials[0].motion.parameters
    for name, form in models.designs.forms.items():
        for segment, columns in (form.segments(believed) if form.segments else {}).items():
            ends = [0.99 * end for end in models.limits[name]]
            for sizes in itertools.product(ends, repeat=len(form.parameters)):
                assert is_of_a_body(changed_segment(believed[segment], columns @ sizes)), (name, sizes)


def test_a_centre_that_lies_elsewhere_leaves_the_central_inertia(models):
    believed = models.designs.as_read.trials[0].motion.parameters["trunk"]
    ahead = models.designs.forms["segment_com@trunk, forward"].segments({"trunk": believed})["trunk"] @ [0.1]
    before, after = pin.Inertia.FromDynamicParameters(believed), changed_segment(believed, ahead)
    np.testing.assert_allclose(after.lever - before.lever, [0.1, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(after.inertia, before.inertia, atol=1e-9)


def test_a_segment_without_mass_or_with_one_moment_is_of_no_body():
    rod = np.diag([1.0, 1.0, 2.1])
    assert not is_of_a_body(Segment(1.0, np.zeros(3), rod))
    assert not is_of_a_body(Segment(-1.0, np.zeros(3), np.eye(3)))


def test_the_equation_of_a_form_has_every_part_that_is_fitted(models):
    for form in models.designs.forms.values():
        _, text = as_fitted(form.cause, form.site, form.parameters)
        parts = [plain_name(n, "") for n in form.parameters if form.cause != "clock_offset"]
        assert all(part in text for part in parts), (form.label, text)
    _, text = as_fitted("external_force", "pelvis, forward and up", ("forward_n", "up_n"))
    assert text.endswith("F = (forward, up)")
