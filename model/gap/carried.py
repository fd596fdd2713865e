"""The effects that a twin carries in `effects.json`, as laws of its world and as records."""

from collections.abc import Mapping, Sequence

import torch
from pydantic import JsonValue

from model.errors import InputError
from model.gap.effects import ALL_EFFECTS
from model.gap.effects.base import Effect, Field, Quantity
from model.gap.world import World
from model.schema import EffectName, EffectRecord

CATALOGUE: Mapping[str, type[Effect]] = {effect.name: effect for effect in ALL_EFFECTS}
SLACK = 1e-6
"""Of a bound: numbers that were written and read again may be this far beyond it, relatively."""


def carrying(world: World, records: Sequence[EffectRecord]) -> World:
    """The world with the effects of the records, in their order.

    Args:
        world: Of the twin without them.
        records: Of its `effects.json`.

    Raises:
        InputError: a record is not of the catalogue, or its effect cannot act in this world.
    """
    for i, record in enumerate(records):
        why = _second(record, records[:i]) or _unable(record, world)
        if why is not None:
            raise InputError(f"effects.json: {i}: {record.name} cannot act in this twin: {why}")
        world = _with(world, record, i)
    return world


def carrying_able(world: World, records: Sequence[EffectRecord]) -> World:
    """The same without those that cannot act in it, as what the ground does cannot in the air."""
    for i, record in enumerate(records):
        world = _with(world, record, i) if _unable(record, world) is None else world
    return world


def idle(world: World, records: Sequence[EffectRecord]) -> list[EffectName]:
    """The effects that `carrying_able` leaves out."""
    return [record.name for record in records if _unable(record, world) is not None]


def _second(record: EffectRecord, before: Sequence[EffectRecord]) -> str | None:
    """Why it cannot act beside another of its name, which it would replace."""
    if CATALOGUE[record.name].stacks or all(one.name != record.name for one in before):
        return None
    return "it carries one already: give both as one, with `acts_on` of both"


def _unable(record: EffectRecord, world: World) -> str | None:
    return CATALOGUE[record.name]().unable(world)


def _with(world: World, record: EffectRecord, number: int) -> World:
    values = values_of(record, f"effects.json: {number}")
    tensors = {name: torch.tensor(value, dtype=torch.float64) for name, value in values.items()}
    where = None if record.acts_on is None else torch.tensor(record.acts_on, dtype=torch.float64)
    return CATALOGUE[record.name]().apply(world, tensors, where)


def values_of(record: EffectRecord, where: str) -> dict[str, float]:
    """The value of each quantity of a record's effect.

    Args:
        record: Each of its parameters is a number, or an object with `value` and maybe `unit`.
        where: What the message calls it.

    Raises:
        InputError: a quantity is missing, unknown, no number, in another unit, or out of bounds.
    """
    effect = CATALOGUE[record.name]
    known, parameters = ", ".join(effect.quantities), {**effect.before, **record.parameters}
    for name in record.parameters:
        if name not in effect.quantities:
            raise InputError(f"{where}: {record.name} has no parameter {name!r}: expected {known}")
    for name in effect.quantities:
        if name not in parameters:
            raise InputError(f"{where}: {record.name}: {name} is missing: expected {known}")
    return {
        name: _value(parameters[name], effect, name, f"{where}: {record.name}: {name}")
        for name in effect.quantities
    }


def record_of(
    effect: Effect | type[Effect],
    values: Mapping[str, float],
    where: Field | None = None,
    intervals: Mapping[str, tuple[float, float]] | None = None,
) -> EffectRecord:
    """The record of an effect, as it is written into a twin.

    Args:
        effect: Of the catalogue.
        values: One for each of its quantities.
        where: The field that it was applied with (not the strength that a report shows); None: on all alike.
        intervals: 95 % intervals of quantities, by name.
    """
    ranges = intervals or {}
    parameters: dict[str, object] = {}
    for name, quantity in effect.quantities.items():
        interval = {"ci95": [float(end) for end in ranges[name]]} if name in ranges else {}
        parameters[name] = {"value": float(values[name]), "unit": quantity.unit, **interval}
    acts_on = None if where is None else tuple(float(share) for share in where)
    return EffectRecord.model_validate({"name": effect.name, "parameters": parameters, "acts_on": acts_on})


def _value(given: JsonValue, effect: type[Effect], name: str, where: str) -> float:
    quantity = effect.quantities[name]
    if isinstance(given, dict):
        unit = given.get("unit", quantity.unit)
        if unit != quantity.unit:
            raise InputError(f"{where}: expected the unit {quantity.unit}, found {unit!r}")
        given = given.get("value")
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise InputError(f"{where}: expected a number, or an object with value and unit, found {given!r}")
    value = float(given)
    if value != effect.absent.get(name) and not _within(value, quantity):
        low, high = quantity.bounds
        raise InputError(f"{where}: expected {low:g} to {high:g} {quantity.unit}, found {value:g}")
    return value


def _within(value: float, quantity: Quantity) -> bool:
    low, high = quantity.bounds
    return low - SLACK * abs(low) <= value <= high + SLACK * abs(high)
