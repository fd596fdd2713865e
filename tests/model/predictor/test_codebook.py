import torch

from model.predictor.codebook import Codebook, WithoutCodebook


def test_a_belief_is_the_mean_of_its_materials():
    torch.manual_seed(0)
    book = Codebook(32)
    belief = torch.zeros(2, 10)
    belief[0, 3] = 1.0
    belief[1, [0, 9]] = torch.tensor([0.25, 0.75])
    found = book(belief)
    torch.testing.assert_close(found[0], book.embeddings[3])
    torch.testing.assert_close(found[1], 0.25 * book.embeddings[0] + 0.75 * book.embeddings[9])
    assert torch.pdist(book.embeddings).min() > 0.5  # materials start apart


def test_without_a_codebook_materials_are_alike():
    found = WithoutCodebook(32)(torch.eye(10))
    assert found.shape == (10, 32)
    assert (found == 0.0).all()
