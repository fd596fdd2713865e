"""The CUDA text of a simulator's kernel: its traced laws in the engine."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch

from model.simulator.kernel.corners import Corners
from model.simulator.kernel.expression import Expression
from model.simulator.kernel.groups import KINDS, Group, Input, Kind, key
from model.simulator.kernel.text import FORMS, Statements

TYPES = {torch.float32: "float", torch.float64: "double"}
"""The number a kernel computes with."""
ENGINE = Path(__file__).with_name("engine.cu")
SCALAR = {**FORMS, "and": "{} && {}", "or": "{} || {}", "not": "!{}"}
"""How operations are written where a value is one number, not a vector of them."""


@dataclass
class _Counts:
    """Constants and variables written so far; each has its place in the fields of `Frame`."""

    edges: int = 0
    scenes: int = 0
    memories: int = 0


@dataclass
class _Members:
    """Of a struct that knows the constants of a law."""

    fields: list[str] = field(default_factory=list)
    made: list[str] = field(default_factory=list)
    symbols: dict[str, str] = field(default_factory=dict)
    """How each constant and variable is read, in a slot or stencil `at`."""
    sinks: dict[str, str] = field(default_factory=dict)
    """What is done with its adjoint."""
    finish: list[str] = field(default_factory=list)
    """What is done with sums, at the end, for a `point`."""

    def pointer(self, name: str, source: str, constant: bool = True) -> None:
        """Add a pointer to the values of this element of the batch."""
        self.fields.append(f"{'const ' if constant else ''}R *{name}")
        self.made.append(f"{name}(of({source}, element))")

    def text(self, name: str, methods: Mapping[str, Sequence[str]], more: Sequence[str] = ()) -> str:
        """The struct; `more` comes first in it."""
        start = f"__device__ {name}(const Frame &f, int element, int step)"
        start += (" : " + ", ".join(self.made) if self.made else "") + " {}"
        lines = [f"struct {name} {{", *(f"  {each};" for each in [*more, *self.fields]), f"  {start}"]
        for head, body in methods.items():
            lines += [f"  __device__ {head} {{", *(f"    {line}" for line in body), "  }"]
        return "\n".join([*lines, "};\n"])


def kernel_source(
    groups: Mapping[Kind, Group], corners: Sequence[Corners], ground: bool, dtype: torch.dtype
) -> str:
    """A whole substep and its adjoint.

    Args:
        groups: What pulls the springs and the controller springs, where anything does.
        corners: What acts on small groups of points.
        ground: Whether there is a ground.
        dtype: float32 or float64.
    """
    counts, laws = _Counts(), list[str]()
    for kind in KINDS:
        laws.append(_group(kind, groups[kind], counts) if kind in groups else _nothing(kind))
    laws += [_corners(index, each, counts) for index, each in enumerate(corners)]
    laws.append(_dispatch(len(corners)))
    sizes = {
        "GROUND": int(ground),
        **{kind.upper(): int(kind in groups) for kind in KINDS},
        "STENCILS": len(corners),
        "EDGES": counts.edges,
        "SCENES": counts.scenes,
        "MEMORIES": counts.memories,
    }
    head = [f"typedef {TYPES[dtype]} R;", *(f"#define {name} {value}" for name, value in sizes.items()), ""]
    return "\n".join(head) + ENGINE.read_text().replace("// THE LAWS\n", "\n".join(laws))


def _group(kind: Kind, group: Group, counts: _Counts) -> str:
    """The laws of a kind of edge."""
    members = _Members(["R dt"], ["dt(R(f.dt))"])
    members.symbols |= {"length": "length", "rate": "rate", "dt": "dt", "tension.bar": "tensionbar"}
    for given in group.inputs:
        name = _constant(members, given, counts)
        if not given.each:
            # one sum over the slots of a point, rather than a value per slot
            members.fields.append(f"R sum_{name}")
            members.made.append(f"sum_{name}(0)")
            members.sinks[key(given.term, given.name)] = f"sum_{name} += {{}};"
            members.finish.append(f"if (g{name}) g{name}[point] += sum_{name};")
    rest = members.symbols[key(group.inputs[0].term, group.inputs[0].name)]
    updates = []
    for (term, variable), update in zip(group.memory, group.updates, strict=True):
        slots = "springs" if kind == "springs" else "held"
        updates.append((_remembered(members, key(term, variable), f"f.{slots}.count", counts), update))
    forms = {"length": "lengthbar = {};", "rate": "ratebar = {};", **members.sinks}
    back = [(forms[name], adjoint) for name, adjoint in group.adjoints.items()]
    tension = [("return {};", group.tension)]
    methods = {
        "R rest(Long at) const": [f"return {rest};"],
        "R tension(Long at, R length, R rate) const": _body([*updates, *tension], members.symbols),
        _PULL_BACK: _body([*back, *tension], members.symbols),
        "void finish(const Frame &f, int element, int point)": members.finish,
    }
    return members.text(kind.capitalize(), methods)


_PULL_BACK = "R pull_back(Long at, R length, R rate, R tensionbar, R &lengthbar, R &ratebar)"


def _nothing(kind: Kind) -> str:
    """What pulls a kind of edge of which there is none."""
    methods = {
        "R rest(Long) const": ["return 1;"],
        "R tension(Long, R, R) const": ["return 0;"],
        _PULL_BACK: ["return lengthbar = ratebar = 0;"],
        "void finish(const Frame &, int, int)": [],
    }
    return _Members().text(kind.capitalize(), methods)


def _remembered(members: _Members, name: str, count: str, counts: _Counts) -> str:
    """Make a variable known, of which there are so many; returns how it is put away.

    Args:
        members: Of the law that remembers.
        name: Of the variable.
        count: In C++.
        counts: The variable is the next of these.
    """
    index = counts.memories
    for now, ahead in (("m", "step"), ("n", "(step + 1)")):
        members.fields.append(f"R *{now}{index}")
        members.made.append(f"{now}{index}(of(f.memory[{index}], element) + f.keep * {count} * {ahead})")
    members.pointer(f"b{index}", f"f.memory_adjoint[{index}]", constant=False)
    members.symbols[name], members.symbols[f"{name}.bar"] = f"m{index}[at]", f"b{index}[at]"
    members.sinks[name] = f"b{index}[at] = {{}};"
    counts.memories += 1
    return f"n{index}[at] = {{}};"


def _corners(index: int, corners: Corners, counts: _Counts) -> str:
    """The law of the stencils of a number."""
    members = _Members(["R dt"], ["dt(R(f.dt))"], {"dt": "dt"})
    members.symbols |= {symbol: "{}[{}][{}]".format(*symbol.split(".")) for symbol in corners.symbols}
    for given in corners.inputs:
        _constant(members, given, counts)
    updates = [
        (_remembered(members, key(term, variable), f"f.stencils[{index}]", counts), update)
        for (term, variable), update in zip(corners.memory, corners.updates, strict=True)
    ]
    forces = [(f"force[{i // 3}][{i % 3}] = {{}};", force) for i, force in enumerate(corners.forces)]
    places = [(f"bar[{i // 6}][{i % 6}] = {{}};", place) for i, place in enumerate(corners.places)]
    adjoints = [*corners.constants, *corners.memories]
    constants = list(zip(members.sinks.values(), adjoints, strict=True))
    known = "Long at, const R x[][6]"
    methods = {
        f"void forces({known}, R force[][3]) const": _body([*updates, *forces], members.symbols),
        f"void pull_back({known}, const R pulled[][3], R force[][3], R bar[][6]) const": _body(
            [*forces, *places, *constants], members.symbols
        ),
    }
    return members.text(f"Stencil{index}", methods, [f"enum {{ SIZE = {corners.size} }}"])


def _constant(members: _Members, given: Input, counts: _Counts) -> str:
    """Make a constant and where its adjoint goes known; returns what the members are called."""
    if given.each:
        name, source, read = f"a{counts.edges}", f"edge[{counts.edges}]", f"a{counts.edges}[at]"
        gradient = f"f.edge_gradient[{counts.edges}]"
        counts.edges += 1
    else:
        name, source, read = f"s{counts.scenes}", f"scene[{counts.scenes}]", f"s{counts.scenes}[0]"
        gradient = f"f.scene_gradient[{counts.scenes}]"
        counts.scenes += 1
    members.pointer(name, f"f.{source}")
    members.pointer(f"g{name}", gradient, constant=False)
    members.symbols[key(given.term, given.name)] = read
    members.sinks[key(given.term, given.name)] = f"if (g{name}) g{name}[at] += {{}};"
    return name


def _body(wanted: Sequence[tuple[str, Expression]], symbols: Mapping[str, str]) -> list[str]:
    """Statements that compute expressions, and put each into its form."""
    body = Statements([expression for _, expression in wanted], symbols, SCALAR)
    return [*body.lines, *(form.format(body.name(expression)) for form, expression in wanted)]


def _dispatch(count: int) -> str:
    """What finds the stencil of a thread."""
    given = "const Frame &f, int element, int step, Long thread, Do go"
    lines = [f"template <class Do> DEVICE void on_stencil({given}) {{"]
    for index in range(count):
        lines.append(f"  if (thread < f.stencils[{index}]) {{")
        lines.append(f"    go(Stencil{index}(f, element, step), {index}, thread);")
        lines += ["    return;", "  }", f"  thread -= f.stencils[{index}];"]
    return "\n".join([*lines, "}\n"])
