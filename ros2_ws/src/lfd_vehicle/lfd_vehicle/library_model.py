"""The multi-body model of `commonroad-vehicle-models`, compiled as the library has written it.

Its derivative takes 25 us in Python and about 1 us compiled; the library's own function is
compiled, with the functions that it calls, so that there is no second text of it.
"""

from collections import namedtuple
from dataclasses import fields, is_dataclass
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any

import vehiclemodels.vehicle_dynamics_mb as library
from vehiclemodels.utils import tire_model
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters

from lfd_mpc.compiled import inner

VEHICLE = 2
"""The library's number of the car: a BMW 320i."""


def _plain(parameters: Any, name: str) -> Any:
    """Parameters as nested named tuples of numbers, which compiled functions take as constants."""
    values = {}
    for field in fields(parameters):
        value = getattr(parameters, field.name)
        if is_dataclass(value):
            values[field.name] = _plain(value, field.name)
        elif value is not None:
            values[field.name] = float(value)
    return namedtuple(name, values)(**values)


def _compiled(function: FunctionType, **others: Any) -> Any:
    """A library function, compiled where the functions that it calls are `others`."""
    return inner(
        FunctionType(function.__code__, {**function.__globals__, **others}, function.__name__)
    )


def _compiled_tires() -> ModuleType:
    tires = ModuleType("compiled_tires")
    sign = _compiled(tire_model.sign)
    for name in (
        "formula_longitudinal",
        "formula_lateral",
        "formula_longitudinal_comb",
        "formula_lateral_comb",
    ):
        setattr(tires, name, _compiled(getattr(tire_model, name), sign=sign))
    return tires


def _compiled_derivative() -> Any:
    steering = _compiled(library.steering_constraints)
    acceleration = _compiled(library.acceleration_constraints)
    slow = _compiled(
        library.vehicle_dynamics_ks_cog,
        steering_constraints=steering,
        acceleration_constraints=acceleration,
    )
    return _compiled(
        library.vehicle_dynamics_mb,
        steering_constraints=steering,
        acceleration_constraints=acceleration,
        vehicle_dynamics_ks_cog=slow,
        tireModel=_compiled_tires(),
    )


PARAMETERS = setup_vehicle_parameters(VEHICLE)
"""As the library gives them."""

CONSTANTS = _plain(PARAMETERS, "Vehicle")
"""The same as plain numbers."""

derivative = _compiled_derivative()
"""`vehicle_dynamics_mb(x, u, p)` of the library, for compiled functions."""

X = SimpleNamespace(position=0, speed=3, pitch=8, pitch_rate=9, first_wheel=23, end_of_wheels=27)
"""Places in the state (29,)."""
