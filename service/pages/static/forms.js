// Forms that start a job: what is filled in goes along, what is left alone is the service's to choose.

import { Problem, upload } from "./api.js";
import { $, $$, announce, showProblem } from "./dom.js";

const random = () => Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");

/** What the form carries, without fields that are empty. */
export function content(form) {
  const body = new FormData();
  // Options go before files, so that a wrong one is refused before the bytes are read.
  for (const field of $$("input:not([type=file]), select", form)) if (field.value) body.append(field.name, field.value);
  for (const field of $$("input[type=file]", form)) if (field.files[0]) body.append(field.name, field.files[0]);
  return body;
}

/**
 * Post the form when it is submitted, and give the job to `then`.
 * A failed upload may be repeated: the same content goes with the same idempotency key, so nothing is made twice.
 */
export function onSubmit(form, path, then) {
  let key = random();
  form.addEventListener("input", () => { key = random(); });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    showProblem(form, null);
    if (!form.checkValidity()) {
      const wrong = $(":invalid:not(fieldset)", form);
      const label = $(`label[for="${wrong.id}"]`, form)?.textContent.trim() ?? wrong.name;
      for (const folded of $$("details", form)) if (folded.contains(wrong)) folded.open = true;
      wrong.focus();
      showProblem(form, { message: `${label}: ${wrong.validationMessage}` });
      return;
    }
    const button = $("button:not([type=button])", form);
    const bar = $("progress", form);
    const told = bar.getAttribute("aria-label");
    button.disabled = true;
    bar.hidden = false;
    bar.value = 0;
    announce(`${told} begins`);
    try {
      const headers = { "Idempotency-Key": key };
      const job = await upload(path(), { body: content(form), headers, onProgress: (share) => { bar.value = 100 * share; } });
      key = random();
      then(job);
    } catch (error) {
      const later = error instanceof Problem && error.retryAfter && [429, 503].includes(error.status);
      showProblem(form, later ? { message: `${error.message} Try again in ${Math.ceil(error.retryAfter)} s.` } : error);
    }
    button.disabled = false;
    bar.hidden = true;
  });
}

/** A file may be dropped on its label; drops beside it must not make the browser leave the page. */
export function acceptDrops(label, onFile) {
  const input = $("input[type=file]", label);
  for (const name of ["dragover", "drop"]) document.addEventListener(name, (event) => event.preventDefault());
  label.addEventListener("dragenter", () => label.classList.add("over"));
  label.addEventListener("dragover", () => label.classList.add("over"));
  label.addEventListener("dragleave", () => label.classList.remove("over"));
  label.addEventListener("drop", (event) => {
    label.classList.remove("over");
    if (!event.dataTransfer.files.length) return;
    input.files = event.dataTransfer.files;
    input.dispatchEvent(new Event("input", { bubbles: true }));
    input.dispatchEvent(new Event("change", { bubbles: true }));
  });
  input.addEventListener("change", () => onFile(input.files[0]));
}
