"""The C++ text of a simulator's kernel: its traced laws in the engine."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch

from model.simulator.kernel import layout
from model.simulator.kernel.corners import Corners
from model.simulator.kernel.expression import Expression
from model.simulator.kernel.groups import KINDS, Group, Kind, key
from model.simulator.kernel.text import Statements

TYPES = {torch.float32: ("float", "int32_t"), torch.float64: ("double", "int64_t")}
"""The number a kernel computes with, and the whole number of its size."""
ENGINE = Path(__file__).with_name("engine")
ONE_BY_ONE = (
    ("vectors", "exponential", "rows", "frame", "edge", "edges"),
    (
        "land",
        "stencils",
        "team",
        "meet",
        "forward",
        "backward",
    ),
)
SIDE_BY_SIDE = ("vectors", "exponential", "frame", "edge"), ("land", "abreast")
"""Files of the engine before and after the traced laws: for worlds one by one, and for many side by side."""
LANES = {
    False: [f"#define LANES {layout.LANES}"],
    True: ["#if SINGLE && defined(__AVX512F__)", "#define LANES 16", "#else", "#define LANES 8", "#endif"],
}
"""How many numbers a vector has: as many as a row, or for worlds side by side as the processor likes."""


def kernel_source(
    groups: Mapping[Kind, Group],
    corners: Sequence[Corners],
    ground: bool,
    dtype: torch.dtype,
    *,
    abreast: bool = False,
) -> str:
    """A whole substep and its adjoint, or a whole substep of many worlds at once.

    Args:
        groups: What pulls the springs and the controller springs, where anything does.
        corners: What acts on small groups of points.
        ground: Whether there is a ground.
        dtype: float32 or float64.
        abreast: Of many worlds, side by side, and without an adjoint.
    """
    number, whole = TYPES[dtype]
    head = [
        "#include <cstdint>",
        f"typedef {number} R;",
        f"typedef {whole} N;",
        f"#define SINGLE {int(dtype == torch.float32)}",
        f"#define GROUND {int(ground)}",
        *(f"#define {kind.upper()} {int(kind in groups)}" for kind in KINDS),
        f"#define STENCILS {len(corners)}",
        *LANES[abreast],
        "",
    ]
    laws, counts = list[str](), (0, 0, 0)
    for kind in KINDS:
        struct = _Struct(kind)
        if kind in groups:
            counts = _fill(struct, groups[kind], counts)
        laws.append(struct.text())
    for index, each in enumerate(corners):
        text, counts = _corners(index, each, counts)
        laws.append(text)
    calls = " ".join(f"{{ Stencil{index} law(f, step); go(law, {index}); }}" for index in range(len(corners)))
    head_of = "template <class Do> INLINE void each_stencil(const Frame &f, int64_t step, Do go)"
    laws.append(f"{head_of} {{ {calls} }}\n")
    parts = SIDE_BY_SIDE if abreast else ONE_BY_ONE
    before, after = ([(ENGINE / f"{name}.cpp").read_text() for name in names] for names in parts)
    return "\n".join([*head, *before, *laws, *after])


@dataclass
class _Struct:
    """The law of one kind of edge as the engine wants it."""

    kind: Kind
    fields: list[str] = field(default_factory=list)
    made: list[str] = field(default_factory=list)
    rest: str = "splat(1)"
    tension: list[str] = field(default_factory=lambda: ["return splat(0);"])
    pull_back: list[str] = field(default_factory=lambda: ["return lengthbar = ratebar = splat(0);"])
    finish: list[str] = field(default_factory=list)

    def text(self) -> str:
        """C++."""
        name = self.kind.capitalize()
        pull_back = "int64_t slot, V length, V rate, V tensionbar, V &lengthbar, V &ratebar"
        methods = {
            f"{name}(const Frame &f, int64_t step)" + (" : " + ", ".join(self.made) if self.made else ""): [],
            "V rest(int64_t slot) const": [f"return {self.rest};"],
            "V tension(int64_t slot, V length, V rate) const": self.tension,
            f"V pull_back({pull_back})": self.pull_back,
            "void finish(const Frame &f, int64_t slice)": self.finish,
        }
        lines = [f"struct {name} {{", *(f"  {each};" for each in self.fields)]
        for head, body in methods.items():
            lines += [f"  LAW {head} {{", *(f"    {line}" for line in body), "  }"]
        return "\n".join([*lines, "};\n"])


def _fill(struct: _Struct, group: Group, before: tuple[int, int, int]) -> tuple[int, int, int]:
    """Write the laws of a group; `before` counts constants per edge, of the scene, and memory of others."""
    edges, scenes, memories = before
    symbols = {"length": "length", "rate": "rate", "dt": "dt", "tension.bar": "tensionbar"}
    sinks = dict[str, str]()
    struct.fields, struct.made = ["V dt"], ["dt(splat(R(f.lasts)))"]
    for given in group.inputs:
        name = key(given.term, given.name)
        if given.each:
            fields, made, symbols[name], sinks[name] = _per_edge(edges)
            struct.fields += fields
            struct.made += made
            edges += 1
        else:
            struct.fields += [f"V s{scenes}", f"V gs{scenes}"]
            struct.made += [f"s{scenes}(scene(f, {scenes}))", f"gs{scenes}(splat(0))"]
            symbols[name] = f"s{scenes}"
            sinks[name] = f"gs{scenes} += {{}};"
            sink = f"f.scene_gradient[{scenes}]"
            struct.finish.append(f"if ({sink}) accumulate({sink} + W * slice, gs{scenes});")
            scenes += 1
    struct.rest = symbols[key(group.inputs[0].term, group.inputs[0].name)]
    rows = f"W * f.{struct.kind.removesuffix('s')}_rows"
    first = memories
    for term, variable in group.memory:
        name = key(term, variable)
        fields, made, symbols[name], symbols[f"{name}.bar"], sinks[name] = _remembered(memories, rows)
        struct.fields += fields
        struct.made += made
        memories += 1
    struct.tension = _tension(group, symbols, first)
    struct.pull_back = _pull_back(group, symbols, sinks)
    return edges, scenes, memories


def _per_edge(index: int) -> tuple[list[str], list[str], str, str]:
    """Fields, their initialisers, how a constant is read, and where its adjoint goes."""
    fields = [f"const R *a{index}", f"R *ga{index}"]
    made = [f"a{index}(f.edge[{index}])", f"ga{index}(f.edge_gradient[{index}])"]
    sink = f"if (ga{index}) accumulate(ga{index} + W * slot, {{}});"
    return fields, made, f"load(a{index} + W * slot)", sink


def _remembered(index: int, rows: str) -> tuple[list[str], list[str], str, str, str]:
    """Fields, initialisers, how a variable is read, its adjoint after a substep, and where that before goes.

    Args:
        index: Of the variable.
        rows: How many numbers there are of it, in C++.
    """
    all_of = f"f.memory[{index}] + f.keep * {rows}"
    fields = [f"const R *m{index}", f"R *n{index}", f"R *b{index}"]
    made = [f"m{index}({all_of} * step)", f"n{index}({all_of} * (step + 1))"]
    made.append(f"b{index}(f.memory_adjoint[{index}])")
    read, bar = f"load(m{index} + W * slot)", f"load(b{index} + W * slot)"
    return fields, made, read, bar, f"store(b{index} + W * slot, {{}});"


def _corners(index: int, corners: Corners, before: tuple[int, int, int]) -> tuple[str, tuple[int, int, int]]:
    """The law of the stencils of a number as the engine wants it."""
    edges, scenes, memories = before
    name, first = f"Stencil{index}", memories
    symbols = {symbol: "{}[{}][{}]".format(*symbol.split(".")) for symbol in corners.symbols} | {"dt": "dt"}
    fields, made, sinks = ["V dt"], ["dt(splat(R(f.lasts)))"], list[str]()
    for given in corners.inputs:
        if given.each:
            more, how, symbols[key(given.term, given.name)], sink = _per_edge(edges)
            edges += 1
        else:
            more, how = [f"V s{scenes}", f"R *gs{scenes}"], [f"s{scenes}(scene(f, {scenes}))"]
            how.append(f"gs{scenes}(f.scene_gradient[{scenes}])")
            symbols[key(given.term, given.name)] = f"s{scenes}"
            sink = f"if (gs{scenes}) accumulate(gs{scenes} + W * slot, {{}});"
            scenes += 1
        fields, made, sinks = [*fields, *more], [*made, *how], [*sinks, sink]
    kept = list[str]()
    for term, variable in corners.memory:
        more, how, read, bar, sink = _remembered(memories, f"W * f.groups[{index}]")
        fields, made, kept = [*fields, *more], [*made, *how], [*kept, sink]
        symbols |= {key(term, variable): read, f"{key(term, variable)}.bar": bar}
        memories += 1
    ahead = Statements([*corners.forces, *corners.updates], symbols)
    back = Statements([*corners.forces, *corners.places, *corners.constants, *corners.memories], symbols)
    stores = [
        f"store(n{first + number} + W * slot, {ahead.name(update)});"
        for number, update in enumerate(corners.updates)
    ]
    forces, bars = _assigned("force", corners.forces, 3), _assigned("bar", corners.places, 6)
    adjoints = zip([*sinks, *kept], [*corners.constants, *corners.memories], strict=True)
    constants = [sink.format(back.name(bar)) for sink, bar in adjoints]
    acts, arguments = "V force[][3]", "int64_t slot, const V x[][8]"
    lines = [
        f"struct {name} {{",
        f"  enum {{ SIZE = {corners.size} }};",
        *(f"  {each};" for each in fields),
        f"  LAW {name}(const Frame &f, int64_t step) : " + ", ".join(made) + " {}",
        f"  LAW void forces({arguments}, {acts}) const {{",
        *(f"    {line}" for line in [*ahead.lines, *stores]),
        *(f"    {f.format(ahead.name(e))}" for f, e in forces),
        "  }",
        f"  LAW void pull_back({arguments}, const V pulled[][4], {acts}, V bar[][6]) const {{",
        *(f"    {line}" for line in back.lines),
        *(f"    {f.format(back.name(e))}" for f, e in [*forces, *bars]),
        *(f"    {line}" for line in constants),
        "  }",
        "};\n",
    ]
    return "\n".join(lines), (edges, scenes, memories)


def _assigned(name: str, values: Sequence[Expression], width: int) -> list[tuple[str, Expression]]:
    """Assignments to the entries of an array of arrays."""
    return [(f"{name}[{i // width}][{i % width}] = {{}};", value) for i, value in enumerate(values)]


def _tension(group: Group, symbols: Mapping[str, str], first: int) -> list[str]:
    body = Statements([group.tension, *group.updates], symbols)
    stores = [
        f"store(n{first + index} + W * slot, {body.name(update)});"
        for index, update in enumerate(group.updates)
    ]
    return [*body.lines, *stores, f"return {body.name(group.tension)};"]


def _pull_back(group: Group, symbols: Mapping[str, str], sinks: Mapping[str, str]) -> list[str]:
    forms = {"length": "lengthbar = {};", "rate": "ratebar = {};", **sinks}
    body = Statements([group.tension, *group.adjoints.values()], symbols)
    flows = [forms[name].format(body.name(adjoint)) for name, adjoint in group.adjoints.items()]
    return [*body.lines, *flows, f"return {body.name(group.tension)};"]
