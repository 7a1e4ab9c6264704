"""A model: a rig with its nominal parameters, and the effects added to it."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fes_pin.data.channels import CHANNELS, WIDTH
from fes_pin.data.errors import InputError, fault_at
from fes_pin.data.numbers import instance, shortened
from fes_pin.data.schema import check_known
from fes_pin.data.show import DataFrame, by_columns, frame, table_html
from fes_pin.data.trial import Trial
from fes_pin.models.parameters import ParameterInfo
from fes_pin.models.rigs.base import Rig
from fes_pin.models.stage import Effect, in_order


def _other_unit(effect: Effect, rig: Rig) -> str:
    """The unit of a stimulus that an effect has and the rig has not; "" for none."""
    stimuli = {c.unit for c in CHANNELS.values()} - {(rig.channel or WIDTH).unit}
    units = (one.unit.partition("/")[0] for one in effect.parameters().values())
    return next((u for u in units if u in stimuli), "")


@dataclass(frozen=True, repr=False)
class Model:
    """A rig and its effects, in the order of the signal path; immutable. `model + effect` is the extended model.

    A parameter's name is its path: `gain`, `coulomb_friction.torque_nm`. `model - effect`, or `model - "its_name"`, is
    the model without it.

    Raises
    ------
    InputError
        When it is built: a rig that lacks constants, an effect that is not for the rig, two of one name. Of `-`: an
        effect that the model does not have.
    """

    rig: Rig
    effects: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        instance(self.rig, Rig, "rig")
        for effect in instance(self.effects, tuple | list, "effects"):
            instance(effect, Effect, "effects")
        names = [e.name for e in self.effects]
        if missing := set(self.rig.needed) - set(self.rig.constants):
            raise InputError(f"expected {', '.join(sorted(missing))} as well", column="constants")
        for effect in self.effects:
            if names.count(effect.name) > 1:
                raise InputError(f"the model has {effect.name} already")
            if hasattr(effect, "rigs") and not self.rig.takes(effect):  # a probe of the residual is for any rig
                raise InputError(f"{effect.name} is not for the rig {self.rig.name}")
            if unit := _other_unit(effect, self.rig):
                expected = f"its class of this rig: model.rig.cause(effects.{type(effect).__name__})"
                raise InputError(f"{effect.name} has sizes in {unit}, and the stimulus has not; expected {expected}")
        object.__setattr__(self, "effects", in_order(self.effects))

    def __add__(self, effect: Effect) -> "Model":
        if not isinstance(effect, Effect):
            raise InputError(f"expected an effect, as in CoulombFriction(torque_nm=0.04); found {effect!r}")
        return Model(self.rig, (*self.effects, effect))

    def __sub__(self, effect: str | Effect | type[Effect]) -> "Model":
        name = getattr(effect, "name", effect)
        if not isinstance(name, str):
            raise InputError(f"expected an effect of the model or its name, found {shortened(effect)}")
        check_known([name], [e.name for e in self.effects], fault_at())
        return Model(self.rig, tuple(e for e in self.effects if e.name != name))

    def parameters(self) -> dict[str, float]:
        """Return the value of every parameter that all trials share, by name."""
        values = {n: float(getattr(self.rig, n)) for n in self.rig.parameters()}
        return values | {f"{e.name}.{n}": float(getattr(e, n)) for e in self.effects for n in e.common()}

    def parameter_info(self) -> dict[str, ParameterInfo]:
        """Return unit, null, bounds and scale of every parameter, by name."""
        own = {f"{e.name}.{n}": e.parameters()[n] for e in self.effects for n in e.common()}
        return {n: one.in_units(self.rig.units()) for n, one in {**self.rig.parameters(), **own}.items()}

    def own_unknowns(self) -> tuple[str, ...]:
        """Return the names of each trial's own unknowns that belong to effects."""
        return tuple(f"{e.name}.{n}" for e in self.effects for n in e.unknowns())

    def unknowns(self, kind: str) -> tuple[str, ...]:
        """Return the names of each trial's own unknowns: of its initial state, and of effects."""
        return (*self.rig.unknowns(kind), *self.own_unknowns())

    def own_nulls(self) -> dict[str, float]:
        """Return start values of the unknowns of effects: their nulls."""
        return {f"{e.name}.{n}": float(getattr(e, n)) for e in self.effects for n in e.unknowns()}

    def initial_unknowns(self, trial: Trial) -> dict[str, float]:
        """Return start values of a trial's unknowns, from its first samples, and those of effects at their nulls."""
        return {**self.rig.initial_unknowns(trial), **self.own_nulls()}

    def fitted_parameters(self) -> tuple[str, ...]:
        """Return the parameters that a fit moves: those of the rig and of effects, without choices and unused forms."""
        own = (f"{e.name}.{n}" for e in self.effects for n in e.fitted_parameters())
        return (*self.rig.fitted_parameters(), *own)

    def unused_parameters(self) -> dict[str, float]:
        """Return the values, by name, of parameters of effects' forms that are switched off."""
        return {f"{e.name}.{n}": value for e in self.effects for n, value in e.unused().items()}

    def with_parameters(self, values: Mapping[str, float]) -> "Model":
        """Return the same model with other values.

        Raises
        ------
        InputError
            For a name that the model does not have, or a value out of its bounds.
        """
        check_known(values, self.parameters(), fault_at())
        nominal: dict[str, Any] = {n: float(v) for n, v in values.items() if "." not in n}
        rig = dataclasses.replace(self.rig, **nominal)
        effects = []
        for effect in self.effects:
            paths = {n: f"{effect.name}.{n}" for n in effect.common()}
            own: dict[str, Any] = {n: float(values[path]) for n, path in paths.items() if path in values}
            effects.append(dataclasses.replace(effect, **own))
        return Model(rig, tuple(effects))

    def acting(self, kind: str, inputs: tuple[str, ...] | None = None) -> "Model":
        """Return the same model without the effects that do not act in a kind of trial with these input columns."""
        signals = self.rig.signals(kind) if inputs is None else self.rig.changeable(kind, inputs)
        return Model(self.rig, tuple(e for e in self.effects if e.signal in signals))

    def driven_by(self, trial: Trial) -> tuple[str, ...]:
        """Return the columns that drive the rig in a trial, and those that effects which act in it read."""
        felt = self.acting(trial.kind, self.rig.input_columns(trial)).effects
        return tuple(dict.fromkeys([*self.rig.driven_by(trial), *(n for e in felt for n in e.inputs)]))

    def structure(self) -> tuple[str, ...]:
        """Return the names of the rig and of the effects."""
        return (self.rig.name, *(f"{e.name} of each trial" if e.each_trial else e.name for e in self.effects))

    def __repr__(self) -> str:
        values = ", ".join(f"{n} = {v:.4g}" for n, v in self.parameters().items())
        return f"Model {' + '.join(self.structure())}: {values}"

    def _repr_html_(self) -> str:
        info = self.parameter_info()
        rows = [(n, f"{v:.6g}", info[n].unit or "-") for n, v in self.parameters().items()]
        return table_html(f"{' + '.join(self.structure())} model", ("parameter", "value", "unit"), rows)

    def to_frame(self) -> DataFrame:
        """Return every parameter with its value, unit and bounds as a pandas frame; see `data.show.frame`."""
        info, head = self.parameter_info(), ("parameter", "value", "unit", "lower", "upper")
        rows = [(n, v, info[n].unit, info[n].lower, info[n].upper) for n, v in self.parameters().items()]
        return frame(by_columns(head, rows), index="parameter")

    def __str__(self) -> str:
        info = self.parameter_info()
        lines = [f"{self.rig.name} model" + "".join(f" + {e.name}" for e in self.effects)]
        lines += [f"  {n:40s} {v:12.6g} {info[n].unit}" for n, v in self.parameters().items()]
        return "\n".join(lines)
