// The page: a key, a list of twins, and the one that is open.

import { getBlob, getJson, pause, Problem, request, storedKey, storeKey } from "./api.js";
import { $, $$, badge, bytes, clone, cloneAll, fill, moment, save, showProblem, words } from "./dom.js";
import { busy, listFiles, showReport } from "./files.js";
import { acceptDrops, onSubmit } from "./forms.js";
import { buttons, FINAL, watch } from "./job.js";
import { renderTwin } from "./result.js";

const LIST_REFRESH_S = 10;
let opened = new AbortController(); // what is under way for the twin that is open

const names = JSON.parse(sessionStorage.getItem("matphys.names") ?? "{}"); // of clips dropped in this tab
const title = (job) => names[job.id] ?? `Twin ${job.id.slice(-6)}`;
function rememberName(id, name) {
  names[id] = name;
  sessionStorage.setItem("matphys.names", JSON.stringify(names));
}

// -- the key ---------------------------------------------------------------------------------------------------

async function enter() {
  const known = storedKey();
  $("#key").hidden = Boolean(known);
  $("#work").hidden = $("#forget").hidden = !known;
  if (!known) { opened.abort(); $("#key-input").focus(); return; }
  try { await refreshList(); } catch (error) {
    if (error.status === 401 || error.status === 403) { refuse(error); return; }
    showProblem($("#list"), error);
  }
  openFromAddress();
}

function refuse(error) {
  storeKey("");
  enter();
  showProblem($("#key"), error);
}

$("#key form").addEventListener("submit", (event) => {
  event.preventDefault();
  showProblem($("#key"), null);
  storeKey($("#key-input").value.trim());
  $("#key-input").value = "";
  enter();
});
$("#forget").onclick = () => { storeKey(""); location.hash = ""; location.reload(); };

// -- the list --------------------------------------------------------------------------------------------------

let next = null;

async function refreshList(cursor = null) {
  const page = await getJson(`/twins?limit=20${cursor ? `&cursor=${encodeURIComponent(cursor)}` : ""}`);
  const list = $("#list .jobs");
  const rows = page.items.map((job) => {
    const item = fill(clone("job-row"), { name: title(job), when: moment(job.created_at) });
    badge(item, job.status);
    $("a", item).href = `#/twins/${job.id}`;
    return item;
  });
  if (cursor) list.append(...rows); else list.replaceChildren(...rows);
  next = page.next_cursor;
  $("#list .more").hidden = !next;
  $("#list .empty").hidden = Boolean(list.children.length);
  markOpen();
  return page.items.some((job) => !FINAL.has(job.status));
}

$("#list .more").onclick = (event) => busy(event.target, $("#list"), () => refreshList(next));

function markOpen() {
  for (const link of $$("#list a")) {
    if (link.hash === location.hash) link.setAttribute("aria-current", "true"); else link.removeAttribute("aria-current");
  }
}

async function keepListFresh() {
  for (;;) {
    await pause(LIST_REFRESH_S);
    const onFirstPage = $$("#list .jobs li").length <= 20;
    if (storedKey() && onFirstPage && !document.hidden) {
      try { await refreshList(); showProblem($("#list"), null); } catch (error) { showProblem($("#list"), error); }
    }
  }
}

// -- a new twin ------------------------------------------------------------------------------------------------

const form = $("#new form");
const idle = { name: $('[data-slot="name"]', form).textContent, facts: $('[data-slot="facts"]', form).textContent };
const showClip = (file) => fill(form, file ? { name: file.name, facts: `${bytes(file.size)} · choose or drop another` } : idle);

acceptDrops($(".drop"), showClip);
form.addEventListener("submit", (event) => { // before the other listener: the clip cannot be `required`, it is invisible
  if ($("#clip").files.length) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  showProblem(form, { message: "Choose a clip first." });
  $("#clip").focus();
});
onSubmit(form, () => "/twins", (job) => {
  rememberName(job.id, $("#clip").files[0].name);
  form.reset();
  for (const folded of $$("details", form)) folded.open = false;
  showClip(null);
  location.hash = `#/twins/${job.id}`;
  refreshList().catch((error) => showProblem($("#list"), error));
});

// -- the open twin ---------------------------------------------------------------------------------------------

function openFromAddress() {
  const id = /^#\/twins\/([\w-]+)$/.exec(location.hash)?.[1];
  markOpen();
  if (id && storedKey()) open(id).catch((error) => showError(error));
}

function showError(error) {
  if (error.name === "AbortError") return;
  if (error.status === 401) { refuse(error); return; }
  const view = $("#twin");
  if (!$(".problem", view)) view.replaceChildren(cloneAll("twin-view"));
  showProblem(view, error);
}

async function open(id) {
  opened.abort();
  opened = new AbortController();
  const { signal } = opened;
  const view = $("#twin");
  view.replaceChildren(cloneAll("twin-view"));
  const card = $(".job", view);
  const log = $(".logs", card);
  log.ontoggle = () => log.open && showLog(log, `/twins/${id}/logs`, signal);
  if (matchMedia("(max-width: 50rem)").matches) view.scrollIntoView();
  let seen = "";
  const job = await watch(card, `/twins/${id}`, signal, (now) => {
    fill(card, { name: title(now) });
    buttons(card, now, () => { location.hash = ""; view.replaceChildren(); refreshList(); });
    if (seen && seen !== now.status) refreshList().catch(() => {}); // the list tells of its own troubles
    seen = now.status;
  });
  if (job?.status === "succeeded") await showResult($(".result", view), job, signal);
}

async function showLog(log, url, signal) {
  const box = $("pre", log);
  while (log.open && !signal.aborted) {
    try {
      const text = (await (await request(url, { signal })).text()) || "Nothing yet.";
      if (box.textContent !== text) box.textContent = text;
    } catch (error) { if (!signal.aborted) box.textContent = error.message; }
    await pause(3, signal);
  }
}

async function showResult(box, job, signal) {
  box.replaceChildren(cloneAll("twin-result"));
  const url = (name) => job.files.find((file) => file.name === name)?.url;
  const read = (name) => getJson(url(name), { signal });
  const downloads = $("#download-title", box).parentElement;
  const [bundle, rest] = [true, false].map((whole) => job.files.filter((file) => file.name.endsWith(".zip") === whole));
  listFiles($(".files", downloads), [...bundle, ...rest], downloads);
  for (const button of $$(".exports button", box)) {
    button.onclick = () => busy(button, downloads, () => makeExport(job, button.dataset.format, $(".export-state", box), signal));
  }
  for (const section of $$(".child", box)) showChildren(section, job, signal);
  const [manifest, parts, parameters] = await Promise.all(["twin.json", "parts.json", "parameters.json"].map(read));
  renderTwin(box, { manifest, parts, parameters });
  const video = $("video", box);
  video.autoplay = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (url("preview.mp4")) {
    video.src = URL.createObjectURL(await getBlob(url("preview.mp4"), { signal }));
    signal.addEventListener("abort", () => URL.revokeObjectURL(video.src), { once: true });
  } else video.hidden = true;
}

/** Ask for an export until it is made: 202 says later, 200 brings it. */
async function makeExport(job, format, state, signal) {
  try {
    for (;;) {
      const response = await request(`${job.urls.self}/exports/${format}`, { signal });
      if (response.status === 200) {
        const name = /filename="?([^";]+)/.exec(response.headers.get("Content-Disposition") ?? "")?.[1];
        save(await response.blob(), name ?? `twin.${format}`);
        return;
      }
      state.textContent = `Making ${format} …`;
      await pause(Number(response.headers.get("Retry-After")) || 1, signal);
      if (signal.aborted) return;
    }
  } finally { state.textContent = ""; }
}

// -- further kinds of job on a twin: whatever the service offers ----------------------------------------------

async function showChildren(section, twin, signal) {
  const { collection } = section.dataset;
  const path = `${twin.urls.self}/${collection}`;
  const runs = $(".runs", section);
  const show = async (job, place) => {
    const run = fill(clone("child-run"), { name: moment(job.created_at) });
    runs[place](run);
    try {
      const ended = await watch(run, job.urls.self, signal, (now) => buttons(run, now));
      if (!ended) return;
      listFiles($(".files", run), ended.files, run);
      await showReport($(".report", run), ended.files);
    } catch (error) { if (!signal.aborted) showProblem(run, error); }
  };
  onSubmit($("form", section), () => path, (job) => show(job, "prepend"));
  try {
    const { items } = await getJson(path, { signal });
    await Promise.all(items.map((job) => show(job, "append")));
  } catch (error) {
    if (!signal.aborted && !(error instanceof Problem && error.status === 404)) showProblem(section, error);
  }
}

addEventListener("hashchange", () => (location.hash.length > 1 ? openFromAddress() : markOpen()));
enter();
keepListFresh();
