"""DINOv2 from a folder of weights; the weights here are tiny and random."""

import hashlib
import shutil
import sys

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from model.encoders.dinov2 import Dinov2Encoder
from model.errors import InputError, MissingDependencyError

transformers = pytest.importorskip("transformers")
SMALL = {
    "hidden_size": 16,
    "num_hidden_layers": 2,
    "num_attention_heads": 2,
    "intermediate_size": 32,
    "patch_size": 14,
    "image_size": 56,
}


@pytest.fixture(scope="module", params=["plain", "registers"])
def checkpoint(request, tmp_path_factory):
    torch.manual_seed(0)
    if request.param == "plain":
        network = transformers.Dinov2Model(transformers.Dinov2Config(**SMALL))
    else:
        config = transformers.Dinov2WithRegistersConfig(**SMALL, num_register_tokens=4)
        network = transformers.Dinov2WithRegistersModel(config)
    folder = tmp_path_factory.mktemp(request.param)
    network.save_pretrained(folder)
    return folder, network.eval()


def picture(height=60, width=90):
    return np.random.default_rng(0).integers(0, 256, (height, width, 3), dtype=np.uint8)


def test_grid_follows_the_aspect_of_the_image(checkpoint):
    encoder = Dinov2Encoder(checkpoint[0])
    features = encoder(picture(60, 90))
    assert features.shape == (25, 37, 16)  # 518 px make 37 patches of 14 px
    assert features.dtype == np.float32
    assert encoder.dim == 16


def test_features_are_the_patch_tokens_alone(checkpoint):
    """At 518 × 518 nothing is resized: the model itself says what the tokens are."""
    folder, network = checkpoint
    image = picture(518, 518)
    normal = (image / 255.0 - [0.485, 0.456, 0.406]) / [0.229, 0.224, 0.225]
    with torch.no_grad():
        pixels = torch.from_numpy(normal.transpose(2, 0, 1)[None].astype(np.float32))
        tokens = network(pixel_values=pixels).last_hidden_state[0].numpy()
    extra = len(tokens) - 37 * 37
    assert extra == (5 if "registers" in folder.name else 1)
    features = Dinov2Encoder(folder)(image)
    np.testing.assert_allclose(features.reshape(-1, 16), tokens[extra:], atol=1e-5)


def test_weights_are_the_hash_of_the_file(checkpoint):
    content = (checkpoint[0] / "model.safetensors").read_bytes()
    assert Dinov2Encoder(checkpoint[0]).weights == hashlib.sha256(content).hexdigest()


def test_folder_may_come_from_the_environment(checkpoint, monkeypatch):
    monkeypatch.setenv("MATPHYS_DINOV2", str(checkpoint[0]))
    assert Dinov2Encoder().dim == 16


def test_without_a_folder_it_says_which_variable_to_set(monkeypatch):
    monkeypatch.delenv("MATPHYS_DINOV2", raising=False)
    with pytest.raises(InputError, match="MATPHYS_DINOV2"):
        Dinov2Encoder()


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({}, "no config.json"),
        ({"config.json": "{"}, "model_type"),
        ({"config.json": "[]"}, "model_type"),
        ({"config.json": '{"model_type": "vit"}'}, "'vit' model"),
        ({"config.json": '{"model_type": "dinov2"}'}, "neither model.safetensors"),
        ({"config.json": '{"model_type": "dinov2"}', "model.safetensors": "rubbish"}, "cannot be loaded"),
    ],
)
def test_a_folder_that_is_no_model_gets_one_line(tmp_path, files, message):
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        Dinov2Encoder(tmp_path)
    assert "\n" not in str(caught.value)


def test_weights_with_a_hole_are_refused(checkpoint, tmp_path):
    shutil.copytree(checkpoint[0], tmp_path / "hole")
    tensors = load_file(checkpoint[0] / "model.safetensors")
    del tensors["layernorm.weight"]
    save_file(tensors, tmp_path / "hole" / "model.safetensors", metadata={"format": "pt"})
    with pytest.raises(InputError, match=r"lack layernorm\.weight"):
        Dinov2Encoder(tmp_path / "hole")


def test_without_transformers_it_says_what_to_install(checkpoint, monkeypatch):
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(MissingDependencyError, match="pip install"):
        Dinov2Encoder(checkpoint[0])
