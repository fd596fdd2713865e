"""Generate worlds: observations with neutral names, and their labels apart.

    python -m benchmarks.reality.generate --split dev --count 40 --out out/worlds/dev
    python -m benchmarks.reality.generate --split test --count 100 --out out/worlds/test
    python -m benchmarks.reality.generate --split dev --seed 1 --count 24 --only single pair --targets 2 4 \
        --choosy 12 --out out/worlds/clear

What is in the folder already is not made again.

Development worlds are moved by MuJoCo, test worlds by our own finite elements, with other objects. Each
world is a pair `NAME.npz` and `NAME.transfer.npz`: the same object, tracked points in the same order,
another interaction.
"""

import argparse
import hashlib
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from benchmarks.reality.effects import ALL, draw
from benchmarks.reality.labels import known_labels, write_labels
from benchmarks.reality.magnitude import Simulate, checked_gap, hopeless, measure, tune
from benchmarks.reality.recipe import BLOCK, LAST, MAGNITUDES, SPLITS, Recipe, Split, Wanted, draw_recipe
from benchmarks.reality.sensor import Sensor, lagging, report
from benchmarks.reality.side import cameras, facing_of_line, facing_of_volume, kept
from benchmarks.reality.tube import on_skin
from benchmarks.reality.world import Array, Effect, Motion, Runaway, World

GENERATORS = {"dev": "mujoco", "test": "fem"}
MODULES = {
    "mujoco": "benchmarks.reality.lattice",
    "flex": "benchmarks.reality.flex",
    "fem": "benchmarks.reality.fem",
}
TRIES, CHOOSY = 12, 3
"""Draws of a world; the first `CHOOSY` are thrown away where the effect is far from its target."""
WITHIN = 1.6
"""Factor within which that is."""
Tracked = Literal["around", "skin", "side"]
"""Which points: all around solids, and of ropes along their middle line; of ropes on their skin; and of those
of solids and of skins the ones that one or two cameras see in the first frame."""


def generator(name: str) -> Simulate:
    """`simulate` of a generator."""
    simulate: Simulate = import_module(MODULES[name]).simulate
    return simulate


def make(
    seed: int,
    split: Split,
    index: int,
    generator_name: str,
    wanted: Wanted | None = None,
    choosy: int = CHOOSY,
    *,
    tracked: Tracked = "around",
) -> tuple[dict[str, Array], dict[str, Array], dict[str, Any]]:
    """Observation, transfer observation, label of one world."""
    simulate = generator(generator_name)
    for attempt in range(TRIES):
        recipe = draw_recipe(seed, split, index, attempt, wanted)
        rng = np.random.default_rng([SPLITS[split], seed, 4, index, attempt])
        try:
            within = np.inf if attempt >= choosy else WITHIN
            done = _realise(recipe, simulate, rng, within, tracked, (seed, index))
        except Runaway:
            continue
        if done is not None:
            observation, transfer, label = done
            return (
                observation,
                transfer,
                label | {"attempts": attempt + 1, "generator": generator_name, "split": split},
            )
    raise RuntimeError(f"world {index} of {split} with seed {seed}: no draw in {TRIES} could be realised")


def _realise(
    recipe: Recipe,
    simulate: Simulate,
    rng: np.random.Generator,
    within: float,
    tracked: Tracked,
    place: tuple[int, int],
) -> tuple[dict[str, Array], dict[str, Array], dict[str, Any]] | None:
    sensor, again = recipe.sensor, recipe.transfer_sensor
    effects: list[Effect] = []
    magnitude: dict[str, float] = {}
    if recipe.names:
        drawn = [draw(name, recipe.world.shape, 1.0, rng) for name in recipe.names]
        if any(hopeless(recipe.world, each, ALL[each.name].range, simulate, sensor.noise) for each in drawn):
            return None
        stick = measure(recipe.world, simulate, sensor.noise)
        for each in drawn:
            tuned = tune(stick, each, ALL[each.name].range, recipe.target, simulate, within)
            if tuned is None:
                return None
            effects.append(tuned.effect)
            motion, size = tuned.motion, tuned.magnitude
        if len(effects) > 1:
            motion = simulate(recipe.world.with_effects(*effects))
            size = checked_gap(stick, motion.points, simulate)
        magnitude = {
            "target": recipe.target,
            "magnitude": size,
            "discretisation_m": stick.discretisation,
        }
    else:
        motion = simulate(_lag(recipe.world, sensor))
    transfer = simulate(_lag(recipe.transfer.with_effects(*effects), again))
    if not (_sane(motion) and _sane(transfer)):
        return None
    motion, transfer = _seen(recipe, (motion, transfer), tracked, place)
    observation = report(motion.points, recipe.world.scene, sensor, rng)
    second = report(transfer.points, recipe.transfer.scene, again, rng)
    return observation, second, _label(recipe, effects, motion, magnitude)


def _seen(
    recipe: Recipe, motions: tuple[Motion, Motion], tracked: Tracked, place: tuple[int, int]
) -> tuple[Motion, Motion]:
    """The same places in both; `place` says where on a skin they are, and where cameras stand."""
    first, second = motions
    shape, scene = recipe.world.shape, recipe.world.scene
    if tracked == "around" or shape.kind == "sheet":
        return motions
    if shape.kind == "rope":
        line = first.points[0]
        first, second = (
            on_skin(each, shape.radius, np.random.default_rng(place)) for each in (first, second)
        )
    if tracked == "skin":
        return first, second
    eyes = cameras(recipe.sensor.camera, scene, np.random.default_rng([*place, 6]))
    if shape.kind == "rope":
        seen = facing_of_line(first.points[0], line, eyes)
    else:
        seen = facing_of_volume(shape.surface, shape.inside, scene, eyes)
    return kept(first, seen), kept(second, seen)


def _lag(world: World, sensor: Sensor) -> World:
    return replace(world, scene=lagging(world.scene, sensor.lag))


def _sane(motion: Motion) -> bool:
    """Whether the object stays near and whole."""
    away = np.abs(motion.points - motion.points[0].mean(axis=0)).max()
    return bool(np.isfinite(motion.points).all() and away < 2.5)


ACCEPTED = {
    "": ["none"],
    "coarse": ["none"],
    "slit": ["none", "unknown"],
    "scale": ["none"],
    "drift": ["none"],
    "depth": ["none"],
    "jitter": ["none"],
    "gain": ["none", "unknown"],
    "lag": ["actuation_delay", "none"],
}


def _label(
    recipe: Recipe, effects: list[Effect], motion: Motion, magnitude: dict[str, float]
) -> dict[str, Any]:
    names = [effect.name for effect in effects]
    accepted = {"single": names, "pair": names, "outside": ["unknown"]}.get(
        recipe.category, ACCEPTED[recipe.note]
    )
    acts = {name: motion.acts[name] for name in names}
    return {
        "category": recipe.category,
        "effects": [asdict(effect) for effect in effects],
        "accepted": accepted,
        "note": recipe.note,
        "source": {"perception": "perception", "actuation": "actuation", "topology": "parameters"}.get(
            recipe.category, "physics" if names else "parameters"
        ),
        **magnitude,
        "noise_m": recipe.sensor.noise,
        "acts_on": acts,
        "interaction": recipe.world.scene.interaction,
        "transfer_interaction": recipe.transfer.scene.interaction,
        "shape": recipe.world.shape.name,
        "kind": recipe.world.shape.kind,
        "material": asdict(recipe.world.material),
        "spacing_m": recipe.world.spacing,
        "sensor": asdict(recipe.sensor),
    }


def _name(split: Split, seed: int, index: int) -> str:
    """A name that tells nothing."""
    return hashlib.sha256(f"{split} {seed} {index}".encode()).hexdigest()[:10]


Job = tuple[int, Split, int, str, Wanted, int, Tracked, Path]


def _work(job: Job) -> dict[str, Any] | None:
    seed, split, index, generator_name, wanted, choosy, tracked, out = job
    name = _name(split, seed, index)
    try:
        observation, transfer, label = make(
            seed, split, index, generator_name, wanted, choosy, tracked=tracked
        )
    except RuntimeError as error:
        print(error, file=sys.stderr)
        return None
    for ending, arrays in (("", observation), (".transfer", transfer)):
        np.savez_compressed(out / f"{name}{ending}.npz", **arrays)
    return {"world": name} | label


def main(arguments: list[str] | None = None) -> int:
    """Generate a split."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--split", choices=list(SPLITS), required=True)
    parser.add_argument("--count", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="index of the first world")
    parser.add_argument(
        "--generator", choices=list(MODULES), help="another than the split's; for development only"
    )
    development = parser.add_argument_group("for development only", "to learn from what is seen clearly")
    development.add_argument(
        "--only", nargs="+", choices=sorted({*BLOCK, *LAST}), default=[], help="categories"
    )
    development.add_argument("--targets", nargs="+", type=float, default=MAGNITUDES, help="signal-to-noise")
    development.add_argument(
        "--choosy", type=int, default=CHOOSY, help="draws that have to be near the target"
    )
    development.add_argument(
        "--tracked",
        choices=get_args(Tracked),
        default="around",
        help="points all around solids and along the middle of ropes, on the skin of ropes too, or of both"
        " what one or two cameras see at first",
    )
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args(arguments)
    if options.split == "test" and options.generator not in (None, GENERATORS["test"]):
        parser.error("test worlds have a generator of their own")
    wanted = Wanted(tuple(options.only), tuple(options.targets))
    if options.split == "test" and (
        wanted != Wanted() or options.choosy != CHOOSY or options.tracked != "around"
    ):
        parser.error(
            "test worlds come as they are drawn: --only, --targets, --choosy, --tracked are for development"
        )
    chosen = options.generator or GENERATORS[options.split]
    options.out.mkdir(parents=True, exist_ok=True)
    labels = known_labels(options.out)
    made = {label["world"] for label in labels}
    jobs = [
        (options.seed, options.split, index, chosen, wanted, options.choosy, options.tracked, options.out)
        for index in range(options.first, options.first + options.count)
        if _name(options.split, options.seed, index) not in made
    ]
    began, missed, path = time.monotonic(), 0, options.out
    with ProcessPoolExecutor(options.workers) as pool:
        for done, label in enumerate(pool.map(_work, jobs), 1):
            if label is None:
                missed += 1
            else:
                labels.append(label)
                path = write_labels(options.out, labels, sealed=options.split == "test")
            spent = time.monotonic() - began
            left = spent / done * (len(jobs) - done)
            print(f"{done}/{len(jobs)} worlds, {spent:.0f} s, about {left:.0f} s left", flush=True)
    if path != options.out:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        print(f"wrote {len(jobs) - missed} of {len(labels)} worlds and {path}, sha256 {digest}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
