"""A slow cause, which a filter follows and foretells for as long as a random effort lasts in its place."""

from driven_rigs.draw import draw

from fes_pin.data.study import read_study
from fes_pin.diagnose.decide.held_out import Gain
from fes_pin.diagnose.diagnosis import diagnose_joint
from fes_pin.diagnose.record import diagnosis_record


def test_a_spring_of_a_slow_slide_shows_beyond_the_horizon(tmp_path):
    """Without it 0.3 s are foretold as well as with it, and it had been refused."""
    drawn = draw(("coulomb_friction", "parallel_stiffness"), 0.3, 1150018, tmp_path, recorded=True)
    diagnosis = diagnose_joint(read_study(drawn.study))
    causes = {c.name: c for c in diagnosis.causes}
    assert {"coulomb_friction", "parallel_stiffness"} <= set(causes), str(diagnosis)
    gain = causes["parallel_stiffness"].gain_held_out
    assert gain.ahead_s is not None
    assert gain.ahead_s > 2.0 * diagnosis.ahead.horizon_s
    assert gain.is_material
    told = {c["name"]: c["gain_percent"] for c in diagnosis_record(diagnosis)["causes"]}
    assert told["parallel_stiffness"]["ahead_s"] > 2.0 * diagnosis.ahead.horizon_s
    assert "ahead_s" not in told["coulomb_friction"]


def test_a_gain_says_how_far_ahead_it_looked():
    assert str(Gain(28.3, 17.2, 43.6)) == "28 % [17, 44]"
    assert str(Gain(28.3, 17.2, 43.6, 1.158)) == "28 % [17, 44], 1.2 s ahead"
