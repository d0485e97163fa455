// Entry point of the sign-in page: name and password, or the token of a link, which is removed from the address at
// once.

import { post } from "./link/api.js";
import { reasonText } from "./state/reasons.js";
import { hints } from "./state/settings.js";
import { text } from "./state/texts.js";
import { fillTexts } from "./views/dom.js";

document.title = text("sign_in.title");
fillTexts(document);

const progress = /** @type {HTMLElement} */ (document.getElementById("progress"));
const hint = /** @type {HTMLElement} */ (document.getElementById("token-hint"));
const tokenForm = /** @type {HTMLFormElement} */ (document.getElementById("token-form"));
const tokenField = /** @type {HTMLInputElement} */ (document.getElementById("token"));
const passwordForm = /** @type {HTMLFormElement} */ (document.getElementById("password-form"));
const userField = /** @type {HTMLInputElement} */ (document.getElementById("user"));
const passwordField = /** @type {HTMLInputElement} */ (document.getElementById("password"));

/** @returns {Promise<boolean>} Does this server use passwords? */
async function withPassword() {
  try {
    const response = await fetch("api/sign-in", { signal: AbortSignal.timeout(4000) });
    return response.ok && (await response.json()).password === true;
  } catch {
    return false;
  }
}

/** @param {object} body */
async function signIn(body) {
  progress.textContent = text("sign_in.signing_in");
  progress.className = "";
  const answer = await post("api/sign-in", body);
  if (answer.ok) {
    if (hints.get() === "") hints.set("due");
    location.replace(location.pathname.replace(/sign-in$/, ""));
    return;
  }
  progress.textContent = text("sign_in.refused", { why: reasonText(answer.why) });
  progress.className = "problem";
  ask(passwordFirst);
}

/** @param {boolean} password */
function ask(password) {
  passwordForm.hidden = !password;
  tokenForm.hidden = hint.hidden = password;
  if (!password) {
    tokenField.focus();
  } else if (userField.value) {
    passwordField.select();
    passwordField.focus();
  } else {
    userField.focus();
  }
}

tokenForm.addEventListener("submit", (event) => {
  event.preventDefault();
  void signIn({ token: tokenField.value.trim() });
});
passwordForm.addEventListener("submit", (event) => {
  event.preventDefault();
  void signIn({ user: userField.value.trim(), password: passwordField.value });
});

const token = new URLSearchParams(location.search).get("token") ?? "";
history.replaceState(null, "", location.pathname);
const passwordFirst = await withPassword();
if (token) {
  await signIn({ token });
} else {
  progress.textContent = passwordFirst ? "" : text("sign_in.how");
  ask(passwordFirst);
}
