"""Parts of other materials, predicted while the twin moves."""

import html
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from model.bundle import TwinBundle
from model.edit import edit_part, predictor_of
from model.errors import InputError
from model.playground.colors import Colors, material_of
from model.playground.session import Session
from model.priors.materials import MATERIALS

if TYPE_CHECKING:
    import viser

AS_IT_WAS = "as it was"


def remade(original: TwinBundle, materials: Mapping[int, str]) -> TwinBundle:
    """The twin with these parts of other materials, as `matphys edit` makes it.

    Raises:
        InputError: as `edit_part` does.
    """
    twin, predictor = original, predictor_of(original) if materials else None
    for part, material in sorted(materials.items()):
        twin = edit_part(twin, part, material, predictor=predictor)
    return twin


class MaterialPicker:
    """Which part, which material, and a button; nothing where the twin does not say what its parts are."""

    def __init__(self, gui: "viser.GuiApi", session: Session, colors: Colors) -> None:
        """Put it beside the stage."""
        self._session, self._colors, self._original = session, colors, session.bundle
        self._materials = dict[int, str]()
        if not self._original.parts:
            return
        self._labels = [f"{number}: {record.label}" for number, record in enumerate(self._original.parts)]
        with gui.add_folder("Another material"):
            self._part = gui.add_dropdown("Part", self._labels, initial_value=self._labels[0])
            self._material = gui.add_dropdown("Made of", (AS_IT_WAS, *MATERIALS), initial_value=AS_IT_WAS)
            self._button = gui.add_button("Predict its springs")
            self._said = gui.add_html(_small(*self._lines()))
        self._button.on_click(self._clicked)

    def _clicked(self, _: Any) -> None:  # noqa: ANN401 - viser's event
        """Predict beside all else: it takes seconds."""
        part, material = self._labels.index(self._part.value), self._material.value
        wanted = {number: made for number, made in self._materials.items() if number != part}
        if material != AS_IT_WAS:
            wanted[part] = material
        self._button.disabled = True
        self._said.content = _small("predicting its springs")
        threading.Thread(target=self._predict, args=(wanted,), name="materials", daemon=True).start()

    def _predict(self, wanted: dict[int, str]) -> None:
        doubts: list[str] = []
        try:
            twin = remade(self._original, wanted)
            doubts += [
                line
                for line in twin.manifest.warnings[len(self._original.manifest.warnings) :]
                if "by its user" not in line
            ]
            self._materials, self._colors.bundle = wanted, twin
            self._session.remake(twin)
        except InputError as error:
            doubts = [str(error)]
        finally:
            self._said.content = _small(*self._lines(), *doubts)
            self._button.disabled = False

    def _lines(self) -> list[str]:
        """What each part is made of now."""
        parts = range(len(self._labels))
        return [f"{self._labels[i]}: {material_of(self._colors.bundle, i) or 'not known'}" for i in parts]


def _small(*lines: str) -> str:
    """Words of a bundle are no markup."""
    return '<div style="padding:0 1em;font-size:0.85em">' + "<br>".join(map(html.escape, lines)) + "</div>"
