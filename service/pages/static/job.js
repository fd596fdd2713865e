// One job, live: its status, stages and progress, until it has ended.

import { follow, getJson, pause, Problem, request } from "./api.js";
import { $, announce, badge, duration, element, fill, moment, showProblem, words } from "./dom.js";

export const FINAL = new Set(["succeeded", "failed", "canceled"]);
const REFRESH_S = 5; // also how the page gets on where a proxy holds events back

/**
 * Show a job in `root` and keep it up to date; gives the job once it has ended, or undefined when given up.
 * Events tell the stages as they come; the job itself is asked now and then, for what events do not carry.
 */
export async function watch(root, url, signal, onChange = () => {}) {
  let job = await getJson(url, { signal });
  const stop = new AbortController();
  signal.addEventListener("abort", () => stop.abort(), { once: true });
  let wake = () => {};
  const show = (news) => {
    const before = job;
    job = { ...job, ...news };
    render(root, job);
    if (before.status !== job.status) onChange(job);
    if (before.status !== job.status || before.stage !== job.stage) announce(sentence(job));
  };
  render(root, job);
  onChange(job);
  const listening = listen($(".stages", root), job, stop.signal, show, () => wake());
  listening.catch(() => {}); // what it could not hear, the loop below asks for
  if (FINAL.has(job.status)) return job;
  while (!FINAL.has(job.status) && !signal.aborted) {
    await Promise.race([pause(REFRESH_S, signal), new Promise((resolve) => { wake = resolve; })]);
    if (signal.aborted) break;
    try {
      show(await getJson(url, { signal }));
      showProblem(root, job.error && problemOf(job));
    } catch (error) {
      if (signal.aborted) break;
      if (error instanceof Problem && [401, 403, 404, 410].includes(error.status)) { stop.abort(); throw error; }
      showProblem(root, error);
    }
  }
  return signal.aborted ? undefined : job;
}

/** Hear the events to the last one; of a job that has ended they only tell how long its stages took. */
async function listen(list, job, signal, show, wake) {
  const over = FINAL.has(job.status);
  const heard = []; // {stage, from, to}, of the newest attempt
  let known = job.status;
  let attempt;
  for await (const event of follow(job.urls.events, signal)) {
    if (event.type === "broken") continue;
    let news;
    try { news = JSON.parse(event.data); } catch { continue; }
    const { status, stage, progress, at } = news;
    if (news.attempt !== attempt) { attempt = news.attempt; heard.length = 0; }
    const last = heard.at(-1);
    if (last?.stage !== stage || FINAL.has(status)) {
      if (last) last.to = at;
      if (stage && stage !== "done" && status === "running") heard.push({ stage, from: at });
    }
    if (list) stages(list, heard, status);
    if (!over && status !== known) wake(); // the job itself carries the times, and at the end files or the error
    known = status;
    if (FINAL.has(status)) return;
    if (!over) show({ status, stage, progress, ...(status !== "queued" && { queue_position: null }) });
  }
}

const problemOf = (job) => ({ message: [job.error.title, job.error.detail].filter(Boolean).join(": ") });

function sentence(job) {
  if (job.status === "running") return job.stage ? `${words(job.stage)}, ${Math.round(job.progress)} %` : "starting";
  if (job.status === "queued") return job.queue_position ? `waiting behind ${job.queue_position} other${job.queue_position > 1 ? "s" : ""}` : "next in the queue";
  return { succeeded: "done", failed: "failed", canceled: "canceled" }[job.status];
}

function render(root, job) {
  badge(root, job.status);
  const bar = $("progress", root);
  bar.value = job.progress;
  bar.hidden = FINAL.has(job.status);
  const running = job.status === "running" && job.started_at ? ` · ${duration(job.started_at)}` : "";
  fill(root, { now: FINAL.has(job.status) ? "" : sentence(job) + running, facts: facts(job) });
  for (const name of ["cancel", "delete"]) {
    const button = $(`.${name}`, root);
    if (button) button.hidden = (name === "cancel") === FINAL.has(job.status);
  }
  if (job.error) showProblem(root, problemOf(job));
}

function facts(job) {
  const made = job.completed_at && job.started_at ? `, took ${duration(job.started_at, job.completed_at)}` : "";
  const gone = job.expires_at ? ` · kept until ${moment(job.expires_at)}` : "";
  return `${moment(job.created_at)}${made}${gone} · ${job.id}`;
}

/** Stages as they were heard of; only the last one is under way. */
function stages(list, heard, status) {
  list.replaceChildren(...heard.map(({ stage, from, to }, i) => {
    const item = element("li", { text: words(stage) });
    const seconds = to && (Date.parse(to) - Date.parse(from)) / 1000;
    if (to) item.append(" ", element("small", { text: `${seconds.toFixed(seconds < 9.95 ? 1 : 0)} s` }));
    const last = i === heard.length - 1;
    if (last && status === "running") item.setAttribute("aria-current", "step");
    item.classList.toggle("broken", last && ["failed", "canceled"].includes(status));
    return item;
  }));
}

/** The buttons of a job; `onGone` is called once it is deleted. */
export function buttons(root, job, onGone) {
  const act = (selector, method, path, then) => {
    const button = $(selector, root);
    button.onclick = async () => {
      button.disabled = true;
      try { await request(path, { method }); then?.(); } catch (error) { showProblem(root, error); }
      button.disabled = false;
    };
  };
  act(".cancel", "POST", job.urls.cancel ?? `${job.urls.self}/cancel`);
  if ($(".delete", root)) act(".delete", "DELETE", job.urls.self, onGone);
}
