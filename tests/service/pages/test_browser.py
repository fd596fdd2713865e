"""The page, driven as a person would."""

from pathlib import Path
from typing import ClassVar

import pytest
from playwright.sync_api import expect

from model.job_schema import JobRequest
from service.resources import Resource
from service.routes.twins import TWINS
from worker.kinds import Input, Kind
from worker.record import JobError

DROP = """(label, bytes) => {
  const data = new DataTransfer();
  data.items.add(new File([new Uint8Array(bytes)], "dropped.mp4", { type: "video/mp4" }));
  for (const name of ["dragenter", "dragover", "drop"])
    label.dispatchEvent(new DragEvent(name, { dataTransfer: data, bubbles: true, cancelable: true }));
}"""


class DanceRequest(JobRequest):
    tempo: int = 120


class DanceKind(Kind):
    """Any further kind of job: the page knows nothing of it but this."""

    name: ClassVar[str] = "dance"
    queue: ClassVar[str] = "twins"
    options: ClassVar = DanceRequest
    inputs: ClassVar = {"camera": Input("camera")}
    limit_s: ClassVar[float] = 1.0

    def run(self, run):
        raise NotImplementedError


DANCES = Resource(DanceKind, "/dances", "dance", parent=TWINS)
REPORT = b"""<html><head><style>h1 { color: rgb(1, 2, 3) }</style></head><body><h1>Dance</h1>
<p style="color: rgb(4, 5, 6)">well</p><script>document.title = "hacked"</script>
<img src="x" onerror="document.title = 'hacked'"></body></html>"""


def begin(serving, job_id):
    return serving.records.begin(job_id, "token", "worker")


def test_a_wrong_key_is_told_and_a_right_one_is_kept_for_this_tab_alone(open_page, serving):
    page = open_page(key=False)
    expect(page.get_by_role("heading", name="New twin")).to_be_hidden()
    page.get_by_label("API key", exact=True).fill("mp_nonsense")
    page.get_by_role("button", name="Continue").click()
    expect(page.get_by_role("alert").filter(has_text="API key")).to_be_visible()
    page.get_by_label("API key", exact=True).fill(serving.keys.create("me", "default", ("read",))[1])
    page.keyboard.press("Enter")
    expect(page.get_by_text("None yet.")).to_be_visible()
    page.reload()
    expect(page.get_by_text("None yet.")).to_be_visible()
    assert page.evaluate("localStorage.length") == 0
    assert page.context.cookies() == []
    page.get_by_role("button", name="Forget the key").click()
    expect(page.get_by_label("API key", exact=True)).to_be_visible()
    assert page.evaluate("sessionStorage.getItem('matphys.key')") is None


def test_a_dropped_clip_is_watched_to_its_end(open_page, serving, film, twin_files, tmp_path):
    page = open_page()
    page.locator(".drop").evaluate(DROP, list(film))
    expect(page.locator(".drop")).to_contain_text("dropped.mp4")
    page.get_by_role("button", name="Make the twin").click()
    expect(page.get_by_role("heading", name="dropped.mp4")).to_be_visible()
    expect(page.locator(".job .badge")).to_have_text("queued")
    job_id = page.url.rsplit("/", 1)[1]
    attempt = begin(serving, job_id)
    for stage, progress in (("segmentation", 12.0), ("tracking", 40.0)):
        serving.records.advance(job_id, attempt, stage, progress)
        expect(page.locator(".stages [aria-current=step]")).to_have_text(stage, timeout=4000)
        expect(page.locator(".job progress")).to_have_js_property("value", progress)
    expect(page.locator("#announce")).to_have_text("tracking, 40 %")
    finish(serving, job_id, attempt, twin_files, tmp_path)
    expect(page.locator(".job .badge")).to_have_text("succeeded", timeout=4000)
    expect(page.locator("#list .badge")).to_have_text("succeeded")
    expect(page.locator(".stages li")).to_have_count(3)
    expect(page.get_by_role("heading", name="Parts")).to_be_visible()


def test_stages_are_shown_also_where_a_proxy_holds_events_back(open_page, serving, new_twin):
    job_id = new_twin()
    page = open_page(key=False)
    page.route("**/events", lambda route: route.abort())
    page.evaluate(f"location.hash = '#/twins/{job_id}'")
    page.get_by_label("API key", exact=True).fill(serving.keys.create("me", "default", ("read",))[1])
    page.keyboard.press("Enter")
    expect(page.locator(".job .badge")).to_have_text("queued")
    serving.records.advance(job_id, begin(serving, job_id), "tracking", 40.0)
    expect(page.locator(".job .now")).to_contain_text("tracking, 40 %", timeout=12_000)


def test_events_that_break_off_are_resumed(open_page, serving, new_twin):
    job_id = new_twin()
    page = open_page()
    asked = []

    def break_the_first(route):
        asked.append(route.request.headers.get("last-event-id"))
        if len(asked) > 1:
            route.fallback()
            return
        data = '{"status": "running", "stage": "video", "progress": 1, "attempt": 0}'
        body = f"id: 7-0\ndata: {data}\n\nid: 8-0\nda"
        route.fulfill(body=body, content_type="text/event-stream")

    page.route("**/events", break_the_first)
    page.locator("#list a").click()
    expect(page.locator(".stages")).to_contain_text("video")
    attempt = begin(serving, job_id)
    serving.records.advance(job_id, attempt, "tracking", 40.0)
    expect(page.locator(".stages")).to_contain_text("tracking", timeout=4000)
    assert asked == [None, "7-0"]


def test_a_finished_twin_is_read_watched_and_downloaded(open_page, serving, new_twin, twin_files, tmp_path):
    job_id = new_twin()
    serving.finish(job_id, twin_files, tmp_path)
    page = open_page()
    page.locator("#list a").click()
    video = page.locator("video")
    expect(video).to_have_js_property("readyState", 4)
    expect(video).to_have_js_property("videoWidth", 64)
    part = page.locator(".part")
    for text in ("6.56 ± 1.9 N/m", "2 to 12 N/m, 42 springs", "44.4 g", "12.2 × 17 × 6 cm", "fabric70 %"):
        expect(part).to_contain_text(text)
    expect(part.locator("img")).to_have_js_property("naturalWidth", 1)
    damping = page.locator(".parameters tr").nth(1)
    expect(damping).to_have_text("dashpot damping0.005520.004N·s/mprior")
    expect(page.locator(".parameters")).to_contain_text("(0, 0, -9.81)m/s²user")
    doubts = page.locator(".warnings li")
    expect(doubts).to_have_text(["prior: is a stub", "<img src=x onerror=document.title='hacked'>"])
    expect(page.locator(".origin")).to_contain_text("assumed: <b>0.3 m</b>")
    expect(page.locator(".spark figcaption")).to_contain_text("mean 80 %, at the end 60 %")
    assert page.title() == "MatPhys"
    with page.expect_download() as download:
        page.get_by_role("button", name="bundle.twin.zip").click()
    assert download.value.suggested_filename == "bundle.twin.zip"
    assert Path(download.value.path()).read_bytes() == twin_files["bundle.twin.zip"]


def test_an_export_is_made_when_it_is_asked_for(open_page, serving, new_twin, twin_files, tmp_path):
    job_id = new_twin()
    serving.finish(job_id, twin_files, tmp_path)
    page = open_page()
    page.locator("#list a").click()
    # what comes in above the button moves it: a click that begins before and ends after is none
    expect(page.locator(".parameters")).to_contain_text("dashpot damping")
    expect(page.locator(".result video")).to_have_js_property("autoplay", True)
    with page.expect_download() as download:
        page.get_by_role("button", name="PLY").click()
        expect(page.locator(".export-state")).to_have_text("Making ply …")
        (export,) = serving.records.children(job_id)
        serving.finish(export.id, {"twin.ply": b"ply"}, tmp_path)
    assert download.value.suggested_filename == "twin.ply"
    expect(page.locator(".export-state")).to_have_text("")


def test_why_a_job_failed_is_read(open_page, serving, new_twin):
    job_id = new_twin()
    attempt = begin(serving, job_id)
    serving.records.advance(job_id, attempt, "segmentation", 12.0)
    fail(serving, job_id, attempt, "clip.mp4: nothing moves; give a box")
    page = open_page()
    page.locator("#list a").click()
    expect(page.locator(".job").get_by_role("alert")).to_contain_text("nothing moves; give a box")
    expect(page.locator(".stages li.broken")).to_contain_text("segmentation")
    expect(page.locator(".job").get_by_role("button", name="Cancel")).to_be_hidden()


def test_a_job_is_canceled_and_deleted(open_page, serving, new_twin):
    job_id = new_twin()
    page = open_page()
    page.locator("#list a").click()
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator(".job .badge")).to_have_text("canceled")
    page.get_by_role("button", name="Delete").click()
    expect(page.get_by_text("None yet.")).to_be_visible()
    assert serving.records.get(job_id) is None


def test_what_the_service_refuses_is_read(open_page, tmp_path, serving):
    page = open_page()
    page.get_by_role("button", name="Make the twin").click()
    alert = page.locator("#new").get_by_role("alert")
    expect(alert).to_have_text("Choose a clip first.")
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(b"no film")
    page.locator("#clip").set_input_files(broken)
    page.get_by_text("What you know of it").click()
    page.get_by_label("Size [m]").fill("1000")
    page.get_by_role("button", name="Make the twin").click()
    expect(alert).to_contain_text("Size [m]: ")
    page.get_by_label("Size [m]").fill("0.2")
    with page.expect_response("**/twins") as response:
        page.get_by_role("button", name="Make the twin").click()
    expect(alert).to_contain_text(response.value.json()["title"])
    assert list(serving.stored()) == []


def test_an_upload_that_broke_off_is_sent_again_under_the_same_key(open_page, serving, clip_file):
    page = open_page()
    keys = []

    def break_the_first(route):
        if route.request.method != "POST":
            route.fallback()
            return
        keys.append(route.request.headers["idempotency-key"])
        if len(keys) == 1:
            route.abort()
        else:
            route.fallback()

    page.route("**/twins", break_the_first)
    page.locator("#clip").set_input_files(clip_file)
    button = page.get_by_role("button", name="Make the twin")
    button.click()
    expect(page.locator("#new").get_by_role("alert")).to_contain_text("nothing is made twice")
    button.click()
    expect(page.locator(".job .badge")).to_have_text("queued")
    page.locator("#clip").set_input_files(clip_file)
    with page.expect_response("**/twins"):
        button.click()
    assert keys[0] == keys[1] != keys[2]
    assert len(serving.records.list("default", "twin")[0]) == 1


def test_a_read_only_key_is_told_what_it_may_not(open_page, serving, clip_file):
    page = open_page(key=False)
    page.get_by_label("API key", exact=True).fill(serving.keys.create("me", "default", ("read",))[1])
    page.keyboard.press("Enter")
    page.locator("#clip").set_input_files(clip_file)
    page.get_by_role("button", name="Make the twin").click()
    expect(page.locator("#new").get_by_role("alert")).to_contain_text("does not allow")


def test_the_keyboard_is_enough(open_page, serving, new_twin):
    new_twin()
    page = open_page()
    page.get_by_role("link", name="MatPhys").focus()
    reached = []
    for _ in range(12):
        page.keyboard.press("Tab")
        reached.append(
            page.evaluate("document.activeElement.id || document.activeElement.textContent.trim()")
        )
    for wanted in ("forget", "clip", "What you know of it", "Make the twin"):
        assert wanted in reached, reached
    page.locator("#list a").focus()
    page.keyboard.press("Enter")
    expect(page.locator(".job .badge")).to_have_text("queued")


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (320, "light"), (1280, "light")])
def test_nothing_is_wider_than_the_screen_and_everything_can_be_read(
    open_page, serving, new_twin, twin_files, tmp_path, scheme, width
):
    serving.finish(new_twin(), twin_files, tmp_path)
    page = open_page(width=width, color_scheme=scheme)
    page.locator("#list a").click()
    expect(page.get_by_role("heading", name="How it was made")).to_be_visible()
    for folded in page.locator("details:not(.logs)").all():
        folded.evaluate("node => { node.open = true }")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    worst = page.evaluate((Path(__file__).parent / "contrast.js").read_text())
    assert worst["ratio"] >= 4.5, worst


def test_a_further_kind_of_job_is_started_and_its_report_read(
    open_page, serve, new_twin, twin_files, tmp_path
):
    serving = serve(children=(DANCES,))
    twin = new_twin(serving)
    serving.finish(twin, twin_files, tmp_path)
    page = open_page(at=serving)
    page.locator("#list a").click()
    section = page.locator(".child")
    expect(section.get_by_role("heading", name="Dance")).to_be_visible()
    section.get_by_text("More").click()
    section.get_by_label("Tempo").fill("90")
    section.get_by_role("button", name="Start").click()
    expect(section.locator(".badge")).to_have_text("queued")
    (dance,) = [child for child in serving.records.children(twin) if child.kind == "dance"]
    assert dance.options["tempo"] == 90
    serving.finish(dance.id, {"report.html": REPORT, "report.json": b"{}"}, tmp_path)
    title = section.locator(".report h1")
    expect(title).to_have_text("Dance", timeout=10_000)
    expect(title).to_have_css("color", "rgb(1, 2, 3)")
    expect(section.locator(".report p")).to_have_css("color", "rgb(4, 5, 6)")
    page.reload()
    expect(page.locator(".report h1")).to_have_text("Dance")
    assert page.title() == "MatPhys"


def test_a_diagnosis_is_asked_for_and_its_verdict_read(
    open_page, serving, new_twin, twin_files, observation, tmp_path
):
    twin = new_twin()
    serving.finish(twin, twin_files, tmp_path)
    page = open_page()
    page.locator("#list a").click()
    section = page.locator('[data-kind="diagnosis"]')
    expect(section.get_by_role("heading", name="Diagnose")).to_be_visible()
    section.get_by_role("button", name="Start").click()
    expect(section.locator("form .problem")).to_contain_text("observation is missing")
    expect(section).to_contain_text("instead of an observation")
    (tmp_path / "seen.npz").write_bytes(observation)
    section.get_by_label("Observation").set_input_files(tmp_path / "seen.npz")
    section.get_by_role("button", name="Start").click()
    expect(section.locator(".run .badge")).to_have_text("queued")
    (diagnosis,) = [child for child in serving.records.children(twin) if child.kind == "diagnosis"]
    report = b"<html><body><h1>Wind is missing.</h1></body></html>"
    serving.finish(diagnosis.id, {"report.html": report, "report.json": b"{}"}, tmp_path)
    expect(section.locator(".report h1")).to_have_text("Wind is missing.", timeout=10_000)
    with page.expect_download() as downloading:
        section.get_by_role("button", name="report.html").click()
    assert downloading.value.suggested_filename == "report.html"


def finish(serving, job_id, attempt, files, tmp_path):
    published = []
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
        published.append(serving.storage.publish(f"jobs/{job_id}/{attempt}/{name}", tmp_path / name))
    serving.records.succeed(job_id, attempt, published, {})


def fail(serving, job_id, attempt, detail):
    error = JobError(type="bad-input", title="The input cannot be used", detail=detail)
    serving.records.fail(job_id, attempt, error)
