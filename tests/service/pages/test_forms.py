from typing import Annotated, Literal

from pydantic import BaseModel, Field

from model.job_schema import TwinRequest
from service.pages.forms import form_fields
from service.pages.offers import make_offer


class Wishes(BaseModel):
    depth_m: Annotated[float, Field(gt=0, le=2, description="How deep.")]
    count: Annotated[int | None, Field(gt=0, lt=9, examples=[4])] = None
    method: Literal["slow", "fast"] = "fast"
    thorough: bool = False
    note: Annotated[str | None, Field(pattern="^[a-z]+$")] = None


def test_every_kind_of_field_gets_its_control():
    fields = {field.name: field for field in form_fields(Wishes)}
    assert [field.control for field in fields.values()] == ["number", "number", "choice", "check", "text"]
    depth, count, method = fields["depth_m"], fields["count"], fields["method"]
    assert (depth.label, depth.help, depth.required) == ("Depth [m]", "How deep.", True)
    assert (depth.minimum, depth.maximum, depth.whole) == (0, 2, False)
    assert (count.minimum, count.maximum, count.whole, count.example) == (1, 9, True, "4")
    assert (method.choices, method.value, method.required) == (("slow", "fast"), "fast", False)
    assert fields["thorough"].value == "False"
    assert fields["note"].pattern == "^[a-z]+$"


def test_a_field_can_be_left_out():
    assert "count" not in {field.name for field in form_fields(Wishes, ["count"])}


def test_a_twin_is_offered_with_all_its_options_but_the_webhook():
    offer = make_offer("twin", "twins", TwinRequest, ("video", "mask"), required=("video",))
    assert {f.name for f in offer.first + offer.more} == set(TwinRequest.model_fields) - {"webhook"}
    assert offer.first[0].name == "size_m"
    assert [(f.name, f.required) for f in offer.files] == [("video", True), ("mask", False)]
    assert (offer.main, offer.title) == ("video", "Twin")
