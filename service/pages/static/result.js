// What a finished twin is: preview, parts, parameters, warnings, where it came from.

import { $, clone, element, fill, number, unit, words } from "./dom.js";

const SHOWN_MATERIALS = 3;

/** Fill the tables of `root` from the twin's own files. */
export function renderTwin(root, { manifest, parts, parameters }) {
  renderWarnings($(".warnings", root), manifest);
  $(".parts", root).append(...parts.map(part));
  $(".parameters tbody", root).append(...Object.entries(parameters).map(parameter));
  $(".origin", root).append(...definitions(origin(manifest)));
  $(".methods tbody", root).append(...(manifest.stages ?? []).map((stage) =>
    row(words(stage.name), stage.method, stage.version, stage.weights?.slice(0, 12) ?? "none")));
  spark($(".spark", root), manifest.metrics?.silhouette_iou_per_frame);
}

const row = (...texts) => element("tr", {}, ...texts.map((text, i) => element(i ? "td" : "th", { text: String(text ?? ""), ...(i ? {} : { scope: "row" }) })));
const definitions = (pairs) => pairs.filter(([, text]) => text).flatMap(([name, text]) => [element("dt", { text: name }), element("dd", { text: String(text) })]);
const parameter = ([name, entry]) => row(words(name), number(entry.value), entry.std == null ? "" : number(entry.std), unit(entry.unit), entry.source);

function renderWarnings(box, manifest) {
  const found = [...new Set([...(manifest.warnings ?? []), ...(manifest.stages ?? []).flatMap((stage) => stage.warnings ?? [])])];
  // The manifest repeats the stages' warnings with the stage's name before them.
  const told = found.filter((one) => !found.some((other) => other !== one && other.endsWith(`: ${one}`)));
  $("ul", box).append(...told.map((text) => element("li", { text })));
  box.hidden = !told.length;
}

function part(record) {
  const card = fill(clone("part-card"), { name: String(record.label) });
  const image = $("img", card);
  if (record.overlay) {
    image.src = `data:image/png;base64,${record.overlay}`;
    image.alt = `${record.label}, highlighted on the keyframe`;
    image.hidden = false;
  }
  const { stiffness: k, size } = record;
  $("dl", card).append(...definitions([
    ["Stiffness", k && k.mean != null && `${number(k.mean)} ± ${number(k.std)} N/m`],
    ["Range", k && k.minimum != null && `${number(k.minimum)} to ${number(k.maximum)} N/m, ${k.springs} springs`],
    ["Mass", size?.mass != null && `${number(1000 * size.mass)} g`],
    ["Size", size?.extent && `${size.extent.map((side) => number(100 * side)).join(" × ")} cm`],
    ["Points", size?.points],
  ]));
  const likely = Object.entries(record.materials ?? {}).sort((a, b) => b[1] - a[1]).slice(0, SHOWN_MATERIALS);
  $(".materials", card).append(...likely.map(([name, share]) => element("li", {},
    element("span", { text: name }),
    element("meter", { min: 0, max: 1, value: share, "aria-hidden": "true" }),
    element("span", { text: `${Math.round(100 * share)} %` }))));
  const priors = Object.entries(record.prior ?? {});
  $(".priors tbody", card).append(...priors.map(([name, belief]) =>
    row(words(name), number(belief.mean), `× ${number(Math.exp(belief.spread))}`, unit(belief.unit))));
  $("details", card).hidden = !priors.length;
  return card;
}

function origin({ source = {}, version, metrics = {} }) {
  const percent = (share) => share != null && `${Math.round(100 * share)} %`;
  return [
    ["Clip", source.frames && `${source.frames} frames at ${number(source.fps)} per second, ${source.width} × ${source.height} px, reconstructed from frame ${source.keyframe}`],
    ["Scale", source.scale],
    ["Gravity", source.gravity],
    ["Ground", source.ground],
    ["Camera", source.camera?.source !== source.gravity && source.camera?.source],
    ["Outline on the keyframe", percent(metrics.keyframe_iou) && `${percent(metrics.keyframe_iou)} of the mask (intersection over union)`],
    ["Version", version],
  ];
}

function spark(figure, shares) {
  if (!Array.isArray(shares) || shares.length < 2) return;
  const height = (share) => 57 - 54 * share;
  const points = shares.map((share, i) => `${(300 * i) / (shares.length - 1)},${height(share)}`).join(" ");
  const shape = (name, attributes) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    return node;
  };
  const grid = [0, 0.5, 1].map((share) => shape("line", { x1: 0, x2: 300, y1: height(share), y2: height(share) }));
  $("svg", figure).append(...grid, shape("polyline", { points }));
  const mean = shares.reduce((sum, share) => sum + share, 0) / shares.length;
  const text = `How much of the object's outline the twin covers, frame by frame: mean ${Math.round(100 * mean)} %, at the end ${Math.round(100 * shares.at(-1))} %`;
  $("svg", figure).setAttribute("aria-label", text);
  $("figcaption", figure).textContent = `${text}. Measured against the masks that were found, not against the truth.`;
  figure.hidden = false;
}
