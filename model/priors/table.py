"""What soft objects of each material are like: one row per material and property, with its reason.

All values are effective ones of the twin, not of the fibre or the sheet metal: a stuffed toy is mostly air, a
reconstructed cloth is thicker than the woven one, and what is rigid at our resolution need not be stiffer than
that. The anchors "ln Y" are spring constants per strain that fits of PhysTwin-like models found or were told
(with mass 1 per point, d ≈ 15 mm between neighbours, about 30 of them): in a random network the speed of sound
is c² ≈ 3 Y d, so the modulus they mean is E ≈ 3 ρ Y d.
"""

# ruff: noqa: E501 - a table reads row by row
from dataclasses import dataclass

from model.types import ShapeClass

SPECIFIC_STIFFNESS_CEILING = 5000.0
"""Largest stiffness over density in the table [m²/s²].

Sound then crosses a 15 mm spring in 0.2 ms, some 200 substeps per video frame: what an explicit mass-spring
twin still affords. The true moduli of metal, wood, hard plastic and paper (1e9 Pa and more) only differ from it
by strains far below a pixel.
"""


@dataclass(frozen=True)
class Row:
    """One property of one material."""

    material: str
    property: str
    solid: float
    sheet: float
    rope: float
    spread: float
    """Standard deviation of the natural logarithm."""
    source: str

    def value(self, shape_class: ShapeClass) -> float:
        """The typical value (median) in that shape."""
        return {"solid": self.solid, "sheet": self.sheet, "rope": self.rope}[shape_class]


STIFFNESS = (
    Row("fabric", "stiffness", 2.5e3, 2e4, 1.5e4, 0.8, "stuffed: skins wrinkle over loose filling; sheet and rope: yarns slide, so they bend 10-50 times softer than they stretch"),
    Row("leather", "stiffness", 1.5e4, 1e5, 6e4, 0.8, "between dense plush and solid rubber; skins wrinkle, straps bend"),
    Row("rubber", "stiffness", 5e5, 1e6, 1e6, 0.8, "silicone Dragon Skin 10 measured 264 kPa, ln Y 9.2 means 5e5, Shore A 30 about 1e6"),
    Row("plastic", "stiffness", 1e6, 2e6, 2e6, 1.0, "soft vinyl 1e6-1e7, hollow toys give at the wall; capped by the ceiling"),
    Row("metal", "stiffness", 5e6, 5e6, 5e6, 0.7, "rigid (7e10 and more): capped; chains and cables bend freely"),
    Row("wood", "stiffness", 2e6, 2e6, 2e6, 0.7, "rigid (1e10): capped"),
    Row("paper", "stiffness", 5e4, 2e5, 1e5, 0.9, "crumpled balls and thin boxes give at their folds; a sheet bends long before it stretches"),
    Row("silk", "stiffness", 2e3, 1.5e4, 1e4, 0.8, "softer filling, finer weave and smoother yarns than fabric"),
    Row("denim", "stiffness", 5e3, 5e4, 3e4, 0.8, "heavy twill: two to three times a plain weave"),
    Row("fur", "stiffness", 2e3, 2e4, 1e4, 0.8, "plush toys: knitted backing over loose stuffing, limbs hang by their own weight"),
)  # fmt: skip

DAMPING = (
    Row("fabric", "damping", 0.15, 0.10, 0.15, 0.6, "fibre friction: loss factors 0.2-0.4 in textile assemblies, half of that as a ratio"),
    Row("leather", "damping", 0.10, 0.10, 0.10, 0.6, "collagen network, less sliding than woven yarns"),
    Row("rubber", "damping", 0.05, 0.05, 0.05, 0.6, "silicone cantilever measured 0.05; filled rubbers up to 0.1"),
    Row("plastic", "damping", 0.04, 0.04, 0.04, 0.6, "loss tangents of soft vinyl and polyolefins 0.05-0.1"),
    Row("metal", "damping", 0.02, 0.02, 0.05, 0.7, "joints rather than the metal (1e-3); chains rub"),
    Row("wood", "damping", 0.03, 0.03, 0.03, 0.6, "loss factor 0.01-0.1 with joints"),
    Row("paper", "damping", 0.06, 0.06, 0.06, 0.6, "loss tangent about 0.05-0.1, creases add"),
    Row("silk", "damping", 0.12, 0.08, 0.12, 0.6, "smoother filaments slide with less loss than cotton"),
    Row("denim", "damping", 0.15, 0.15, 0.15, 0.6, "tight twill: as fabric, more yarn contacts"),
    Row("fur", "damping", 0.20, 0.15, 0.20, 0.6, "loose stuffing and pile: plush stops within two or three swings"),
)  # fmt: skip

DRAG_RATE = (
    Row("fabric", "drag_rate", 0.5, 2.0, 0.5, 0.9, "½ρ_air C v / areal mass is 1.8 at 0.2 kg/m² and 0.5 m/s; anchors: light cloth 5, heavy 1"),
    Row("leather", "drag_rate", 0.3, 0.7, 0.3, 0.9, "areal mass about 0.8 kg/m²"),
    Row("rubber", "drag_rate", 0.2, 0.4, 0.2, 0.9, "heavy for its surface: air hardly matters"),
    Row("plastic", "drag_rate", 0.3, 1.5, 0.3, 0.9, "film 0.05-0.5 kg/m²; hollow toys light"),
    Row("metal", "drag_rate", 0.1, 0.2, 0.1, 0.9, "heaviest for its surface"),
    Row("wood", "drag_rate", 0.2, 0.4, 0.2, 0.9, "600 kg/m³: a third of what fabric solids feel"),
    Row("paper", "drag_rate", 0.8, 4.0, 0.8, 0.9, "80 g/m² sheets drift: the lightest"),
    Row("silk", "drag_rate", 0.6, 4.0, 0.6, 0.9, "60-100 g/m²; anchor: light cloth 5"),
    Row("denim", "drag_rate", 0.4, 1.0, 0.4, 0.9, "400 g/m²; anchor: heavy cloth 1"),
    Row("fur", "drag_rate", 0.7, 1.5, 0.8, 0.9, "pile holds air, stuffing is light"),
)  # fmt: skip

FRICTION = (
    Row("fabric", "friction", 0.5, 0.5, 0.5, 0.4, "cotton on smooth board 0.4-0.6; anchor: rough cloth 1.2 is the upper end"),
    Row("leather", "friction", 0.5, 0.5, 0.5, 0.4, "leather on wood 0.4-0.6"),
    Row("rubber", "friction", 0.8, 0.8, 0.8, 0.4, "rubber on dry hard surfaces 0.6-1.0; anchor 0.6"),
    Row("plastic", "friction", 0.3, 0.3, 0.3, 0.4, "plastics on wood and laminate 0.2-0.4"),
    Row("metal", "friction", 0.3, 0.3, 0.3, 0.4, "metal on wood 0.2-0.5"),
    Row("wood", "friction", 0.4, 0.4, 0.4, 0.4, "wood on wood 0.25-0.5"),
    Row("paper", "friction", 0.4, 0.4, 0.4, 0.4, "paper on laminate 0.3-0.5"),
    Row("silk", "friction", 0.3, 0.3, 0.3, 0.4, "smooth filament: 0.2-0.35"),
    Row("denim", "friction", 0.6, 0.6, 0.6, 0.4, "coarse twill: above plain cotton"),
    Row("fur", "friction", 0.6, 0.6, 0.6, 0.4, "pile interlocks with rough tables, slides on smooth ones"),
)  # fmt: skip

RESTITUTION = (
    Row("fabric", "restitution", 0.10, 0.05, 0.10, 0.5, "anchor: cloth 0.1; a sheet lands dead"),
    Row("leather", "restitution", 0.20, 0.10, 0.15, 0.5, "between cloth and rubber"),
    Row("rubber", "restitution", 0.50, 0.30, 0.40, 0.4, "anchor: rubber 0.5; thin pieces bend instead of bouncing"),
    Row("plastic", "restitution", 0.40, 0.20, 0.30, 0.4, "hollow toys 0.3-0.6"),
    Row("metal", "restitution", 0.40, 0.30, 0.20, 0.4, "on a wooden table 0.3-0.5; chains collapse"),
    Row("wood", "restitution", 0.40, 0.40, 0.40, 0.4, "wood on wood 0.4-0.6"),
    Row("paper", "restitution", 0.15, 0.05, 0.10, 0.5, "crumples where it lands"),
    Row("silk", "restitution", 0.10, 0.05, 0.10, 0.5, "anchor: cloth 0.1"),
    Row("denim", "restitution", 0.10, 0.05, 0.10, 0.5, "anchor: cloth 0.1"),
    Row("fur", "restitution", 0.10, 0.05, 0.10, 0.5, "stuffing takes up the blow"),
)  # fmt: skip

DENSITY = (
    Row("fabric", "density", 110.0, 300.0, 500.0, 0.4, "stuffed toys and cushions 60-150; 0.25 kg/m² at 0.8 mm; twisted cotton rope"),
    Row("leather", "density", 200.0, 800.0, 800.0, 0.4, "stuffed skin; leather 0.7-1.0 g/cm³"),
    Row("rubber", "density", 1100.0, 1100.0, 1100.0, 0.3, "silicone 1070, natural rubber 930-1200"),
    Row("plastic", "density", 300.0, 900.0, 900.0, 0.6, "hollow toys; polyolefins 900-950, vinyl 1300"),
    Row("metal", "density", 2700.0, 2700.0, 2500.0, 0.6, "aluminium 2700, hollow steel alike; chains have gaps"),
    Row("wood", "density", 600.0, 600.0, 600.0, 0.3, "softwood 450 to hardwood 750"),
    Row("paper", "density", 100.0, 700.0, 400.0, 0.5, "boxes and crumpled balls; office paper 700-800"),
    Row("silk", "density", 100.0, 250.0, 500.0, 0.4, "stuffed cushion; 80 g/m² at 0.3 mm; twisted cord"),
    Row("denim", "density", 150.0, 400.0, 550.0, 0.4, "heavier cover; 0.4 kg/m² at 1 mm; twisted"),
    Row("fur", "density", 80.0, 150.0, 150.0, 0.4, "plush toys 60-120; pile holds air"),
)  # fmt: skip

TABLE = (*STIFFNESS, *DAMPING, *DRAG_RATE, *FRICTION, *RESTITUTION, *DENSITY)
