// Talks to the API: the key travels in a header, errors arrive as problems, events through fetch.

const KEY = "matphys.key";
const LONGEST_PAUSE = 30; // between two attempts [s]

export const storedKey = () => sessionStorage.getItem(KEY) ?? "";
export const storeKey = (key) => (key ? sessionStorage.setItem(KEY, key) : sessionStorage.removeItem(KEY));

/** What the service refused, and why (RFC 9457). */
export class Problem extends Error {
  constructor(status, fields, retryAfter = 0) {
    super([fields.title, fields.detail].filter(Boolean).join(": ") || `The service answered ${status}.`);
    Object.assign(this, { status, fields, retryAfter });
  }
}

export const pause = (seconds, signal) =>
  new Promise((resolve) => {
    const timer = setTimeout(resolve, 1000 * seconds);
    signal?.addEventListener("abort", () => (clearTimeout(timer), resolve()), { once: true });
  });

const authorization = () => ({ Authorization: `Bearer ${storedKey()}` });

/** One request; throws a Problem for everything that is no success. */
export async function request(path, { method = "GET", headers = {}, signal, body } = {}) {
  let response;
  try {
    response = await fetch(path, {
      method, signal, body, headers: { ...authorization(), ...headers }, cache: "no-store",
    });
  } catch (error) {
    if (signal?.aborted) throw error;
    throw new Problem(0, { title: "The service cannot be reached", detail: "is it running, and are you online?" });
  }
  if (!response.ok) throw await problem(response);
  return response;
}

export const getJson = async (path, options) => (await request(path, options)).json();
export const getBlob = async (path, options) => (await request(path, options)).blob();

const seconds = (header) => Math.min(Math.max(Number(header) || 1, 0.2), LONGEST_PAUSE);

async function problem(response) {
  const fields = await response.json().catch(() => ({}));
  return new Problem(response.status, fields, seconds(response.headers.get("Retry-After")));
}

/** Post a form; XMLHttpRequest, since fetch does not tell how far an upload is. */
export function upload(path, { body, headers = {}, onProgress = () => {} }) {
  return new Promise((resolve, reject) => {
    const call = new XMLHttpRequest();
    call.open("POST", path);
    for (const [name, value] of Object.entries({ ...authorization(), ...headers })) call.setRequestHeader(name, value);
    call.upload.onprogress = (event) => event.lengthComputable && onProgress(event.loaded / event.total);
    call.onerror = () => reject(new Problem(0, { title: "The upload broke off", detail: "try again; nothing is made twice" }));
    call.onload = () => {
      let fields = {};
      try { fields = JSON.parse(call.responseText); } catch { /* a proxy's page: the status says enough */ }
      if (call.status >= 200 && call.status < 300) resolve(fields);
      else reject(new Problem(call.status, fields, seconds(call.getResponseHeader("Retry-After"))));
    };
    call.send(body);
  });
}

/**
 * Follow the events of a job to the end: server-sent events, resumed where they broke off.
 * Yields {id, type, data}; ends when the server closes after a final state, throws only what waiting cannot cure.
 */
export async function* follow(path, signal) {
  let last = "";
  for (let failures = 0; !signal.aborted; ) {
    try {
      const headers = { Accept: "text/event-stream", ...(last && { "Last-Event-ID": last }) };
      const response = await request(path, { headers, signal });
      for await (const event of events(response.body)) {
        failures = 0;
        last = event.id || last;
        yield event;
      }
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof Problem && error.status >= 400 && error.status < 500 && error.status !== 429) throw error;
    }
    yield { id: last, type: "broken", data: "" };
    await pause(Math.min(0.5 * 2 ** failures++, LONGEST_PAUSE), signal);
  }
}

/** The events of a stream of bytes. */
export async function* events(stream) {
  let text = "";
  const decoder = new TextDecoder();
  const reader = stream.getReader();
  try {
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      const blocks = (text + decoder.decode(part.value, { stream: true })).split(/\r?\n\r?\n/);
      text = blocks.pop();
      for (const block of blocks) {
        const event = parse(block);
        if (event.data) yield event;
      }
    }
  } finally {
    reader.cancel().catch(() => {});
  }
}

function parse(block) {
  const event = { id: "", type: "message", data: "" };
  for (const line of block.split(/\r?\n/)) {
    const [, name, value] = /^([^:]*):? ?(.*)$/.exec(line);
    if (name === "data") event.data += (event.data && "\n") + value;
    else if (name === "event") event.type = value;
    else if (name === "id") event.id = value;
  }
  return event;
}
