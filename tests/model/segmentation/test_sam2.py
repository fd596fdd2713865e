from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from model.errors import InputError, MissingDependencyError
from model.segmentation import Sam2Segmenter
from model.types import Prompt

transformers = pytest.importorskip("transformers")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A random SAM 2 of a million parameters, in the hub's format."""
    backbone = {
        "model_type": "sam2_hiera_det_model",
        "hidden_size": 8,
        "blocks_per_stage": [1, 1, 2, 1],
        "embed_dim_per_stage": [8, 16, 32, 64],
        "num_attention_heads_per_stage": [1, 1, 2, 4],
        "global_attention_blocks": [3],
        "image_size": [64, 64],
        "window_positional_embedding_background_size": [4, 4],
        "window_size_per_stage": [4, 2, 4, 2],
    }
    config = transformers.Sam2VideoConfig(
        image_size=64,
        vision_config={
            "backbone_config": backbone,
            "backbone_channel_list": [64, 32, 16, 8],
            "backbone_feature_sizes": [[16, 16], [8, 8], [4, 4]],
            "fpn_hidden_size": 128,
        },
        prompt_encoder_config={"hidden_size": 128, "image_size": 64, "mask_input_channels": 4},
        mask_decoder_config={
            "hidden_size": 128,
            "mlp_dim": 32,
            "num_attention_heads": 2,
            "iou_head_hidden_dim": 16,
        },
        memory_attention_hidden_size=128,
        memory_attention_num_layers=1,
        memory_attention_feed_forward_hidden_size=32,
        memory_attention_rope_feat_sizes=[4, 4],
        memory_encoder_hidden_size=128,
        memory_encoder_output_channels=64,
        mask_downsampler_embed_dim=128,
        memory_fuser_embed_dim=128,
        memory_fuser_intermediate_dim=32,
        memory_fuser_num_layers=1,
    )
    torch.manual_seed(0)
    path = tmp_path_factory.mktemp("sam2")
    transformers.Sam2VideoModel(config).save_pretrained(path)
    return path


def test_runs_from_the_classical_keyframe(folder, make_scene):
    frames, objects, _ = make_scene(6)
    segmenter = Sam2Segmenter(folder)
    masks = segmenter(frames, Prompt())
    assert masks.object.shape == masks.hand.shape == objects.shape
    # A mask prompt comes back as it was given, at the model's own resolution.
    overlap = (masks.object[0] & objects[0]).sum() / (masks.object[0] | objects[0]).sum()
    assert overlap > 0.6
    assert not (masks.object & masks.hand).any()
    again = segmenter(frames, Prompt())
    np.testing.assert_array_equal(masks.object, again.object)


def test_a_box_is_handed_to_the_model(folder, make_scene):
    frames, _, _ = make_scene(5)
    boxed = Sam2Segmenter(folder)(frames, Prompt(box=(45, 50, 62, 48), keyframe=2))
    assert boxed.keyframe == 2
    assert boxed.object[2].any()


def test_a_users_mask_is_taken_as_it_is(folder, make_scene):
    frames, objects, _ = make_scene(5)
    masks = Sam2Segmenter(folder)(frames, Prompt(mask=objects[1], keyframe=1))
    np.testing.assert_array_equal(masks.object[1], objects[1])


def test_weights_are_named_by_their_hash(folder, monkeypatch):
    monkeypatch.setenv("MATPHYS_SAM2", str(folder))
    assert len(Sam2Segmenter().weights or "") == 64


def test_missing_weights_are_named(tmp_path, monkeypatch):
    monkeypatch.delenv("MATPHYS_SAM2", raising=False)
    with pytest.raises(MissingDependencyError, match="MATPHYS_SAM2"):
        Sam2Segmenter()
    with pytest.raises(MissingDependencyError, match=r"config\.json: no such file"):
        Sam2Segmenter(tmp_path)


def test_a_hand_that_comes_later_is_found(folder, make_scene):
    """SAM 2 follows what it is shown on the keyframe."""
    frames, _, _ = make_scene(8)
    bare, _, _ = make_scene(8, hand=False)
    late = replace(frames, images=np.concatenate([bare.images[:4], frames.images[4:]]))
    masks = Sam2Segmenter(folder)(late, Prompt(keyframe=0))
    assert not masks.hand[:4].any()
    assert masks.hand[5:].any((1, 2)).all()


def test_weights_that_lack_something_are_refused(folder, make_scene, tmp_path):
    for file in folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    tensors = load_file(tmp_path / "model.safetensors")
    save_file(dict(sorted(tensors.items())[::2]), tmp_path / "model.safetensors", metadata={"format": "pt"})
    with pytest.raises(InputError, match="it lacks"):
        Sam2Segmenter(tmp_path)(make_scene(4)[0], Prompt())


def test_a_folder_with_something_else_is_refused(tmp_path, make_scene):
    (tmp_path / "config.json").write_text("{}")
    (tmp_path / "model.safetensors").write_bytes(b"nothing")
    with pytest.raises(InputError, match="not a checkpoint of SAM 2"):
        Sam2Segmenter(tmp_path)(make_scene(4)[0], Prompt())
