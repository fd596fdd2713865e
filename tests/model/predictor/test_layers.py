import torch

from model.predictor.layers import Standardise, head, mean_by, perceptron


def test_inputs_are_standardised_and_outliers_drawn_in():
    values = torch.randn(1000, 3, generator=torch.Generator().manual_seed(0)) * torch.tensor([5.0, 0.1, 0.0])
    values += torch.tensor([100.0, -3.0, 2.0])
    layer = Standardise(3)
    layer.fit(values)
    found = layer(values)
    assert found[:, :2].mean(dim=0).abs().max() < 0.1
    assert ((found[:, :2].std(dim=0) - 0.8).abs() < 0.1).all()
    assert (found[:, 2] == 0.0).all()  # what never varied
    assert (layer(values + 1e9).abs() < 6.01).all()
    assert not list(layer.parameters())


def test_before_a_fit_small_values_pass():
    values = torch.tensor([[0.01, -0.02]])
    torch.testing.assert_close(Standardise(2)(values), values, rtol=0.01, atol=0.0)


def test_means_by_group():
    values, group = torch.tensor([[1.0], [2.0], [6.0]]), torch.tensor([2, 0, 2])
    assert mean_by(values, group, 4).tolist() == [[2.0], [0.0], [3.5], [0.0]]
    assert mean_by(values[:, 0], group, 3).tolist() == [2.0, 0.0, 3.5]


def test_a_perceptron_is_normalised_and_a_head_starts_small():
    torch.manual_seed(0)
    inputs = torch.randn(20, 5)
    assert perceptron(5, 16, 0.0)(inputs).std(dim=-1, correction=0).sub(1.0).abs().max() < 0.01
    assert 0.0 < head(5, 16, 2, 0.0)(inputs).abs().max() < 0.02
