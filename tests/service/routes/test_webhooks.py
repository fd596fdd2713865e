import pytest


def test_a_tenant_learns_its_secret_and_no_other(serving, http):
    secret = http.get("/webhook-secret").json()["secret"]
    assert secret.startswith("whsec_")
    assert http.get("/webhook-secret").json()["secret"] == secret
    with serving.client("other") as other:
        assert other.get("/webhook-secret").json()["secret"] != secret


@pytest.mark.parametrize("scopes", [("read",)])
def test_who_may_only_read_does_not(serving, scopes):
    with serving.client(scopes=scopes) as reader:
        assert reader.get("/webhook-secret").status_code == 403
