"""What was predicted of a case as two files: arrays, and JSON to read."""

import json
from pathlib import Path

import numpy as np

from model.formats.files import replacing
from model.formats.parameters import encode_parameters
from model.predictor.sample import GLOBALS, Prediction
from model.types import Parameters


def write_prediction(folder: Path, name: str, parameters: Parameters, prediction: Prediction) -> None:
    """Write `NAME.npz` and `NAME.json`.

    `NAME.npz` holds, in the order of the case's topology: `stiffness` [E] and `controller_stiffness` [S]
    [N/m], as a twin takes them; `log_modulus` and `log_modulus_spread` [E], `part_log_modulus` and
    `part_log_spread` [K], of the natural logarithm of the modulus [Pa]; `global_mean` and `global_spread` [4]
    of ln `dashpot_damping`, ln `drag_rate`, ln `friction` and logit `restitution`. `NAME.json` holds
    `parameters` as in a twin's `parameters.json`, `parts` (median modulus [Pa] and spread of its logarithm)
    and `warnings`.

    Args:
        folder: Made if missing.
        name: Of the case.
        parameters: As a twin takes them.
        prediction: Of this case alone.

    Raises:
        InputError: nothing can be written there.
    """
    beliefs = {
        "log_modulus": prediction.log_modulus,
        "log_modulus_spread": prediction.log_modulus_spread,
        "part_log_modulus": prediction.part_log_modulus,
        "part_log_spread": prediction.part_log_spread,
        "global_mean": prediction.global_mean[0],
        "global_spread": prediction.global_log_spread[0],
    }
    arrays = {key: value.detach().cpu().numpy() for key, value in beliefs.items()}
    arrays |= {"stiffness": parameters.stiffness, "controller_stiffness": parameters.controller_stiffness}
    with replacing(folder / f"{name}.npz") as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
    moduli = np.exp(arrays["part_log_modulus"].astype(np.float64))
    text = {
        "parameters": json.loads(encode_parameters(parameters)),
        "parts": [
            {"modulus": float(modulus), "unit": "Pa", "spread": float(spread)}
            for modulus, spread in zip(moduli, arrays["part_log_spread"], strict=True)
        ],
        "order_of_globals": list(GLOBALS),
        "warnings": list(parameters.warnings),
    }
    with replacing(folder / f"{name}.json") as temporary:
        temporary.write_text(json.dumps(text, indent=1))
