import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
COMPOSE = ROOT / "docker-compose.yml"
ONE_SHOT = {"store-folder"}


def follows_the_schema(path):
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec", str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=False).returncode == 0


@pytest.fixture(scope="module")
def compose():
    return yaml.safe_load(COMPOSE.read_text())


def test_the_file_follows_the_schema_of_compose(tmp_path):
    assert follows_the_schema(COMPOSE)
    broken = tmp_path / "docker-compose.yml"
    broken.write_text(COMPOSE.read_text().replace("restart:", "restarts:"))
    assert not follows_the_schema(broken)


def test_nothing_refers_to_what_is_not_there(compose):
    volumes, networks, services = compose["volumes"], compose["networks"], compose["services"]
    for name, service in services.items():
        for mount in service.get("volumes", ()):
            assert mount.split(":")[0] in volumes, name
        assert set(service.get("networks", ())) <= set(networks), name
        assert set(service.get("depends_on", ())) <= set(services), name
        for other, state in service.get("depends_on", {}).items():
            if state["condition"] == "service_healthy" and other in ("redis", "store"):
                assert "healthcheck" in services[other]
    used = {mount.split(":")[0] for service in services.values() for mount in service.get("volumes", ())}
    assert used == set(volumes)


def test_every_service_is_confined(compose):
    for name, service in compose["services"].items():
        assert service["read_only"] is True, name
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        if name not in ONE_SHOT:
            assert service["restart"] == "unless-stopped", name
            assert "cap_add" not in service, name


def test_nothing_runs_as_root_but_what_ends_at_once(compose):
    stages = dockerfile_stages()
    for name, service in compose["services"].items():
        if "build" in service:
            user = stages[service["build"]["target"]]
        else:
            user = service.get("user", "0")
        assert (user.split(":")[0] == "0") == (name in ONE_SHOT), name


def test_only_the_front_is_reached_from_outside_and_from_this_machine_alone(compose):
    published = {
        name: service["ports"] for name, service in compose["services"].items() if "ports" in service
    }
    assert published == {"front": ["${MATPHYS_ADDRESS:-127.0.0.1:8000}:8000"]}
    assert compose["networks"]["inside"] == {"internal": True}


def test_there_are_no_secrets_in_the_files():
    text = COMPOSE.read_text()
    for name in ("REDIS_PASSWORD", "STORE_SECRET", "STORE_KEY"):
        for use in re.findall(rf"\${{{name}[^}}]*}}", text):
            assert use == f"${{{name}:?see deploy/env.example}}"
    example = (ROOT / "deploy/env.example").read_text()
    assert re.search(r"^REDIS_PASSWORD=$", example, re.M)
    assert re.search(r"^STORE_SECRET=$", example, re.M)
    variables = set(re.findall(r"\${(\w+)[:}]", text))
    assert variables == set(re.findall(r"^(\w+)=", example, re.M))


def test_workers_have_longer_to_stop_than_they_give_their_jobs(compose):
    worker = compose["services"]["worker"]
    assert int(worker["stop_grace_period"].removesuffix("s")) > int(worker["environment"]["MATPHYS_GRACE"])


def dockerfile_stages():
    """Name of each stage → the user it ends with."""
    users, stage = {}, ""
    for line in (ROOT / "Dockerfile").read_text().splitlines():
        if found := re.match(r"FROM \S+ AS (\w+)", line):
            stage = found[1]
            users[stage] = "0"
        elif found := re.match(r"USER (\S+)", line):
            users[stage] = found[1]
    return users
