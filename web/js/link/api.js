// REST requests. Every refusal is shown and logged.

import { link, say, showToast } from "../state/page-state.js";
import { reason, reasonText } from "../state/reasons.js";
import { text } from "../state/texts.js";

/** @typedef {import("../state/reasons.js").Reason} Reason */

/**
 * `status` is 0 if the server was not reached; `why` may be what an accepted request does; `link` and the rows of `qr`
 * answer an invitation.
 *
 * @typedef {{ ok: boolean, why: Reason|null, status: number, link?: string, qr?: readonly string[] }} Answer
 */

/**
 * @param {string} path
 * @param {object} [body]
 * @param {number} [timeoutMs]
 * @returns {Promise<Answer>}
 */
export async function post(path, body = {}, timeoutMs = 4000) {
  /** @type {Response} */
  let response;
  try {
    response = await fetch(path, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
      credentials: "same-origin",
      signal: AbortSignal.timeout(timeoutMs),
    });
  } catch {
    return { ok: false, why: reason("server_unreachable"), status: 0 };
  }
  if (response.status === 401) link.set({ status: "signed-out", attempts: 0 });
  return { ...(await answerOf(response)), status: response.status };
}

/**
 * Post a request and show a refusal.
 *
 * @param {string} what Name of the request, for the message.
 * @param {string} path
 * @param {object} [body]
 * @returns {Promise<boolean>} Was it accepted?
 */
export async function ask(what, path, body) {
  const answer = await post(path, body);
  if (answer.ok) return true;
  const words = text("refused", { what, why: reasonText(answer.why) });
  // Refusals (409) and timeouts (503) of the controller reach the log through the server; others are logged here.
  if (answer.status === 409) showToast("warning", words);
  else if (answer.status === 503) showToast("error", words);
  else say("error", words);
  return false;
}

/**
 * @param {string} path
 * @returns {Promise<any>} Null without an answer.
 */
export async function fetchJson(path) {
  try {
    const response = await fetch(path, { credentials: "same-origin", signal: AbortSignal.timeout(4000) });
    return response.ok ? await response.json() : null;
  } catch {
    return null;
  }
}

/** Is this browser signed in? Null when the server cannot be reached. */
export async function isSignedIn() {
  try {
    const response = await fetch("api/me", { credentials: "same-origin", signal: AbortSignal.timeout(4000) });
    if (response.status === 401) return false;
    return response.ok ? true : null;
  } catch {
    return null;
  }
}

/**
 * @param {Response} response
 * @returns {Promise<Pick<Answer, "ok"|"why"|"link"|"qr">>}
 */
async function answerOf(response) {
  /** @type {any} */
  let body = null;
  try {
    body = await response.json();
  } catch {
    // Not JSON: the status has to do.
  }
  const why = reasonIn(body);
  if (!response.ok) return { ok: false, why: why ?? reason("server_answered", { status: response.status }) };
  return { ok: body?.ok !== false, why, link: body?.link, qr: body?.qr };
}

/**
 * The reason in an answer; null without one.
 *
 * @param {any} body
 * @returns {Reason|null}
 */
export function reasonIn(body) {
  if (typeof body?.code === "string") return reasonOf(body);
  return body?.reason ? reason("said", { text: String(body.reason) }) : null;
}

/**
 * A reason whose values an answer has by name.
 *
 * @param {{code: string, values: Record<string, any>}} body
 * @returns {Reason}
 */
function reasonOf({ code, values }) {
  const plain = Object.entries(values ?? {}).map(([name, value]) => [name, value?.code ? reasonOf(value) : value]);
  return { code, values: /** @type {[string, string|number][]} */ (plain) };
}
