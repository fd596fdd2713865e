import numpy as np
import torch

from model.predictor.decoders import FIELD, GRIP, SPAN, EdgeDecoder, GlobalDecoder, GripDecoder, PartDecoder
from model.priors.materials import MATERIALS, typical

READ = torch.randn(50, 6, generator=torch.Generator().manual_seed(0))


def test_heads_start_at_the_prior():
    torch.manual_seed(0)
    spread = torch.linspace(0.2, 3.0, 50)
    shift, found = PartDecoder(6, 16, 0.0)(READ, spread)
    assert 0.0 < shift.abs().max() < 0.02
    torch.testing.assert_close(found, spread, rtol=0.02, atol=0.0)
    shift, factor = EdgeDecoder(6, 16, 0.0)(READ)
    assert 0.0 < shift.abs().max() < 0.02
    torch.testing.assert_close(factor, torch.ones(50), rtol=0.02, atol=0.0)
    assert 0.0 < GripDecoder(6, 16, 0.0)(READ).abs().max() < 0.02
    shift, found = GlobalDecoder(6, 16, 0.0)(READ, spread[:, None].expand(50, 4))
    assert 0.0 < shift.abs().max() < 0.02
    torch.testing.assert_close(found, spread[:, None].expand(50, 4), rtol=0.02, atol=0.0)


def loud(decoder):
    with torch.no_grad():
        decoder.head[-1].weight.mul_(1e6)
    return decoder


def test_the_right_material_is_within_reach_of_a_wrong_prior():
    for shape in ("solid", "sheet", "rope"):
        logs = [np.log(typical(material, shape)["stiffness"].mean) for material in MATERIALS]
        assert np.ptp(logs) < SPAN


def test_heads_stay_within_their_limits_and_never_saturate():
    torch.manual_seed(0)
    spread = torch.cat([torch.full((25,), 0.3), torch.full((25,), 3.0)])
    shift, found = loud(PartDecoder(6, 16, 0.0))(READ, spread)
    assert (shift[:25].abs() < 8.0 + 1e-5).all()  # however sure the prior is
    assert (shift[25:].abs() < 12.0 + 1e-5).all()
    assert shift[:25].abs().max() > 7.9
    assert shift[25:].abs().max() > 11.5
    assert (found / spread < 20.1).all()
    assert (found / spread > 0.049).all()
    shift, _ = loud(GlobalDecoder(6, 16, 0.0))(READ, spread[:, None].expand(50, 4))
    assert (shift[:25].abs() < 1.5 + 1e-5).all()
    assert (shift[25:].abs() < 12.0 + 1e-5).all()
    assert shift[25:].abs().max() > 11.5
    assert (loud(EdgeDecoder(6, 16, 0.0))(READ)[0].abs() < FIELD + 1e-6).all()
    assert (loud(GripDecoder(6, 16, 0.0))(READ).abs() < GRIP + 1e-6).all()
    decoder = loud(PartDecoder(6, 16, 0.0)).double()
    shift, _ = decoder(READ.double(), spread.double())
    shift.sum().backward()
    assert all(p.grad.abs().max() > 0.0 for p in (decoder.head[0].weight, decoder.head[-1].weight))
