"""A stop that free motion refutes is no answer, however little it costs predictions over a horizon."""

from dataclasses import replace

import numpy as np
from bench import study, trial

import fes_pin as fp
from fes_pin.diagnosis.by_effort import begun_by_effort
from fes_pin.diagnosis.likelihood_models import LikelihoodModels, LikelihoodSearch
from fes_pin.diagnosis.verdict import RigVerdict
from fes_pin.identify.likelihood_fit import at_values
from fes_pin.models.effects import JointStop


def test_a_stop_within_the_motion_is_refuted_and_dry_friction_is_not(tmp_path):
    arm = study(tmp_path, [trial(seed, friction=0.1) for seed in range(3)])
    models = LikelihoodModels(fp.nominal_model(arm), arm.trials, answered=True)
    search = LikelihoodSearch(models, lambda share, words: None, begun_by_effort(models, arm.trials))
    found, verdict = search.run(), RigVerdict(search, ())
    assert found.best.names == ("coulomb_friction",) and verdict.weigh(found).carried == {}
    inside = float(np.quantile(np.concatenate([t["position"] for t in arm.trials]), 0.9))
    names = models.fit_model(found.best.model + JointStop(stiffness=20.0, angle_rad=inside))
    stopped = at_values(models.fits[names], {"joint_stop.angle_rad": inside, "joint_stop.stiffness": 20.0})
    both = replace(found, best=stopped, without={"joint_stop": found.best})
    (gain,) = verdict._refuted_in_free_motion(both).values()
    assert gain < -100.0
