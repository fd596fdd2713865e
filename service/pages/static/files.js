// Files of a job: download buttons, and reports shown in place.

import { getBlob } from "./api.js";
import { $, bytes, clone, element, fill, save, showProblem } from "./dom.js";

/** A download button per file. */
export function listFiles(list, files, root) {
  list.replaceChildren(...files.map((file) => {
    const item = fill(clone("file-row"), { facts: bytes(file.bytes) });
    const button = $("button", item);
    button.textContent = file.name;
    button.title = `sha256 ${file.sha256}`;
    button.onclick = () => busy(button, root, async () => save(await getBlob(file.url), file.name));
    return item;
  }));
}

/** Run something a button started: the button rests meanwhile, what goes wrong is told in `root`. */
export async function busy(button, root, work) {
  button.disabled = true;
  showProblem(root, null);
  try { await work(); } catch (error) { showProblem(root, error); }
  button.disabled = false;
}

/**
 * Show the report of a job, if it has one: `*.html` in a shadow of its own with its own style, else its images.
 * A report's scripts, frames and forms are left out; the page's Content-Security-Policy holds for it besides.
 */
export async function showReport(box, files) {
  const report = files.find((file) => file.name.endsWith(".html"));
  if (report) {
    box.replaceChildren(shadowOf(await (await getBlob(report.url)).text()));
    return;
  }
  const images = files.filter((file) => /\.(png|jpe?g|webp)$/.test(file.name));
  box.replaceChildren(...await Promise.all(images.map(async (file) =>
    element("img", { src: URL.createObjectURL(await getBlob(file.url)), alt: file.name }))));
}

/** The page forbids styles written into markup; the script may set the very same ones. */
function shadowOf(html) {
  const rules = [];
  const bare = html
    .replaceAll(/<style[^>]*>([\s\S]*?)<\/style>/gi, (_, text) => { rules.push(text); return ""; })
    .replaceAll(/<[a-z][^>]*>/gi, (tag) => tag.replaceAll(/\s(style|on\w+)\s*=/gi, " data-$1="));
  const parsed = new DOMParser().parseFromString(bare, "text/html");
  for (const node of parsed.querySelectorAll("script, iframe, frame, object, embed, link, meta, base, form")) node.remove();
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(rules.join("\n").replaceAll(/(^|[\s,}])(:root|html|body)(?![\w-])/g, "$1:host"));
  const host = element("div");
  const shadow = host.attachShadow({ mode: "open" });
  shadow.adoptedStyleSheets = [sheet];
  shadow.append(...document.importNode(parsed.body, true).childNodes);
  for (const node of shadow.querySelectorAll("[data-style]")) node.style.cssText = node.dataset.style;
  return host;
}
